//! The study's claims, tables and figures.

use pleiad_estimation::Pose2;
use pleiad_report::{Axis, Colour, Dash, Figure, Table, Trace, quantity, with_interval};
use serde_json::json;

use super::drive::{Path, driven};
use super::fixes::{FixOutcome, Laps, OUTDOORS_S, laps, short_run};
use super::methods::{Method, poses, relative_errors};
use super::{Effective, NAME, usual_calibration};
use crate::error::SurveyError;
use crate::monte_carlo::{Estimate, over_seeds};
use crate::pages::{blank, claim, figure, number, prose, table};
use crate::solo::{ROBOT, root_mean_square};
use crate::study::Study;

const LEAD: &str = "A skid-steered robot of the size of a Pioneer AT on four closed paths, localized in three ways on the same \
runs: odometry as the firmware has it; odometry with an effective radius and an effective track width found on other runs; and \
an extended Kalman filter whose states are the pose, the speeds of both sides, the yaw rate and the bias of the gyro that measures it. The error \
is that of the final position over the distance driven. Source: Goel, Roumeliotis and Sukhatme 1999.";
const NOTE: &str = "How the simulated wheels slip in turns was chosen so that the odometry, raw and calibrated, errs about as \
much as the published one: the first two columns say that the runs are comparable, no more. The filter's column is a result.";
/// Long runs with GPS.
const LAP_RUNS: usize = 20;
/// The filter is as good as the published one if it errs by less than this, percent.
const FILTER_PERCENT: f64 = 3.0;
/// Fixes do not hurt if the mean square error is not above that without them by more than this, percent.
const HARMLESS_PERCENT: f64 = 5.0;

pub(super) fn study(seeds: &[u64]) -> Result<Study, SurveyError> {
    let mut page = blank(NAME, "Skid-steered robot indoors and outdoors", LEAD);
    let calibrated = usual_calibration()?;
    number(&mut page, "runs", seeds.len());
    number(&mut page, "effective_radius_m", calibrated.drive.wheel_radius_m);
    number(&mut page, "effective_track_m", calibrated.drive.track_width_m);
    let mut errors = Vec::new();
    for path in Path::PUBLISHED {
        errors.push((path, over_seeds(seeds, |seed| relative_errors(path, seed, &calibrated))?));
    }
    methods(&mut page, &errors, &calibrated);
    let short = over_seeds(seeds, |seed| short_run(seed, &calibrated))?;
    let long = over_seeds(&seeds[..seeds.len().min(LAP_RUNS)], |seed| laps(seed, &calibrated))?;
    fixes(&mut page, &short, &long);
    if let Some(seed) = seeds.first() {
        one_run(&mut page, *seed, &calibrated)?;
    }
    Ok(page)
}

type Errors = Vec<(Path, Vec<[f64; 3]>)>;

fn differences(errors: &[[f64; 3]], worse: usize, better: usize) -> Vec<f64> {
    errors.iter().map(|own| own[worse] - own[better]).collect()
}

fn methods(page: &mut Study, errors: &Errors, calibrated: &Effective) {
    let (mut all_raw, mut words, mut separate) = (Vec::new(), Vec::new(), true);
    let (mut filter_words, mut good) = (Vec::new(), true);
    let mut rows = Table::new(
        format!(
            "Final position error over distance driven, mean and 95 % interval over {} runs, and the published figure of \
             one robot.",
            errors[0].1.len()
        ),
        ["path", "raw", "calibrated", "EKF", "published raw / calibrated / EKF"],
    );
    let mut bars =
        Figure::new(Axis::category("path"), Axis::new("final error over distance", "%").from_zero());
    let names: Vec<String> = errors.iter().map(|(path, _)| path.words().to_owned()).collect();
    let mut means = [Vec::new(), Vec::new(), Vec::new()];
    for (path, own) in errors {
        let key = path.words().replace(' ', "_");
        let estimates: Vec<Option<Estimate>> =
            (0..3).map(|k| Estimate::of(&own.iter().map(|run| run[k]).collect::<Vec<_>>())).collect();
        let mut cells = vec![path.words().to_owned()];
        for (k, estimate) in estimates.iter().enumerate() {
            let Some(estimate) = estimate else { return };
            cells.push(with_interval(estimate.mean, estimate.interval, "%"));
            let method = ["raw", "calibrated", "ekf"][k];
            number(page, &format!("{key}_{method}_percent"), estimate.mean);
            number(page, &format!("{key}_{method}_percent_interval"), json!(estimate.interval));
            means[k].push(estimate.mean);
        }
        let published = path.published_percent().unwrap_or([f64::NAN; 3]);
        cells.push(format!("{} / {} / {} %", published[0], published[1], published[2]));
        rows = rows.row(cells);
        if let (Some(filter), Some(gap)) = (estimates[2], Estimate::of(&differences(own, 1, 2))) {
            filter_words.push(format!(
                "{} {}",
                path.words(),
                with_interval(filter.mean, filter.interval, "%")
            ));
            good &= filter.interval[1] < FILTER_PERCENT;
            words.push(format!("{} {}", path.words(), with_interval(gap.mean, gap.interval, "%")));
            separate &= gap.interval[0] > 0.0;
        }
        all_raw.extend(differences(own, 0, 1));
    }
    if let Some(raw) = Estimate::of(&all_raw) {
        claim(
            page,
            "Calibration makes odometry better, over the four paths",
            format!("raw less calibrated: {} of the distance", with_interval(raw.mean, raw.interval, "%")),
            raw.interval[0] > 0.0,
        );
    }
    claim(
        page,
        "The filter is better than calibrated odometry on every path",
        format!("calibrated less EKF, of the distance: {}", words.join(", ")),
        separate,
    );
    claim(
        page,
        "The filter errs by less than 3 % of the distance on every path, as the published one",
        filter_words.join(", "),
        good,
    );
    for (k, method) in Method::ALL.iter().enumerate() {
        bars = bars.trace(Trace::bars(method.words(), &names, &means[k], Colour::Series(k)));
        let published: Vec<f64> =
            errors.iter().map(|(path, _)| path.published_percent().map_or(f64::NAN, |own| own[k])).collect();
        let words = format!("{}, published", method.words());
        bars = bars.trace(Trace::bars(&words, &names, &published, Colour::Series(k)).opacity(0.4));
    }
    prose(page, NOTE);
    table(page, rows);
    figure(page, bars, "Mean final error by path and method; pale: published.");
    prose(
        page,
        &format!(
            "The calibration, on {} runs of their own (8 m ahead, two turns each way on the spot), gives an effective radius \
             of {:.4} m where the firmware believes 0.11 m, and an effective track of {:.3} m where it believes 0.640 m.",
            calibrated.runs, calibrated.drive.wheel_radius_m, calibrated.drive.track_width_m
        ),
    );
}

/// By how much the mean square error is above that without fixes, percent of it, run by run.
fn above(short: &[FixOutcome], pick: fn(&FixOutcome) -> f64) -> Option<Estimate> {
    let mean = short.iter().map(|own| own.without).sum::<f64>() / short.len() as f64;
    Estimate::of(&short.iter().map(|own| 100.0 * (pick(own) - own.without) / mean).collect::<Vec<_>>())
}

fn fixes(page: &mut Study, short: &[FixOutcome], long: &[Laps]) {
    let (Some(with), Some(overtrusted)) = (above(short, |own| own.with), above(short, |own| own.overtrusted))
    else {
        return;
    };
    let rms = |pick: fn(&FixOutcome) -> f64| root_mean_square(short.iter().map(|own| pick(own).sqrt()));
    claim(
        page,
        "Fixes of 0.8 m do not hurt a filter that errs by far less",
        format!(
            "square of 20 m, a fix a second: {} with fixes, {} without (RMS); mean square changes by {}",
            quantity(rms(|own| own.with), "m"),
            quantity(rms(|own| own.without), "m"),
            with_interval(with.mean, with.interval, "%"),
        ),
        with.interval[1] < HARMLESS_PERCENT,
    );
    claim(
        page,
        "Trusted ten times too much they hurt",
        format!(
            "{} (RMS); mean square changes by {}",
            quantity(rms(|own| own.overtrusted), "m"),
            with_interval(overtrusted.mean, overtrusted.interval, "%")
        ),
        overtrusted.interval[0] > 0.0,
    );
    number(page, "short_run_with_fixes_rms_m", rms(|own| own.with));
    number(page, "short_run_without_fixes_rms_m", rms(|own| own.without));
    number(page, "short_run_change_of_mean_square_percent", with.mean);
    number(page, "short_run_change_of_mean_square_percent_interval", json!(with.interval));
    laps_claim(page, long);
}

fn laps_claim(page: &mut Study, long: &[Laps]) {
    let Some(length) = long.iter().map(|own| own.times_s.len()).min() else { return };
    let Some(first) = long.first() else { return };
    let end = length - 1;
    let times = &first.times_s[..length];
    let rms =
        |pick: fn(&Laps) -> &Vec<f64>, k: usize| root_mean_square(long.iter().map(|own| pick(own)[k].sqrt()));
    let Some(gain) =
        Estimate::of(&long.iter().map(|own| own.without[end] - own.with[end]).collect::<Vec<_>>())
    else {
        return;
    };
    claim(
        page,
        "On a long way they help, and dead reckoning carries the robot indoors",
        format!(
            "after {:.0} s and four laps {} with fixes, {} without (RMS over {} runs)",
            times[end],
            quantity(rms(|own| &own.with, end), "m"),
            quantity(rms(|own| &own.without, end), "m"),
            long.len()
        ),
        gain.interval[0] > 0.0,
    );
    number(page, "laps_with_fixes_rms_m", rms(|own| &own.with, end));
    number(page, "laps_without_fixes_rms_m", rms(|own| &own.without, end));
    let over = |pick: fn(&Laps) -> &Vec<f64>| (0..length).map(|k| rms(pick, k)).collect::<Vec<f64>>();
    let (with, without) = (over(|own| &own.with), over(|own| &own.without));
    // Sigma of both axes together, to stand beside a position error.
    let sigma: Vec<f64> = first.sigma_m[..length].iter().map(|own| own * std::f64::consts::SQRT_2).collect();
    let greatest = with.iter().chain(&without).copied().fold(0.0, f64::max);
    let [indoors, outdoors] = [OUTDOORS_S[0][1], OUTDOORS_S[1][0]];
    let drawing = Figure::new(Axis::new("time", "s"), Axis::new("position error, RMS", "m").from_zero())
        .trace(Trace::band("indoors", &[indoors, outdoors], &[0.0; 2], &[greatest; 2], Colour::Muted))
        .trace(Trace::line("without fixes", times, &without, Colour::Series(1)))
        .trace(Trace::line("with fixes", times, &with, Colour::Series(0)))
        .trace(
            Trace::line("sigma of the filter with fixes", times, &sigma, Colour::Series(0)).dash(Dash::Dot),
        );
    figure(
        page,
        drawing,
        "Four laps of a square of 8 m, with GPS of 0.8 m outdoors and none indoors: the error of the filter with and without \
         fixes.",
    );
}

/// The square of one run as each method has it.
fn one_run(page: &mut Study, seed: u64, calibrated: &Effective) -> Result<(), SurveyError> {
    let (scenario, run) = driven(Path::Square, seed, &Vec::new())?;
    let truth = &run.recording.robots[&ROBOT].truth;
    let times: Vec<_> = truth.iter().map(|own| own.time).collect();
    let columns = |poses: &[Pose2]| -> [Vec<f64>; 2] {
        [poses.iter().map(Pose2::x_m).collect(), poses.iter().map(Pose2::y_m).collect()]
    };
    let [x, y] = columns(&truth.iter().map(|own| own.pose).collect::<Vec<_>>());
    let mut map = Figure::new(Axis::new("east", "m"), Axis::new("north", "m"))
        .equal_aspect()
        .trace(Trace::path("truth", &x, &y, Colour::Ink));
    for (k, method) in Method::ALL.into_iter().enumerate() {
        let [x, y] = columns(&poses(&scenario, &run, method, calibrated, &times)?);
        map = map.trace(Trace::path(method.words(), &x, &y, Colour::Series(k)).dash(Dash::of_case(k + 1)));
    }
    figure(page, map, "One run of the square as it was and as each method has it.");
    Ok(())
}
