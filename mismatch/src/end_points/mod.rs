//! What end points alone tell of wheels and axle.
//!
//! Where the reference system saw a robot only here and there (a tape measure at the start and the end of a square), no
//! window of time can be compared. What is left is the way from one reference pose to the next, three numbers each, and
//! of the catalogue what every wheeled robot has a little of: wheel radius, unequal wheels, track width. Driven one way
//! round, two of them can bring the robot back to where it started (`borenstein1996`): the end point then says that all
//! is well. So the first question is not what the residuals are but what they could not show: the directions of the
//! information matrix along which errors of several times their relevance change no end point by more than its noise.

mod path;
mod ways;

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use pleiad_estimation::RobotId;
use pleiad_physics::{ActiveEffect, Effect};
use pleiad_recording::{DeclaredEffect, Recording};

use crate::channel::Channel;
use crate::diagnose::{DiagnoseOptions, Diagnosis, TruthUse};
use crate::diagnosis::{familywise, section, upper_tail};
use crate::end_points::path::advice;
use crate::end_points::ways::{Case, mirror};
use crate::error::MismatchError;
use crate::findings::{Estimate, Finding, HeldOut, Place, Verdict};

/// Reference poses farther apart than this on average are end points, seconds.
const SPARSE_S: f64 = 2.0;
/// What shows in end points. A closed path of any size closes: the mean radius of the wheels shows only on one that does
/// not close, and is otherwise what is declared, as in UMBmark.
const SHAPE: [Effect; 2] = [Effect::UnequalWheelRadii, Effect::TrackWidthError];
const ALL: [Effect; 3] = [Effect::UnequalWheelRadii, Effect::TrackWidthError, Effect::WheelRadiusError];
/// Errors of so many times their relevance must show by so many sigmas.
const TIMES: f64 = 3.0;
const SIGMAS: f64 = 3.0;
/// An effect is part of a direction from this share of its largest component on.
const PART: f64 = 0.2;
/// Half the width of a 95 % interval, in standard errors.
const Z_95: f64 = 1.959_963_984_540_054;
/// Residuals of a way: forward, left, yaw.
const WAY: usize = 3;
/// Iterations of Gauss and Newton; end points are nearly linear in errors of a few percent.
const ITERATIONS: usize = 6;

/// Adds to a diagnosis what the end points of robots tell of which no more is known.
///
/// # Errors
/// A recording has no nominal model.
pub(crate) fn add(
    recordings: &[Recording],
    options: &DiagnoseOptions,
    diagnosis: &mut Diagnosis,
) -> Result<(), MismatchError> {
    if options.truth == TruthUse::No {
        return Ok(());
    }
    let fitted: Vec<&Recording> =
        recordings.iter().filter(|own| diagnosis.findings.fit_on.contains(&own.name)).collect();
    let mut robots: Vec<RobotId> = fitted.iter().flat_map(|own| own.robots.keys().copied()).collect();
    robots.sort_unstable();
    robots.dedup();
    for robot in robots {
        let sparse: Vec<&Recording> = fitted.iter().copied().filter(|own| is_sparse(own, robot)).collect();
        // Where time series of the same robot were recorded too, they say more.
        let dense = fitted.iter().any(|own| has_truth(own, robot) && !is_sparse(own, robot));
        if sparse.is_empty() || dense {
            continue;
        }
        if let Some(mut findings) = of_robot(&sparse, robot)? {
            findings.leave(&diagnosis.findings.findings, robot);
            told(&findings, robot, diagnosis);
        }
    }
    Ok(())
}

/// Whether reference poses are so far apart that they are end points.
fn is_sparse(recording: &Recording, robot: RobotId) -> bool {
    let Some(own) = recording.robots.get(&robot) else { return false };
    let [first, .., last] = own.truth.as_slice() else { return false };
    let gaps = own.truth.len().saturating_sub(1);
    last.time.seconds_since(first.time) > SPARSE_S * gaps as f64
}

fn has_truth(recording: &Recording, robot: RobotId) -> bool {
    recording.robots.get(&robot).is_some_and(|own| own.truth.len() > 1)
}

/// What is said of a robot.
struct Told {
    named: Vec<(Effect, f64, f64)>,
    p: f64,
    /// Effects that hide one another, each with the largest size that could be hidden.
    hidden: Vec<(Effect, f64)>,
    manoeuvre: String,
    /// Log score gained on ways left out, with its standard error.
    gain: (f64, f64),
    /// The mean radius of the wheels showed as well.
    scaled: bool,
}

impl Told {
    /// Leaves to other findings what they name: a gyro may have told the track already, and nothing is corrected twice.
    fn leave(&mut self, found: &[Finding], robot: RobotId) {
        let known = |effect: Effect| {
            found.iter().any(|own| {
                own.verdict == Verdict::Named
                    && own.effect.as_deref() == Some(effect.name())
                    && own.robots.contains(&robot.0)
            })
        };
        self.named.retain(|(effect, ..)| !known(*effect));
        self.hidden.retain(|(effect, _)| !known(*effect));
        // What is known does not make up for anything.
        if self.hidden.len() == 1 {
            self.hidden.clear();
        }
    }
}

fn of_robot(recordings: &[&Recording], robot: RobotId) -> Result<Option<Told>, MismatchError> {
    let mut cases: Vec<Case<'_>> = Vec::new();
    for recording in recordings {
        cases.extend(Case::of(recording, robot)?);
    }
    let Some(first) = cases.first() else { return Ok(None) };
    let whole = Normal::new(&cases, &ALL, &DVector::zeros(ALL.len()));
    let effects: &[Effect] = if whole.hides().is_empty() { &ALL } else { &SHAPE };
    let start = Normal::new(&cases, effects, &DVector::zeros(effects.len()));
    if start.rows == 0 {
        return Ok(None);
    }
    let hidden = start.hides();
    if hidden.is_empty() {
        return Ok(fitted(&cases, effects, &start));
    }
    let mut both = start;
    for recording in recordings {
        let other = mirror(recording, robot);
        let cases: Vec<Case<'_>> = Case::of(&other, robot)?.into_iter().collect();
        both.information += Normal::new(&cases, effects, &DVector::zeros(effects.len())).information;
    }
    let manoeuvre = advice(&first.steps, both.hides().is_empty());
    Ok(Some(Told { named: Vec::new(), p: 1.0, hidden, manoeuvre, gain: (0.0, 0.0), scaled: false }))
}

/// The normal equations of all ways, errors in units of their relevance.
struct Normal<'e> {
    effects: &'e [Effect],
    thresholds: DVector<f64>,
    information: DMatrix<f64>,
    gradient: DVector<f64>,
    /// Sum of squared residuals.
    square: f64,
    rows: usize,
}

impl<'e> Normal<'e> {
    fn new(cases: &[Case<'_>], effects: &'e [Effect], errors: &DVector<f64>) -> Self {
        let floors = cases.first().map(|case| case.floors).unwrap_or_default();
        let size = effects.len();
        let thresholds = DVector::from_fn(size, |index, _| {
            effects[index].info().parameters[0].relevance.threshold(&floors)
        });
        let (information, gradient) = (DMatrix::zeros(size, size), DVector::zeros(size));
        let mut own = Self { effects, thresholds, information, gradient, square: 0.0, rows: 0 };
        for ways in cases.iter().filter_map(|case| case.ways(effects, errors)) {
            let columns = ways.columns * DMatrix::from_diagonal(&own.thresholds);
            own.information += columns.transpose() * &columns;
            own.gradient += columns.transpose() * &ways.residuals;
            own.square += ways.residuals.norm_squared();
            own.rows += ways.residuals.len();
        }
        own
    }

    /// Effects of which errors of several times their relevance, together, show in no end point; each with the largest
    /// size that would not.
    fn hides(&self) -> Vec<(Effect, f64)> {
        let eigen = SymmetricEigen::new(self.information.clone());
        let mut hidden: Vec<(Effect, f64)> = Vec::new();
        for (index, value) in eigen.eigenvalues.iter().enumerate() {
            let sigmas = value.max(0.0).sqrt();
            if TIMES * sigmas >= SIGMAS {
                continue;
            }
            let direction = eigen.eigenvectors.column(index);
            let part = PART * direction.amax();
            for (position, &effect) in self.effects.iter().enumerate() {
                if direction[position].abs() < part {
                    continue;
                }
                let most = effect.info().parameters[0].plausible.1;
                let reach = SIGMAS / sigmas.max(f64::MIN_POSITIVE);
                let size = (reach * direction[position].abs() * self.thresholds[position]).min(most);
                match hidden.iter_mut().find(|own| own.0 == effect) {
                    Some(own) => own.1 = own.1.max(size),
                    None => hidden.push((effect, size)),
                }
            }
        }
        hidden
    }
}

/// What the errors are, where all of them show.
fn fitted(cases: &[Case<'_>], effects: &[Effect], start: &Normal<'_>) -> Option<Told> {
    let size = effects.len();
    let mut values = DVector::zeros(size);
    for _ in 0..ITERATIONS {
        let normal = Normal::new(cases, effects, &values);
        let step = normal.information.cholesky()?.solve(&normal.gradient);
        values += step.component_mul(&normal.thresholds);
    }
    let end = Normal::new(cases, effects, &values);
    let covariance = end.information.clone().cholesky()?.inverse();
    // The declared noise may be too small: what is left says.
    let scale = (end.square / end.rows.saturating_sub(size).max(1) as f64).max(1.0);
    let gain = (start.square - end.square) / scale;
    let p = familywise(upper_tail(gain, size) * size as f64)?;
    let error = |index: usize| (scale * covariance[(index, index)]).sqrt() * end.thresholds[index];
    let relevant = |index: &usize| values[*index].abs() - SIGMAS * error(*index) > end.thresholds[*index];
    let named: Vec<(Effect, f64, f64)> =
        (0..size).filter(relevant).map(|index| (effects[index], values[index], error(index))).collect();
    let (hidden, manoeuvre) = (Vec::new(), String::new());
    let scaled = size == ALL.len();
    let gain = left_out(cases, &end, &values, scale);
    (!named.is_empty()).then_some(Told { named, p, hidden, manoeuvre, gain, scaled })
}

/// What is gained on each way by errors that were fitted to the others, over none: log score with its
/// standard error. Ways of one recording are alike; of two, one may be the way round that hides what the other shows.
fn left_out(cases: &[Case<'_>], end: &Normal<'_>, values: &DVector<f64>, scale: f64) -> (f64, f64) {
    let zero = DVector::zeros(values.len());
    let (mut total, mut variance) = (0.0, 0.0);
    for case in cases {
        let mut gains = Vec::new();
        let without = case.ways(end.effects, &zero);
        let Some((with, without)) = case.ways(end.effects, values).zip(without) else { continue };
        let columns = with.columns * DMatrix::from_diagonal(&end.thresholds);
        for first in (0..with.residuals.len()).step_by(WAY) {
            let (own, residuals) = (columns.rows(first, WAY), with.residuals.rows(first, WAY));
            // At the optimum of all ways the gradient of the others is that of this one, with the other sign.
            let others = end.information.clone() - own.transpose() * own;
            let Some(step) = others.cholesky().map(|others| others.solve(&(-own.transpose() * residuals)))
            else {
                continue;
            };
            let left = (residuals - own * step).norm_squared();
            gains.push(0.5 * (without.residuals.rows(first, WAY).norm_squared() - left) / scale);
        }
        let mean = gains.iter().sum::<f64>() / gains.len().max(1) as f64;
        total += gains.iter().sum::<f64>();
        variance += gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>();
    }
    (total, variance.sqrt())
}

/// Puts it into the diagnosis.
fn told(own: &Told, robot: RobotId, diagnosis: &mut Diagnosis) {
    if own.hidden.is_empty() && own.named.is_empty() {
        return;
    }
    let names = || own.hidden.iter().map(|(effect, _)| effect.name().to_owned()).collect::<Vec<_>>();
    let base = |effect: Effect, verdict: Verdict| Finding {
        verdict,
        robots: vec![robot.0],
        stage: effect.info().stage.name().to_owned(),
        channel: Channel::Body.name().to_owned(),
        effect: Some(effect.name().to_owned()),
        expression: None,
        expression_units: None,
        support_set: vec![effect.name().to_owned()],
        parameters: BTreeMap::new(),
        place: Place::default(),
        p_familywise: own.p.max(f64::MIN_POSITIVE),
        held_out: HeldOut { log_score_gain: own.gain.0, log_score_gain_se: own.gain.1, ..HeldOut::default() },
        shape: None,
        manoeuvre: None,
        summary: String::new(),
        equation: Some(effect.info().equation.to_owned()),
        configuration: String::new(),
    };
    if let [(first, _), ..] = own.hidden.as_slice() {
        let sizes: Vec<String> =
            own.hidden.iter().map(|(effect, size)| format!("{} up to {size:.2}", effect.name())).collect();
        let finding = Finding {
            support_set: names(),
            manoeuvre: Some(own.manoeuvre.clone()),
            summary: format!(
                "robot {robot}: end points alone cannot tell: errors that make up for one another ({}) bring the robot \
                 to the same places",
                sizes.join(", ")
            ),
            ..base(*first, Verdict::CannotTell)
        };
        diagnosis.findings.findings.push(finding);
    }
    for (effect, value, error) in &own.named {
        let parameter = &effect.info().parameters[0];
        let ci95 = [value - Z_95 * error, value + Z_95 * error];
        let estimate = Estimate { value: *value, unit: parameter.unit.to_owned(), ci95 };
        let mut finding = base(*effect, Verdict::Named);
        finding.parameters.insert(parameter.label(), estimate);
        if let Ok(active) = ActiveEffect::new(*effect, &[*value]) {
            let declared = DeclaredEffect { active, ci95: vec![Some(ci95)] };
            finding.configuration = section(robot.0, &declared);
            let own = diagnosis.corrected.values_mut().filter_map(|nominal| nominal.robots.get_mut(&robot));
            own.for_each(|own| own.effects.push(declared.clone()));
        }
        diagnosis.findings.findings.push(finding);
    }
    diagnosis.findings.notes.push(format!(
        "robot {robot}: reference poses are farther apart than {SPARSE_S:.0} s: its wheels and axle were judged by the way \
         from one to the next{}",
        if own.scaled { "" } else { "; paths that close do not show the mean radius of the wheels, which is taken as declared" }
    ));
    let strongest = if own.named.is_empty() { Verdict::CannotTell } else { Verdict::Named };
    let weaker = [Verdict::NothingMissing, Verdict::Untestable, Verdict::Form, Verdict::Unnameable];
    let verdict = &mut diagnosis.findings.verdict;
    if weaker.contains(verdict) || (strongest == Verdict::Named && *verdict == Verdict::CannotTell) {
        *verdict = strongest;
    }
}
