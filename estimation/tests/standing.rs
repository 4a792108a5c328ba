//! Robots that lie, robots that err, and levels of noise that follow what is read.

#![allow(clippy::expect_used, reason = "a fixture")]
#![allow(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "a number of runs")]
#![allow(clippy::print_stdout, reason = "figures for the documentation")]

mod support;

use pleiad_estimation::fold::{Clutter, FoldConfig, Inflation, Quarantine, Relinearization};
use pleiad_estimation::joint::{Joint, Party};
use pleiad_estimation::{LandmarkId, RobotId};
use support::wander::{Lie, Run, TICK_S, World, Wrong, run};

const RUNS: u64 = 40;
/// Tick from which on a robot lies, or at which it is shoved.
const SINCE: i64 = 400;
const QUARANTINE: Quarantine = Quarantine { level: 15.0, window_ns: 30_000_000_000 };
const INFLATION: Inflation = Inflation { readings: 20.0, most: 10.0 };

fn wary() -> FoldConfig {
    FoldConfig { quarantine: Some(QUARANTINE), ..FoldConfig::default() }
}

fn following() -> FoldConfig {
    FoldConfig { inflation: Some(INFLATION), ..FoldConfig::default() }
}

fn together(config: FoldConfig) -> FoldConfig {
    let how = Relinearization { block_ns: 5_000_000_000, ahead_ns: 5_000_000_000, passes: 4, cell_ns: 0 };
    FoldConfig { relinearize: Some(how), ..config }
}

/// Ten robots with fixes that see one another.
fn ten() -> World<'static> {
    World { all_gps: true, every: 1, ..World::default() }
}

/// The robots that were found to contradict the others, after how many seconds from when one lies, and whether in whole.
fn distrusted(joint: &Joint) -> Vec<(u32, f64, bool)> {
    let of = |robot: &pleiad_estimation::joint::Member| {
        let since = robot.reputation.detached.or(robot.reputation.distrust.map(|of| of.since))?;
        let whole =
            robot.reputation.detached.is_some() || robot.reputation.distrust.is_some_and(|of| of.whole);
        Some((robot.robot.0, since.0 as f64 / 1e9 - SINCE as f64 * TICK_S, whole))
    };
    joint.members().filter_map(of).collect()
}

fn team(seed: u64, robots: usize, seconds: i64, config: &FoldConfig, world: World<'_>) -> Run {
    run(seed, seconds, config, world, &vec![(Wrong::default(), None); robots])
}

fn lies(robot: usize) -> [(&'static str, Lie); 3] {
    let honest = Lie::none(robot, SINCE);
    [
        ("fix", Lie { fix_m: [2.0, 0.0], ..honest }),
        ("sighting", Lie { sighting: [0.3, 0.1], ..honest }),
        ("answer", Lie { answer_m: 1.0, ..honest }),
    ]
}

/// Of runs with `robots` the errors of position at the end, root mean square in metres, and their NEES over its dimension.
fn judged(config: &FoldConfig, robots: usize, seconds: i64, world: World<'_>) -> (f64, f64) {
    let (mut square, mut nees) = (0.0, 0.0);
    for seed in 0..RUNS {
        let run = team(seed, robots, seconds, config, world);
        let mut ledger = run.ledger(*config);
        let joint = ledger.settle();
        square += run.error_m(joint).powi(2) / RUNS as f64;
        nees += run.nees_of_positions(joint) / RUNS as f64;
    }
    (square.sqrt(), nees)
}

/// Two in ten of the readings are a liar's or about it; each robot sees two others a second, and has a fix. Of a false fix only
/// what is said of the map is false.
#[test]
fn one_liar_of_ten_is_found_within_seconds_and_nobody_else_is() {
    for config in [wary(), FoldConfig { inflation: Some(INFLATION), ..wary() }, together(wary())] {
        // What levels that follow explain by noise is no lie to them.
        for (what, lie) in
            lies(3).into_iter().filter(|(what, _)| config.inflation.is_none() || *what == "answer")
        {
            let mut after = Vec::new();
            for seed in 0..20 {
                let run = team(seed, 10, 40, &config, World { lie: Some(lie), ..ten() });
                let found = distrusted(run.ledger(config).settle());
                let [(robot, seconds, whole)] = found[..] else { panic!("{what} {seed}: {found:?}") };
                assert_eq!((robot, whole), (4, what != "fix"), "{what} {seed}");
                assert!(seconds > 0.0, "{what} {seed}: {seconds}");
                after.push(seconds);
            }
            after.sort_by(f64::total_cmp);
            println!("{what}: median {:.1} s, last {:.1} s", after[10], after[19]);
            assert!(after[10] < 8.0 && after[19] < 16.0, "{what}: {after:?}");
        }
    }
}

/// Errors of the honest ones at the end, root mean square, m.
fn error_without(liar: u32, config: &FoldConfig, world: World<'_>) -> f64 {
    let mut square = 0.0;
    for seed in 0..RUNS {
        let run = team(seed, 4, 60, config, world);
        let mut ledger = run.ledger(*config);
        let joint = ledger.settle();
        square += run.error_without_m(joint, liar).powi(2) / RUNS as f64;
    }
    square.sqrt()
}

/// Four robots, of which the first has fixes and the last lies. What was believed before it is found stays in the estimate, but
/// no more comes.
#[test]
fn the_honest_are_nearly_where_they_would_be_without_the_liar() {
    for (what, lie) in &lies(3)[1..] {
        let world = World { every: 1, slip: 4.0, ..World::default() };
        let lying = World { lie: Some(*lie), ..world };
        let honest = error_without(4, &wary(), world);
        let trusting = error_without(4, &FoldConfig::default(), lying);
        let found = error_without(4, &wary(), lying);
        println!("{what}: {honest} honest, {trusting} believed, {found} found");
        assert!(trusting > 1.15 * honest && found < 1.15 * honest, "{what}: {honest} {trusting} {found}");
        // To levels that follow a false sighting is a noisy one; they do not tell them apart.
        let followed = error_without(4, &following(), lying);
        println!("{what}: {followed} with levels that follow");
    }
}

/// A robot that is shoved contradicts the others as a liar does. In a frame of its own it finds back.
#[test]
fn a_robot_that_was_carried_off_finds_back() {
    let wary = wary();
    let (unmoved, _) = judged(&wary, 4, 60, World::default());
    for config in [wary, FoldConfig { inflation: Some(INFLATION), ..wary }, together(wary)] {
        for by in [1.0, 4.0] {
            let shoved = World { shove: Some((2, SINCE, by)), ..World::default() };
            let (lost, _) = judged(&FoldConfig::default(), 4, 60, shoved);
            let (found, nees) = judged(&config, 4, 60, shoved);
            println!("{by} m: {lost} without, {found}, NEES {nees}; {unmoved} unmoved");
            assert!(lost > 5.0 * unmoved, "{lost} {unmoved}");
            assert!(found < 1.25 * unmoved && nees < 1.2, "{found} {unmoved} {nees}");
        }
    }
}

/// A liar that has a frame of its own comes back at best to be found again.
#[test]
fn a_liar_does_not_find_back() {
    let config = wary();
    for (what, lie) in &lies(3)[1..] {
        for seed in 0..20 {
            let run = team(seed, 10, 60, &config, World { lie: Some(*lie), ..ten() });
            let mut ledger = run.ledger(config);
            let joint = ledger.settle();
            let believed = |robot: RobotId| {
                joint.is_in_map(robot)
                    && joint.member(robot).is_some_and(|of| of.reputation.distrust.is_none())
            };
            let kept_out: Vec<RobotId> = (1..=10).map(RobotId).filter(|robot| !believed(*robot)).collect();
            assert_eq!(kept_out, [RobotId(4)], "{what} {seed}");
        }
    }
}

/// `HOURS` of them, of teams of three, five and ten. With three in ten of the sightings of nothing, which the filter is told.
#[test]
fn for_hours_nobody_honest_is_distrusted() {
    let hours: f64 = std::env::var("HOURS").map_or(1.0, |hours| hours.parse().expect("a number of hours"));
    let told = FoldConfig { clutter: Some(Clutter { share: 0.3, reach_m: 8.0 }), ..wary() };
    for (config, garbage) in [(wary(), 0.0), (wary(), 0.05), (told, 0.3)] {
        for (robots, every) in [(10, 1), (5, 2), (3, 4)] {
            let mut found = Vec::new();
            let runs = (30.0 * hours).ceil() as u64;
            for seed in 1000..1000 + runs {
                let run = team(seed, robots, 120, &config, World { garbage, every, ..ten() });
                found.extend(distrusted(run.ledger(config).settle()).into_iter().map(|found| (seed, found)));
            }
            println!("{robots} robots, {garbage} of nothing, {hours} h: {found:?}");
            // Untold of what is of nothing, chance finds a liar every fifty hours.
            let by_chance = if garbage > 0.0 && config.clutter.is_none() { hours / 20.0 } else { 0.0 };
            assert!(found.len() as f64 <= by_chance, "{found:?}");
        }
    }
}

/// What cannot be known: which of two that contradict each other is right, and whether the only one that knows is.
#[test]
fn without_redundancy_nobody_is_distrusted() {
    let [(_, lie), ..] = lies(0);
    let from_the_start = Lie { from: 0, ..lie };
    let config = FoldConfig { join: true, ..wary() };
    let base = World { every: 1, ..World::default() };
    let two = World { all_gps: true, lie: Some(lie), ..base };
    let only_one_knows = World { told: 1, lie: Some(from_the_start), ..base };
    for (robots, world) in [(2, two), (10, only_one_knows)] {
        for seed in 0..20 {
            let run = team(seed, robots, 60, &config, world);
            let mut ledger = run.ledger(config);
            let joint = ledger.settle();
            assert_eq!(distrusted(joint), [], "{robots} robots, seed {seed}");
            if robots == 10 {
                let found = run.error_m(joint);
                assert!((found - 2.0).abs() < 0.4, "the team is where it says: seed {seed}, {found} m");
            }
        }
    }
}

const PLACES: [[f64; 2]; 5] = [[-4.0, -3.0], [3.0, 4.0], [0.0, -4.5], [4.5, 0.5], [-1.0, 3.5]];

/// Six robots that see landmarks whose places they know, and each other.
fn by_landmarks() -> World<'static> {
    World { gps: false, landmarks: &PLACES, known: true, ..World::default() }
}

/// A landmark that is half a metre from where everybody thinks: it is what is wrong, and no robot.
#[test]
fn a_landmark_that_everyone_contradicts_blames_nobody() {
    let misplaced = World { misplaced_m: 0.5, ..by_landmarks() };
    for seed in 0..20 {
        let run = team(seed, 6, 60, &wary(), misplaced);
        let mut ledger = run.ledger(wary());
        let joint = ledger.settle();
        assert_eq!(distrusted(joint), [], "seed {seed}");
        let landmark = Party::Landmark(LandmarkId(0));
        let against = |of: Party| {
            joint.contradictions().iter().filter(|pair| pair.of == of).fold(0.0, |sum, pair| sum + pair.level)
        };
        assert!(against(landmark) > QUARANTINE.level, "seed {seed}: {}", against(landmark));
    }
}

/// One whose landmarks are all too far, where others agree with them, is not believed on the map, and on others still.
#[test]
fn a_robot_that_alone_contradicts_the_landmarks_is_not_believed_on_the_map() {
    let lie = Lie { landmark_m: 0.6, ..Lie::none(3, SINCE) };
    for seed in 0..20 {
        let run = team(seed, 6, 60, &wary(), World { lie: Some(lie), ..by_landmarks() });
        let found = distrusted(run.ledger(wary()).settle());
        assert!(matches!(found[..], [(4, seconds, false)] if seconds > 0.0), "seed {seed}: {found:?}");
    }
}

/// Noise of the odometry several times what is stated, and as stated.
#[test]
fn levels_follow_noise_that_is_understated() {
    for (slip, by) in [(1.0, 1.0), (4.0, 1.0), (1.0, 3.0), (4.0, 3.0), (1.0, 5.0)] {
        let world = World { slip: slip * by, understated: by, ..World::default() };
        let (stated, stated_nees) = judged(&FoldConfig::default(), 4, 60, world);
        let (followed, nees) = judged(&following(), 4, 60, world);
        println!("{slip} x {by}: {stated} NEES {stated_nees}, following {followed} NEES {nees}");
        if by < 1.5 {
            // It costs next to nothing where it is not needed, and is on the safe side.
            assert!(
                followed < 1.02 * stated && nees < stated_nees && nees > 0.75,
                "{followed} {stated} {nees}"
            );
        } else {
            assert!(followed < 0.6 * stated && stated_nees > 5.0 && nees < 2.2, "{followed} {stated} {nees}");
        }
    }
}
