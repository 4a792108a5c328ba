//! What the parameters of an effect amount to, in plain words.
//!
//! A phrase belongs to an effect and is said if the finding has every parameter in it. `{name:unit}` becomes
//! the estimate with its interval in that unit; `{name:unit|more|less}` becomes the size, with one word or the
//! other by the sign. An effect without a phrase is told by the names of its parameters.

/// Effect and phrase.
pub(super) const PHRASES: &[(&str, &str)] = &[
    (
        "unequal_wheel_radii",
        "its left and right wheels differ by {ratio:%|, the left one larger|, the left one smaller}",
    ),
    ("track_width_error", "its effective track is {relative:%|wider|narrower} than declared"),
    ("wheel_radius_error", "its wheels are {relative:%|larger|smaller} than declared"),
    ("longitudinal_slip", "it loses {slip_s:mm/s} of speed per m/s² of acceleration by slip"),
    ("lateral_skid", "it skids outwards in turns by {skid_s:mm/s} per m/s of speed and rad/s of turning"),
    ("icr_offset", "it turns about a point {offset_m:mm|ahead of|behind} the middle of its axle"),
    (
        "castor_friction",
        "after a reversal its castor turns it by {heading_kick_rad:deg}, fading over {decay_m:mm}",
    ),
    ("actuator_lag", "its motors answer {time_constant_s:ms|more slowly|faster} than declared"),
    ("command_delay", "its commands take effect {delay_s:ms|later|earlier} than declared"),
    ("clock_offset", "its clock is {offset_s:ms|ahead|behind}"),
    ("clock_drift", "its clock runs {ppm:ppm|fast|slow}"),
    ("motor_deadband", "it ignores commands below {speed_m_s:mm/s}"),
    ("motor_deadband", "its wheels ignore set-points below {wheel_rad_s:rad/s}"),
    ("stiction", "from rest it does not move on commands below {breakaway:mm/s}"),
    (
        "sticky_wheel",
        "from {t_on_s:s} on its {wheel:wheel} wheel turns {droop:rad/s|slower|faster} than it is told",
    ),
    ("speed_saturation", "its wheels turn no faster than {wheel_speed_max_rad_s:rad/s}"),
    ("acceleration_limit", "it accelerates by no more than {m_s2:m/s²}"),
    ("speed_dependent_scale", "for every m/s of speed it covers {s_per_m:%|less|more} than its wheels say"),
    ("quadratic_drag", "for every m/s of speed its motors stay {s_per_m:%|below|above} what they are told"),
    ("turn_loss", "for every rad/s of turning it covers {coefficient_s:%|less|more} than its wheels say"),
    ("payload_added", "from {t_on_s:s} on its wheels are {radius_relative:%|larger|smaller}"),
    ("payload_added", "its motors answer {lag_change_s:ms|more slowly|faster} from then on"),
    (
        "payload_offset",
        "a load to one side makes its left and right wheels differ by {ratio:%|, the left one larger|, the left one smaller}",
    ),
    ("payload_offset", "its effective track is {track_relative:%|wider|narrower}"),
    ("battery_sag", "its motors turn {gain_per_v:%|faster|slower} for every volt above the nominal supply"),
    ("battery_sag", "its motors turn {gain_per_s:%/min|faster|slower} as time passes"),
    (
        "floor_tilt",
        "the floor slopes by {slope_rad:deg}, downhill at {downhill_azimuth_rad:deg} from the x axis",
    ),
    ("low_friction_patch", "in the patch it loses {slip_s:mm/s} of speed per m/s² of acceleration"),
    (
        "low_friction_patch",
        "in the patch it skids outwards by {skid_s:mm/s} per m/s of speed and rad/s of turning",
    ),
    ("low_friction_overall", "the floor costs {slip_s:mm/s} of speed per m/s² of acceleration"),
    (
        "low_friction_overall",
        "the floor lets it skid outwards by {skid_s:mm/s} per m/s of speed and rad/s of turning",
    ),
    ("push", "at {t_on_s:s} something moved it by {jump.x:mm} in x and {jump.y:mm} in y"),
    ("push", "it was turned by {jump.yaw:deg}"),
    ("world_force", "something pushes it by {droop_m_s:mm/s}, towards {azimuth_rad:deg} from the x axis"),
    ("world_drift", "it drifts over the map by {velocity_m_s.x:mm/s} in x and {velocity_m_s.y:mm/s} in y"),
    ("encoder_coarse", "its encoders have {actual_ticks_per_rev:1} ticks per turn"),
    ("backlash", "its gears have {rad:deg} of play"),
    ("wheel_eccentricity", "its {wheel:wheel} wheel turns {offset_m:mm} out of centre"),
    ("steer_trim", "its steering is off by {rad:deg|to the left|to the right}"),
    ("understeer", "it understeers by {s2_per_m2:s²/m²}"),
    ("gyro_bias", "its gyro reads {bias_rad_s:deg/s} at rest"),
    ("gyro_scale", "its gyro reads {relative:%|too much|too little}"),
    ("gyro_random_walk", "the zero of its gyro wanders by {rad_s_sqrt_s:deg/s} in a second"),
    (
        "gyro_thermal_drift",
        "the zero of its gyro drifts by {final_bias_rad_s:deg/s} with a time constant of {time_constant_s:s}",
    ),
    (
        "compass_hard_iron",
        "iron in its body adds {body_field_fraction.forward:%} of the earth's field forwards and \
         {body_field_fraction.left:%} to the left at its compass",
    ),
    ("compass_soft_iron", "its compass errs by {amplitude_rad:deg}, twice per turn"),
    ("local_magnetic_field", "in the region its compass errs by {amplitude_rad:deg}"),
    ("sun_sensor_misalignment", "its sun sensor is turned by {rad:deg|to the left|to the right}"),
    (
        "gps_lever_arm",
        "its GPS antenna is {offset_body_m.forward:mm|ahead|behind} and {offset_body_m.left:mm|to the left|to the right} \
         of where it is declared",
    ),
    ("gps_latency", "its GPS positions are {latency_s:ms|older|newer} than declared"),
    ("gps_multipath_patch", "in the region its GPS is off by {offset_m.x:mm} in x and {offset_m.y:mm} in y"),
    (
        "sensor_lever_arm",
        "its range sensor is {offset_body_m.forward:mm|ahead|behind} and \
         {offset_body_m.left:mm|to the left|to the right} of where it is declared",
    ),
    ("sensor_yaw_misalignment", "its range sensor is turned by {yaw_rad:deg|to the left|to the right}"),
    ("range_bias", "its ranges are {bias_m:mm|too long|too short}"),
    ("range_scale", "its ranges are {relative:%|too long|too short}"),
    ("bearing_distortion", "its bearings are {c1:%|too large|too small}"),
    ("range_dependent_noise", "the noise of its ranges is {s0_m:mm|larger|smaller} than declared"),
    ("range_dependent_noise", "the noise of its ranges changes by {s1:%} of the range"),
    (
        "bearing_dependent_range_bias",
        "its ranges are off by {m_per_rad2:mm} for every squared radian of bearing",
    ),
    (
        "heavy_tails",
        "its ranges and bearings have outliers as Student's t with {degrees_of_freedom:1} degrees of freedom",
    ),
    ("landmark_identity_swap", "landmarks {ids.first:label} and {ids.second:label} are swapped"),
    ("identity_mix_up", "{probability:%} of its sightings carry the wrong name"),
    ("motion_blur", "the noise of its bearings grows by {s:deg} for every rad/s of turning"),
    ("camera_latency", "its ranges and bearings are {latency_s:ms|older|newer} than their stamps"),
    (
        "truth_marker_offset",
        "the marker of the ground truth is {offset_body_m.forward:mm|ahead|behind} and \
         {offset_body_m.left:mm|to the left|to the right} of the middle of its axle",
    ),
    (
        "truth_marker_offset",
        "the marker of the ground truth is turned by {yaw_rad:deg|to the left|to the right}",
    ),
    ("truth_latency", "the ground truth is {latency_s:ms|late|early}"),
    (
        "landmark_survey_error",
        "landmark {id:label} is {offset_m.x:mm} in x and {offset_m.y:mm} in y off its surveyed place",
    ),
    ("partner_influence", "a robot nearby pushes it away by {amplitude:mm/s}, fading over {range_m:m}"),
    ("actuator_gain", "it drives {v_relative:%|faster|slower} than commanded"),
    ("actuator_gain", "it turns {w_relative:%|faster|slower} than commanded"),
    ("crab", "driving straight it creeps sideways by {rad:deg|to the left|to the right}"),
    ("reverse_asymmetry", "backwards it covers {relative:%|more|less} than forwards"),
    ("command_loss", "{probability:%} of its commands are lost"),
    ("command_jitter", "its commands come up to {delay_s:ms} late, at random"),
    ("heading_offset", "its absolute heading is off by {rad:deg|to the left|to the right}"),
];
