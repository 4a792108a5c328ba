//! Effects on a robot's readings of itself, on the reference and on the clock.

use pleiad_estimation::geometry::wrap_angle;
use pleiad_estimation::sample::Reading;
use pleiad_physics::Effect;
use pleiad_sim_peers::SimulatedRun;

use crate::{MIXED, ROBOT, channels, close, pose, run};

/// Noise is 1e-9 of its unit, and so is the rounding of stamps at this speed.
const EXACT: f64 = 2e-8;

/// Every reading of the gyro with its time, and the same without the effect.
fn gyro(effect: Effect, values: &[f64]) -> Vec<(f64, f64, f64)> {
    let (clean, acted) = (run(MIXED, effect, &zeros(effect)), run(MIXED, effect, values));
    let rate = |reading| match reading {
        Reading::Gyro { yaw_rate_rad_s } => yaw_rate_rad_s,
        other => panic!("{other:?}"),
    };
    let pairs = channels(&clean).gyro.iter().zip(&channels(&acted).gyro);
    pairs.map(|(clean, acted)| (clean.time.seconds(), rate(clean.reading), rate(acted.reading))).collect()
}

fn zeros(effect: Effect) -> Vec<f64> {
    effect.info().parameters.iter().map(|parameter| parameter.off).collect()
}

#[test]
fn a_gyro_reads_its_bias_scale_and_temperature() {
    for (time, clean, acted) in gyro(Effect::GyroBias, &[0.003]) {
        close(acted - clean, 0.003, EXACT);
        assert!(time > 0.0);
    }
    for (_, clean, acted) in gyro(Effect::GyroScale, &[0.01]) {
        close(acted, 1.01 * clean, EXACT);
    }
    for (time, clean, acted) in gyro(Effect::GyroThermalDrift, &[0.005, 8.0]) {
        close(acted - clean, 0.005 * (1.0 - (-time / 8.0).exp()), EXACT);
    }
}

/// Errors of the heading sensor with the true heading then.
fn heading_errors(effect: Effect, values: &[f64]) -> Vec<(f64, f64)> {
    let run = run(MIXED, effect, values);
    let error = |sample: &pleiad_estimation::sample::Sample| {
        let Reading::Heading { heading_rad } = sample.reading else { panic!("{sample:?}") };
        let truth = run.tracks[&ROBOT].pose_at(sample.time).yaw_rad();
        (truth, wrap_angle(heading_rad - truth))
    };
    channels(&run).heading.iter().map(error).collect()
}

#[test]
fn a_compass_errs_by_offsets_and_by_the_field_of_the_robot() {
    for effect in [Effect::HeadingOffset, Effect::SunSensorMisalignment] {
        for (_, error) in heading_errors(effect, &[0.1]) {
            close(error, 0.1, EXACT);
        }
    }
    for (heading, error) in heading_errors(Effect::CompassHardIron, &[0.06, -0.04]) {
        // North is (0, 1) in the map. In the body it stands at 90 degrees minus the heading; the robot adds
        // its own field there, and the heading is read from where the sum points.
        let (north_x, north_y) = (heading.sin(), heading.cos());
        let read = std::f64::consts::FRAC_PI_2 - (north_y - 0.04).atan2(north_x + 0.06);
        close(wrap_angle(error - (read - heading)), 0.0, EXACT);
    }
    for (heading, error) in heading_errors(Effect::CompassSoftIron, &[0.05, 0.4]) {
        close(error, 0.05 * (2.0 * (heading - 0.4)).sin(), EXACT);
    }
}

/// Where GPS reads the robot, against where it is.
fn gps(run: &SimulatedRun) -> Vec<(f64, [f64; 2])> {
    let position = |sample: &pleiad_estimation::sample::Sample| match sample.reading {
        Reading::Gps { x_m, y_m } => (sample.time.seconds(), [x_m, y_m]),
        other => panic!("{other:?}"),
    };
    channels(run).gps.iter().map(position).collect()
}

#[test]
fn gps_reads_its_antenna_and_a_place_that_was() {
    let lever = run(MIXED, Effect::GpsLeverArm, &[0.2, -0.1]);
    for (time, [x, y]) in gps(&lever) {
        let expected = pose(&lever, time).act(pleiad_estimation::geometry::Vector2::new(0.2, -0.1));
        close(x, expected.x, EXACT);
        close(y, expected.y, EXACT);
    }
    let late = run(MIXED, Effect::GpsLatency, &[0.15]);
    for (time, [x, y]) in gps(&late) {
        close(x, pose(&late, time - 0.15).x_m(), EXACT);
        close(y, pose(&late, time - 0.15).y_m(), EXACT);
    }
}

#[test]
fn patches_of_multipath_and_of_magnetic_field_end_at_their_borders() {
    let patch = [0.5, 2.0, -1.0, 1.0];
    let within = |x: f64, y: f64| (0.5..=2.0).contains(&x) && (-1.0..=1.0).contains(&y);
    let values: Vec<f64> = patch.into_iter().chain([0.5, -0.3]).collect();
    let multipath = run(MIXED, Effect::GpsMultipathPatch, &values);
    let mut counts = [0, 0];
    for (time, [x, y]) in gps(&multipath) {
        let truth = pose(&multipath, time);
        let inside = within(truth.x_m(), truth.y_m());
        close(x - truth.x_m(), if inside { 0.5 } else { 0.0 }, EXACT);
        close(y - truth.y_m(), if inside { -0.3 } else { 0.0 }, EXACT);
        counts[usize::from(inside)] += 1;
    }
    assert!(counts.iter().all(|count| *count > 5), "{counts:?}");
    let values: Vec<f64> = patch.into_iter().chain([0.2]).collect();
    let field = run(MIXED, Effect::LocalMagneticField, &values);
    for sample in &channels(&field).heading {
        let Reading::Heading { heading_rad } = sample.reading else { panic!("{sample:?}") };
        let truth = field.tracks[&ROBOT].pose_at(sample.time);
        let expected = if within(truth.x_m(), truth.y_m()) { 0.2 } else { 0.0 };
        close(wrap_angle(heading_rad - truth.yaw_rad()), expected, EXACT);
    }
}

#[test]
fn the_reference_sees_its_marker_and_a_pose_that_was() {
    let marked = run(MIXED, Effect::TruthMarkerOffset, &[0.03, 0.02, 0.05]);
    let marker = pleiad_estimation::Pose2::new(0.03, 0.02, 0.05);
    let late = run(MIXED, Effect::TruthLatency, &[0.02]);
    for (run, late_s, marker) in [(&marked, 0.0, marker), (&late, 0.02, pleiad_estimation::Pose2::identity())]
    {
        for sample in &channels(run).truth {
            let expected = pose(run, sample.time.seconds() - late_s).compose(&marker);
            let error = expected.between(&sample.pose).log().norm();
            close(error, 0.0, EXACT);
        }
    }
}

#[test]
fn a_clock_stamps_by_its_offset_and_rate_what_is_sampled_at_common_times() {
    let clean = run(MIXED, Effect::ClockOffset, &[0.0]);
    let stamps = |run: &SimulatedRun| {
        let own = channels(run);
        let commands = own.commands.iter().map(|command| command.time);
        let samples = [&own.odometry, &own.gyro, &own.gps, &own.heading, &own.sightings];
        commands.chain(samples.into_iter().flatten().map(|sample| sample.time)).collect::<Vec<_>>()
    };
    for (effect, value) in [(Effect::ClockOffset, -0.05), (Effect::ClockDrift, 400.0)] {
        let acted = run(MIXED, effect, &[value]);
        assert_eq!(stamps(&acted).len(), stamps(&clean).len());
        for (true_time, stamp) in stamps(&clean).into_iter().zip(stamps(&acted)) {
            let ahead_s =
                if effect == Effect::ClockOffset { value } else { value * 1e-6 * true_time.seconds() };
            close(stamp.seconds_since(true_time), ahead_s, 1e-9);
        }
        // Readings are those of the true instants.
        let readings = |run: &SimulatedRun| -> Vec<Reading> {
            channels(run).samples().iter().map(|sample| sample.reading).collect()
        };
        assert_eq!(readings(&acted).len(), readings(&clean).len());
        assert_eq!(
            gps(&acted).iter().map(|row| row.1).collect::<Vec<_>>(),
            gps(&clean).iter().map(|row| row.1).collect::<Vec<_>>()
        );
        assert_eq!(channels(&acted).truth, channels(&clean).truth);
    }
}
