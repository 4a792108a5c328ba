//! What the fits of one effect say, parameter by parameter.

use std::f64::consts::PI;

use pleiad_estimation::geometry::wrap_angle;
use pleiad_mismatch::{Interval, KnownFit};
use pleiad_physics::{Effect, Parameter};
use serde_json::{Value, json};

use super::cases::{Case, has_size};

/// The size that the error of an onset is compared with, seconds: the length of a window of the body.
const ONSET_SIZE_S: f64 = 1.0;

/// The fits of one effect.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Which effect.
    pub effect: Effect,
    /// One per parameter that was injected.
    pub rows: Vec<Row>,
    /// How many recordings.
    pub seeds: usize,
    /// In how many of them the effect was found at all.
    pub found: usize,
}

/// One parameter over all seeds.
#[derive(Clone, Debug)]
pub struct Row {
    /// Its name.
    pub label: String,
    /// Its unit.
    pub unit: String,
    /// The value injected.
    pub truth: f64,
    /// The size that errors are compared with.
    pub size: f64,
    /// Of a label, how many seeds got it right; it has no errors.
    pub right: Option<usize>,
    /// Value minus truth, per seed with an interval.
    pub errors: Vec<f64>,
    /// Standard errors, likewise.
    pub sigmas: Vec<f64>,
    /// Of how many the interval holds the truth.
    pub covered: usize,
    /// Whether intervals are profiles.
    pub profile: bool,
}

impl Outcome {
    #[allow(clippy::float_cmp, reason = "the off value itself")]
    pub(super) fn new(case: &Case, fits: Vec<Option<KnownFit>>) -> Self {
        let seeds = fits.len();
        let fits: Vec<KnownFit> = fits.into_iter().flatten().collect();
        let parameters = case.effect.info().parameters.iter().zip(&case.values).enumerate();
        let rows = parameters
            .filter(|(_, (parameter, truth))| {
                // A shape is there whether or not it has its usual value; a size that is off was not injected.
                let is_shape = parameter.off != 0.0 && parameter.off.is_finite();
                !has_size(parameter.fit) || **truth != parameter.off || is_shape
            })
            .map(|(index, (parameter, truth))| Row::new(parameter, *truth, index, &fits))
            .collect();
        Self { effect: case.effect, rows, seeds, found: fits.len() }
    }

    /// Squared errors in standard errors, of all parameters.
    pub fn z_squares(&self) -> Vec<f64> {
        self.rows.iter().flat_map(Row::z_squares).collect()
    }

    /// To be kept in a file.
    pub fn to_json(&self) -> Value {
        let rows: Vec<Value> = self.rows.iter().map(Row::to_json).collect();
        json!({ "effect": self.effect.name(), "seeds": self.seeds, "found": self.found, "rows": rows })
    }

    /// What [`Outcome::to_json`] kept.
    pub fn from_json(kept: &Value) -> Option<Self> {
        Some(Self {
            effect: Effect::from_name(kept["effect"].as_str()?)?,
            rows: kept["rows"].as_array()?.iter().map(Row::from_json).collect::<Option<_>>()?,
            seeds: size(&kept["seeds"])?,
            found: size(&kept["found"])?,
        })
    }
}

fn size(kept: &Value) -> Option<usize> {
    usize::try_from(kept.as_u64()?).ok()
}

fn numbers(kept: &Value) -> Option<Vec<f64>> {
    kept.as_array()?.iter().map(Value::as_f64).collect()
}

impl Row {
    fn new(parameter: &Parameter, truth: f64, index: usize, fits: &[KnownFit]) -> Self {
        let mut row = Self {
            label: parameter.label(),
            unit: parameter.unit.to_owned(),
            truth,
            size: if parameter.name == "t_on_s" { ONSET_SIZE_S } else { truth.abs() },
            right: None,
            errors: Vec::new(),
            sigmas: Vec::new(),
            covered: 0,
            profile: false,
        };
        let found = fits.iter().filter_map(|fit| fit.parameters.get(index));
        if !has_size(parameter.fit) {
            row.right = Some(found.filter(|found| (found.value - truth).abs() < 0.5).count());
            return row;
        }
        for found in found {
            let (Some(sigma), Some([low, high])) = (found.standard_error, found.ci95) else { continue };
            // An angle is right by whole turns too.
            let turned = wrapped(parameter, found.value - truth);
            let shift = turned - (found.value - truth);
            row.errors.push(turned);
            row.sigmas.push(sigma);
            row.covered += usize::from((low + shift..=high + shift).contains(&truth));
            row.profile = found.interval == Interval::Profile;
        }
        row
    }

    fn to_json(&self) -> Value {
        json!({
            "label": self.label,
            "unit": self.unit,
            "truth": self.truth,
            "size": self.size,
            "right": self.right,
            "errors": self.errors,
            "sigmas": self.sigmas,
            "covered": self.covered,
            "profile": self.profile,
        })
    }

    fn from_json(kept: &Value) -> Option<Self> {
        Some(Self {
            label: kept["label"].as_str()?.to_owned(),
            unit: kept["unit"].as_str()?.to_owned(),
            truth: kept["truth"].as_f64()?,
            size: kept["size"].as_f64()?,
            right: size(&kept["right"]),
            errors: numbers(&kept["errors"])?,
            sigmas: numbers(&kept["sigmas"])?,
            covered: size(&kept["covered"])?,
            profile: kept["profile"].as_bool()?,
        })
    }

    /// The root mean square of the standard errors.
    pub fn sigma(&self) -> f64 {
        (mean(self.sigmas.iter().map(|sigma| sigma * sigma))).sqrt()
    }

    /// The mean of the errors.
    pub fn bias(&self) -> f64 {
        mean(self.errors.iter().copied())
    }

    /// Squared errors in standard errors.
    pub fn z_squares(&self) -> Vec<f64> {
        self.errors.iter().zip(&self.sigmas).map(|(error, sigma)| (error / sigma).powi(2)).collect()
    }
}

/// A difference of angles, the nearest of those that are the same; any other difference as it is.
fn wrapped(parameter: &Parameter, difference: f64) -> f64 {
    let period = parameter.plausible.1 - parameter.plausible.0;
    match parameter.unit {
        "rad" if period > 2.0 * PI => wrap_angle(difference),
        "rad" if period > PI => 0.5 * wrap_angle(2.0 * difference),
        _ => difference,
    }
}

/// The mean; NaN of none.
pub(super) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    sum / f64::from(count)
}
