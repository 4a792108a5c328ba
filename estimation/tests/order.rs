//! The estimate is a function of the set of facts: any order, duplicates, batches, late arrivals.

mod support;

use pleiad_estimation::RobotId;
use pleiad_estimation::fact::Entry;
use pleiad_estimation::fold::{FoldConfig, Inflation, Quarantine, Relinearization};
use pleiad_estimation::joint::ErrorForm;
use pleiad_estimation::ledger::{Insertion, Ledger};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use support::{Kinds, Options, shuffled, team};

const TOGETHER: Relinearization =
    Relinearization { block_ns: 2_000_000_000, ahead_ns: 3_000_000_000, passes: 3, cell_ns: 10_000_000_000 };

fn folded_at_once(entries: &[Entry], config: FoldConfig) -> Ledger {
    let mut ledger = Ledger::new(config);
    for entry in entries {
        assert_eq!(ledger.insert(entry.clone()), Insertion::Added { released: 0 });
    }
    ledger.settle();
    ledger
}

fn check_order(seed: u64, options: &Options) {
    let team = team(seed, options);
    let mut straight = folded_at_once(&team.entries, options.config);
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0xA5A5);
    let mut any_order = Ledger::new(options.config);
    for entry in shuffled(&team.entries, &mut random, 0.3) {
        any_order.insert(entry);
        // In random batches: settled now and then, so that late facts rewind.
        if random.random::<f64>() < 0.1 {
            any_order.settle();
        }
    }
    assert_eq!(straight.fingerprint(), any_order.fingerprint(), "seed {seed}");
    assert_eq!(straight.joint(), any_order.joint());
    let records = |ledger: &Ledger| ledger.facts().map(|(key, record)| (*key, *record)).collect::<Vec<_>>();
    assert_eq!(records(&straight), records(&any_order));
    let history = |ledger: &Ledger| ledger.settled_history(RobotId(1));
    assert_eq!(history(&straight), history(&any_order));
    assert_eq!(straight.counts().pending, 0);
    assert!(straight.counts().used > 10);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn any_order_gives_the_same_bits(seed in 0u64..1_000_000, robots in 2u32..=8, all in any::<bool>(),
                                     additive in any::<bool>(), together in any::<bool>(), wary in any::<bool>()) {
        let form = if additive { ErrorForm::Additive } else { ErrorForm::Invariant };
        let relinearize = together.then_some(TOGETHER);
        // So low that robots are suspected for nothing.
        let quarantine = wary.then_some(Quarantine { level: 1.0, window_ns: 10_000_000_000 });
        let inflation = wary.then_some(Inflation { readings: 10.0, most: 5.0 });
        let config = FoldConfig { form, relinearize, quarantine, inflation, join: wary && !additive, ..FoldConfig::default() };
        let kinds = if all { Kinds::All } else { Kinds::Relative };
        check_order(seed, &Options { robots, seconds: 20, kinds, config, ..Options::default() });
    }
}

/// Suspects are taken out and not believed in the runs above, not only in name.
#[test]
fn robots_are_suspected_where_little_is_needed_for_it() {
    let quarantine = Some(Quarantine { level: 1.0, window_ns: 10_000_000_000 });
    let (mut detached, mut whole, mut on_the_map) = (0, 0, 0);
    for form in [ErrorForm::Invariant, ErrorForm::Additive] {
        let config = FoldConfig { form, quarantine, ..FoldConfig::default() };
        let options = Options { robots: 5, seconds: 60, config, ..Options::default() };
        for seed in 0..100 {
            for member in folded_at_once(&team(seed, &options).entries, config).joint().members() {
                detached += u32::from(member.reputation.detached.is_some());
                whole += u32::from(member.reputation.distrust.is_some_and(|of| of.whole));
                on_the_map += u32::from(member.reputation.distrust.is_some_and(|of| !of.whole));
            }
        }
    }
    assert!(detached > 5 && whole > 5 && on_the_map > 5, "{detached} {whole} {on_the_map} of 1000");
}

#[test]
fn a_fact_missing_in_one_ledger_shows_in_the_fingerprint() {
    let options = Options::default();
    let team = team(3, &options);
    let mut whole = folded_at_once(&team.entries, options.config);
    let mut short = folded_at_once(&team.entries[..team.entries.len() - 1], options.config);
    assert_ne!(whole.fingerprint(), short.fingerprint());
}

#[test]
fn late_facts_cost_folds_in_proportion_to_how_late_they_are() {
    let options = Options { seconds: 200, ..Options::default() };
    let mut entries = team(5, &options).entries;
    let observation_time = |entry: &Entry| match entry.body {
        pleiad_estimation::fact::Body::Observation(observation) => observation.time,
        _ => pleiad_estimation::Timestamp::MIN,
    };
    entries.sort_by_key(|entry| entry.id);
    let mut ledger = folded_at_once(&entries[..entries.len() - 1], options.config);
    let before = ledger.folds();
    let last = entries.last().expect("entries");
    ledger.insert(last.clone());
    ledger.settle();
    let facts_after = ledger.facts().filter(|(key, _)| key.time >= observation_time(last)).count() as u64;
    let folds = ledger.folds() - before;
    assert!(folds <= 2 * facts_after + 32, "{folds} folds for a fact {facts_after} positions late");
}
