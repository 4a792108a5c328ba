//! The fold: one fact at a time, in the order of their keys, into the joint state.

mod across;
mod config;
mod named;
mod reading;
mod window;

pub use config::{Clutter, DEFAULT_GATE, FOLD_VERSION, FoldConfig, Inflation, Quarantine};
pub use window::Relinearization;
pub(crate) use window::fold_blocks;

use reading::{Taken, linearize, participants, seen_poses, taken, usable};

use crate::fact::{Boot, EntryId, Noise, NominalState, Quantity};
use crate::geometry::{Matrix3, Vector3};
use crate::joint::{Distrust, ErrorForm, Joint, Participant, Party, Surprise, Update};
use crate::measurement::{self, Linearization};
use crate::{BootIndex, LandmarkId, RobotId, Sequence, Timestamp};

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
