//! `pleiad slam`: vehicle and map at once, on a scenario or on a recording.

use std::fmt::Write as _;

use anyhow::{Context, bail};
use pleiad_estimation::RobotId;
use pleiad_estimation::joint::ErrorForm;
use pleiad_estimation::sample::{Reading, Target};
use pleiad_estimation::slam::Association;
use pleiad_estimation::strategy::Noises;
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_sim_peers::Scenario;
use pleiad_survey::slam::{Asked, RunOptions, SlamInput, SlamPage, on_recording, on_scenario};

use super::{replay, study};
use crate::cli::{AssociationArg, ErrorArg, FilterArgs, LandmarksArg, MeasureArg, SlamArgs};
use crate::setup::{self, Input, ReplayOptions};
use crate::{folder, output};

pub fn run(args: &SlamArgs) -> anyhow::Result<()> {
    if args.association == AssociationArg::Joint && args.measure == MeasureArg::Bearing {
        bail!(
            "--association joint: a bearing alone does not fix a place; use it with --measure range_bearing"
        );
    }
    let options = RunOptions {
        form: match args.error {
            ErrorArg::Invariant => ErrorForm::Invariant,
            ErrorArg::Additive => ErrorForm::Additive,
        },
        association: match args.association {
            AssociationArg::Identity => Association::Identity,
            AssociationArg::Nearest => Association::Nearest,
            AssociationArg::Joint => Association::Joint,
        },
        without_ranges: args.measure == MeasureArg::Bearing,
        ..RunOptions::default()
    };
    let page = if args.input.is_dir() { of_recording(args, &options)? } else { of_scenario(args, options)? };
    let out = folder::create(args.out.as_deref(), &page.study.title.to_lowercase().replace(": ", "-"))?;
    let summary = study::write(&page.study, &out, &replay::command_line())?;
    let text = format!("{}\nreport: {}", page.text, out.join("report.html").display());
    output::print(args.json, &summary, &text)
}

fn of_scenario(args: &SlamArgs, options: RunOptions) -> anyhow::Result<SlamPage> {
    if args.robot.is_some() || args.noise.is_some() || args.seconds.is_some() || args.start != 0.0 {
        bail!(
            "--robot, --noise, --start and --seconds are of recordings; {} is a scenario",
            args.input.display()
        );
    }
    let scenario = Scenario::load(&args.input)?;
    let seeds = usize::try_from(args.seeds).context("--seeds")?;
    let spinner = output::spinner(&format!("{}: {seeds} seeds", scenario.name));
    let page = on_scenario(&scenario, &Asked { options, seeds, first_seed: args.first_seed })?;
    spinner.finish_and_clear();
    Ok(page)
}

fn of_recording(args: &SlamArgs, options: &RunOptions) -> anyhow::Result<SlamPage> {
    let input = setup::open(&args.input, args.reading.mapping.as_deref(), args.reading.skip_bad_rows)?;
    let Input { recording, ingest, folder, .. } = &input;
    let team = setup::recorded(
        recording,
        &ReplayOptions {
            filter: FilterArgs::exact(args.error),
            landmarks: &LandmarksArg::Known,
            absolute: &[],
            start_s: args.start,
            seconds: args.seconds,
            seed: 1,
            noise: args.noise.as_deref(),
            model: None,
            folder,
            mrclam: ingest.form == pleiad_recording::Form::Mrclam,
        },
    )?;
    let asked = args.robot.map(RobotId);
    if let Some(robot) = asked
        && !team.agents.contains_key(&robot)
    {
        let there: Vec<String> = team.agents.keys().map(ToString::to_string).collect();
        bail!("--robot {robot}: the recording has robots {}", there.join(", "));
    }
    let mut inputs = Vec::new();
    for (robot, agent) in team.agents.iter().filter(|(robot, _)| asked.is_none_or(|asked| asked == **robot)) {
        let node = agent.node()?;
        let Some(prior) = &node.prior else {
            bail!(
                "robot {robot} has no ground truth to start from, and the recording does not say where it started"
            );
        };
        if let Some(key) = node.sensors.growing() {
            bail!("{key}: slam knows ranges of one sigma only; take it out of the noise");
        }
        let [_, relative_position, range, bearing, range_bearing, ..] = node.sensors.profiles();
        let samples = team.samples.get(robot).into_iter().flatten();
        // Each robot is alone here: what it sees of the others is left out.
        let own = samples
            .filter(|sample| !matches!(sample.reading, Reading::Sighting { target: Target::Robot(_), .. }));
        inputs.push(SlamInput {
            robot: *robot,
            motion: node.motion,
            noises: Noises { relative_position, range, bearing, range_bearing, ..Noises::default() },
            start: prior.pose,
            start_noise: Symmetric3(prior.noise.lower),
            samples: own.map(|sample| sample.without_range_bias(node.sensors.range_bias_m)).collect(),
            recorded: team.recording.robots.get(robot).cloned().unwrap_or_default(),
            landmarks: team.recording.landmarks.clone(),
        });
    }
    let spinner = output::spinner(&format!("{}: {} robots", recording.name, inputs.len()));
    let mut page = on_recording(&recording.name, &inputs, options)?;
    spinner.finish_and_clear();
    for note in &team.notes {
        let _ = writeln!(page.text, "note: {note}");
    }
    Ok(page)
}
