//! Moves an onset or the bounds of a region to where they gain most, by halving steps.

use crate::diagnosis::candidate::Candidate;
use crate::diagnosis::select::{Scored, score};
use crate::diagnosis::starts::Placing;
use crate::diagnosis::unit::Unit;
use crate::diagnosis::white::White;

/// Onsets are found to this, seconds.
const ONSET_STEP_S: f64 = 0.25;
/// First step of an onset, as a share of the recording.
const FIRST_ONSET_SHARE: f64 = 1.0 / 32.0;
/// Bounds are found to this, metres.
const BOUND_STEP_M: f64 = 0.05;

/// The candidate with its onset and region refined; others are given back as they are.
pub(crate) fn refine(units: &[&Unit<'_>], whites: &[White<'_, '_>], scored: &Scored) -> Scored {
    if !scored.candidate.is_placed() {
        return scored.clone();
    }
    let placing = Placing::of(scored.candidate.term.effect.info());
    let mut best = scored.clone();
    if let Some(onset) = placing.onset {
        let span = units.iter().map(|unit| unit.span_s.1 - unit.span_s.0).fold(0.0, f64::max);
        best = descend(units, whites, best, &[onset], span * FIRST_ONSET_SHARE, ONSET_STEP_S);
    }
    if let Some(first) = placing.region {
        let values = &best.candidate.term.values;
        let side = (values[first + 1] - values[first]).max(values[first + 3] - values[first + 2]);
        let bounds: Vec<usize> = (first..first + 4).collect();
        best = descend(units, whites, best, &bounds, 0.5 * side, BOUND_STEP_M);
    }
    best
}

/// Coordinate ascent of the gain over parameters that need no new linearization.
fn descend(
    units: &[&Unit<'_>],
    whites: &[White<'_, '_>],
    mut best: Scored,
    parameters: &[usize],
    first_step: f64,
    last_step: f64,
) -> Scored {
    let mut step = first_step;
    while step >= last_step {
        let mut moved = false;
        for &parameter in parameters {
            for change in [-step, step] {
                let mut candidate: Candidate = best.candidate.clone();
                candidate.term.values[parameter] += change;
                if let Some(next) = score(units, whites, &candidate)
                    && next.step.gain > best.step.gain * (1.0 + 1e-9)
                {
                    best = next;
                    moved = true;
                }
            }
        }
        if !moved {
            step *= 0.5;
        }
    }
    best
}
