//! `pleiad evaluate`: many runs, and variants of the filter on the same facts.

use pleiad_tests::program::run;
use serde_json::Value;

use crate::{list, number};

const HARD: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/five_hard.toml");

#[test]
fn facts_linearized_together_stay_consistent_where_the_filter_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "--seeds",
        "10",
        "--seed",
        "301",
        "--seconds",
        "300",
        "--variants",
        "invariant,5:5:4",
        "--times",
        "6",
    ];
    let words: Vec<&str> =
        ["evaluate", HARD, "--json", "--out", "out"].iter().chain(&arguments).copied().collect();
    let found = run(folder.path(), words).json();
    assert_eq!(number(&found, "seeds"), 10.0);
    assert_eq!(list(&found, "times_s").len(), 6);
    let rows = list(&found, "rows");
    let [filter, together] = rows else { panic!("two variants: {rows:?}") };
    for row in rows {
        for key in ["joint_anees", "apart_anees", "position_rmse_m", "heading_rmse_rad"] {
            assert_eq!(list(row, key).len(), 6, "{key}");
        }
    }
    assert_eq!((number(filter, "position_rmse_ratio"), number(filter, "undefined")), (1.0, 0.0));
    assert!(number(together, "position_rmse_ratio") < 0.5, "{together}");
    // Ten runs of 15 dimensions at three times that are not independent: as for one time, 0.12.
    assert!((number(together, "apart_anees_second_half") - 1.0).abs() < 0.35, "{together}");
    assert!(number(filter, "apart_anees_second_half") > 2.0, "{filter}");
    assert!((number(together, "nis_per_degree") - 1.0).abs() < 0.1, "{together}");
    assert!(number(filter, "rejected_percent") > number(together, "rejected_percent"));
    assert!(number(together, "whiteness").abs() < 0.05, "{together}");
    let out = folder.path().join("out");
    let summary: Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary, found);
    assert!(std::fs::read_to_string(out.join("report.html")).unwrap().contains("</html>"));
}

#[test]
fn what_is_no_variant_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    for (variant, said) in
        [("sigma", "sigma"), ("5:5", "5:5"), ("iterated:x", "iterated:x"), ("0:1:2", "block_s")]
    {
        let words = ["evaluate", HARD, "--seeds", "2", "--seconds", "5", "--variants", variant];
        let stderr = run(folder.path(), words).failure();
        assert!(stderr.contains(said), "{variant}: {stderr}");
    }
}
