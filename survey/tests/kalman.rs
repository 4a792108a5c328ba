//! The Kalman filter's claims, with fewer draws than the command takes.

use pleiad_survey::StudyOptions;
use pleiad_survey::kalman::{self, System, Told, consistency};

#[test]
fn every_claim_holds_and_the_steady_state_is_exact() {
    let study = kalman::run(&StudyOptions { seeds: Some(100), first_seed: 5000 }).unwrap();
    for claim in &study.claims {
        assert!(claim.holds, "{claim:?}");
    }
    let number = |name: &str| study.numbers[name].as_f64().unwrap();
    assert!(number("steady_state_largest_relative_difference") <= 1e-12);
    assert!(number("alpha_beta_largest_relative_difference") <= 1e-10);
    assert!((number("gain_over_root_at_1e_minus_8") - 1.0).abs() < 1e-4);
}

#[test]
fn a_filter_told_half_the_process_noise_does_not_pass_for_consistent() {
    let seeds: Vec<u64> = (7000..7200).collect();
    let half = Told { process: 0.5, measurement: 1.0 };
    assert!(!consistency(&System::walk(), half, &seeds).unwrap().holds());
    assert!(consistency(&System::walk(), Told::TRUTH, &seeds).unwrap().holds());
}

#[test]
fn too_few_seeds_are_refused_with_how_many_are_needed() {
    let error = kalman::run(&StudyOptions { seeds: Some(3), first_seed: 1 }).unwrap_err().to_string();
    assert!(error.contains("kalman was given 3 seeds") && error.contains("at least 20"), "{error}");
}
