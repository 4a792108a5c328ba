//! The rover's claims, with fewer runs than the command takes.

use pleiad_survey::StudyOptions;
use pleiad_survey::rover;

#[test]
fn dead_reckoning_is_worse_than_the_filter_and_the_filter_than_the_filter_with_sun() {
    let study = rover::run(&StudyOptions { seeds: Some(48), first_seed: 4000 }).unwrap();
    for claim in study.claims.iter().filter(|claim| !claim.statement.contains("within a fifth")) {
        assert!(claim.holds, "{claim:?}");
    }
    let number = |name: &str| study.numbers[name].as_f64().unwrap();
    assert!(number("ekf_sun_1_10_heading_rms_rad") < 0.5 * number("ekf_heading_rms_rad"));
    assert_eq!(study.numbers["late_runs_equal"], study.numbers["late_runs"]);
}

#[test]
fn late_readings_in_their_place_are_those_in_order_and_not_those_at_arrival() {
    let own = rover::late(4100).unwrap();
    assert!(own.equal);
    assert!(own.overtaken > own.readings / 2, "{own:?}");
}
