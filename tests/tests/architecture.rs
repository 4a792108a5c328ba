//! The workspace is what `ARCHITECTURE.md` says it is: arrows between crates, names a crate must not know,
//! and words its sources must not contain.

#![allow(clippy::unwrap_used, reason = "helpers of tests, outside a test function")]

use std::path::Path;
use std::process::Command;

use pleiad_tests::architecture::{
    Absence, Dependencies, Rules, Workspace, lines_with, occurrences, parse_metadata, violations,
};

const CLOCKS_AND_CHANCE: &[&str] =
    &["SystemTime", "Instant::now", "std::time::Instant", "thread_rng", "rand::rng", "OsRng"];

/// The absences that dependencies do not show.
const ABSENCES: &[Absence] = &[
    Absence {
        within: &[""],
        except: &["bus/", "tests/"],
        words: &["zenoh::"],
        because: "only bus names zenoh; speak to the Bus trait",
    },
    Absence {
        within: &["estimation/", "recording/", "protocol/", "report/", "agent/"],
        except: &["agent/src/driver"],
        words: CLOCKS_AND_CHANCE,
        because: "time and randomness come in as arguments; only drivers read a clock",
    },
    Absence {
        within: &["estimation/"],
        except: &[],
        words: &[
            "std::fs",
            "std::io",
            "std::net",
            "std::thread",
            "std::env",
            "std::process",
            "HashMap",
            "HashSet",
        ],
        because: "the estimator is a function of its arguments: no I/O, no threads, no unordered maps",
    },
    Absence {
        within: &[
            "estimation/src/fact",
            "estimation/src/fold",
            "estimation/src/geometry",
            "estimation/src/group_fold",
            "estimation/src/joint",
            "estimation/src/measurement",
            "estimation/src/motion",
            "estimation/src/nominal",
            "estimation/src/spatial",
        ],
        except: &[],
        words: &[
            ".sin()",
            ".cos()",
            ".sin_cos()",
            ".tan()",
            ".asin()",
            ".acos()",
            ".atan()",
            ".atan2(",
            ".ln()",
            ".powf(",
            ".powi(",
            ".hypot(",
            ".cbrt()",
            ".mul_add(",
            "f64::sin",
            "f64::cos",
            "f64::atan2",
        ],
        because: "bits must agree on every processor: use libm, and no fused multiply-add",
    },
];

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

fn rules() -> Rules {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    Rules::parse(&text).unwrap()
}

fn workspace() -> Workspace {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--no-deps", "--format-version", "1", "--offline", "--manifest-path"])
        .arg(root().join("Cargo.toml"))
        .output()
        .unwrap();
    assert!(output.status.success(), "cargo metadata: {}", String::from_utf8_lossy(&output.stderr));
    parse_metadata(&String::from_utf8(output.stdout).unwrap()).unwrap()
}

fn names(list: &[&str]) -> std::collections::BTreeSet<String> {
    list.iter().map(|name| (*name).to_owned()).collect()
}

fn assert_none(found: &[String]) {
    assert!(found.is_empty(), "{} found:\n{}", found.len(), found.join("\n"));
}

#[test]
fn every_arrow_of_the_workspace_is_in_the_table() {
    let workspace = workspace();
    assert!(workspace.contains_key("estimation") && workspace.contains_key("bus"), "{workspace:?}");
    assert_none(&violations(&rules(), &workspace));
}

#[test]
fn no_source_contains_what_its_crate_must_not_know() {
    for absence in ABSENCES {
        assert_none(&occurrences(root(), absence).unwrap());
    }
}

/// A small architecture of its own, so that the checks below do not change with the real one.
const TABLES: &str = "\
| crate | responsibility | may depend on | must not know |
|---|---|---|---|
| `core/` | mathematics | - | formats: `serde` |
| `link/` | the network | core | |
| `tool/` *(later)* | judges | core | |
| `app/` | the binary | all but tool | |

| dependency | only in | because |
|---|---|---|
| `zenoh` | `link/` | one place |
";

fn small_workspace() -> Workspace {
    let crate_of = |internal: &[&str], external: &[&str]| Dependencies {
        internal: names(internal),
        external: names(external),
    };
    Workspace::from([
        ("core".to_owned(), crate_of(&[], &["libm"])),
        ("link".to_owned(), crate_of(&["core"], &["zenoh", "serde"])),
        ("app".to_owned(), crate_of(&["core", "link"], &[])),
    ])
}

/// Asserts that the only violation after `plant` is the one expected.
fn check_planted(plant: impl Fn(&mut Workspace), expected: &str) {
    let mut workspace = small_workspace();
    plant(&mut workspace);
    assert_eq!(violations(&Rules::parse(TABLES).unwrap(), &workspace), [expected.to_owned()]);
}

#[test]
fn a_workspace_as_its_tables_say_has_no_violation() {
    assert_none(&violations(&Rules::parse(TABLES).unwrap(), &small_workspace()));
}

#[test]
fn a_forbidden_arrow_is_found() {
    check_planted(
        |workspace| {
            workspace.get_mut("core").unwrap().internal.insert("link".to_owned());
        },
        "core depends on link, which its row does not allow",
    );
}

#[test]
fn an_excluded_crate_is_not_among_all() {
    let rules = Rules::parse(TABLES).unwrap();
    assert_eq!(rules.crates["app"].may_depend_on, names(&["core", "link"]));
}

#[test]
fn a_dependency_that_must_not_be_known_is_found() {
    check_planted(
        |workspace| {
            workspace.get_mut("core").unwrap().external.insert("serde".to_owned());
        },
        "core depends on serde, which it must not know",
    );
}

#[test]
fn a_dependency_reserved_for_another_crate_is_found() {
    check_planted(
        |workspace| {
            workspace.get_mut("app").unwrap().external.insert("zenoh".to_owned());
        },
        "app depends on zenoh, which only link may name",
    );
}

#[test]
fn a_crate_without_a_row_is_found() {
    check_planted(
        |workspace| {
            workspace.insert("extra".to_owned(), Dependencies::default());
        },
        "extra has no row in the table of crates",
    );
}

#[test]
fn a_row_without_a_crate_is_found_unless_it_is_for_later() {
    check_planted(
        |workspace| {
            workspace.remove("link");
            workspace.get_mut("app").unwrap().internal.remove("link");
        },
        "link has a row but no crate: mark it *(later)*",
    );
}

#[test]
fn a_crate_still_marked_for_later_is_found() {
    check_planted(
        |workspace| {
            workspace.insert("tool".to_owned(), Dependencies::default());
        },
        "tool is marked *(later)* but exists",
    );
}

#[test]
fn a_table_that_names_an_unknown_crate_is_refused() {
    let error = Rules::parse(&TABLES.replace("| core | |", "| cor | |")).unwrap_err();
    assert!(error.contains("names cor"), "{error}");
    assert!(Rules::parse("no table here").is_err());
}

#[test]
fn dev_dependencies_are_no_arrows() {
    let json = r#"{"packages": [
        {"name": "p-core", "manifest_path": "/w/core/Cargo.toml", "dependencies": [
            {"name": "p-app", "kind": "dev"}, {"name": "libm", "kind": null}, {"name": "cc", "kind": "build"}]},
        {"name": "p-app", "manifest_path": "/w/app/Cargo.toml", "dependencies": [{"name": "p-core", "kind": null}]}
    ]}"#;
    let workspace = parse_metadata(json).unwrap();
    assert_eq!(workspace["core"].internal, names(&[]));
    assert_eq!(workspace["core"].external, names(&["cc", "libm"]));
    assert_eq!(workspace["app"].internal, names(&["core"]));
}

#[test]
fn a_word_is_found_in_code_but_not_in_comments_tests_or_longer_names() {
    let source = "\
// zenoh::Session is not named here
use zenoh::Session;
use pleiad_bus::zenoh::Endpoint;
let y = x.sin(); // zenoh::
#[cfg(test)]
use zenoh::Config;
";
    assert_eq!(lines_with(source, &["zenoh::"]), [(2, "use zenoh::Session;")]);
    assert_eq!(lines_with(source, &[".sin()"]).len(), 1);
    assert_eq!(lines_with(source, &["SystemTime"]), []);
}
