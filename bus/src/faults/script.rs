//! Chance made into a script: when faults happen that are to happen now and then, and to whom.

use std::collections::{BTreeMap, BTreeSet};

use pleiad_protocol::RobotId;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::plan::{Fault, FaultPlan, Rule};

/// A process has this long between two faults to come to itself, s.
const PAUSE_S: f64 = 2.0;

impl FaultPlan {
    /// Whether something is to happen at random times that have not been drawn yet.
    pub fn is_random(&self) -> bool {
        self.rules.iter().any(|rule| rule.again.is_some())
    }

    /// The same plan with its random times drawn: each fault that happens now and then becomes as many that
    /// happen once, within its own window and before `until_s`. Where it names no groups or robots, or several
    /// robots, one is drawn each time. Nothing befalls a process while something else does.
    ///
    /// Every rule draws from a stream of its own. Equal seeds give equal scripts.
    pub fn scripted(&self, seed: u64, robots: &BTreeSet<RobotId>, until_s: f64) -> Self {
        let mut busy = Busy::default();
        for rule in self.rules.iter().filter(|rule| rule.again.is_none() && rule.fault.is_of_processes()) {
            for robot in rule.fault.robots().into_iter().flatten() {
                busy.take(*robot, rule.start_s, rule.end_s);
            }
        }
        let mut rules = Vec::new();
        for (index, rule) in self.rules.iter().enumerate() {
            let Some(again) = rule.again else {
                rules.push(rule.clone());
                continue;
            };
            let mut chance = ChaCha8Rng::seed_from_u64(seed);
            // Links draw from the streams of their robots' numbers, which this is above in practice.
            chance.set_stream(u64::MAX - index as u64);
            let mut about = |mean: f64| mean * (0.5 + chance.random::<f64>());
            let last_s = rule.end_s.min(until_s);
            let mut start_s = rule.start_s + about(again.every_s);
            let mut spans = Vec::new();
            while start_s < last_s {
                let end_s = (start_s + about(again.for_s)).min(last_s);
                spans.push((start_s, end_s));
                start_s = end_s + about(again.every_s);
            }
            for (start_s, end_s) in spans {
                let mut fault = rule.fault.clone();
                if draw(&mut fault, robots, &mut chance, &mut busy, (start_s, end_s)) {
                    rules.push(Rule { fault, start_s, end_s, again: None, ..rule.clone() });
                }
            }
        }
        Self { rules }
    }
}

/// When something befalls each robot's process.
#[derive(Default)]
struct Busy(BTreeMap<RobotId, Vec<(f64, f64)>>);

impl Busy {
    fn take(&mut self, robot: RobotId, start_s: f64, end_s: f64) {
        self.0.entry(robot).or_default().push((start_s, end_s));
    }

    fn is_free(&self, robot: RobotId, (start_s, end_s): (f64, f64)) -> bool {
        let apart = |span: &(f64, f64)| end_s + PAUSE_S <= span.0 || span.1 + PAUSE_S <= start_s;
        self.0.get(&robot).is_none_or(|spans| spans.iter().all(apart))
    }
}

/// Draws whom a fault befalls; false if there is nobody.
fn draw(
    fault: &mut Fault,
    robots: &BTreeSet<RobotId>,
    chance: &mut ChaCha8Rng,
    busy: &mut Busy,
    span: (f64, f64),
) -> bool {
    let of_processes = fault.is_of_processes();
    if let Fault::Partition { groups } = fault {
        if groups.is_empty() {
            return split(robots, chance).is_some_and(|group| {
                groups.push(group);
                true
            });
        }
        return true;
    }
    let Some(named) = fault.robots_mut() else { return true };
    let among = if named.is_empty() { robots } else { &*named };
    let free = among.iter().filter(|robot| !of_processes || busy.is_free(**robot, span));
    let free: Vec<RobotId> = free.copied().collect();
    if free.is_empty() {
        return false;
    }
    let robot = free[chance.random_range(0..free.len())];
    *named = BTreeSet::from([robot]);
    if of_processes {
        busy.take(robot, span.0, span.1);
    }
    true
}

/// Some of the robots, neither none nor all; `None` if there are fewer than two.
fn split(robots: &BTreeSet<RobotId>, chance: &mut ChaCha8Rng) -> Option<BTreeSet<RobotId>> {
    if robots.len() < 2 {
        return None;
    }
    let mut rest: Vec<RobotId> = robots.iter().copied().collect();
    let size = chance.random_range(1..robots.len());
    Some((0..size).map(|_| rest.swap_remove(chance.random_range(0..rest.len()))).collect())
}

#[cfg(test)]
mod tests;
