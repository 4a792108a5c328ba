//! From turning wheels to a pose in the map.

use crate::context::Context;
use crate::model::{Drive, RobotModel};
use crate::pose::Pose;
use crate::scalar::Scalar;
use crate::signal::{BodyMotion, Castor, Geometry, MapMotion, Rolling};

/// A castor turns round once the robot has rolled so far the other way, metres: a few ticks of an encoder.
const CASTOR_PLAY_M: f64 = 0.001;

/// What the body remembers from step to step.
#[derive(Clone, Copy, Debug)]
pub struct BodyState<S> {
    /// Speed of the step before, m/s: its change is the acceleration. `None` at the start.
    pub speed_m_s: Option<S>,
    /// What a swinging castor remembers.
    pub castor: Castor<S>,
}

impl<S: Scalar> Default for BodyState<S> {
    fn default() -> Self {
        Self { speed_m_s: None, castor: Castor { direction: 0, since_reversal_m: None, against_m: 0.0 } }
    }
}

impl BodyState<f64> {
    /// The same state as another scalar, depending on nothing.
    pub fn lift<S: Scalar>(&self) -> BodyState<S> {
        let Castor { direction, since_reversal_m, against_m } = self.castor;
        BodyState {
            speed_m_s: self.speed_m_s.map(S::constant),
            castor: Castor { direction, since_reversal_m: since_reversal_m.map(S::constant), against_m },
        }
    }
}

/// What a step adds to a pose, and the mean velocities in it.
#[derive(Clone, Copy, Debug)]
pub struct BodyIncrement<S> {
    /// Driven at a constant velocity of the body, in its frame: forward and left (metres), yaw (radians).
    pub driven: [S; 3],
    /// What the surroundings add, in the map.
    pub added: MapMotion<S>,
    /// Mean forward speed, m/s.
    pub speed_m_s: S,
    /// Mean yaw rate, rad/s.
    pub yaw_rate_rad_s: S,
    /// Change of speed from the step before, m/s^2.
    pub acceleration_m_s2: S,
}

impl<S: Scalar> BodyIncrement<S> {
    /// The pose at the end of a step that began at `start`.
    pub fn applied_to(&self, start: &Pose<S>) -> Pose<S> {
        driven_from(start, self.driven, &self.added)
    }
}

/// The pose after this was driven, in the frame of the body, and added, in the map.
pub(crate) fn driven_from<S: Scalar>(
    start: &Pose<S>,
    [forward_m, left_m, yaw_rad]: [S; 3],
    added: &MapMotion<S>,
) -> Pose<S> {
    let mut pose = start.compose(&Pose::exp(forward_m, left_m, yaw_rad));
    pose.x_m += added.shift_m[0];
    pose.y_m += added.shift_m[1];
    pose.yaw_rad += added.yaw_rad;
    pose
}

/// The pose before this was driven and added: the inverse of [`driven_from`].
pub(crate) fn driven_to<S: Scalar>(
    end: &Pose<S>,
    [forward_m, left_m, yaw_rad]: [S; 3],
    added: &MapMotion<S>,
) -> Pose<S> {
    let mut pose = *end;
    pose.x_m -= added.shift_m[0];
    pose.y_m -= added.shift_m[1];
    pose.yaw_rad -= added.yaw_rad;
    pose.compose(&Pose::exp(-forward_m, -left_m, -yaw_rad))
}

/// What the surroundings add in the context's step.
pub(crate) fn added<S: Scalar>(model: &RobotModel<S>, context: &Context<S>) -> MapMotion<S> {
    let mut added = MapMotion { shift_m: [S::zero(); 2], yaw_rad: S::zero() };
    model.apply(context, |effect, values| effect.world(values, context, &mut added));
    added
}

/// The outcome of a step of the body.
#[derive(Clone, Copy, Debug)]
pub struct BodyStep<S> {
    /// `map_from_robot` at the end.
    pub pose: Pose<S>,
    /// Mean forward speed, m/s.
    pub speed_m_s: S,
    /// Mean yaw rate, rad/s.
    pub yaw_rate_rad_s: S,
    /// Change of speed from the step before, m/s^2.
    pub acceleration_m_s2: S,
}

/// Moves the body by the angles that its wheels turn in the context's step, which must be longer than 0.
///
/// Velocities for the hooks come from the turned angles themselves; the context gives the pose at the
/// beginning and the wheels' angles.
pub fn advance<S: Scalar>(
    model: &RobotModel<S>,
    context: &Context<S>,
    turned_rad: [S; 2],
    state: &mut BodyState<S>,
) -> BodyStep<S> {
    let increment = increment(model, context, turned_rad, state);
    BodyStep {
        pose: increment.applied_to(&context.motion.pose),
        speed_m_s: increment.speed_m_s,
        yaw_rate_rad_s: increment.yaw_rate_rad_s,
        acceleration_m_s2: increment.acceleration_m_s2,
    }
}

/// What [`advance`] adds to a pose. A simulator gives the context the pose in the middle of the step, where
/// effects of place and heading are at their mean.
pub fn increment<S: Scalar>(
    model: &RobotModel<S>,
    context: &Context<S>,
    turned_rad: [S; 2],
    state: &mut BodyState<S>,
) -> BodyIncrement<S> {
    let step_s = context.step_s;
    let geometry = geometry(model, context);
    let [left, right] = geometry.wheel_radius_m;
    let rolled_m = [left * turned_rad[0], right * turned_rad[1]];
    let (forward, yaw) = kinematics(model.drive, context, &geometry, rolled_m);

    let mut context = *context;
    let speed = forward / step_s;
    context.motion.speed_m_s = speed;
    context.motion.yaw_rate_rad_s = yaw / step_s;
    context.motion.acceleration_m_s2 = state.speed_m_s.map_or(S::zero(), |before| (speed - before) / step_s);

    let mut rolling = Rolling { turned_rad, rolled_m };
    model.apply(&context, |effect, values| effect.rolling(values, &context, &mut rolling));
    let (forward_m, yaw_rad) = kinematics(model.drive, &context, &geometry, rolling.rolled_m);
    turn_castor(&mut state.castor, forward_m);
    let mut body = BodyMotion { forward_m, left_m: S::zero(), yaw_rad, castor: state.castor };
    model.apply(&context, |effect, values| effect.body(values, &context, &mut body));
    if let Some(since) = &mut state.castor.since_reversal_m {
        *since += forward_m.abs();
    }
    let added = added(model, &context);
    state.speed_m_s = Some(speed);
    BodyIncrement {
        driven: [body.forward_m, body.left_m, body.yaw_rad],
        added,
        speed_m_s: body.forward_m / step_s,
        yaw_rate_rad_s: (body.yaw_rad + added.yaw_rad) / step_s,
        acceleration_m_s2: context.motion.acceleration_m_s2,
    }
}

/// What the nominal robot drives when its wheels turn by these angles: forward (metres) and yaw (radians).
pub(crate) fn nominal_motion<S: Scalar>(
    model: &RobotModel<S>,
    context: &Context<S>,
    turned_rad: [S; 2],
) -> (S, S) {
    let rolled_m = turned_rad.map(|turned| model.nominal.wheel_radius * turned);
    kinematics(model.drive, context, &nominal_geometry(model), rolled_m)
}

/// The robot as its wheels see it.
fn geometry<S: Scalar>(model: &RobotModel<S>, context: &Context<S>) -> Geometry<S> {
    let mut geometry = nominal_geometry(model);
    model.apply(context, |effect, values| effect.geometry(values, context, &mut geometry));
    geometry
}

fn nominal_geometry<S: Scalar>(model: &RobotModel<S>) -> Geometry<S> {
    let nominal = &model.nominal;
    Geometry {
        wheel_radius_m: [nominal.wheel_radius; 2],
        track_width_m: match model.drive {
            Drive::SkidSteer { track_ratio } => nominal.track_width * track_ratio,
            Drive::Differential | Drive::CarLike { .. } => nominal.track_width,
        },
        steer_offset_rad: S::zero(),
        understeer_s2_per_m2: S::zero(),
    }
}

/// Forward distance and yaw: `(left + right)/2`, and `(right - left)/b`, or for a car the distance times
/// `tan(steer) / (L (1 + K v^2))`.
fn kinematics<S: Scalar>(
    drive: Drive,
    context: &Context<S>,
    geometry: &Geometry<S>,
    [left, right]: [S; 2],
) -> (S, S) {
    let forward = (left + right) * 0.5;
    let yaw = match drive {
        Drive::Differential | Drive::SkidSteer { .. } => (right - left) / geometry.track_width_m,
        Drive::CarLike { wheelbase_m } => {
            let steer = geometry.steer_offset_rad + context.surroundings.steer_rad;
            let speed = forward / context.step_s;
            let widened = geometry.understeer_s2_per_m2 * speed.square() + 1.0;
            forward * steer.tan() / (widened * wheelbase_m)
        }
    };
    (forward, yaw)
}

/// Notes a reversal; the castor begins to swing round in the step in which the robot has rolled
/// [`CASTOR_PLAY_M`] the other way. Less is no reversal: a robot that spins does not roll, but for the ticks of
/// its encoders.
fn turn_castor<S: Scalar>(castor: &mut Castor<S>, forward: S) {
    let forward_m = forward.value();
    if castor.direction == 0 {
        castor.against_m += forward_m;
        if castor.against_m.abs() > CASTOR_PLAY_M {
            castor.direction = if castor.against_m > 0.0 { 1 } else { -1 };
            castor.against_m = 0.0;
        }
        return;
    }
    castor.against_m = (castor.against_m - f64::from(castor.direction) * forward_m).max(0.0);
    if castor.against_m > CASTOR_PLAY_M {
        // It begins within the step: before, it was not yet there.
        castor.since_reversal_m = Some(-forward.abs() + (castor.against_m - CASTOR_PLAY_M));
        castor.direction = -castor.direction;
        castor.against_m = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Motion, Nominal};

    fn moved(drive: Drive, steer_rad: f64, turned: [f64; 2]) -> BodyStep<f64> {
        let model = RobotModel::nominal(drive, Nominal::ideal(0.1, 0.5));
        let mut context = Context::new(&model.nominal, 0.0, Motion::at_rest(Pose::identity())).over(2.0);
        context.surroundings.steer_rad = steer_rad;
        advance(&model, &context, turned, &mut BodyState::default())
    }

    #[test]
    fn opposite_wheels_spin_in_place() {
        let step = moved(Drive::Differential, 0.0, [-5.0, 5.0]);
        assert!((step.pose.yaw_rad - 2.0).abs() < 1e-15 && step.pose.x_m.abs() < 1e-15);
        assert!((step.yaw_rate_rad_s - 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_skid_steered_robot_turns_less_by_its_track_ratio() {
        let step = moved(Drive::SkidSteer { track_ratio: 1.6 }, 0.0, [-5.0, 5.0]);
        assert!((step.pose.yaw_rad - 2.0 / 1.6).abs() < 1e-15);
    }

    #[test]
    fn a_car_drives_the_circle_of_its_steering_angle() {
        // Ackermann: radius = wheelbase / tan(steer) = 0.8 m; rolled 1 m.
        let step = moved(Drive::CarLike { wheelbase_m: 0.8 }, std::f64::consts::FRAC_PI_4, [10.0, 10.0]);
        assert!((step.pose.yaw_rad - 1.0 / 0.8).abs() < 1e-15);
        assert!((step.pose.x_m - 0.8 * 1.25_f64.sin()).abs() < 1e-15);
    }

    #[test]
    fn only_effects_that_say_so_look_at_where_the_body_is() {
        use crate::{ActiveEffect, Effect};
        for &effect in Effect::ALL {
            let active = ActiveEffect::new(effect, &effect.typical_values()).expect("its own values");
            let model = RobotModel::nominal(Drive::Differential, Nominal::ideal(0.1, 0.5)).with(active);
            let moved = |pose: Pose<f64>| {
                let mut context = Context::new(&model.nominal, 0.0, Motion::at_rest(pose)).over(2.0);
                context.surroundings.partner_m = Some([0.4, 0.3]);
                let mut state = BodyState { speed_m_s: Some(0.2), ..BodyState::default() };
                let step = increment(&model, &context, [2.0, 3.0], &mut state);
                let mut motion = context.motion;
                motion.yaw_rate_rad_s = step.yaw_rate_rad_s;
                let context = Context::new(&model.nominal, 1.0, motion);
                let read = crate::chain::sensors::gyro(&model, &context, &mut 0.0);
                format!("{step:?} {read:?}")
            };
            let nowhere = Pose::new(f64::NAN, f64::NAN, f64::NAN);
            if !effect.places_body() {
                assert_eq!(moved(nowhere), moved(Pose::new(0.1, 0.2, 0.3)), "{}", effect.name());
            }
        }
    }

    #[test]
    fn a_castor_begins_to_swing_at_a_reversal_only() {
        let mut castor = Castor { direction: 0, since_reversal_m: None, against_m: 0.0 };
        for (forward, reversed) in [(0.1, false), (0.0, false), (0.2, false), (-0.1, true)] {
            turn_castor(&mut castor, forward);
            assert_eq!(castor.since_reversal_m.is_some(), reversed);
        }
    }

    #[test]
    fn ticks_of_the_encoders_are_no_reversal_and_a_slow_one_is() {
        let mut castor = Castor { direction: 1, since_reversal_m: None, against_m: 0.0 };
        for _ in 0..1000 {
            turn_castor(&mut castor, 3e-4);
            turn_castor(&mut castor, -3e-4);
        }
        assert_eq!(castor.since_reversal_m, None);
        for _ in 0..1000 {
            turn_castor(&mut castor, -2e-6);
        }
        let since_m = castor.since_reversal_m.expect("a reversal");
        assert!((-2e-6..=0.0).contains(&since_m) && castor.direction == -1, "{since_m}");
    }
}
