//! Odometry noise: the body departs from what the wheels say by exactly the declared law.

use pleiad_estimation::geometry::{Matrix3, Pose2, Vector3};
use pleiad_estimation::sample::{Reading, Sample};
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_sim_peers::SimulatedRun;

use crate::{assert_standard, assert_uncorrelated, run};

const SPEED: f64 = 0.02;
const LATERAL: f64 = 0.004;
const YAW: f64 = 0.01;
const PER_METRE: f64 = 0.03;
const PER_RADIAN: f64 = 0.02;
const WHEEL_RADIUS_M: f64 = 0.07;
const TRACK_WIDTH_M: f64 = 0.36;

fn text(kind: &str, policy: &str, duration_s: f64, extra: &str) -> String {
    format!(
        "name = \"slip\"\nduration_s = {duration_s:?}\nteam_size = 1\n\
         [defaults]\nwheel_radius_m = {WHEEL_RADIUS_M}\ntrack_width_m = {TRACK_WIDTH_M}\n\
         [defaults.motion]\npolicy = \"{policy}\"\n\
         [defaults.odometry]\nkind = \"{kind}\"\n\
         noise = {{ speed_m_per_sqrt_s = {SPEED}, lateral_m_per_sqrt_s = {LATERAL}, \
         yaw_rad_per_sqrt_s = {YAW}, speed_m_per_sqrt_m = {PER_METRE}, yaw_rad_per_sqrt_rad = {PER_RADIAN}{extra} }}\n"
    )
}

/// What odometry says of a tick: the motion, and its length along the arc and angle.
struct Tick {
    from: Timestamp,
    until: Timestamp,
    motion: Pose2,
    forward_m: f64,
    turn_rad: f64,
}

/// A filter's reading of the odometry, from the documented meaning of each kind alone.
fn ticks(odometry: &[Sample]) -> Vec<Tick> {
    let tick = |pair: &[Sample]| {
        let (from, until) = (pair[0].time, pair[1].time);
        let dt_s = until.seconds_since(from);
        let (forward_m, turn_rad) = match (pair[0].reading, pair[1].reading) {
            (Reading::Velocity { forward_m_s, yaw_rate_rad_s }, _) => {
                (forward_m_s * dt_s, yaw_rate_rad_s * dt_s)
            }
            (
                Reading::Wheels { left_rad: left, right_rad: right },
                Reading::Wheels { left_rad: left_after, right_rad: right_after },
            ) => {
                let (left_m, right_m) =
                    (WHEEL_RADIUS_M * (left_after - left), WHEEL_RADIUS_M * (right_after - right));
                (0.5 * (left_m + right_m), (right_m - left_m) / TRACK_WIDTH_M)
            }
            (_, Reading::Increment(increment)) => (increment.log().x, increment.log().z),
            other => panic!("{other:?} is not odometry"),
        };
        let motion = Pose2::exp(Vector3::new(forward_m, 0.0, turn_rad));
        Tick { from, until, motion, forward_m, turn_rad }
    };
    odometry.windows(2).map(tick).collect()
}

fn variances(tick: &Tick) -> [f64; 3] {
    let dt_s = tick.until.seconds_since(tick.from);
    [
        SPEED * SPEED * dt_s + PER_METRE * PER_METRE * tick.forward_m.abs(),
        LATERAL * LATERAL * dt_s,
        YAW * YAW * dt_s + PER_RADIAN * PER_RADIAN * tick.turn_rad.abs(),
    ]
}

/// Per tick, `n` of `X(t + dt) = X(t) U exp(n)` over its declared sigmas.
fn normalized_slip(run: &SimulatedRun) -> Vec<[f64; 3]> {
    let track = &run.tracks[&RobotId(1)];
    ticks(&run.recording.robots[&RobotId(1)].odometry)
        .iter()
        .map(|tick| {
            let predicted = track.pose_at(tick.from).compose(&tick.motion);
            let slip = predicted.between(&track.pose_at(tick.until)).log();
            let sigmas = variances(tick).map(f64::sqrt);
            std::array::from_fn(|i| slip[i] / sigmas[i])
        })
        .collect()
}

#[test]
fn slip_over_every_tick_is_white_with_the_declared_variance_for_every_kind_of_odometry() {
    for kind in ["velocity", "wheels", "increment"] {
        let slip = normalized_slip(&run(&text(kind, "figure_eight", 300.0, ""), 11));
        assert!(slip.len() > 7400);
        for axis in 0..3 {
            let values: Vec<f64> = slip.iter().map(|n| n[axis]).collect();
            assert_standard(&format!("{kind} axis {axis}"), &values);
            let successive = values.windows(2).map(|pair| (pair[0], pair[1]));
            assert_uncorrelated(&format!("{kind} axis {axis} from tick to tick"), successive);
            let across = slip.iter().map(|n| (n[axis], n[(axis + 1) % 3]));
            assert_uncorrelated(&format!("{kind} axis {axis} with the next"), across);
        }
    }
}

#[test]
fn slip_grows_linearly_within_a_tick() {
    // Half way through a tick of five knots: variance half of the whole but for the straight line between
    // two knots, (0.4 + 0.25 * 0.2) = 0.45 of it.
    let text = text("velocity", "figure_eight", 300.0, "").replace("kind =", "rate_hz = 40.0\nkind =");
    let run = run(&text, 12);
    let track = &run.tracks[&RobotId(1)];
    let mut lateral = Vec::new();
    for tick in ticks(&run.recording.robots[&RobotId(1)].odometry) {
        let half_s = 0.5 * tick.until.seconds_since(tick.from);
        let wheels = Pose2::exp(Vector3::new(0.5 * tick.forward_m, 0.0, 0.5 * tick.turn_rad));
        let predicted = track.pose_at(tick.from).compose(&wheels);
        let slip = predicted.between(&track.pose_at(tick.from.plus_seconds(half_s))).log();
        lateral.push(slip.y / (0.45 * variances(&tick)[1]).sqrt());
    }
    assert_standard("lateral slip half way", &lateral);
}

#[test]
fn a_parked_robot_stays_put_if_quiet_and_drifts_as_declared_if_not() {
    let quiet = run(&text("velocity", "parked", 60.0, ""), 3);
    let track = &quiet.tracks[&RobotId(1)];
    assert_eq!(track.end_pose(), track.start());
    let restless = run(&text("velocity", "parked", 60.0, ", quiet_at_standstill = false"), 3);
    for axis in 0..3 {
        let values: Vec<f64> = normalized_slip(&restless).iter().map(|n| n[axis]).collect();
        assert_standard(&format!("parked axis {axis}"), &values);
    }
}

#[test]
fn dead_reckoning_with_the_declared_noise_is_consistent_over_a_hundred_seeds() {
    let text = text("velocity", "waypoints_random", 20.0, "");
    let (runs, mut nees) = (100_u32, 0.0);
    for seed in 0..u64::from(runs) {
        let run = run(&text, seed);
        let (track, prior) = (&run.tracks[&RobotId(1)], run.priors[&RobotId(1)]);
        let position_variance = prior.sigma_position_m.powi(2);
        let spread = Matrix3::from_diagonal(&Vector3::new(
            position_variance,
            position_variance,
            prior.sigma_heading_rad.powi(2),
        ));
        let mut pose = prior.pose;
        let mut covariance = pose.adjoint() * spread * pose.adjoint().transpose();
        for tick in ticks(&run.recording.robots[&RobotId(1)].odometry) {
            pose = pose.compose(&tick.motion);
            let noise = Matrix3::from_diagonal(&Vector3::from(variances(&tick)));
            covariance += pose.adjoint() * noise * pose.adjoint().transpose();
        }
        // X = exp(xi) X_hat.
        let error = track.end_pose().compose(&pose.inverse()).log();
        nees += error.dot(&covariance.cholesky().unwrap().solve(&error));
    }
    let expected = 3.0 * f64::from(runs);
    let bound = 4.5 * (2.0 * expected).sqrt();
    assert!((nees - expected).abs() < bound, "NEES sum {nees:.1}, expected {expected} within {bound:.1}");
}

#[test]
fn encoders_report_whole_counts_within_one_count_of_the_wheel() {
    let ideal = run(&text("wheels", "circle", 20.0, ""), 5);
    let counted = run(
        &text("wheels", "circle", 20.0, "")
            .replace("[defaults]\n", "[defaults]\nencoder_ticks_per_rev = 1024\n"),
        5,
    );
    let count_rad = std::f64::consts::TAU / 1024.0;
    let pairs = ideal.recording.robots[&RobotId(1)].odometry.iter();
    for (ideal, counted) in pairs.zip(&counted.recording.robots[&RobotId(1)].odometry) {
        let (Reading::Wheels { right_rad: exact, .. }, Reading::Wheels { right_rad: read, .. }) =
            (ideal.reading, counted.reading)
        else {
            panic!("not wheels")
        };
        assert!((read / count_rad - (read / count_rad).round()).abs() < 1e-9);
        assert!((exact - read) > -1e-9 && (exact - read) < count_rad + 1e-9, "{exact} read as {read}");
    }
}
