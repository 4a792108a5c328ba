//! A figure: axes with units, and traces.

use serde_json::{Map, Value, json};

use crate::Trace;
use crate::html::label;
use crate::trace::Thinning;

/// An axis: what it shows, in which unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    quantity: String,
    unit: String,
    scale: Scale,
    range: Option<(f64, f64)>,
    from_zero: bool,
    categories: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scale {
    Linear,
    Logarithmic,
    Category,
}

/// A figure of one or several rows that share their horizontal axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    x: Axis,
    rows: Vec<Axis>,
    traces: Vec<Trace>,
    notes: Vec<Note>,
    height_px: u32,
    equal_aspect: bool,
}

#[derive(Clone, Debug, PartialEq)]
struct Note {
    x: f64,
    y: f64,
    text: String,
}

impl Axis {
    /// A linear axis of `quantity` in `unit`; `-` for what has none.
    pub fn new(quantity: &str, unit: &str) -> Self {
        Self {
            quantity: quantity.to_owned(),
            unit: unit.to_owned(),
            scale: Scale::Linear,
            range: None,
            from_zero: false,
            categories: Vec::new(),
        }
    }

    /// A vertical axis of the named categories in this order from the top, each labelled.
    pub fn list(quantity: &str, categories: &[String]) -> Self {
        let from_bottom = categories.iter().rev().map(|category| label(category)).collect();
        Self { categories: from_bottom, ..Self::category(quantity) }
    }

    /// An axis of named categories.
    pub fn category(quantity: &str) -> Self {
        Self { scale: Scale::Category, ..Self::new(quantity, "") }
    }

    /// On a logarithmic scale.
    pub fn logarithmic(mut self) -> Self {
        self.scale = Scale::Logarithmic;
        self
    }

    /// From `low` to `high`; without it the traces decide.
    pub fn range(mut self, low: f64, high: f64) -> Self {
        self.range = (low.is_finite() && high.is_finite() && low < high).then_some((low, high));
        self
    }

    /// From zero at least.
    pub fn from_zero(mut self) -> Self {
        self.from_zero = true;
        self
    }

    fn title(&self) -> String {
        if self.unit.is_empty() {
            label(&self.quantity)
        } else {
            label(&format!("{} ({})", self.quantity, self.unit))
        }
    }

    /// A value on the axis in Plotly's coordinates.
    fn coordinate(&self, value: f64) -> f64 {
        if self.scale == Scale::Logarithmic { value.log10() } else { value }
    }

    fn json(&self) -> Map<String, Value> {
        let mut axis = Map::new();
        axis.insert("title".into(), json!({"text": self.title(), "standoff": 6}));
        let kind = match self.scale {
            Scale::Linear => "linear",
            Scale::Logarithmic => "log",
            Scale::Category => "category",
        };
        axis.insert("type".into(), kind.into());
        if !self.categories.is_empty() {
            axis.insert("categoryarray".into(), json!(self.categories));
            axis.insert("range".into(), json!([-0.6, self.categories.len() as f64 - 0.4]));
            axis.insert("dtick".into(), 1.into());
        }
        if self.scale == Scale::Logarithmic {
            // No dtick: below two decades, ticks at whole powers of ten alone would leave a single number.
            axis.insert("exponentformat".into(), "power".into());
        }
        if let Some((low, high)) = self.range {
            axis.insert("range".into(), json!([self.coordinate(low), self.coordinate(high)]));
        } else if self.from_zero {
            axis.insert("rangemode".into(), "tozero".into());
        }
        axis
    }

    /// The part of a hover text that shows `variable` on this axis.
    fn hover(&self, variable: &str) -> String {
        if self.scale == Scale::Category {
            return format!("%{{{variable}}}");
        }
        let unit = if self.unit == "-" { "" } else { self.unit.as_str() };
        format!("{} %{{{variable}:.4~r}} {}", label(&self.quantity), label(unit))
    }
}

impl Figure {
    /// An empty figure with one row.
    pub fn new(x: Axis, y: Axis) -> Self {
        Self { x, rows: vec![y], traces: Vec::new(), notes: Vec::new(), height_px: 420, equal_aspect: false }
    }

    /// Adds a row below the others, with the same horizontal axis.
    pub fn row(mut self, y: Axis) -> Self {
        self.rows.push(y);
        self
    }

    /// Height, pixels. A map with ranges on both axes takes its height from them instead.
    pub fn height(mut self, height_px: u32) -> Self {
        self.height_px = height_px;
        self
    }

    /// One metre is as long to the right as it is upwards.
    pub fn equal_aspect(mut self) -> Self {
        self.equal_aspect = true;
        self
    }

    /// Adds a trace on top of the others.
    pub fn trace(mut self, trace: Trace) -> Self {
        self.traces.push(trace);
        self
    }

    /// Adds traces on top of the others.
    pub fn traces(mut self, traces: impl IntoIterator<Item = Trace>) -> Self {
        self.traces.extend(traces);
        self
    }

    /// Writes `text` to the left above a point of the first row.
    pub fn note(mut self, x: f64, y: f64, text: &str) -> Self {
        if x.is_finite() && y.is_finite() {
            self.notes.push(Note { x, y, text: text.to_owned() });
        }
        self
    }

    /// Whether some of the figure's traces leave points out in this way.
    pub(crate) fn has(&self, thinning: Thinning) -> bool {
        self.traces.iter().any(|trace| trace.thinning == thinning)
    }

    /// `{data, layout, aspect}` for the script of the page; `aspect` is height by width of a map.
    pub fn to_json(&self) -> Value {
        let data: Vec<Value> = self.traces.iter().map(|trace| self.trace_json(trace)).collect();
        json!({"data": data, "layout": self.layout(), "aspect": self.aspect()})
    }

    fn trace_json(&self, trace: &Trace) -> Value {
        let mut json = trace.json.clone();
        let row = trace.row.min(self.rows.len() - 1);
        json.insert("yaxis".into(), axis_name("y", row).into());
        if !json.contains_key("hoverinfo") && !json.contains_key("hovertemplate") {
            let own = json.get("name").and_then(Value::as_str).unwrap_or_default();
            let name = trace.hover_name.as_deref().unwrap_or(own);
            let hover =
                format!("{}<br>{}<extra>{name}</extra>", self.x.hover("x"), self.rows[row].hover("y"));
            json.insert("hovertemplate".into(), hover.into());
        }
        Value::Object(json)
    }

    fn layout(&self) -> Value {
        let mut layout = Map::new();
        let mut x = self.x.json();
        x.insert("anchor".into(), axis_name("y", self.rows.len() - 1).into());
        if self.equal_aspect {
            x.insert("constrain".into(), "domain".into());
        }
        layout.insert("xaxis".into(), Value::Object(x));
        let count = self.rows.len() as f64;
        for (row, axis) in self.rows.iter().enumerate() {
            let mut y = axis.json();
            let gap = if row == 0 { 0.0 } else { 0.06 };
            y.insert(
                "domain".into(),
                json!([1.0 - (row as f64 + 1.0) / count, 1.0 - row as f64 / count - gap]),
            );
            if self.equal_aspect {
                y.insert("scaleanchor".into(), "x".into());
                y.insert("constrain".into(), "domain".into());
            }
            layout.insert(axis_name("yaxis", row), Value::Object(y));
        }
        let notes: Vec<Value> = self.notes.iter().map(|note| self.note_json(note)).collect();
        layout.insert("annotations".into(), notes.into());
        layout.insert("height".into(), self.height_px.into());
        Value::Object(layout)
    }

    fn note_json(&self, note: &Note) -> Value {
        json!({
            "x": self.x.coordinate(note.x),
            "y": self.rows[0].coordinate(note.y),
            "text": label(&note.text),
            "showarrow": false,
            "xanchor": "right",
            "yanchor": "bottom",
            "yshift": 4,
            "bgcolor": "@paper/0.8",
        })
    }

    fn aspect(&self) -> Option<f64> {
        let ((left, right), (bottom, top)) = (self.x.range?, self.rows[0].range?);
        self.equal_aspect.then(|| (top - bottom) / (right - left))
    }
}

/// Plotly counts axes from 1 and leaves the 1 out.
fn axis_name(stem: &str, row: usize) -> String {
    if row == 0 { stem.to_owned() } else { format!("{stem}{}", row + 1) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Colour;

    #[test]
    fn axes_carry_their_units_and_rows_share_the_time() {
        let figure = Figure::new(Axis::new("time", "s"), Axis::new("x error", "m"))
            .row(Axis::new("y error", "m"))
            .trace(Trace::line("a", &[0.0], &[0.0], Colour::Ink).in_row(1));
        let json = figure.to_json();
        assert_eq!(json["layout"]["xaxis"]["title"]["text"], "time (s)");
        assert_eq!(json["layout"]["xaxis"]["anchor"], "y2");
        assert_eq!(json["layout"]["yaxis2"]["title"]["text"], "y error (m)");
        assert_eq!(json["data"][0]["yaxis"], "y2");
        assert_eq!(json["aspect"], Value::Null);
    }

    #[test]
    fn logarithmic_ranges_and_notes_are_in_decades() {
        let figure =
            Figure::new(Axis::new("time", "s"), Axis::new("sigma", "m").logarithmic().range(0.01, 100.0))
                .note(5.0, 10.0, "here");
        let layout = figure.to_json()["layout"].clone();
        assert_eq!(layout["yaxis"]["range"], json!([-2.0, 2.0]));
        assert_eq!(layout["annotations"][0]["y"], json!(1.0));
    }

    #[test]
    fn a_map_keeps_the_aspect_of_its_ranges() {
        let map = Figure::new(Axis::new("x", "m").range(0.0, 10.0), Axis::new("y", "m").range(-2.0, 3.0))
            .equal_aspect();
        assert_eq!(map.to_json()["aspect"], json!(0.5));
        assert_eq!(map.to_json()["layout"]["yaxis"]["scaleanchor"], "x");
    }
}
