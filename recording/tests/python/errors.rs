//! ATE and RPE are those of evo, on trajectories as we write them.

use pleiad_estimation::statistics::{
    Alignment, ErrorStatistics, PosePair, absolute_trajectory_error, relative_pose_error,
};
use pleiad_estimation::{Pose2, Timestamp};
use pleiad_recording::tum;
use serde_json::Value;

use crate::{Chance, ask};

/// What evo has to agree to.
const TOLERANCE: f64 = 1e-6;

/// A drive through the plane and an estimate that wanders off, in another frame.
fn pairs() -> Vec<PosePair> {
    let mut chance = Chance(11);
    let (mut truth, mut drift) = (Pose2::new(3.0, -2.0, 2.9), Pose2::new(0.4, 0.3, 0.2));
    let mut pairs = Vec::new();
    for step in 0..1003 {
        let time = Timestamp(1_248_444_175_000_000_000).plus_seconds(0.1 * f64::from(step));
        pairs.push(PosePair { time, truth, estimate: drift.compose(&truth) });
        truth = truth.compose(&Pose2::new(0.05, 0.0, 0.04 * chance.next()));
        drift = drift.compose(&Pose2::new(0.01 * chance.next(), 0.01 * chance.next(), 0.005 * chance.next()));
    }
    pairs
}

fn check(told: &Value, ours: &ErrorStatistics, name: &str) {
    let numbers = [
        ("rmse", ours.rmse),
        ("mean", ours.mean),
        ("median", ours.median),
        ("std", ours.std),
        ("min", ours.min),
        ("max", ours.max),
        ("sse", ours.sse),
    ];
    for (what, number) in numbers {
        let theirs = told[name][what].as_f64().unwrap();
        assert!((number - theirs).abs() < TOLERANCE, "{name}, {what}: {number}, evo {theirs}");
    }
}

#[test]
fn errors_of_trajectories_are_those_of_evo() {
    let pairs = pairs();
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, pose: fn(&PosePair) -> Pose2| {
        let path = folder.path().join(name);
        tum::write(&path, &pairs.iter().map(|pair| (pair.time, pose(pair))).collect::<Vec<_>>()).unwrap();
        path
    };
    let (truth, estimate) =
        (file("truth.tum", |pair| pair.truth), file("estimate.tum", |pair| pair.estimate));
    let told = ask("trajectory_error.py", &[&truth, &estimate]);
    assert_eq!(told["count"].as_u64(), Some(1003));
    let ate = |alignment| absolute_trajectory_error(&pairs, alignment).unwrap();
    assert!(ate(Alignment::None).rmse > 2.0 * ate(Alignment::Se2).rmse, "the alignment matters here");
    check(&told, &ate(Alignment::None), "ate");
    check(&told, &ate(Alignment::Se2), "ate aligned");
    for delta in [1, 10] {
        for (all_pairs, how) in [(false, "steps"), (true, "all")] {
            let ours = relative_pose_error(&pairs, delta, all_pairs).unwrap();
            check(&told, &ours.translation_m, &format!("translation_part {delta} {how}"));
            check(&told, &ours.rotation_rad, &format!("rotation_angle_rad {delta} {how}"));
        }
    }
}
