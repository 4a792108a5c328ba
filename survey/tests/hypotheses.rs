//! The claims of the hypotheses, on a few seeds that the study does not use.

use pleiad_survey::hypotheses::study;
use pleiad_survey::{StudyOptions, SurveyError};

#[test]
fn look_alikes_are_told_apart_kidnapping_is_survived_and_a_symmetric_map_is_left_undecided() {
    let study = study(&StudyOptions { seeds: Some(8), first_seed: 900 }).unwrap();
    let number = |name: &str| study.numbers[name].as_u64().unwrap();
    let hits = |name: &str| study.numbers[name]["hits"].as_u64().unwrap();
    // Of 8 runs: the bounds of the study are shares of 100. Each fails with at most one run in 16 to spare.
    assert!(hits("converged_share") >= 7, "{:?}", study.numbers);
    assert!(hits("recovered_share") >= 7, "{:?}", study.numbers);
    assert_eq!(number("strayed"), 0);
    // Without pruning and merging there are more: the number is not small by itself.
    let mean = |name: &str| study.numbers[name]["mean"].as_f64().unwrap();
    assert!(mean("mean_hypotheses_unpruned") > 3.0 * mean("mean_hypotheses"), "{:?}", study.numbers);
    assert!(study.numbers["plain_largest_difference"].as_f64().unwrap() < 1e-9);
    // The planted fault: nothing stands for `none of these`.
    assert!(number("recovered_without_reserve") <= 4, "{:?}", study.numbers);
}

#[test]
fn too_few_seeds_for_an_interval_are_refused() {
    let outcome = study(&StudyOptions { seeds: Some(2), first_seed: 1 });
    assert!(matches!(outcome, Err(SurveyError::TooFewSeeds { found: 2, .. })));
}
