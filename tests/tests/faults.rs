//! What faults do to each strategy: the promises of `exact`, and the shortcomings that theory states of the
//! others. All through `pleiad faults`, on simulated worlds with fixed seeds.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests fail by panicking")]

use std::collections::BTreeMap;
use std::path::Path;

use pleiad_estimation::fold::{Fact, fold};
use pleiad_estimation::joint::Joint;
use pleiad_estimation::statistics::NeesSummary;
use pleiad_estimation::strategy::joint_of_replica;
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_sim_peers::{FleetOptions, Scenario};
use pleiad_tests::program::run;
use pleiad_tests::team::{Team, Told};
use serde_json::Value;

const FAULTS: &str = include_str!("../../scenarios/faults.toml");

fn faults(arguments: &[&str]) -> Vec<Value> {
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios/faults.toml");
    let folder = tempfile::tempdir().unwrap();
    let scenario = scenario.display().to_string();
    let all = ["faults", &scenario, "--json", "--out", "out"].into_iter().chain(arguments.iter().copied());
    let json = run(folder.path(), all).json();
    assert!(std::fs::read_to_string(folder.path().join("out/report.html")).unwrap().contains("</html>"));
    json["rows"].as_array().unwrap().clone()
}

fn number(row: &Value, key: &str) -> f64 {
    row[key].as_f64().unwrap_or_else(|| panic!("{key} in {row}"))
}

fn row<'a>(rows: &'a [Value], strategy: &str, loss: f64) -> &'a Value {
    let found = rows.iter().find(|row| row["strategy"] == strategy && row["loss_percent"] == loss);
    found.unwrap_or_else(|| panic!("no row of {strategy} at {loss} %"))
}

fn robot_anees(row: &Value) -> f64 {
    let robots: Vec<f64> =
        row["robot_anees"].as_array().unwrap().iter().map(|a| a.as_f64().unwrap()).collect();
    robots.iter().sum::<f64>() / robots.len() as f64
}

fn check_healed(row: &Value) {
    assert!(number(row, "oracle_difference_healed") < 1e-9, "{row}");
    assert_eq!(row["replicas_identical"], true, "{row}");
    for key in ["facts_lost", "facts_counted_twice", "facts_pending"] {
        assert_eq!(row[key], 0, "{key} in {row}");
    }
}

#[test]
fn after_half_and_nine_tenths_burst_loss_exact_is_the_oracle_in_every_replica() {
    let rows = faults(&[
        "--strategies",
        "exact",
        "--loss",
        "50,90",
        "--burst",
        "1,10,100",
        "--seeds",
        "4",
        "--seconds",
        "112",
    ]);
    assert_eq!(rows.len(), 6);
    rows.iter().for_each(check_healed);
}

#[test]
fn during_half_loss_exact_stays_within_a_tenth_of_lossless_and_consistent() {
    let rows = faults(&[
        "--strategies",
        "exact",
        "--loss",
        "0,50",
        "--burst",
        "1",
        "--seeds",
        "20",
        "--seed",
        "100",
    ]);
    let row = row(&rows, "exact", 50.0);
    let ratio = number(row, "position_rmse_during_m") / number(row, "lossless_rmse_m");
    assert!(ratio <= 1.10, "{ratio}: {row}");
    assert_eq!(row["joint_consistent"], true, "{row}");
    check_healed(row);
}

/// Participants always hold the facts they took part in; of all others every robot holds a random half, for
/// good. The online estimates are folds of these sets.
#[test]
fn half_of_the_facts_of_others_lost_for_good_costs_at_most_a_tenth_and_no_consistency() {
    let times = [30.0, 50.0, 70.0, 90.0];
    let (mut squares, mut deviations) = ([0.0, 0.0], Vec::new());
    for seed in 200..220 {
        let mut scenario = Scenario::from_toml(FAULTS, "faults.toml").unwrap();
        scenario.duration_s = 91.0;
        let run = Team::new(&scenario, seed, Told::default()).run(&FleetOptions::default());
        let config = run.fold_config();
        for robot in run.outcomes.keys() {
            for (case, share) in [1.0, 0.5].into_iter().enumerate() {
                let mut joint = Joint::new(config.form);
                let mut due = times.iter();
                let mut next = due.next();
                let mut judged = Vec::new();
                let mut look = |joint: &Joint, time_s: f64| {
                    let time = Timestamp::from_seconds(time_s);
                    let states: BTreeMap<RobotId, _> = run
                        .outcomes
                        .keys()
                        .map(|robot| (*robot, run.reckoned(*robot).trajectory.at(time).unwrap()))
                        .collect();
                    let error = run.pose_error_at(joint, *robot, time).error;
                    squares[case] += error.x * error.x + error.y * error.y;
                    let truths = states
                        .keys()
                        .map(|robot| (*robot, run.team.world.tracks[robot].pose_at(time)))
                        .collect();
                    judged.push(joint_of_replica(joint, &states).unwrap().deviation(&truths).unwrap());
                };
                for (key, record) in run.ledger().facts() {
                    while let Some(time_s) =
                        next.filter(|time_s| key.time > Timestamp::from_seconds(**time_s))
                    {
                        look(&joint, *time_s);
                        next = due.next();
                    }
                    let seen = match &record.fact {
                        Fact::Observation { quantity, .. } => match quantity {
                            pleiad_estimation::fact::Quantity::Robot { robot, .. } => Some(*robot),
                            _ => None,
                        },
                        Fact::Boot(_) => None,
                    };
                    let own = key.id.robot == *robot || seen == Some(*robot) || seen.is_none();
                    // A hash of (fact, robot): the luck of this copy.
                    let mut luck = key.id.sequence.0.wrapping_mul(0x9e37_79b9_7f4a_7c15)
                        ^ u64::from(key.id.robot.0 * 31 + robot.0).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                    luck = (luck ^ (luck >> 31)).wrapping_mul(0x94d0_49bb_1331_11eb);
                    let arrives = ((luck >> 11) as f64) / (1_u64 << 53) as f64 <= share;
                    if own || arrives {
                        fold(&mut joint, &config, key, &record.fact);
                    }
                }
                if case == 1 && *robot == RobotId(1) {
                    deviations.push(judged);
                }
            }
        }
    }
    let ratio = (squares[1] / squares[0]).sqrt();
    assert!((1.0..=1.10).contains(&ratio), "{ratio}");
    let complete: Vec<_> = deviations.iter().map(|judged| judged[..3].to_vec()).collect();
    let summary = NeesSummary::from_runs(&complete, 0.05).unwrap();
    assert!(summary.is_consistent(), "{summary:?}");
}

#[test]
fn without_any_fix_the_strategies_are_as_theory_says() {
    let rows = faults(&["--loss", "0", "--burst", "1", "--seeds", "20", "--seed", "300"]);
    let anees = |strategy: &str| robot_anees(row(&rows, strategy, 0.0));
    let interval = &row(&rows, "exact", 0.0)["robot_anees_interval"];
    let (low, high) = (interval[0].as_f64().unwrap(), interval[1].as_f64().unwrap());
    for consistent in ["exact", "factored", "independent"] {
        assert!((low..=high).contains(&anees(consistent)), "{consistent}: {}", anees(consistent));
    }
    assert_eq!(row(&rows, "exact", 0.0)["joint_consistent"], true);
    assert!(anees("pairwise") > 2.0, "overconfident: {}", anees("pairwise"));
    for conservative in ["intersection", "split_intersection"] {
        assert!(anees(conservative) < 0.8, "{conservative}: {}", anees(conservative));
    }
    // Ignoring correlations is worst.
    for other in ["exact", "factored", "pairwise", "intersection", "split_intersection", "independent"] {
        assert!(anees("naive") > anees(other), "{other}");
    }
    // And no approximation is as accurate as what it approximates.
    let rmse = |strategy: &str| number(row(&rows, strategy, 0.0), "position_rmse_during_m");
    for other in ["pairwise", "intersection", "split_intersection", "naive", "independent"] {
        assert!(rmse(other) > rmse("exact"), "{other}: {} {}", rmse(other), rmse("exact"));
    }
    assert!(row(&rows, "intersection", 0.0)["joint_anees"].is_null());
    assert!(row(&rows, "independent", 0.0)["facts_lost"].is_null());
}

#[test]
fn whatever_else_goes_wrong_exact_heals_to_the_oracle() {
    let folder = tempfile::tempdir().unwrap();
    let plan = folder.path().join("plan.toml");
    let everything = r#"
        [[fault]]
        what = "corrupt"
        probability = 0.2
        bytes = 3
        start_s = 10
        end_s = 60
        [[fault]]
        what = "duplicate"
        probability = 0.5
        within_s = 3
        start_s = 10
        end_s = 60
        [[fault]]
        what = "delay"
        delay_s = 0.05
        jitter_s = 0.4
        start_s = 10
        end_s = 60
        [[fault]]
        what = "reorder"
        probability = 0.3
        by_s = 2
        start_s = 10
        end_s = 60
        [[fault]]
        what = "partition"
        groups = [[1, 2], [3]]
        start_s = 15
        end_s = 30
        [[fault]]
        what = "away"
        robots = [4]
        start_s = 20
        end_s = 50
        [[fault]]
        what = "cut"
        from = [1]
        to = [2]
        start_s = 30
        end_s = 60
        [[fault]]
        what = "slow"
        to = [5]
        messages_per_s = 20
        queue = 40
        start_s = 30
        end_s = 55
        [[fault]]
        what = "loss"
        loss = 0.3
        start_s = 10
        end_s = 60
    "#;
    std::fs::write(&plan, everything).unwrap();
    let plan = plan.display().to_string();
    let rows = faults(&[
        "--strategies",
        "exact,pairwise",
        "--loss",
        "30",
        "--burst",
        "1",
        "--seeds",
        "4",
        "--seconds",
        "75",
        "--faults",
        &plan,
    ]);
    let exact = row(&rows, "exact", 30.0);
    check_healed(exact);
    assert!(number(exact, "messages_refused") > 100.0, "{exact}");
    // The approximations go on too, and count nothing twice.
    assert_eq!(row(&rows, "pairwise", 30.0)["facts_counted_twice"], 0);
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let scenario =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios/faults.toml").display().to_string();
    let folder = tempfile::tempdir().unwrap();
    for (arguments, expected) in [
        (vec!["--loss", "120"], "--loss 120"),
        (vec!["--loss", "90", "--burst", "2"], "at least loss / (1 - loss)"),
        (vec!["--strategies", "exakt"], "expected exact, factored, pairwise"),
        (vec!["--seconds", "20"], "the faults begin at"),
        (vec!["--faults", "nowhere.toml"], "nowhere.toml: cannot be read"),
    ] {
        let all = ["faults", &scenario, "--out", "out"].into_iter().chain(arguments.iter().copied());
        let failed = run(folder.path(), all).failure();
        assert!(failed.contains(expected), "{arguments:?}: {failed}");
    }
}
