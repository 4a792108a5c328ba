//! `pleiad calibrate map`: from a recording with range scans, or a simulated one.

use anyhow::Context;
use pleiad_mismatch::calibration::map::{Drift, MapCalibration, MapOptions, calibrate};
use pleiad_mismatch::calibration::umbmark::{WheelErrors, believed, corrected};
use pleiad_recording::write_model;
use pleiad_survey::{Study, StudyOptions, map};
use serde_json::{Map, Value, json};

use super::super::replay::command_line;
use super::super::study;
use crate::cli::MapArgs;
use crate::{folder, output, setup};

pub fn run(args: &MapArgs) -> anyhow::Result<()> {
    let Some(path) = &args.recording else {
        let out = folder::create(args.out.as_deref(), "calibrate-map")?;
        let spinner = output::spinner("driving and matching");
        let outcome = map::run(&StudyOptions { seeds: args.seeds, first_seed: args.first_seed })?;
        spinner.finish_and_clear();
        return study::show(&outcome, &out, args.json, &command_line());
    };
    let recording = setup::open(path, args.mapping.as_deref(), args.skip_bad_rows)?.recording;
    let robot = super::robot(args.robot, std::slice::from_ref(&recording))?;
    let options = MapOptions {
        start: Drift { trans: args.a_trans, rot_rad_m: args.a_rot },
        gamma: args.gamma,
        stretch_m: args.stretch_m,
        cell_m: args.cell_m,
        mu_min: args.mu_min,
        ..MapOptions::default()
    };
    let calibration = calibrate(&recording, robot, &options)?;
    let out = folder::create(args.out.as_deref(), "calibrate-map")?;
    let mut model = recording.nominal.clone().context("the recording has no nominal model")?;
    let own = model.robots.get_mut(&robot).context("the nominal model lacks the robot")?;
    // Per metre of odometry: the wheels carry the robot farther, the track keeps turns on the spot as they were, and the
    // wheels' difference turns it: r_left - r_right = -a_rot b r.
    let Drift { trans, rot_rad_m } = calibration.estimate;
    let half = 0.5 * rot_rad_m * own.track_width;
    let errors = WheelErrors { e_d: (1.0 + half) / (1.0 - half), e_b: 1.0 + trans, e_s: 1.0 + trans };
    *own = corrected(own, errors.factors().upon(believed(&own.effects)), [None; 3]);
    let comment = format!(
        "The nominal model of robot {robot} with what `pleiad calibrate map` found. SI units, radians."
    );
    write_model(&out.join("corrected.toml"), &model, &comment)?;
    study::show(&page(&recording.name, &calibration, &options), &out, args.json, &command_line())
}

fn page(name: &str, calibration: &MapCalibration, options: &MapOptions) -> Study {
    let Drift { trans, rot_rad_m } = calibration.estimate;
    let matched = calibration.stretches.iter().filter(|stretch| stretch.best.is_some()).count();
    let numbers = json!({
        "recording": name,
        "a_trans": trans,
        "a_rot_rad_m": rot_rad_m,
        "matched": matched,
        "options": options,
        "stretches": calibration.stretches,
    });
    Study {
        name: "map",
        title: "Odometry calibrated against a map".to_owned(),
        lead: format!(
            "{name}: a_trans = {trans:.4}, a_rot = {rot_rad_m:.4} rad/m at the end, from {matched} of {} stretches of {} m \
             (Hoseinnezhad, Moshiri and Asharif 2003). corrected.toml holds the model.",
            calibration.stretches.len(),
            options.stretch_m
        ),
        claims: Vec::new(),
        shown: vec![map::followed(&[], std::slice::from_ref(calibration), &[options.gamma])],
        numbers: if let Value::Object(numbers) = numbers { numbers } else { Map::new() },
    }
}
