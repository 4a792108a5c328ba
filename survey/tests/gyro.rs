//! What a gyro and the correlation of the wheels' noise are worth.

use pleiad_survey::StudyOptions;
use pleiad_survey::gyro::{self, Variant, Wheels, judged};

#[test]
fn every_claim_of_the_gyro_holds() {
    let study = gyro::run(&StudyOptions { seeds: Some(300), first_seed: 3000 }).unwrap();
    for claim in &study.claims {
        assert!(claim.holds, "{claim:?}");
    }
    let number = |name: &str| study.numbers[name].as_f64().unwrap();
    assert!(number("heading_error_times_without_gyro") > 2.0);
}

#[test]
fn a_filter_without_the_correlation_is_caught_where_the_one_with_it_passes() {
    let seeds: Vec<u64> = (9000..9300).collect();
    let all = judged(&seeds).unwrap();
    let consistent = |wheels| {
        let own = all.iter().find(|own| own.variant == Variant { wheels, gyro: false }).unwrap();
        own.nees.is_consistent()
    };
    assert!(consistent(Wheels::Each));
    assert!(!consistent(Wheels::Uncorrelated));
}
