use super::*;
use crate::restart::{Backoff, Restart};

const ONE: RobotId = RobotId(1);
const TWO: RobotId = RobotId(2);
const CRASH: Exit = Exit::Code(1);
const SHORT: Duration = Duration::from_secs(1);

/// Robots 1 and 2, restarted after 1, 2 and 4 s; healthy after 60 s.
fn team(when: Restart) -> Membership {
    let backoff = Backoff { first_s: 1.0, longest_s: 8.0, max_restarts: 3, stable_s: 60.0 };
    Membership::new(RestartPolicy { when, backoff }, &BTreeMap::from([(ONE, 11), (TWO, 12)]))
}

fn exited(robot: RobotId, exit: Exit) -> Input {
    Input::Exited { robot, exit, ran: SHORT }
}

fn told(robot: RobotId, exit: Exit) -> Action {
    Action::Tell(TeamEvent::Exited { robot, exit })
}

fn wait(restarts: u32, seconds: u64) -> Action {
    Action::Wait { robot: ONE, restarts, delay: Duration::from_secs(seconds) }
}

/// Lets robot 1 fail once and be restarted, with process id `pid`.
fn fail_and_restart(team: &mut Membership, restarts: u32, seconds: u64, pid: u32) {
    assert_eq!(team.handle(exited(ONE, CRASH)), [told(ONE, CRASH), wait(restarts, seconds)]);
    assert_eq!(team.members()[&ONE].process, ProcessState::Restarting { exit: CRASH });
    assert_eq!(team.handle(Input::Due { robot: ONE, restarts }), [Action::Spawn(ONE)]);
    let restarted = TeamEvent::Restarted { robot: ONE, restarts: restarts + 1 };
    assert_eq!(team.handle(Input::Spawned { robot: ONE, pid }), [Action::Tell(restarted)]);
    assert_eq!(team.members()[&ONE].pid(), Some(pid));
}

#[test]
fn without_restarts_an_exit_is_told_and_final() {
    let mut team = team(Restart::Never);
    assert_eq!(team.handle(exited(ONE, CRASH)), [told(ONE, CRASH)]);
    assert_eq!(team.members()[&ONE].ended(), Some(CRASH));
    assert_eq!(team.members()[&TWO].pid(), Some(12), "the other one is untouched");
}

#[test]
fn failures_are_restarted_with_growing_waits_and_then_given_up() {
    let mut team = team(Restart::OnFailure);
    fail_and_restart(&mut team, 0, 1, 21);
    fail_and_restart(&mut team, 1, 2, 22);
    fail_and_restart(&mut team, 2, 4, 23);
    let gave_up = Action::Tell(TeamEvent::GaveUp { robot: ONE, attempts: 3 });
    assert_eq!(team.handle(exited(ONE, CRASH)), [told(ONE, CRASH), gave_up]);
    assert_eq!(team.members()[&ONE].ended(), Some(CRASH));
}

#[test]
fn a_healthy_run_starts_the_count_anew() {
    let mut team = team(Restart::OnFailure);
    fail_and_restart(&mut team, 0, 1, 21);
    fail_and_restart(&mut team, 1, 2, 22);
    let after_a_minute = Input::Exited { robot: ONE, exit: CRASH, ran: Duration::from_mins(1) };
    assert_eq!(team.handle(after_a_minute), [told(ONE, CRASH), wait(2, 1)]);
}

#[test]
fn success_is_not_restarted() {
    let mut team = team(Restart::OnFailure);
    assert_eq!(team.handle(exited(ONE, Exit::Code(0))), [told(ONE, Exit::Code(0))]);
    assert_eq!(team.members()[&ONE].ended(), Some(Exit::Code(0)));
}

#[test]
fn a_wanted_end_is_not_restarted() {
    let mut team = team(Restart::OnFailure);
    assert_eq!(team.handle(Input::Hold { robot: ONE }), []);
    assert_eq!(team.handle(exited(ONE, Exit::Signal(9))), [told(ONE, Exit::Signal(9))]);
    assert_eq!(team.members()[&ONE].ended(), Some(Exit::Signal(9)));
}

#[test]
fn a_wanted_end_cancels_a_waiting_restart() {
    let mut team = team(Restart::OnFailure);
    team.handle(exited(ONE, CRASH));
    assert_eq!(team.handle(Input::Hold { robot: ONE }), []);
    assert_eq!(team.members()[&ONE].ended(), Some(CRASH));
    assert_eq!(team.handle(Input::Due { robot: ONE, restarts: 0 }), []);
}

#[test]
fn an_ended_agent_can_be_started_by_hand_and_is_then_watched_again() {
    let mut team = team(Restart::OnFailure);
    team.handle(Input::Hold { robot: ONE });
    team.handle(exited(ONE, Exit::Signal(9)));
    assert_eq!(team.handle(Input::Start { robot: ONE }), [Action::Spawn(ONE)]);
    team.handle(Input::Spawned { robot: ONE, pid: 21 });
    fail_and_restart(&mut team, 1, 1, 22);
}

#[test]
fn a_running_agent_is_not_started_twice() {
    let mut team = team(Restart::OnFailure);
    assert_eq!(team.handle(Input::Start { robot: ONE }), []);
    assert_eq!(team.handle(Input::Due { robot: ONE, restarts: 0 }), []);
    fail_and_restart(&mut team, 0, 1, 21);
    team.handle(exited(ONE, CRASH));
    assert_eq!(team.handle(Input::Due { robot: ONE, restarts: 0 }), [], "the wait of an earlier failure");
}

#[test]
fn a_process_that_cannot_be_started_counts_as_a_failure() {
    let mut team = team(Restart::OnFailure);
    team.handle(exited(ONE, CRASH));
    team.handle(Input::Due { robot: ONE, restarts: 0 });
    let refused = team.handle(Input::NotSpawned { robot: ONE });
    assert_eq!(refused, [told(ONE, Exit::NotStarted), wait(0, 2)]);
}

#[test]
fn liveliness_is_told_once_per_change() {
    let mut team = team(Restart::Never);
    let token = |alive| Input::Liveliness { robot: TWO, alive };
    assert_eq!(team.handle(token(false)), [], "it was not there");
    assert_eq!(team.handle(token(true)), [Action::Tell(TeamEvent::AgentUp { robot: TWO })]);
    assert_eq!(team.handle(token(true)), []);
    assert!(team.members()[&TWO].alive && !team.members()[&ONE].alive);
    assert_eq!(team.handle(token(false)), [Action::Tell(TeamEvent::AgentDown { robot: TWO })]);
}

#[test]
fn an_exit_takes_liveliness_with_it() {
    let mut team = team(Restart::Never);
    let token = |alive| Input::Liveliness { robot: ONE, alive };
    team.handle(token(true));
    let down = Action::Tell(TeamEvent::AgentDown { robot: ONE });
    assert_eq!(team.handle(exited(ONE, CRASH)), [down, told(ONE, CRASH)]);
    assert_eq!(team.handle(token(false)), [], "told already");
    assert_eq!(team.handle(token(true)), [], "a token without a process");
}

#[test]
fn strangers_are_ignored() {
    let mut team = team(Restart::OnFailure);
    let before = team.members();
    let stranger = RobotId(9);
    assert_eq!(team.handle(Input::Liveliness { robot: stranger, alive: true }), []);
    assert_eq!(team.handle(Input::Start { robot: stranger }), []);
    assert_eq!(team.members(), before);
}
