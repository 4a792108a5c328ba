//! The fold: one fact at a time, in the order of their keys, into the joint state.

mod across;
mod config;
mod named;
mod window;

pub use config::{Clutter, DEFAULT_GATE, FOLD_VERSION, FoldConfig, Inflation, Quarantine};
pub use window::Relinearization;
pub(crate) use window::fold_blocks;

use crate::fact::{Boot, EntryId, Noise, NominalState, Quantity};
use crate::geometry::{Matrix3, Vector2, Vector3};
use crate::joint::{
    Distrust, ErrorForm, Joint, ParameterKind, Participant, Party, Surprise, Update, clock_influence,
};
use crate::measurement::{self, Linearization, Unusable};
use crate::{BootIndex, LandmarkId, Pose2, RobotId, Sequence, Timestamp};

/// Where a fact stands in the order of the fold: by time, boots before observations of equal time, then
/// by robot, boot and sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FactKey {
    /// When.
    pub time: Timestamp,
    rank: u8,
    /// The entry that carries the fact.
    pub id: EntryId,
}

impl FactKey {
    /// Key of a boot.
    pub fn boot(time: Timestamp, id: EntryId) -> Self {
        Self { time, rank: 0, id }
    }

    /// Key of an observation.
    pub fn observation(time: Timestamp, id: EntryId) -> Self {
        Self { time, rank: 1, id }
    }

    /// Key of an observation counted a second time, which only a planted mistake does.
    #[cfg(feature = "planted")]
    pub(crate) fn again(time: Timestamp, id: EntryId) -> Self {
        Self { time, rank: 2, id }
    }

    /// The first key that a fact of `time` can have.
    pub(crate) fn first_at(time: Timestamp) -> Self {
        let id = EntryId { robot: RobotId(0), boot: BootIndex(0), sequence: Sequence(0) };
        Self { time, rank: 0, id }
    }

    /// The last key that a fact of `time` or earlier can have.
    pub fn last_at(time: Timestamp) -> Self {
        let id =
            EntryId { robot: RobotId(u32::MAX), boot: BootIndex(u32::MAX), sequence: Sequence(u64::MAX) };
        Self { time, rank: u8::MAX, id }
    }
}

/// A complete fact, ready to be folded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fact {
    /// A robot's boot begins.
    Boot(Boot),
    /// A robot observed something; with the other half if it was a robot.
    Observation {
        /// What was observed.
        quantity: Quantity,
        /// How well; `None` if the log never declared the profile referred to.
        noise: Option<Noise>,
        /// The observer's nominal state.
        observer: NominalState,
        /// The state of the robot that was seen, and the boot it belongs to.
        other: Option<(BootIndex, NominalState)>,
    },
}

/// Why a fact was not folded though complete.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SkipReason {
    /// A participant has no place in the map yet.
    NotPlaced(RobotId),
    /// A participant's state belongs to a boot that has ended or has not begun.
    OtherBoot(RobotId),
    /// The target is predicted closer than a millimetre.
    TooClose,
    /// A full pose of a landmark: a point has no heading.
    PointHasNoHeading,
    /// The noise profile is not declared, has the wrong dimension, or is not positive definite.
    Noise,
    /// A robot observed itself.
    Itself,
    /// The landmark has no place in the team's map yet, and a range or a bearing alone does not give it one; nor does
    /// the additive form map landmarks.
    NotMapped(LandmarkId),
    /// It contradicts the others or, alone, the map, and is not believed on that until it boots again.
    Distrusted(RobotId),
}

/// What the fold did with a fact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// A boot took effect.
    Booted,
    /// A robot was placed in the map by its prior, or a landmark by whoever saw it first.
    Placed,
    /// The joint was updated.
    Used,
    /// The joint was updated, and that it was of another than it names is the likeliest.
    UsedAs(Party),
    /// It was seen between two frames of which it is not yet known how they lie to one another, and waits for more.
    Tied,
    /// It was the last that was needed to know how two frames lie to one another.
    Joined {
        /// Numbers measured beyond the three that it takes. Without any, nothing could contradict.
        redundancy: usize,
    },
    /// The gate refused it.
    Rejected {
        /// The gate.
        threshold: f64,
    },
    /// It could not be folded.
    Skipped(SkipReason),
}

/// The record every fact leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// What became of it.
    pub outcome: Outcome,
    /// Dimension of the measurement; 0 where there was none.
    pub dimension: usize,
    /// Measured minus predicted before the update; zero beyond the dimension.
    pub innovation: Vector3,
    /// Normalized innovation squared.
    pub nis: f64,
}

impl Residual {
    fn without_measurement(outcome: Outcome) -> Self {
        Self { outcome, dimension: 0, innovation: Vector3::zeros(), nis: 0.0 }
    }
}

/// The joint that `facts`, in the order of their keys, make of nothing.
pub fn joint_of(config: &FoldConfig, facts: &[(FactKey, Fact)]) -> Joint {
    joint_among(config, facts, &nobody)
}

/// The same where others than those that sightings name have said where they were.
pub fn joint_among(config: &FoldConfig, facts: &[(FactKey, Fact)], others: &Others<'_>) -> Joint {
    let mut joint = Joint::new(config.form);
    fold_on(&mut joint, config, facts, others, &mut |_, _| {});
    joint
}

/// Where other robots than the one that a sighting names were at its time, on which boot; of use where names may be wrong
/// (`FoldConfig::misnamed`).
pub type Others<'a> = dyn Fn(EntryId, RobotId) -> Option<(BootIndex, NominalState)> + 'a;

/// Nobody but who is named has said where it was.
pub fn nobody(_: EntryId, _: RobotId) -> Option<(BootIndex, NominalState)> {
    None
}

/// Folds all of `facts`, in the order of their keys, into the joint state, and tells what became of each.
pub fn fold_on(
    joint: &mut Joint,
    config: &FoldConfig,
    facts: &[(FactKey, Fact)],
    others: &Others<'_>,
    told: &mut dyn FnMut(&FactKey, Residual),
) {
    if let Some(how) = &config.relinearize {
        let mut told = |index: usize, residual, _: &dyn Fn() -> Joint| told(&facts[index].0, residual);
        fold_blocks(joint, config, how, facts, &mut |_, _| {}, &mut told);
    } else {
        for (key, fact) in facts {
            told(key, fold_among(joint, config, key, fact, others));
        }
    }
}

/// Folds one fact into the joint state, linearized where those before it put the robots, whatever the configuration says
/// of linearizing facts together.
pub fn fold(joint: &mut Joint, config: &FoldConfig, key: &FactKey, fact: &Fact) -> Residual {
    fold_among(joint, config, key, fact, &nobody)
}

/// The same where others than the one that a sighting names have said where they were.
pub fn fold_among(
    joint: &mut Joint,
    config: &FoldConfig,
    key: &FactKey,
    fact: &Fact,
    others: &Others<'_>,
) -> Residual {
    match fact {
        Fact::Boot(boot) => {
            joint.boot(key.id.robot, key.id.boot, boot);
            if config.join {
                joint.begin_frame(key.id.robot, key.id.boot, boot);
            }
            Residual::without_measurement(Outcome::Booted)
        }
        Fact::Observation { quantity, noise, observer, other } => {
            let seen = other.as_ref();
            fold_observation(joint, (config, others), key, quantity, noise.as_ref(), observer, seen)
                .unwrap_or_else(|reason| Residual::without_measurement(Outcome::Skipped(reason)))
        }
    }
}

fn fold_observation(
    joint: &mut Joint,
    (config, others): (&FoldConfig, &Others<'_>),
    key: &FactKey,
    quantity: &Quantity,
    noise: Option<&Noise>,
    observer: &NominalState,
    other: Option<&(BootIndex, NominalState)>,
) -> Result<Residual, SkipReason> {
    let mut noise = measurement::noise_matrix(&usable(quantity, noise)?);
    let of_map = !matches!(quantity, Quantity::Robot { .. });
    if let Some(robot) = joint.distrusted(joint.index(key.id.robot).into_iter(), of_map) {
        return Err(SkipReason::Distrusted(robot));
    }
    if let Quantity::Absolute(crate::fact::Absolute::Pose(z)) = quantity
        && (joint.index(key.id.robot).is_none() || joint.is_alone(key.id.robot))
    {
        joint.place(key.id.robot, key.id.boot, z, &noise, observer);
        return Ok(Residual::without_measurement(Outcome::Placed));
    }
    let taken = taken(joint, key, quantity, observer, other)?;
    if let Some(robot) = joint.distrusted(robots(&taken), of_map) {
        return Err(SkipReason::Distrusted(robot));
    }
    noise *= joint.part(taken[0].0).reputation.noise_level;
    for (index, state) in &taken {
        if let Some(state) = state {
            joint.propagate(*index, state);
        }
    }
    if across::is_across(joint, quantity, &taken) {
        return across::fold_across(joint, config, key, quantity, &noise, &taken);
    }
    let (poses, influences) = seen_poses(joint, key.time, quantity, &taken);
    if let (Quantity::Feature { landmark, relative }, [from]) = (quantity, poses.as_slice()) {
        let (position, spread) =
            measurement::point_of(relative, &noise).ok_or(SkipReason::NotMapped(*landmark))?;
        if joint.form() == ErrorForm::Additive {
            return Err(SkipReason::NotMapped(*landmark));
        }
        let mount = influences.first().map(|(index, _, by)| (*index, *by));
        joint.map_landmark(*landmark, taken[0].0, mount, from, position, &spread);
        return Ok(Residual::without_measurement(Outcome::Placed));
    }
    if let Some(clutter) = config.clutter.filter(|_| config.misnamed > 0.0)
        && named::is_named(quantity)
    {
        named::keep_stated(joint, quantity);
        let own = named::Reading { quantity: *quantity, taken, poses, influences };
        let folded = named::fold_named(joint, (config, &clutter, others), key, own, &noise)?;
        let (Residual { dimension, nis, .. }, weight) = (folded.residual, folded.weight);
        reflect(
            joint,
            config,
            key.time,
            &folded.of.quantity,
            &folded.of.taken,
            (dimension, nis, weight),
            true,
        );
        return Ok(folded.residual);
    }
    let odds = config.clutter.map(|clutter| clutter.log_odds(quantity));
    let at = linearize(quantity, &poses)?;
    let mut participants = participants(quantity, &taken, &influences, &at);
    let (residual, weight) = update(joint, config, &at, &noise, &mut participants, odds)?;
    reflect(joint, config, key.time, quantity, &taken, (residual.dimension, residual.nis, weight), true);
    Ok(residual)
}

/// What a reading says of those who took part, besides where they are, by its dimension, its normalized innovation squared and
/// the probability that it is of something. With `detach` a robot that contradicts the others begins a frame of its own.
fn reflect(
    joint: &mut Joint,
    config: &FoldConfig,
    time: Timestamp,
    quantity: &Quantity,
    taken: &[Taken],
    (dimension, nis, weight): (usize, f64, f64),
    detach: bool,
) {
    if config.inflation.is_none() && config.quarantine.is_none() {
        return;
    }
    // An open gate does not bound what one reading may say.
    let gate = config.gate[dimension - 1].min(DEFAULT_GATE[dimension - 1]);
    let nothing = config.clutter.map_or(0.0, |clutter| clutter.share);
    let surprise = Surprise { time, dimension, nis, gate, weight, nothing };
    let robots: Vec<usize> = robots(taken).collect();
    if let Some(inflation) = &config.inflation {
        joint.follow(inflation, &robots, &surprise);
    }
    if let Some(quarantine) = &config.quarantine
        && let Some((robot, whole)) = joint.weigh(quarantine, &robots, Party::of(quantity), &surprise)
    {
        let distrust = Distrust { since: time, whole };
        if !(detach && whole && joint.detach(robot, time, quarantine.last_chance(time))) {
            joint.distrust(robot, distrust);
        }
    }
}

/// Blocks of the robots that take part.
fn robots(taken: &[Taken]) -> impl Iterator<Item = usize> {
    taken.iter().filter_map(|(index, state)| state.map(|_| *index))
}

/// What besides a robot's own error moves its pose as a measurement sees it: the block, which pose of those in the order of
/// [`taken`], and the derivative of that pose's error.
type Influence = (usize, usize, Matrix3);

/// A block that takes part, and the nominal state of the robot in it; a landmark has none.
type Taken = (usize, Option<NominalState>);

/// The poses of those who take part as the measurement sees them, in the order of [`taken`]: of the observer the frame it sees
/// from, and of the robot that was seen the pose at the observer's time, whose clock may differ.
fn seen_poses(
    joint: &Joint,
    time: Timestamp,
    quantity: &Quantity,
    taken: &[Taken],
) -> (Vec<Pose2>, Vec<Influence>) {
    let own = |(index, state): &Taken| {
        let frame = *joint.frame(*index);
        state.as_ref().map_or(frame, |state| frame.compose(&state.nominal))
    };
    let mut poses: Vec<Pose2> = taken.iter().map(own).collect();
    let mut influences = Vec::new();
    if matches!(quantity, Quantity::Absolute(_)) {
        return (poses, influences);
    }
    let parameters = |robot, kind| {
        let index = joint.parameter_index(robot, kind)?;
        joint.parameters_at(index).map(|of| (index, of))
    };
    let observer = joint.part(taken[0].0).robot;
    if let Some((index, mount)) = parameters(observer, ParameterKind::Mount) {
        let frame = Pose2::new(mount.value.x, mount.value.y, mount.value.z);
        poses[0] = poses[0].compose(&frame);
        let turned = Pose2::new(0.0, 0.0, -frame.yaw_rad()).adjoint();
        influences.push((index, 0, poses[0].adjoint() * turned));
    }
    let Some((index, Some(NominalState { sensitivity: Some(sensitivity), .. }))) = taken.get(1) else {
        return (poses, influences);
    };
    let clocks = [(joint.part(*index).robot, 1.0), (observer, -1.0)].map(|(robot, sign)| {
        parameters(robot, ParameterKind::Clock).map(|(index, clock)| (index, clock, sign))
    });
    let late_s = clocks.iter().flatten().fold(0.0, |sum, (_, clock, sign)| {
        sum + sign * (clock.value.x + clock.value.y * time.seconds_since(clock.since))
    });
    if late_s != 0.0 {
        poses[1] = poses[1].compose(&Pose2::exp(sensitivity.twist * late_s));
    }
    for (index, clock, sign) in clocks.into_iter().flatten() {
        influences.push((index, 1, clock_influence(&poses[1], sensitivity, clock, time) * sign));
    }
    (poses, influences)
}

/// The blocks that the prediction depends on, and how.
fn participants(
    quantity: &Quantity,
    taken: &[Taken],
    influences: &[Influence],
    at: &Linearization,
) -> Vec<Participant> {
    let signs = signs(quantity);
    let robots = taken.iter().zip(signs);
    let mut participants: Vec<Participant> = robots
        .map(|((index, _), sign)| Participant { index: *index, jacobian: at.jacobian * *sign })
        .collect();
    participants.extend(influences.iter().map(|(index, which, by)| Participant {
        index: *index,
        jacobian: at.jacobian * *by * signs[*which],
    }));
    participants
}

/// The noise, if it fits what was measured.
fn usable(quantity: &Quantity, noise: Option<&Noise>) -> Result<Noise, SkipReason> {
    let fits = |noise: &&Noise| usize::from(noise.dimension) == dimension(quantity);
    noise.filter(fits).copied().ok_or(SkipReason::Noise)
}

/// Who takes part in a measurement, the observer first, and their nominal states at its time. A landmark that is not in the
/// team's map yet does not.
fn taken(
    joint: &Joint,
    key: &FactKey,
    quantity: &Quantity,
    observer: &NominalState,
    other: Option<&(BootIndex, NominalState)>,
) -> Result<Vec<Taken>, SkipReason> {
    let a = key.id.robot;
    let mut taken = Vec::with_capacity(2);
    taken.push((participant(joint, a, key.id.boot)?, Some(*observer)));
    if let Quantity::Robot { robot: b, .. } = quantity {
        if *b == a {
            return Err(SkipReason::Itself);
        }
        let (boot, state) = other.ok_or(SkipReason::NotPlaced(*b))?;
        taken.push((participant(joint, *b, *boot)?, Some(*state)));
    }
    if let Quantity::Feature { landmark, .. } = quantity {
        taken.extend(joint.landmark_index(*landmark).map(|index| (index, None)));
    }
    Ok(taken)
}

/// A measurement at the poses of those who take part, in the order of [`taken`].
fn linearize(quantity: &Quantity, poses: &[Pose2]) -> Result<Linearization, SkipReason> {
    let linearized = match (quantity, poses) {
        (Quantity::Robot { relative, .. }, [a, b]) => measurement::of_robot(relative, a, b),
        (Quantity::Landmark { position_m: [x, y], relative, .. }, [a]) => {
            measurement::of_point(relative, a, Vector2::new(*x, *y))
        }
        (Quantity::Feature { relative, .. }, [a, landmark]) => {
            measurement::of_point(relative, a, landmark.position())
        }
        (Quantity::Absolute(absolute), [a]) => Ok(measurement::of_map(absolute, a)),
        _ => return Err(SkipReason::Noise),
    };
    linearized.map_err(|unusable| match unusable {
        Unusable::TooClose { .. } => SkipReason::TooClose,
        Unusable::PointHasNoHeading => SkipReason::PointHasNoHeading,
    })
}

/// What the derivative with respect to the error of each who takes part is multiplied by, in the order of [`taken`]: a
/// relative measurement moves with the observer the other way.
fn signs(quantity: &Quantity) -> &'static [f64] {
    match quantity {
        Quantity::Robot { .. } | Quantity::Feature { .. } => &[-1.0, 1.0],
        Quantity::Landmark { .. } => &[-1.0],
        Quantity::Absolute(_) => &[1.0],
    }
}

fn update(
    joint: &mut Joint,
    config: &FoldConfig,
    at: &Linearization,
    noise: &Matrix3,
    participants: &mut [Participant],
    odds: Option<f64>,
) -> Result<(Residual, f64), SkipReason> {
    let threshold = config.gate[at.dimension - 1];
    let (outcome, nis, weight) =
        match joint.update(at.dimension, &at.innovation, noise, participants, threshold, odds) {
            Update::Used { nis, weight } => (Outcome::Used, nis, weight),
            Update::Rejected { nis, threshold, weight } => (Outcome::Rejected { threshold }, nis, weight),
            Update::Indefinite => return Err(SkipReason::Noise),
        };
    Ok((Residual { outcome, dimension: at.dimension, innovation: at.innovation, nis }, weight))
}

fn dimension(quantity: &Quantity) -> usize {
    match quantity {
        Quantity::Robot { relative, .. }
        | Quantity::Landmark { relative, .. }
        | Quantity::Feature { relative, .. } => measurement::dimension(relative),
        Quantity::Absolute(absolute) => measurement::absolute_dimension(absolute),
    }
}

fn participant(joint: &Joint, robot: RobotId, boot: BootIndex) -> Result<usize, SkipReason> {
    let index = joint.index(robot).ok_or(SkipReason::NotPlaced(robot))?;
    match joint.member(robot) {
        Some(member) if member.boot == boot => Ok(index),
        _ => Err(SkipReason::OtherBoot(robot)),
    }
}
