//! From a state to readings, their stamps and the names in them.
//!
//! The context's motion is the true one at the instant of the stamp, in common time. A robot's clock that
//! is ahead by `e` stamps a reading `e` too late, so a reading is of the state `latency + e` before its stamp.

use std::f64::consts::{PI, TAU};

use crate::context::Context;
use crate::model::RobotModel;
use crate::pose::Pose;
use crate::scalar::Scalar;
use crate::signal::{
    EncoderReading, GpsReading, GyroReading, HeadingReading, Identity, Noise, Sighting, SightingGeometry,
    Stamp, Target, TruthReading,
};

/// The standard deviation of a uniform distribution over one tick, in ticks: `1/sqrt(12)`.
const TICK_SIGMA: f64 = 0.288_675_134_594_812_9;

/// The stamp that the robot's clock gives to the context's instant, seconds.
pub fn stamp<S: Scalar>(model: &RobotModel<S>, context: &Context<S>) -> S {
    let nominal = &model.nominal;
    let rate = nominal.clock_drift_ppm * 1e-6 + 1.0;
    let mut stamp = Stamp { stamp_s: nominal.clock_offset_s + rate * context.time_s };
    model.apply(context, |effect, values| effect.clock(values, context, &mut stamp));
    stamp.stamp_s
}

/// By how much the robot's clock is ahead, seconds.
pub fn clock_error_s<S: Scalar>(model: &RobotModel<S>, context: &Context<S>) -> S {
    stamp(model, context) - context.time_s
}

/// Wheel angles as read, radians: the last tick passed. A count itself has no derivative.
pub fn encoders<S: Scalar>(model: &RobotModel<S>, context: &Context<S>) -> [S; 2] {
    let reading = encoder_reading(model, context);
    let ticks = reading.ticks_per_rev;
    if ticks > 0.0 {
        let tick_rad = S::constant(TAU) / ticks;
        reading.angle_rad.map(|angle| tick_rad * libm::floor((angle / tick_rad).value()))
    } else {
        reading.angle_rad
    }
}

fn encoder_reading<S: Scalar>(model: &RobotModel<S>, context: &Context<S>) -> EncoderReading<S> {
    let mut reading = EncoderReading {
        angle_rad: context.motion.wheel_angle_rad,
        ticks_per_rev: model.nominal.encoder_ticks_per_rev,
    };
    model.apply(context, |effect, values| effect.encoder(values, context, &mut reading));
    reading
}

/// Yaw rate as read, rad/s. `walk_rad_s` is the part of the bias that walks, kept from reading to reading;
/// the context's step is the time since the reading before.
pub fn gyro<S: Scalar>(model: &RobotModel<S>, context: &Context<S>, walk_rad_s: &mut S) -> S {
    let nominal = &model.nominal;
    let rate_rad_s = nominal.gyro_scale * context.motion.yaw_rate_rad_s + nominal.gyro_bias_rad_s;
    let mut reading = GyroReading { rate_rad_s, walk_rad_s: *walk_rad_s };
    model.apply(context, |effect, values| effect.gyro(values, context, &mut reading));
    *walk_rad_s = reading.walk_rad_s;
    reading.rate_rad_s
}

/// Position as read, metres in the map.
pub fn gps<S: Scalar>(model: &RobotModel<S>, context: &Context<S>) -> [S; 2] {
    let reading = gps_reading(model, context);
    let pose = context.motion.carried(-(reading.latency_s + clock_error_s(model, context)));
    antenna(&reading, &pose)
}

/// How GPS sees the robot: where the antenna is, how late and how wrong.
pub fn gps_reading<S: Scalar>(model: &RobotModel<S>, context: &Context<S>) -> GpsReading<S> {
    let nominal = &model.nominal;
    let mut reading = GpsReading {
        lever_m: [nominal.gps_mount_x_m, nominal.gps_mount_y_m],
        latency_s: nominal.gps_latency_s,
        error_m: [S::zero(); 2],
    };
    model.apply(context, |effect, values| effect.gps(values, context, &mut reading));
    reading
}

/// The position read with the robot at this pose, metres in the map.
pub fn antenna<S: Scalar>(reading: &GpsReading<S>, pose: &Pose<S>) -> [S; 2] {
    let [x, y] = pose.rotate(reading.lever_m);
    [pose.x_m + x + reading.error_m[0], pose.y_m + y + reading.error_m[1]]
}

/// Heading as read, radians, not wrapped.
pub fn heading<S: Scalar>(model: &RobotModel<S>, context: &Context<S>) -> S {
    let pose = context.motion.carried(-clock_error_s(model, context));
    heading_of(model, context, pose.yaw_rad)
}

/// Heading as read by a robot that has this one, radians, not wrapped.
pub fn heading_of<S: Scalar>(model: &RobotModel<S>, context: &Context<S>, heading_rad: S) -> S {
    let mut reading = HeadingReading { heading_rad };
    model.apply(context, |effect, values| effect.heading(values, context, &mut reading));
    reading.heading_rad
}

/// What the range sensor looks at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Which one.
    pub target: Target,
    /// Its place in the map at the instant of the stamp, metres.
    pub position_m: [f64; 2],
    /// Its velocity in the map, m/s; zero for a landmark.
    pub velocity_m_s: [f64; 2],
}

impl Seen {
    /// A landmark of the map.
    pub fn landmark(id: u32, position_m: [f64; 2]) -> Self {
        Self { target: Target::Landmark(id), position_m, velocity_m_s: [0.0; 2] }
    }
}

/// Range and bearing as read.
pub fn sighting<S: Scalar>(model: &RobotModel<S>, context: &Context<S>, seen: &Seen) -> Sighting<S> {
    let geometry = sighting_geometry(model, context, seen.target, seen.position_m);
    let age_s = geometry.latency_s + clock_error_s(model, context);
    let map_from_sensor = context.motion.carried(-age_s).compose(&sensor(&geometry));
    let mut target_m = geometry.target_m;
    for (coordinate, velocity) in target_m.iter_mut().zip(seen.velocity_m_s) {
        *coordinate -= age_s * velocity;
    }
    sighting_of(model, context, map_from_sensor.point_seen(target_m))
}

/// From where, when and at what the range sensor looks: `target_m` is where the map has the target, and what
/// comes back where it is.
pub fn sighting_geometry<S: Scalar>(
    model: &RobotModel<S>,
    context: &Context<S>,
    target: Target,
    target_m: [f64; 2],
) -> SightingGeometry<S> {
    let nominal = &model.nominal;
    let mut geometry = SightingGeometry {
        target,
        target_m: target_m.map(S::constant),
        lever_m: [nominal.sensor_mount_x_m, nominal.sensor_mount_y_m],
        yaw_rad: nominal.sensor_mount_yaw_rad,
        latency_s: nominal.sensor_latency_s,
    };
    model.apply(context, |effect, values| effect.sighting_geometry(values, context, &mut geometry));
    geometry
}

/// `robot_from_sensor`.
pub fn sensor<S: Scalar>(geometry: &SightingGeometry<S>) -> Pose<S> {
    Pose::new(geometry.lever_m[0], geometry.lever_m[1], geometry.yaw_rad)
}

/// Range and bearing as read of a target that is here in the frame of the sensor, metres.
pub fn sighting_of<S: Scalar>(model: &RobotModel<S>, context: &Context<S>, [x, y]: [S; 2]) -> Sighting<S> {
    let nominal = &model.nominal;
    let range = x.hypot(y);
    let mut sighting = Sighting {
        range_m: nominal.range_scale * range + nominal.range_bias_m,
        bearing_rad: y.atan2(x),
        detection_probability: nominal.detection_probability,
    };
    model.apply(context, |effect, values| effect.sighting(values, context, &mut sighting));
    sighting
}

/// The reference pose as read. Its stamps are of common time.
pub fn truth<S: Scalar>(model: &RobotModel<S>, context: &Context<S>) -> Pose<S> {
    let reading = truth_reading(model, context);
    context.motion.carried(-reading.latency_s).compose(&marker(&reading))
}

/// How the reference system sees the robot: where the marker is, and how late.
pub fn truth_reading<S: Scalar>(model: &RobotModel<S>, context: &Context<S>) -> TruthReading<S> {
    let mut reading = TruthReading { lever_m: [S::zero(); 2], yaw_rad: S::zero(), latency_s: S::zero() };
    model.apply(context, |effect, values| effect.truth(values, context, &mut reading));
    reading
}

/// `robot_from_marker`.
pub fn marker<S: Scalar>(reading: &TruthReading<S>) -> Pose<S> {
    Pose::new(reading.lever_m[0], reading.lever_m[1], reading.yaw_rad)
}

/// The name that a sighting of `target` bears, where `others` could be taken for it.
pub fn identity<S: Scalar>(
    model: &RobotModel<S>,
    context: &Context<S>,
    target: Target,
    others: &[Target],
) -> Target {
    let mut identity = Identity { target, others };
    model.apply(context, |effect, values| effect.identity(values, context, &mut identity));
    identity.target
}

/// The spread of readings; that of range and bearing for a sighting at this range and bearing.
pub fn noise<S: Scalar>(model: &RobotModel<S>, context: &Context<S>, range_m: S, bearing_rad: S) -> Noise<S> {
    let nominal = &model.nominal;
    let ticks = encoder_reading(model, context).ticks_per_rev;
    let mut noise = Noise {
        range_m,
        bearing_rad,
        encoder_sigma_rad: if ticks > 0.0 { S::constant(2.0 * PI * TICK_SIGMA) / ticks } else { S::zero() },
        command_delay_sigma_s: S::zero(),
        command_loss_probability: S::zero(),
        gyro_sigma_rad_s: nominal.gyro_sigma_rad_s,
        gyro_walk_variance: S::zero(),
        range_sigma_m: nominal.range_sigma_m,
        bearing_sigma_rad: nominal.bearing_sigma_rad,
        degrees_of_freedom: S::constant(f64::INFINITY),
        wrong_identity_probability: S::zero(),
    };
    model.apply(context, |effect, values| effect.noise(values, context, &mut noise));
    noise
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Drive, Motion, Nominal};

    fn nominal() -> Nominal<f64> {
        Nominal::ideal(0.05, 0.3)
    }

    /// Facing north at (1, 2), driving at 0.5 m/s.
    fn northward() -> Motion<f64> {
        let mut motion = Motion::at_rest(Pose::new(1.0, 2.0, PI / 2.0));
        motion.speed_m_s = 0.5;
        motion
    }

    fn close(found: [f64; 2], expected: [f64; 2]) {
        assert!((found[0] - expected[0]).hypot(found[1] - expected[1]) < 1e-12, "{found:?} {expected:?}");
    }

    #[test]
    fn gps_reads_its_antenna_as_it_was_before_its_latency() {
        let mut nominal = nominal();
        (nominal.gps_mount_x_m, nominal.gps_mount_y_m, nominal.gps_latency_s) = (0.3, 0.1, 0.2);
        let model = RobotModel::nominal(Drive::Differential, nominal);
        close(gps(&model, &Context::new(&nominal, 0.0, northward())), [0.9, 2.0 + 0.3 - 0.1]);
    }

    #[test]
    fn a_mounted_sensor_sees_a_landmark_from_where_it_sits() {
        let mut nominal = nominal();
        (nominal.sensor_mount_x_m, nominal.sensor_mount_yaw_rad) = (1.0, PI / 2.0);
        (nominal.range_bias_m, nominal.range_scale) = (0.1, 1.5);
        let model = RobotModel::nominal(Drive::Differential, nominal);
        // The sensor sits at (1, 3) and looks west; the landmark is 2 m ahead of it, then 2 m to its right.
        let context = Context::new(&nominal, 0.0, northward());
        for (landmark, bearing) in [([-1.0, 3.0], 0.0), ([1.0, 5.0], -PI / 2.0)] {
            let seen = sighting(&model, &context, &Seen::landmark(3, landmark));
            close([seen.range_m, seen.bearing_rad], [3.1, bearing]);
        }
    }

    #[test]
    fn a_clock_that_is_ahead_makes_readings_old() {
        let mut nominal = nominal();
        (nominal.clock_offset_s, nominal.clock_drift_ppm) = (0.1, 1000.0);
        let model = RobotModel::nominal(Drive::Differential, nominal);
        let context = Context::new(&nominal, 100.0, northward());
        assert!((stamp(&model, &context) - 100.2).abs() < 1e-12);
        close(gps(&model, &context), [1.0, 1.9]);
        close(truth(&model, &context).position(), [1.0, 2.0]);
    }

    #[test]
    fn encoders_read_whole_ticks() {
        let mut nominal = nominal();
        nominal.encoder_ticks_per_rev = 360.0;
        let model = RobotModel::nominal(Drive::Differential, nominal);
        let mut motion = northward();
        motion.wheel_angle_rad = [1.5_f64.to_radians(), (-1.5_f64).to_radians()];
        let context = Context::new(&nominal, 0.0, motion);
        close(encoders(&model, &context), [1.0_f64.to_radians(), (-2.0_f64).to_radians()]);
        let sigma = noise(&model, &context, 1.0, 0.0).encoder_sigma_rad;
        assert!((sigma - 1.0_f64.to_radians() / 12.0_f64.sqrt()).abs() < 1e-15);
    }
}
