//! The scenarios that come with the project.

use std::path::{Path, PathBuf};

use pleiad_estimation::RobotId;
use pleiad_sim_peers::{Scenario, connectivity, simulate};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios")
}

fn load(name: &str) -> Scenario {
    Scenario::load(&folder().join(format!("{name}.toml"))).unwrap()
}

#[test]
fn every_plan_of_faults_loads_and_has_faults() {
    let plans = std::fs::read_dir(folder().join("plans")).unwrap().map(|entry| entry.unwrap().path());
    let plans: Vec<PathBuf> = plans.collect();
    assert!(!plans.is_empty());
    for plan in plans {
        assert!(!pleiad_bus::FaultPlan::load(&plan).unwrap().rules.is_empty(), "{}", plan.display());
    }
}

#[test]
fn every_scenario_loads_and_simulates_under_its_own_name() {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        // Plans of faults, for any scenario.
        if path.ends_with("plans") {
            continue;
        }
        let scenario = Scenario::load(&path).unwrap();
        assert_eq!(path.file_stem().unwrap().to_str().unwrap(), scenario.name);
        let run = simulate(&scenario, scenario.seed).unwrap();
        assert_eq!(run.recording.robots.len(), scenario.robots.len());
        // Robots that look for others or for landmarks see some; those of a survey of single robots do not look.
        for (robot, settings) in &scenario.robots {
            let looks = settings.relative.rate_hz > 0.0;
            let sightings = &run.recording.robots[robot].sightings;
            assert_eq!(looks, !sightings.is_empty(), "{}: robot {robot:?}", scenario.name);
        }
        names.push(scenario.name);
    }
    for name in ["survey_three", "five_relative", "five_gps", "ten_gps", "five_landmarks", "five_hard"] {
        assert!(names.iter().any(|found| found == name), "{name} is missing");
    }
}

#[test]
fn the_demonstration_pair_differs_in_nothing_but_the_gps_of_robot_1() {
    let (relative, gps) = (load("five_relative"), load("five_gps"));
    let (without, mut with) = (simulate(&relative, 3).unwrap(), simulate(&gps, 3).unwrap());
    let fixes = std::mem::take(&mut with.recording.robots.get_mut(&RobotId(1)).unwrap().gps);
    assert!(fixes.len() >= 298);
    assert_eq!(without.recording.robots, with.recording.robots);
    assert_eq!(without.priors, with.priors);
}

#[test]
fn the_demonstration_team_stays_connected_over_seeds_one_to_ten() {
    let scenario = load("five_relative");
    for seed in 1..=10 {
        let apart = connectivity(&simulate(&scenario, seed).unwrap().recording, 5.0);
        assert!(apart.is_empty(), "seed {seed}: {}", apart[0]);
    }
}

#[test]
fn a_short_sighted_team_is_reported_as_disconnected_with_the_robots_cut_off() {
    let mut scenario = load("five_relative");
    for settings in scenario.robots.values_mut() {
        settings.relative.max_range_m = 3.0;
    }
    let apart = connectivity(&simulate(&scenario, 1).unwrap().recording, 5.0);
    assert!(!apart.is_empty());
    assert!(apart.iter().all(|stretch| !stretch.cut_off().is_empty() && stretch.duration_s() > 0.0));
}
