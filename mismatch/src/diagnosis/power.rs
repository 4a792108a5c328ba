//! The smallest effect that would have been found.

use std::collections::BTreeMap;

use pleiad_physics::Effect;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::diagnosis::select::{FAMILYWISE, Scored};
use crate::diagnosis::term::Whose;
use crate::diagnosis::unit::Unit;
use crate::findings::Undetected;

/// Quantile of the standard normal at a power of 80 %.
pub(crate) const POWER_80: f64 = 0.841_621_233_572_914;
/// Standard errors by which an estimate must exceed the threshold of relevance.
const NEAR_END: f64 = 3.0;

/// The smallest size of every effect that was tried, from the standard errors beside what was found: large
/// enough to be significant, and relevant, in four of five recordings.
pub(crate) fn undetected(units: &[&Unit<'_>], scored: &[Scored], tests: usize) -> Vec<Undetected> {
    let critical = Normal::standard().inverse_cdf(1.0 - 0.5 * FAMILYWISE / tests.max(1) as f64);
    let mut least: BTreeMap<(Effect, Whose, usize), f64> = BTreeMap::new();
    for one in scored {
        let term = &one.candidate.term;
        for (position, &parameter) in one.candidate.along.iter().enumerate() {
            let error = one.step.covariance[(position, position)].sqrt();
            if !error.is_finite() || error <= 0.0 {
                continue;
            }
            let threshold = units
                .iter()
                .flat_map(|unit| unit.acted_on(term))
                .map(|member| term.parameters()[parameter].relevance.threshold(&member.floors))
                .fold(f64::INFINITY, f64::min);
            if !threshold.is_finite() || threshold <= 0.0 {
                continue;
            }
            let size = ((critical + POWER_80) * error).max(threshold + (NEAR_END + POWER_80) * error);
            let known = least.entry((term.effect, term.whose, parameter)).or_insert(size);
            *known = known.min(size);
        }
    }
    let one = |((effect, whose, parameter), minimum_detectable): ((Effect, Whose, usize), f64)| {
        let info = effect.info();
        let robot = match whose {
            Whose::Robot(robot) => Some(robot.0),
            Whose::Everyone => None,
        };
        Undetected {
            effect: info.name.to_owned(),
            robot,
            parameter: info.parameters[parameter].label(),
            minimum_detectable,
            unit: info.parameters[parameter].unit.to_owned(),
        }
    };
    least.into_iter().map(one).collect()
}
