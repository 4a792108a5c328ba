//! What a robot has to vote.

use std::collections::{BTreeMap, BTreeSet};

use crate::fact::{Ballot, LogId, Vote, WHOLE};
use crate::ledger::closure::Closing;
use crate::ledger::{Ledger, rules};
use crate::{BootIndex, RobotId, Timestamp};

/// What a robot would change about the team.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Wish {
    /// To be evicted.
    pub evict: BTreeSet<RobotId>,
    /// Absent for long enough here to agree when others want them evicted.
    pub absent: BTreeSet<RobotId>,
    /// To be admitted, from which boot on.
    pub admit: BTreeMap<RobotId, BootIndex>,
    /// It is an operator's.
    pub operator: bool,
    /// The ballots so far have led to nothing for long enough.
    pub impatient: bool,
}

impl Ledger {
    /// What the owner has to vote next, if anything.
    pub fn proposal(&self, wish: &Wish) -> Option<Vote> {
        let closing = self.closing.as_ref()?;
        if !closing.views.is_active(closing.owner) || closing.views.decided().is_some() {
            return None;
        }
        let vote = accept(closing).or_else(|| self.propose(closing, wish));
        vote.or_else(|| self.promise(closing, wish)).or_else(|| self.begin(closing, wish))
    }

    /// Promises the latest ballot of another, if it agrees to do without those who are to go.
    fn promise(&self, closing: &Closing, wish: &Wish) -> Option<Vote> {
        let (views, owner) = (&closing.views, closing.owner);
        let promised = views.ballot(owner);
        let given_up = views.given_up(owner);
        let asked = views.active().filter_map(|term| {
            views.promises(term.robot).next_back().filter(|vote| vote.ballot.robot == term.robot)
        });
        let agreed = |vote: &&Vote| {
            let gone = |robot: &RobotId| {
                wish.evict.contains(robot) || wish.absent.contains(robot) || given_up.contains(robot)
            };
            !vote.removed.contains(&owner)
                && rules::may_promise(promised, vote.ballot)
                && (vote.operator || vote.removed.iter().all(gone))
        };
        let asked = asked.filter(agreed).max_by_key(|vote| vote.ballot)?;
        Some(self.promise_of(closing, asked.ballot, asked.removed.clone(), asked.operator))
    }

    /// Begins a ballot of its own, if it wants something that the ballots so far do not bring.
    fn begin(&self, closing: &Closing, wish: &Wish) -> Option<Vote> {
        let (views, owner) = (&closing.views, closing.owner);
        let latest = views.active().filter_map(|term| views.ballot(term.robot)).max();
        let under_way =
            views.active().flat_map(|term| views.promises(term.robot)).max_by_key(|vote| vote.ballot);
        let evict: BTreeSet<RobotId> =
            wish.evict.iter().copied().filter(|robot| *robot != owner && views.is_active(*robot)).collect();
        // Once by itself; after that two robots that want different things would outbid one another for ever.
        let first = !views.promises(owner).any(|vote| vote.ballot.robot == owner);
        let more = under_way.is_none_or(|vote| !evict.iter().all(|robot| vote.removed.contains(robot)));
        let admit = wish.admit.keys().any(|robot| !views.is_active(*robot));
        let wanted = !evict.is_empty() || admit;
        let begins = (wanted && under_way.is_none())
            || (!evict.is_empty() && more && first)
            || (wish.impatient && (wanted || under_way.is_some()));
        if !begins {
            return None;
        }
        let members = views.active().count();
        // An operator answers for those he has named, not for others who happen to be away.
        let by_operators =
            views.active().flat_map(|term| views.promises(term.robot)).filter(|vote| vote.operator);
        let mut named: BTreeSet<RobotId> =
            by_operators.flat_map(|vote| vote.removed.iter().copied()).collect();
        if wish.operator {
            named.extend(&evict);
        }
        // Whoever was given up and is back need not go: those who have met him would not agree.
        let given_up = views.given_up(owner);
        let away = given_up.iter().filter(|robot| wish.absent.contains(robot) || named.contains(robot));
        let joined: BTreeSet<RobotId> = evict.iter().chain(away).copied().collect();
        let operator = |removed: &BTreeSet<RobotId>| !removed.is_empty() && removed.is_subset(&named);
        let possible = |removed: &BTreeSet<RobotId>| {
            rules::may_decide(members, members - removed.len(), operator(removed))
        };
        let removed = [joined, evict, BTreeSet::new()].into_iter().find(possible)?;
        let ballot = Ballot { round: latest.map_or(1, |latest| latest.round + 1), robot: owner };
        let operator = operator(&removed);
        Some(self.promise_of(closing, ballot, removed.into_iter().collect(), operator))
    }

    /// Proposes in its own ballot, once all who would stay have promised it and all that they said before is held:
    /// they may have accepted something in an earlier boot.
    fn propose(&self, closing: &Closing, wish: &Wish) -> Option<Vote> {
        let (views, owner) = (&closing.views, closing.owner);
        let asked = views.promises(owner).next_back().filter(|vote| vote.ballot.robot == owner)?;
        let ballot = asked.ballot;
        if views.ballot(owner) != Some(ballot)
            || views.votes_of(owner).any(|(_, vote)| vote.accepted && vote.ballot == ballot)
        {
            return None;
        }
        let known = |robot: &RobotId| self.holds_past(closing, *robot);
        let promise =
            |robot| views.promises(robot).find(|vote| vote.ballot == ballot).filter(|_| known(&robot));
        let promises: Vec<&Vote> = views.staying(asked).map(promise).collect::<Option<_>>()?;
        let accepted = views.staying(asked).flat_map(|robot| views.votes_of(robot));
        let accepted = accepted.map(|(_, vote)| (vote.ballot, vote)).filter(|(_, vote)| vote.accepted);
        if let Some(bound) = rules::bound(accepted, ballot) {
            return Some(Vote { ballot, ..bound.clone() });
        }
        let mut held: BTreeMap<LogId, u64> = BTreeMap::new();
        for (log, length) in promises.iter().flat_map(|vote| &vote.held) {
            let slot = held.entry(*log).or_insert(0);
            *slot = (*slot).max(*length);
        }
        let admit = wish.admit.iter().filter(|(robot, _)| !views.is_active(**robot));
        Some(Vote {
            accepted: true,
            held: held.into_iter().collect(),
            added: admit.map(|(robot, boot)| (*robot, *boot)).collect(),
            from: promises.iter().map(|vote| vote.from).max().unwrap_or(Timestamp::MIN),
            ..asked.clone()
        })
    }

    /// A promise: what is held here of the logs of those who are to go, and how far this robot has sealed.
    fn promise_of(&self, closing: &Closing, ballot: Ballot, removed: Vec<RobotId>, operator: bool) -> Vote {
        let known = self.logs.iter().filter(|(id, log)| log.held() > 0 && removed.contains(&id.robot));
        // What is forgotten was held to its end.
        let floors = closing.base.floors.iter().filter(|(robot, _)| removed.contains(robot));
        let over = floors.filter_map(|(robot, floor)| {
            Some((LogId { robot: *robot, boot: BootIndex(floor.0.checked_sub(1)?) }, WHOLE))
        });
        let held: BTreeMap<LogId, u64> = known.map(|(id, log)| (*id, log.held())).chain(over).collect();
        Vote {
            epoch: closing.views.epoch,
            ballot,
            accepted: false,
            held: held.into_iter().collect(),
            removed,
            added: Vec::new(),
            from: self.seal_of(closing.owner).map_or(Timestamp::MIN, |seal| seal.observed),
            operator,
        }
    }
}

/// Follows what another has proposed in its ballot.
fn accept(closing: &Closing) -> Option<Vote> {
    let (views, owner) = (&closing.views, closing.owner);
    let promised = views.ballot(owner);
    let proposals = views.active().flat_map(|term| views.votes_of(term.robot));
    let mut proposals = proposals.map(|(_, vote)| vote).filter(|vote| vote.accepted);
    let fresh = |vote: &Vote| !views.votes_of(owner).any(|(_, given)| given == vote);
    proposals
        .find(|vote| {
            !vote.removed.contains(&owner) && rules::may_accept(promised, vote.ballot) && fresh(vote)
        })
        .cloned()
}
