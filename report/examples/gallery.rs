//! Writes `demo.html`, `replay.html` and `diagnose.html` from made-up data into the folder given (default `target/gallery`),
//! to look at the reports' style without running a team:
//! `cargo run -p pleiad-report --example gallery`.

use std::error::Error;
use std::f64::consts::TAU;
use std::path::PathBuf;

use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{LandmarkId, Pose2, RobotId};
use pleiad_report::{
    DemoCase, DemoReport, FactCount, Landmark, NisPoint, NisSeries, ReplayReport, RobotScore, RobotSeries,
    TeamSeries, demo_report, diagnose_report, replay_report,
};

#[path = "../tests/fixture/mod.rs"]
mod fixture;

const STEP_S: f64 = 0.1;
/// Random walk of the whole team's unobserved position, m per square root of a second, and heading, rad.
const DRIFT_M: f64 = 0.055;
const DRIFT_RAD: f64 = 0.006;
/// Bounded part of a robot's error.
const OWN_M: f64 = 0.05;
const OWN_RAD: f64 = 0.012;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).map_or_else(|| PathBuf::from("target/gallery"), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    demo_report(&demo())?.write(&folder.join("demo.html"))?;
    replay_report(&replay())?.write(&folder.join("replay.html"))?;
    diagnose_report(&fixture::diagnosis(3, 240, 1))?.write(&folder.join("diagnose.html"))?;
    Ok(())
}

fn demo() -> DemoReport {
    let case = |name: &str, drifts: bool, unobservable: &[&str]| {
        let series = team(5, 120.0, drifts);
        let sigma = |from_s, to_s| series.position_sigma_m(from_s, to_s).unwrap_or(f64::NAN);
        let last = series.robots.iter().filter_map(|robot| robot.position_sigma_m().last().copied());
        DemoCase {
            name: name.into(),
            rank: if drifts { 12 } else { 15 },
            dimension: 15,
            unobservable: unobservable.iter().map(|&direction| direction.to_owned()).collect(),
            team_sigma_early_m: sigma(10.0, 20.0),
            team_sigma_late_m: sigma(110.0, 120.0),
            final_position_sigma_m: last.fold(0.0, f64::max),
            position_rmse_m: series.position_rmse_m().unwrap_or(f64::NAN),
            series,
            processes: 6,
            facts: 1_482,
            messages: 18_204,
            bytes: 2_713_400,
            notes: Vec::new(),
        }
    };
    DemoReport {
        seconds: 120.0,
        seed: 7,
        robots: 5,
        cases: vec![
            case(
                "relative only",
                true,
                &[
                    "x of the whole team",
                    "y of the whole team",
                    "heading of the whole team about the map's origin",
                ],
            ),
            case("one robot has GPS", false, &[]),
        ],
        command: "pleiad demo --seed 7 --seconds 120".into(),
    }
}

fn replay() -> ReplayReport {
    let series = team(5, 1_500.0, false);
    let scores = series
        .robots
        .iter()
        .map(|robot| {
            let scaled = |factor: f64| {
                robot.accuracy().map(|mut accuracy| {
                    accuracy.position_rmse_m *= factor;
                    accuracy.heading_rmse_rad *= factor;
                    accuracy
                })
            };
            RobotScore {
                robot: robot.robot,
                distance_m: robot.true_distance_m().unwrap_or(f64::NAN),
                settled: robot.accuracy(),
                online: scaled(1.1),
                dead_reckoning: scaled(9.0 + f64::from(robot.robot.0)),
            }
        })
        .collect();
    let landmarks = (0..15).map(|i| {
        let angle = TAU * f64::from(i) / 15.0;
        Landmark { id: LandmarkId(6 + i), x_m: 5.2 * angle.cos(), y_m: 4.0 * angle.sin() }
    });
    ReplayReport {
        name: "mrclam-1".into(),
        seconds: 1_500.0,
        series,
        landmarks: landmarks.collect(),
        scores,
        nis: vec![
            nis("Range and bearing to landmarks", 8_000, 3),
            nis("Range and bearing to robots", 1_100, 4),
        ],
        facts: vec![
            FactCount {
                kind: "range and bearing to a landmark".into(),
                used: 7_912,
                rejected: 88,
                pending: 0,
            },
            FactCount { kind: "range and bearing to a robot".into(), used: 1_081, rejected: 17, pending: 2 },
        ],
        highlights: vec![("Processes".into(), "6".into())],
        notes: vec!["Robot 3 was restarted at 612 s and kept its log.".into()],
        commands: vec![("This report:".into(), "pleiad replay recordings/mrclam-1".into())],
    }
}

fn nis(name: &str, count: u32, seed: u64) -> NisSeries {
    let mut noise = Noise(seed);
    let point = |i: u32| {
        let nis = noise.gaussian().powi(2) + noise.gaussian().powi(2);
        let nis = if i.is_multiple_of(97) { nis * 9.0 + 10.0 } else { nis };
        NisPoint { time_s: f64::from(i) * 1_500.0 / f64::from(count), nis, used: nis < 13.8 }
    };
    NisSeries { name: name.into(), degrees_of_freedom: 2, points: (0..count).map(point).collect() }
}

/// Robots on loops; errors drift as one if `drifts`, else stay bounded. The covariance is that of the errors.
fn team(robots: u32, seconds: f64, drifts: bool) -> TeamSeries {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a small positive number of steps"
    )]
    let steps = (seconds / STEP_S) as u32;
    let time_s: Vec<f64> = (0..=steps).map(|step| f64::from(step) * STEP_S).collect();
    let mut noise = Noise(42);
    let walk = if drifts { STEP_S.sqrt() } else { 0.0 };
    let mut common = vec![[0.0_f64; 3]];
    for step in 0..steps as usize {
        let [x, y, yaw] = common[step];
        common.push([
            x + walk * DRIFT_M * noise.gaussian(),
            y + walk * DRIFT_M * noise.gaussian(),
            yaw + walk * DRIFT_RAD * noise.gaussian(),
        ]);
    }
    let series = |robot: u32| one(robot, &time_s, &common, if drifts { 1.0 } else { 0.0 });
    TeamSeries { robots: (1..=robots).map(series).collect() }
}

fn one(robot: u32, time_s: &[f64], common: &[[f64; 3]], drifts: f64) -> RobotSeries {
    let mut noise = Noise(100 + u64::from(robot));
    let mut own = [0.0; 3];
    let mut series = RobotSeries {
        robot: RobotId(robot),
        time_s: time_s.to_vec(),
        estimate: Vec::new(),
        covariance: Vec::new(),
        truth: Vec::new(),
        dead_reckoning: None,
    };
    let mut odometry = Vec::new();
    for (&time, shared) in time_s.iter().zip(common) {
        let truth = truth(robot, time);
        // First-order Gauss-Markov with unit variance and a correlation time of 4 s.
        let decay = (-STEP_S / 4.0).exp();
        own = own.map(|value: f64| decay * value + (1.0 - decay * decay).sqrt() * noise.gaussian());
        let [x, y, yaw] = *shared;
        let error = [
            x - yaw * truth.y_m() + OWN_M * own[0],
            y + yaw * truth.x_m() + OWN_M * own[1],
            yaw + OWN_RAD * own[2],
        ];
        series.estimate.push(Pose2::new(
            truth.x_m() + error[0],
            truth.y_m() + error[1],
            truth.yaw_rad() + error[2],
        ));
        let turned = drifts * DRIFT_RAD.powi(2) * time;
        let shifted = drifts * DRIFT_M.powi(2) * time + OWN_M.powi(2);
        let (px, py) = (truth.x_m(), truth.y_m());
        series.covariance.push(Symmetric3([
            shifted + turned * py * py,
            -turned * px * py,
            shifted + turned * px * px,
            -turned * py,
            turned * px,
            turned + OWN_RAD.powi(2),
        ]));
        series.truth.push((!(50.0..58.0).contains(&time) || robot != 2).then_some(truth));
        odometry.push((time, Pose2::exp([0.0, 0.0, 0.002 * time].into()).compose(&truth)));
    }
    series.dead_reckoning = Some(odometry);
    series
}

fn truth(robot: u32, time: f64) -> Pose2 {
    let number = f64::from(robot);
    let phase = TAU * (time / (70.0 + 9.0 * number) + number / 5.0);
    let (radius_x, radius_y) = (2.0 + 0.55 * number, 1.6 + 0.35 * number);
    let (dx, dy) = (-radius_x * phase.sin(), 0.8 * radius_y * (2.0 * phase + number).cos());
    Pose2::new(
        radius_x * phase.cos(),
        0.4 * radius_y * (2.0 * phase + number).sin() + radius_y * 0.6 * phase.sin(),
        dy.atan2(dx),
    )
}

/// A small repeatable generator (splitmix64).
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Box and Muller's transform.
    fn gaussian(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}
