//! What a robot did around every row of its residuals, in samples fine enough that rates can be summed over
//! the window of a row.

use std::collections::{BTreeMap, BTreeSet};

use pleiad_physics::chain::actuator::servo;
use pleiad_physics::{Context, Motion, Pose};

use crate::channel::Channel;
use crate::commanded;
use crate::diagnosis::open::monomial::{Base, Factor, Instant, Monomial};
use crate::diagnosis::open::target::Target;
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::{Row, Stretch, Unit};
use crate::schedule::Schedule;
use crate::sightings;
use crate::track::Track;

/// Into how long steps time is divided, seconds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grain {
    /// Rates are summed in steps of about this.
    step_s: f64,
    /// Set-points pass through the servo in steps of this.
    servo_step_s: f64,
}

impl Grain {
    pub(crate) const FINE: Self = Self { step_s: 0.05, servo_step_s: 0.01 };
    /// Enough to see what is worth a closer look.
    pub(crate) const COARSE: Self = Self { step_s: 0.25, servo_step_s: 0.05 };
}

/// Yaw acceleration is taken over twice this, seconds.
const REACH_S: f64 = 0.05;
/// Length of a window of the gyro, seconds.
const GYRO_WINDOW_S: f64 = 0.5;

/// The samples of the window of a row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    pub(crate) first: usize,
    pub(crate) count: usize,
    pub(crate) step_s: f64,
}

/// Windows over which rates are summed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rolled {
    pub(crate) samples: Vec<Instant>,
    /// Cosine and sine of how much the heading differs from that in the middle of the window, of each sample.
    pub(crate) turned: Vec<[f64; 2]>,
    /// Driven in the step of each sample, metres; 0 where it is not known.
    pub(crate) driven_m: Vec<f64>,
    pub(crate) rows: Vec<Span>,
}

impl Rolled {
    /// The windows of a stretch, from `from_s` to `to_s` of each row.
    fn new(track: &Track, ends_s: &[(f64, f64)], longest_s: f64) -> Self {
        let mut all = Self::default();
        for &(from_s, to_s) in ends_s {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a short window")]
            let count = ((to_s - from_s) / longest_s).round().max(1.0) as usize;
            let step_s = (to_s - from_s) / count as f64;
            let first = all.samples.len();
            let mut turned = 0.0;
            let mut angles = Vec::with_capacity(count);
            for index in 0..count {
                let at = instant(track, from_s + (index as f64 + 0.5) * step_s);
                let rate = known(at.get(Base::YawRate));
                all.samples.push(at);
                all.driven_m.push(known(at.get(Base::Speed) * step_s));
                angles.push(turned + 0.5 * rate * step_s);
                turned += rate * step_s;
            }
            let circle = |angle: f64| [libm::cos(angle - 0.5 * turned), libm::sin(angle - 0.5 * turned)];
            all.turned.extend(angles.into_iter().map(circle));
            all.rows.push(Span { first, count, step_s });
        }
        all
    }
}

fn known(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}

/// Set-points on an even grid, and the windows of the wheels.
#[derive(Clone, Debug, Default)]
pub(crate) struct Driven {
    pub(crate) from_s: f64,
    pub(crate) step_s: f64,
    pub(crate) samples: Vec<Instant>,
    pub(crate) ends_s: Vec<(f64, f64)>,
    /// Of the speed and of the yaw rate, seconds.
    pub(crate) time_constants_s: [f64; 2],
}

/// What a unit did, as far as its channels need it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Motions {
    pub(crate) body: Rolled,
    pub(crate) gyro: Rolled,
    pub(crate) driven: Driven,
    /// One per row of every other stretch, by the position of the stretch.
    pub(crate) readings: Vec<Vec<Instant>>,
}

impl Motions {
    /// What was done at the samples of a stretch.
    pub(crate) fn samples(&self, unit: &Unit<'_>, which: usize) -> &[Instant] {
        match unit.stretches[which].channel {
            Channel::Body | Channel::CommandedBody => &self.body.samples,
            Channel::Gyro => &self.gyro.samples,
            Channel::Actuator => &self.driven.samples,
            _ => &self.readings[which],
        }
    }

    /// Under terms of a hypothesis: they may delay commands.
    pub(crate) fn new(unit: &Unit<'_>, terms: &[Term], grain: Grain) -> Self {
        let mut all = Self { readings: vec![Vec::new(); unit.stretches.len()], ..Self::default() };
        let Some((track, plans)) = unit.evidence.prepared(unit.robot()) else { return all };
        for (which, stretch) in unit.stretches.iter().enumerate().filter(|(_, stretch)| stretch.rows > 0) {
            let rows: Vec<&Row> =
                stretch.range().step_by(stretch.components).map(|row| &unit.rows[row]).collect();
            let around = |length_s: f64| -> Vec<(f64, f64)> {
                rows.iter().map(|row| (row.time_s - 0.5 * length_s, row.time_s + 0.5 * length_s)).collect()
            };
            match stretch.channel {
                Channel::Body => {
                    let mut items = plans.body.items.iter().peekable();
                    let ends = |row: &&Row| {
                        while items.next_if(|own| own.middle_s < row.time_s - 1e-9).is_some() {}
                        items.peek().map_or((row.time_s, row.time_s), |own| {
                            let time_s = |index: usize| track.encoders[index].time_s;
                            (time_s(own.window.first), time_s(own.window.last))
                        })
                    };
                    let ends: Vec<(f64, f64)> = rows.iter().map(ends).collect();
                    all.body = Rolled::new(track, &ends, grain.step_s);
                }
                Channel::CommandedBody => {
                    all.body = Rolled::new(track, &around(commanded::WINDOW_S), grain.step_s);
                }
                Channel::Gyro => all.gyro = Rolled::new(track, &around(GYRO_WINDOW_S), grain.step_s),
                Channel::Actuator => {
                    let ends = plans.actuator.items.iter().filter(|own| own.measured.is_some());
                    let ends: Vec<(f64, f64)> =
                        ends.map(|own| (own.window.from_s, own.window.to_s)).collect();
                    if ends.len() == stretch.rows {
                        all.driven = driven((unit, track), terms, ends, grain.servo_step_s);
                    }
                }
                _ => all.readings[which] = readings(unit, stretch),
            }
        }
        all
    }
}

/// What the factors of monomials are at the samples of the stretches that show a target, each found once.
pub(crate) struct Table {
    /// By stretch.
    factors: BTreeMap<usize, BTreeMap<Factor, Vec<f64>>>,
    samples: BTreeMap<usize, usize>,
}

impl Table {
    pub(crate) fn new(unit: &Unit<'_>, motions: &Motions, target: Target, monomials: &[&Monomial]) -> Self {
        let wanted: BTreeSet<Factor> = monomials.iter().flat_map(|own| own.0.iter().copied()).collect();
        let shown = target.shown(unit);
        let of = |which: usize| {
            let samples = motions.samples(unit, which);
            let values = |factor: &Factor| (*factor, samples.iter().map(|at| factor.value(at)).collect());
            wanted.iter().map(values).collect()
        };
        Self {
            factors: shown.iter().map(|&which| (which, of(which))).collect(),
            samples: shown.iter().map(|&which| (which, motions.samples(unit, which).len())).collect(),
        }
    }

    /// The values of a monomial at the samples of a stretch; 0 where a base is not known.
    pub(crate) fn values(&self, which: usize, monomial: &Monomial) -> Vec<f64> {
        let mut values = vec![1.0; self.samples.get(&which).copied().unwrap_or(0)];
        for own in self.factors.get(&which).into_iter().flat_map(|all| monomial.0.iter().map(|own| &all[own]))
        {
            for (value, factor) in values.iter_mut().zip(own) {
                *value *= factor;
            }
        }
        for value in &mut values {
            *value = known(*value);
        }
        values
    }
}

/// What was driven at an instant, by the odometry and the truth.
fn instant(track: &Track, time_s: f64) -> Instant {
    let mut at: Vec<(Base, f64)> = Vec::with_capacity(12);
    at.push((Base::Time, time_s));
    if let Some(regime) = track.regime_at(time_s) {
        at.push((Base::Speed, regime.speed_m_s));
        at.push((Base::YawRate, regime.yaw_rate_rad_s));
        at.push((Base::Acceleration, regime.acceleration_m_s2));
        if let Some(pose) = regime.pose {
            at.push((Base::Heading, pose.yaw_rad));
            at.push((Base::X, pose.x_m));
            at.push((Base::Y, pose.y_m));
        }
    }
    let rate = |time_s: f64| track.regime_at(time_s).map(|regime| regime.yaw_rate_rad_s);
    let change = rate(time_s - REACH_S).zip(rate(time_s + REACH_S)).map_or(0.0, |(a, b)| b - a);
    at.push((Base::YawAcceleration, change / (2.0 * REACH_S)));
    if let Some(wheels) = track.wheels_at(time_s) {
        at.push((Base::LeftWheel, wheels.angle_rad[0]));
        at.push((Base::RightWheel, wheels.angle_rad[1]));
    }
    Instant::of(&at)
}

/// Set-points when they act, how far the servo is behind them, and where the robot is.
fn driven(
    (unit, track): (&Unit<'_>, &Track),
    terms: &[Term],
    ends_s: Vec<(f64, f64)>,
    step_s: f64,
) -> Driven {
    let model = unit.model(terms);
    let schedule = Schedule::new(&model, &track.commands);
    let (Some(first), Some(&(_, to_s))) = (schedule.all().first(), ends_s.last()) else {
        return Driven::default();
    };
    let from_s = first.from_s;
    let context = Context::new(&model.nominal, from_s, Motion::at_rest(Pose::identity()));
    let servo = servo(&model, &context);
    let time_constants_s = [servo.time_constant_s, servo.time_constant_turn_s].map(|own| own.max(1e-3));
    let keep = time_constants_s.map(|own| libm::exp(-step_s / own));
    let mut reached = [0.0; 2];
    let mut next = 0;
    let mut asked = [0.0; 2];
    let mut samples = Vec::new();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "times of a recording")]
    let count = ((to_s - from_s) / step_s).ceil().max(0.0) as usize;
    for index in 0..count {
        let middle_s = from_s + (index as f64 + 0.5) * step_s;
        while let Some(command) = schedule.all().get(next).filter(|command| command.from_s <= middle_s) {
            asked = [command.command.speed_m_s, command.command.yaw_rate_rad_s];
            next += 1;
        }
        let mut at: Vec<(Base, f64)> = Vec::with_capacity(12);
        at.push((Base::Time, middle_s));
        at.push((Base::Speed, asked[0]));
        at.push((Base::YawRate, asked[1]));
        at.push((Base::Acceleration, (asked[0] - reached[0]) / time_constants_s[0]));
        at.push((Base::YawAcceleration, (asked[1] - reached[1]) / time_constants_s[1]));
        if let Some(pose) = track.truth_at(middle_s) {
            at.push((Base::Heading, pose.yaw_rad));
            at.push((Base::X, pose.x_m));
            at.push((Base::Y, pose.y_m));
        }
        for axis in 0..2 {
            reached[axis] = asked[axis] + (reached[axis] - asked[axis]) * keep[axis];
        }
        samples.push(Instant::of(&at));
    }
    Driven { from_s, step_s, samples, ends_s, time_constants_s }
}

/// What was driven and seen at every reading of a stretch.
fn readings(unit: &Unit<'_>, stretch: &Stretch) -> Vec<Instant> {
    let row = |index: usize| {
        let row = &unit.rows[index];
        let mut at: Vec<(Base, f64)> = Vec::with_capacity(12);
        at.push((Base::Time, row.time_s));
        at.push((Base::Speed, row.regime.speed_m_s));
        at.push((Base::YawRate, row.regime.yaw_rate_rad_s));
        at.push((Base::Acceleration, row.regime.acceleration_m_s2));
        let Some(pose) = row.regime.pose else { return Instant::of(&at) };
        at.push((Base::Heading, pose.yaw_rad));
        at.push((Base::X, pose.x_m));
        at.push((Base::Y, pose.y_m));
        let seen = row.target.and_then(|target| sightings::seen(unit.evidence, target, row.time_s).ok());
        if let Some(seen) = seen {
            let [forward, left] =
                pose.rotate_back([seen.position_m[0] - pose.x_m, seen.position_m[1] - pose.y_m]);
            at.push((Base::Range, libm::hypot(forward, left)));
            at.push((Base::Bearing, libm::atan2(left, forward)));
        }
        Instant::of(&at)
    };
    stretch.range().step_by(stretch.components).map(row).collect()
}
