//! The catalogue as a linear regression: residuals of the nominal model, and what every effect would change,
//! both in sigmas. It is what other methods of selection are given on the same recordings.

use pleiad_estimation::RobotId;
use pleiad_physics::Effect;
use pleiad_recording::Recording;

use crate::diagnosis::candidate::candidates;
use crate::diagnosis::entries::entries;
use crate::diagnosis::fit::{Effort, fit};
use crate::diagnosis::run::Prepared;
use crate::diagnosis::select::{Scored, score, whites};
use crate::diagnosis::spread::is_of_spread;
use crate::diagnosis::term::Whose;
use crate::diagnosis::unit::Unit;
use crate::error::MismatchError;
use pleiad_recording::parallel;

/// A linear regression of residuals on effects.
#[derive(Clone, Debug, Default)]
pub struct Design {
    /// Residuals under the nominal model, in sigmas, robot after robot.
    pub errors: Vec<f64>,
    /// The time of each, as a share of its robot's recording.
    pub shares: Vec<f64>,
    /// What effects would predict.
    pub columns: Vec<DesignColumn>,
}

/// What a step of a parameter of an effect changes.
#[derive(Clone, Debug)]
pub struct DesignColumn {
    /// Which effect.
    pub effect: Effect,
    /// On which robot; `None` for every robot.
    pub robot: Option<RobotId>,
    /// The name of the parameter; of the effect as a whole, empty.
    pub parameter: String,
    /// Stretches in which it is not zero: the position of the first element, and per unit of the parameter the
    /// predicted change in sigmas.
    pub parts: Vec<(usize, Vec<f64>)>,
}

/// Linearizes every effect of the catalogue but some beside the nominal model. Of an effect that begins somewhere
/// (an onset, a place, a threshold, an angle), the start that explains most is taken. Effects of spread or
/// chance have no column.
///
/// # Errors
/// As [`fit_known`](crate::fit_known).
pub fn design(recording: &Recording, leave_out: &[Effect]) -> Result<Design, MismatchError> {
    let prepared = Prepared::alone(recording, false)?;
    let all = prepared.units(|_| true);
    let units: Vec<&Unit<'_>> = all.iter().filter(|unit| !unit.rows.is_empty()).collect();
    let Some(nominal) = fit(&units, Vec::new(), &|_| true, Effort::FULL) else {
        return Ok(Design::default());
    };
    let mut tried = entries(&units).entries;
    tried.retain(|(effect, _)| !is_of_spread(*effect) && !leave_out.contains(effect));
    let whites = whites(&units, &nominal);
    let found = candidates(&tried, &units, &nominal.terms, &nominal.states);
    let best = parallel::map(&found, |starts| -> Option<Scored> {
        let scored = starts.iter().filter_map(|candidate| score(&units, &whites, candidate));
        scored.max_by(|a, b| a.step.gain.total_cmp(&b.step.gain))
    });

    let mut design = Design::default();
    let mut first = Vec::with_capacity(units.len());
    for (unit, white) in units.iter().zip(&whites) {
        first.push(design.errors.len());
        design.errors.extend_from_slice(&white.errors);
        let (from_s, to_s) = unit.span_s;
        let lasts_s = (to_s - from_s).max(f64::MIN_POSITIVE);
        design.shares.extend(unit.rows.iter().map(|row| (row.time_s - from_s) / lasts_s));
    }
    for ((effect, whose), scored) in tried.into_iter().zip(best) {
        let Some(scored) = scored else { continue };
        let columns = scored.candidate.columns(&units);
        for position in 0..scored.candidate.along.len().max(1) {
            let along = scored.candidate.along.get(position);
            let parts = columns.iter().flat_map(|(index, own)| {
                let (unit, start) = (units[*index], first[*index]);
                let shown = whites[*index].of(&own[position]);
                let each = shown.into_iter().zip(&unit.stretches);
                each.filter_map(|(part, stretch)| Some((start + stretch.offset, part?))).collect::<Vec<_>>()
            });
            design.columns.push(DesignColumn {
                effect,
                robot: match whose {
                    Whose::Robot(robot) => Some(robot),
                    Whose::Everyone => None,
                },
                parameter: along.map_or_else(String::new, |&along| effect.info().parameters[along].label()),
                parts: parts.collect(),
            });
        }
    }
    Ok(design)
}
