//! Readings, predicted from the true motion (or, without truth, from the filter's).

use crate::chain::sensors::{self, Seen};
use crate::context::{Context, Motion, Surroundings};
use crate::model::RobotModel;
use crate::pose::Pose;
use crate::scalar::Scalar;
use crate::signal::Sighting;

/// The stamp of a reading, and the motion then: the sample nearest in time, carried there by the encoders.
#[derive(Clone, Copy, Debug)]
pub struct Instant {
    /// Seconds.
    pub time_s: f64,
    /// Pose in the map and velocity.
    pub motion: Motion<f64>,
    /// Neighbours.
    pub surroundings: Surroundings,
}

impl Instant {
    fn context<'a, S: Scalar>(&self, model: &'a RobotModel<S>) -> Context<'a, S> {
        Context {
            surroundings: self.surroundings,
            ..Context::new(&model.nominal, self.time_s, self.motion.lift())
        }
    }
}

/// Position, metres in the map.
pub fn gps<S: Scalar>(model: &RobotModel<S>, instant: &Instant) -> [S; 2] {
    sensors::gps(model, &instant.context(model))
}

/// Heading, radians, not wrapped.
pub fn heading<S: Scalar>(model: &RobotModel<S>, instant: &Instant) -> S {
    sensors::heading(model, &instant.context(model))
}

/// Range and bearing.
pub fn sighting<S: Scalar>(model: &RobotModel<S>, instant: &Instant, seen: &Seen) -> Sighting<S> {
    sensors::sighting(model, &instant.context(model), seen)
}

/// The reference pose.
pub fn truth<S: Scalar>(model: &RobotModel<S>, instant: &Instant) -> Pose<S> {
    sensors::truth(model, &instant.context(model))
}
