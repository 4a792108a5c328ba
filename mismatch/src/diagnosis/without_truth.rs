//! Recordings without what they are not to be judged by, and teams whose places nobody knows but they.

use pleiad_estimation::sample::{Reading, Target};
use pleiad_physics::Pose;
use pleiad_recording::Recording;

use crate::builtin;
use crate::diagnose::{DiagnoseOptions, TruthUse};
use crate::diagnosis::fit::{Effort, Fit, State, fit_from, residuals, states};
use crate::diagnosis::mesh::{Event, Mesh, STATES};
use crate::diagnosis::noise;
use crate::diagnosis::run::{Prepared, member};
use crate::diagnosis::unit::{Member, Unit};
use crate::error::MismatchError;
use crate::evidence::Evidence;
use crate::reference::{moved, references, samples};

/// So often references are put where the whole recording says they should be.
const SMOOTHED: usize = 3;

/// Copies without landmarks, or with references for truth.
pub(crate) fn withheld(
    recordings: &[Recording],
    options: &DiagnoseOptions,
) -> Result<Vec<Recording>, MismatchError> {
    recordings.iter().map(|recording| withheld_of(recording, options)).collect()
}

/// A copy without landmarks, or with references for truth.
pub(crate) fn withheld_of(
    recording: &Recording,
    options: &DiagnoseOptions,
) -> Result<Recording, MismatchError> {
    let mut recording = recording.clone();
    if options.without_landmarks {
        let of_landmark =
            |reading: &Reading| matches!(reading, Reading::Sighting { target: Target::Landmark(_), .. });
        for own in recording.robots.values_mut() {
            own.sightings.retain(|sample| !of_landmark(&sample.reading));
        }
    }
    if options.truth == TruthUse::No { referred(&recording) } else { Ok(recording) }
}

/// A copy in which truth is what the team makes of the rest, smoothed over the whole recording.
fn referred(recording: &Recording) -> Result<Recording, MismatchError> {
    let models = builtin::models(recording)?;
    let mut blind = references(recording, &models)?;
    for _ in 0..SMOOTHED {
        let evidence = Evidence::by_reference(&blind, &models);
        let members = models.iter().map(|(&robot, model)| member(&blind, robot, model)).collect();
        let unit = team(&evidence, 0, members, &recording.name)?;
        let unknown = || not_finite(&recording.name);
        let state = states(&[&unit], &[]).and_then(|mut states| states.pop()).ok_or_else(unknown)?;
        let moved = corrected(&unit, &state).ok_or_else(unknown)?;
        blind = moved;
    }
    Ok(blind)
}

/// The recording of a team with its references where the whole recording says they should be.
fn corrected(unit: &Unit<'_>, state: &State) -> Option<Recording> {
    let mut recording = unit.evidence.recording.clone();
    let origin = unit.evidence.origin();
    for (member, poses) in unit.members.iter().zip(smoothed(unit, state)?) {
        let own = recording.robots.get_mut(&member.robot)?;
        own.truth = samples(poses.iter().map(|(stamp_s, pose)| (stamp_s, pose)), origin);
    }
    Some(recording)
}

/// Teams with their references where the terms of a fit say they should be.
pub(crate) struct Moved {
    recordings: Vec<Recording>,
}

impl Moved {
    pub(crate) fn new(units: &[&Unit<'_>], fit: &Fit) -> Option<Self> {
        let each = units.iter().zip(&fit.states);
        Some(Self { recordings: each.map(|(unit, state)| corrected(unit, state)).collect::<Option<_>>()? })
    }

    pub(crate) fn evidence<'s>(&'s self, units: &[&Unit<'_>]) -> Vec<Evidence<'s>> {
        let mut all = Vec::with_capacity(units.len());
        for (recording, unit) in self.recordings.iter().zip(units) {
            let models = unit.members.iter().map(|member| (member.robot, member.nominal.clone())).collect();
            all.push(Evidence::by_reference(recording, &models));
        }
        all
    }
}

/// The same teams by other evidence.
pub(crate) fn again<'a>(units: &[&Unit<'_>], evidence: &'a [Evidence<'a>]) -> Option<Vec<Unit<'a>>> {
    let one = |(unit, evidence): (&&Unit<'_>, &'a Evidence<'a>)| {
        let name = &evidence.recording.name;
        team(evidence, unit.recording, unit.members.clone(), name).ok()
    };
    units.iter().zip(evidence).map(one).collect()
}

/// The log-likelihood of a fit at the references that it asks for, at the noise scales of other states: so far from
/// those of another model it is not linear enough.
pub(crate) fn at_own_references(units: &[&Unit<'_>], own: &Fit, noise: &[State]) -> Option<f64> {
    let moved = Moved::new(units, own)?;
    let evidence = moved.evidence(units);
    let teams = again(units, &evidence)?;
    let teams: Vec<&Unit<'_>> = teams.iter().collect();
    let mut states = Vec::with_capacity(teams.len());
    for (unit, known) in teams.iter().zip(noise) {
        let residuals = residuals(unit, &own.terms, &|_| true, None)?;
        let known = known.noise.refiltered(unit)?;
        states.push(State { noise: noise::estimate(unit, &own.terms, &residuals, Some(&known)), residuals });
    }
    let last = own.terms.len().checked_sub(1)?;
    let fitted =
        fit_from(&teams, own.terms.clone(), states, &|index| index == last, Effort::RIVAL, &|_| None);
    Some(fitted.log_likelihood)
}

fn not_finite(recording: &str) -> MismatchError {
    MismatchError::NotFinite { recording: recording.to_owned() }
}

/// Stamps in seconds, and poses.
type References = Vec<(f64, Pose<f64>)>;

/// The references of every robot, put where the whole recording says they should be.
fn smoothed(unit: &Unit<'_>, state: &State) -> Option<Vec<References>> {
    let (mesh, filter) = unit.mesh.as_ref().zip(state.noise.filter.as_ref())?;
    let corrections = filter.smoothed(mesh, &state.noise.scales, &state.residuals);
    let one = |(index, member): (usize, &Member)| {
        let truth = &unit.evidence.tracks.get(&member.robot)?.truth;
        // A correction is of the reference at the beginning of each window, and the last of that at the end.
        let until = mesh.events.iter().filter_map(|event| match event {
            Event::Move(own) if own.at == STATES * index => Some(own.until_s),
            _ => None,
        });
        let ends: Vec<f64> = until.collect();
        let corrected = |(stamp_s, pose): &(f64, Pose<f64>)| {
            let place = ends.partition_point(|end_s| end_s <= stamp_s);
            corrections[index].get(place).map_or((*stamp_s, *pose), |xi| (*stamp_s, moved(pose, *xi)))
        };
        Some(truth.iter().map(corrected).collect())
    };
    unit.members.iter().enumerate().map(one).collect()
}

/// The team of every recording, of robots as they are alone.
pub(crate) fn teams<'a>(
    alone: &[Unit<'_>],
    prepared: &'a [Prepared<'a>],
) -> Result<Vec<Unit<'a>>, MismatchError> {
    let one = |(index, own): (usize, &'a Prepared<'a>)| {
        let members = alone.iter().filter(|unit| unit.recording == index);
        let members = members.flat_map(|unit| unit.members.iter().cloned()).collect();
        team(&own.evidence, index, members, &own.recording.name)
    };
    prepared.iter().enumerate().filter(|(_, own)| !own.models.is_empty()).map(one).collect()
}

fn team<'a>(
    evidence: &'a Evidence<'a>,
    index: usize,
    members: Vec<Member>,
    name: &str,
) -> Result<Unit<'a>, MismatchError> {
    let mut unit = Unit::new(evidence, index, members);
    unit.mesh = Some(Mesh::new(&unit).ok_or_else(|| not_finite(name))?);
    Ok(unit)
}

/// Robots by themselves under the terms of a fit of their teams: for what does not move the mean of residuals.
pub(crate) fn alone_under(alone: &[&Unit<'_>], fit: &Fit) -> Option<Fit> {
    let states = states(alone, &fit.terms)?;
    let columns = vec![Vec::new(); alone.len()];
    let log_likelihood = states.iter().map(|state| state.noise.log_likelihood).sum();
    Some(Fit { terms: fit.terms.clone(), states, slots: Vec::new(), columns, log_likelihood })
}
