//! The seals of `docs/ledger.md`, model-checked: every schedule of three robots that observe, answer, seal,
//! tell one another and close, explored to the end with the decisions the ledger itself takes
//! (`pleiad_estimation::ledger::rules`).

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::collections::BTreeSet;

use pleiad_estimation::Timestamp;
use pleiad_estimation::ledger::rules::{Standing, answerable, final_until};

const ROBOTS: usize = 3;

/// One entry of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Entry {
    /// Robot `of` was seen at `time`.
    Seen {
        time: i8,
        of: u8,
    },
    /// The answer to entry `entry` of robot `by`.
    Half {
        by: u8,
        entry: u8,
    },
    Seal {
        observed: i8,
        answered: i8,
    },
}

/// By which rule a robot closes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rule {
    Seals,
    /// Wrong: up to the last time of which every robot has said something, all of it acknowledged.
    Acknowledged,
    /// Wrong: by the first stage alone.
    FirstStage,
}

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct State {
    clock: [i8; ROBOTS],
    logs: [Vec<Entry>; ROBOTS],
    /// `held[p][r]`: how many entries of `r`'s log `p` holds; of its own, all.
    held: [[u8; ROBOTS]; ROBOTS],
    /// The last cut of each robot.
    closed: [i8; ROBOTS],
}

/// How far the schedules go.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    clock: i8,
    observations: usize,
}

fn at(time: i8) -> Timestamp {
    Timestamp(i64::from(time))
}

fn back(time: Timestamp) -> i8 {
    i8::try_from(time.0.clamp(-1, 100)).unwrap()
}

impl State {
    fn new() -> Self {
        Self {
            clock: [0; ROBOTS],
            logs: Default::default(),
            held: [[0; ROBOTS]; ROBOTS],
            closed: [-1; ROBOTS],
        }
    }

    fn view(&self, p: usize, r: usize) -> &[Entry] {
        &self.logs[r][..usize::from(self.held[p][r])]
    }

    fn standing(&self, p: usize, r: usize) -> Standing {
        let seal = self.view(p, r).iter().rev().find_map(|entry| match entry {
            Entry::Seal { observed, answered } => Some((*observed, *answered)),
            _ => None,
        });
        let (observed, answered) = seal.unwrap_or((-1, -1));
        Standing { observed: at(observed), answered: at(answered), from: Timestamp::MIN }
    }

    /// Whether `p` holds the answer to an entry of `by`.
    fn answered(&self, p: usize, by: usize, entry: usize) -> bool {
        (0..ROBOTS).any(|r| {
            self.view(p, r).iter().any(
                |other| matches!(other, Entry::Half { by: b, entry: e } if usize::from(*b) == by && usize::from(*e) == entry),
            )
        })
    }

    /// Observations of `r` that it holds and has not answered: whose, which, when.
    fn owed(&self, r: usize) -> Vec<(usize, usize, i8)> {
        let mut owed = Vec::new();
        for by in 0..ROBOTS {
            for (index, entry) in self.view(r, by).iter().enumerate() {
                if let Entry::Seen { time, of } = entry
                    && usize::from(*of) == r
                    && !self.answered(r, by, index)
                {
                    owed.push((by, index, *time));
                }
            }
        }
        owed
    }

    fn say(&mut self, r: usize, entry: Entry) {
        self.logs[r].push(entry);
        self.held[r][r] = u8::try_from(self.logs[r].len()).unwrap();
    }

    fn observations(&self) -> usize {
        self.logs.iter().flatten().filter(|entry| matches!(entry, Entry::Seen { .. })).count()
    }

    fn cut(&self, p: usize, rule: Rule) -> i8 {
        let standings = (0..ROBOTS).map(|r| self.standing(p, r));
        match rule {
            Rule::Seals => back(final_until(standings)),
            Rule::FirstStage => {
                back(final_until(standings.map(|member| Standing { answered: member.observed, ..member })))
            }
            Rule::Acknowledged => {
                let all_hold = (0..ROBOTS).all(|r| (0..ROBOTS).all(|q| self.held[q][r] >= self.held[p][r]));
                let last = |r: usize| {
                    let times = self.view(p, r).iter().filter_map(|entry| match entry {
                        Entry::Seen { time, .. } => Some(*time),
                        Entry::Seal { observed, .. } => Some(*observed),
                        Entry::Half { .. } => None,
                    });
                    times.max().unwrap_or(-1)
                };
                if all_hold { (0..ROBOTS).map(last).min().unwrap() } else { -1 }
            }
        }
    }

    /// The states one step later; what is wrong with a step, if anything is.
    fn steps(&self, rule: Rule, bounds: Bounds, out: &mut Vec<State>) -> Option<String> {
        for r in 0..ROBOTS {
            if self.clock[r] < bounds.clock {
                let mut next = self.clone();
                next.clock[r] += 1;
                out.push(next);
            }
            let own = self.standing(r, r);
            // A sensor may deliver one tick late.
            for time in [self.clock[r], self.clock[r] - 1] {
                if time < 0 || at(time) <= own.observed || self.observations() >= bounds.observations {
                    continue;
                }
                for of in (0..ROBOTS).filter(|of| *of != r) {
                    if let Some(p) = (0..ROBOTS).find(|p| self.closed[*p] >= time) {
                        return Some(format!("{r} observes at {time}, which {p} has closed: {self:?}"));
                    }
                    let mut next = self.clone();
                    next.say(r, Entry::Seen { time, of: u8::try_from(of).unwrap() });
                    out.push(next);
                }
            }
            for p in (0..ROBOTS).filter(|p| *p != r) {
                if usize::from(self.held[p][r]) < self.logs[r].len() {
                    let mut next = self.clone();
                    next.held[p][r] += 1;
                    out.push(next);
                }
            }
            if let Some((by, entry, _)) = self.owed(r).iter().find(|(_, _, time)| *time <= self.clock[r]) {
                let mut next = self.clone();
                let (by, entry) = (u8::try_from(*by).unwrap(), u8::try_from(*entry).unwrap());
                next.say(r, Entry::Half { by, entry });
                out.push(next);
            }
            let (observed, answered) = (back(own.observed), back(own.answered));
            if self.clock[r] - 1 > observed {
                let mut next = self.clone();
                next.say(r, Entry::Seal { observed: self.clock[r] - 1, answered });
                out.push(next);
            }
            let owed = self.owed(r).iter().map(|(_, _, time)| at(*time)).min();
            let until = back(answerable((0..ROBOTS).map(|other| self.standing(r, other)), owed));
            if until > answered && rule != Rule::FirstStage {
                let mut next = self.clone();
                next.say(r, Entry::Seal { observed, answered: until });
                out.push(next);
            }
            let cut = self.cut(r, rule);
            if cut > self.closed[r] {
                // Everything that was ever seen up to the cut is there, with its answer.
                for by in 0..ROBOTS {
                    for (index, entry) in self.logs[by].iter().enumerate() {
                        let Entry::Seen { time, .. } = entry else { continue };
                        let there = index < usize::from(self.held[r][by]) && self.answered(r, by, index);
                        if *time <= cut && !there {
                            return Some(format!("{r} closes {cut} without entry {index} of {by}: {self:?}"));
                        }
                    }
                }
                let mut next = self.clone();
                next.closed[r] = cut;
                out.push(next);
            }
        }
        None
    }
}

/// Every state that can be reached, and the first thing that goes wrong.
fn explore(rule: Rule, bounds: Bounds) -> (usize, Option<String>) {
    let mut seen = BTreeSet::from([State::new()]);
    let mut open = vec![State::new()];
    let mut next = Vec::new();
    while let Some(state) = open.pop() {
        next.clear();
        if let Some(wrong) = state.steps(rule, bounds, &mut next) {
            return (seen.len(), Some(wrong));
        }
        for state in next.drain(..) {
            if !seen.contains(&state) {
                seen.insert(state.clone());
                open.push(state);
            }
        }
    }
    (seen.len(), None)
}

#[test]
fn no_schedule_of_three_robots_closes_what_is_not_final() {
    let (states, wrong) = explore(Rule::Seals, Bounds { clock: 1, observations: 1 });
    println!("{states} states");
    assert_eq!(wrong, None);
    assert!(states > 10_000, "{states}");
}

#[cfg(feature = "slow")]
#[test]
fn nor_with_two_observations() {
    let (states, wrong) = explore(Rule::Seals, Bounds { clock: 1, observations: 2 });
    println!("{states} states");
    assert_eq!(wrong, None);
}

#[test]
fn closing_by_what_is_acknowledged_is_caught() {
    let (states, wrong) = explore(Rule::Acknowledged, Bounds { clock: 2, observations: 2 });
    println!("{states} states: {wrong:?}");
    assert!(wrong.is_some());
}

#[test]
fn closing_by_the_first_stage_alone_is_caught() {
    let (states, wrong) = explore(Rule::FirstStage, Bounds { clock: 2, observations: 1 });
    println!("{states} states: {wrong:?}");
    assert!(wrong.is_some_and(|wrong| wrong.contains("without")));
}
