//! The examples in the help, run as printed; and what a newcomer is given to begin with.

use pleiad_tests::program::{run, turn};

use super::help::COMMANDS;

const HELPS: [&[&str]; 14] = [
    &[],
    &["init"],
    &["demo"],
    &["run"],
    &["simulate"],
    &["observability"],
    &["replay"],
    &["tune"],
    &["why"],
    &["export"],
    &["faults"],
    &["evaluate"],
    &["effects"],
    &["completions"],
];

fn examples(command: &[&str]) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let help = run(folder.path(), command.iter().chain(&["--help"])).success();
    let after = help.split("Examples:\n").nth(1).unwrap_or_else(|| panic!("no examples: {help}")).to_owned();
    after.lines().map_while(|line| line.strip_prefix("  pleiad ")).map(str::to_owned).collect()
}

#[test]
fn the_examples_of_the_help_run_as_printed() {
    let _turn = turn();
    let folder = tempfile::tempdir().unwrap();
    for command in HELPS {
        let examples = examples(command);
        assert!(!examples.is_empty(), "{command:?}");
        for example in examples {
            // Files that another example has made are in its way, as they would be in everybody's.
            let out = example.split(' ').skip_while(|word| *word != "--out").nth(1);
            let made = out.or_else(|| example.strip_prefix("init ")).map(|made| folder.path().join(made));
            if let Some(made) = &made
                && !(example.starts_with("init") && made.exists())
            {
                let _ = std::fs::remove_dir_all(made);
                let _ = std::fs::remove_file(made);
            } else if made.is_some() {
                continue;
            }
            run(folder.path(), example.split(' ')).success();
            assert!(made.is_none_or(|made| made.exists()), "{example} left nothing");
        }
    }
}

#[test]
fn no_help_has_examples_that_are_not_run() {
    let folder = tempfile::tempdir().unwrap();
    for command in COMMANDS {
        let help = run(folder.path(), [command, "--help"]).success();
        assert_eq!(help.contains("Examples:"), HELPS.contains(&[command].as_slice()), "{command}");
    }
}

#[test]
fn the_scenario_to_begin_with_is_not_overwritten_and_its_fault_works() {
    let _turn = turn();
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), ["init"]).success();
    let path = folder.path().join("team.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let refused = run(folder.path(), ["init"]).failure();
    assert!(refused.contains("team.toml exists") && refused.contains("another file"), "{refused}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text);

    let (before, fault) = text.split_once("# [[fault]]").unwrap();
    let fault = format!("# [[fault]]{fault}").replace("# ", "");
    std::fs::write(&path, format!("{before}{fault}")).unwrap();
    let json = run(folder.path(), ["run", "team.toml", "--out", "run", "--json"]).json();
    assert!(json["faults"].is_object(), "{json}");
}
