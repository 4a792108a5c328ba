//! The study's claims, tables and figures.

use pleiad_estimation::{Pose2, Timestamp};
use pleiad_report::{Axis, Colour, Dash, Figure, Table, Trace, with_interval};
use serde_json::json;

use super::NAME;
use super::late::{Late, late};
use super::run::{JUDGED_S, Method, Outcome, on, outcome, recorded};
use crate::error::SurveyError;
use crate::monte_carlo::{Estimate, over_seeds};
use crate::pages::{blank, claim, figure, number, table};
use crate::solo::{ROBOT, root_mean_square, small, times, times_words};
use crate::study::Study;

const LEAD: &str = "A rover drives 18 m in S-curves at 0.1 m/s. It has encoders, a rear steering angle and a gyro at 50 Hz, and a \
sun sensor that reads its heading at that rate or at a tenth of it. The soil turns and shifts it besides. Every reading is a \
scalar update at its own instant, whichever is there. Source: Roumeliotis and Bekey 1997 (Rocky 7).";
/// Runs in which sun readings arrive late.
const LATE_RUNS: usize = 20;
/// Times of judgement that count as early, and as late.
const EARLY: std::ops::Range<usize> = 0..6;
const LAST: std::ops::Range<usize> = 12..18;
/// A heading error is bounded if its mean square grows by less than this share from the first to the last minute.
const BOUNDED: f64 = 0.5;

/// The square of an error at a time of judgement.
type Square = fn(&Outcome, usize) -> f64;
/// All runs by method: `[method][run]`.
type All = Vec<Vec<Outcome>>;

pub(super) fn study(seeds: &[u64]) -> Result<Study, SurveyError> {
    let mut page = blank(NAME, "Rover with a slow sun sensor", LEAD);
    let runs = over_seeds(seeds, outcome)?;
    let all: All =
        (0..Method::ALL.len()).map(|method| runs.iter().map(|run| run[method].clone()).collect()).collect();
    number(&mut page, "runs", seeds.len());
    order(&mut page, &all);
    bounded(&mut page, &all);
    honest(&mut page, &all);
    let lates = over_seeds(&seeds[..seeds.len().min(LATE_RUNS)], late)?;
    lateness(&mut page, &lates);
    table(&mut page, summary(&all));
    figures(&mut page, &all);
    if let Some(seed) = seeds.first() {
        paths(&mut page, *seed)?;
    }
    Ok(page)
}

fn position_m2(outcome: &Outcome, time: usize) -> f64 {
    let [x, y, _] = outcome.errors[time];
    x * x + y * y
}

fn heading_rad2(outcome: &Outcome, time: usize) -> f64 {
    outcome.errors[time][2].powi(2)
}

fn end() -> usize {
    JUDGED_S.len() - 1
}

/// Root mean square over the runs.
fn rms(outcomes: &[Outcome], time: usize, square: Square) -> f64 {
    root_mean_square(outcomes.iter().map(|own| square(own, time).sqrt()))
}

/// How many times the error of the first method at the end is that of the second.
fn compared(first: &[Outcome], second: &[Outcome], square: Square) -> Option<(f64, [f64; 2])> {
    let squares = |own: &[Outcome]| own.iter().map(|own| square(own, end())).collect::<Vec<f64>>();
    times(&squares(first), &squares(second))
}

fn order(page: &mut Study, all: &All) {
    let quantities: [(&str, &str, Square); 2] =
        [("position", "m", position_m2), ("heading", "rad", heading_rad2)];
    for (name, unit, square) in quantities {
        let spreads: Vec<String> = Method::ALL
            .iter()
            .zip(all)
            .map(|(method, own)| {
                let spread = rms(own, end(), square);
                number(page, &format!("{}_{name}_rms_{unit}", method.key()), spread);
                format!("{} {}", method.words(), small(spread, unit))
            })
            .collect();
        let steps = [(0, 1), (1, 2), (2, 3)].map(|(a, b)| compared(&all[a], &all[b], square));
        let [Some(filter), Some(sun), Some(fast)] = steps else { continue };
        for (key, own) in
            [("dead_reckoning_over_ekf", filter), ("ekf_over_sun_1_10", sun), ("sun_1_10_over_1_1", fast)]
        {
            number(page, &format!("{key}_{name}"), own.0);
            number(page, &format!("{key}_{name}_interval"), json!(own.1));
        }
        claim(
            page,
            &format!("Spread in {name}: dead reckoning above EKF above EKF with sun"),
            format!(
                "{} (RMS at 180 s); dead reckoning {} the EKF, the EKF {} that with the slow sun sensor",
                spreads.join("; "),
                times_words(filter),
                times_words(sun),
            ),
            filter.1[0] > 1.0 && sun.1[0] > 1.0,
        );
    }
}

/// Growth of the mean square heading error from the first to the last minute, as a share of that of the first.
fn growth(outcomes: &[Outcome]) -> Option<Estimate> {
    let mean = |own: &Outcome, span: std::ops::Range<usize>| {
        let count = span.len() as f64;
        span.map(|time| heading_rad2(own, time)).sum::<f64>() / count
    };
    let early = outcomes.iter().map(|own| mean(own, EARLY)).sum::<f64>() / outcomes.len() as f64;
    let shares: Vec<f64> = outcomes.iter().map(|own| (mean(own, LAST) - mean(own, EARLY)) / early).collect();
    Estimate::of(&shares)
}

fn bounded(page: &mut Study, all: &All) {
    let sigma =
        |method: usize, time: usize| all[method].first().map_or(f64::NAN, |own| own.sigma_heading_rad[time]);
    let (Some(without), Some(slow), Some(fast)) = (growth(&all[1]), growth(&all[2]), growth(&all[3])) else {
        return;
    };
    let word = |own: &Estimate| with_interval(100.0 * own.mean, own.interval.map(|end| 100.0 * end), "%");
    let settled = [2, 3].map(|method| sigma(method, end()) / sigma(method, EARLY.end - 1));
    claim(
        page,
        "With the sun sensor the heading variance is bounded, also at 1:10",
        format!(
            "mean square error from the first to the last minute: 1:10 {}, 1:1 {}; sigma of the filter {} and {}, {:.3} and \
             {:.3} times those after a minute",
            word(&slow),
            word(&fast),
            small(sigma(2, end()), "rad"),
            small(sigma(3, end()), "rad"),
            settled[0],
            settled[1],
        ),
        [slow, fast].iter().all(|own| own.interval[1] < BOUNDED) && settled.iter().all(|ratio| *ratio < 1.05),
    );
    let grows = sigma(1, end()) / sigma(1, EARLY.end - 1);
    claim(
        page,
        "Without it, it grows",
        format!(
            "mean square error from the first to the last minute: {}; sigma of the filter {grows:.2} times that after a \
             minute, {:.2} is the square root of the time",
            word(&without),
            (JUDGED_S[end()] / JUDGED_S[EARLY.end - 1]).sqrt(),
        ),
        without.interval[0] > 0.0 && grows > 1.5,
    );
    for (key, own) in [("ekf", without), ("sun_1_10", slow), ("sun_1_1", fast)] {
        number(page, &format!("{key}_growth_of_squared_heading_error"), own.mean);
        number(page, &format!("{key}_growth_of_squared_heading_error_interval"), json!(own.interval));
    }
}

/// Heading error over sigma, mean square over runs and times.
fn honesty(outcomes: &[Outcome]) -> Option<Estimate> {
    let ratio = |own: &Outcome| {
        let pairs = own.errors.iter().zip(&own.sigma_heading_rad);
        let squares: Vec<f64> = pairs.map(|(error, sigma)| (error[2] / sigma).powi(2)).collect();
        squares.iter().sum::<f64>() / squares.len() as f64
    };
    Estimate::of(&outcomes.iter().map(ratio).collect::<Vec<_>>())
}

fn honest(page: &mut Study, all: &All) {
    let mut words = Vec::new();
    let mut holds = true;
    for (method, own) in Method::ALL.iter().zip(all).skip(1) {
        let Some(ratio) = honesty(own) else { return };
        words.push(format!("{} {}", method.words(), with_interval(ratio.mean, ratio.interval, "")));
        holds &= (0.8..=1.25).contains(&ratio.mean);
        number(page, &format!("{}_heading_nees", method.key()), ratio.mean);
        number(page, &format!("{}_heading_nees_interval", method.key()), json!(ratio.interval));
    }
    claim(
        page,
        "The heading error is as large as the filter says, within a fifth",
        format!("squared error over variance, mean over runs and times: {}", words.join(", ")),
        holds,
    );
}

fn lateness(page: &mut Study, lates: &[Late]) {
    let equal = lates.iter().filter(|own| own.equal).count();
    let sum = |pick: fn(&Late) -> usize| lates.iter().map(pick).sum::<usize>();
    let (overtaken, readings) = (sum(|own| own.overtaken), sum(|own| own.readings));
    claim(
        page,
        "Late sun readings go to their own instants: the estimate is that of the readings in order",
        format!(
            "equal bit for bit in {equal} of {} runs; {overtaken} of {readings} sun readings were overtaken",
            lates.len()
        ),
        equal == lates.len() && overtaken > 0,
    );
    let squares: Vec<f64> =
        lates.iter().map(|own| own.heading_rms_rad[1].powi(2) - own.heading_rms_rad[0].powi(2)).collect();
    let of = |k: usize| root_mean_square(lates.iter().map(|own| own.heading_rms_rad[k]));
    let Some(worse) = Estimate::of(&squares) else { return };
    claim(
        page,
        "Applied at their arrival instead they make the heading worse",
        format!("{} instead of {} (RMS over the run)", small(of(1), "rad"), small(of(0), "rad")),
        worse.interval[0] > 0.0,
    );
    number(page, "late_runs_equal", equal);
    number(page, "late_runs", lates.len());
    number(page, "late_heading_rms_rad", of(0));
    number(page, "applied_at_arrival_heading_rms_rad", of(1));
}

fn summary(all: &All) -> Table {
    let header = ["method", "position error, RMS", "heading error, RMS", "heading sigma of the filter"];
    let caption = format!("After 18 m and 180 s, over {} runs.", all[0].len());
    Method::ALL.iter().zip(all).fold(Table::new(caption, header), |rows, (method, own)| {
        let sigma = own.first().map_or(f64::NAN, |own| own.sigma_heading_rad[end()]);
        rows.row([
            method.words().to_owned(),
            small(rms(own, end(), position_m2), "m"),
            small(rms(own, end(), heading_rad2), "rad"),
            small(sigma, "rad"),
        ])
    })
}

fn figures(page: &mut Study, all: &All) {
    let mut headings =
        Figure::new(Axis::new("time", "s"), Axis::new("heading error, RMS", "rad").logarithmic());
    let mut positions =
        Figure::new(Axis::new("time", "s"), Axis::new("position error, RMS", "m").from_zero());
    for (k, (method, own)) in Method::ALL.iter().zip(all).enumerate() {
        let colour = Colour::Series(k);
        let over = |square| (0..JUDGED_S.len()).map(|time| rms(own, time, square)).collect::<Vec<f64>>();
        headings = headings.trace(Trace::line(method.words(), &JUDGED_S, &over(heading_rad2), colour));
        positions = positions.trace(Trace::line(method.words(), &JUDGED_S, &over(position_m2), colour));
        if let Some(first) = own.first()
            && *method != Method::DeadReckoning
        {
            let sigma = Trace::line("sigma of the filter", &JUDGED_S, &first.sigma_heading_rad, colour);
            let sigma = if *method == Method::Filter { sigma } else { sigma.unlisted() };
            headings = headings.trace(sigma.dash(Dash::Dot).group("sigma"));
        }
    }
    figure(
        page,
        headings,
        "Heading error over all runs. Without the sun it grows as the root of time, with it stays; dotted is what the \
         filter says of itself.",
    );
    figure(page, positions, "Position error over all runs.");
    let mut ends = Figure::new(Axis::new("east error", "m"), Axis::new("north error", "m")).equal_aspect();
    for (k, (method, own)) in Method::ALL.iter().zip(all).enumerate() {
        let column = |axis: usize| own.iter().map(|own| own.errors[end()][axis]).collect::<Vec<f64>>();
        let symbol = ["circle-open", "x", "diamond", "circle"][k];
        ends = ends.trace(Trace::markers(
            method.words(),
            &column(0),
            &column(1),
            Colour::Series(k),
            symbol,
            6.0,
        ));
    }
    figure(page, ends, "Position errors at the end of every run.");
}

/// The path of one run as the methods have it, in the detail of a point a second.
fn paths(page: &mut Study, seed: u64) -> Result<(), SurveyError> {
    let (scenario, run) = recorded(seed)?;
    let seconds: Vec<f64> = (1..=181).map(f64::from).collect();
    let track = &run.tracks[&ROBOT];
    let truth: Vec<_> = seconds.iter().map(|own| track.pose_at(Timestamp::from_seconds(*own))).collect();
    let column = |poses: &[Pose2]| -> [Vec<f64>; 2] {
        [poses.iter().map(Pose2::x_m).collect(), poses.iter().map(Pose2::y_m).collect()]
    };
    let [x, y] = column(&truth);
    let mut map = Figure::new(Axis::new("east", "m"), Axis::new("north", "m"))
        .equal_aspect()
        .trace(Trace::path("truth", &x, &y, Colour::Ink));
    for (k, method) in Method::ALL.into_iter().enumerate() {
        let [x, y] = column(&on(&scenario, &run, method, &seconds)?.path);
        map = map.trace(Trace::path(method.words(), &x, &y, Colour::Series(k)).dash(Dash::of_case(k)));
    }
    figure(page, map, "One run as it was and as each method has it.");
    Ok(())
}
