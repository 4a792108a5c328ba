//! `pleiad demo`.

use pleiad_tests::program::{self, run};
use serde_json::Value;

use crate::{list, number, numbers};

#[test]
fn the_demo_tells_what_is_observable_in_one_json_object() {
    let _turn = program::turn();
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["demo", "--robots", "3", "--seconds", "120", "--json", "--out", "demo"];
    let demo = run(folder.path(), arguments).json();
    assert_eq!((number(&demo, "robots"), number(&demo, "seconds")), (3.0, 120.0));
    let cases = list(&demo, "cases");
    // Roumeliotis and Bekey (2002): relative observations leave the three rigid motions of the whole team
    // unobservable; one robot's absolute position makes everything observable.
    let expected = [("relative_only", 6.0, 3), ("with_absolute", 9.0, 0)];
    assert_eq!(cases.len(), expected.len());
    for (case, (name, rank, unobservable)) in cases.iter().zip(expected) {
        assert_eq!(case["name"], name);
        assert_eq!((number(case, "rank"), number(case, "dimension")), (rank, 9.0), "{name}");
        assert_eq!(list(case, "unobservable").len(), unobservable, "{case}");
        assert!(list(case, "unobservable").iter().all(Value::is_string), "{case}");
        for key in ["final_position_sigma_m", "position_rmse_m"] {
            let values = numbers(case, key);
            assert!(values.len() == 3 && values.iter().all(|value| *value > 0.0), "{key}: {values:?}");
        }
        assert_eq!(number(case, "processes"), 3.0);
        for key in ["team_sigma_early_m", "team_sigma_late_m", "facts", "messages", "bytes"] {
            assert!(number(case, key) > 0.0, "{key} of {name}");
        }
    }
    // Without anything absolute the team's uncertainty grows; with it, it does not run away.
    let sigma = |case: &Value, when: &str| number(case, &format!("team_sigma_{when}_m"));
    assert!(sigma(&cases[0], "late") > sigma(&cases[0], "early"), "{}", cases[0]);
    assert!(sigma(&cases[1], "late") < sigma(&cases[0], "late"), "{demo}");

    let out = folder.path().join("demo");
    let summary: Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary, demo);
    let report = std::fs::read_to_string(out.join("report.html")).unwrap();
    for words in ["<svg", "6 of 9", "9 of 9", "</html>"] {
        assert!(report.contains(words), "{words} is missing in the report");
    }
}

#[test]
fn a_demo_too_short_to_show_anything_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let stderr = run(folder.path(), ["demo", "--seconds", "60", "--out", "demo"]).failure();
    assert!(stderr.contains("--seconds 60") && stderr.contains("at least 120"), "{stderr}");
    assert!(!folder.path().join("demo").exists(), "nothing is left behind");
}
