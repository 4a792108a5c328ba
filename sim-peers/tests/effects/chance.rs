//! Effects of chance, against their distributions. Bounds are 4.5 standard deviations; seeds are fixed.

use std::collections::BTreeMap;

use pleiad_estimation::Pose2;
use pleiad_estimation::sample::{Reading, Target};
use pleiad_physics::Effect;
use pleiad_sim_peers::{Scenario, SimulatedRun};

use crate::sightings::{geometry, seen};
use crate::{MIXED, RADIUS_M, ROBOT, TAU_S, active, channels, close, run, scenario, wheels, with};

const RANGE_M: f64 = 0.03;
const BEARING_RAD: f64 = 0.01;

/// The mixed script with noisy sightings at 100 Hz.
fn noisy() -> Scenario {
    let mut scenario = scenario(MIXED);
    let relative = &mut scenario.robots.get_mut(&ROBOT).unwrap().relative;
    (relative.rate_hz, relative.sigma_range_m, relative.sigma_bearing_rad) = (100.0, RANGE_M, BEARING_RAD);
    scenario
}

/// Errors of range and bearing over their declared sigmas, with range, bearing and yaw rate.
fn errors(run: &SimulatedRun) -> Vec<[f64; 5]> {
    let one = |seen: &crate::sightings::Seen| {
        let (range, bearing) = geometry(run, seen, Pose2::identity(), 0.0);
        let track = &run.tracks[&ROBOT];
        let yaw = |seconds: f64| track.pose_at(crate::at(seconds)).yaw_rad();
        let turned =
            pleiad_estimation::geometry::wrap_angle(yaw(seen.time_s + 0.005) - yaw(seen.time_s - 0.005));
        let off = pleiad_estimation::geometry::wrap_angle(seen.bearing_rad - bearing);
        [(seen.range_m - range) / RANGE_M, off / BEARING_RAD, range, bearing, turned / 0.01]
    };
    seen(run).iter().map(one).collect()
}

/// Asserts that squares have the mean 1, as those of standard normals.
#[track_caller]
fn standard(values: impl Iterator<Item = f64>) {
    let squares: Vec<f64> = values.map(|value| value * value).collect();
    let count = squares.len() as f64;
    assert!(count > 5000.0, "{count}");
    close(squares.iter().sum::<f64>() / count, 1.0, 4.5 * (2.0 / count).sqrt());
}

#[test]
fn the_spread_grows_with_range_and_with_the_yaw_rate() {
    let by_range = with(noisy(), &[active(Effect::RangeDependentNoise, &[0.02, 0.01, 0.005])]);
    let sigma = |range: f64| 1.0 + (0.02 + 0.01 * range + 0.005 * range * range) / RANGE_M;
    standard(errors(&by_range).iter().map(|[error, _, range, ..]| error / sigma(*range)));
    standard(errors(&by_range).iter().map(|[_, error, ..]| *error));
    let blurred = with(noisy(), &[active(Effect::MotionBlur, &[0.02])]);
    let sigma = |yaw_rate: f64| 1.0 + 0.02 * yaw_rate.abs() / BEARING_RAD;
    standard(errors(&blurred).iter().map(|[_, error, _, _, yaw_rate]| error / sigma(*yaw_rate)));
    standard(errors(&blurred).iter().map(|[error, ..]| *error));
}

#[test]
fn heavy_tails_have_the_quantiles_of_students_distribution() {
    let run = with(noisy(), &[active(Effect::HeavyTails, &[3.0])]);
    // Student's t of 3 degrees of freedom: P(|t| > 3.182) = 0.05, P(|t| > 0.765) = 0.5 (tables).
    for axis in 0..2 {
        let all = errors(&run);
        let count = all.len() as f64;
        for (beyond, share) in [(3.182, 0.05), (0.765, 0.5)] {
            let found = all.iter().filter(|row| row[axis].abs() > beyond).count() as f64;
            close(found, share * count, 4.5 * (count * share * (1.0 - share)).sqrt());
        }
    }
}

#[test]
fn detections_are_missed_with_the_logistic_probability() {
    let drop_out: f64 = 0.05;
    let mut clean = noisy();
    clean.robots.get_mut(&ROBOT).unwrap().relative.drop_out = drop_out;
    let effect = active(Effect::MissedDetections, &[0.5, 0.4, 0.3]);
    let (all, missed) = (with(noisy(), &[]), with(clean, &[effect]));
    let (mut expected, mut variance) = (0.0, 0.0);
    for [range_error, _, range, bearing, _] in errors(&all) {
        assert!(range_error.abs() < 6.0);
        let odds = drop_out / (1.0 - drop_out) * (0.5 + 0.4 * range + 0.3 * bearing * bearing).exp();
        let seen = 1.0 / (1.0 + odds);
        expected += seen;
        variance += seen * (1.0 - seen);
    }
    let found = seen(&missed).len() as f64;
    assert!(found < 0.9 * seen(&all).len() as f64);
    close(found, expected, 4.5 * variance.sqrt());
}

#[test]
fn a_share_of_sightings_bears_the_name_of_another_target_of_its_kind() {
    let probability = 0.2;
    let run = with(noisy(), &[active(Effect::IdentityMixUp, &[probability])]);
    let all = with(noisy(), &[]);
    // A scan is as it should be if none of its three landmarks is mixed up.
    let mut scans: BTreeMap<i64, usize> = BTreeMap::new();
    for (seen, row) in seen(&run).iter().zip(errors(&run)) {
        let right = matches!(seen.target, Target::Landmark(_)) && row[0].abs() < 8.0 && row[1].abs() < 8.0;
        *scans.entry(crate::at(seen.time_s).0).or_default() += usize::from(right);
    }
    let (count, share) = (scans.len() as f64, (1.0_f64 - probability).powi(3));
    assert!(count > 1900.0);
    let right = scans.values().filter(|right| **right == 3).count() as f64;
    close(right, share * count, 4.5 * (count * share * (1.0 - share)).sqrt());
    // The one other robot has nobody to be taken for.
    let robots =
        |run: &SimulatedRun| seen(run).iter().filter(|seen| matches!(seen.target, Target::Robot(_))).count();
    assert_eq!(robots(&run), robots(&all));
}

#[test]
fn a_gyros_walk_has_independent_increments_of_its_density() {
    let density = 5e-4;
    let (clean, walked) =
        (run(MIXED, Effect::GyroRandomWalk, &[0.0]), run(MIXED, Effect::GyroRandomWalk, &[density]));
    let rates = |run: &SimulatedRun| -> Vec<f64> {
        let rate = |reading| match reading {
            Reading::Gyro { yaw_rate_rad_s } => yaw_rate_rad_s,
            other => panic!("{other:?}"),
        };
        channels(run).gyro.iter().map(|sample| rate(sample.reading)).collect()
    };
    let walk: Vec<f64> =
        rates(&walked).iter().zip(rates(&clean)).map(|(with, without)| with - without).collect();
    let sigma = density * 0.02_f64.sqrt();
    let steps: Vec<f64> = walk.windows(2).map(|pair| (pair[1] - pair[0]) / sigma).collect();
    let count = steps.len() as f64;
    close(steps.iter().map(|z| z * z).sum::<f64>() / count, 1.0, 4.5 * (2.0 / count).sqrt());
    let products: f64 = steps.windows(2).map(|pair| pair[0] * pair[1]).sum();
    close(products / count, 0.0, 4.5 / count.sqrt());
}

/// The distance that a robot is behind its commands, over and over from rest, in seconds.
fn lateness(run: &SimulatedRun) -> Vec<f64> {
    let wheels = wheels(run);
    let angle_at = |seconds: f64| wheels.iter().rfind(|(time, _)| *time <= seconds).unwrap();
    let commands = &channels(run).commands;
    let starts = commands.windows(2).filter(|pair| pair[0].forward_m_s == 0.0 && pair[1].forward_m_s > 0.0);
    starts
        .map(|pair| {
            let begun_s = pair[1].time.seconds();
            let (before, (time, after)) = (angle_at(begun_s - 0.02), angle_at(begun_s + 0.79));
            time - begun_s - RADIUS_M * (after[0] - before.1[0]) / 0.5
        })
        .collect()
}

#[test]
fn jitter_is_uniform_and_a_lost_command_holds_the_one_before() {
    let rows: Vec<String> = (0..100).map(|_| "[0.5, 0.0, 0.8], [0.0, 0.0, 0.8]".to_owned()).collect();
    let long = |effect, values: &[f64]| {
        let mut scenario = scenario(&format!("[{}]", rows.join(", ")));
        scenario.duration_s = 160.0;
        with(scenario, &[active(effect, values)])
    };
    let late: Vec<f64> = lateness(&long(Effect::CommandJitter, &[0.02])).iter().map(|s| s - TAU_S).collect();
    let count = late.len() as f64;
    assert!(count > 95.0 && late.iter().all(|late| (-1e-4..0.0201).contains(late)), "{late:?}");
    // Mean and variance of the uniform distribution; the sample variance of it has kurtosis 1.8.
    let mean = late.iter().sum::<f64>() / count;
    let variance = late.iter().map(|late| (late - mean).powi(2)).sum::<f64>() / count;
    close(mean, 0.01, 4.5 * 0.02 / (12.0 * count).sqrt());
    close(variance * 12.0 / 4e-4, 1.0, 4.5 * (0.8 / count).sqrt());

    // A start that is lost is late by a period of 40 ms, and by another with every further loss.
    let probability = 0.25;
    let late = lateness(&long(Effect::CommandLoss, &[probability]));
    let periods: Vec<f64> = late.iter().map(|late| (late - TAU_S) / 0.04).collect();
    assert!(periods.iter().all(|periods| (periods - periods.round()).abs() < 0.01), "{periods:?}");
    let on_time = periods.iter().filter(|periods| periods.round() == 0.0).count() as f64;
    let count = periods.len() as f64;
    close(on_time, (1.0 - probability) * count, 4.5 * (count * probability * (1.0 - probability)).sqrt());
}
