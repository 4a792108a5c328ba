//! The ballots of `docs/ledger.md`, model-checked: every schedule of three robots that seal, ask for a change
//! of the team, promise, propose, accept, tell one another and close, with the decisions the ledger itself
//! takes (`pleiad_estimation::ledger::rules`). The two stages of a seal are one here; `ledger_model.rs` has
//! them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::collections::BTreeSet;

use pleiad_estimation::RobotId;
use pleiad_estimation::fact::Ballot;
use pleiad_estimation::ledger::rules::{bound, is_decided, may_accept, may_promise};

const ROBOTS: usize = 3;

/// A change: who goes and how much of its log is accepted, or, with nobody, someone who comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Change {
    removed: Option<u8>,
    held: u8,
    /// A newcomer takes part in what is after this.
    from: u8,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Entry {
    Seal(u8),
    Promise { ballot: (u8, u8), change: Change },
    Accept { ballot: (u8, u8), change: Change },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rule {
    Ballots,
    /// Wrong: who has promised goes on sealing.
    SealsOn,
    /// Wrong: a later ballot proposes what it likes.
    Unbound,
    /// Wrong: who has given a robot up relies on its later words.
    ReliesOn,
    /// Wrong: a promise is read without what its robot said in an earlier boot.
    LastBoot,
}

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct State {
    /// Of two boots each.
    logs: [[Vec<Entry>; 2]; ROBOTS],
    boot: [usize; ROBOTS],
    /// `held[p][r]`: how many entries of `r`'s logs `p` holds; of its own, all.
    held: [[[u8; 2]; ROBOTS]; ROBOTS],
    /// The last cut of each robot under the old membership, and how much of each log it rests on.
    closed: [(u8, [u8; ROBOTS]); ROBOTS],
}

#[derive(Clone, Copy, Debug)]
struct Bounds {
    clock: u8,
    ballots: usize,
    /// Robots that begin a second boot. Cuts are modelled without.
    restarts: usize,
}

fn of((round, robot): (u8, u8)) -> Ballot {
    Ballot { round: u32::from(round), robot: RobotId(u32::from(robot)) }
}

fn index(number: usize) -> u8 {
    u8::try_from(number).unwrap()
}

impl State {
    fn new() -> Self {
        Self {
            logs: Default::default(),
            boot: [0; ROBOTS],
            held: [[[0; 2]; ROBOTS]; ROBOTS],
            closed: [(0, [0; ROBOTS]); ROBOTS],
        }
    }

    fn view(&self, p: usize, r: usize) -> impl DoubleEndedIterator<Item = &Entry> {
        let of = |boot: usize| &self.logs[r][boot][..usize::from(self.held[p][r][boot])];
        of(0).iter().chain(of(1))
    }

    fn said(&self, r: usize) -> impl DoubleEndedIterator<Item = &Entry> {
        self.logs[r].iter().flatten()
    }

    /// Whether `p` holds all of `r`'s earlier log, if it holds anything of the later one: the first entry of that
    /// says how long the earlier is.
    fn knows_past(&self, p: usize, r: usize) -> bool {
        self.held[p][r][1] == 0 || usize::from(self.held[p][r][0]) == self.logs[r][0].len()
    }

    fn say(&self, r: usize, entry: Entry) -> Self {
        let mut next = self.clone();
        let boot = self.boot[r];
        next.logs[r][boot].push(entry);
        next.held[r][r][boot] = index(next.logs[r][boot].len());
        next
    }

    fn promised(&self, p: usize, r: usize) -> Option<Ballot> {
        let ballots = self.view(p, r).filter_map(|entry| match entry {
            Entry::Promise { ballot, .. } | Entry::Accept { ballot, .. } => Some(of(*ballot)),
            Entry::Seal(_) => None,
        });
        ballots.max()
    }

    /// What is decided in the entries that are seen.
    fn decided<'a, V: Iterator<Item = &'a Entry>>(view: impl Fn(usize) -> V) -> Vec<Change> {
        let mut found: Vec<((u8, u8), Change, usize)> = Vec::new();
        for r in 0..ROBOTS {
            for entry in view(r) {
                let Entry::Accept { ballot, change } = entry else { continue };
                match found.iter_mut().find(|(b, c, _)| b == ballot && c == change) {
                    Some((_, _, count)) => *count += 1,
                    None => found.push((*ballot, *change, 1)),
                }
            }
        }
        let staying = |change: &Change| ROBOTS - usize::from(change.removed.is_some());
        found.retain(|(_, change, count)| is_decided(ROBOTS, staying(change), *count, false));
        found.into_iter().map(|(_, change, _)| change).collect()
    }

    fn sealed(&self, p: usize, r: usize, within: u8) -> (u8, u8) {
        let entries = self.view(p, r).enumerate().take(usize::from(within));
        let seals = entries.filter_map(|(place, entry)| match entry {
            Entry::Seal(until) => Some((*until, index(place) + 1)),
            _ => None,
        });
        seals.last().unwrap_or((0, 0))
    }

    /// How much of `r`'s log `p` relies on.
    fn relied(&self, p: usize, r: usize, rule: Rule) -> u8 {
        let given_up = self.said(p).filter_map(|entry| match entry {
            Entry::Promise { change, .. } if change.removed == Some(index(r)) => Some(change.held),
            _ => None,
        });
        if rule == Rule::ReliesOn { u8::MAX } else { given_up.min().unwrap_or(u8::MAX) }
    }

    /// What is wrong with what has been decided and closed so far.
    fn wrong(&self) -> Option<String> {
        let decided = Self::decided(|r| self.said(r));
        let change = decided.first()?;
        if decided.iter().any(|other| other != change) {
            return Some(format!("two changes are decided: {self:?}"));
        }
        for (p, (cut, rests_on)) in self.closed.iter().enumerate() {
            match change.removed {
                Some(gone) if usize::from(gone) != p && rests_on[usize::from(gone)] > change.held => {
                    return Some(format!("{p} rests on words that are not accepted: {self:?}"));
                }
                None if *cut > change.from => {
                    return Some(format!("{p} has closed {cut} without the newcomer: {self:?}"));
                }
                _ => {}
            }
        }
        None
    }

    fn steps(&self, rule: Rule, bounds: Bounds, out: &mut Vec<State>) {
        let begun = (0..ROBOTS).flat_map(|r| self.said(r).map(move |entry| (r, entry)));
        let begun = begun
            .filter(
                |(r, entry)| matches!(entry, Entry::Promise { ballot, .. } if usize::from(ballot.1) == *r),
            )
            .count();
        let restarted: usize = self.boot.iter().sum();
        for r in 0..ROBOTS {
            for (p, boot) in (0..ROBOTS).filter(|p| *p != r).flat_map(|p| [(p, 0), (p, 1)]) {
                if usize::from(self.held[p][r][boot]) < self.logs[r][boot].len() {
                    let mut next = self.clone();
                    next.held[p][r][boot] += 1;
                    out.push(next);
                }
            }
            if self.boot[r] == 0 && !self.logs[r][0].is_empty() && restarted < bounds.restarts {
                let mut next = self.clone();
                next.boot[r] = 1;
                out.push(next);
            }
            let known = Self::decided(|by| self.view(r, by));
            let (own, _) = self.sealed(r, r, u8::MAX);
            if let Some(change) = known.first() {
                // A robot that knows seals again; the others read its entries in order.
                if change.removed != Some(index(r)) && own < bounds.clock {
                    out.push(self.say(r, Entry::Seal(own + 1)));
                }
                continue;
            }
            let promised = self.promised(r, r);
            if own < bounds.clock && (promised.is_none() || rule == Rule::SealsOn) {
                out.push(self.say(r, Entry::Seal(own + 1)));
            }
            let promise = |ballot, removed: Option<u8>| {
                let held = removed.map_or(0, |gone| self.held[r][usize::from(gone)].iter().sum());
                Entry::Promise { ballot, change: Change { removed, held, from: own } }
            };
            if begun < bounds.ballots {
                let rounds = (0..ROBOTS).filter_map(|by| self.promised(r, by)).map(|ballot| ballot.round);
                let round = u8::try_from(rounds.max().unwrap_or(0) + 1).unwrap();
                let others = (0..ROBOTS).filter(|gone| *gone != r).map(|gone| Some(index(gone)));
                for removed in others.chain([None]) {
                    out.push(self.say(r, promise((round, index(r)), removed)));
                }
            }
            for by in 0..ROBOTS {
                for entry in self.view(r, by) {
                    match entry {
                        Entry::Promise { ballot, change }
                            if usize::from(ballot.1) == by
                                && change.removed != Some(index(r))
                                && may_promise(promised, of(*ballot)) =>
                        {
                            out.push(self.say(r, promise(*ballot, change.removed)));
                        }
                        Entry::Accept { ballot, change }
                            if usize::from(ballot.1) == by
                                && change.removed != Some(index(r))
                                && may_accept(promised, of(*ballot))
                                && !self.said(r).any(|said| said == entry) =>
                        {
                            out.push(self.say(r, Entry::Accept { ballot: *ballot, change: *change }));
                        }
                        _ => {}
                    }
                }
            }
            out.extend(self.propose(r, rule));
            // A cut under the old membership.
            let seals: Vec<(u8, u8)> = (0..ROBOTS)
                .map(|by| self.sealed(r, by, if by == r { u8::MAX } else { self.relied(r, by, rule) }))
                .collect();
            let cut = seals.iter().map(|(until, _)| *until).min().unwrap();
            if cut > self.closed[r].0 {
                let mut next = self.clone();
                let reaches = |entry: &Entry| matches!(entry, Entry::Seal(until) if *until >= cut);
                let rests_on = std::array::from_fn(|by| index(self.said(by).position(reaches).unwrap()) + 1);
                next.closed[r] = (cut, rests_on);
                out.push(next);
            }
        }
    }

    fn propose(&self, r: usize, rule: Rule) -> Option<State> {
        let own = self.said(r).rev().find_map(|entry| match entry {
            Entry::Promise { ballot, change } => Some((*ballot, *change)),
            _ => None,
        });
        let (ballot, asked) = own.filter(|(ballot, _)| usize::from(ballot.1) == r)?;
        let proposed = |entry: &Entry| matches!(entry, Entry::Accept { ballot: of, .. } if *of == ballot);
        if self.promised(r, r) != Some(of(ballot)) || self.said(r).any(proposed) {
            return None;
        }
        let staying = (0..ROBOTS).filter(|by| asked.removed != Some(index(*by)));
        let promises: Vec<(usize, Change)> = staying
            .clone()
            .filter(|by| rule == Rule::LastBoot || self.knows_past(r, *by))
            .filter_map(|by| {
                self.view(r, by).find_map(|entry| match entry {
                    Entry::Promise { ballot: of, change } if *of == ballot => Some((by, *change)),
                    _ => None,
                })
            })
            .collect();
        if promises.len() < staying.count() {
            return None;
        }
        let accepted =
            promises.iter().flat_map(|(by, _)| self.view(r, *by)).filter_map(|entry| match entry {
                Entry::Accept { ballot, change } => Some((of(*ballot), change)),
                _ => None,
            });
        let fresh = Change {
            removed: asked.removed,
            held: promises.iter().map(|(_, change)| change.held).max().unwrap_or(0),
            from: promises.iter().map(|(_, change)| change.from).max().unwrap_or(0),
        };
        let change = if rule == Rule::Unbound { None } else { bound(accepted, of(ballot)).copied() };
        Some(self.say(r, Entry::Accept { ballot, change: change.unwrap_or(fresh) }))
    }
}

/// Every state that can be reached, and the first thing that goes wrong.
fn explore(rule: Rule, bounds: Bounds) -> (usize, Option<String>) {
    let mut seen = BTreeSet::from([State::new()]);
    let mut open = vec![State::new()];
    let mut next = Vec::new();
    while let Some(state) = open.pop() {
        if let Some(wrong) = state.wrong() {
            return (seen.len(), Some(wrong));
        }
        next.clear();
        state.steps(rule, bounds, &mut next);
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
fn no_schedule_decides_two_changes_or_closes_against_one() {
    let (states, wrong) = explore(Rule::Ballots, Bounds { clock: 1, ballots: 1, restarts: 0 });
    println!("{states} states");
    assert_eq!(wrong, None);
    assert!(states > 10_000, "{states}");
}

#[test]
fn nor_in_later_cuts() {
    let (states, wrong) = explore(Rule::Ballots, Bounds { clock: 2, ballots: 1, restarts: 0 });
    println!("{states} states");
    assert_eq!(wrong, None);
}

#[test]
fn nor_with_two_ballots_that_compete() {
    let (states, wrong) = explore(Rule::Ballots, Bounds { clock: 0, ballots: 2, restarts: 0 });
    println!("{states} states");
    assert_eq!(wrong, None);
}

#[test]
fn nor_with_a_robot_that_begins_a_second_boot() {
    let (states, wrong) = explore(Rule::Ballots, Bounds { clock: 0, ballots: 2, restarts: 1 });
    println!("{states} states");
    assert_eq!(wrong, None);
}

#[test]
fn a_promise_without_what_was_said_in_an_earlier_boot_is_caught() {
    let (states, wrong) = explore(Rule::LastBoot, Bounds { clock: 0, ballots: 2, restarts: 1 });
    println!("{states} states: {}", wrong.is_some());
    assert!(wrong.is_some_and(|wrong| wrong.contains("two changes")));
}

#[cfg(feature = "slow")]
#[test]
fn nor_with_two_ballots_and_cuts() {
    let (states, wrong) = explore(Rule::Ballots, Bounds { clock: 1, ballots: 2, restarts: 0 });
    println!("{states} states");
    assert_eq!(wrong, None);
}

#[test]
fn sealing_on_after_a_promise_is_caught() {
    let (states, wrong) = explore(Rule::SealsOn, Bounds { clock: 1, ballots: 1, restarts: 0 });
    println!("{states} states: {wrong:?}");
    assert!(wrong.is_some_and(|wrong| wrong.contains("newcomer")));
}

#[test]
fn relying_on_who_is_given_up_is_caught() {
    let (states, wrong) = explore(Rule::ReliesOn, Bounds { clock: 1, ballots: 1, restarts: 0 });
    println!("{states} states: {wrong:?}");
    assert!(wrong.is_some_and(|wrong| wrong.contains("not accepted")));
}

#[test]
fn proposing_against_what_was_accepted_is_caught() {
    let (states, wrong) = explore(Rule::Unbound, Bounds { clock: 0, ballots: 2, restarts: 0 });
    println!("{states} states: {}", wrong.is_some());
    assert!(wrong.is_some_and(|wrong| wrong.contains("two changes")));
}
