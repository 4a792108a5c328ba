//! What is due when, and what is refused.

use super::*;

const ONE: RobotId = RobotId(1);
const TWO: RobotId = RobotId(2);

fn schedule(text: &str) -> Result<Schedule, ScheduleError> {
    let plan = FaultPlan::from_toml(text, "f.toml").unwrap();
    Schedule::new(&plan, &BTreeSet::from([ONE, TWO]))
}

const PLAN: &str = r#"
    [[fault]]
    what = "loss"
    loss = 0.5
    [[fault]]
    what = "kill"
    robots = [1, 2]
    start_s = 10
    for_s = 5
    [[fault]]
    what = "stop"
    robots = [1]
    start_s = 15
    end_s = 18
    [[fault]]
    what = "disk_full"
    robots = [2]
    start_s = 30
"#;

#[test]
fn acts_come_in_their_order_and_once_and_what_ends_makes_room_for_what_begins() {
    let mut schedule = schedule(PLAN).unwrap();
    assert!(!schedule.is_empty() && !schedule.kills_coordinator());
    assert_eq!(schedule.due(9.99), []);
    assert_eq!(schedule.due(10.0), [Act::Kill(ONE), Act::Kill(TWO)]);
    assert_eq!(schedule.due(12.0), []);
    assert_eq!(schedule.due(15.0), [Act::Start(ONE), Act::Start(TWO), Act::Stop(ONE)]);
    // Time may jump over the whole of it.
    assert_eq!(schedule.due(1e6), [Act::Resume(ONE), Act::FillDisk(TWO)]);
    assert_eq!(schedule.end(), [Act::EmptyDisk(TWO)]);
    assert_eq!(schedule.end(), []);
}

#[test]
fn the_end_undoes_what_has_begun_and_nothing_else() {
    let mut schedule = schedule(PLAN).unwrap();
    schedule.due(11.0);
    assert_eq!(schedule.end(), [Act::Start(ONE), Act::Start(TWO)]);
    assert!(schedule.is_empty());
    let mut untouched = self::schedule(PLAN).unwrap();
    assert_eq!(untouched.end(), []);
}

#[test]
fn faults_of_links_alone_are_nothing_to_processes() {
    assert!(schedule("[[fault]]\nwhat = \"loss\"\nloss = 0.5").unwrap().is_empty());
}

#[test]
fn the_coordinator_dies_alone_and_once() {
    let mut dies = schedule("[[fault]]\nwhat = \"coordinator_dies\"\nstart_s = 4").unwrap();
    assert!(dies.kills_coordinator());
    assert_eq!(dies.due(4.0), [Act::KillCoordinator]);
    assert_eq!(dies.end(), []);
}

#[test]
fn what_cannot_be_carried_out_is_refused_by_its_place() {
    let kill = "[[fault]]\nwhat = \"kill\"\nrobots = [1]\nstart_s = 5\nend_s = 9\n";
    let dies = "[[fault]]\nwhat = \"coordinator_dies\"\n";
    let cases = [
        (
            "[[fault]]\nwhat = \"kill\"\nrobots = [7]".to_owned(),
            "fault[0].robots names 7; expected robots of this team: 1, 2",
        ),
        (
            format!("{kill}[[fault]]\nwhat = \"stop\"\nrobots = [2, 1]\nstart_s = 8"),
            "fault[1] and fault[0] befall the process of robot 1 at the same time",
        ),
        (
            "[[fault]]\nwhat = \"kill\"\nevery_s = 3\nfor_s = 1".to_owned(),
            "fault[0].every_s: the random times of this plan have not been drawn",
        ),
        (format!("{kill}{dies}"), "fault[1] is the death of the coordinator and fault[0] befalls"),
        (format!("{dies}{dies}"), "fault[1] is the second death of the coordinator"),
    ];
    for (text, expected) in cases {
        let error = schedule(&text).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{text}\n{error}");
    }
}
