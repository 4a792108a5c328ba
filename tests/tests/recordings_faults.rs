//! `pleiad faults` on real robots (MRCLAM dataset 6): the exact strategy heals to the oracle there too.
//! `PLEIAD_RECORDINGS` names the folder that holds `mrclam/`;
//! `cargo test -p pleiad-tests --features recordings --test recordings_faults`.

#![cfg(feature = "recordings")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests fail by panicking")]

use std::path::PathBuf;

use pleiad_tests::program::run;

#[test]
fn after_half_and_nine_tenths_loss_real_robots_end_with_the_oracle_in_every_replica() {
    let how = "set PLEIAD_RECORDINGS to the folder that holds mrclam/MRCLAM_Dataset6 (published by its authors at \
               asrl.utias.utoronto.ca/datasets/mrclam)";
    let folder = std::env::var_os("PLEIAD_RECORDINGS").map(PathBuf::from);
    let folder = folder.unwrap_or_else(|| panic!("PLEIAD_RECORDINGS is not set; {how}"));
    let recording = folder.join("mrclam/MRCLAM_Dataset6");
    assert!(recording.is_dir(), "{} is not a folder; {how}", recording.display());
    let out = tempfile::tempdir().unwrap();
    let recording = recording.display().to_string();
    let arguments = [
        "faults",
        &recording,
        "--json",
        "--out",
        "out",
        "--seconds",
        "300",
        "--landmarks",
        "none",
        "--seeds",
        "2",
        "--strategies",
        "exact",
        "--loss",
        "0,50,90",
        "--burst",
        "10",
    ];
    let json = run(out.path(), arguments).json();
    assert_eq!(json["independent_worlds"], false);
    let rows = json["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 3);
    for row in rows {
        assert!(row["oracle_difference_healed"].as_f64().unwrap() < 1e-9, "{row}");
        assert_eq!(row["replicas_identical"], true, "{row}");
        for key in ["facts_lost", "facts_counted_twice", "facts_pending"] {
            assert_eq!(row[key], 0, "{key} in {row}");
        }
        // One realization has no interval.
        assert!(row["joint_anees_interval"].is_null() && row["joint_anees"].is_number(), "{row}");
    }
}
