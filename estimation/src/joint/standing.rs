//! How far what robots say is to be believed: levels of noise that grow where readings surprise, and who contradicts whom.

use std::collections::BTreeMap;

use super::{Block, Component, ErrorForm, Joint};
use crate::fact::Quantity;
use crate::fold::{Inflation, Quarantine};
use crate::{LandmarkId, RobotId, Timestamp};

/// What speaks for readings between two being wrong, by what one of them measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contradiction {
    /// Who measured.
    pub author: RobotId,
    /// What it measured.
    pub of: Party,
    /// Logarithm of the odds that they are wrong since it was last zero, nats.
    pub level: f64,
    /// How many readings there were, the earlier ones forgotten over some sixty.
    pub readings: f64,
    /// How many of them surprised.
    pub surprises: f64,
    /// When the last one that counted was.
    pub last: Timestamp,
}

/// What can be wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Party {
    /// A robot.
    Robot(RobotId),
    /// Where a landmark is.
    Landmark(LandmarkId),
    /// The map as fixes know it.
    Map,
}

impl Party {
    /// What a reading is of.
    pub(crate) fn of(quantity: &Quantity) -> Self {
        match quantity {
            Quantity::Robot { robot, .. } => Self::Robot(*robot),
            Quantity::Landmark { landmark, .. } | Quantity::Feature { landmark, .. } => {
                Self::Landmark(*landmark)
            }
            Quantity::Absolute(_) => Self::Map,
        }
    }

    fn is_robot(self) -> bool {
        matches!(self, Self::Robot(_))
    }

    fn words(self) -> [u64; 2] {
        match self {
            Self::Robot(robot) => [0, u64::from(robot.0)],
            Self::Landmark(landmark) => [1, u64::from(landmark.0)],
            Self::Map => [2, 0],
        }
    }
}

/// How far a robot is believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reputation {
    /// By how much more noise, as a variance, there is on what it says than it says; 1 unless levels follow
    /// ([`Inflation`]).
    pub noise_level: f64,
    /// What speaks against what it says, and against what it answers, nats.
    pub doubt: [f64; 2],
    /// When it was last taken out of the frame that it contradicted, into one of its own.
    pub detached: Option<Timestamp>,
    /// It is not believed any more ([`Quarantine`]).
    pub distrust: Option<Distrust>,
}

impl Default for Reputation {
    fn default() -> Self {
        Self { noise_level: 1.0, doubt: [0.0; 2], detached: None, distrust: None }
    }
}

impl Reputation {
    /// The bits of it, for comparing two estimates; none while nothing is known.
    pub(super) fn words(&self) -> Vec<u64> {
        if *self == Self::default() {
            return Vec::new();
        }
        let mut words = vec![self.noise_level.to_bits()];
        words.extend(self.doubt.map(f64::to_bits));
        words.extend(self.detached.map_or([0, 0], |at| [1, at.0.cast_unsigned()]));
        words
            .extend(self.distrust.map_or([0, 0], |of| [1 + u64::from(of.whole), of.since.0.cast_unsigned()]));
        words
    }
}

/// How much a robot's word is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Distrust {
    /// Since when.
    pub since: Timestamp,
    /// What it says of others, and what others say of it, is not believed either; else only what it says of the map.
    pub whole: bool,
}

/// Chi-square at 95 % by dimension: what of sound readings one in twenty exceeds.
const SURPRISE: [f64; 3] = [3.841, 5.991, 7.815];
/// Share of a sound robot's readings that surprise, at least: twice as many as there should be, for noise is never what is
/// stated. Where more of those between others do, it is theirs.
const SOUND: f64 = 0.1;
/// Worth of that in readings.
const PRIOR: f64 = 20.0;
/// Share of the readings that surprise of a robot with which something is wrong, unless that is common.
const WRONG: f64 = 0.7;
/// After so many readings of a kind one is forgotten but for a third.
const MEMORY: f64 = 64.0;
/// Readings of a pair closer to each other are of one look, ns, and count as one: what is wrong with one is wrong with all.
const LOOK_NS: i64 = 1_000_000_000;
/// A level grows up to so many times that which counts, so that what was wrong for an hour can be right within seconds.
const CAP: f64 = 2.0;
/// From here on two contradict each other, nats: one surprise where they are rare.
const CONTRADICTS: f64 = 1.5;

/// What a reading was, as far as its standing goes.
pub(crate) struct Surprise {
    pub time: Timestamp,
    pub dimension: usize,
    pub nis: f64,
    /// Largest that the gate takes.
    pub gate: f64,
    /// Probability that it is not of nothing.
    pub weight: f64,
    /// Share of the readings that are of nothing, as stated.
    pub nothing: f64,
}

/// A level after one more reading, where so large a share of sound ones surprises: the cumulative sum of Page (`page1954`).
fn counted(level: f64, surprises: bool, sound: f64, most: f64) -> f64 {
    let wrong = WRONG.max(0.5 * (1.0 + sound));
    let odds = if surprises { wrong / sound } else { (1.0 - wrong) / (1.0 - sound) };
    (level + libm::log(odds)).clamp(0.0, most)
}

impl Contradiction {
    pub(super) fn words(&self) -> [u64; 7] {
        let [kind, of] = self.of.words();
        let [level, readings, surprises] = [self.level, self.readings, self.surprises].map(f64::to_bits);
        [u64::from(self.author.0), kind, of, level, readings, surprises, self.last.0.cast_unsigned()]
    }

    /// Who it is between, in their order; robots are first.
    fn ends(&self) -> [Party; 2] {
        let ends = [Party::Robot(self.author), self.of];
        [ends[0].min(ends[1]), ends[0].max(ends[1])]
    }
}

impl Joint {
    /// What contradicts what, in the order of author and whom it measured; nothing unless it is kept ([`Quarantine`]).
    pub fn contradictions(&self) -> &[Contradiction] {
        &self.contradictions
    }

    /// The first of the robots in these blocks that is not believed any more, on others or on the map.
    pub(crate) fn distrusted(
        &self,
        mut robots: impl Iterator<Item = usize>,
        of_map: bool,
    ) -> Option<RobotId> {
        let member = robots.find_map(|index| {
            let member = self.part(index);
            member.reputation.distrust.filter(|distrust| distrust.whole || of_map).map(|_| member)
        });
        member.map(|member| member.robot)
    }

    /// Levels of noise of those who took part move so that squared innovations are what they should be: the score of the
    /// likelihood by the logarithm of a common level, over its information, over so many readings.
    pub(crate) fn follow(&mut self, inflation: &Inflation, robots: &[usize], of: &Surprise) {
        let ratio = of.nis.min(of.gate) / of.dimension as f64;
        let step = of.weight * (ratio - 1.0) / inflation.readings;
        for index in robots {
            let level = &mut self.part_mut(*index).reputation.noise_level;
            *level = (*level * libm::exp(step)).clamp(1.0, inflation.most);
        }
    }

    /// Counts a reading for or against those who took part, the author first. Gives the robot that alone explains what is wrong,
    /// if one does, and whether in whole.
    pub(crate) fn weigh(
        &mut self,
        quarantine: &Quarantine,
        robots: &[usize],
        partner: Party,
        of: &Surprise,
    ) -> Option<(RobotId, bool)> {
        let author = self.part(*robots.first()?).robot;
        let place = self.contradictions.binary_search_by_key(&(author, partner), |of| (of.author, of.of));
        if place.is_ok_and(|at| of.time.0 < self.contradictions[at].last.0.saturating_add(LOOK_NS)) {
            return None;
        }
        let most = CAP * quarantine.level;
        let surprises = of.nis > SURPRISE[of.dimension - 1];
        let [sound, without_author, without_partner] =
            self.shares_between_others(author, partner, of, quarantine);
        for ((index, side), sound) in robots.iter().zip([0, 1]).zip([without_author, without_partner]) {
            let doubt = &mut self.part_mut(*index).reputation.doubt[side];
            *doubt = counted(*doubt, surprises, sound, most);
        }
        let place = place.unwrap_or_else(|at| {
            let last = of.time;
            let fresh =
                Contradiction { author, of: partner, level: 0.0, readings: 0.0, surprises: 0.0, last };
            self.contradictions.insert(at, fresh);
            at
        });
        let pair = &mut self.contradictions[place];
        pair.level = counted(pair.level, surprises, sound, most);
        pair.readings = pair.readings * (1.0 - 1.0 / MEMORY) + 1.0;
        pair.surprises = pair.surprises * (1.0 - 1.0 / MEMORY) + f64::from(u8::from(surprises));
        pair.last = of.time;
        if !surprises {
            return None;
        }
        self.explains(quarantine, of.time)
    }

    /// Stops believing a robot.
    pub(crate) fn distrust(&mut self, robot: RobotId, distrust: Distrust) {
        if let Some(index) = self.index(robot) {
            self.part_mut(index).reputation.distrust = Some(distrust);
            self.acquit(robot, distrust.whole);
        }
    }

    /// Takes a robot that contradicts the others out of their frame into one of its own, from which it comes back once what is
    /// seen between the two agrees on how they lie: an honest robot that was lost does, a liar hardly. `false` if it was
    /// taken out since `since`, or is in no frame with others; then nothing is done.
    pub(crate) fn detach(&mut self, robot: RobotId, now: Timestamp, since: Timestamp) -> bool {
        let Some(index) = self.index(robot) else { return false };
        let member = self.part(index);
        let before = member.reputation.detached.is_some_and(|last| last >= since);
        if before || self.form != ErrorForm::Invariant || self.is_alone(robot) {
            return false;
        }
        self.untie_the_lost();
        self.covariance.clear(index);
        let member = self.part_mut(index);
        member.correction = member.nominal.inverse();
        member.component = Component::new(now, robot);
        member.reputation.detached = Some(now);
        member.reputation.distrust = None;
        self.acquit(robot, true);
        true
    }

    /// Forgets what was held against a robot, now that it is judged; and against the others, whom what it said has moved so that
    /// they contradict each other for a while.
    fn acquit(&mut self, robot: RobotId, whole: bool) {
        if !whole {
            self.contradictions.retain(|of| of.author != robot || of.of.is_robot());
            return;
        }
        self.contradictions.clear();
        for block in &mut self.blocks {
            if let Block::Robot(member) = block {
                member.reputation.doubt = [0.0; 2];
            }
        }
    }

    /// Shares of the readings that surprise in which neither takes part, and without the author, and without the partner: what
    /// is common in this team at this time, of robots or of the map, whatever these two say.
    fn shares_between_others(
        &self,
        author: RobotId,
        partner: Party,
        of: &Surprise,
        quarantine: &Quarantine,
    ) -> [f64; 3] {
        let least = SOUND + of.nothing * (1.0 - SOUND);
        let mut counts = [(PRIOR, PRIOR * least); 3];
        let same_kind = |of: &&Contradiction| of.of.is_robot() == partner.is_robot();
        for of in self.fresh(of.time, quarantine).filter(same_kind) {
            // Everyone has a part of the map; only what is of the other robot is left out.
            let is = |party: Party| of.ends().contains(&party);
            let of_either = [is(Party::Robot(author)), partner.is_robot() && is(partner)];
            let counted = [!of_either[0] && !of_either[1], !of_either[0], !of_either[1]];
            for ((readings, surprises), _) in counts.iter_mut().zip(counted).filter(|(_, counted)| *counted) {
                *readings += of.readings;
                *surprises += of.surprises;
            }
        }
        counts.map(|(readings, surprises)| (surprises / readings).max(least))
    }

    fn fresh(&self, now: Timestamp, quarantine: &Quarantine) -> impl Iterator<Item = &Contradiction> {
        let since = now.0.saturating_sub(quarantine.window_ns);
        self.contradictions.iter().filter(move |of| of.last.0 >= since)
    }

    /// The robot that explains what is wrong, if one does, and whether in whole.
    ///
    /// In whole if enough speaks against what it says or what is said of it, it contradicts two at least, and more than half of those
    /// it is compared with, and it is much likelier to be what is wrong than any other, or the map. On the map if it contradicts
    /// that by as much, and two others at least, and more than half of those who are compared with it, do not.
    fn explains(&self, quarantine: &Quarantine, now: Timestamp) -> Option<(RobotId, bool)> {
        // Both ways between two are one comparison.
        let mut between: BTreeMap<[Party; 2], f64> = BTreeMap::new();
        for of in self.fresh(now, quarantine) {
            *between.entry(of.ends()).or_default() += of.level;
        }
        let mut suspects: BTreeMap<Party, Suspect> = BTreeMap::new();
        for (ends, level) in &between {
            for end in ends {
                let suspect = suspects.entry(*end).or_default();
                suspect.level += level;
                suspect.compared += 1;
                suspect.contradicted += usize::from(*level >= CONTRADICTS);
            }
        }
        let (liar, first) = suspects.iter().max_by(|a, b| a.1.level.total_cmp(&b.1.level))?;
        let others = suspects.iter().filter(|(other, _)| *other != liar).map(|(_, other)| other.level);
        let second = others.fold(0.0, f64::max);
        let many = first.contradicted >= 2 && 2 * first.contradicted > first.compared;
        if let Party::Robot(robot) = liar
            && many
            && first.level - second >= 0.5 * quarantine.level
            && self
                .member(*robot)
                .is_some_and(|of| of.reputation.doubt.iter().sum::<f64>() >= quarantine.level)
        {
            return Some((*robot, true));
        }
        // Of what others agree with: how much speaks against each robot's word on it, and on how many parts of the map.
        let mut on_the_map: BTreeMap<RobotId, (f64, usize)> = BTreeMap::new();
        for ([robot, party], level) in &between {
            let Some(suspect) = suspects.get(party) else { continue };
            let sound = suspect.compared - suspect.contradicted;
            if let (Party::Robot(robot), false) = (robot, party.is_robot())
                && *level >= CONTRADICTS
                && sound >= 2
                && 2 * sound > suspect.compared
            {
                let (sum, parts) = on_the_map.entry(*robot).or_default();
                *sum += level;
                // One landmark may be taken for another, for as long as it is in sight.
                *parts += if *party == Party::Map { 2 } else { 1 };
            }
        }
        let worst = on_the_map.into_iter().max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        worst
            .filter(|(_, (sum, parts))| *sum >= quarantine.level && *parts >= 2)
            .map(|(robot, _)| (robot, false))
    }

    /// Forgets what contradicts a robot, which begins anew.
    pub(super) fn absolve(&mut self, robot: RobotId) {
        self.contradictions.retain(|of| !of.ends().contains(&Party::Robot(robot)));
    }
}

/// What speaks for a robot's, or the map's, being wrong.
#[derive(Default)]
struct Suspect {
    level: f64,
    compared: usize,
    contradicted: usize,
}
