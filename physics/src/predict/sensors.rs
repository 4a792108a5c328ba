//! Readings, predicted from the true motion (or, without truth, from the filter's).

use crate::chain::sensors::{self, Seen};
use crate::context::{Context, Motion, Surroundings};
use crate::model::RobotModel;
use crate::pose::Pose;
use crate::scalar::Scalar;
use crate::signal::{Sighting, TruthReading};

/// Where a robot's wheels took it, for any stamp.
pub trait Path {
    /// Pose and velocity at this stamp of the robot's clock, in a frame of the path's own. `None` where they
    /// are not known.
    fn motion_at(&self, time_s: f64) -> Option<Motion<f64>>;
}

/// A reference pose, and the path along which the model carries it to the instant of a reading: what the
/// model says of the reference system and of clocks decides where the robot was.
#[derive(Clone, Copy)]
pub struct Anchor<'a> {
    /// The stamp of the reference pose, seconds.
    pub time_s: f64,
    /// The reference pose as it was recorded.
    pub pose: Pose<f64>,
    /// The robot's path.
    pub path: &'a dyn Path,
    /// The motion on the path at the stamp of the reference pose and at that of the reading.
    pub on_path: [Motion<f64>; 2],
}

/// The stamp of a reading, and the motion then: the sample nearest in time, carried there by the encoders.
#[derive(Clone, Copy)]
pub struct Instant<'a> {
    /// Seconds.
    pub time_s: f64,
    /// Pose in the map and velocity.
    pub motion: Motion<f64>,
    /// Neighbours.
    pub surroundings: Surroundings,
    /// Where `motion` is from. Without it, the motion is taken for true and its velocity for constant.
    pub anchor: Option<Anchor<'a>>,
    /// The path, in the map, of a robot that is seen.
    pub target: Option<&'a dyn Path>,
}

/// What of an instant depends on the model.
struct Carrier<'m, 'a, S> {
    instant: &'m Instant<'a>,
    truth: TruthReading<S>,
    /// By how much the robot's clock is ahead, seconds.
    clock_error_s: S,
    /// `map_from_path`, if there is a path.
    map_from_path: Option<(Pose<S>, Anchor<'a>)>,
}

impl<'m, 'a, S: Scalar> Carrier<'m, 'a, S> {
    fn new(model: &RobotModel<S>, instant: &'m Instant<'a>) -> Self {
        let context = instant.nominal_context(model);
        let truth = sensors::truth_reading(model, &context);
        let clock_error_s = sensors::clock_error_s(model, &context);
        let anchored = instant.anchor.and_then(|anchor| {
            let since_s = clock_error_s - truth.latency_s;
            let known = (anchor.time_s, &anchor.on_path[0]);
            let path_from_robot = along(anchor.path, Some(known), since_s + anchor.time_s)?;
            let map_from_robot = anchor.pose.lift().compose_plainly(&sensors::marker(&truth).inverse());
            Some((map_from_robot.compose_plainly(&path_from_robot.inverse()), anchor))
        });
        Self { instant, truth, clock_error_s, map_from_path: anchored }
    }

    /// The pose that the robot had when its clock showed this much less than the stamp.
    fn before(&self, age_s: S) -> Pose<S> {
        let time_s = self.instant.time_s;
        let on_path = |(map_from_path, anchor): &(Pose<S>, Anchor<'_>)| {
            let known = (time_s, &anchor.on_path[1]);
            Some(map_from_path.compose_plainly(&along(anchor.path, Some(known), -age_s + time_s)?))
        };
        self.map_from_path.as_ref().and_then(on_path).unwrap_or_else(|| {
            let shift_s = self.clock_error_s - self.truth.latency_s;
            let marker_from_robot = sensors::marker(&self.truth).between(&Pose::identity());
            self.instant.motion.lift().carried(-(age_s + shift_s)).compose(&marker_from_robot)
        })
    }

    /// The context of the stamp, with the robot where the model has it.
    fn context<'c>(&self, model: &'c RobotModel<S>) -> Context<'c, S> {
        let mut context = self.instant.nominal_context(model);
        context.motion.pose = self.before(S::zero());
        context
    }
}

/// The pose on a path at a stamp; `known` is the motion at one that is asked for often.
#[allow(clippy::float_cmp, reason = "the very stamp")]
fn along<S: Scalar>(path: &dyn Path, known: Option<(f64, &Motion<f64>)>, time_s: S) -> Option<Pose<S>> {
    let then_s = time_s.value();
    let motion = match known {
        Some((known_s, motion)) if known_s == then_s => *motion,
        _ => path.motion_at(then_s)?,
    };
    // The stamp itself is met: what is left to carry is its derivative.
    Some(if time_s.is_constant() { motion.pose.lift() } else { motion.lift().carried(time_s - then_s) })
}

impl Instant<'_> {
    fn nominal_context<'a, S: Scalar>(&self, model: &'a RobotModel<S>) -> Context<'a, S> {
        Context {
            surroundings: self.surroundings,
            ..Context::new(&model.nominal, self.time_s, self.motion.lift())
        }
    }
}

/// Position, metres in the map.
pub fn gps<S: Scalar>(model: &RobotModel<S>, instant: &Instant<'_>) -> [S; 2] {
    let carrier = Carrier::new(model, instant);
    let reading = sensors::gps_reading(model, &carrier.context(model));
    sensors::antenna(&reading, &carrier.before(reading.latency_s))
}

/// Heading, radians, not wrapped.
pub fn heading<S: Scalar>(model: &RobotModel<S>, instant: &Instant<'_>) -> S {
    let context = Carrier::new(model, instant).context(model);
    sensors::heading_of(model, &context, context.heading_rad())
}

/// Range and bearing.
pub fn sighting<S: Scalar>(model: &RobotModel<S>, instant: &Instant<'_>, seen: &Seen) -> Sighting<S> {
    let carrier = Carrier::new(model, instant);
    let context = carrier.context(model);
    let geometry = sensors::sighting_geometry(model, &context, seen.target, seen.position_m);
    let map_from_sensor = carrier.before(geometry.latency_s).compose(&sensors::sensor(&geometry));
    // The target is where the reference system shows it at that instant of common time.
    let ahead_s = carrier.truth.latency_s - carrier.clock_error_s - geometry.latency_s;
    let there = instant.target.and_then(|path| along(path, None, ahead_s + instant.time_s));
    let target_m = if let Some(pose) = there {
        pose.position()
    } else {
        let [x_m, y_m] = geometry.target_m;
        let [x_m_s, y_m_s] = seen.velocity_m_s;
        [x_m + ahead_s * x_m_s, y_m + ahead_s * y_m_s]
    };
    sensors::sighting_of(model, &context, map_from_sensor.point_seen(target_m))
}

/// The reference pose.
pub fn truth<S: Scalar>(model: &RobotModel<S>, instant: &Instant<'_>) -> Pose<S> {
    sensors::truth(model, &instant.nominal_context(model))
}
