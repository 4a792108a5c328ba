//! What a seed has in store for a team.

use super::Options;
use super::chance::Chance;
use super::network::Weather;

/// Something done to the team at an instant.
#[derive(Clone, Debug, PartialEq)]
pub enum Blow {
    /// The links change.
    Weather(Weather),
    /// Sides by robot, in the order of their numbers.
    Partition(Vec<u32>),
    Heal,
    /// The process of a robot is killed after so many more commands; it comes back after seconds.
    Kill {
        robot: u32,
        commands: u32,
        back_s: f64,
    },
    /// The power goes, with what was not synced.
    PowerLoss {
        robot: u32,
        back_s: f64,
    },
    /// The disk is lost.
    DiskLoss {
        robot: u32,
        back_s: f64,
    },
    /// The disk is full for some time.
    DiskFull {
        robot: u32,
        seconds: f64,
    },
    /// The operator evicts a robot, at one of the others.
    Evict {
        robot: u32,
        at: u32,
    },
}

/// The whole plan, by time.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Size of the team.
    pub robots: u32,
    /// Virtual time until everything heals, s.
    pub seconds: f64,
    /// The team closes its past on a grid of this distance; `None` if it keeps everything.
    pub cell_s: Option<f64>,
    /// Robots silent for longer are evicted by the majority.
    pub evict_after_s: Option<f64>,
    /// With so many items in memory a robot observes nothing more.
    pub most_items: Option<usize>,
    /// Facts are linearized together.
    pub relinearize: bool,
    /// Parameters, the landmark and garbage are found out.
    pub calibrate: bool,
    /// The nominal trajectories begin anew that far from their origin, m.
    pub rebase_m: f64,
    /// What links do at first.
    pub weather: Weather,
    /// What is done to the team, by time in s.
    pub blows: Vec<(f64, Blow)>,
}

impl Plan {
    /// The plan of a seed.
    pub fn new(seed: u64, options: &Options) -> Self {
        let mut chance = Chance::new(seed, 1);
        let robots = 2 + chance.below(3);
        let seconds = chance.between(20.0, 40.0);
        let cell_s = chance.happens(0.8).then(|| if chance.happens(0.5) { 1.0 } else { 3.0 });
        let rebase_m = if chance.happens(0.4) { 4.0 } else { 300.0 };
        let hard = !options.partitions_only;
        let mut plan = Self {
            robots,
            seconds,
            cell_s,
            evict_after_s: (chance.happens(0.15) && options.evictions).then_some(8.0),
            most_items: options.most_items,
            relinearize: options.relinearize,
            calibrate: options.calibrate,
            rebase_m,
            weather: weather(&mut chance),
            blows: Vec::new(),
        };
        let moment = |chance: &mut Chance| chance.between(1.0, seconds - 2.0);
        for _ in 0..chance.below(4) {
            let begin = moment(&mut chance);
            let sides = (0..robots).map(|_| chance.below(2)).collect();
            plan.blows.push((begin, Blow::Partition(sides)));
            plan.blows.push((begin + chance.between(1.0, 15.0), Blow::Heal));
        }
        for _ in 0..chance.below(3) {
            plan.blows.push((moment(&mut chance), Blow::Weather(weather(&mut chance))));
        }
        if hard {
            plan.strike(&mut chance, seconds, options.evictions);
        }
        plan.blows.sort_by(|a, b| a.0.total_cmp(&b.0));
        plan
    }

    fn strike(&mut self, chance: &mut Chance, seconds: f64, evictions: bool) {
        let robots = self.robots;
        let moment = |chance: &mut Chance| chance.between(1.0, seconds - 2.0);
        for _ in 0..chance.below(4) {
            let robot = 1 + chance.below(robots);
            let back_s = chance.between(0.3, 6.0);
            let at = moment(chance);
            let blow = match chance.below(8) {
                0..=3 => Blow::Kill { robot, commands: chance.below(4), back_s },
                4 | 5 => Blow::PowerLoss { robot, back_s: back_s + 1.0 },
                6 => Blow::DiskLoss { robot, back_s: back_s + 1.0 },
                _ => Blow::DiskFull { robot, seconds: back_s },
            };
            self.blows.push((at, blow));
        }
        if self.cell_s.is_some() && evictions && chance.happens(0.15) {
            let robot = 1 + chance.below(robots);
            let other = 1 + (robot - 1 + 1 + chance.below(robots - 1)) % robots;
            // Out of reach for long enough that somebody might give it up.
            let begin = chance.between(3.0, seconds * 0.4);
            let sides = (1..=robots).map(|number| u32::from(number == robot)).collect();
            self.blows.push((begin, Blow::Partition(sides)));
            self.blows.push((begin + chance.between(1.0, 5.0), Blow::Evict { robot, at: other }));
            self.blows.push((begin + chance.between(6.0, 12.0), Blow::Heal));
        }
    }

    /// How many items a robot may ever keep. While a robot has observed `k` times it keeps at least `2 k` items, so
    /// that with its last observation under the limit `M` it has made `M / 2`; each can become an entry with its
    /// answer and the fact: four items of every robot. Besides, votes and boots.
    pub fn most_allowed(&self) -> Option<usize> {
        let robots = usize::try_from(self.robots).unwrap_or(usize::MAX);
        self.most_items.map(|items| robots * (2 * items + 100))
    }

    /// Whether facts that were published can be lost for good.
    pub fn can_lose(&self) -> bool {
        let losing =
            |blow: &Blow| matches!(blow, Blow::PowerLoss { .. } | Blow::DiskLoss { .. } | Blow::Evict { .. });
        self.evict_after_s.is_some() || self.blows.iter().any(|(_, blow)| losing(blow))
    }
}

fn weather(chance: &mut Chance) -> Weather {
    let loss = [0.0, 0.1, 0.3, 0.5, 0.7, 0.9][chance.below(6) as usize];
    Weather {
        loss,
        burst: [1.0, 5.0, 30.0][chance.below(3) as usize],
        delay_s: chance.between(0.0, 0.05),
        jitter_s: if chance.happens(0.5) { chance.between(0.0, 0.6) } else { 0.01 },
        repeated: if chance.happens(0.5) { 0.2 } else { 0.0 },
    }
}
