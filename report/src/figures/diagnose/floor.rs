//! Where on the floor a finding shows, and where residuals remain.

use std::collections::BTreeMap;

use crate::figures::diagnose::evidence::increments;
use crate::reports::diagnose::{DiagnoseReport, Evidence, Found, ResidualColumns};
use crate::{Axis, Colour, Figure, Panel, Trace, indices_keeping_extremes};

/// Cells along the longer side of the floor, at most.
const CELLS: f64 = 40.0;
/// Sides that cells may have, metres.
const SIDES_M: [f64; 10] = [0.05, 0.1, 0.2, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 50.0];
/// Residuals in a cell from which its size is shown.
const LEAST: usize = 3;
/// Points of a path below the cells.
const PATH_POINTS: usize = 600;
/// Share of the cells that the colours cover; the rest takes the last colour.
const QUANTILE: f64 = 0.98;

/// A part of the floor in squares.
struct Grid {
    low: [f64; 2],
    high: [f64; 2],
    side_m: f64,
}

impl Grid {
    /// Around all paths and known positions; `None` without any.
    fn around(report: &DiagnoseReport) -> Option<Self> {
        let driven = report.paths.iter().flat_map(|(_, path)| path.iter().copied());
        let seen = report.residuals.iter().flat_map(|series| series.position_m.iter().flatten().copied());
        let marks = report.landmarks.iter().map(|landmark| [landmark.x_m, landmark.y_m]);
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in
            driven.chain(seen).chain(marks).filter(|point| point.iter().all(|value| value.is_finite()))
        {
            for axis in 0..2 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        let longer = (high[0] - low[0]).max(high[1] - low[1]);
        if !(longer.is_finite() && longer > 0.0) {
            return None;
        }
        let wanted = longer / CELLS;
        let side_m = SIDES_M.into_iter().find(|side| *side >= wanted).unwrap_or(wanted);
        let down = |value: f64| (value / side_m - 0.5).floor() * side_m;
        let up = |value: f64| (value / side_m + 0.5).ceil() * side_m;
        Some(Self { low: low.map(down), high: high.map(up), side_m })
    }

    #[allow(clippy::cast_possible_truncation, reason = "a number of cells")]
    fn cell(&self, point: [f64; 2]) -> Option<(i64, i64)> {
        let finite = point.iter().all(|value| value.is_finite());
        let at = |axis: usize| ((point[axis] - self.low[axis]) / self.side_m).floor() as i64;
        finite.then(|| (at(0), at(1)))
    }

    fn centres(&self, axis: usize) -> Vec<f64> {
        let mut centres = Vec::new();
        let mut centre = self.low[axis] + 0.5 * self.side_m;
        while centre < self.high[axis] {
            centres.push(centre);
            centre += self.side_m;
        }
        centres
    }

    fn figure(&self, report: &DiagnoseReport) -> Figure {
        let axis = |name: &str, axis: usize| Axis::new(name, "m").range(self.low[axis], self.high[axis]);
        let mut figure = Figure::new(axis("x", 0), axis("y", 1)).equal_aspect();
        if !report.landmarks.is_empty() {
            let column =
                |of: fn(&crate::Landmark) -> f64| report.landmarks.iter().map(of).collect::<Vec<f64>>();
            let (x, y) = (column(|landmark| landmark.x_m), column(|landmark| landmark.y_m));
            figure = figure
                .trace(Trace::markers("landmarks", &x, &y, Colour::Muted, "diamond-open", 8.0).unlisted());
        }
        figure
    }

    /// The cells with their values, lines of y of columns of x, and the upper end of the colours.
    fn cells(&self, values: &BTreeMap<(i64, i64), f64>) -> (Vec<f64>, Vec<f64>, Vec<Vec<f64>>) {
        let (x, y) = (self.centres(0), self.centres(1));
        let value = |column: usize, line: usize| {
            let cell = (i64::try_from(column).unwrap_or(-1), i64::try_from(line).unwrap_or(-1));
            values.get(&cell).copied().unwrap_or(f64::NAN)
        };
        let lines =
            (0..y.len()).map(|line| (0..x.len()).map(|column| value(column, line)).collect()).collect();
        (x, y, lines)
    }
}

/// The value below which all but the largest few lie.
fn upper_end<'a>(values: impl Iterator<Item = &'a f64>) -> f64 {
    let mut sorted: Vec<f64> = values.copied().filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a length")]
    let last = (sorted.len() as f64 * QUANTILE) as usize;
    sorted.get(last.min(sorted.len().saturating_sub(1))).copied().unwrap_or(0.0)
}

/// Where a finding gains its log-likelihood: summed per square of the floor. `None` without positions.
pub(crate) fn gain_floor(report: &DiagnoseReport, finding: &Found, evidence: &[&Evidence]) -> Option<Figure> {
    let grid = Grid::around(report)?;
    let mut gained: BTreeMap<(i64, i64), f64> = BTreeMap::new();
    for own in evidence {
        let Some(places) = report.residuals.iter().find(|series| is_of(series, own)) else { continue };
        for [time, gain] in increments(own).into_iter().filter(|step| step[1].is_finite()) {
            if let Some(cell) = place_at(places, time).and_then(|place| grid.cell(place)) {
                *gained.entry(cell).or_default() += gain;
            }
        }
    }
    let most = upper_end(gained.values());
    if most <= 0.0 {
        return None;
    }
    let mut figure = grid.figure(report);
    for (robot, path) in report.paths.iter().filter(|(robot, _)| finding.robots.contains(robot)) {
        let column = |axis: usize| path.iter().map(|point| point[axis]).collect::<Vec<f64>>();
        let (x, y) = (column(0), column(1));
        let kept = indices_keeping_extremes(&[&x, &y], PATH_POINTS);
        let pick = |column: &[f64]| kept.iter().map(|&i| column[i]).collect::<Vec<f64>>();
        let name = format!("path of robot {robot}");
        if !kept.is_empty() {
            figure = figure.trace(
                Trace::path(&name, &pick(&x), &pick(&y), Colour::Muted).width(0.5).opacity(0.3).unlisted(),
            );
        }
    }
    let (x, y, cells) = grid.cells(&gained);
    figure = figure.trace(Trace::cells("gain", &x, &y, &cells, (0.0, most), "log-likelihood gained (nat)"));
    if let Some([x0, x1, y0, y1]) = finding.region_m {
        let outline = [[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]];
        let column = |axis: usize| outline.iter().map(|point| point[axis]).collect::<Vec<f64>>();
        figure = figure.trace(
            Trace::path("region found", &column(0), &column(1), Colour::Series(1)).width(2.5).unlisted(),
        );
    }
    Some(figure)
}

fn is_of(series: &ResidualColumns, evidence: &Evidence) -> bool {
    series.recording == evidence.recording
        && series.robot == evidence.robot
        && series.channel == evidence.channel
        && series.component == evidence.component
}

/// The known place nearest in time, at most a second away.
fn place_at(series: &ResidualColumns, time_s: f64) -> Option<[f64; 2]> {
    let after = series.time_s.partition_point(|time| *time < time_s);
    let near = after.saturating_sub(3)..(after + 3).min(series.time_s.len().min(series.position_m.len()));
    near.filter_map(|index| Some(((series.time_s[index] - time_s).abs(), series.position_m[index]?)))
        .filter(|(distance, _)| *distance <= 1.0)
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, place)| place)
}

/// Root mean square residual over noise per square of the floor, under the nominal and under the corrected
/// model in the same colours; empty without positions.
pub(crate) fn residual_floors(report: &DiagnoseReport) -> Vec<Panel> {
    let Some(grid) = Grid::around(report) else { return Vec::new() };
    let sizes =
        [sizes(report, &grid, |series| &series.nominal), sizes(report, &grid, |series| &series.corrected)];
    let most = upper_end(sizes.iter().flat_map(|sizes| sizes.values()));
    if sizes.iter().any(BTreeMap::is_empty) || most <= 0.0 {
        return Vec::new();
    }
    let panel = |(heading, sizes): (&str, &BTreeMap<(i64, i64), f64>)| {
        let (x, y, cells) = grid.cells(sizes);
        let trace = Trace::cells("residuals", &x, &y, &cells, (0.0, most), "residual (σ)");
        Panel { heading: heading.to_owned(), figure: grid.figure(report).trace(trace) }
    };
    ["Nominal", "Corrected"].into_iter().zip(&sizes).map(panel).collect()
}

fn sizes(
    report: &DiagnoseReport,
    grid: &Grid,
    values: fn(&ResidualColumns) -> &Vec<f64>,
) -> BTreeMap<(i64, i64), f64> {
    let mut sums: BTreeMap<(i64, i64), (f64, usize)> = BTreeMap::new();
    for series in report.residuals.iter().filter(|series| series.sigma > 0.0) {
        for (value, place) in values(series).iter().zip(&series.position_m) {
            let size = (value / series.sigma).powi(2);
            if let (true, Some(cell)) = (size.is_finite(), place.and_then(|place| grid.cell(place))) {
                let sum = sums.entry(cell).or_default();
                *sum = (sum.0 + size, sum.1 + 1);
            }
        }
    }
    let enough = sums.into_iter().filter(|(_, (_, count))| *count >= LEAST);
    enough.map(|(cell, (sum, count))| (cell, (sum / count as f64).sqrt())).collect()
}
