//! From recordings to findings.

use std::collections::BTreeMap;

use pleiad_recording::Recording;

use crate::error::MismatchError;
use crate::findings::{Findings, Verdict};
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
    /// Names of the recordings to fit on; all if empty.
    pub fit_on: Vec<String>,
    /// Names of the recordings to test on; parts left out of the fit if empty.
    pub test_on: Vec<String>,
    /// How ground truth is used.
    pub truth: TruthUse,
}

/// Compares, locates, names, models.
///
/// # Errors
/// A recording that cannot be compared at all.
pub fn diagnose(recordings: &[Recording], options: &DiagnoseOptions) -> Result<Diagnosis, MismatchError> {
    let mut corrected = BTreeMap::new();
    for recording in recordings {
        let Some(nominal) = &recording.nominal else {
            return Err(MismatchError::NoNominal { recording: recording.name.clone() });
        };
        corrected.insert(recording.name.clone(), nominal.clone());
    }
    let findings = Findings {
        verdict: Verdict::Untestable,
        recordings: recordings.iter().map(|recording| recording.name.clone()).collect(),
        fit_on: options.fit_on.clone(),
        test_on: options.test_on.clone(),
        findings: Vec::new(),
        undetected: Vec::new(),
        untestable: Vec::new(),
        roll_outs: Vec::new(),
        notes: Vec::new(),
    };
    Ok(Diagnosis { findings, plots: Plots::default(), corrected })
}
