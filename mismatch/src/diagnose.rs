//! From recordings to findings.

use std::collections::BTreeMap;

use pleiad_physics::Effect;
use pleiad_recording::Recording;

use crate::diagnosis;
use crate::end_points;
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
    /// Whether sightings of landmarks are left out.
    pub without_landmarks: bool,
    /// Effects that are not tried, as if the catalogue did not have them.
    pub leave_out: Vec<Effect>,
    /// Parts of the diagnosis that are left away.
    pub without: Without,
}

/// Parts of the diagnosis that can be left away, to see what they are worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Without {
    /// Errors count as independent from row to row, not correlated within blocks of time.
    pub blocks: bool,
    /// Effects that begin at some time or act in some place only are not looked for.
    pub scans: bool,
    /// A finding has no rivals.
    pub sets: bool,
}

/// Compares, locates, names, models.
///
/// # Errors
/// There is no recording to fit on; a recording has no nominal model, or one that lacks a robot; without
/// ground truth nobody knows where a robot began, or a prediction is no finite number.
pub fn diagnose(recordings: &[Recording], options: &DiagnoseOptions) -> Result<Diagnosis, MismatchError> {
    let mut diagnosis = diagnosis::run(recordings, options)?;
    end_points::add(recordings, options, &mut diagnosis)?;
    Ok(diagnosis)
}
