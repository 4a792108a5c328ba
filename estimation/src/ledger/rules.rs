//! The decisions by which a team closes its past, apart from what they are taken on. The ledger takes them
//! on the logs it holds, the model check (`tests/tests/ledger_model.rs`) on every state that three robots
//! can reach. `docs/ledger.md` has the proof.

use std::collections::BTreeSet;

use crate::fact::Ballot;
use crate::{RobotId, Timestamp};

/// What a team agrees on to close its past.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Closure {
    /// Who belongs to it from the start.
    pub members: BTreeSet<RobotId>,
    /// Distance of the times at which it may be closed, ns.
    pub cell_ns: i64,
}

impl Closure {
    /// The last time of the grid at or before `time`.
    pub fn floor(&self, time: Timestamp) -> Timestamp {
        let cell = self.cell_ns.max(1);
        match time.0.checked_sub(time.0.rem_euclid(cell)) {
            Some(floor) => Timestamp(floor),
            None => Timestamp::MIN,
        }
    }
}

/// How far a member has promised, by the seals of its that count here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Standing {
    /// Stage one.
    pub observed: Timestamp,
    /// Stage two.
    pub answered: Timestamp,
    /// It takes part in what is after this; [`Timestamp::MIN`] from the start.
    pub from: Timestamp,
}

/// Up to when a robot may say that it has answered everything that names it: as far as every member has
/// promised not to observe any more, and before the first observation it still owes an answer to.
pub fn answerable(members: impl IntoIterator<Item = Standing>, owed: Option<Timestamp>) -> Timestamp {
    let sealed = members.into_iter().map(|member| member.observed.max(member.from)).min();
    let owed = owed.map_or(Timestamp::MAX, |owed| Timestamp(owed.0.saturating_sub(1)));
    sealed.unwrap_or(Timestamp::MIN).min(owed)
}

/// Up to when nothing can change any more: every member has promised both. Not yet on the grid.
pub fn final_until(members: impl IntoIterator<Item = Standing>) -> Timestamp {
    let promised = |member: Standing| member.observed.min(member.answered).max(member.from);
    members.into_iter().map(promised).min().unwrap_or(Timestamp::MIN)
}

/// How much of a log a seal asks for before it counts: what it says its length is, or less if the robot has
/// said later that the log ends earlier, nobody holding more of it.
pub fn needed(said: u64, ends: Option<u64>) -> u64 {
    ends.map_or(said, |ends| said.min(ends))
}

/// Whether a robot that has promised `promised` last may promise `asked`: to accept nothing earlier any more.
pub fn may_promise(promised: Option<Ballot>, asked: Ballot) -> bool {
    promised.is_none_or(|promised| asked > promised)
}

/// Whether it may accept what is proposed in `ballot`.
pub fn may_accept(promised: Option<Ballot>, ballot: Ballot) -> bool {
    promised.is_none_or(|promised| ballot >= promised)
}

/// What a robot must propose in `ballot` once all who would stay have promised it: what any of them has
/// accepted in the latest ballot before. Its own wish only if there is no such thing.
pub fn bound<'a, V>(accepted: impl IntoIterator<Item = (Ballot, &'a V)>, ballot: Ballot) -> Option<&'a V> {
    accepted.into_iter().filter(|(of, _)| *of < ballot).max_by_key(|(of, _)| *of).map(|(_, value)| value)
}

/// Whether a proposal is decided that so many of those who would stay have accepted.
pub fn is_decided(members: usize, staying: usize, accepting: usize, operator: bool) -> bool {
    may_decide(members, accepting, false) || (operator && accepting > 0 && accepting == staying)
}

/// Whether those who would stay may decide without those who would go.
pub fn may_decide(members: usize, staying: usize, operator: bool) -> bool {
    staying > 0 && (operator || staying == members || 2 * staying > members)
}
