//! `pleiad survey slam`: the theorems, the choice of the error, association, bearings.

use pleiad_estimation::Timestamp;
use pleiad_estimation::statistics::chi_square_interval;
use pleiad_report::{Axis, Colour, Dash, Figure, Table, Trace};
use pleiad_sim_peers::Scenario;
use serde_json::{Map, Value, json};

use super::input::{Luck, SlamInput};
use super::measure::{Ended, LONG_S, Measured, NEES_AT_S, Nees, Told, Watched, Wheels, at_truth, measured};
use super::page::{LikenessSeries, error_figure, likeness_figure, map_figure, sigma_figure};
use super::run::Associated;
use super::theorems::{Likeness, OverLimit};
use crate::error::SurveyError;
use crate::monte_carlo::{Estimate, over_seeds, share};
use crate::study::{Claim, Shown, Study, StudyOptions};

/// Seeds of the study where none are asked for.
const SEEDS: usize = 24;
/// An interval needs two.
const LEAST_SEEDS: usize = 2;
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
/// Below the limit by more than this is more than rounding.
const AT_LIMIT: f64 = 1.0 - 1e-6;
/// Probability that a consistent filter fails a test of NEES anywhere.
const ALPHA: f64 = 0.01;
/// Starts that theorem 3 is tried with: position, m, and heading, rad.
const STARTS: [[f64; 2]; 4] = [[0.03, 0.01], [0.1, 0.02], [0.3, 0.02], [0.1, 0.1]];
/// Factors on the sensor's noise.
const SENSORS: [f64; 3] = [0.5, 1.0, 2.0];
/// Ways that they are tried on.
const WAYS: usize = 3;

/// Runs the study.
///
/// # Errors
/// Fewer than two seeds; a scenario or a run that fails.
pub fn study(options: &StudyOptions) -> Result<Study, SurveyError> {
    let count = options.seeds.unwrap_or(SEEDS);
    if count < LEAST_SEEDS {
        return Err(SurveyError::TooFewSeeds { study: super::NAME, found: count, least: LEAST_SEEDS });
    }
    let scenario = Scenario::from_toml(super::SCENARIO, "scenarios/slam.toml")
        .map_err(|error| SurveyError::Scenario { study: super::NAME, source: Box::new(error) })?;
    let seeds: Vec<u64> = (0..count as u64).map(|k| options.first_seed + k).collect();
    let all = over_seeds(&seeds, |seed| measured(&scenario, seed))?;
    let grid = grid(&scenario, &seeds[..WAYS.min(count)])?;
    let mut parts = Parts::default();
    determinants(&all, &mut parts);
    correlations(&all, &mut parts);
    limits(&grid, &mut parts);
    forms(&all, &mut parts);
    consistency(&all, &mut parts);
    association(&all, &mut parts);
    bearings(&all, scenario.landmarks.len(), &mut parts);
    if let Some(first) = all.first() {
        let input = SlamInput::simulated(&super::measure::strained(&scenario), seeds[0], Luck::Drawn)?;
        example(&input, &first.forms[0], seeds[0], &mut parts);
    }
    Ok(Study {
        name: super::NAME,
        title: "EKF SLAM: what a map converges to".to_owned(),
        lead: format!(
            "A car with range and bearing among {} landmarks that it does not know, 300 s, {count} seeds from {} (Dissanayake, \
             Newman, Clark, Durrant-Whyte, Csorba 2001). The theorems are of the linear case: they are measured on runs \
             without chance, whose estimates and linearization stay at the truth, and then on runs with it.",
            scenario.landmarks.len(),
            options.first_seed
        ),
        claims: parts.claims,
        shown: parts.shown,
        numbers: parts.numbers,
    })
}

#[derive(Default)]
struct Parts {
    claims: Vec<Claim>,
    shown: Vec<Shown>,
    numbers: Map<String, Value>,
}

impl Parts {
    fn claim(&mut self, statement: &str, measured: String, holds: bool) {
        self.claims.push(Claim { statement: statement.to_owned(), measured, holds });
    }

    fn number(&mut self, key: &str, value: Value) {
        self.numbers.insert(key.to_owned(), value);
    }
}

fn determinants(all: &[Measured], parts: &mut Parts) {
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
        "Theorem 1: no determinant of a submatrix of the map covariance grows with an observation (rounding: 1e-8).",
        words.join("; "),
        holds,
    );
    let rows = cases.iter().map(|(name, (growth, compared, singular))| {
        json!({ "case": name, "largest_growth": growth, "compared": compared, "singular": singular })
    });
    parts.number("determinants", rows.collect());
}

fn correlations(all: &[Measured], parts: &mut Parts) {
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
         turn, and every distance becomes better known.",
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

type GridRow = (Told, Vec<OverLimit>);

fn grid(scenario: &Scenario, seeds: &[u64]) -> Result<Vec<GridRow>, SurveyError> {
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

fn limits(grid: &[GridRow], parts: &mut Parts) {
    let mut table = Table::new(
        "Theorem 3, at the truth: standard deviation of a landmark after 300 s (mean over landmarks and ways) and its closed form, \
         [I, J (l - p0)] P0 [I, J (l - p0)]^T; covariance over closed form, least in any direction; variance beyond it, greatest in any direction.",
        ["start: position m, heading rad", "sensor noise", "process noise", "closed form m", "found m", "least", "beyond m^2"],
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
         and what is left is the sensor's: fourfold where its noise doubles, the same for all starts.",
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

fn forms(all: &[Measured], parts: &mut Parts) {
    let least = |form: usize| -> Vec<f64> {
        all.iter().filter_map(|run| Some(run.forms[form].over_limit?.least)).collect()
    };
    let (invariant, additive) = (least(0), least(1));
    let lowest = invariant.iter().copied().fold(f64::INFINITY, f64::min);
    let below = additive.iter().filter(|ratio| **ratio < AT_LIMIT).count();
    parts.claim(
        "With chance (heading told to 0.1 rad, sensor noise doubled) the invariant filter keeps the limit of theorem 3 exactly, at any \
         linearization; the additive one falls below it: it gains information that no sensor gave.",
        format!(
            "least covariance over the limit: invariant {lowest:.7} (worst of {}); additive {} (mean over seeds), below 1 in {below} of {} \
             seeds",
            invariant.len(),
            Estimate::of(&additive).map_or("-".to_owned(), |estimate| {
                format!("{:.3} ({:.3} to {:.3})", estimate.mean, estimate.interval[0], estimate.interval[1])
            }),
            additive.len()
        ),
        lowest >= AT_LIMIT && below == additive.len() && !additive.is_empty(),
    );
    parts.number("invariant_least_over_limit", json!(lowest));
    parts.number("additive_least_over_limit", json!(Estimate::of(&additive)));
}

/// Average NEES per degree of freedom at each time, and where it would lie.
struct Anees {
    value: f64,
    interval: [f64; 2],
}

impl Anees {
    fn of(runs: impl Iterator<Item = Nees> + Clone, alpha: f64) -> Self {
        let dimension: usize = runs.clone().map(|nees| nees.dimension).sum();
        let dof = dimension as f64;
        let (low, high) = chi_square_interval(dof, alpha);
        Self { value: runs.map(|nees| nees.sum).sum::<f64>() / dof, interval: [low / dof, high / dof] }
    }

    fn consistent(&self) -> bool {
        (self.interval[0]..=self.interval[1]).contains(&self.value)
    }
}

fn anees(runs: &[&Watched], what: usize) -> Vec<Anees> {
    (0..NEES_AT_S.len())
        .map(|at| {
            let of = runs.iter().filter_map(|run| run.nees.get(at).map(|nees| nees[what]));
            Anees::of(of, ALPHA / NEES_AT_S.len() as f64)
        })
        .collect()
}

fn list(anees: &[Anees]) -> String {
    anees.iter().map(|at| format!("{:.2}", at.value)).collect::<Vec<_>>().join(", ")
}

fn consistency(all: &[Measured], parts: &mut Parts) {
    let of = |form: usize| -> Vec<&Watched> { all.iter().map(|run| &run.forms[form]).collect() };
    let [pose, map] = [0, 1].map(|what| anees(&of(0), what));
    let [additive_pose, additive_map] = [0, 1].map(|what| anees(&of(1), what));
    let consistent = |anees: &[Anees]| anees.iter().all(Anees::consistent);
    let [low, high] = pose.first().map_or([f64::NAN; 2], |at| at.interval);
    let [map_low, map_high] = map.last().map_or([f64::NAN; 2], |at| at.interval);
    parts.claim(
        "Consistency on the same runs: the invariant filter's NEES over seeds lies in its interval at every time (1 % to fail \
         anywhere), of the pose and of the map as the vehicle sees it; the additive filter's does not.",
        format!(
            "per degree of freedom at 60 to 299 s: pose {} (interval {low:.2} to {high:.2}), map {} (at the end {map_low:.2} to {map_high:.2}); \
             additive: pose {}, map {}",
            list(&pose),
            list(&map),
            list(&additive_pose),
            list(&additive_map)
        ),
        consistent(&pose) && consistent(&map) && !(consistent(&additive_pose) && consistent(&additive_map)),
    );
    let column = |anees: &[Anees], of: fn(&Anees) -> f64| anees.iter().map(of).collect::<Vec<f64>>();
    let mut rows = Vec::new();
    for (name, pose, map) in [("invariant", &pose, &map), ("additive", &additive_pose, &additive_map)] {
        rows.push(json!({
            "error": name, "at_s": NEES_AT_S, "pose": column(pose, |at| at.value), "map": column(map, |at| at.value),
            "pose_consistent": consistent(pose), "map_consistent": consistent(map),
        }));
    }
    parts.number("nees_per_dof", Value::Array(rows));
    let bound = |anees: &[Anees]| (column(anees, |at| at.interval[0]), column(anees, |at| at.interval[1]));
    let ((pose_low, pose_high), (map_low, map_high)) = (bound(&pose), bound(&map));
    let line = |name: &str, anees: &[Anees], k: usize, row: usize| {
        Trace::line(name, &NEES_AT_S, &column(anees, |at| at.value), Colour::Series(k)).in_row(row)
    };
    parts.shown.push(Shown::Figure(
        Figure::new(Axis::new("time", "s"), Axis::new("NEES of the pose per dof", "-").logarithmic())
            .row(Axis::new("NEES of the map per dof", "-").logarithmic())
            .height(520)
            .trace(Trace::band("99 % interval, all times", &NEES_AT_S, &pose_low, &pose_high, Colour::Muted))
            .trace(line("invariant", &pose, 0, 0))
            .trace(line("additive", &additive_pose, 1, 0))
            .trace(
                Trace::band("interval", &NEES_AT_S, &map_low, &map_high, Colour::Muted).in_row(1).unlisted(),
            )
            .trace(line("invariant", &map, 0, 1).unlisted())
            .trace(line("additive", &additive_map, 1, 1).unlisted()),
        "Consistency: what the errors are over what the filters say they are.".to_owned(),
    ));
}

fn summed(all: &[Measured], of: fn(&Measured) -> &Ended) -> Associated {
    all.iter().fold(Associated::default(), |sum, run| sum.plus(of(run).associated))
}

fn mean(values: impl Iterator<Item = Option<f64>>) -> f64 {
    let values: Vec<f64> = values.flatten().collect();
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn association(all: &[Measured], parts: &mut Parts) {
    let cases: [(&str, fn(&Measured) -> &Ended); 3] = [
        ("clean", |run| &run.nearest),
        ("gate a thousand times too wide", |run| &run.wide_gate),
        ("a look-alike 0.35 m beside every landmark", |run| &run.twins),
    ];
    let mut table = Table::new(
        "Nearest neighbour without names: right, wrong, landmarks founded a second time, left open; over all seeds.",
        ["", "right", "wrong", "twice", "left open", "share right", "95 % interval", "map error m", "way error m"],
    )
    .numeric();
    let mut rows = Vec::new();
    let mut found = Vec::new();
    for (name, of) in cases {
        let sum = summed(all, of);
        let [low, high] = share(sum.right, sum.decided());
        let right = sum.right as f64 / sum.decided().max(1) as f64;
        let (map, way) = (
            mean(all.iter().map(|run| of(run).map_error_m)),
            mean(all.iter().map(|run| of(run).way_error_m)),
        );
        table = table.row([
            name.to_owned(),
            sum.right.to_string(),
            sum.wrong.to_string(),
            sum.again.to_string(),
            sum.ambiguous.to_string(),
            format!("{:.3} %", 100.0 * right),
            format!("{:.3} to {:.3} %", 100.0 * low, 100.0 * high),
            format!("{map:.3}"),
            format!("{way:.3}"),
        ]);
        rows.push(json!({ "case": name, "associated": sum, "share_right": right, "interval": [low, high],
            "map_error_aligned_m": map, "way_error_m": way }));
        found.push((sum, high));
    }
    let [(clean, _), (wide, wide_high), (twins, twins_high)] = found[..] else { return };
    let [clean_low, _] = share(clean.right, clean.decided());
    parts.claim(
        "Association without names: none wrong in the clean case; a gate far too wide and look-alikes make mistakes that are seen.",
        format!(
            "clean: {} of {} wrong or twice; wide gate: {} wrong or twice of {}; look-alikes: {} of {}",
            clean.wrong + clean.again,
            clean.decided(),
            wide.wrong + wide.again,
            wide.decided(),
            twins.wrong + twins.again,
            twins.decided()
        ),
        clean.wrong + clean.again == 0
            && clean.decided() > 0
            && wide_high < clean_low
            && twins_high < clean_low,
    );
    parts.number("association", Value::Array(rows));
    parts.shown.push(Shown::Table(table));
}

fn bearings(all: &[Measured], there: usize, parts: &mut Parts) {
    let runs: Vec<&Watched> = all.iter().map(|run| &run.bearing).collect();
    let [pose, map] = [0, 1].map(|what| anees(&runs, what));
    let missed: usize = runs.iter().map(|run| there.saturating_sub(run.ran.map.len())).sum();
    let worst = runs.iter().map(|run| there.saturating_sub(run.ran.map.len())).max().unwrap_or(there);
    let errors: Vec<f64> = runs
        .iter()
        .filter_map(|run| run.ran.map_error_m(pleiad_estimation::statistics::Alignment::Se2))
        .collect();
    let poses = runs.iter().map(|run| run.ran.most_waiting_poses).max().unwrap_or(0);
    let error = Estimate::of(&errors);
    let consistent = |anees: &[Anees]| anees.iter().all(Anees::consistent);
    parts.claim(
        "Bearings alone: landmarks enter once two bearings cross well, five of six at least in every run, and the pose stays consistent.",
        format!(
            "{missed} of {} landmarks missed, at most {worst} in a run; map error {} m; NEES of the pose per degree of freedom at 60 to \
             299 s: {}; at most {poses} past poses at once",
            there * runs.len(),
            error.map_or("-".to_owned(), |error| format!(
                "{:.3} ({:.3} to {:.3})",
                error.mean, error.interval[0], error.interval[1]
            )),
            list(&pose)
        ),
        6 * worst <= there && consistent(&pose),
    );
    let bounds = |anees: &[Anees]| {
        let upper: Vec<String> = anees.iter().map(|at| format!("{:.2}", at.interval[1])).collect();
        upper.join(", ")
    };
    parts.shown.push(Shown::Prose(format!(
        "Bearings alone, NEES of the map as the vehicle sees it, per degree of freedom at 60 to 299 s: {} (upper ends of the interval: {}): \
         the map is {}. A landmark that has just entered is farther from Gaussian than its ellipse says.",
        list(&map),
        bounds(&map),
        if consistent(&map) { "consistent" } else { "not consistent at every time" }
    )));
    parts.number("bearing_map_consistent", json!(consistent(&map)));
    let nameless = summed(all, |run| &run.bearing_nearest);
    let [low, high] = share(nameless.right, nameless.decided());
    let landmarks = mean(all.iter().map(|run| Some(run.bearing_nearest.landmarks as f64)));
    let nameless_error = mean(all.iter().map(|run| run.bearing_nearest.map_error_m));
    parts.shown.push(Shown::Prose(format!(
        "Bearings alone and without names: {} right, {} wrong, {} landmarks founded a second time ({:.2} to {:.2} % right), {} left \
         open; {landmarks:.1} landmarks of {there}, map error {nameless_error:.3} m. A bearing says little of which landmark it is of.",
        nameless.right,
        nameless.wrong,
        nameless.again,
        100.0 * low,
        100.0 * high,
        nameless.ambiguous
    )));
    parts.number("bearing_map_error_aligned_m", json!(error));
    parts.number("bearing_landmarks_missed", json!(missed));
    parts.number("bearing_most_waiting_poses", json!(poses));
    parts.number(
        "bearing_nees_per_dof",
        json!({ "pose": pose.iter().map(|at| at.value).collect::<Vec<_>>(), "map": map.iter().map(|at| at.value).collect::<Vec<_>>() }),
    );
    parts.number(
        "bearing_without_names",
        json!({ "associated": nameless, "landmarks": landmarks, "map_error_aligned_m": nameless_error }),
    );
}

fn example(input: &SlamInput, run: &Watched, seed: u64, parts: &mut Parts) {
    let whose = format!("Seed {seed}, heading told to 0.1 rad, sensor noise doubled, invariant error");
    parts.shown.push(Shown::Figure(
        map_figure(input, &run.ran, &pleiad_estimation::Pose2::identity()),
        format!("{whose}: the map as it is. Ellipses hold 95 %; the map is turned as the start was."),
    ));
    parts.shown.push(Shown::Figure(
        sigma_figure(&run.ran, run.over_limit.map(|limit| limit.limit_sigma_m)),
        format!("{whose}: standard deviations and the mean of the landmarks' limits."),
    ));
    parts.shown.push(Shown::Figure(
        error_figure(&run.ran),
        format!("{whose}: errors of the vehicle with three standard deviations."),
    ));
}
