//! From return errors to ratios of wheels.

use pleiad_estimation::geometry::Vector2;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::error::UmbmarkError;
use super::factors::{WheelErrors, WheelFactors};
use super::run::{Kind, Run, Turning};

/// Squares of one calibration have sides that agree to this share.
const SIDES_WITHIN: f64 = 0.1;
/// The formulas are of the first order: beyond this, radians, their error is as large as what they correct.
const LARGEST_ANGLE_RAD: f64 = 0.35;

/// A value with its 95 % interval, which is absent where the runs give none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// The value.
    pub value: f64,
    /// Its 95 % interval.
    pub ci95: Option<[f64; 2]>,
}

/// Return errors of one direction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Centre {
    /// Return errors, truth minus odometry, in the frame of the start: metres.
    pub errors_m: Vec<[f64; 2]>,
    /// Their centre of gravity, metres.
    pub centre_m: [f64; 2],
    /// Its distance from the start, metres.
    pub r_cg_m: f64,
    /// Standard deviation of one run per axis, metres: what is not systematic. 0 for one run.
    pub spread_m: f64,
}

/// Both directions under one set of factors.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stage {
    /// `E_max,syst`: the larger of the distances of the centres of gravity, metres.
    pub e_max_syst_m: f64,
    /// Clockwise.
    pub clockwise: Centre,
    /// Counter-clockwise.
    pub counter_clockwise: Centre,
}

/// `alpha` and `beta` of both pairs of components, radians.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Angles {
    /// Corners are turned short by this: the mean of both pairs.
    pub alpha_rad: f64,
    /// Sides bend left by this: the mean of both pairs.
    pub beta_rad: f64,
    /// `(x_cw + x_ccw) / (-4 L)` and `(y_cw - y_ccw) / (-4 L)`.
    pub alpha_of_pairs_rad: [f64; 2],
    /// `(x_cw - x_ccw) / (-4 L)` and `(y_cw + y_ccw) / (-4 L)`.
    pub beta_of_pairs_rad: [f64; 2],
    /// By how much the pairs disagree: the larger of the two differences. Errors of another kind than wrong wheels and
    /// track, and errors of second order, show here.
    pub disagreement_rad: f64,
    /// Half of the 95 % interval of `alpha` and of `beta`, which is the same; absent with fewer than two runs a direction.
    pub half_interval_rad: Option<f64>,
}

/// A calibration.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Umbmark {
    /// Length of a side by odometry, metres.
    pub side_m: f64,
    /// Nominal track (that of the turns, for skid steer), metres.
    pub nominal_track_m: f64,
    /// Return errors of the runs it was made of.
    pub before: Stage,
    /// Angles of corners and sides.
    pub angles: Angles,
    /// Radius of the circle on which the middle of the axle drives a side, metres: positive to the left.
    pub radius_m: f64,
    /// `E_d`.
    pub e_d: Interval,
    /// `E_b`. Without a straight run that of a robot whose mean diameter is nominal.
    pub e_b: Interval,
    /// `E_s`, from straight runs; absent without one, because neither squares nor turns on the spot show it.
    pub e_s: Option<Interval>,
    /// True over reckoned angle of turns on the spot: `E_s / E_b` by another way; absent without a turn.
    pub turn_ratio: Option<Interval>,
    /// `c_L`, `c_R` and `E_b` with `E_s` in them: what the nominal robot is multiplied by.
    pub factors: WheelFactors,
}

/// The return error of a square, truth minus odometry, in the frame of the start, metres.
pub fn return_error(run: &Run, factors: WheelFactors) -> [f64; 2] {
    let (truth, reckoned) = (run.truth(), run.reckoned(factors).pose);
    [truth.x_m() - reckoned.x_m, truth.y_m() - reckoned.y_m]
}

/// Return errors of squares of both directions under these factors.
///
/// # Errors
/// [`UmbmarkError::NoSquare`], [`UmbmarkError::OneDirection`].
pub fn stage(runs: &[Run], factors: WheelFactors) -> Result<Stage, UmbmarkError> {
    let of = |wanted: Turning| {
        let squares =
            runs.iter().filter(|run| matches!(run.kind, Kind::Square { turning, .. } if turning == wanted));
        Centre::of(squares.map(|run| return_error(run, factors)).collect())
    };
    match (of(Turning::Clockwise), of(Turning::CounterClockwise)) {
        (Some(clockwise), Some(counter_clockwise)) => Ok(Stage {
            e_max_syst_m: clockwise.r_cg_m.max(counter_clockwise.r_cg_m),
            clockwise,
            counter_clockwise,
        }),
        (None, None) => Err(UmbmarkError::NoSquare { runs: runs.len() }),
        (Some(only), None) => Err(one_direction(&only, Turning::Clockwise)),
        (None, Some(only)) => Err(one_direction(&only, Turning::CounterClockwise)),
    }
}

fn one_direction(only: &Centre, turning: Turning) -> UmbmarkError {
    UmbmarkError::OneDirection { runs: only.errors_m.len(), turning, other: turning.other() }
}

impl Centre {
    fn of(errors_m: Vec<[f64; 2]>) -> Option<Self> {
        let count = errors_m.len() as f64;
        let sum: Vector2 = errors_m.iter().map(|&[x, y]| Vector2::new(x, y)).sum();
        let centre = (!errors_m.is_empty()).then(|| sum / count)?;
        let squares: f64 = errors_m.iter().map(|&[x, y]| (Vector2::new(x, y) - centre).norm_squared()).sum();
        let spread_m = if count > 1.0 { (0.5 * squares / (count - 1.0)).sqrt() } else { 0.0 };
        Some(Self { errors_m, centre_m: [centre.x, centre.y], r_cg_m: centre.norm(), spread_m })
    }
}

/// Calibrates on runs of one robot under the factors `known` that it is believed to have; the result is in place of
/// them.
///
/// # Errors
/// Squares of one direction alone, of different sizes, or errors beyond what the formulas are for.
pub fn calibrate(runs: &[Run], known: WheelFactors) -> Result<Umbmark, UmbmarkError> {
    let before = stage(runs, known)?;
    let (side_m, nominal_track_m) = sides(runs)?;
    let straight: Vec<f64> = runs.iter().filter_map(|run| scale(run, known)).collect();
    let e_s = Interval::of(&straight);
    let scale = e_s.map_or(1.0, |e_s| e_s.value);
    // Sides are as much longer as wheels are larger.
    let angles = Angles::of(&before, side_m * scale);
    if !(angles.alpha_rad.abs() < LARGEST_ANGLE_RAD && angles.beta_rad.abs() < LARGEST_ANGLE_RAD) {
        return Err(UmbmarkError::TooLarge {
            alpha_deg: angles.alpha_rad.to_degrees(),
            beta_deg: angles.beta_rad.to_degrees(),
        });
    }
    let believed_track_m = nominal_track_m * known.track;
    let errors = |alpha_rad: f64, beta_rad: f64| {
        WheelErrors::from_angles(alpha_rad, beta_rad, side_m * scale, believed_track_m).with_scale(scale)
    };
    let found = errors(angles.alpha_rad, angles.beta_rad);
    let factors = found.factors().upon(known);
    let whole = factors.errors();
    let around = |of: fn(WheelErrors) -> f64, half: f64, [alpha, beta]: [f64; 2]| {
        let end = |sign: f64| {
            let errors = errors(angles.alpha_rad + sign * half * alpha, angles.beta_rad + sign * half * beta);
            of(errors.factors().upon(known).errors())
        };
        [end(-1.0), end(1.0)]
    };
    let half = angles.half_interval_rad;
    // The interval of E_b has that of the scale in it; both are small.
    let scale_spread = e_s.and_then(|e_s| e_s.ci95).map_or(0.0, |[low, high]| 0.5 * (high - low) / scale);
    let e_b_ci95 = half.map(|half| {
        let [low, high] = around(|errors| errors.e_b, half, [1.0, 0.0]);
        let half = (0.5 * (high - low)).hypot(scale_spread * whole.e_b);
        [whole.e_b - half, whole.e_b + half]
    });
    let turn: Vec<f64> = runs.iter().filter_map(|run| turn_ratio(run, known)).collect();
    Ok(Umbmark {
        side_m,
        nominal_track_m,
        radius_m: 0.5 * side_m * scale / (0.5 * angles.beta_rad).sin(),
        e_d: Interval {
            value: whole.e_d,
            ci95: half.map(|half| around(|errors| errors.e_d, half, [0.0, 1.0])),
        },
        e_b: Interval { value: whole.e_b, ci95: e_b_ci95 },
        e_s: e_s.map(|e_s| e_s.times(whole.e_s / scale)),
        turn_ratio: Interval::of(&turn),
        factors,
        angles,
        before,
    })
}

/// The stage after correction of runs that also have to give the correction: each pair of runs is judged by the
/// calibration on all others. With one run a direction it is judged by itself; the flag says so.
///
/// # Errors
/// As [`calibrate`].
pub fn left_out(runs: &[Run], known: WheelFactors) -> Result<(Stage, bool), UmbmarkError> {
    let squares = |wanted: Turning| {
        let has = |run: &Run| matches!(run.kind, Kind::Square { turning, .. } if turning == wanted);
        (0..runs.len()).filter(|&index| has(&runs[index])).collect::<Vec<_>>()
    };
    let [clockwise, counter] = [Turning::Clockwise, Turning::CounterClockwise].map(squares);
    if clockwise.len() < 2 || counter.len() < 2 {
        return Ok((stage(runs, calibrate(runs, known)?.factors)?, false));
    }
    let mut errors = [Vec::new(), Vec::new()];
    for round in 0..clockwise.len().max(counter.len()) {
        let out = [&clockwise, &counter].map(|own| own[round % own.len()]);
        let rest = (0..runs.len()).filter(|index| !out.contains(index));
        let rest: Vec<Run> = rest.map(|index| runs[index].clone()).collect();
        let factors = calibrate(&rest, known)?.factors;
        for ((errors, own), out) in errors.iter_mut().zip([&clockwise, &counter]).zip(out) {
            if round < own.len() {
                errors.push(return_error(&runs[out], factors));
            }
        }
    }
    let [clockwise, counter] = errors.map(Centre::of);
    let (Some(clockwise), Some(counter_clockwise)) = (clockwise, counter) else {
        return Err(UmbmarkError::NoSquare { runs: runs.len() });
    };
    let e_max_syst_m = clockwise.r_cg_m.max(counter_clockwise.r_cg_m);
    Ok((Stage { e_max_syst_m, clockwise, counter_clockwise }, true))
}

/// The side of the squares and the nominal track.
fn sides(runs: &[Run]) -> Result<(f64, f64), UmbmarkError> {
    let squares: Vec<(&Run, f64)> = runs
        .iter()
        .filter_map(|run| if let Kind::Square { side_m, .. } = run.kind { Some((run, side_m)) } else { None })
        .collect();
    let Some((first, first_m)) = squares.first() else {
        return Err(UmbmarkError::NoSquare { runs: runs.len() });
    };
    if let Some((run, side_m)) =
        squares.iter().find(|(_, side_m)| (side_m - first_m).abs() > SIDES_WITHIN * first_m)
    {
        return Err(UmbmarkError::Sides {
            recording: run.recording.clone(),
            side_m: *side_m,
            other: first.recording.clone(),
            other_m: *first_m,
        });
    }
    let side_m = squares.iter().map(|(_, side_m)| side_m).sum::<f64>() / squares.len() as f64;
    let ratio = match first.model.drive {
        pleiad_physics::Drive::SkidSteer { track_ratio } => track_ratio,
        _ => 1.0,
    };
    Ok((side_m, first.model.nominal.track_width * ratio))
}

/// True over reckoned length of a straight run.
fn scale(run: &Run, known: WheelFactors) -> Option<f64> {
    let Kind::Straight = run.kind else { return None };
    let (truth, reckoned) = (run.truth(), run.reckoned(known).pose);
    Some(truth.x_m().hypot(truth.y_m()) / reckoned.x_m.hypot(reckoned.y_m))
}

/// True over reckoned angle of a turn on the spot.
fn turn_ratio(run: &Run, known: WheelFactors) -> Option<f64> {
    let reckoned_rad = run.reckoned(known).pose.yaw_rad;
    Some(run.turned_rad(reckoned_rad)? / reckoned_rad)
}

impl Angles {
    /// From centres of gravity with sides of `side_m`.
    fn of(stage: &Stage, side_m: f64) -> Self {
        let ([x_cw, y_cw], [x_ccw, y_ccw]) = (stage.clockwise.centre_m, stage.counter_clockwise.centre_m);
        let by = -4.0 * side_m;
        let alpha = [(x_cw + x_ccw) / by, (y_cw - y_ccw) / by];
        let beta = [(x_cw - x_ccw) / by, (y_cw + y_ccw) / by];
        // The means are combinations of x + y of clockwise runs and x - y of the others, so that the spread of these says
        // how sure they are, with whatever correlation x and y have.
        let sums = |centre: &Centre, sign: f64| {
            let values: Vec<f64> = centre.errors_m.iter().map(|[x, y]| x + sign * y).collect();
            Spread::of(&values)
        };
        let half = match (sums(&stage.clockwise, 1.0), sums(&stage.counter_clockwise, -1.0)) {
            (Some(clockwise), Some(counter)) => {
                clockwise.half_of_sum(&counter).map(|half| half / (8.0 * side_m))
            }
            _ => None,
        };
        Self {
            alpha_rad: f64::midpoint(alpha[0], alpha[1]),
            beta_rad: f64::midpoint(beta[0], beta[1]),
            disagreement_rad: (alpha[0] - alpha[1]).abs().max((beta[0] - beta[1]).abs()),
            alpha_of_pairs_rad: alpha,
            beta_of_pairs_rad: beta,
            half_interval_rad: half,
        }
    }
}

/// Sum of squares about the mean, and count.
struct Spread {
    squares: f64,
    count: f64,
}

impl Spread {
    fn of(values: &[f64]) -> Option<Self> {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares = values.iter().map(|value| (value - mean).powi(2)).sum();
        (count > 1.5).then_some(Self { squares, count })
    }

    /// Half of the 95 % interval of a sum of two means with one spread.
    fn half_of_sum(&self, other: &Self) -> Option<f64> {
        let degrees = self.count + other.count - 2.0;
        let variance = (self.squares + other.squares) / degrees * (1.0 / self.count + 1.0 / other.count);
        Some(StudentsT::new(0.0, 1.0, degrees).ok()?.inverse_cdf(0.975) * variance.sqrt())
    }
}

impl Interval {
    /// The mean of runs; `None` of none.
    fn of(values: &[f64]) -> Option<Self> {
        let count = values.len() as f64;
        let value = (!values.is_empty()).then(|| values.iter().sum::<f64>() / count)?;
        let ci95 = Spread::of(values).and_then(|spread| {
            let variance = spread.squares / (count - 1.0) / count;
            let half = StudentsT::new(0.0, 1.0, count - 1.0).ok()?.inverse_cdf(0.975) * variance.sqrt();
            Some([value - half, value + half])
        });
        Some(Self { value, ci95 })
    }

    fn times(self, factor: f64) -> Self {
        Self { value: self.value * factor, ci95: self.ci95.map(|ends| ends.map(|end| end * factor)) }
    }
}
