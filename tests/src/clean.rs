//! Recordings on which nothing acts, and what the diagnosis says of them: the benchmark behind
//! `docs/benchmarks/clean.md`.

#![allow(clippy::expect_used, clippy::missing_panics_doc, reason = "helpers of tests fail by panicking")]

use std::fmt::Write as _;
use std::ops::RangeInclusive;
use std::path::Path;
use std::time::Instant;

use pleiad_benchmark::clopper_pearson;
use pleiad_estimation::RobotId;
use pleiad_mismatch::{DiagnoseOptions, Finding, diagnose};
use pleiad_sim_peers::{Scenario, simulate};

/// Recordings of one kind.
pub struct Group {
    /// What they are, in words.
    pub name: &'static str,
    /// One recording per seed.
    pub seeds: RangeInclusive<u64>,
    scenario: &'static str,
    change: fn(&mut Scenario),
}

/// The hundred: fixed before any result was looked at, but for how many are long (`docs/benchmarks/clean.md`).
pub const HUNDRED: [Group; 4] = [
    group("differential drive, 300 s, 3 robots", 1..=60, "manoeuvres"),
    group("differential drive, 1500 s, 5 robots", 61..=70, "manoeuvres_long"),
    group("skid-steered, 300 s, 3 robots", 71..=85, "manoeuvres_skid_steer"),
    group("car-like, 300 s, 3 robots", 86..=100, "manoeuvres_car_like"),
];

/// Others beside them: five robots for 600 s, with sensors that are noisier and less noisy.
pub const OTHERS: [Group; 3] = [
    Group { change: |own| larger(own, 1.0), ..group("600 s, 5 robots", 101..=104, "manoeuvres") },
    Group { change: |own| larger(own, 3.0), ..group("600 s, 5 robots, noise x 3", 105..=108, "manoeuvres") },
    Group {
        change: |own| larger(own, 1.0 / 3.0),
        ..group("600 s, 5 robots, noise x 1/3", 109..=112, "manoeuvres")
    },
];

const fn group(name: &'static str, seeds: RangeInclusive<u64>, scenario: &'static str) -> Group {
    Group { name, seeds, scenario, change: |_| {} }
}

/// Five robots for 600 s in an area that is wide enough, and what every sensor's noise is multiplied by.
fn larger(scenario: &mut Scenario, noise: f64) {
    let settings = scenario.robots[&RobotId(1)].clone();
    scenario.duration_s = 600.0;
    scenario.arena.width_m = 20.0;
    scenario.random_landmarks = 20;
    scenario.robots = (1..=5).map(|robot| (RobotId(robot), settings.clone())).collect();
    for own in scenario.robots.values_mut() {
        own.gyro.sigma_rad_s *= noise;
        own.gps.sigma_m *= noise;
        own.heading.sigma_rad *= noise;
        own.relative.sigma_range_m *= noise;
        own.relative.sigma_bearing_rad *= noise;
    }
}

/// What was said of one recording.
pub struct Said {
    /// The seed of the recording.
    pub seed: u64,
    /// Every finding: verdict, effects, robots, values.
    pub findings: Vec<String>,
    /// How many effects of how many robots were tested and not found.
    pub undetected: usize,
    /// How long the diagnosis took, seconds.
    pub took_s: f64,
}

impl Group {
    /// The scenario without any effect.
    #[must_use]
    pub fn scenario(&self) -> Scenario {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../scenarios/{}.toml", self.scenario));
        let mut scenario = Scenario::load(&file).expect("a shipped scenario");
        for own in scenario.robots.values_mut() {
            own.effects.clear();
        }
        (self.change)(&mut scenario);
        scenario
    }

    /// Simulates and diagnoses the recording of a seed.
    #[must_use]
    pub fn said(&self, seed: u64) -> Said {
        let run = simulate(&self.scenario(), seed).expect("a scenario that is valid");
        let begun = Instant::now();
        let found =
            diagnose(&[run.recording], &DiagnoseOptions::default()).expect("a recording with a model");
        Said {
            seed,
            findings: found.findings.findings.iter().map(told).collect(),
            undetected: found.findings.undetected.len(),
            took_s: begun.elapsed().as_secs_f64(),
        }
    }
}

/// A finding in a line.
#[must_use]
pub fn told(finding: &Finding) -> String {
    let values =
        finding.parameters.iter().map(|(label, own)| format!("{label} = {:.3e} {}", own.value, own.unit));
    format!(
        "{:?} {} on {:?} ({}), p {:.1e}, gain {:.1} +- {:.1}",
        finding.verdict,
        finding.support_set.join(" / "),
        finding.robots,
        values.collect::<Vec<_>>().join(", "),
        finding.p_familywise,
        finding.held_out.log_score_gain,
        finding.held_out.log_score_gain_se
    )
}

/// The table of groups, and below it every finding.
#[must_use]
pub fn table(groups: &[(&Group, Vec<Said>)]) -> String {
    let mut text = String::from(
        "| recordings | seeds | effects of robots tested | with a finding | s per diagnosis, median (most) |\n\
         |---|---|---|---|---|\n",
    );
    let mut listed = String::new();
    for (group, said) in groups {
        let mut took: Vec<f64> = said.iter().map(|own| own.took_s).collect();
        took.sort_by(f64::total_cmp);
        let undetected: usize = said.iter().map(|own| own.undetected).sum();
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "| {} | {}..{} | {:.0} | {} of {} | {:.0} ({:.0}) |",
            group.name,
            group.seeds.start(),
            group.seeds.end(),
            undetected as f64 / said.len() as f64,
            wrong(said),
            said.len(),
            took[took.len() / 2],
            took[took.len() - 1]
        );
        for own in said {
            for finding in &own.findings {
                let _ = writeln!(listed, "- seed {}: {finding}", own.seed);
            }
        }
    }
    let count: usize = groups.iter().map(|(_, said)| wrong(said)).sum();
    let of: usize = groups.iter().map(|(_, said)| said.len()).sum();
    let [low, high] = clopper_pearson(count, of).map(|share| 100.0 * share);
    let _ = writeln!(
        text,
        "\nWith a finding: {count} of {of}; 95 % interval of the rate {low:.1} to {high:.1} % (Clopper and Pearson)."
    );
    if !listed.is_empty() {
        text += "\n";
        text += &listed;
    }
    text
}

fn wrong(said: &[Said]) -> usize {
    said.iter().filter(|own| !own.findings.is_empty()).count()
}
