//! Whether a parameter is one number: the same from beginning to end, and for every target.
//!
//! What the catalogue lacks is taken for what it has: a clock that drifts for one that is set wrong, a landmark in the
//! wrong place for a scale of all ranges. The name fits on average. What gives it away is that its parameter would
//! have to be another one at another time, or for another target: a score test (`rao1948`) of its column times time,
//! times the distance from the middle of the time, and of its column at one target, beside everything that is fitted.

use std::collections::BTreeMap;

use pleiad_estimation::sample::Target;
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::diagnosis::fit::Fit;
use crate::diagnosis::run::Judgement;
use crate::diagnosis::select::{FAMILYWISE, whites};
use crate::diagnosis::unit::{Column, Row, Unit};
use crate::diagnosis::white::{White, step};

/// A parameter that changes by less than this share of itself is one number.
const LEAST_CHANGE: f64 = 0.5;
/// Scores are summed over blocks of time, whose variance is known about as well as from so many.
const FREEDOM: f64 = 20.0;
/// Fewer rows of a target than this say nothing.
const LEAST_ROWS: usize = 20;

/// What a parameter may differ with.
#[derive(Clone, Copy, Debug, PartialEq)]
enum With {
    Time,
    DistanceFromTheMiddle,
    Target(Target),
}

impl With {
    fn words(self) -> &'static str {
        match self {
            Self::Time | Self::DistanceFromTheMiddle => "with time",
            Self::Target(_) => "from target to target",
        }
    }

    /// From 0 to 1, of a row at `at` of the time from 0 to 1.
    fn of(self, row: &Row, at: f64) -> f64 {
        match self {
            Self::Time => at,
            Self::DistanceFromTheMiddle => (2.0 * at - 1.0).abs(),
            Self::Target(target) => f64::from(u8::from(row.target == Some(target))),
        }
    }
}

/// Makes of names what cannot be told where their main parameter is not one number.
pub(crate) fn doubt(units: &[&Unit<'_>], fit: &Fit, judgements: &mut [Judgement], notes: &mut Vec<String>) {
    // Innovations of a mesh are not a robot's alone.
    if units.iter().any(|unit| unit.mesh.is_some()) {
        return;
    }
    let whites = whites(units, fit);
    let mut asked = 0_usize;
    let mut worst: BTreeMap<usize, (f64, With)> = BTreeMap::new();
    for (index, own) in judgements.iter().enumerate().filter(|(_, own)| own.claims()) {
        for &position in &own.group {
            let Some(slot) = fit.slots.iter().position(|slot| *slot == (position, 0)) else { continue };
            let term = &fit.terms[position];
            let size = (term.values[0] - term.parameters()[0].off).abs();
            for with in alternatives(units, fit, slot) {
                asked += 1;
                let Some((p, change)) = tested(&whites, fit, slot, with) else { continue };
                if change.abs() > LEAST_CHANGE * size && worst.get(&index).is_none_or(|(least, _)| p < *least)
                {
                    worst.insert(index, (p, with));
                }
            }
        }
    }
    for (index, (p, with)) in worst {
        if p * asked as f64 >= FAMILYWISE {
            continue;
        }
        let own = &mut judgements[index];
        notes.push(format!(
            "{}: its parameter would have to differ {} (p = {:.1e}); it may stand in for something else",
            own.name(),
            with.words(),
            p * asked as f64
        ));
        own.doubt([format!("something that differs {}", with.words())]);
    }
}

/// What the parameter of a slot can differ with in these recordings.
fn alternatives(units: &[&Unit<'_>], fit: &Fit, slot: usize) -> Vec<With> {
    let mut counts: BTreeMap<Target, usize> = BTreeMap::new();
    for (unit, columns) in units.iter().zip(&fit.columns) {
        for (stretch, part) in unit.stretches.iter().zip(&columns[slot].parts) {
            if part.is_some() {
                for target in unit.rows[stretch.range()].iter().filter_map(|row| row.target) {
                    *counts.entry(target).or_default() += 1;
                }
            }
        }
    }
    let several = counts.len() > 1;
    let often = counts.into_iter().filter(|(_, count)| several && *count >= LEAST_ROWS);
    [With::Time, With::DistanceFromTheMiddle]
        .into_iter()
        .chain(often.map(|(target, _)| With::Target(target)))
        .collect()
}

/// The probability of as much if the parameter is one number, and by how much it differs.
fn tested(whites: &[White<'_, '_>], fit: &Fit, slot: usize, with: With) -> Option<(f64, f64)> {
    let shows: Vec<usize> = (0..whites.len()).filter(|&unit| !fit.columns[unit][slot].is_zero()).collect();
    let times = || shows.iter().flat_map(|&unit| whites[unit].unit.rows.iter().map(|row| row.time_s));
    let (first, last) = (times().fold(f64::MAX, f64::min), times().fold(f64::MIN, f64::max));
    let at = |row: &Row| (row.time_s - first) / (last - first).max(f64::MIN_POSITIVE);
    let column = |unit: usize| -> Column {
        let parts = whites[unit].unit.stretches.iter().zip(&fit.columns[unit][slot].parts);
        let parts = parts.map(|(stretch, part)| {
            let rows = &whites[unit].unit.rows[stretch.range()];
            let part = part.as_ref()?;
            Some(part.iter().zip(rows).map(|(value, row)| value * with.of(row, at(row))).collect())
        });
        Column { parts: parts.collect() }
    };
    let columns: Vec<[Column; 1]> = shows.iter().map(|&unit| [column(unit)]).collect();
    let columns: Vec<&[Column]> = columns.iter().map(<[Column; 1]>::as_slice).collect();
    let own: Vec<&White<'_, '_>> = shows.iter().map(|&unit| &whites[unit]).collect();
    let step = step(&own, &columns)?;
    let p = StudentsT::new(0.0, 1.0, FREEDOM).map_or(1.0, |own| 2.0 * own.sf(step.wald.sqrt()));
    p.is_finite().then_some((p, step.change[0]))
}
