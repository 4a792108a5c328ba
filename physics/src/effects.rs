//! The catalogue of effects.
//!
//! To add an effect, write its file in `effects/`, its line below, and its sizes in `typical.rs`.

mod places;

use crate::catalogue::{catalogue, dispatch, dispatch_one};
use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::EffectInfo;
use crate::scalar::Scalar;
use crate::signal::{
    BodyMotion, CommandTiming, EncoderReading, Geometry, GpsReading, GyroReading, HeadingReading, Identity,
    MapMotion, Noise, Rolling, Servo, SetPoint, Sighting, SightingGeometry, Stamp, Transmission,
    TruthReading, WheelSetPoint,
};

catalogue! {
    unequal_wheel_radii::UnequalWheelRadii;
    track_width_error::TrackWidthError;
    wheel_radius_error::WheelRadiusError;
    longitudinal_slip::LongitudinalSlip;
    lateral_skid::LateralSkid;
    icr_offset::IcrOffset;
    castor_friction::CastorFriction;
    actuator_lag::ActuatorLag;
    command_delay::CommandDelay;
    clock_offset::ClockOffset;
    clock_drift::ClockDrift;
    motor_deadband::MotorDeadband;
    stiction::Stiction;
    sticky_wheel::StickyWheel;
    speed_saturation::SpeedSaturation;
    acceleration_limit::AccelerationLimit;
    speed_dependent_scale::SpeedDependentScale;
    quadratic_drag::QuadraticDrag;
    turn_loss::TurnLoss;
    payload_added::PayloadAdded;
    payload_offset::PayloadOffset;
    battery_sag::BatterySag;
    floor_tilt::FloorTilt;
    low_friction_patch::LowFrictionPatch;
    low_friction_overall::LowFrictionOverall;
    push::Push;
    world_force::WorldForce;
    world_drift::WorldDrift;
    encoder_coarse::EncoderCoarse;
    backlash::Backlash;
    wheel_eccentricity::WheelEccentricity;
    steer_trim::SteerTrim;
    understeer::Understeer;
    gyro_bias::GyroBias;
    gyro_scale::GyroScale;
    gyro_random_walk::GyroRandomWalk;
    gyro_thermal_drift::GyroThermalDrift;
    compass_hard_iron::CompassHardIron;
    compass_soft_iron::CompassSoftIron;
    local_magnetic_field::LocalMagneticField;
    sun_sensor_misalignment::SunSensorMisalignment;
    gps_lever_arm::GpsLeverArm;
    gps_latency::GpsLatency;
    gps_multipath_patch::GpsMultipathPatch;
    sensor_lever_arm::SensorLeverArm;
    sensor_yaw_misalignment::SensorYawMisalignment;
    range_bias::RangeBias;
    range_scale::RangeScale;
    bearing_distortion::BearingDistortion;
    range_dependent_noise::RangeDependentNoise;
    bearing_dependent_range_bias::BearingDependentRangeBias;
    heavy_tails::HeavyTails;
    landmark_identity_swap::LandmarkIdentitySwap;
    identity_mix_up::IdentityMixUp;
    missed_detections::MissedDetections;
    motion_blur::MotionBlur;
    camera_latency::CameraLatency;
    truth_marker_offset::TruthMarkerOffset;
    truth_latency::TruthLatency;
    landmark_survey_error::LandmarkSurveyError;
    partner_influence::PartnerInfluence;
    actuator_gain::ActuatorGain;
    crab::Crab;
    reverse_asymmetry::ReverseAsymmetry;
    command_loss::CommandLoss;
    command_jitter::CommandJitter;
    heading_offset::HeadingOffset;
}

impl Effect {
    /// The effect of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|effect| effect.info().name == name)
    }

    /// Whether what it does to the motion of the body, or to the gyro, depends on where the robot is or where it
    /// heads: without such an effect nobody need know the pose in the middle of a step.
    pub(crate) const fn places_body(self) -> bool {
        matches!(self, Self::LowFrictionPatch | Self::PartnerInfluence)
    }

    /// The name in findings, scenarios and model files.
    pub const fn name(self) -> &'static str {
        self.info().name
    }
}
