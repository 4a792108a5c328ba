//! From recordings to findings.

use std::collections::BTreeMap;

use pleiad_physics::Effect;
use pleiad_recording::Recording;

use crate::diagnosis;
use crate::error::MismatchError;
use crate::findings::Findings;
use crate::view::Plots;

/// What a diagnosis gives.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// What was found.
    pub findings: Findings,
    /// What to plot.
    pub plots: Plots,
    /// The nominal model with what was found, by recording.
    pub corrected: BTreeMap<String, pleiad_recording::Nominal>,
}

/// How ground truth is used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TruthUse {
    /// Where it was recorded.
    #[default]
    Auto,
    /// Not at all.
    No,
}

/// How to diagnose.
#[derive(Clone, Debug, Default)]
pub struct DiagnoseOptions {
    /// Names of the recordings to fit on; all that are not tested on if empty.
    pub fit_on: Vec<String>,
    /// Names of the recordings to test on; parts left out of the fit if empty.
    pub test_on: Vec<String>,
    /// How ground truth is used.
    pub truth: TruthUse,
    /// Effects of the catalogue that are not tried: what becomes of them without their names.
    pub without: Vec<Effect>,
}

/// Compares, locates, names, models.
///
/// # Errors
/// There is no recording to fit on; a recording has no nominal model, or one that lacks a robot; ground truth
/// is not to be used.
pub fn diagnose(recordings: &[Recording], options: &DiagnoseOptions) -> Result<Diagnosis, MismatchError> {
    diagnosis::run(recordings, options)
}
