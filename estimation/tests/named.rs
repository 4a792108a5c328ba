//! Sightings of landmarks that go by another's name.

#![allow(clippy::expect_used, reason = "a fixture")]
#![allow(clippy::print_stdout, reason = "figures for the documentation")]

mod support;

use pleiad_estimation::fact::{
    Absolute, Body, Boot, Entry, EntryId, Noise, NoiseRef, NominalState, Observation, Quantity,
};
use pleiad_estimation::fold::{Clutter, Fact, FoldConfig, Outcome};
use pleiad_estimation::joint::Party;
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::sample::Relative;
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, LandmarkId, Pose2, RobotId, Sequence, Timestamp};
use support::wander::{Run, World, Wrong, run};

const RUNS: u64 = 40;
const PLACES: [[f64; 2]; 6] = [[-4.0, -3.0], [-3.2, -3.4], [3.0, 4.0], [0.0, -4.5], [4.5, 0.5], [-1.0, 3.5]];

fn believing() -> FoldConfig {
    FoldConfig { clutter: Some(Clutter { share: 0.02, reach_m: 6.0 }), ..FoldConfig::default() }
}

fn asking() -> FoldConfig {
    FoldConfig { misnamed: 0.2, ..believing() }
}

fn world() -> World<'static> {
    World { gps: false, landmarks: &PLACES, known: true, slip: 6.0, every: 40, ..World::default() }
}

fn team(seed: u64, config: &FoldConfig, world: World<'_>) -> Run {
    run(seed, 60, config, world, &[(Wrong::default(), None); 3])
}

/// Errors of position at the end, root mean square in metres.
fn error_m(config: FoldConfig, world: World<'_>) -> f64 {
    let square: f64 = (0..RUNS)
        .map(|seed| {
            let run = team(seed, &config, world);
            run.error_m(run.ledger(config).settle()).powi(2)
        })
        .sum();
    (square / RUNS as f64).sqrt()
}

#[test]
fn landmarks_by_wrong_names_cost_little_when_they_are_asked_for() {
    let clean = error_m(believing(), world());
    let asked_for_nothing = error_m(asking(), world());
    println!("clean {clean}, asked for nothing {asked_for_nothing}");
    assert!(asked_for_nothing < 1.05 * clean, "{asked_for_nothing} {clean}");
    for misnamed in [0.1, 0.3] {
        let wrong = World { misnamed, ..world() };
        let (gated, asked) = (error_m(FoldConfig::default(), wrong), error_m(asking(), wrong));
        println!("{misnamed}: gate {gated}, asked {asked}");
        assert!(asked < 1.2 * clean && asked < gated, "{asked} {gated} {clean}");
    }
    let swapped = World { swapped: true, ..world() };
    let (believed, asked) = (error_m(believing(), swapped), error_m(asking(), swapped));
    println!("swapped: {believed}, asked {asked}");
    assert!(asked < 1.2 * clean && believed > 3.0 * clean, "{asked} {believed} {clean}");
    let unknown = World { known: false, gps: true, misnamed: 0.1, ..world() };
    let (believed, asked) = (error_m(believing(), unknown), error_m(asking(), unknown));
    println!("nobody knows the landmarks: {believed}, asked {asked}");
    assert!(asked < believed, "{asked} {believed}");
}

/// Five robots, one of them with fixes, that see each other every fifth of a second and mistake one for another.
#[test]
fn robots_by_wrong_names_cost_little_when_everyone_answers() {
    let world = World { all_answer: true, slip: 4.0, ..World::default() };
    let error = |config: FoldConfig, world: World<'_>| {
        let square: f64 = (0..RUNS)
            .map(|seed| {
                let run = run(seed, 60, &config, world, &[(Wrong::default(), None); 5]);
                run.error_m(run.ledger(config).settle()).powi(2)
            })
            .sum();
        (square / RUNS as f64).sqrt()
    };
    let clean = error(believing(), world);
    let asked_for_nothing = error(asking(), world);
    println!("clean {clean}, asked for nothing {asked_for_nothing}");
    assert!(asked_for_nothing < 1.05 * clean, "{asked_for_nothing} {clean}");
    for mistaken in [0.1, 0.3, 0.5] {
        let wrong = World { mistaken, ..world };
        let (gated, asked) = (error(FoldConfig::default(), wrong), error(asking(), wrong));
        println!("{mistaken}: gate {gated}, asked {asked}");
        assert!(asked < 1.2 * clean && asked < gated, "{asked} {gated} {clean}");
    }
    let swapped = World { swapped: true, ..world };
    let (gated, asked) = (error(FoldConfig::default(), swapped), error(asking(), swapped));
    println!("swapped: gate {gated}, asked {asked}");
    // Every sighting of two robots in five is wrong, and where they are close to each other they stay confused.
    assert!(asked < 0.95 * gated, "{asked} {gated}");
}

/// Two landmarks that stand for each other all the time, a metre apart: what is seen is used as what it is.
#[test]
fn landmarks_that_stand_for_each_other_are_told_apart() {
    let (mut right, mut wrong, mut others) = (0, 0, 0);
    for seed in 0..RUNS {
        let run = team(seed, &asking(), World { swapped: true, ..world() });
        let mut ledger = run.ledger(asking());
        ledger.settle();
        for (_, record) in ledger.facts() {
            let Fact::Observation { quantity: Quantity::Landmark { landmark, .. }, .. } = record.fact else {
                continue;
            };
            match (landmark.0, record.residual.expect("settled").outcome) {
                (0 | 1, Outcome::UsedAs(Party::Landmark(other))) if other.0 == 1 - landmark.0 => right += 1,
                (0 | 1, Outcome::Used) => wrong += 1,
                (2.., Outcome::UsedAs(_)) => others += 1,
                _ => {}
            }
        }
    }
    println!("{right} {wrong} {others}");
    assert!(right > 20 * wrong && right > 50 * others && right > 500, "{right} {wrong} {others}");
}

/// In whatever order it is heard.
#[test]
fn any_order_gives_the_same_bits() {
    for (seed, known) in [(1, true), (2, false)] {
        let wrong =
            World { misnamed: 0.2, known, gps: true, mistaken: 0.3, all_answer: true, every: 4, ..world() };
        let run = team(seed, &asking(), wrong);
        let mut backwards = Ledger::new(asking());
        for robot in run.robots.iter().rev() {
            for entry in &robot.entries {
                backwards.insert(entry.clone());
                if entry.id.sequence.0 % 50 == 0 {
                    backwards.settle();
                }
            }
        }
        assert_eq!(backwards.fingerprint(), run.ledger(asking()).fingerprint());
    }
}

/// A robot at the origin that is unsure by 0.3 m sees something a metre ahead of it, which it takes for a landmark at 1.6 m. There is
/// one at 1.0 m too. By hand: two Kalman updates and nothing, by their weights.
#[test]
fn the_mixture_is_that_of_the_textbook() {
    let (variance, noise): (f64, f64) = (0.09, 0.04);
    let config =
        FoldConfig { misnamed: 0.1, clutter: Some(Clutter { share: 0.05, reach_m: 5.0 }), ..believing() };
    let mut ledger = Ledger::new(config);
    let mut say = |sequence: u64, body| {
        let id = EntryId { robot: RobotId(1), boot: BootIndex(0), sequence: Sequence(sequence) };
        ledger.insert(Entry { id, body, extension: Vec::new() });
    };
    let state = NominalState::new(Pose2::identity(), Symmetric3::zero());
    let sees = |time: i64, quantity, sigmas: &[f64]| {
        let noise = NoiseRef::Explicit(Noise::from_sigmas(sigmas));
        Body::Observation(Observation { time: Timestamp(time), quantity, noise, observer: state })
    };
    let configuration = config.hash();
    let boot = Boot {
        time: Timestamp(0),
        nonce: 1,
        configuration,
        nominal: Pose2::identity(),
        continuation: None,
        calibration: None,
    };
    say(0, Body::Boot(boot));
    // Its heading is as good as known, so that positions are all there is.
    say(
        1,
        sees(
            0,
            Quantity::Absolute(Absolute::Pose(Pose2::identity())),
            &[variance.sqrt(), variance.sqrt(), 1e-9],
        ),
    );
    let position = |x_m| Relative::Position { x_m, y_m: 0.0 };
    let at = |number, x, seen| Quantity::Landmark {
        landmark: LandmarkId(number),
        position_m: [x, 0.0],
        relative: position(seen),
    };
    // The first sighting of the other one says where it is; with so much noise it says nothing else.
    say(2, sees(1, at(7, 1.0, 1.0), &[1e6, 1e6]));
    say(3, sees(2, at(8, 1.6, 1.0), &[noise.sqrt(), noise.sqrt()]));
    let joint = ledger.settle();
    let total = variance + noise;
    let density = |x: f64| (-0.5 * x * x / total).exp() / (std::f64::consts::TAU * total);
    // Of something 0.6 m off, of something where it should be, of nothing in a disc of 5 m.
    let weights = [0.85 * density(0.6), 0.1 * density(0.0), 0.05 / (std::f64::consts::PI * 25.0)];
    let sum: f64 = weights.iter().sum();
    let [claimed, other, _] = weights.map(|weight| weight / sum);
    let gain = variance / total;
    let mean = claimed * gain * 0.6;
    let kept = variance - (claimed + other) * gain * variance;
    let spread = [kept + claimed * (gain * 0.6).powi(2) - mean * mean, kept];
    let (pose, covariance) = joint.estimate(RobotId(1), Timestamp(2), &state).expect("placed");
    assert!((pose.x_m() - mean).abs() < 1e-6 && pose.y_m().abs() < 1e-6, "{} {mean}", pose.x_m());
    let [xx, _, yy, ..] = covariance.0;
    assert!((xx - spread[0]).abs() < 1e-6 && (yy - spread[1]).abs() < 1e-6, "{xx} {yy} {spread:?}");
}
