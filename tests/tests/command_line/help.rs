//! `--help`, `--version` and shell completions.

use pleiad_tests::program::run;

pub const COMMANDS: [&str; 20] = [
    "demo",
    "init",
    "why",
    "run",
    "replay",
    "tune",
    "observability",
    "simulate",
    "diagnose",
    "benchmark",
    "faults",
    "evaluate",
    "slam",
    "effects",
    "agent",
    "coordinator",
    "evict",
    "export",
    "sim-peers",
    "completions",
];

#[test]
fn help_lists_every_command_and_each_has_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let help = run(folder.path(), ["--help"]).success();
    for command in COMMANDS {
        let listed = help.lines().any(|line| line.trim_start().starts_with(&format!("{command} ")));
        assert!(listed, "{command} is not in: {help}");
        let own = run(folder.path(), [command, "--help"]).success();
        assert!(own.contains(&format!("Usage: pleiad {command}")), "{own}");
    }
}

#[test]
fn the_version_is_that_of_the_package() {
    let folder = tempfile::tempdir().unwrap();
    let version = run(folder.path(), ["--version"]).success();
    assert_eq!(version.trim(), format!("pleiad {}", env!("CARGO_PKG_VERSION")));
}

#[test]
fn completions_for_bash_complete_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let script = run(folder.path(), ["completions", "bash"]).success();
    assert!(script.contains("complete -F _pleiad"), "{script}");
    for command in COMMANDS {
        assert!(script.contains(command), "{command} is missing");
    }
    let path = folder.path().join("pleiad.bash");
    std::fs::write(&path, script).unwrap();
    let checked = std::process::Command::new("bash").arg("-n").arg(&path).status().unwrap();
    assert!(checked.success(), "bash does not read it");
}

#[test]
fn without_a_command_the_help_is_shown_and_the_exit_code_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let stderr = run::<&str>(folder.path(), []).failure();
    assert!(stderr.contains("Usage: pleiad <COMMAND>"), "{stderr}");
    let unknown = run(folder.path(), ["dmeo"]).failure();
    assert!(unknown.contains("dmeo") && unknown.contains("demo"), "{unknown}");
}
