//! The strategies over the codec and the in-memory network: what they send, and what `factored` and `exact`
//! promise of a whole run.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests fail by panicking")]

use std::collections::BTreeMap;

use pleiad_bus::FaultPlan;
use pleiad_estimation::fold::FoldConfig;
use pleiad_estimation::geometry::wrap_angle;
use pleiad_estimation::joint::ErrorForm;
use pleiad_estimation::reference::{JointEkf, facts_from_entries};
use pleiad_estimation::strategy::StrategyKind;
use pleiad_sim_peers::strategies::{StrategyOptions, StrategyOutcome, run};
use pleiad_sim_peers::{FleetOptions, Scenario};
use pleiad_tests::team::{Team, Told};

const FIVE_GPS: &str = include_str!("../../scenarios/five_gps.toml");
const FAULTS: &str = include_str!("../../scenarios/faults.toml");

fn team(text: &str, seconds: f64, seed: u64, gate: [f64; 3]) -> Team {
    let mut scenario = Scenario::from_toml(text, "scenario.toml").unwrap();
    scenario.duration_s = seconds;
    let mut team = Team::new(&scenario, seed, Told { estimate_rate_hz: 0.01, ..Told::default() });
    for config in team.configs.values_mut() {
        config.fold = FoldConfig { gate, ..config.fold };
    }
    team
}

fn outcome(team: &Team, kind: StrategyKind) -> StrategyOutcome {
    run(&team.configs, &team.samples, &StrategyOptions::new(kind)).unwrap()
}

#[test]
fn factored_is_the_centralized_additive_filter_over_a_whole_run() {
    for (text, seed) in [(FIVE_GPS, 3), (FAULTS, 4)] {
        // Without a gate: a decision within rounding of it would be no difference of the filters.
        let team = team(text, 60.0, seed, [f64::INFINITY; 3]);
        let factored = outcome(&team, StrategyKind::Factored);
        let exact = team.clone().run(&FleetOptions::default());
        let facts = facts_from_entries(&exact.entries());
        let oracle = JointEkf { form: ErrorForm::Additive, gate: [f64::INFINITY; 3] }.fold(&facts);
        assert!(oracle.nis().count() > 500);
        // The production joint carries the oracle's covariance on to the last odometry.
        let config =
            FoldConfig { form: ErrorForm::Additive, gate: [f64::INFINITY; 3], ..FoldConfig::default() };
        let joint = exact.joint_in(config, team.end());
        for (robot, (_, view)) in &factored.last.views {
            let (end, state) = exact.reckoned(*robot).trajectory.end();
            let expected = oracle.robot(*robot).unwrap().correction.compose(&state.nominal);
            let offset = view.pose.position() - expected.position();
            let turned = wrap_angle(view.pose.yaw_rad() - expected.yaw_rad());
            assert!(offset.norm() < 1e-9 && turned.abs() < 1e-9, "robot {robot}: {offset} {turned}");
            let (_, covariance) = joint.estimate(*robot, end, &state).unwrap();
            let apart = (view.covariance - covariance.to_matrix()).amax();
            assert!(apart < 1e-9, "robot {robot}: {apart}");
        }
        let own = factored.last.joint.as_ref().unwrap();
        let robots: Vec<_> = own.robots.iter().map(|(robot, _)| *robot).collect();
        // Cross terms: those of the oracle, carried on by the motion since each robot's last event.
        for (i, a) in robots.iter().enumerate() {
            for (j, b) in robots.iter().enumerate().filter(|(j, _)| *j > i) {
                let carried = |robot| {
                    let (_, state) = exact.reckoned(robot).trajectory.end();
                    let last = oracle.robot(robot).unwrap();
                    let moved = last.correction.compose(&state.nominal).position() - last.pose().position();
                    pleiad_estimation::geometry::Matrix3::new(
                        1.0, 0.0, -moved.y, 0.0, 1.0, moved.x, 0.0, 0.0, 1.0,
                    )
                };
                let expected =
                    carried(*a) * oracle.covariance.block(*a, *b).unwrap() * carried(*b).transpose();
                let found = own.covariance.fixed_view::<3, 3>(3 * i, 3 * j).into_owned();
                assert!((found - expected).amax() < 1e-9, "P_{a}{b}: {found} {expected}");
            }
        }
    }
}

#[test]
fn exact_behind_the_trait_is_the_fleet_of_nodes_bit_for_bit() {
    let team = team(FIVE_GPS, 30.0, 5, pleiad_estimation::fold::DEFAULT_GATE);
    let mut behind = outcome(&team, StrategyKind::Exact);
    assert!(behind.agreed);
    let mut fleet = team.run(&FleetOptions { seed: 1, ..FleetOptions::default() });
    for (robot, member) in &mut fleet.outcomes {
        let node = behind.participants.get_mut(robot).unwrap().node_mut().unwrap();
        assert_eq!(node.status().estimate, member.node.status().estimate, "robot {robot}");
    }
}

#[test]
fn equal_seeds_give_equal_runs_under_faults_and_other_seeds_others() {
    let plan = FaultPlan::from_toml(FAULTS, "faults.toml").unwrap();
    let team = team(FAULTS, 60.0, 6, pleiad_estimation::fold::DEFAULT_GATE);
    for kind in StrategyKind::ALL.into_iter().filter(|kind| *kind != StrategyKind::Independent) {
        let poses = |seed: u64| {
            let options = StrategyOptions { seed, plan: plan.clone(), ..StrategyOptions::new(kind) };
            let outcome = run(&team.configs, &team.samples, &options).unwrap();
            let online = outcome.snapshots.iter().flat_map(|snapshot| snapshot.views.clone());
            let poses: Vec<_> = online.map(|(robot, (_, view))| (robot, view.pose)).collect();
            (poses, outcome.traffic)
        };
        assert_eq!(poses(1), poses(1), "{kind}");
        assert_ne!(poses(1), poses(2), "{kind}");
    }
}

/// Bytes of a run over its relative observations, on a network without faults, robots without GPS.
fn bytes_per_observation(kind: StrategyKind, robots: u32) -> f64 {
    let text = FAULTS.replace("team_size = 5", &format!("team_size = {robots}"));
    let team = team(&text, 40.0, 7, pleiad_estimation::fold::DEFAULT_GATE);
    let outcome = outcome(&team, kind);
    let observed: usize = team.world.recording.robots.values().map(|robot| robot.sightings.len()).sum();
    // Digests of the exact strategy are a matter of time and not of observations.
    outcome.total().1 as f64 / observed as f64
}

#[test]
fn the_bytes_of_an_observation_are_those_that_the_documentation_states() {
    let guide = include_str!("../../docs/strategies.md");
    let mut measured = BTreeMap::new();
    for kind in StrategyKind::ALL {
        let found = [5, 10].map(|robots| bytes_per_observation(kind, robots));
        let row = guide.lines().find(|line| line.starts_with(&format!("| `{kind}` |"))).expect("a row");
        let stated: Vec<f64> =
            row.split('|').nth(4).unwrap().split('/').map(|cell| cell.trim().parse().unwrap()).collect();
        measured.insert(kind.name(), (found, stated));
    }
    for (kind, (found, stated)) in &measured {
        for (found, stated) in found.iter().zip(stated) {
            // Stated to whole bytes; sequence numbers are varints, whose length grows with a run.
            assert!((found - stated).abs() <= 1.0, "{kind}: measured {found:.1}; all: {measured:?}");
        }
    }
}
