//! Schedules of a simulated team: losses, partitions, kills, lost power and lost disks, every invariant of
//! the ledger checked on the way. A seed that fails is replayed by the `schedules` example.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(clippy::unreadable_literal, reason = "seeds are names")]

use pleiad_sim_peers::simulation::{Options, Outcome, run};

fn all(seeds: std::ops::Range<u64>, options: &Options) -> Vec<Outcome> {
    let one = |seed| {
        run(seed, options).unwrap_or_else(|violation| {
            let kind = match (options.partitions_only, options.evictions) {
                (true, _) => " --partitions",
                (false, true) => " --evictions",
                (false, false) => "",
            };
            let most = options.most_items.map_or_else(String::new, |items| format!(" --most-items {items}"));
            let most = if options.relinearize { format!("{most} --relinearize") } else { most };
            let most = if options.calibrate { format!("{most} --calibrate") } else { most };
            panic!(
                "seed {seed}: {violation}\nreplay: cargo run -p pleiad-tests --features planted \
                 --example schedules -- --seeds {seed}..{}{kind}{most}",
                seed + 1
            )
        })
    };
    seeds.map(one).collect()
}

#[test]
fn two_hundred_schedules_keep_every_invariant() {
    let outcomes = all(0..100, &Options { partitions_only: true, ..Options::default() });
    assert!(outcomes.iter().all(|outcome| outcome.deaths == 0 && outcome.expired == 0));
    assert!(outcomes.iter().map(|outcome| outcome.cuts).sum::<u64>() > 1000);
    let outcomes = all(0..100, &Options::default());
    assert!(outcomes.iter().map(|outcome| outcome.deaths).sum::<u64>() > 50);
}

#[test]
fn a_limit_on_items_in_memory_holds_and_every_invariant_with_it() {
    let free = Options { evictions: true, ..Options::default() };
    let bounded = Options { most_items: Some(60), ..free.clone() };
    let most = |outcomes: Vec<Outcome>| outcomes.iter().map(|outcome| outcome.most_kept).max().unwrap();
    let (free, bounded) = (most(all(0..100, &free)), most(all(0..100, &bounded)));
    // Every event was checked against the bound that a team of this size cannot exceed.
    assert!(bounded < 500 && free > 700, "{bounded} {free}");
}

#[test]
fn facts_linearized_together_are_those_of_one_fold_after_evictions_and_crashes() {
    let outcomes = all(0..60, &Options { evictions: true, relinearize: true, ..Options::default() });
    let total = |of: fn(&Outcome) -> u64| outcomes.iter().map(of).sum::<u64>();
    assert!(total(|outcome| outcome.deaths) > 30 && total(|outcome| outcome.cuts) > 1000);
}

#[test]
fn what_is_found_out_besides_poses_is_that_of_one_fold_after_evictions_and_crashes() {
    for relinearize in [false, true] {
        let options = Options { evictions: true, calibrate: true, relinearize, ..Options::default() };
        let outcomes = all(0..60, &options);
        let total = |of: fn(&Outcome) -> u64| outcomes.iter().map(of).sum::<u64>();
        assert!(total(|outcome| outcome.deaths) > 30 && total(|outcome| outcome.cuts) > 1000);
    }
}

/// Seeds that have found a mistake in the rules, in the node or in the harness; `docs/ledger.md` says which.
#[test]
fn schedules_that_found_a_mistake_keep_every_invariant() {
    let each =
        |seeds: &[u64], options: &Options| seeds.iter().for_each(|seed| drop(all(*seed..seed + 1, options)));
    each(&CRASHES, &Options::default());
    each(&EVICTIONS, &Options { evictions: true, ..Options::default() });
}

const CRASHES: [u64; 17] = [
    144, 425, 673, 1049, 1665, 1998, 2259, 2375, 2669, 2684, 3897, 19710, 22259, 33269, 100246, 206355,
    207575,
];
const EVICTIONS: [u64; 73] = [
    11, 94, 113, 197, 218, 245, 260, 290, 291, 303, 432, 470, 554, 676, 946, 1076, 1115, 1322, 1520, 2683,
    4176, 4606, 5079, 5390, 5920, 10603, 12414, 14782, 23788, 100042, 100155, 100721, 111560, 112676, 115152,
    116595, 119240, 119703, 119783, 124584, 124703, 127110, 127277, 127694, 129181, 129775, 130145, 135254,
    138868, 217975, 302553, 403243, 407872, 409371, 409672, 517366, 519427, 520360, 531938, 537175, 538164,
    703764, 801567, 808160, 813265, 821817, 824125, 831086, 832218, 864221, 1005923, 2019382, 2043655,
];

#[test]
fn a_seed_gives_the_same_run_twice() {
    for seed in 0..3 {
        let once = || run(seed, &Options::default()).unwrap();
        assert_eq!(once(), once());
    }
}

#[cfg(feature = "slow")]
#[test]
fn a_thousand_partitions_heal() {
    all(0..1000, &Options { partitions_only: true, ..Options::default() });
}

#[cfg(feature = "planted")]
mod planted {
    use super::*;
    use pleiad_sim_peers::simulation::Planted;

    /// How many schedules it takes to find a mistake.
    fn found_after(planted: Planted) -> Option<u64> {
        let options = Options { planted: Some(planted), ..Options::default() };
        (0..200).find(|seed| run(*seed, &options).is_err()).map(|seed| seed + 1)
    }

    #[test]
    fn every_planted_mistake_is_found() {
        for planted in [
            Planted::CountDuplicates,
            Planted::SkipRewind,
            Planted::ForgetLateNoise,
            Planted::MixBoots,
            Planted::CloseByNumbers,
            Planted::AnswerBlindly,
            Planted::PublishFirst,
        ] {
            let found = found_after(planted);
            println!("{planted:?}: after {found:?} schedules");
            assert!(found.is_some(), "{planted:?} is not found");
        }
    }
}
