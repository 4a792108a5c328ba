//! How sure the parameters of a fit are for a search, and whether terms are there at all.

use nalgebra::DMatrix;

use crate::diagnosis::fit::Fit;
use crate::diagnosis::unit::Unit;
use crate::diagnosis::white::{White, step};

/// The robust covariance of all fitted parameters, in the order of the slots.
pub(crate) fn covariance(units: &[&Unit<'_>], fit: &Fit) -> Option<DMatrix<f64>> {
    if fit.slots.is_empty() {
        return Some(DMatrix::zeros(0, 0));
    }
    let bare: Vec<White<'_, '_>> =
        units.iter().zip(&fit.states).map(|(unit, state)| White::new(unit, state, &[])).collect();
    let bare: Vec<&White<'_, '_>> = bare.iter().collect();
    let columns: Vec<&[_]> = fit.columns.iter().map(Vec::as_slice).collect();
    Some(step(&bare, &columns)?.covariance)
}

/// The Wald statistic of terms and its degrees of freedom.
pub(crate) fn wald(fit: &Fit, covariance: &DMatrix<f64>, terms: &[usize]) -> Option<(f64, usize)> {
    let parameter = |slot: usize| {
        let (term, parameter) = fit.slots[slot];
        (fit.terms[term].values[parameter], &fit.terms[term].parameters()[parameter])
    };
    // A parameter that is off at infinity, or only shapes an effect, says nothing of its presence.
    let says = |slot: &usize| {
        let (_, parameter) = parameter(*slot);
        parameter.off.is_finite() && (parameter.off == 0.0 || fit.slots.len() == 1)
    };
    let own: Vec<usize> =
        (0..fit.slots.len()).filter(|&slot| terms.contains(&fit.slots[slot].0)).filter(says).collect();
    if own.is_empty() {
        return None;
    }
    let part = DMatrix::from_fn(own.len(), own.len(), |i, j| covariance[(own[i], own[j])]);
    let value = |slot: usize| {
        let (value, parameter) = parameter(slot);
        value - parameter.off
    };
    let values = nalgebra::DVector::from_fn(own.len(), |i, _| value(own[i]));
    Some((values.dot(&part.cholesky()?.solve(&values)), own.len()))
}
