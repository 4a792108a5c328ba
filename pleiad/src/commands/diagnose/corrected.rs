//! `corrected.toml`: one model for all robots of all recordings.

use std::path::Path;

use pleiad_estimation::Timestamp;
use pleiad_mismatch::Diagnosis;
use pleiad_recording::{Nominal, Recording, RobotRecording, write_model};

/// Writes the robots of all recordings into one model. Of a robot that the recordings model differently, the
/// first is written and the difference remarked.
pub(super) fn write(diagnosis: &mut Diagnosis, recordings: &[Recording], path: &Path) -> anyhow::Result<()> {
    let mut models = recordings
        .iter()
        .filter_map(|recording| Some((&recording.name, diagnosis.corrected.get(&recording.name)?)));
    let Some((first, model)) = models.next() else { return Ok(()) };
    let mut whole: Nominal = model.clone();
    let mut notes = Vec::new();
    for (name, model) in models {
        for (robot, own) in &model.robots {
            let written = whole.robots.entry(*robot).or_insert_with(|| own.clone());
            if written != own {
                notes.push(format!(
                    "corrected.toml holds robot {robot} as {first} has it; the model of {name} differs"
                ));
            }
        }
    }
    diagnosis.findings.notes.extend(notes);
    let names: Vec<&str> = recordings.iter().map(|recording| recording.name.as_str()).collect();
    let comment = format!(
        "The nominal model of {} with what `pleiad diagnose` found in it. SI units, radians.\nIntervals hold 95 %; \
         findings.json says how sure each is.",
        names.join(", ")
    );
    Ok(write_model(path, &whole, &comment)?)
}

/// From the first to the last sample of any channel.
pub(super) fn seconds(recording: &Recording) -> f64 {
    let ends = recording.robots.values().flat_map(ends);
    let first = ends.clone().map(|(first, _)| first).min();
    let last = ends.map(|(_, last)| last).max();
    first.zip(last).map_or(0.0, |(first, last)| last.seconds_since(first))
}

fn ends(robot: &RobotRecording) -> impl Iterator<Item = (Timestamp, Timestamp)> + Clone {
    let channels = [&robot.odometry, &robot.gyro, &robot.gps, &robot.heading, &robot.sightings];
    let sampled = channels.map(|channel| channel.first().zip(channel.last()).map(|(a, b)| (a.time, b.time)));
    let commands = robot.commands.first().zip(robot.commands.last()).map(|(a, b)| (a.time, b.time));
    let truth = robot.truth.first().zip(robot.truth.last()).map(|(a, b)| (a.time, b.time));
    sampled.into_iter().chain([commands, truth]).flatten()
}
