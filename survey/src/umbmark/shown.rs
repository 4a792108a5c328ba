//! Tables and figures, for simulated and for recorded runs.

use pleiad_mismatch::calibration::umbmark::{
    Centre, Stage, Turning, Umbmark, WheelErrors, masking_track, square_end, square_path,
};
use pleiad_report::{Axis, Colour, Dash, Figure, Table, Trace};

use crate::study::Shown;

/// The published robot that one direction deceives: nominal track and side, metres, and `E_d`.
pub(super) const MASKED: (f64, f64, f64) = (0.3, 4.0, 1.004);
/// Points to a motion of a drawn square.
const STEPS: u32 = 12;
const DIRECTIONS: [Turning; 2] = [Turning::CounterClockwise, Turning::Clockwise];

/// Where runs of both directions ended, stage by stage: the figure that UMBmark is known for.
pub fn returns(stages: &[(&str, &Stage)]) -> Shown {
    let mut figure =
        Figure::new(Axis::new("x error", "m"), Axis::new("y error", "m")).equal_aspect().height(460);
    for (series, (name, stage)) in stages.iter().enumerate() {
        let colour = Colour::Series(series);
        let directions = [
            ("clockwise", &stage.clockwise, "circle"),
            ("counter-clockwise", &stage.counter_clockwise, "diamond"),
        ];
        for (direction, centre, symbol) in directions {
            let [x, y] = columns(&centre.errors_m);
            let label = format!("{name}, {direction}");
            figure = figure.trace(Trace::markers(&label, &x, &y, colour, symbol, 7.0).opacity(0.7));
            let [x, y] = centre.centre_m;
            let label = format!("centre of gravity, {label}");
            figure = figure.trace(Trace::markers(&label, &[x], &[y], colour, "x", 12.0).unlisted());
        }
    }
    let caption = "Return errors (truth minus odometry, in the frame of the start), with the centre of gravity of each \
                   direction as a cross. What is systematic moves a whole cluster, what is not widens it.";
    Shown::Figure(figure, caption.to_owned())
}

/// The stages in figures.
pub fn stages(stages: &[(&str, &Stage)]) -> Shown {
    let mut table = Table::new(
        "Centres of gravity of the return errors, of clockwise (cw) and counter-clockwise (ccw) runs; how much single runs scatter \
         about them; and the greater of the distances of both centres from the start.",
        ["", "x_cg cw (m)", "y_cg cw (m)", "x_cg ccw (m)", "y_cg ccw (m)", "spread (m)", "E_max,syst (m)"],
    )
    .numeric();
    for (name, stage) in stages {
        let ([x_cw, y_cw], [x_ccw, y_ccw]) = (stage.clockwise.centre_m, stage.counter_clockwise.centre_m);
        let spread = f64::midpoint(stage.clockwise.spread_m, stage.counter_clockwise.spread_m);
        let cells = [x_cw, y_cw, x_ccw, y_ccw, spread, stage.e_max_syst_m].map(|value| format!("{value:.4}"));
        table = table.row(std::iter::once((*name).to_owned()).chain(cells));
    }
    Shown::Table(table)
}

/// What the first stage says of the wheels: by how much corners are turned short, how much sides bend, and how well the
/// two pairs of components that each angle comes from agree.
pub fn angles(calibration: &Umbmark) -> Shown {
    let angles = &calibration.angles;
    let half = angles.half_interval_rad.map_or(String::new(), |half| format!(" +- {:.3}", half.to_degrees()));
    let row = |name: &str, angle_rad: f64, [x, y]: [f64; 2]| {
        let degrees = |angle_rad: f64| format!("{:.3}", angle_rad.to_degrees());
        [name.to_owned(), format!("{}{half}", degrees(angle_rad)), degrees(x), degrees(y)]
    };
    let caption = format!(
        "What the centres before the correction say of the wheels: both angles, and each from its x and y components \
         alone. Where these disagree, errors of another kind act. The sides have a radius of {:.1} m.",
        calibration.radius_m
    );
    Shown::Table(
        Table::new(caption, ["angle", "mean of both (deg)", "from x (deg)", "from y (deg)"])
            .numeric()
            .row(row("alpha: a corner is turned short by", angles.alpha_rad, angles.alpha_of_pairs_rad))
            .row(row("beta: a side bends left by", angles.beta_rad, angles.beta_of_pairs_rad)),
    )
}

/// The square that one direction masks, and its figure.
pub fn masked() -> [Shown; 2] {
    let (track_m, side_m, e_d) = MASKED;
    let e_b = masking_track(e_d, track_m, side_m, Turning::CounterClockwise);
    let errors = WheelErrors { e_d, e_b, e_s: 1.0 };
    let ends = masked_ends_m();
    let prose = format!(
        "Why one direction is not enough: a robot with E_d = {e_d} and nominal track {track_m} m whose actual track is \
         {e_b:.4} of it comes home within {:.1} mm on a {side_m} m square counter-clockwise, with both errors there: sides \
         bend left by as much as corners are short. Clockwise it misses its start by {:.2} m.",
        1e3 * ends[0],
        ends[1]
    );
    let mut figure = Figure::new(Axis::new("x", "m"), Axis::new("y", "m")).equal_aspect().height(460);
    for (series, turning) in DIRECTIONS.into_iter().enumerate() {
        let path = square_path(errors, track_m, side_m, turning, STEPS);
        let [x, y] = columns(&path);
        figure = figure.trace(Trace::path(&turning.to_string(), &x, &y, Colour::Series(series)));
        let ideal = square_path(WheelErrors::NONE, track_m, side_m, turning, 1);
        let [x, y] = columns(&ideal);
        let as_believed = Trace::path("as odometry has it", &x, &y, Colour::Muted).dash(Dash::Dot);
        figure = figure.trace(if series == 0 { as_believed } else { as_believed.unlisted() });
    }
    let caption = "The masked square, in closed form: true paths of the same robot in both directions.";
    [Shown::Prose(prose), Shown::Figure(figure, caption.to_owned())]
}

/// By how far the masked square misses its start: counter-clockwise and clockwise, metres.
pub(super) fn masked_ends_m() -> [f64; 2] {
    let (track_m, side_m, e_d) = MASKED;
    // The published track, of four decimals.
    let errors = WheelErrors { e_d, e_b: 1.0339, e_s: 1.0 };
    DIRECTIONS.map(|turning| {
        let end = square_end(errors, track_m, side_m, turning);
        end.x_m.hypot(end.y_m)
    })
}

/// Recovered over injected departures from 1, in per mille.
pub(super) fn recovered(drawn: &[(WheelErrors, WheelErrors)]) -> Shown {
    let of = |pick: fn(WheelErrors) -> f64| {
        let injected: Vec<f64> = drawn.iter().map(|(injected, _)| 1e3 * (pick(*injected) - 1.0)).collect();
        let found: Vec<f64> = drawn.iter().map(|(_, found)| 1e3 * (pick(*found) - 1.0)).collect();
        [injected, found]
    };
    let mut figure =
        Figure::new(Axis::new("injected, less 1", "1e-3"), Axis::new("recovered, less 1", "1e-3"));
    figure =
        figure.trace(Trace::line("equal", &[-30.0, 30.0], &[-30.0, 30.0], Colour::Muted).dash(Dash::Dot));
    let ratios: [(&str, Factor); 3] =
        [("E_d", |errors| errors.e_d), ("E_b", |errors| errors.e_b), ("E_s", |errors| errors.e_s)];
    for (series, (name, pick)) in ratios.into_iter().enumerate() {
        let [injected, found] = of(pick);
        figure = figure.trace(Trace::markers(name, &injected, &found, Colour::Series(series), "circle", 6.0));
    }
    Shown::Figure(
        figure,
        "Robots drawn at random, one procedure each: recovered against injected.".to_owned(),
    )
}

/// Picks one of the ratios.
type Factor = fn(WheelErrors) -> f64;

fn columns(points: &[[f64; 2]]) -> [Vec<f64>; 2] {
    [0, 1].map(|axis| points.iter().map(|point| point[axis]).collect())
}

/// What both directions scatter by, metres.
pub(super) fn spread_m([one, other]: [&Centre; 2]) -> f64 {
    f64::midpoint(one.spread_m.powi(2), other.spread_m.powi(2)).sqrt()
}
