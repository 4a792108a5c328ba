//! Effects that could be added to a hypothesis, linearized where their search begins.

use std::sync::Arc;

use pleiad_physics::{Effect, Region};

use crate::diagnosis::fit::State;
use crate::diagnosis::linearize::{Request, linearized};
use crate::diagnosis::scan::{best_rectangles, rectangles};
use crate::diagnosis::select::Entry;
use crate::diagnosis::starts::{Placing, Start, onsets, regions, starts};
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::touch::touches;
use crate::diagnosis::unit::{Column, Row, Stretch, Unit};
use pleiad_recording::parallel;

/// An impulse is looked for at so many of the largest residuals.
const IMPULSES: usize = 8;

/// Columns per unit that an effect acts on: the unit's position and its columns.
pub(crate) type Columns = Vec<(usize, Arc<Vec<Column>>)>;

/// A start of an effect with its columns.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    pub(crate) term: Term,
    /// Parameters that the columns are derivatives by; empty for one column that is the effect itself at the
    /// values of the term.
    pub(crate) along: Vec<usize>,
    /// Columns, of the effect always and everywhere if it has an onset or a region.
    base: Columns,
    /// Whether rows before the onset or outside the region of the term are to be blanked.
    masked: bool,
    /// Among how many places that refinement may lead to it was chosen.
    pub(crate) looked: f64,
}

impl Candidate {
    /// The columns at the onset and in the region of the term.
    pub(crate) fn columns(&self, units: &[&Unit<'_>]) -> Columns {
        if !self.masked {
            return self.base.clone();
        }
        let placing = Placing::of(self.term.effect.info());
        let values = &self.term.values;
        let from_s = placing.onset.map(|onset| values[onset]);
        let region = placing.region.map(|first| {
            Region::from_bounds([values[first], values[first + 1], values[first + 2], values[first + 3]])
        });
        let inside = |row: &Row| {
            from_s.is_none_or(|from_s| row.time_s >= from_s)
                && region
                    .is_none_or(|region| row.regime.pose.is_some_and(|pose| region.contains(pose.position())))
        };
        let blank = |unit: &Unit<'_>, column: &Column| {
            let part = |(part, stretch): (&Option<Vec<f64>>, &Stretch)| {
                let rows = &unit.rows[stretch.range()];
                let keep = |(value, row): (&f64, &Row)| if inside(row) { *value } else { 0.0 };
                part.as_ref().map(|part| part.iter().zip(rows).map(keep).collect())
            };
            Column { parts: column.parts.iter().zip(&unit.stretches).map(part).collect() }
        };
        let of_unit = |(unit, columns): &(usize, Arc<Vec<Column>>)| {
            let blanked: Vec<Column> = columns.iter().map(|column| blank(units[*unit], column)).collect();
            (*unit, Arc::new(blanked))
        };
        self.base.iter().map(of_unit).collect()
    }

    /// The same where only some units are looked at: `own` are their positions so far.
    pub(crate) fn renumbered(&self, own: &[usize]) -> Self {
        let place = |unit: usize| own.iter().position(|known| *known == unit);
        let base = self
            .base
            .iter()
            .filter_map(|(unit, columns)| Some((place(*unit)?, Arc::clone(columns))))
            .collect();
        Self { base, ..self.clone() }
    }

    /// Whether onset or region can be moved without a new linearization.
    pub(crate) fn is_placed(&self) -> bool {
        self.masked
    }
}

/// Linearizes entries at all their starts beside the terms of a hypothesis: candidates by entry. Starts that show
/// nowhere are left out; parameters that do not show stay at their values.
pub(crate) fn candidates(
    entries: &[Entry],
    units: &[&Unit<'_>],
    terms: &[Term],
    states: &[State],
) -> Vec<Vec<Candidate>> {
    let own = |(_, whose): Entry| -> Vec<usize> {
        (0..units.len()).filter(|&unit| acts(whose, units[unit])).collect()
    };
    let acting = |entry: Entry| -> Vec<&Unit<'_>> { own(entry).iter().map(|&unit| units[unit]).collect() };
    let mut owners = Vec::new();
    let mut requests = Vec::new();
    for (owner, &entry) in entries.iter().enumerate() {
        let placing = Placing::of(entry.0.info());
        for Start { mut values, along } in starts(entry.0, &acting(entry)) {
            placing.widen(&mut values);
            requests.push(Request { term: Term::new(entry.0, entry.1, values), along });
            owners.push(owner);
        }
    }
    let mut found: Vec<Vec<Candidate>> = vec![Vec::new(); entries.len()];
    // An impulse shows only if it is at an instant that was recorded.
    let (mut instant_owners, mut instants) = (Vec::new(), Vec::new());
    let columns = linearized(units, terms, states, &requests);
    let shown_of = requests.iter().zip(columns).map(|(request, columns)| shown(request, columns));
    let shown_of: Vec<(usize, Option<Candidate>)> = owners.into_iter().zip(shown_of).collect();
    let expanded = parallel::map(&shown_of, |(owner, everywhere)| {
        let entry = entries[*owner];
        let placing = Placing::of(entry.0.info());
        let everywhere = everywhere.as_ref().filter(|_| placing.is_some())?;
        Some(placed(everywhere, placing, units, (&acting(entry), states)))
    });
    for (((owner, shown), request), expanded) in shown_of.into_iter().zip(&requests).zip(expanded) {
        let entry = entries[owner];
        match (shown.map(|plain| expanded.unwrap_or_else(|| vec![plain])), Placing::of(entry.0.info()).onset)
        {
            (Some(candidates), _) => found[owner].extend(candidates),
            (None, Some(onset)) => {
                for time_s in largest(entry.0, &own(entry), units, states) {
                    let mut term = request.term.clone();
                    term.values[onset] = time_s;
                    instants.push(Request { term, along: request.along.clone() });
                    instant_owners.push(owner);
                }
            }
            (None, None) => {}
        }
    }
    let columns = linearized(units, terms, states, &instants);
    for ((owner, request), columns) in instant_owners.into_iter().zip(&instants).zip(columns) {
        found[owner].extend(shown(request, columns));
    }
    found
}

/// The candidate at every onset and in every region: squares of all that was driven, and where it would gain most.
fn placed(
    everywhere: &Candidate,
    placing: Placing,
    units: &[&Unit<'_>],
    (acting, states): (&[&Unit<'_>], &[State]),
) -> Vec<Candidate> {
    let mut all = vec![Candidate { masked: true, ..everywhere.clone() }];
    if let Some(onset) = placing.onset {
        all = expand(&all, &onsets(acting), |values, time_s| values[onset] = time_s);
    }
    if let Some(first) = placing.region {
        let mut places = regions(acting);
        // What a team measured of each other is not at one place.
        if acting.iter().all(|unit| unit.mesh.is_none()) {
            places.extend(best_rectangles(everywhere, units, states));
        }
        let looked = rectangles(acting);
        for own in &mut all {
            own.looked = looked;
        }
        all = expand(&all, &places, |values, region: [f64; 4]| {
            values[first..first + 4].copy_from_slice(&region);
        });
    }
    all
}

fn expand<V: Copy>(all: &[Candidate], places: &[V], set: impl Fn(&mut [f64], V)) -> Vec<Candidate> {
    let mut expanded = Vec::with_capacity(all.len() * places.len());
    for candidate in all {
        for &place in places {
            let mut next = candidate.clone();
            set(&mut next.term.values, place);
            expanded.push(next);
        }
    }
    expanded
}

/// The times of the largest residuals in the channels of an effect, the largest first.
fn largest(effect: Effect, own: &[usize], units: &[&Unit<'_>], states: &[State]) -> Vec<f64> {
    let mut sizes: Vec<(f64, f64)> = Vec::new();
    for &unit in own {
        let (unit, state) = (units[unit], &states[unit]);
        let errors = state.noise.whitened(unit, &state.residuals);
        let shows = |stretch: &&Stretch| unit.mesh.is_some() || touches(effect, stretch.channel);
        for stretch in unit.stretches.iter().filter(shows) {
            sizes.extend(stretch.range().map(|index| (errors[index].abs(), unit.rows[index].time_s)));
        }
    }
    sizes.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.total_cmp(&b.1)));
    let mut times: Vec<f64> = Vec::new();
    for (_, time_s) in sizes {
        if times.len() == IMPULSES {
            break;
        }
        if !times.iter().any(|known| (known - time_s).abs() < 1e-9) {
            times.push(time_s);
        }
    }
    times
}

fn acts(whose: Whose, unit: &Unit<'_>) -> bool {
    match whose {
        Whose::Robot(robot) => unit.members.iter().any(|member| member.robot == robot),
        Whose::Everyone => true,
    }
}

/// Keeps the columns that show somewhere.
fn shown(request: &Request, columns: Vec<(usize, Vec<Column>)>) -> Option<Candidate> {
    let mut term = request.term.clone();
    let (_, first) = columns.first()?;
    let shows: Vec<bool> =
        (0..first.len()).map(|index| columns.iter().any(|(_, columns)| !columns[index].is_zero())).collect();
    if !shows.contains(&true) {
        return None;
    }
    for (&parameter, &shows) in request.along.iter().zip(&shows) {
        term.free[parameter] = term.free[parameter] && shows;
    }
    let along =
        request.along.iter().zip(&shows).filter(|(_, shows)| **shows).map(|(index, _)| *index).collect();
    let keep = |(unit, columns): (usize, Vec<Column>)| {
        let kept = columns.into_iter().zip(&shows).filter(|(_, shows)| **shows).map(|(column, _)| column);
        (unit, Arc::new(kept.collect()))
    };
    Some(Candidate { term, along, base: columns.into_iter().map(keep).collect(), masked: false, looked: 1.0 })
}
