//! Readings as a nominal robot would have given them: what an estimator folds that is told of effects.
//!
//! A model says how readings come about; the estimator takes them for those of a nominal robot. What lies
//! between is taken out here: odometry becomes the motion of the body ([`OdometryCorrection`]), a reading
//! `z` becomes `z - (h_model(x) - h_nominal(x))`. Where `x` follows from the reading itself (a heading, a
//! sighting, a yaw rate), the equation is solved for it; elsewhere the caller's estimate of the pose stands
//! in. Time is corrected in stamps, not in values: a clock that is ahead and a sensor that is late make
//! readings of an earlier instant, and that instant is known, while the motion of a robot that was seen
//! since is not.

mod odometry;
mod sensors;
mod solve;

pub use odometry::{OdometryCorrection, OdometryReading};
pub use sensors::Polar;

use crate::chain::sensors::clock_error_s;
use crate::context::{Context, Motion};
use crate::effects::Effect;
use crate::info::Stage;
use crate::model::{ActiveEffect, Drive, RobotModel};
use crate::nominal::Nominal;
use crate::pose::Pose;

/// Rounds of a fixed point at most. Effects of real robots contract by 0.3 or better per round, so that
/// twenty give full precision.
const MOST_ROUNDS: u32 = 100;
/// A fixed point has been reached when it moves by less than this: radians, metres, rad/s.
const STILL: f64 = 1e-13;

/// Where and when a reading is corrected: the estimator's pose `map_from_robot` at that instant.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Common time, seconds.
    pub time_s: f64,
    /// The estimate.
    pub pose: Pose<f64>,
}

/// A model of a robot against what the estimator believes of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Correction {
    /// The model as given.
    given: RobotModel<f64>,
    /// The model with a perfect clock: stamps are corrected before readings.
    model: RobotModel<f64>,
    /// The model without the mount of the range sensor.
    unmounted: RobotModel<f64>,
    /// What the estimator believes.
    nominal: RobotModel<f64>,
}

impl Correction {
    /// From a model, and the robot that the estimator believes in. Stamps it takes at their word, so that
    /// latencies and the clock of `nominal` are not looked at; its track width is the effective one.
    pub fn new(model: RobotModel<f64>, nominal: Nominal<f64>) -> Self {
        let given = model.clone();
        let mut model = model;
        (model.nominal.clock_offset_s, model.nominal.clock_drift_ppm) = (0.0, 0.0);
        model.effects.retain(|active| active.effect().info().stage != Stage::Clock);
        let mut unmounted = model.clone();
        (unmounted.nominal.sensor_mount_x_m, unmounted.nominal.sensor_mount_y_m) = (0.0, 0.0);
        unmounted.effects.retain(|active| active.effect() != Effect::SensorLeverArm);
        let nominal = RobotModel::nominal(Drive::Differential, nominal);
        Self { given, model, unmounted, nominal }
    }

    /// The model as it was given.
    pub fn given(&self) -> &RobotModel<f64> {
        &self.given
    }

    /// By how much the robot's clock is ahead when it shows `stamp_s`, seconds: to be subtracted from every
    /// stamp.
    pub fn clock_error_s(&self, stamp_s: f64) -> f64 {
        let mut error_s = 0.0;
        for _ in 0..MOST_ROUNDS {
            let motion = Motion::at_rest(Pose::identity());
            let next_s =
                clock_error_s(&self.given, &Context::new(&self.given.nominal, stamp_s - error_s, motion));
            let moved_s = (next_s - error_s).abs();
            error_s = next_s;
            if moved_s < STILL {
                break;
            }
        }
        error_s
    }

    /// Effects of the model that cannot be taken out, each with the reason.
    pub fn not_corrected(&self) -> Vec<(Effect, &'static str)> {
        let effects = self.given.effects.iter().map(ActiveEffect::effect);
        effects.filter_map(|effect| Some((effect, limit(effect)?))).collect()
    }
}

impl Place {
    /// At rest: readings are corrected at the instant they are of, so that nothing has to be carried.
    fn context<'a>(&self, model: &'a RobotModel<f64>) -> Context<'a, f64> {
        Context::new(&model.nominal, self.time_s, Motion::at_rest(self.pose))
    }
}

/// Why an effect cannot be taken out of readings; `None` if it can.
pub const fn limit(effect: Effect) -> Option<&'static str> {
    match effect {
        Effect::GyroRandomWalk | Effect::RangeDependentNoise | Effect::HeavyTails | Effect::MotionBlur => {
            Some("it acts on the spread of readings: give the sensor that noise")
        }
        Effect::MissedDetections => Some("what was not reported cannot be restored"),
        Effect::IdentityMixUp => Some("which names are wrong is not known"),
        Effect::CommandLoss => Some("which commands were lost is not known"),
        Effect::EncoderCoarse => Some("an angle that was rounded cannot be restored"),
        Effect::TruthMarkerOffset | Effect::TruthLatency => {
            Some("it acts on the reference, which no estimator sees")
        }
        Effect::PartnerInfluence => Some("where the partner is, an agent is not told in time"),
        _ => None,
    }
}
