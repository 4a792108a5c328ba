//! The three theorems, claimed.

use pleiad_estimation::Timestamp;
use pleiad_report::{Axis, Colour, Dash, Figure, Table, Trace};
use pleiad_sim_peers::Scenario;
use serde_json::{Value, json};

use super::super::input::{Luck, SlamInput};
use super::super::measure::{LONG_S, Measured, Told, Watched, Wheels, at_truth};
use super::super::page::{LikenessSeries, likeness_figure};
use super::super::theorems::{Likeness, OverLimit};
use super::{AT_LIMIT, Parts};
use crate::error::SurveyError;
use crate::monte_carlo::{Estimate, over_seeds};
use crate::study::Shown;

/// Theorem 1: growth of the logarithm of a determinant that is rounding. The matrices have condition numbers up to 1e6,
/// whose determinants Cholesky gives to about 1e-10.
const ROUNDING: f64 = 1e-8;
/// Theorem 2: looked at early and late, seconds.
const EARLY_S: f64 = 300.0;
const LATE_S: f64 = LONG_S - 4.0;
/// Theorem 2, as far as [`LATE_S`] goes: correlation of every two landmarks in both coordinates.
const CORRELATED: f64 = 0.98;
/// Theorem 3: mean standard deviation of the landmarks over that of the closed form.
const CONVERGED: f64 = 1.02;
/// Theorem 3: growth of what is left where the sensor's noise doubles: four, but for how fast each landmark converges.
const FOURFOLD: [f64; 2] = [3.6, 4.4];
/// Theorem 3: how much of what is left may be the start's: greatest over least.
const NOT_THE_START: f64 = 1.25;
/// Starts that theorem 3 is tried with: position, m, and heading, rad.
const STARTS: [[f64; 2]; 4] = [[0.03, 0.01], [0.1, 0.02], [0.3, 0.02], [0.1, 0.1]];
/// Factors on the sensor's noise.
const SENSORS: [f64; 3] = [0.5, 1.0, 2.0];

pub(super) fn determinants(all: &[Measured], parts: &mut Parts) {
    let of = |which: fn(&Measured) -> &Watched| {
        let runs = || all.iter().map(|run| &which(run).determinants);
        let growth = runs().map(|watch| watch.largest_growth).fold(f64::NEG_INFINITY, f64::max);
        let compared: usize = runs().map(|watch| watch.compared).sum();
        let singular: usize = runs().map(|watch| watch.singular).sum();
        (growth, compared, singular)
    };
    let cases = [
        ("at the truth", of(|run| &run.exact)),
        ("with chance, invariant", of(|run| &run.forms[0])),
        ("with chance, additive", of(|run| &run.forms[1])),
    ];
    let words: Vec<String> = cases
        .iter()
        .map(|(name, (growth, compared, singular))| {
            format!("{name}: largest growth of a log-determinant {growth:.1e} of {compared} compared, {singular} singular")
        })
        .collect();
    let holds = cases
        .iter()
        .all(|(_, (growth, compared, singular))| *growth <= ROUNDING && *compared > 0 && *singular == 0);
    parts.claim(
        "Theorem 1: no determinant of a submatrix of the map covariance grows with an observation (rounding: 1e-8)",
        words.join("; "),
        holds,
    );
    let rows = cases.iter().map(|(name, (growth, compared, singular))| {
        json!({ "case": name, "largest_growth": growth, "compared": compared, "singular": singular })
    });
    parts.number("determinants", rows.collect());
}

pub(super) fn correlations(all: &[Measured], parts: &mut Parts) {
    let at = |series: &LikenessSeries, time_s: f64| {
        let due = |(time, _): &&(Timestamp, Likeness)| *time >= Timestamp::from_seconds(time_s);
        series.iter().find(due).map(|(_, like)| *like)
    };
    let column = |of: &dyn Fn(&Measured) -> Option<f64>| all.iter().filter_map(of).collect::<Vec<f64>>();
    let correlation = |time_s: f64| column(&|run| Some(at(&run.linear, time_s)?.least_correlation));
    let difference = |time_s: f64| column(&|run| Some(at(&run.linear, time_s)?.relative_sigma_m));
    let distance = |time_s: f64| column(&|run| Some(at(&run.turning, time_s)?.distance_sigma_m));
    let times = [EARLY_S, LATE_S];
    let [early, late] = times.map(&correlation);
    let least = late.iter().copied().fold(f64::INFINITY, f64::min);
    let words = |values: &[f64], decimals: usize| {
        Estimate::of(values).map_or("-".to_owned(), |estimate| {
            let [low, high] = estimate.interval;
            format!("{:.decimals$} ({low:.decimals$} to {high:.decimals$})", estimate.mean)
        })
    };
    // Of every run, so that nothing is hidden in a mean.
    let shrinks = |[before, after]: [Vec<f64>; 2]| {
        before.len() == all.len() && before.iter().zip(&after).all(|(before, after)| after < before)
    };
    let rises = early.len() == all.len() && early.iter().zip(&late).all(|(early, late)| late > early);
    parts.claim(
        "Theorem 2: landmark estimates become fully correlated. Heading known (the linear case): every correlation above 0.98 after \
         1200 s, from 300 s on rising in every run, and every difference better known. Heading uncertain: the map keeps a common \
         turn, and every distance becomes better known",
        format!(
            "heading known: least correlation of any two landmarks at 300 s {}, at 1200 s {}, worst run {least:.4}; largest sigma of a \
             difference {} m, then {} m (start: 0.1 m); heading uncertain: largest sigma of a distance {} m, then {} m",
            words(&early, 4),
            words(&late, 4),
            words(&difference(EARLY_S), 4),
            words(&difference(LATE_S), 4),
            words(&distance(EARLY_S), 4),
            words(&distance(LATE_S), 4)
        ),
        least > CORRELATED && rises && shrinks(times.map(&difference)) && shrinks(times.map(&distance)),
    );
    for (key, of) in [
        ("least_correlation", &correlation as &dyn Fn(f64) -> Vec<f64>),
        ("largest_difference_sigma_m", &difference),
        ("largest_distance_sigma_m", &distance),
    ] {
        parts.number(
            key,
            json!({ "at_300_s": Estimate::of(&of(EARLY_S)), "at_1200_s": Estimate::of(&of(LATE_S)) }),
        );
    }
    if let Some(first) = all.first() {
        parts.shown.push(Shown::Figure(
            likeness_figure(&first.linear),
            "Theorem 2 on one run at the truth, heading known. Jumps are landmarks that enter the map."
                .to_owned(),
        ));
    }
}

/// A start and a sensor, and what every way gave.
pub(super) type GridRow = (Told, Vec<OverLimit>);

pub(super) fn grid(scenario: &Scenario, seeds: &[u64]) -> Result<Vec<GridRow>, SurveyError> {
    let start = |[sigma_position_m, sigma_heading_rad]: [f64; 2], times: f64, wheels: Wheels| Told {
        sigma_position_m,
        sigma_heading_rad,
        times,
        wheels,
    };
    let exact = STARTS.iter().flat_map(|told| SENSORS.map(|times| start(*told, times, Wheels::Exact)));
    let noisy = STARTS.iter().map(|told| start(*told, 1.0, Wheels::AsTheyAre));
    let tried: Vec<Told> = exact.chain(noisy).collect();
    let ways = over_seeds(seeds, |seed| {
        let exact = SlamInput::simulated(scenario, seed, Luck::None)?;
        tried
            .iter()
            .map(|told| Ok(at_truth(&exact, *told, seed)?.over_limit))
            .collect::<Result<Vec<_>, SurveyError>>()
    })?;
    let row = |(k, told): (usize, &Told)| (*told, ways.iter().filter_map(|way| way[k]).collect());
    Ok(tried.iter().enumerate().map(row).collect())
}

pub(super) fn limits(grid: &[GridRow], parts: &mut Parts) {
    let mut table = Table::new(
        "Theorem 3, at the truth: standard deviation of a landmark after 300 s (mean over landmarks and ways) and its closed form, \
         [I, J (l - p0)] P0 [I, J (l - p0)]^T; least ratio of the covariance to the closed form, and largest excess of a variance over it, in any direction.",
        ["start: position (m), heading (rad)", "sensor noise", "process noise", "closed form (m)", "found (m)", "least ratio", "largest excess (m^2)"],
    )
    .numeric();
    let (mut least, mut greatest) = (f64::INFINITY, 0.0_f64);
    let mut left = Vec::new();
    let (mut closed, mut found) = ([Vec::new(), Vec::new()], [Vec::new(), Vec::new()]);
    let mut rows = Vec::new();
    for (told, ways) in grid {
        let mean = |of: fn(&OverLimit) -> f64| ways.iter().map(of).sum::<f64>() / ways.len() as f64;
        let low = ways.iter().map(|way| way.least).fold(f64::INFINITY, f64::min);
        let beyond = mean(|way| way.excess_m2);
        let (limit_m, sigma_m) = (mean(|way| way.limit_sigma_m), mean(|way| way.sigma_m));
        let exact = told.wheels == Wheels::Exact;
        if exact {
            greatest = greatest.max(sigma_m / limit_m);
            left.push(beyond);
        }
        least = least.min(low);
        closed[usize::from(!exact)].push(limit_m);
        found[usize::from(!exact)].push(sigma_m);
        table = table.row([
            format!("{}, {}", told.sigma_position_m, told.sigma_heading_rad),
            format!("x {}", told.times),
            if exact { "none" } else { "the scenario's" }.to_owned(),
            format!("{limit_m:.4}"),
            format!("{sigma_m:.4}"),
            format!("{low:.6}"),
            format!("{beyond:.1e}"),
        ]);
        rows.push(json!({
            "sigma_position_m": told.sigma_position_m, "sigma_heading_rad": told.sigma_heading_rad,
            "sensor_noise_times": told.times, "process_noise": !exact, "closed_form_sigma_m": limit_m, "sigma_m": sigma_m,
            "least_over_limit": low, "beyond_limit_m2": beyond,
        }));
    }
    // Rows are starts, columns sensors.
    let columns = SENSORS.len();
    let doubled: Vec<f64> = left.chunks(columns).flat_map(|row| [row[1] / row[0], row[2] / row[1]]).collect();
    let by_start = |sensor: usize| {
        let of_sensor = || left.iter().skip(sensor).step_by(columns).copied();
        of_sensor().fold(0.0, f64::max) / of_sensor().fold(f64::INFINITY, f64::min)
    };
    let start_share = (0..columns).map(by_start).fold(0.0, f64::max);
    let range = |values: &[f64]| {
        [values.iter().copied().fold(f64::INFINITY, f64::min), values.iter().copied().fold(0.0, f64::max)]
    };
    let [fold_low, fold_high] = range(&doubled);
    parts.claim(
        "Theorem 3: a landmark's covariance is bounded below by the vehicle's first covariance carried to it, whatever the sensor; \
         without process noise that is its limit. After 300 s standard deviations are within 2 % of it for every start and sensor, \
         and what is left is the sensor's: fourfold where its noise doubles, the same for all starts",
        format!(
            "covariance over closed form at least {least:.7}; standard deviation over closed form without process noise at most \
             {greatest:.4}; what is left grows {fold_low:.2} to {fold_high:.2} times with a doubled sensor noise, and differs between starts by a \
             factor of {start_share:.3}; with process noise the first scans fix the start no better than they can, and the map stays \
             above the limit (table)"
        ),
        least >= AT_LIMIT
            && greatest <= CONVERGED
            && fold_low >= FOURFOLD[0]
            && fold_high <= FOURFOLD[1]
            && start_share <= NOT_THE_START,
    );
    parts.number("theorem_3", Value::Array(rows));
    let ends = [0.02, 2.0];
    parts.shown.push(Shown::Table(table));
    parts.shown.push(Shown::Figure(
        Figure::new(
            Axis::new("closed form from the start alone", "m").logarithmic(),
            Axis::new("standard deviation of a landmark after 300 s", "m").logarithmic(),
        )
        .trace(Trace::line("equal", &ends, &ends, Colour::Muted).dash(Dash::Dash))
        .trace(Trace::markers("no process noise", &closed[0], &found[0], Colour::Series(0), "circle-open", 9.0))
        .trace(Trace::markers("with process noise", &closed[1], &found[1], Colour::Series(1), "x", 8.0)),
        "Theorem 3: four starts, three sensors each. What the map converges to is set by the start alone; process noise keeps it \
         above."
            .to_owned(),
    ));
}
