//! What is drawn in a figure: lines, markers, bands, polygons, bars.

use serde_json::{Map, Value, json};

use crate::MAX_POINTS;
use crate::decimate::{even_sample, indices_keeping_extremes};
use crate::html::label;
use crate::number::compact;
use crate::palette::{Colour, Dash};

/// One trace of a figure. Long series are thinned to their extremes, see [`crate::MAX_POINTS`].
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    pub(crate) json: Map<String, Value>,
    pub(crate) hover_name: Option<String>,
    pub(crate) row: usize,
    pub(crate) thinning: Thinning,
}

/// Which points of a long series are left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Thinning {
    /// None.
    None,
    /// Those between the extremes of short runs.
    ToExtremes,
    /// All but an even sample.
    EvenSample,
}

impl Trace {
    /// A line through `(x, y)`; entries that are not finite are gaps.
    pub fn line(name: &str, x: &[f64], y: &[f64], colour: Colour) -> Self {
        Self::thinned_line(name, x, y, &[y], colour)
    }

    /// A line in the plane, whose horizontal extremes matter as much as its vertical ones.
    pub fn path(name: &str, x: &[f64], y: &[f64], colour: Colour) -> Self {
        Self::thinned_line(name, x, y, &[x, y], colour)
    }

    /// A line that holds each value until the next.
    pub fn step(name: &str, x: &[f64], y: &[f64], colour: Colour) -> Self {
        Self::line(name, x, y, colour).with_line("shape", "hv".into())
    }

    /// Points of `size_px`, of very many an even sample, with a symbol of Plotly's (`circle`, `circle-open`, `x`, `diamond`).
    pub fn markers(name: &str, x: &[f64], y: &[f64], colour: Colour, symbol: &str, size_px: f64) -> Self {
        let length = x.len().min(y.len());
        let kept = even_sample(length, MAX_POINTS);
        let mut trace = Self::scatter(name, x, y, &kept, "markers");
        if kept.len() < length {
            trace.thinning = Thinning::EvenSample;
        }
        let outline = json!({"width": 1.5, "color": colour.code()});
        let marker = json!({"color": colour.code(), "symbol": symbol, "size": size_px, "line": outline});
        trace.with("marker", marker)
    }

    /// The area between two curves over `x`, filled; instants where one is not finite are left out.
    pub fn band(name: &str, x: &[f64], lower: &[f64], upper: &[f64], colour: Colour) -> Self {
        let length = x.len().min(lower.len()).min(upper.len());
        let kept = indices_keeping_extremes(&[&lower[..length], &upper[..length]], MAX_POINTS / 2);
        let inside = |&&i: &&usize| x[i].is_finite() && lower[i].is_finite() && upper[i].is_finite();
        let kept_inside: Vec<usize> = kept.iter().filter(inside).copied().collect();
        let around = |ahead: &[f64], back: &[f64]| -> Vec<f64> {
            let there = kept_inside.iter().map(|&i| ahead[i]);
            there.chain(kept_inside.iter().rev().map(|&i| back[i])).collect()
        };
        let thinning = if kept.len() < length { Thinning::ToExtremes } else { Thinning::None };
        Self::area(name, &around(x, x), &around(upper, lower), colour, thinning)
    }

    /// Filled polygons, each closed by its first point.
    pub fn polygons(name: &str, outlines: &[Vec<[f64; 2]>], colour: Colour) -> Self {
        let gap = [f64::NAN; 2];
        let points: Vec<[f64; 2]> =
            outlines.iter().flat_map(|outline| outline.iter().copied().chain([gap])).collect();
        let column = |axis: usize| points.iter().map(|point| point[axis]).collect::<Vec<f64>>();
        let mut trace = Self::area(name, &column(0), &column(1), colour, Thinning::None);
        trace.json.insert("line".into(), json!({"color": colour.code(), "width": 1}));
        trace
    }

    /// Bars over named categories.
    pub fn bars(name: &str, categories: &[String], values: &[f64], colour: Colour) -> Self {
        let json = json!({
            "type": "bar",
            "name": label(name),
            "x": categories.iter().map(|category| label(category)).collect::<Vec<_>>(),
            "y": compact(values),
            "marker": {"color": colour.code()},
        });
        Self::from_json(json, Thinning::None)
    }

    /// Points over the named categories of a vertical axis.
    pub fn dots(name: &str, x: &[f64], categories: &[String], colour: Colour, symbol: &str) -> Self {
        let json = json!({
            "type": "scatter",
            "mode": "markers",
            "name": label(name),
            "x": compact(x),
            "y": categories.iter().map(|category| label(category)).collect::<Vec<_>>(),
            "marker": {
                "color": colour.code(),
                "symbol": symbol,
                "size": 9,
                "line": {"width": 1.5, "color": colour.code()},
            },
        });
        Self::from_json(json, Thinning::None)
    }

    /// Squares of the plane around the centres `x` and `y`, coloured by `values[row of y][column of x]` from
    /// `range.0` to `range.1`; those that are not finite stay clear. `quantity` names the colours.
    pub fn cells(
        name: &str,
        x: &[f64],
        y: &[f64],
        values: &[Vec<f64>],
        range: (f64, f64),
        quantity: &str,
    ) -> Self {
        let json = json!({
            "type": "heatmap",
            "name": label(name),
            "x": compact(x),
            "y": compact(y),
            "z": values.iter().map(|row| compact(row)).collect::<Vec<_>>(),
            "zmin": range.0,
            "zmax": range.1,
            // Cividis, Nunez et al. 2018: even steps of brightness, the same with any colour vision.
            "colorscale": "Cividis",
            "colorbar": {"title": {"text": label(quantity), "side": "right"}, "thickness": 12, "outlinewidth": 0},
            "showlegend": false,
            "hoverongaps": false,
            "hovertemplate": format!("x %{{x:.2f}} m<br>y %{{y:.2f}} m<br>{} %{{z:.3~r}}<extra></extra>", label(quantity)),
        });
        Self::from_json(json, Thinning::None)
    }

    /// The pattern of the line.
    pub fn dash(self, dash: Dash) -> Self {
        self.with_line("dash", dash.code().into())
    }

    /// The width of the line, pixels.
    pub fn width(self, width_px: f64) -> Self {
        self.with_line("width", width_px.into())
    }

    /// From 0, invisible, to 1.
    pub fn opacity(self, opacity: f64) -> Self {
        self.with("opacity", opacity.into())
    }

    /// Not in the legend; shown and hidden with its group.
    pub fn unlisted(self) -> Self {
        self.with("showlegend", false.into())
    }

    /// Shown and hidden with the others of its group.
    pub fn group(self, group: &str) -> Self {
        self.with("legendgroup", group.into())
    }

    /// Hidden until chosen in the legend.
    pub fn on_request(self) -> Self {
        self.with("visible", "legendonly".into())
    }

    /// Another name under the pointer than in the legend.
    pub fn hover_name(mut self, name: &str) -> Self {
        self.hover_name = Some(label(name));
        self
    }

    /// Says nothing under the pointer.
    pub fn silent(self) -> Self {
        self.with("hoverinfo", "skip".into())
    }

    /// In the how-manieth row of a figure of several rows, from 0.
    pub fn in_row(mut self, row: usize) -> Self {
        self.row = row;
        self
    }

    fn thinned_line(name: &str, x: &[f64], y: &[f64], columns: &[&[f64]], colour: Colour) -> Self {
        let length = x.len().min(y.len());
        let columns: Vec<&[f64]> = columns.iter().map(|column| &column[..length]).collect();
        let kept = indices_keeping_extremes(&columns, MAX_POINTS);
        let mut trace = Self::scatter(name, x, y, &kept, "lines");
        if kept.len() < length {
            trace.thinning = Thinning::ToExtremes;
        }
        trace.with("line", json!({"color": colour.code(), "width": 1.75}))
    }

    fn scatter(name: &str, x: &[f64], y: &[f64], kept: &[usize], mode: &str) -> Self {
        let pick = |column: &[f64]| compact(&kept.iter().map(|&i| column[i]).collect::<Vec<f64>>());
        let json = json!({"type": "scatter", "mode": mode, "name": label(name), "x": pick(x), "y": pick(y)});
        Self::from_json(json, Thinning::None)
    }

    fn area(name: &str, x: &[f64], y: &[f64], colour: Colour, thinning: Thinning) -> Self {
        let json = json!({
            "type": "scatter",
            "mode": "lines",
            "name": label(name),
            "x": compact(x),
            "y": compact(y),
            "fill": "toself",
            "fillcolor": format!("{}/0.16", colour.code()),
            "line": {"color": colour.code(), "width": 0},
            "hoverinfo": "skip",
        });
        Self::from_json(json, thinning)
    }

    fn from_json(json: Value, thinning: Thinning) -> Self {
        let json = if let Value::Object(map) = json { map } else { Map::new() };
        Self { json, hover_name: None, row: 0, thinning }
    }

    fn with(mut self, key: &str, value: Value) -> Self {
        self.json.insert(key.into(), value);
        self
    }

    fn with_line(mut self, key: &str, value: Value) -> Self {
        if let Some(Value::Object(line)) = self.json.get_mut("line") {
            line.insert(key.into(), value);
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_finite_is_a_gap() {
        let trace = Trace::line("a", &[0.0, 1.0, 2.0], &[1.0, f64::NAN, 3.0], Colour::Ink);
        assert_eq!(trace.json["y"], json!([1.0, null, 3.0]));
        assert_eq!(trace.thinning, Thinning::None);
    }

    #[test]
    fn a_band_runs_along_its_upper_and_back_along_its_lower_curve() {
        let x = [0.0, 1.0, 2.0];
        let trace = Trace::band("a", &x, &[-1.0, f64::NAN, -2.0], &[1.0, 5.0, 2.0], Colour::Muted);
        assert_eq!(trace.json["x"], json!([0.0, 2.0, 2.0, 0.0]));
        assert_eq!(trace.json["y"], json!([1.0, 2.0, -2.0, -1.0]));
    }

    #[test]
    fn long_series_say_that_they_are_thinned() {
        let x: Vec<f64> = (0..100_000).map(f64::from).collect();
        let trace = Trace::line("a", &x, &x, Colour::Series(0));
        assert_eq!(trace.thinning, Thinning::ToExtremes);
        assert!(trace.json["x"].as_array().unwrap().len() <= MAX_POINTS);
    }

    #[test]
    fn names_cannot_carry_markup_into_labels() {
        let trace = Trace::line("<a href='x'>", &[0.0], &[0.0], Colour::Ink);
        assert_eq!(trace.json["name"], "&lt;a href='x'&gt;");
    }
}
