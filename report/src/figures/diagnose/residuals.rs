//! Residuals before and after the correction.

use std::collections::BTreeMap;

use pleiad_estimation::RobotId;

use crate::figures::robot_name;
use crate::reports::diagnose::ResidualColumns;
use crate::{Axis, Colour, Figure, Panel, Trace};

/// Runs that many residuals are summed up in: about as many as can be told apart in a panel.
const RUNS: usize = 150;
/// Sizes over noise that are shown in any case: small differences of clean data look small.
const SPREADS: (f64, f64) = (0.5, 10.0);
/// And this factor beyond the smallest and largest.
const MARGIN: f64 = 1.2;

/// Root mean square of the residuals over their noise, `[nominal, corrected]`.
fn spread(series: &ResidualColumns) -> [f64; 2] {
    [&series.nominal, &series.corrected].map(|values| {
        let finite = || values.iter().filter(|value| value.is_finite());
        let sum: f64 = finite().map(|value| value * value).sum();
        (sum / finite().count() as f64).sqrt() / series.sigma
    })
}

fn row(series: &ResidualColumns) -> String {
    if series.channel == series.component {
        series.channel.clone()
    } else {
        format!("{}, {}", series.channel, series.component)
    }
}

/// Size of the residuals in units of their noise, a row per component, a point per robot: open under the
/// nominal model, filled under the corrected one. `None` if there is nothing to show.
pub(crate) fn spread_figure(residuals: &[ResidualColumns], robots: &[RobotId]) -> Option<Figure> {
    let mut rows: Vec<String> = Vec::new();
    for series in residuals {
        let name = row(series);
        if !rows.contains(&name) {
            rows.push(name);
        }
    }
    let mut traces = Vec::new();
    let (mut low, mut high) = SPREADS;
    for (index, robot) in robots.iter().enumerate() {
        let own: Vec<(&ResidualColumns, [f64; 2])> = residuals
            .iter()
            .filter(|series| series.robot == *robot)
            .map(|series| (series, spread(series)))
            .filter(|(_, spread)| spread.iter().all(|value| value.is_finite() && *value > 0.0))
            .collect();
        if own.is_empty() {
            continue;
        }
        for value in own.iter().flat_map(|(_, spread)| spread) {
            (low, high) = (low.min(value / MARGIN), high.max(value * MARGIN));
        }
        let name = robot_name(*robot);
        let categories: Vec<String> = own.iter().map(|(series, _)| row(series)).collect();
        let column = |which: usize| own.iter().map(|(_, spread)| spread[which]).collect::<Vec<f64>>();
        let colour = Colour::Series(index);
        let dots = |which: usize, symbol| Trace::dots(&name, &column(which), &categories, colour, symbol);
        traces.push(dots(0, "circle-open").unlisted().group(&name).hover_name(&format!("{name}, nominal")));
        traces.push(dots(1, "circle").group(&name).hover_name(&format!("{name}, corrected")));
    }
    if traces.is_empty() {
        return None;
    }
    let x = Axis::new("root mean square over noise", "-").logarithmic().range(low, high);
    let height = u32::try_from(rows.len()).unwrap_or(40).min(40) * 34 + 90;
    Some(Figure::new(x, Axis::list("", &rows)).height(height).traces(traces))
}

/// Per channel a heading and, per robot, residuals over time in units of their noise: above under the
/// nominal model, below under the corrected one.
pub(crate) fn series_panels(residuals: &[ResidualColumns]) -> Vec<(String, Vec<Panel>)> {
    let mut channels: Vec<(String, Vec<Panel>)> = Vec::new();
    let mut groups: BTreeMap<(usize, RobotId, &str), Vec<&ResidualColumns>> = BTreeMap::new();
    for series in residuals {
        if !(series.sigma > 0.0 && has_finite(&series.nominal) && has_finite(&series.corrected)) {
            continue;
        }
        let position = channels.iter().position(|(name, _)| *name == series.channel).unwrap_or_else(|| {
            channels.push((series.channel.clone(), Vec::new()));
            channels.len() - 1
        });
        groups.entry((position, series.robot, &series.recording)).or_default().push(series);
    }
    for ((position, robot, recording), group) in groups {
        let of = if recording.is_empty() { String::new() } else { format!(", {recording}") };
        let heading = format!("Robot {robot}{of}");
        channels[position].1.push(Panel { heading, figure: before_and_after(&group) });
    }
    channels
}

fn has_finite(values: &[f64]) -> bool {
    values.iter().any(|value| value.is_finite())
}

fn before_and_after(group: &[&ResidualColumns]) -> Figure {
    let largest = group
        .iter()
        .flat_map(|series| {
            series.nominal.iter().chain(&series.corrected).map(|value| (value / series.sigma).abs())
        })
        .filter(|value| value.is_finite())
        .fold(1.0, f64::max);
    let axis = |name: &str| Axis::new(name, "σ").range(-1.05 * largest, 1.05 * largest);
    let mut figure = Figure::new(Axis::new("time", "s"), axis("nominal")).row(axis("corrected")).height(300);
    for (index, series) in group.iter().enumerate() {
        let colour = Colour::Series(index);
        let grouped = |trace: Trace| trace.group(&series.component);
        let below = |trace: Trace| grouped(trace).in_row(1).unlisted();
        figure = figure
            .traces(traces(series, &series.nominal, colour).into_iter().map(grouped))
            .traces(traces(series, &series.corrected, colour).into_iter().map(below));
    }
    figure
}

/// The residuals over their noise: as they are, or the mean and the extremes of equal runs of many.
fn traces(series: &ResidualColumns, values: &[f64], colour: Colour) -> Vec<Trace> {
    let scaled: Vec<f64> = values.iter().map(|value| value / series.sigma).collect();
    let name = &series.component;
    let length = scaled.len().min(series.time_s.len());
    if length <= 2 * RUNS {
        return vec![Trace::line(name, &series.time_s, &scaled, colour).width(1.25)];
    }
    let run = |k: usize| length * k / RUNS..length * (k + 1) / RUNS;
    let of_runs = |column: &[f64], of: &dyn Fn(&[f64]) -> f64| -> Vec<f64> {
        let finite =
            |k: usize| column[run(k)].iter().copied().filter(|value| value.is_finite()).collect::<Vec<f64>>();
        (0..RUNS).map(|k| of(&finite(k))).collect()
    };
    // Of nothing finite these are not finite either, which is a gap.
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let least = |values: &[f64]| values.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let times = of_runs(&series.time_s, &mean);
    vec![
        Trace::band(name, &times, &of_runs(&scaled, &least), &of_runs(&scaled, &greatest), colour).unlisted(),
        Trace::line(name, &times, &of_runs(&scaled, &mean), colour),
    ]
}
