//! `pleiad simulate SCENARIO`: writes the recording folder of a simulated run.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use pleiad_recording::{Overwrite, write_folder};
use pleiad_sim_peers::scenario::Policy;
use pleiad_sim_peers::{Scenario, SimulatedRun, injected_text, simulate};
use serde::Serialize;

use crate::cli::SimulateArgs;
use crate::{folder, output};

#[derive(Debug, Serialize)]
struct RecordJson {
    scenario: String,
    seed: u64,
    seconds: f64,
    recording: String,
    /// What acted on the robots, apart from the recording.
    injected: String,
    robots: Vec<RobotJson>,
}

#[derive(Debug, Serialize)]
struct RobotJson {
    robot: u32,
    samples: usize,
    effects: Vec<&'static str>,
}

pub(super) fn run(file: &Path, args: &SimulateArgs) -> anyhow::Result<()> {
    let mut scenario = Scenario::load(file)?;
    if let Some(seconds) = args.seconds {
        scenario.duration_s = seconds;
    }
    if !args.manoeuvre.is_empty() {
        for settings in scenario.robots.values_mut() {
            settings.motion.policy = Policy::Manoeuvres;
            settings.motion.manoeuvres.clone_from(&args.manoeuvre);
        }
    }
    scenario.validate()?;
    let run = simulate(&scenario, args.seed.unwrap_or(scenario.seed))?;
    if let Some(asked) = &args.out {
        beside(asked)?;
    }
    let folder = folder::create(args.out.as_deref(), "simulate")?;
    let manifest = beside(&folder)?;
    write_folder(&run.recording, &folder, Overwrite::Refuse)?;
    std::fs::write(&manifest, injected_text(&scenario, &run)?)
        .with_context(|| format!("cannot write {}", manifest.display()))?;
    let json = RecordJson {
        scenario: scenario.name.clone(),
        seed: run.seed,
        seconds: scenario.duration_s,
        recording: folder.display().to_string(),
        injected: manifest.display().to_string(),
        robots: robots(&run),
    };
    output::print(args.json, &json, &text(&json))
}

/// `RECORDING.injected.toml` beside the folder `RECORDING`; refused where that is taken.
fn beside(folder: &Path) -> anyhow::Result<PathBuf> {
    let Some(name) = folder.file_name() else {
        bail!("{} has no name that a file beside it could bear: name another with --out", folder.display());
    };
    let mut name = name.to_os_string();
    name.push(".injected.toml");
    let manifest = folder.with_file_name(name);
    if manifest.exists() {
        let manifest = manifest.display();
        bail!("{manifest} is there already: move it away, or name another folder with --out");
    }
    Ok(manifest)
}

fn robots(run: &SimulatedRun) -> Vec<RobotJson> {
    let robot = |(robot, channels): (&pleiad_estimation::RobotId, &pleiad_recording::RobotRecording)| {
        let effects = run.injected.get(robot).into_iter().flatten();
        RobotJson {
            robot: robot.0,
            samples: channels.samples().len(),
            effects: effects.map(|effect| effect.effect().name()).collect(),
        }
    };
    run.recording.robots.iter().map(robot).collect()
}

fn text(json: &RecordJson) -> String {
    let mut text = format!(
        "{}: {} s with seed {} recorded in {}\n",
        json.scenario, json.seconds, json.seed, json.recording
    );
    for robot in &json.robots {
        let effects =
            if robot.effects.is_empty() { "nothing injected".to_owned() } else { robot.effects.join(", ") };
        let _ = writeln!(text, "robot {:<4} {:>8} samples   {effects}", robot.robot, robot.samples);
    }
    let _ = writeln!(text, "what was injected: {}", json.injected);
    text
}
