//! The study's claims, tables and figures.

use pleiad_estimation::single::Unicycle;
use pleiad_estimation::{Pose2, Timestamp};
use pleiad_report::{Axis, Colour, Dash, Figure, Table, Trace};
use serde_json::json;

use super::run::{JUDGED_S, Judged, Variant, begun, judged, measurements, recorded};
use super::{NAME, Wheels};
use crate::error::SurveyError;
use crate::pages::{blank, claim, figure, number, table};
use crate::solo::{ROBOT, beliefs_at, error_of, pose_of, small, times, times_words};
use crate::study::Study;

const LEAD: &str = "One robot, two encoders and a gyro in one extended Kalman filter whose speed and yaw rate are random walks. \
The right encoder is three times worse than the left one, so that the noises of speed and yaw rate are correlated by 0.8: the \
filter takes each wheel as a measurement of its own, or, in the variants that ignore it, speed and yaw rate as if they were \
independent. The robot drives what the filter takes it for: random walks about a circle, clockwise.";

pub(super) fn study(seeds: &[u64]) -> Result<Study, SurveyError> {
    let mut page = blank(NAME, "Wheels and a gyro", LEAD);
    let all = judged(seeds)?;
    number(&mut page, "runs", seeds.len());
    for own in &all {
        let key = own.variant.words().replace(", ", "_").replace(' ', "_");
        number(&mut page, &format!("{key}_nees_per_dimension"), json!(own.nees.overall));
        number(&mut page, &format!("{key}_position_rms_m"), root(&own.position_m2));
        number(&mut page, &format!("{key}_heading_rms_rad"), root(&own.heading_rad2));
    }
    claims(&mut page, &all);
    table(&mut page, summary(&all, seeds.len()));
    figure(
        &mut page,
        nees_figure(&all),
        "Normalized error of the pose per dimension, 1 for a filter that is as good as it says; the band holds 99 % of \
         consistent filters at all five times together.",
    );
    if let Some(seed) = seeds.first() {
        one_run(&mut page, *seed)?;
    }
    Ok(page)
}

fn root(squares: &[f64]) -> f64 {
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn of(all: &[Judged], wheels: Wheels, gyro: bool) -> Option<&Judged> {
    all.iter().find(|own| own.variant == Variant { wheels, gyro })
}

fn claims(page: &mut Study, all: &[Judged]) {
    let find = |wheels, gyro| of(all, wheels, gyro);
    let (Some(wheels), Some(ignored), Some(both), Some(both_ignored)) = (
        find(Wheels::Each, false),
        find(Wheels::Uncorrelated, false),
        find(Wheels::Each, true),
        find(Wheels::Uncorrelated, true),
    ) else {
        return;
    };
    let nees = |own: &Judged| {
        let values = own.nees.times.iter().filter_map(|time| time.anees);
        let words: Vec<String> = values.map(|value| format!("{value:.2}")).collect();
        words.join(", ")
    };
    let interval = wheels.nees.times.first().map_or((f64::NAN, f64::NAN), |time| time.interval);
    let within =
        format!("99 % of consistent filters within {:.2}..{:.2} at all five times", interval.0, interval.1);
    claim(
        page,
        "With the correlation the filter is as good as it says, with the gyro and without",
        format!("NEES {}; with the gyro {}; {within}", nees(wheels), nees(both)),
        wheels.nees.is_consistent() && both.nees.is_consistent(),
    );
    claim(
        page,
        "A filter of the wheels that ignores the correlation is not",
        format!("NEES {}; {within}", nees(ignored)),
        !ignored.nees.is_consistent(),
    );
    let mut compared = |statement: &str, name: &str, worse: &[f64], better: &[f64], unit: &str| {
        let Some(ratio) = times(worse, better) else { return };
        let measured = format!(
            "{} instead of {} (RMS at the end): {} smaller",
            small(root(better), unit),
            small(root(worse), unit),
            times_words(ratio),
        );
        number(page, name, ratio.0);
        number(page, &format!("{name}_interval"), json!(ratio.1));
        claim(page, statement, measured, ratio.1[0] > 1.0);
    };
    compared(
        "With a gyro, ignoring the correlation costs position",
        "position_error_times_without_correlation",
        &both_ignored.position_m2,
        &both.position_m2,
        "m",
    );
    compared(
        "The gyro makes the heading better",
        "heading_error_times_without_gyro",
        &wheels.heading_rad2,
        &both.heading_rad2,
        "rad",
    );
    compared(
        "The gyro makes the position better",
        "position_error_times_without_gyro",
        &wheels.position_m2,
        &both.position_m2,
        "m",
    );
}

fn summary(all: &[Judged], runs: usize) -> Table {
    let header = ["filter", "position error, RMS", "heading error, RMS", "NEES per dimension", "consistent"];
    let caption =
        format!("Errors after 30 s over {runs} runs, and the mean NEES of the five times of judgement.");
    all.iter().fold(Table::new(caption, header), |rows, own| {
        let consistent = if own.nees.is_consistent() { "yes" } else { "no" };
        rows.row([
            own.variant.words().to_owned(),
            small(root(&own.position_m2), "m"),
            small(root(&own.heading_rad2), "rad"),
            format!("{:.2}", own.nees.overall.unwrap_or(f64::NAN)),
            consistent.to_owned(),
        ])
    })
}

fn nees_figure(all: &[Judged]) -> Figure {
    let mut drawing = Figure::new(Axis::new("time", "s"), Axis::new("NEES per dimension", "-").from_zero());
    if let Some(first) = all.first() {
        let low: Vec<f64> = first.nees.times.iter().map(|time| time.interval.0).collect();
        let high: Vec<f64> = first.nees.times.iter().map(|time| time.interval.1).collect();
        drawing = drawing.trace(Trace::band("consistent", &JUDGED_S, &low, &high, Colour::Muted));
    }
    for (k, own) in all.iter().enumerate() {
        let values: Vec<f64> = own.nees.times.iter().map(|time| time.anees.unwrap_or(f64::NAN)).collect();
        let words = own.variant.words();
        let dash = if own.variant.wheels == Wheels::Each { Dash::Solid } else { Dash::Dash };
        let symbol = if own.variant.gyro { "diamond" } else { "circle" };
        let colour = Colour::Series(k);
        drawing = drawing
            .trace(Trace::line(words, &JUDGED_S, &values, colour).dash(dash).group(words))
            .trace(Trace::markers(words, &JUDGED_S, &values, colour, symbol, 8.0).group(words).unlisted());
    }
    drawing
}

/// Paths and heading errors of one run.
fn one_run(page: &mut Study, seed: u64) -> Result<(), SurveyError> {
    let (scenario, run) = recorded(seed)?;
    let failed = |what: String| SurveyError::Diverged { study: NAME, seed, what };
    let track = &run.tracks[&ROBOT];
    let seconds: Vec<f64> = (10..=310).map(|k| f64::from(k) * 0.1).collect();
    let instants: Vec<Timestamp> = seconds.iter().map(|own| Timestamp::from_seconds(*own)).collect();
    let truth: Vec<_> = instants.iter().map(|time| track.pose_at(*time)).collect();
    let mut map = Figure::new(Axis::new("east", "m"), Axis::new("north", "m")).equal_aspect();
    map = map.trace(Trace::path(
        "truth",
        &truth.iter().map(Pose2::x_m).collect::<Vec<_>>(),
        &truth.iter().map(Pose2::y_m).collect::<Vec<_>>(),
        Colour::Ink,
    ));
    let mut headings = Figure::new(Axis::new("time", "s"), Axis::new("heading error, wheels", "rad"))
        .row(Axis::new("with the gyro", "rad"));
    for (row, gyro) in [false, true].into_iter().enumerate() {
        let variant = Variant { wheels: Wheels::Each, gyro };
        let mut filter = begun(&run).ok_or_else(|| failed("the robot is not told its start".to_owned()))?;
        let beliefs = beliefs_at(&mut filter, &measurements(&scenario, &run, variant), &instants, failed)?;
        let colour = Colour::Series(2 * row);
        let column = |state: usize| beliefs.iter().map(|own| own.mean[state]).collect::<Vec<f64>>();
        let path = Trace::path(variant.words(), &column(Unicycle::X), &column(Unicycle::Y), colour);
        map = map.trace(path.dash(Dash::of_case(2 * row)));
        let errors: Vec<f64> =
            beliefs.iter().zip(&truth).map(|(own, truth)| error_of(&pose_of(own), truth)[2]).collect();
        let bound = |sign: f64| -> Vec<f64> {
            beliefs.iter().map(|own| sign * 2.0 * own.sigma(Unicycle::HEADING)).collect()
        };
        headings = headings
            .trace(Trace::band("two sigma", &seconds, &bound(-1.0), &bound(1.0), colour).in_row(row))
            .trace(Trace::line(variant.words(), &seconds, &errors, colour).in_row(row));
    }
    figure(
        page,
        headings.height(480),
        "Heading error of one run within the band of two standard deviations.",
    );
    figure(page, map, "The path of the same run.");
    Ok(())
}
