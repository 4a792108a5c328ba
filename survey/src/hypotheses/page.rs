//! Figures and tables of the hypotheses.

use pleiad_estimation::hypotheses::Standing;
use pleiad_report::{Axis, Colour, Figure, Table, Trace};
use pleiad_sim_peers::Scenario;

use super::drive::Run;
use super::{Outcome, mean, of_runs};
use crate::Shown;

/// Symbols of the kinds of landmark.
const SYMBOLS: [&str; 3] = ["square", "diamond", "triangle-up"];

pub(super) fn shown(outcome: &Outcome) -> Vec<Shown> {
    let mut shown = vec![Shown::Table(table(outcome))];
    if let Some(run) = outcome.kidnapped.first() {
        shown.push(Shown::Figure(
            weights(run, outcome.kidnapped_at_s),
            "Weights and number of hypotheses in the first run, carried off where the line is. The weight at the true \
             place falls at once; the old hypotheses hold out until nothing explains what is seen."
                .to_owned(),
        ));
        shown.push(Shown::Figure(
            map(&outcome.scenario, run),
            "The map: landmarks by kind, the true path of the first run, the heaviest hypothesis after each scan, and \
             all hypotheses after its first scans."
                .to_owned(),
        ));
    }
    shown.push(Shown::Figure(
        shares(outcome),
        "Share of runs that believe in one hypothesis, the right one, from then on. Recovery counts from the \
         kidnapping."
            .to_owned(),
    ));
    if let Some(run) = outcome.symmetric.first() {
        shown.push(Shown::Figure(
            ambiguous(run),
            "The symmetric map, first run: the true place and its image under half a turn share all weight."
                .to_owned(),
        ));
        shown.push(Shown::Figure(
            map(&outcome.symmetric_scenario, run),
            "The symmetric map with the true path; which of the two places is heaviest is decided by the last bit."
                .to_owned(),
        ));
    }
    shown
}

fn table(outcome: &Outcome) -> Table {
    let of = outcome.clean.len();
    let counts = |runs: &[Run]| {
        let all: Vec<f64> = runs.iter().map(|run| run.most as f64).collect();
        mean(&all, "")
    };
    let until = outcome.duration_s;
    let errors = |runs: &[Run]| mean(&runs.iter().map(|run| run.error_m).collect::<Vec<_>>(), "m");
    let row = |name: &str, runs: &[Run], from_s: f64| {
        let settled: Vec<f64> =
            runs.iter().filter_map(|run| Some(run.settled_s(from_s, f64::INFINITY)? - from_s)).collect();
        let decided = runs.iter().filter(|run| run.decided_s(from_s, until).is_some()).count();
        [
            name.to_owned(),
            of_runs(settled.len(), of),
            mean(&settled, "s"),
            decided.saturating_sub(settled.len()).to_string(),
            counts(runs),
            errors(runs),
        ]
    };
    Table::new(
        "What became of the runs: shares with exact 95 % intervals, means with 95 % intervals.",
        [
            "case",
            "one hypothesis, the right one, at the end",
            "believed after",
            "runs with a wrong one",
            "most hypotheses in a run",
            "position error at the end",
        ],
    )
    .row(row("uniform start", &outcome.clean, 0.0))
    .row(row("carried off", &outcome.kidnapped, outcome.kidnapped_at_s))
    .row(row("carried off, no reserve (planted fault)", &outcome.without_reserve, outcome.kidnapped_at_s))
    .row(row("symmetric map", &outcome.symmetric, 0.0))
}

fn weights(run: &Run, kidnapped_at_s: f64) -> Figure {
    let times: Vec<f64> = run.moments.iter().map(|moment| moment.time_s).collect();
    let heaviest: Vec<f64> = run.moments.iter().map(|moment| moment.heaviest).collect();
    let truth: Vec<f64> = run.moments.iter().map(|moment| moment.at_truth).collect();
    let count: Vec<f64> = run.moments.iter().map(|moment| moment.count as f64).collect();
    let mark = [kidnapped_at_s; 2];
    Figure::new(Axis::new("time", "s"), Axis::new("weight", "-").range(-0.02, 1.04))
        .row(Axis::new("hypotheses", "-").logarithmic())
        .height(520)
        .trace(Trace::step("at the true place", &times, &truth, Colour::Series(2)).width(4.0).opacity(0.5))
        .trace(Trace::step("heaviest", &times, &heaviest, Colour::Series(0)))
        .trace(Trace::line("carried off", &mark, &[0.0, 1.0], Colour::Series(1)))
        .trace(Trace::step("number of hypotheses", &times, &count, Colour::Ink).in_row(1))
}

fn ambiguous(run: &Run) -> Figure {
    let times: Vec<f64> = run.moments.iter().map(|moment| moment.time_s).collect();
    let truth: Vec<f64> = run.moments.iter().map(|moment| moment.at_truth).collect();
    let image: Vec<f64> = run.moments.iter().map(|moment| moment.at_image).collect();
    Figure::new(Axis::new("time", "s"), Axis::new("weight", "-").range(-0.02, 1.04))
        .trace(Trace::step("at the true place", &times, &truth, Colour::Series(2)).width(5.0).opacity(0.5))
        .trace(Trace::step("at its image", &times, &image, Colour::Series(1)))
}

fn map(scenario: &Scenario, run: &Run) -> Figure {
    let [left, right, bottom, top] = scenario.arena.bounds_m();
    let mut figure = Figure::new(
        Axis::new("x", "m").range(left - 0.5, right + 0.5),
        Axis::new("y", "m").range(bottom - 0.5, top + 0.5),
    )
    .equal_aspect();
    // A jump is no path.
    let mut last = None;
    let (mut xs, mut ys) = (Vec::new(), Vec::new());
    for moment in &run.moments {
        let here = moment.truth.position();
        if last.is_some_and(|before: pleiad_estimation::geometry::Vector2| (here - before).norm() > 2.5) {
            xs.push(f64::NAN);
            ys.push(f64::NAN);
        }
        xs.push(here.x);
        ys.push(here.y);
        last = Some(here);
    }
    figure = figure.trace(Trace::path("truth", &xs, &ys, Colour::Series(2)).width(6.0).opacity(0.35));
    for (k, index) in [0usize, 4].into_iter().enumerate() {
        if let Some(standings) = run.early.get(index) {
            let (xs, ys) = places(standings);
            let name = format!("{} hypotheses after scan {}", standings.len(), index + 1);
            figure = figure.trace(Trace::markers(&name, &xs, &ys, Colour::Series(3 + k), "circle-open", 5.0));
        }
    }
    let (ex, ey): (Vec<f64>, Vec<f64>) =
        run.moments.iter().map(|moment| (moment.pose.x_m(), moment.pose.y_m())).unzip();
    figure =
        figure.trace(Trace::markers("heaviest after each scan", &ex, &ey, Colour::Series(0), "circle", 4.0));
    for (kind, symbol) in SYMBOLS.iter().enumerate() {
        let of_kind = scenario
            .landmarks
            .iter()
            .filter(|(id, _)| scenario.landmark_kinds.get(id).is_some_and(|own| *own as usize == kind));
        let (xs, ys): (Vec<f64>, Vec<f64>) = of_kind.map(|(_, [x, y])| (*x, *y)).unzip();
        let name = format!("landmarks of kind {kind}");
        figure = figure.trace(Trace::markers(&name, &xs, &ys, Colour::Ink, symbol, 11.0));
    }
    figure
}

fn places(standings: &[Standing]) -> (Vec<f64>, Vec<f64>) {
    standings.iter().map(|standing| (standing.pose.x_m(), standing.pose.y_m())).unzip()
}

/// Share of runs settled by a time, as a curve.
fn shares(outcome: &Outcome) -> Figure {
    let curve = |mut times: Vec<f64>, runs: usize| {
        times.sort_by(f64::total_cmp);
        let mut xs = vec![0.0];
        let mut ys = vec![0.0];
        for (index, time) in times.iter().enumerate() {
            xs.push(*time);
            ys.push((index + 1) as f64 / runs.max(1) as f64);
        }
        xs.push(outcome.duration_s - outcome.kidnapped_at_s);
        ys.push(ys.last().copied().unwrap_or(0.0));
        (xs, ys)
    };
    let of = outcome.clean.len();
    let cases = [
        ("from a uniform start", outcome.converged_s()),
        ("after being carried off", outcome.recovered_s(&outcome.kidnapped)),
        ("carried off, no reserve", outcome.recovered_s(&outcome.without_reserve)),
    ];
    let mut figure = Figure::new(
        Axis::new("time since the start or the kidnapping", "s")
            .range(0.0, outcome.duration_s - outcome.kidnapped_at_s),
        Axis::new("share of runs", "-").range(0.0, 1.04),
    );
    for (index, (name, times)) in cases.into_iter().enumerate() {
        let (xs, ys) = curve(times, of);
        figure = figure.trace(Trace::step(name, &xs, &ys, Colour::Series(index)));
    }
    figure
}
