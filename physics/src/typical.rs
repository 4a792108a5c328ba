//! The typical size of every parameter: one number each, fixed before any result is looked at.
//!
//! Experiments inject these sizes and power is stated for them. They lie within the ranges that the
//! catalogue gives for real robots; see `docs/effects.md`.

use crate::effects::Effect;

/// Effect, parameter, size in the parameter's unit.
const TYPICAL: &[(&str, &str, f64)] = &[
    ("unequal_wheel_radii", "ratio", 0.01),
    ("track_width_error", "relative", 0.03),
    ("wheel_radius_error", "relative", 0.01),
    ("longitudinal_slip", "slip_s", 0.02),
    ("lateral_skid", "skid_s", 0.03),
    ("icr_offset", "offset_m", 0.03),
    ("castor_friction", "heading_kick_rad", 0.05),
    ("castor_friction", "decay_m", 0.03),
    ("actuator_lag", "time_constant_s", 0.1),
    ("command_delay", "delay_s", 0.08),
    ("clock_offset", "offset_s", 0.05),
    ("clock_drift", "ppm", 100.0),
    ("motor_deadband", "speed_m_s", 0.03),
    ("motor_deadband", "wheel_rad_s", 0.5),
    ("stiction", "breakaway", 0.05),
    ("sticky_wheel", "wheel", 1.0),
    ("sticky_wheel", "t_on_s", 1.0),
    ("sticky_wheel", "droop", 0.3),
    ("speed_saturation", "wheel_speed_max_rad_s", 6.0),
    ("acceleration_limit", "m_s2", 1.0),
    ("speed_dependent_scale", "s_per_m", 0.03),
    ("quadratic_drag", "s_per_m", 0.03),
    ("turn_loss", "coefficient_s", 0.02),
    ("payload_added", "t_on_s", 1.0),
    ("payload_added", "radius_relative", -0.005),
    ("payload_added", "lag_change_s", 0.02),
    ("payload_offset", "ratio", 0.005),
    ("payload_offset", "track_relative", 0.01),
    ("battery_sag", "gain_per_v", 0.05),
    ("battery_sag", "gain_per_s", -5e-4),
    ("floor_tilt", "slope_rad", 0.035),
    ("floor_tilt", "downhill_azimuth_rad", 0.7),
    ("low_friction_patch", "region_m.x_min", -0.5),
    ("low_friction_patch", "region_m.x_max", 0.5),
    ("low_friction_patch", "region_m.y_min", -0.5),
    ("low_friction_patch", "region_m.y_max", 0.5),
    ("low_friction_patch", "slip_s", 0.05),
    ("low_friction_patch", "skid_s", 0.1),
    ("low_friction_overall", "slip_s", 0.03),
    ("low_friction_overall", "skid_s", 0.05),
    ("push", "t_on_s", 1.0),
    ("push", "jump.x", 0.1),
    ("push", "jump.y", 0.05),
    ("push", "jump.yaw", 0.1),
    ("world_force", "droop_m_s", 0.01),
    ("world_force", "azimuth_rad", 0.7),
    ("world_drift", "velocity_m_s.x", 0.05),
    ("world_drift", "velocity_m_s.y", -0.03),
    ("encoder_coarse", "actual_ticks_per_rev", 64.0),
    ("backlash", "rad", 0.03),
    ("wheel_eccentricity", "wheel", 0.0),
    ("wheel_eccentricity", "offset_m", 0.002),
    ("wheel_eccentricity", "phase_rad", 0.5),
    ("steer_trim", "rad", 0.01),
    ("understeer", "s2_per_m2", 0.05),
    ("gyro_bias", "bias_rad_s", 0.003),
    ("gyro_scale", "relative", 0.01),
    ("gyro_random_walk", "rad_s_sqrt_s", 5e-4),
    ("gyro_thermal_drift", "final_bias_rad_s", 0.005),
    ("gyro_thermal_drift", "time_constant_s", 60.0),
    ("compass_hard_iron", "body_field_fraction.forward", 0.06),
    ("compass_hard_iron", "body_field_fraction.left", -0.04),
    ("compass_soft_iron", "amplitude_rad", 0.05),
    ("compass_soft_iron", "phase_rad", 0.4),
    ("local_magnetic_field", "region_m.x_min", -0.5),
    ("local_magnetic_field", "region_m.x_max", 0.5),
    ("local_magnetic_field", "region_m.y_min", -0.5),
    ("local_magnetic_field", "region_m.y_max", 0.5),
    ("local_magnetic_field", "amplitude_rad", 0.2),
    ("sun_sensor_misalignment", "rad", 0.03),
    ("gps_lever_arm", "offset_body_m.forward", 0.2),
    ("gps_lever_arm", "offset_body_m.left", -0.1),
    ("gps_latency", "latency_s", 0.15),
    ("gps_multipath_patch", "region_m.x_min", -0.5),
    ("gps_multipath_patch", "region_m.x_max", 0.5),
    ("gps_multipath_patch", "region_m.y_min", -0.5),
    ("gps_multipath_patch", "region_m.y_max", 0.5),
    ("gps_multipath_patch", "offset_m.x", 0.5),
    ("gps_multipath_patch", "offset_m.y", -0.3),
    ("sensor_lever_arm", "offset_body_m.forward", 0.1),
    ("sensor_lever_arm", "offset_body_m.left", 0.05),
    ("sensor_yaw_misalignment", "yaw_rad", 0.04),
    ("range_bias", "bias_m", 0.05),
    ("range_scale", "relative", 0.02),
    ("bearing_distortion", "c1", 0.03),
    ("bearing_distortion", "c3", 0.05),
    ("range_dependent_noise", "s0_m", 0.02),
    ("range_dependent_noise", "s1", 0.01),
    ("range_dependent_noise", "s2_per_m", 0.005),
    ("bearing_dependent_range_bias", "m_per_rad2", 0.05),
    ("heavy_tails", "degrees_of_freedom", 3.0),
    ("landmark_identity_swap", "ids.first", 1.0),
    ("landmark_identity_swap", "ids.second", 2.0),
    ("identity_mix_up", "probability", 0.02),
    ("missed_detections", "logit.constant", 0.5),
    ("missed_detections", "logit.range", 0.4),
    ("missed_detections", "logit.bearing_squared", 1.0),
    ("motion_blur", "s", 0.02),
    ("camera_latency", "latency_s", 0.05),
    ("truth_marker_offset", "offset_body_m.forward", 0.03),
    ("truth_marker_offset", "offset_body_m.left", 0.02),
    ("truth_marker_offset", "yaw_rad", 0.02),
    ("truth_latency", "latency_s", 0.02),
    ("landmark_survey_error", "id", 1.0),
    ("landmark_survey_error", "offset_m.x", 0.05),
    ("landmark_survey_error", "offset_m.y", -0.03),
    ("partner_influence", "amplitude", 0.05),
    ("partner_influence", "range_m", 1.0),
    ("actuator_gain", "v_relative", 0.03),
    ("actuator_gain", "w_relative", -0.04),
    ("crab", "rad", 0.01),
    ("reverse_asymmetry", "relative", 0.01),
    ("command_loss", "probability", 0.05),
    ("command_jitter", "delay_s", 0.02),
    ("heading_offset", "rad", 0.1),
];

impl Effect {
    /// The typical sizes, in the order of the parameters. A size that is missing from the table is `NaN`,
    /// which no model takes.
    pub fn typical_values(self) -> Vec<f64> {
        let info = self.info();
        let size = |label: &str| TYPICAL.iter().find(|row| row.0 == info.name && row.1 == label);
        let parameters = info.parameters.iter();
        parameters.map(|parameter| size(&parameter.label()).map_or(f64::NAN, |row| row.2)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_has_one_size_and_every_size_a_parameter() {
        let labels = |effect: &Effect| {
            let info = effect.info();
            info.parameters.iter().map(|parameter| (info.name, parameter.label())).collect::<Vec<_>>()
        };
        let expected: Vec<_> = Effect::ALL.iter().flat_map(labels).collect();
        let found: Vec<_> = TYPICAL.iter().map(|row| (row.0, row.1.to_owned())).collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn sizes_are_plausible_and_relevant() {
        let floors = crate::Floors { servo_time_constant_s: 0.1, ..crate::Floors::default() };
        for effect in Effect::ALL {
            for (parameter, size) in effect.info().parameters.iter().zip(effect.typical_values()) {
                let (least, greatest) = parameter.plausible;
                let name = format!("{}: {}", effect.name(), parameter.label());
                assert!((least..=greatest).contains(&size), "{name} = {size}");
                assert!(size.abs() >= parameter.relevance.threshold(&floors), "{name} = {size}");
            }
        }
    }
}
