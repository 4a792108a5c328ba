//! Whether the team's estimate is as good as it says, and the same whatever the network does: real nodes
//! in one process, simulated worlds, fixed seeds.

#![allow(clippy::unwrap_used, reason = "helpers of tests, outside a test function")]

use std::collections::BTreeMap;
use std::sync::LazyLock;

use pleiad_bus::LinkFaults;
use pleiad_estimation::fact::{Absolute, Quantity};
use pleiad_estimation::fold::{Fact, FoldConfig};
use pleiad_estimation::geometry::{Matrix3, wrap_angle};
use pleiad_estimation::joint::{ErrorForm, Joint};
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::observability::of_entries;
use pleiad_estimation::reference::{JointEkf, PerTickEkf, Tick, TimedMeasurement, facts_from_entries};
use pleiad_estimation::statistics::{NeesSummary, chi_square_interval};
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_sim_peers::scenario::{RelativeKind, See};
use pleiad_sim_peers::{FleetOptions, Scenario};
use pleiad_tests::team::{PoseError, Team, TeamRun, Told};

const FIVE_RELATIVE: &str = include_str!("../../scenarios/five_relative.toml");
const FIVE_GPS: &str = include_str!("../../scenarios/five_gps.toml");

/// Runs across which consistency is judged, and the instants at which it is.
const RUNS: u64 = 30;
const TIMES_S: [f64; 3] = [20.0, 40.0, 60.0];
/// Probability that a consistent filter fails one of the checks below, corrected within each check for
/// the number of its comparisons.
const ALPHA: f64 = 0.01;
/// Length of the demonstration, and its seeds here.
const DEMO_S: f64 = 300.0;
const DEMO_SEEDS: std::ops::RangeInclusive<u64> = 1..=10;

static RELATIVE: LazyLock<Vec<TeamRun>> = LazyLock::new(|| runs(FIVE_RELATIVE, RUNS, Told::default()));
static GPS: LazyLock<Vec<TeamRun>> = LazyLock::new(|| runs(FIVE_GPS, RUNS, Told::default()));
static DEMO_RELATIVE: LazyLock<Vec<TeamRun>> = LazyLock::new(|| demo(FIVE_RELATIVE));
static DEMO_GPS: LazyLock<Vec<TeamRun>> = LazyLock::new(|| demo(FIVE_GPS));

fn scenario(text: &str, duration_s: f64) -> Scenario {
    let mut scenario = Scenario::from_toml(text, "scenario.toml").unwrap();
    scenario.duration_s = duration_s;
    scenario
}

fn run(scenario: &Scenario, seed: u64, told: Told) -> TeamRun {
    let run = Team::new(scenario, seed, told).run(&FleetOptions { seed, ..FleetOptions::default() });
    assert!(run.agreed, "seed {seed}: the team did not agree");
    run
}

fn runs(text: &str, count: u64, told: Told) -> Vec<TeamRun> {
    let scenario = scenario(text, TIMES_S[2] + 0.5);
    (100..100 + count).map(|seed| run(&scenario, seed, told)).collect()
}

fn demo(text: &str) -> Vec<TeamRun> {
    let scenario = scenario(text, DEMO_S);
    DEMO_SEEDS.map(|seed| run(&scenario, seed, Told::default())).collect()
}

fn nees(runs: &[TeamRun]) -> NeesSummary {
    let of = |run: &TeamRun| TIMES_S.map(|time| run.joint_error_at(Timestamp::from_seconds(time))).to_vec();
    NeesSummary::from_runs(&runs.iter().map(of).collect::<Vec<_>>(), ALPHA).unwrap()
}

#[test]
fn joint_nees_lies_in_its_interval_without_any_fix() {
    let summary = nees(&RELATIVE);
    assert!(summary.is_consistent(), "{summary:?}");
}

#[test]
fn joint_nees_lies_in_its_interval_with_gps_on_one_robot() {
    let summary = nees(&GPS);
    assert!(summary.is_consistent(), "{summary:?}");
}

#[test]
fn a_team_told_half_its_noise_is_found_inconsistent() {
    for text in [FIVE_RELATIVE, FIVE_GPS] {
        let summary = nees(&runs(text, 6, Told { noise: 0.5, ..Told::default() }));
        assert!(!summary.is_consistent(), "{summary:?}");
        assert!(summary.overall.unwrap() > 1.5, "{summary:?}");
    }
}

/// Squared errors of position and yaw over their stated variances at the last instant, averaged over runs;
/// `stated` picks the covariance.
fn spread(runs: &[TeamRun], stated: impl Fn(&PoseError) -> Matrix3) -> Vec<(RobotId, [f64; 3])> {
    let time = Timestamp::from_seconds(TIMES_S[2]);
    let mut sums: BTreeMap<RobotId, [f64; 3]> = BTreeMap::new();
    for run in runs {
        let joint = run.joint_at(time);
        for robot in run.outcomes.keys() {
            let pose = run.pose_error_at(&joint, *robot, time);
            let stated = stated(&pose);
            let sum = sums.entry(*robot).or_default();
            for axis in 0..3 {
                sum[axis] += pose.error[axis].powi(2) / stated[(axis, axis)] / runs.len() as f64;
            }
        }
    }
    sums.into_iter().collect()
}

/// Where all of `comparisons` values of [`spread`] lie if the stated covariance is the right one.
fn spread_interval(comparisons: usize) -> (f64, f64) {
    let dof = RUNS as f64;
    let (low, high) = chi_square_interval(dof, ALPHA / comparisons as f64);
    (low / dof, high / dof)
}

fn check_published(runs: &[TeamRun]) {
    let spread = spread(runs, |pose| pose.published);
    let (low, high) = spread_interval(3 * spread.len());
    for (robot, ratios) in spread {
        let within = ratios.iter().all(|ratio| (low..=high).contains(ratio));
        assert!(within, "robot {robot}: {ratios:?} not in {low} to {high}");
    }
}

#[test]
fn every_published_sigma_is_the_spread_of_the_errors_across_runs() {
    check_published(&RELATIVE);
    check_published(&GPS);
}

#[test]
fn far_from_the_origin_published_sigmas_hold_and_those_of_the_invariant_error_do_not() {
    let mut far = scenario(FIVE_RELATIVE, TIMES_S[2] + 0.5);
    (far.arena.width_m, far.arena.height_m) = (90.0, 90.0);
    for robot in far.robots.values_mut() {
        robot.motion.area_m = Some([24.0, 40.0, 24.0, 40.0]);
    }
    let runs: Vec<_> = (100..100 + RUNS).map(|seed| run(&far, seed, Told::default())).collect();
    check_published(&runs);
    let raw = spread(&runs, |pose| pose.invariant);
    let (low, _) = spread_interval(3 * raw.len());
    assert!(raw.iter().all(|(_, [x, y, _])| *x < low && *y < low), "{raw:?} against {low}");
}

/// The textbook joint filter over the same measurements, stepping every robot at every odometry tick to
/// the end of the run.
fn per_tick(run: &TeamRun, form: ErrorForm) -> PerTickEkf {
    let mut ekf = PerTickEkf::new(form, run.fold_config().gate);
    for (robot, config) in &run.team.configs {
        let prior = config.prior.unwrap();
        let reckoned = run.reckoned(*robot);
        let ticks = reckoned.steps.iter().map(|step| Tick {
            time: step.to,
            increment: Pose2::exp(step.motion),
            covariance: step.covariance.to_matrix(),
        });
        let covariance = pleiad_estimation::measurement::noise_matrix(&prior.noise);
        ekf.add_robot(*robot, reckoned.trajectory.start(), prior.pose, &covariance, ticks);
    }
    let measurement =
        |(key, record): (&pleiad_estimation::fold::FactKey, &pleiad_estimation::ledger::FactRecord)| {
            match record.fact {
                // The poses are the priors, which the filter has been given.
                Fact::Boot(_) | Fact::Observation { quantity: Quantity::Absolute(Absolute::Pose(_)), .. } => {
                    None
                }
                Fact::Observation { quantity, noise, .. } => Some(TimedMeasurement {
                    time: key.time,
                    observer: key.id.robot,
                    quantity,
                    noise: noise.unwrap(),
                }),
            }
        };
    let measurements: Vec<_> = run.ledger().facts().filter_map(measurement).collect();
    assert!(measurements.len() > 1000);
    ekf.run(&measurements);
    ekf.advance_to(run.team.end());
    ekf
}

#[test]
fn the_fold_is_the_filter_that_steps_every_tick_to_a_percent_of_a_sigma() {
    for run in
        RELATIVE.iter().take(5).chain(GPS.iter().take(5)).chain(&DEMO_RELATIVE[..1]).chain(&DEMO_GPS[..1])
    {
        let ekf = per_tick(run, ErrorForm::Invariant);
        let joint = run.joint_at(run.team.end());
        for robot in run.outcomes.keys() {
            let (end, state) = run.reckoned(*robot).trajectory.end();
            let (pose, covariance) = joint.estimate(*robot, end, &state).unwrap();
            let reference = ekf.pose(*robot).unwrap();
            let m = reference.additive_from_invariant();
            let expected = m * ekf.covariance().block(*robot, *robot).unwrap() * m.transpose();
            let off = pose.position() - reference.position();
            let turned = wrap_angle(pose.yaw_rad() - reference.yaw_rad());
            for (axis, difference) in [off.x, off.y, turned].into_iter().enumerate() {
                let share = difference.abs() / expected[(axis, axis)].sqrt();
                assert!(share < 0.01, "robot {robot}, axis {axis}: {share} of a sigma");
            }
            let apart = (covariance.to_matrix() - expected).amax() / expected.amax();
            assert!(apart < 0.01, "robot {robot}: the covariance differs by {apart} of its largest entry");
        }
    }
}

fn rank(run: &TeamRun) -> (usize, usize) {
    let joint = run.ledger().joint();
    let observability = of_entries(&run.entries(), |robot, boot, state| {
        let member = joint.member(robot).filter(|member| member.boot == boot)?;
        Some(member.correction.compose(&state.nominal))
    });
    (observability.rank, observability.states)
}

/// Late over early sigma of the team, as `pleiad demo` reports them.
fn growth(run: &TeamRun) -> f64 {
    run.team_sigma_m(DEMO_S - 30.0, DEMO_S) / run.team_sigma_m(60.0, 90.0)
}

#[test]
fn without_a_fix_the_team_drifts_and_with_one_gps_it_does_not_over_ten_seeds() {
    for (seed, run) in DEMO_SEEDS.zip(DEMO_RELATIVE.iter()) {
        assert_eq!(rank(run), (12, 15), "seed {seed}");
        assert!(growth(run) >= 1.3, "seed {seed}: {}", growth(run));
    }
    for (seed, run) in DEMO_SEEDS.zip(DEMO_GPS.iter()) {
        assert_eq!(rank(run), (15, 15), "seed {seed}");
        assert!(growth(run) <= 1.15, "seed {seed}: {}", growth(run));
    }
}

#[test]
fn the_demonstration_scenarios_differ_by_nothing_but_the_receiver() {
    let (without, mut with) = (scenario(FIVE_RELATIVE, DEMO_S), scenario(FIVE_GPS, DEMO_S));
    let receiver = &mut with.robots.get_mut(&RobotId(1)).unwrap().gps;
    assert!(receiver.rate_hz > 0.0);
    receiver.clone_from(&without.robots[&RobotId(1)].gps);
    with.name.clone_from(&without.name);
    assert_eq!(with, without);
}

/// Root mean square of the yaw sigma stated for the robots at the end, radians.
fn yaw_sigma_rad(run: &TeamRun, joint: &Joint) -> f64 {
    let variance =
        |robot: &RobotId| run.pose_error_at(joint, *robot, Timestamp::from_seconds(DEMO_S)).published[(2, 2)];
    (run.outcomes.keys().map(variance).sum::<f64>() / run.outcomes.len() as f64).sqrt()
}

/// The common heading of a team without fixes cannot be observed, and the additive form believes that it
/// is (Huang, Mourikis, Roumeliotis 2011, on the standard filter of cooperative localization).
#[test]
fn the_additive_form_gains_heading_from_nothing() {
    let additive = FoldConfig { form: ErrorForm::Additive, ..FoldConfig::default() };
    let end = Timestamp::from_seconds(DEMO_S);
    for (drifting, fixed) in DEMO_RELATIVE.iter().zip(DEMO_GPS.iter()).take(5) {
        let share = |run: &TeamRun| {
            let (other, own) = (run.joint_in(additive, end), run.joint_at(end));
            yaw_sigma_rad(run, &other) / yaw_sigma_rad(run, &own)
        };
        println!("{} {}", share(drifting), share(fixed));
        assert!(share(drifting) < 0.9, "{}", share(drifting));
        assert!(share(fixed) > 0.95, "{}", share(fixed));
    }
    // The filter as published, stepped at every tick, believes the same.
    let run = &DEMO_RELATIVE[0];
    let ekf = per_tick(run, ErrorForm::Additive);
    let variance = |robot: &RobotId| ekf.covariance().block(*robot, *robot).unwrap()[(2, 2)];
    let stated = (run.outcomes.keys().map(variance).sum::<f64>() / run.outcomes.len() as f64).sqrt();
    assert!(stated < 0.9 * yaw_sigma_rad(run, &run.joint_at(end)), "{stated}");
}

fn fingerprints(run: &TeamRun) -> Vec<String> {
    let fingerprint = |ledger: &Ledger| ledger.clone().fingerprint().to_string();
    run.outcomes.values().map(|outcome| fingerprint(outcome.node.ledger())).collect()
}

/// All robots of `run` ended with the bits of the run without faults.
fn check_same_bits(run: &TeamRun, undisturbed: &TeamRun) {
    assert!(run.agreed);
    let expected = fingerprints(undisturbed).swap_remove(0);
    assert!(fingerprints(run).iter().all(|own| *own == expected), "{:?} not {expected}", fingerprints(run));
    // And so does whoever is given the entries in another order.
    let mut fresh = Ledger::new(run.fold_config());
    for entry in run.entries().into_iter().rev() {
        fresh.insert(entry);
    }
    assert_eq!(fresh.fingerprint().to_string(), expected);
}

#[test]
fn loss_delay_jitter_and_duplicates_leave_no_trace_in_the_bits() {
    let scenario = scenario(FIVE_GPS, 40.0);
    let undisturbed = run(&scenario, 5, Told::default());
    let faults = LinkFaults { loss: 0.3, delay_s: 0.05, jitter_s: 0.4, duplicate: 0.1 };
    let team = Team::new(&scenario, 5, Told::default());
    let mut fleet = team.fleet(&FleetOptions { seed: 5, faults, ..FleetOptions::default() });
    fleet.feed(&team.samples, |_| {});
    let traffic = fleet.network().traffic();
    assert!(traffic.lost.messages > 1000 && traffic.duplicated.messages > 500, "{traffic:?}");
    check_same_bits(&team.finish(fleet), &undisturbed);
}

#[test]
fn a_partition_that_heals_leaves_no_trace_in_the_bits() {
    let scenario = scenario(FIVE_GPS, 40.0);
    let undisturbed = run(&scenario, 6, Told::default());
    let team = Team::new(&scenario, 6, Told::default());
    let mut fleet = team.fleet(&FleetOptions { seed: 6, ..FleetOptions::default() });
    fleet.feed(&team.samples_within(0.0, 10.0), |_| {});
    fleet.network().partition(&[vec![RobotId(1), RobotId(2)], vec![RobotId(3), RobotId(4)]]);
    fleet.feed(&team.samples_within(10.0, 30.0), |_| {});
    let traffic = fleet.network().traffic();
    assert!(traffic.cut.messages > 500, "{traffic:?}");
    fleet.network().heal();
    fleet.feed(&team.samples_within(30.0, f64::INFINITY), |_| {});
    check_same_bits(&team.finish(fleet), &undisturbed);
}

/// A team whose robots differ in what they see of one another, with landmarks, GPS and heading.
fn mixed(robots: u32) -> Scenario {
    let text = format!(
        "name = \"mixed\"\nduration_s = 15.0\nteam_size = {robots}\nrandom_landmarks = 3\n\
         [defaults.relative]\nrate_hz = 2.0\nmax_range_m = 12.0\n"
    );
    let mut scenario = Scenario::from_toml(&text, "mixed.toml").unwrap();
    let kinds = [
        RelativeKind::RangeBearing,
        RelativeKind::Pose,
        RelativeKind::Position,
        RelativeKind::Range,
        RelativeKind::Bearing,
    ];
    for ((index, robot), kind) in scenario.robots.values_mut().enumerate().zip(kinds.iter().cycle()) {
        robot.relative.kind = *kind;
        robot.relative.see = See::Both;
        robot.gps.rate_hz = if index == 0 { 1.0 } else { 0.0 };
        robot.heading.rate_hz = if index == 1 { 2.0 } else { 0.0 };
    }
    scenario
}

#[test]
fn what_each_agent_settles_on_is_what_the_centralized_filter_makes_of_all_entries() {
    for robots in 2..=8 {
        let run = run(&mixed(robots), u64::from(robots), Told::default());
        let config = run.fold_config();
        let oracle =
            JointEkf { form: config.form, gate: config.gate }.fold(&facts_from_entries(&run.entries()));
        assert_eq!(oracle.near_gate(&config.gate, 1e-6), [], "choose another seed");
        assert!(oracle.nis().count() > 50, "{}", oracle.nis().count());
        let largest = oracle.covariance.matrix().amax();
        for outcome in run.outcomes.values() {
            let mut ledger = outcome.node.ledger().clone();
            let joint = ledger.settle();
            assert_eq!(joint.members().count(), oracle.robots.len());
            for robot in &oracle.robots {
                let ours = joint.member(robot.robot).unwrap().correction;
                let apart = ours.between(&robot.correction).log().amax();
                assert!(apart < 1e-9 * (1.0 + ours.position().norm()), "{robots}: {apart}");
                for other in &oracle.robots {
                    let (row, column) =
                        (joint.index(robot.robot).unwrap(), joint.index(other.robot).unwrap());
                    let expected = oracle.covariance.block(robot.robot, other.robot).unwrap();
                    let apart = (joint.covariance().block(row, column) - expected).amax();
                    assert!(apart < 1e-9 * largest, "{robots}: {apart} of {largest}");
                }
            }
        }
    }
}
