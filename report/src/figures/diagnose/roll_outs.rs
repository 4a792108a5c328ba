//! How far predictions go wrong.

use crate::reports::diagnose::RobotRollOut;
use crate::{Axis, Colour, Dash, Figure, Panel, Trace};

/// The models in the order of their columns: name, colour, line, symbol.
const MODELS: [(&str, Colour, Dash, &str); 3] = [
    ("nominal", Colour::Muted, Dash::Dot, "circle-open"),
    ("nominal, refitted", Colour::Series(1), Dash::Dash, "square"),
    ("corrected", Colour::Series(0), Dash::Solid, "circle"),
];

/// Error of the predicted pose over the horizon, a panel per robot: position above, heading below.
pub(crate) fn roll_out_panels(roll_outs: &[RobotRollOut]) -> Vec<Panel> {
    roll_outs.iter().filter_map(panel).collect()
}

fn panel(own: &RobotRollOut) -> Option<Panel> {
    let times: Vec<f64> = own.horizons.iter().map(|horizon| horizon.horizon_s).collect();
    let mut figure =
        Figure::new(Axis::new("horizon", "s").logarithmic(), Axis::new("position", "m").logarithmic())
            .row(Axis::new("heading", "rad").logarithmic())
            .height(360);
    let mut drawn = false;
    for (model, (name, colour, dash, symbol)) in MODELS.into_iter().enumerate() {
        let position = own.horizons.iter().map(|horizon| positive(horizon.position_m[model]));
        let heading = own.horizons.iter().map(|horizon| positive(horizon.heading_rad[model]));
        for (row, values) in [position.collect::<Vec<f64>>(), heading.collect()].iter().enumerate() {
            if !values.iter().any(|value| value.is_finite()) {
                continue;
            }
            drawn = true;
            let line = Trace::line(name, &times, values, colour).dash(dash).group(name).in_row(row);
            let points = Trace::markers(name, &times, values, colour, symbol, 6.0);
            figure = figure
                .trace(if row == 0 { line } else { line.unlisted() })
                .trace(points.unlisted().group(name).in_row(row));
        }
    }
    drawn.then(|| Panel { heading: format!("Robot {}", own.robot), figure })
}

/// A logarithmic axis has no place for zero.
fn positive(value: f64) -> f64 {
    if value > 0.0 { value } else { f64::NAN }
}
