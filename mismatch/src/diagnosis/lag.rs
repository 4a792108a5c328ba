//! Lag and delay where no encoder tells them apart.

use pleiad_physics::Effect;

use crate::diagnosis::fit::{Effort, Fit, fit};
use crate::diagnosis::naming::{is_unseen, twin};
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::Unit;

/// Shares of lag in a total of lag and delay from which a fit begins: at none it would never leave.
const LAG_SHARES: [f64; 2] = [0.5, 0.8];
/// A shorter lag cannot be told from a delay, seconds.
const LEAST_LAG_S: f64 = 0.01;

/// Where lag or delay was found without encoders, both are fitted: only their sum is well known.
pub(crate) fn paired(units: &[&Unit<'_>], found: Fit) -> Option<Fit> {
    let mut current = without_vanished(units, found)?;
    for share in LAG_SHARES {
        let mut terms = current.terms.clone();
        for (position, term) in current.terms.iter().enumerate() {
            let Some(twin) = twin(term.effect) else { continue };
            let known = current.terms.iter().any(|other| other.effect == twin && other.whose == term.whose);
            if !known && is_unseen(units, term) {
                let total_s = term.values[0];
                let of = |effect| total_s * if effect == Effect::ActuatorLag { share } else { 1.0 - share };
                terms[position].values[0] = of(term.effect);
                terms.push(Term::new(twin, term.whose, vec![of(twin)]));
            }
        }
        if terms.len() == current.terms.len() {
            break;
        }
        current = without_vanished(units, fit(units, terms, &|_| true, Effort::FULL)?)?;
    }
    Some(current)
}

/// Of pairs of lag and delay whose lag has vanished, the delay alone: beside it the lag only shifts in time,
/// and any split of the two predicts the same.
fn without_vanished(units: &[&Unit<'_>], both: Fit) -> Option<Fit> {
    let mut terms = both.terms.clone();
    let mut vanished = Vec::new();
    for (lag, term) in both.terms.iter().enumerate().filter(|(_, term)| term.effect == Effect::ActuatorLag) {
        let same = |other: &Term| Some(other.effect) == twin(term.effect) && other.whose == term.whose;
        let Some(delay) = both.terms.iter().position(same) else { continue };
        if term.values[0] < LEAST_LAG_S && is_unseen(units, term) {
            terms[delay].values[0] += term.values[0];
            vanished.push(lag);
        }
    }
    if vanished.is_empty() {
        return Some(both);
    }
    let mut position = 0..;
    terms.retain(|_| position.next().is_none_or(|position| !vanished.contains(&position)));
    fit(units, terms, &|_| true, Effort::FULL)
}
