//! `pleiad calibrate umbmark`: from runs that were recorded, or simulated ones.

use std::path::Path;

use anyhow::{Context, bail};
use pleiad_estimation::RobotId;
use pleiad_mismatch::calibration::umbmark::{
    Run, Stage, Umbmark, UmbmarkError, WheelFactors, believed, calibrate, corrected, left_out,
};
use pleiad_recording::{Nominal, Recording, write_folder, write_model};
use pleiad_sim_peers::Scenario;
use pleiad_survey::{Claim, Shown, Study, StudyOptions, umbmark};
use serde_json::{Map, json};

use super::super::replay::command_line;
use super::super::study;
use crate::cli::UmbmarkArgs;
use crate::{folder, output, setup};

pub fn run(args: &UmbmarkArgs) -> anyhow::Result<()> {
    if args.simulate { simulated(args) } else { recorded(args) }
}

/// Drives the procedure, writes the first seed's recordings and model, and shows all seeds.
fn simulated(args: &UmbmarkArgs) -> anyhow::Result<()> {
    let scenario = match &args.scenario {
        Some(path) => Scenario::load(path)?,
        None => umbmark::scenario()?,
    };
    let out = folder::create(args.out.as_deref(), "umbmark")?;
    let spinner = output::spinner("driving squares");
    let options = StudyOptions { seeds: args.seeds, first_seed: args.first_seed };
    let trials = umbmark::trials(&scenario, &options)?;
    let outcome = umbmark::study(&trials);
    spinner.finish_and_clear();
    if let Some(first) = trials.own.first() {
        for (set, driven) in [("before", &first.first), ("after", &first.second)] {
            for recording in &driven.recordings {
                let path = out.join("runs").join(set).join(&recording.name);
                write_folder(recording, &path, pleiad_recording::Overwrite::Refuse)?;
            }
        }
        let recording = first.first.recordings.first().context("no run was driven")?;
        let robot = *recording.robots.keys().next().context("no robot was driven")?;
        write_corrected(&out, recording, robot, &first.calibration, "simulated squares")?;
    }
    study::show(&outcome, &out, args.json, &command_line())
}

/// Calibrates on recordings.
fn recorded(args: &UmbmarkArgs) -> anyhow::Result<()> {
    let mut recordings = Vec::new();
    for path in &args.recordings {
        recordings.push(setup::open(path, args.mapping.as_deref(), args.skip_bad_rows)?.recording);
    }
    let robot = super::robot(args.robot, &recordings)?;
    let runs = recordings.iter().map(|recording| Run::of(recording, robot)).collect::<Result<Vec<_>, _>>()?;
    let first = recordings.first().context("name at least one recording")?;
    let known = known(&recordings, robot)?;
    let out = folder::create(args.out.as_deref(), "umbmark")?;
    let calibration = match calibrate(&runs, known) {
        Ok(calibration) => calibration,
        Err(error @ UmbmarkError::OneDirection { .. }) => {
            // The report shows what one direction would have hidden, and the command fails all the same.
            study::write_page(&refused(&error), &out, &command_line())?;
            return Err(anyhow::Error::from(error)
                .context(format!("not calibrated; {} shows why", out.join("report.html").display())));
        }
        Err(error) => return Err(error.into()),
    };
    let (after, held_out) = left_out(&runs, known)?;
    write_corrected(&out, first, robot, &calibration, "recorded squares")?;
    study::show(&of_recordings(&calibration, &after, held_out), &out, args.json, &command_line())
}

/// What the recordings' models say of the wheels already: the same in all, or there is no one robot to correct.
fn known(recordings: &[Recording], robot: RobotId) -> anyhow::Result<WheelFactors> {
    let mut declared = None;
    for recording in recordings {
        let Some(own) = recording.nominal.as_ref().and_then(|nominal| nominal.robots.get(&robot)) else {
            continue;
        };
        let here = (own.wheel_radius, own.track_width, believed(&own.effects));
        match declared {
            None => declared = Some((here, &recording.name)),
            Some((there, name)) if there != here => bail!(
                "recordings `{name}` and `{}` declare other wheels of robot {robot}: calibrate on runs of one nominal.toml",
                recording.name
            ),
            Some(_) => {}
        }
    }
    Ok(declared.map_or(WheelFactors::NONE, |((_, _, factors), _)| factors))
}

/// The nominal model of the recording with this robot corrected.
fn write_corrected(
    out: &Path,
    recording: &Recording,
    robot: RobotId,
    calibration: &Umbmark,
    source: &str,
) -> anyhow::Result<()> {
    let mut model: Nominal = recording.nominal.clone().context("the recording has no nominal model")?;
    let own = model.robots.get_mut(&robot).context("the nominal model lacks the robot")?;
    let e_s = calibration.e_s.and_then(|e_s| e_s.ci95);
    *own = corrected(own, calibration.factors, [calibration.e_d.ci95, calibration.e_b.ci95, e_s]);
    let comment = format!(
        "The nominal model of robot {robot} with what `pleiad calibrate umbmark` found in {source}. SI units, radians.\n\
         Intervals hold 95 %."
    );
    Ok(write_model(&out.join("corrected.toml"), &model, &comment)?)
}

/// The page of a refusal.
fn refused(error: &UmbmarkError) -> Study {
    Study {
        name: "umbmark",
        title: "UMBmark: not calibrated".to_owned(),
        lead: error.to_string(),
        claims: Vec::new(),
        shown: umbmark::masked().into(),
        numbers: Map::new(),
    }
}

fn of_recordings(calibration: &Umbmark, after: &Stage, held_out: bool) -> Study {
    let after_name = if held_out { "after, each pair by the others" } else { "after, same runs" };
    let stages = [("before", &calibration.before), (after_name, after)];
    let errors = calibration.factors.errors();
    let (before_m, after_m) = (calibration.before.e_max_syst_m, after.e_max_syst_m);
    let judged = if held_out {
        "each pair of runs judged by the calibration on the others"
    } else {
        "one run a direction: judged by themselves, which flatters"
    };
    let mut shown = vec![umbmark::returns(&stages), umbmark::stages(&stages), umbmark::angles(calibration)];
    if calibration.e_s.is_none() {
        shown.push(Shown::Prose(
            "No straight run was given: E_s is not known, and E_b is that of wheels of nominal mean diameter. Add recordings of \
             straight lines with the pose measured at both ends."
                .to_owned(),
        ));
    }
    shown.extend(umbmark::masked());
    let numbers = json!({
        "before": calibration.before,
        "after": after,
        "after_held_out": held_out,
        "e_d": errors.e_d,
        "e_b": errors.e_b,
        "e_s": calibration.e_s.map(|e_s| e_s.value),
        "ci95": {
            "e_d": calibration.e_d.ci95, "e_b": calibration.e_b.ci95, "e_s": calibration.e_s.and_then(|e_s| e_s.ci95),
        },
        "turn_ratio": calibration.turn_ratio,
        "c_l": calibration.factors.left,
        "c_r": calibration.factors.right,
        "alpha_rad": calibration.angles.alpha_rad,
        "beta_rad": calibration.angles.beta_rad,
        "angles": calibration.angles,
        "radius_m": calibration.radius_m,
        "side_m": calibration.side_m,
    });
    Study {
        name: "umbmark",
        title: "UMBmark: systematic odometry errors from recorded squares".to_owned(),
        lead: format!(
            "E_d = {:.5}, E_b = {:.5} from {} clockwise and {} counter-clockwise squares with sides of {:.2} m (Borenstein and \
             Feng 1996). corrected.toml holds the model.",
            errors.e_d,
            errors.e_b,
            calibration.before.clockwise.errors_m.len(),
            calibration.before.counter_clockwise.errors_m.len(),
            calibration.side_m
        ),
        claims: vec![Claim {
            statement: "The correction brings the robot nearer to its start".to_owned(),
            measured: format!("E_max,syst {before_m:.4} m before, {after_m:.4} m after ({judged})"),
            holds: after_m < before_m,
        }],
        shown,
        numbers: if let serde_json::Value::Object(numbers) = numbers { numbers } else { Map::new() },
    }
}
