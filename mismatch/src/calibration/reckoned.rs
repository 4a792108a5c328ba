//! Odometry integrated under a model, as an agent does it.

use pleiad_estimation::Timestamp;
use pleiad_estimation::sample::{Reading, Sample};
use pleiad_physics::correct::{Correction, OdometryCorrection, OdometryReading};
use pleiad_physics::{Drive, Nominal, Pose, RobotModel};

/// Where odometry has the robot at one of its samples, in the frame of its beginning.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reckoned {
    pub(super) time: Timestamp,
    /// The yaw is not wrapped.
    pub(super) pose: Pose<f64>,
    /// Distance driven, forwards and backwards, metres.
    pub(super) path_m: f64,
}

/// Integrates odometry under a model of the robot. Velocities and increments were made of wheel angles by the
/// geometry that the model declares.
pub(super) fn reckon(odometry: &[Sample], model: &RobotModel<f64>) -> Vec<Reckoned> {
    let ratio = if let Drive::SkidSteer { track_ratio } = model.drive { track_ratio } else { 1.0 };
    let nominal = &model.nominal;
    let believed = Nominal::ideal(nominal.wheel_radius, nominal.track_width * ratio);
    let correction = Correction::new(model.clone(), believed);
    let mut state = OdometryCorrection::default();
    let mut path = Vec::with_capacity(odometry.len());
    for sample in odometry {
        let Some(reading) = reading(&sample.reading) else { continue };
        let time_s = sample.time.seconds();
        let Some(&Reckoned { time: _, pose, path_m }) = path.last() else {
            state.restart(&correction, time_s, reading);
            let here = Pose::identity();
            path.push(Reckoned { time: sample.time, pose: here, path_m: 0.0 });
            continue;
        };
        let moved = state.step(&correction, pose, time_s, reading);
        path.push(Reckoned {
            time: sample.time,
            pose: pose.compose(&moved),
            path_m: path_m + moved.x_m.hypot(moved.y_m),
        });
    }
    path
}

fn reading(reading: &Reading) -> Option<OdometryReading> {
    Some(match *reading {
        Reading::Wheels { left_rad, right_rad } => OdometryReading::Wheels([left_rad, right_rad]),
        Reading::Velocity { forward_m_s, yaw_rate_rad_s } => {
            OdometryReading::Measured { speed_m_s: forward_m_s, yaw_rate_rad_s }
        }
        Reading::Increment(increment) => {
            let motion = increment.log();
            OdometryReading::Motion([motion.x, motion.y, motion.z])
        }
        _ => return None,
    })
}
