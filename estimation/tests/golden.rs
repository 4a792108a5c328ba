//! The bits of a fold, to be the same on every processor. `.ci/golden-without-fma` runs this test once as
//! it is and once with the processor's fused multiply-add masked, and compares what it prints.

#[path = "support/space.rs"]
mod space;
mod support;

use pleiad_estimation::group_fold::{FoldConfig, Outcome};
use pleiad_estimation::ledger::Ledger;
use support::{Options, team};

/// Changes only when `FOLD_VERSION` does.
const GOLDEN: &str = "39dad7b3fa61902f924f170e693a38d6";

#[test]
fn a_fold_of_every_kind_of_fact_gives_the_golden_bits() {
    let options = Options { robots: 5, seconds: 120, ..Options::default() };
    let mut ledger = Ledger::new(options.config);
    for entry in team(1, &options).entries {
        ledger.insert(entry);
    }
    let counts = {
        ledger.settle();
        ledger.counts()
    };
    assert!(counts.used > 300 && counts.relative > 200 && counts.absolute > 100, "{counts:?}");
    let fingerprint = ledger.fingerprint().to_string();
    println!("golden {fingerprint}");
    assert_eq!(fingerprint, GOLDEN, "the fold's bits changed: raise FOLD_VERSION with the new hash");
}

#[test]
fn a_fold_in_space_prints_its_bits() {
    let run = space::run(1, &space::Options { robots: 5, seconds: 120, ..space::Options::default() });
    let (joint, records) = run.set().fold(&FoldConfig::default());
    let used = records.iter().filter(|(_, record)| record.outcome == Outcome::Used).count();
    assert!(used > 500, "{used}");
    println!("golden {}", joint.fingerprint());
}
