//! The claims of the rules of motion, on a few seeds that the study does not use.

use pleiad_survey::StudyOptions;
use pleiad_survey::motion_policies::study;

#[test]
fn all_moving_is_twice_as_fast_exchange_helps_and_sight_alone_is_lost_without_sight() {
    let study = study(&StudyOptions { seeds: Some(4), first_seed: 900 }).unwrap();
    let number = |case: &str, name: &str| study.numbers[case][name]["mean"].as_f64().unwrap();
    let ratio = number("portable_landmarks", "pace_all_moving_over_this");
    assert!((1.8..2.2).contains(&ratio), "{ratio}");
    let ratio = number("one_mover", "pace_all_moving_over_this");
    assert!((3.6..4.4).contains(&ratio), "{ratio}");
    // The planted fault is the filter without exchange: the same team, the same noise, and no gain.
    assert!(number("independent", "end_rmse_all_moving_over_this") < 1.0);
    for rule in ["portable_landmarks", "one_mover", "watched"] {
        let lost = number(rule, "off_by_sight_alone_m");
        assert!(number("all_moving", "rmse_blocked_m") < 0.5 * lost, "{rule}: {lost}");
    }
}
