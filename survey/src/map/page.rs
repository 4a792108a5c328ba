//! What was measured, as claims, figures and numbers.

use pleiad_mismatch::calibration::map::{Drift, MapCalibration};
use pleiad_report::{Axis, Colour, Dash, Figure, Table, Trace};
use serde_json::{Map, Value, json};

use super::NAME;
use super::trial::{DEFAULT_MU, GAMMAS, JUDGED, MU_MINS, SHORT_M, Trial, Window};
use crate::monte_carlo::Estimate;
use crate::study::{Claim, Shown, Study};

/// Mean errors of `a_trans`, and of `a_rot` in rad/m, may be this large: a tenth of the largest that is injected, and below
/// what odometry of a calibrated robot is known to.
const BOUND: f64 = 0.003;
const HALVES: [&str; 2] = ["before the change", "after it"];

type Pick = fn(&Drift) -> f64;
const ERRORS: [(&str, &str, Pick); 2] =
    [("a_trans", "", |drift| drift.trans), ("a_rot", " rad/m", |drift| drift.rot_rad_m)];

pub(super) fn study(trials: &[Trial]) -> Study {
    let mut claims = Vec::new();
    let mut numbers = Map::new();
    for half in 0..2 {
        claims.extend(recovery(trials, half, &mut numbers));
    }
    claims.push(extremes(trials));
    claims.extend(trade(trials, &mut numbers));
    thin(trials, &mut numbers);
    claims.extend(kept(trials, &mut numbers));
    let mut shown = Vec::new();
    if let Some(first) = trials.first() {
        shown.push(followed(&first.windows, &first.by_gamma, &GAMMAS));
        let last = first.by_gamma[JUDGED].estimate;
        numbers.insert("a_trans".into(), json!(last.trans));
        numbers.insert("a_rot_rad_m".into(), json!(last.rot_rad_m));
        numbers.insert(
            "injected".into(),
            first
                .windows
                .iter()
                .map(|window| json!({"time_s": window.time_s, "drift": window.injected}))
                .collect(),
        );
    }
    shown.push(Shown::Table(by_gamma(trials)));
    shown.push(Shown::Table(by_mu(trials)));
    Study {
        name: NAME,
        title: "Odometry calibrated against a map: maximum likelihood, stretch by stretch".to_owned(),
        lead: format!(
            "A robot with a range scanner drives through a room that is mapped. After every metre it takes the pair (a_trans, \
             a_rot) with which its local occupancy grid matches the map best, and moves its belief toward it (Hoseinnezhad, \
             Moshiri and Asharif 2003). It begins with wrong parameters, and half-way the truth changes. {} seeds.",
            trials.len()
        ),
        claims,
        shown,
        numbers,
    }
}

fn recovery(trials: &[Trial], half: usize, numbers: &mut Map<String, Value>) -> Vec<Claim> {
    let of = |(name, unit, pick): (&str, &str, Pick)| {
        let injected = pick(&trials.first()?.windows[half].injected);
        let errors: Option<Vec<f64>> =
            trials.iter().map(|trial| Some(pick(&trial.estimate(half, JUDGED)?) - injected)).collect();
        let error = Estimate::of(&errors?)?;
        numbers.insert(format!("{name}_error_{}", ["first_half", "second_half"][half]), json!(error));
        Some(Claim {
            statement: format!(
                "{name} = {injected:.3}{unit} {} is recovered with a mean error within {BOUND} (gamma {})",
                HALVES[half], GAMMAS[JUDGED]
            ),
            measured: format!(
                "mean error {:+.5}, interval {:+.5} to {:+.5}; one run scatters by {:.5}",
                error.mean, error.interval[0], error.interval[1], error.spread
            ),
            holds: error.interval.iter().all(|end| end.abs() <= BOUND),
        })
    };
    ERRORS.into_iter().filter_map(of).collect()
}

/// Gamma 1 and gamma 0, exactly.
fn extremes(trials: &[Trial]) -> Claim {
    let (first, last) = (0, GAMMAS.len() - 1);
    let still = |trial: &Trial| {
        let own = &trial.by_gamma[last].stretches;
        own.iter().all(|stretch| stretch.estimate == own[0].estimate)
    };
    let follows = |trial: &Trial| {
        let matched = trial.by_gamma[first].stretches.iter().filter(|stretch| stretch.best.is_some());
        let mut all = matched.peekable();
        all.peek().is_some() && all.all(|stretch| stretch.best == Some(stretch.estimate))
    };
    let (still, follows) = (
        trials.iter().filter(|trial| still(trial)).count(),
        trials.iter().filter(|trial| follows(trial)).count(),
    );
    Claim {
        statement: "gamma = 1 never adapts, gamma = 0 follows every step".to_owned(),
        measured: format!(
            "gamma = 1 in {still}, gamma = 0 in {follows} of {} runs, to the bit",
            trials.len()
        ),
        holds: still == trials.len() && follows == trials.len(),
    }
}

/// Root mean square departure from what was injected, in the last part of both halves.
fn rms(trial: &Trial, gamma: usize, pick: Pick) -> Option<f64> {
    let mut squares = Vec::new();
    for half in 0..2 {
        let injected = pick(&trial.windows[half].injected);
        let all = trial.last(half, gamma, |stretch| Some(stretch.estimate));
        squares.extend(all.iter().map(|drift| (pick(drift) - injected).powi(2)));
    }
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

fn trade(trials: &[Trial], numbers: &mut Map<String, Value>) -> Option<Claim> {
    let mut measured = Vec::new();
    let mut holds = true;
    for (name, _, pick) in ERRORS {
        let differences: Option<Vec<f64>> =
            trials.iter().map(|trial| Some(rms(trial, 0, pick)? - rms(trial, JUDGED, pick)?)).collect();
        let difference = Estimate::of(&differences?)?;
        numbers.insert(format!("{name}_rms_gamma_0_less_judged"), json!(difference));
        holds &= difference.interval[0] > 0.0;
        measured.push(format!(
            "{name} by {:.4} ({:.4} to {:.4})",
            difference.mean, difference.interval[0], difference.interval[1]
        ));
    }
    Some(Claim {
        statement: format!(
            "A single stretch is a noisy witness: once settled, gamma = 0 is farther from the truth than gamma = {}",
            GAMMAS[JUDGED]
        ),
        measured: format!("root mean square errors larger: {}", measured.join(", ")),
        holds,
    })
}

/// How much nearer to the truth `mu_min` keeps the pose where little is seen. A number, not a claim: beyond chance it
/// was on the seeds it was chosen on alone.
fn thin(trials: &[Trial], numbers: &mut Map<String, Value>) {
    let off = |trial: &Trial, index: usize| trial.by_mu[index].as_ref().map(|(_, off_m)| *off_m);
    let saved: Option<Vec<f64>> =
        trials.iter().map(|trial| Some(off(trial, 0)? - off(trial, DEFAULT_MU)?)).collect();
    numbers.insert("mu_min_saves_m".into(), json!(saved.and_then(|saved| Estimate::of(&saved))));
}

/// The pose, which comes with the calibration.
fn kept(trials: &[Trial], numbers: &mut Map<String, Value>) -> Option<Claim> {
    let of = |index: usize| Estimate::of(&trials.iter().map(|trial| trial.off_m[index]).collect::<Vec<_>>());
    let (matched, blind) = (of(0)?, of(1)?);
    numbers.insert("mean_distance_from_truth_m".into(), json!({"matched": matched, "odometry": blind}));
    Some(Claim {
        statement: "The pose that the best pairs predict stays at the truth, where odometry leaves it: within a cell on average"
            .to_owned(),
        measured: format!(
            "{:.3} m off ({:.3} to {:.3}), odometry alone {:.2} m ({:.2} to {:.2})",
            matched.mean, matched.interval[0], matched.interval[1], blind.mean, blind.interval[0], blind.interval[1]
        ),
        holds: matched.interval[1] < 0.1,
    })
}

fn by_gamma(trials: &[Trial]) -> Table {
    let mut table = Table::new(
        "Root mean square error of the belief in the last part of both halves, mean over the runs.",
        ["gamma", "a_trans", "a_rot (rad/m)"],
    )
    .numeric();
    for (index, gamma) in GAMMAS.into_iter().enumerate() {
        let mean = |pick: Pick| {
            let all: Option<Vec<f64>> = trials.iter().map(|trial| rms(trial, index, pick)).collect();
            all.map_or("-".to_owned(), |all| format!("{:.5}", all.iter().sum::<f64>() / all.len() as f64))
        };
        table = table.row([gamma.to_string(), mean(ERRORS[0].2), mean(ERRORS[1].2)]);
    }
    table
}

fn by_mu(trials: &[Trial]) -> Table {
    let mut table = Table::new(
        format!(
            "With a scanner of {SHORT_M} m: what mu_min leaves of the stretches, the distance from the truth, mean over the runs \
             and largest of their means, and the root mean square error of the belief in the last part of both halves."
        ),
        ["mu_min", "matched (%)", "off (m)", "worst run (m)", "a_trans", "a_rot (rad/m)"],
    )
    .numeric();
    for (index, mu_min) in MU_MINS.into_iter().enumerate() {
        let runs: Vec<(&Trial, &MapCalibration, f64)> = trials
            .iter()
            .filter_map(|trial| trial.by_mu[index].as_ref().map(|(found, off_m)| (trial, found, *off_m)))
            .collect();
        let (mut matched, mut stretches, mut settled, mut squares) = (0, 0, 0, [0.0; 2]);
        for (trial, found, _) in &runs {
            stretches += found.stretches.len();
            matched += found.stretches.iter().filter(|stretch| stretch.best.is_some()).count();
            for half in 0..2 {
                let injected = trial.windows[half].injected;
                for stretch in trial.settled(half, found) {
                    settled += 1;
                    squares[0] += (stretch.estimate.trans - injected.trans).powi(2);
                    squares[1] += (stretch.estimate.rot_rad_m - injected.rot_rad_m).powi(2);
                }
            }
        }
        let [trans, rot] = squares.map(|sum: f64| (sum / f64::from(settled)).sqrt());
        let off = runs.iter().map(|(_, _, off_m)| off_m).sum::<f64>() / runs.len() as f64;
        let worst = runs.iter().map(|(_, _, off_m)| *off_m).fold(f64::NAN, f64::max);
        let share = 100.0 * matched as f64 / stretches as f64;
        let cells = [(share, 1), (off, 2), (worst, 2), (trans, 4), (rot, 4)].map(|(value, digits)| {
            if value.is_finite() { format!("{value:.digits$}") } else { "-".to_owned() }
        });
        table = table.row(std::iter::once(mu_min.to_string()).chain(cells));
    }
    table
}

/// What is believed over the run, against what acted.
pub fn followed(windows: &[Window], calibrations: &[MapCalibration], gammas: &[f64]) -> Shown {
    let mut figure = Figure::new(Axis::new("time", "s"), Axis::new("a_trans", "-"))
        .row(Axis::new("a_rot", "rad/m"))
        .height(560);
    for (row, (_, _, pick)) in ERRORS.into_iter().enumerate() {
        for (series, (calibration, gamma)) in calibrations.iter().zip(gammas).enumerate() {
            let time: Vec<f64> = calibration.stretches.iter().map(|stretch| stretch.time_s).collect();
            let value: Vec<f64> =
                calibration.stretches.iter().map(|stretch| pick(&stretch.estimate)).collect();
            let name = format!("gamma {gamma}");
            let trace = Trace::step(&name, &time, &value, Colour::Series(series)).in_row(row).group(&name);
            figure = figure.trace(if row == 0 { trace } else { trace.unlisted() });
        }
        let time: Vec<f64> = windows.iter().flat_map(|window| window.time_s).collect();
        let value: Vec<f64> = windows.iter().flat_map(|window| [pick(&window.injected); 2]).collect();
        if !windows.is_empty() {
            let trace = Trace::line("injected", &time, &value, Colour::Ink).dash(Dash::Dash).in_row(row);
            figure = figure.trace(if row == 0 { trace } else { trace.unlisted() });
        }
    }
    let caption = "What is believed, stretch by stretch, for several gamma: from wrong parameters, and through the change.";
    Shown::Figure(figure, caption.to_owned())
}
