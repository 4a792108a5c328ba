//! What is read, and how what cannot be read is refused.

use super::*;

fn plan(text: &str) -> Result<FaultPlan, FaultsError> {
    FaultPlan::from_toml(text, "f.toml")
}

#[test]
fn every_fault_is_read_with_its_window_links_and_messages() {
    let text = r#"
        name = "another table's business"

        [[fault]]
        what = "burst"
        from = [1]
        to = [2, 3]
        messages = ["entries", "facts request"]
        start_s = 10
        end_s = 60.5
        loss = 0.5
        mean_length = 10

        [[fault]]
        what = "partition"
        groups = [[1, 2], [3]]
    "#;
    let plan = plan(text).unwrap();
    let rule = Rule {
        fault: Fault::Burst { loss: 0.5, mean_length: 10.0 },
        from: BTreeSet::from([RobotId(1)]),
        to: BTreeSet::from([RobotId(2), RobotId(3)]),
        messages: BTreeSet::from(["entries", "facts request"]),
        start_s: 10.0,
        end_s: 60.5,
        again: None,
    };
    let groups = vec![BTreeSet::from([RobotId(1), RobotId(2)]), BTreeSet::from([RobotId(3)])];
    assert_eq!(plan.rules, [rule, Rule::always(Fault::Partition { groups })]);
    assert_eq!(plan.window_s(), Some((0.0, f64::INFINITY)));
    for (what, _, keys) in FAULTS {
        let value = |key: &&str| match *key {
            "groups" => "groups = [[1]]".to_owned(),
            "robots" => "robots = [1]".to_owned(),
            "loss" | "probability" => format!("{key} = 0.25"),
            other => format!("{other} = 2"),
        };
        let lines: Vec<String> = keys.iter().map(value).collect();
        let text = format!("[[fault]]\nwhat = \"{what}\"\n{}\n", lines.join("\n"));
        assert_eq!(FaultPlan::from_toml(&text, "f.toml").unwrap().rules.len(), 1, "{text}");
    }
    assert_eq!(FaultPlan::from_toml("name = 1", "f.toml").unwrap(), FaultPlan::default());
}

#[test]
fn what_is_wrong_is_named_with_file_line_key_value_and_remedy() {
    let cases = [
        ("[[fault]]\nloss = 0.5", "f.toml:1: `fault[0].what` is missing; expected one of loss, burst"),
        ("[[fault]]\nwhat = \"los\"", "f.toml:2: `fault[0].what` is \"los\"; expected one of loss"),
        (
            "[[fault]]\nwhat = \"cut\"\n[[fault]]\nwhat = \"loss\"\nloss = 1.5",
            "f.toml:5: `fault[1].loss` is 1.5; expected a probability from 0 to 1",
        ),
        ("[[fault]]\nwhat = \"loss\"", "f.toml:1: `fault[0].loss` is missing; expected a number"),
        (
            "[[fault]]\nwhat = \"loss\"\nloss = 0.5\nmean_length = 2",
            "f.toml:4: unknown key `fault[0].mean_length`; this fault has what, from, to",
        ),
        (
            "[[fault]]\nwhat = \"burst\"\nloss = 0.9\nmean_length = 2",
            "f.toml:4: `fault[0].mean_length` is 2; expected at least loss / (1 - loss)",
        ),
        ("[[fault]]\nwhat = \"cut\"\nfrom = 1", "f.toml:3: `fault[0].from` is 1; expected robots, as in"),
        ("[[fault]]\nwhat = \"cut\"\nto = [-1]", "f.toml:3: `fault[0].to` is -1; expected a whole number"),
        (
            "[[fault]]\nwhat = \"cut\"\nmessages = [\"entry\"]",
            "f.toml:3: `fault[0].messages` is \"entry\"; expected kinds of messages: entries, status",
        ),
        (
            "[[fault]]\nwhat = \"cut\"\nstart_s = 5\nend_s = 5",
            "f.toml:4: `fault[0].end_s` is 5; expected a time after start_s",
        ),
        (
            "[[fault]]\nwhat = \"partition\"\ngroups = [[1], [1, 2]]",
            "f.toml:3: `fault[0].groups` is 1; expected every robot in one group only",
        ),
        ("[[fault]]\nwhat = \"corrupt\"\nprobability = 1\nbytes = 0", "f.toml:4: `fault[0].bytes` is 0;"),
        ("[[fault]]\nwhat = \"delay\"\ndelay_s = \"1\"", "f.toml:3: `fault[0].delay_s` is \"1\"; expected a"),
        (
            "[[fault]]\nwhat = \"kill\"\nfrom = [1]",
            "f.toml:3: unknown key `fault[0].from`; this fault has what, start_s, end_s, for_s, every_s, robots",
        ),
        (
            "[[fault]]\nwhat = \"coordinator_dies\"\nfor_s = 3",
            "f.toml:3: unknown key `fault[0].for_s`; this fault has what, start_s (",
        ),
        (
            "[[fault]]\nwhat = \"kill\"\nstart_s = 3",
            "f.toml:1: `fault[0].robots` is missing; expected robots, as in [1, 2], or every_s",
        ),
        (
            "[[fault]]\nwhat = \"stop\"\nrobots = [1]\nend_s = 3\nfor_s = 3",
            "f.toml:5: `fault[0].for_s` is 3; expected either for_s or end_s",
        ),
        (
            "[[fault]]\nwhat = \"stop\"\nrobots = [1]\nfor_s = 0",
            "f.toml:4: `fault[0].for_s` is 0; expected a positive number",
        ),
        (
            "[[fault]]\nwhat = \"stop\"\nevery_s = 10",
            "f.toml:1: `fault[0].for_s` is missing; expected how long it lasts",
        ),
        (
            "[[fault]]\nwhat = \"stop\"\nevery_s = 0\nfor_s = 1",
            "f.toml:3: `fault[0].every_s` is 0; expected seconds from 0.1",
        ),
        ("fault = 3", "f.toml:1: `fault` is 3; expected tables, each begun by [[fault]]"),
        ("[[fault]", "f.toml:1: not TOML:"),
    ];
    for (text, expected) in cases {
        let error = plan(text).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{text}\n{error}");
    }
    let missing = FaultPlan::load(Path::new("nowhere/f.toml")).unwrap_err().to_string();
    assert!(missing.contains("nowhere/f.toml: cannot be read"), "{missing}");
}

#[test]
fn what_lasts_or_comes_again_is_read_and_what_is_written_reads_the_same() {
    let text = r#"
        [[fault]]
        what = "kill"
        robots = [2]
        start_s = 20
        for_s = 5
        [[fault]]
        what = "partition"
        every_s = 30
        for_s = 8
        end_s = 300
        [[fault]]
        what = "disk_full"
        every_s = 60
        for_s = 2.5
        [[fault]]
        what = "burst"
        loss = 0.3
        mean_length = 4
        from = [1]
        to = [2, 3]
        messages = ["entries", "status"]
        [[fault]]
        what = "slow"
        messages_per_s = 0.1
        [[fault]]
        what = "coordinator_dies"
        start_s = 7
        [[fault]]
        what = "away"
        robots = [1, 2]
        [[fault]]
        what = "clock"
        offset_s = -1e-3
        [[fault]]
        what = "corrupt"
        probability = 0.3333333333333333
        bytes = 7
    "#;
    let plan = plan(text).unwrap();
    let killed = Fault::Kill { robots: BTreeSet::from([RobotId(2)]) };
    assert_eq!(plan.rules[0], Rule::always(killed).between(20.0, 25.0));
    let again = Some(Again { every_s: 30.0, for_s: 8.0 });
    let split = Rule::always(Fault::Partition { groups: Vec::new() }).between(0.0, 300.0);
    assert_eq!(plan.rules[1], Rule { again, ..split });
    assert!(plan.is_random());
    assert_eq!(FaultPlan::from_toml(&plan.to_toml(), "again.toml").unwrap(), plan, "{}", plan.to_toml());
}
