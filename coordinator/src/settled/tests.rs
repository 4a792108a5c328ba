use pleiad_estimation::BootIndex;
use pleiad_estimation::fact::{Fingerprint, LogId};
use pleiad_protocol::{FactCounts, LogStatus, SampleCounts};

use super::*;

type Statuses = BTreeMap<RobotId, Result<Status, String>>;

fn log(robot: u32, held: u64, chain: u8) -> LogStatus {
    let log = LogId { robot: RobotId(robot), boot: BootIndex(0) };
    LogStatus { log, held, chain: Fingerprint([chain; 16]) }
}

/// Three robots that have settled on two logs.
fn settled() -> Statuses {
    let status = |robot| Status {
        robot: RobotId(robot),
        boot: BootIndex(0),
        configuration: 7,
        logs: vec![log(1, 10, 1), log(2, 20, 2)],
        facts: FactCounts { relative: 9, used: 9, ..FactCounts::default() },
        estimate: Fingerprint([5; 16]),
        odometry_until: None,
        samples: SampleCounts::default(),
        input_ended: true,
        drained: true,
        closure: None,
    };
    [1, 2, 3].map(|robot| (RobotId(robot), Ok(status(robot)))).into()
}

/// Asserts what a change to robot `robot` of a settled team makes of it.
fn check(robot: u32, plant: impl Fn(&mut Status), expected: &[Difference]) {
    let mut statuses = settled();
    plant(statuses.get_mut(&RobotId(robot)).unwrap().as_mut().unwrap());
    assert_eq!(differences(&statuses), expected);
}

fn behind(robot: u32, log: u32, held: u64, other: u32, expected: u64) -> Difference {
    let (robot, log, other) = (RobotId(robot), (RobotId(log), 0), RobotId(other));
    Difference::Behind { robot, log, held, other, expected }
}

#[test]
fn a_settled_team_has_no_differences() {
    assert_eq!(differences(&settled()), []);
}

#[test]
fn open_input_and_open_answers_are_found() {
    let open = |status: &mut Status| (status.input_ended, status.drained) = (false, false);
    check(2, open, &[Difference::InputOpen { robot: RobotId(2) }]);
    let undrained = |status: &mut Status| (status.drained, status.facts.pending) = (false, 4);
    check(3, undrained, &[Difference::NotDrained { robot: RobotId(3), pending: 4 }]);
}

#[test]
fn pending_facts_that_nobody_can_answer_do_not_keep_a_team_from_settling() {
    let mut statuses = settled();
    for status in statuses.values_mut() {
        status.as_mut().unwrap().facts.pending = 3;
    }
    assert_eq!(differences(&statuses), []);
}

#[test]
fn missing_entries_are_found_with_who_holds_them() {
    check(3, |status| status.logs[1].held = 19, &[behind(3, 2, 19, 1, 20)]);
    check(1, |status| status.logs[1].held = 19, &[behind(1, 2, 19, 2, 20)]);
    check(2, |status| status.logs.retain(|log| log.log.robot != RobotId(1)), &[behind(2, 1, 0, 1, 10)]);
    // Robot 3 knows a log that nobody else does.
    check(3, |status| status.logs.push(log(4, 1, 9)), &[behind(1, 4, 0, 3, 1), behind(2, 4, 0, 3, 1)]);
}

#[test]
fn different_entries_of_equal_number_are_a_fork_and_permanent() {
    let fork = Difference::Fork { robot: RobotId(2), other: RobotId(1), log: (RobotId(1), 0), held: 10 };
    check(2, |status| status.logs[0].chain = Fingerprint([99; 16]), std::slice::from_ref(&fork));
    assert!(fork.permanent());
}

#[test]
fn different_estimates_are_found_and_told_only_where_the_logs_agree() {
    let differs = |status: &mut Status| status.estimate = Fingerprint([0xab; 16]);
    let expected = Difference::Estimate {
        robot: RobotId(3),
        found: "ab".repeat(16),
        other: RobotId(1),
        expected: "05".repeat(16),
    };
    check(3, differs, &[expected]);
    let both = |status: &mut Status| {
        differs(status);
        status.logs[0].held = 9;
    };
    check(3, both, &[behind(3, 1, 9, 1, 10)]);
}

#[test]
fn another_configuration_is_found_and_permanent() {
    let expected = Difference::Configuration { robot: RobotId(2), found: 8, other: RobotId(1), expected: 7 };
    assert!(expected.permanent());
    check(2, |status| status.configuration = 8, &[expected]);
}

#[test]
fn a_silent_robot_is_found_and_can_be_left_out() {
    let mut statuses = settled();
    statuses.insert(RobotId(1), Err("no reply".to_owned()));
    assert_eq!(differences(&statuses), [Difference::Silent { robot: RobotId(1), cause: "no reply".into() }]);
    statuses.remove(&RobotId(1));
    assert_eq!(differences(&statuses), [], "its log is still compared among those who hold it");
    statuses.get_mut(&RobotId(3)).unwrap().as_mut().unwrap().logs[0].held = 8;
    assert_eq!(differences(&statuses), [behind(3, 1, 8, 2, 10)]);
}

#[test]
fn differences_read_as_sentences() {
    assert_eq!(
        behind(3, 2, 19, 1, 20).to_string(),
        "robot 3 holds 19 entries of the log of robot 2 boot 0, robot 1 20"
    );
    assert!(!behind(3, 2, 19, 1, 20).permanent());
}
