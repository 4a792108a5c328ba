//! The pipeline: compare, select, judge, show.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use pleiad_estimation::RobotId;
use pleiad_physics::{Effect, Floors, RobotModel};
use pleiad_recording::Recording;

use crate::builtin;
use crate::channel::Channel;
use crate::diagnose::{DiagnoseOptions, Diagnosis, TruthUse};
use crate::diagnosis::corrected;
use crate::diagnosis::entries::{Entries, SHORT_S, entries, lasting_s, unseen};
use crate::diagnosis::fit::{Fit, State, states};
use crate::diagnosis::held_out::{Gain, compared, cross_fitted};
use crate::diagnosis::lag::paired;
use crate::diagnosis::naming::{Judged, disguise, groups, judge};
use crate::diagnosis::open::{Opened, open};
use crate::diagnosis::power::undetected;
use crate::diagnosis::rest;
use crate::diagnosis::rolled::{self, Roller};
use crate::diagnosis::said::{finding, nuisance};
use crate::diagnosis::select::{Entry, Pool, Selected, select};
use crate::diagnosis::series;
use crate::diagnosis::spread::{self, Spread, SpreadTerm, Swaps};
use crate::diagnosis::steady;
use crate::diagnosis::support::{Support, support};
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::{Member, Unit};
use crate::diagnosis::without_truth::{Moved, again, alone_under, teams, withheld};
use crate::error::MismatchError;
use crate::evidence::Evidence;
use crate::findings::{Finding, Findings, Untestable, Verdict};
use pleiad_recording::parallel;

/// The spread of a uniform distribution of length one.
const UNIFORM_SIGMA: f64 = 0.288_675_134_594_812_9;

/// Recordings with their evidence and models.
pub(crate) struct Prepared<'a> {
    pub(crate) recording: &'a Recording,
    pub(crate) evidence: Evidence<'a>,
    pub(crate) models: BTreeMap<RobotId, RobotModel<f64>>,
    pub(crate) tested: bool,
}

/// A term that was judged, with what it was judged by.
pub(crate) struct Judgement {
    /// The positions of its terms in the fit.
    pub(crate) group: Vec<usize>,
    pub(crate) support: Support,
    pub(crate) judged: Judged,
    pub(crate) gain: Gain,
    /// What has no name and may be in its place.
    pub(crate) unnamed_rivals: Vec<String>,
}

impl Judgement {
    /// Whether it says that this and nothing else is the matter: by a name, of physics or of bad data.
    pub(crate) fn claims(&self) -> bool {
        matches!(self.judged.verdict, Some(Verdict::Named | Verdict::BadData))
    }

    /// Makes of a name one of several that cannot be told apart, some of which have none.
    pub(crate) fn doubt(&mut self, rivals: impl IntoIterator<Item = String>) {
        self.judged.verdict = Some(Verdict::CannotTell);
        self.unnamed_rivals.extend(rivals);
        self.unnamed_rivals.dedup();
    }
}

#[allow(clippy::too_many_lines, reason = "the pipeline from top to bottom")]
pub(crate) fn run(recordings: &[Recording], options: &DiagnoseOptions) -> Result<Diagnosis, MismatchError> {
    let tested = roles(recordings, options)?;
    let by_reference = options.truth == TruthUse::No;
    let changed = by_reference || options.without_landmarks;
    let recordings: Cow<'_, [Recording]> =
        if changed { withheld(recordings, options)?.into() } else { recordings.into() };
    let recordings = &*recordings;
    let mut prepared = Vec::new();
    for (recording, role) in recordings.iter().zip(tested) {
        let Some(tested) = role else { continue };
        prepared.push(Prepared { tested, ..Prepared::alone(recording, by_reference)? });
    }
    let robots: Vec<_> = prepared
        .iter()
        .enumerate()
        .flat_map(|(index, own)| own.models.iter().map(move |(&robot, model)| (index, own, robot, model)))
        .collect();
    let mut all = parallel::map(&robots, |&(index, own, robot, model)| unit(index, own, robot, model));
    let swaps = begun(&mut all, options);
    let fitted: Vec<&Unit<'_>> = all.iter().filter(|unit| !prepared[unit.recording].tested).collect();
    let enough = |unit: &&Unit<'_>| lasting_s(&fitted, unit.robot()) >= SHORT_S;
    let units: Vec<&Unit<'_>> =
        fitted.iter().copied().filter(|unit| !unit.rows.is_empty()).filter(enough).collect();
    let tests: Vec<&Unit<'_>> =
        all.iter().filter(|unit| prepared[unit.recording].tested && !unit.rows.is_empty()).collect();
    let teams = if by_reference { teams(&all, &prepared)? } else { Vec::new() };
    let (alone, tests_alone) = (units, tests);
    let (units, tests): (Vec<&Unit<'_>>, Vec<&Unit<'_>>) = if by_reference {
        teams.iter().partition(|unit| !prepared[unit.recording].tested)
    } else {
        (alone.clone(), tests_alone.clone())
    };
    let mut entries = entries(&fitted).tried(options);
    let tried = entries.entries.len() + entries.untestable.len();
    let spread_entries = spread::take(&mut entries, &alone, &options.leave_out);

    let mut notes = notes(&prepared, &all, &fitted);
    let mut selected = select(&units, &entries.entries, Vec::new());
    // References far from where the findings have them are not linear enough: once more where they should be.
    let moved = match &selected {
        Some(first) if by_reference && !first.fit.terms.is_empty() => Moved::new(&units, &first.fit),
        _ => None,
    };
    let evidence = moved.as_ref().map_or_else(Vec::new, |moved| moved.evidence(&units));
    let again = if moved.is_some() { again(&units, &evidence) } else { None };
    let units: Vec<&Unit<'_>> = again.as_ref().map_or(units, |again| again.iter().collect());
    if again.is_some()
        && let Some(first) = selected.take()
    {
        selected = select(&units, &entries.entries, first.fit.terms);
    }
    let Some(Selected { fit, tests: count, mut pool }) = selected else {
        return Ok(nothing(&prepared, entries, notes, units.is_empty()));
    };
    let Some(fit) = paired(&units, fit) else {
        return Ok(nothing(&prepared, entries, notes, false));
    };
    let count = count + spread_entries.len() + swaps.tests;
    let scored = pool.scored(&units, &entries.entries, &fit);
    entries.untestable.extend(hidden(&alone, &entries.entries, &fit, &pool));
    let groups = groups(&units, &fit.terms);
    let mut judgements = judgements(&units, &tests, &fit, &groups, (&pool, options.without.sets), count);
    let fit_alone = if by_reference { alone_under(&alone, &fit) } else { Some(fit.clone()) };
    let mut spread = fit_alone.as_ref().map_or_else(Spread::default, |fit| {
        spread::spread(&alone, &tests_alone, fit, &spread_entries, &swaps, (count, &options.leave_out))
    });
    spread.explain(&mut judgements, &mut notes);
    let recorded: Vec<String> = prepared.iter().map(|own| own.recording.name.clone()).collect();
    // What is left against references is theirs too.
    let opened =
        if by_reference { Opened::default() } else { open(&units, &tests, &recorded, &fit, &spread, count) };
    opened.displace(&mut judgements, &mut spread, &mut notes);
    opened.doubt(&units, &mut judgements);
    let told =
        |robot: RobotId, channel: Channel| spread.shows(robot, channel) || opened.shows(robot, channel);
    rest::doubt(&units, &fit, &told, &mut judgements, &mut notes);
    steady::doubt(&units, &fit, &mut judgements, &mut notes);
    let found: Vec<&Judgement> = ordered(&judgements);

    for (effect, [first, second]) in disguise(&fit.terms) {
        let both = [first, second].map(|term| found.iter().any(|own| own.group.contains(&term)));
        if both == [true, true] {
            notes.push(format!(
                "{} together with {} cannot be told from {} by any data: they move the robot alike",
                fit.terms[first].effect.name(),
                fit.terms[second].effect.name(),
                effect.name()
            ));
        }
    }
    let named = |group: &&Vec<usize>| found.iter().any(|own| own.group == **group);
    let explained = |term: usize| spread.explains(term) || opened.displaced.contains(&term);
    let unexplained = groups.iter().filter(|group| !explained(group[0]));
    notes.extend(unexplained.filter(|group| !named(group)).map(|group| nuisance(&fit.terms[group[0]])));
    notes.extend(spread.nuisances());
    notes.extend(found.iter().filter(|own| own.judged.one_off).map(|own| {
        format!("{} happened once, or where robots were seldom, and could not be cross-validated", own.name())
    }));

    let roller = Roller { prepared: &prepared, units: &units, tests: &tests };
    let kept = kept(&fit, &judgements);
    // Nothing but truth says where a roll-out should have ended.
    let rolled = if by_reference { BTreeMap::new() } else { rolled::robots(&roller, &kept) };
    let mut findings: Vec<Finding> = parallel::map(&found, |own| finding(&units, &rolled, own));
    findings.extend(spread.found().into_iter().map(SpreadTerm::finding));
    let named_count = findings.len();
    findings.extend(opened.found.iter().map(|own| own.finding.clone()));
    notes.extend(opened.notes.iter().cloned());
    if !opened.found.is_empty() {
        notes.push("what has no name is not in the corrected model".to_owned());
    }
    let mut undetected = undetected(&units, &scored, count);
    undetected.extend_from_slice(&spread.undetected);
    entries.untestable.extend_from_slice(&spread.untestable);
    let corrected_terms: Vec<&Judged> = found
        .iter()
        .map(|own| &own.judged)
        .chain(spread.found().into_iter().map(|own| &own.judged))
        .collect();
    let names = |tested: bool| -> Vec<String> {
        prepared.iter().filter(|own| own.tested == tested).map(|own| own.recording.name.clone()).collect()
    };
    let findings = Findings {
        verdict: overall(&findings, tried, entries.untestable.len()),
        recordings: recordings.iter().map(|recording| recording.name.clone()).collect(),
        fit_on: names(false),
        test_on: names(true),
        findings,
        undetected,
        untestable: entries.untestable,
        roll_outs: rolled::per_robot(&rolled, &units),
        notes,
    };
    let mut plots = series::plots(&prepared, &units, &fit, &kept, &found);
    opened.plot(named_count, &mut plots);
    let corrected = prepared
        .iter()
        .map(|own| (own.recording.name.clone(), corrected::corrected(own, &corrected_terms)))
        .collect();
    Ok(Diagnosis { findings, plots, corrected })
}

/// What comes before anything is fitted: names that are exchanged.
fn begun(all: &mut [Unit<'_>], options: &DiagnoseOptions) -> Swaps {
    if options.without.blocks {
        all.iter_mut().for_each(Unit::make_rows_blocks);
    }
    if options.leave_out.contains(&Effect::LandmarkIdentitySwap) {
        return Swaps::default();
    }
    spread::swaps(all)
}

/// For each recording whether it is tested on; `None` if it is not used.
fn roles(recordings: &[Recording], options: &DiagnoseOptions) -> Result<Vec<Option<bool>>, MismatchError> {
    for name in options.fit_on.iter().chain(&options.test_on) {
        if !recordings.iter().any(|recording| recording.name == *name) {
            let given = recordings.iter().map(|recording| recording.name.clone()).collect();
            return Err(MismatchError::UnknownRecording { name: name.clone(), given });
        }
    }
    let role = |recording: &Recording| {
        if options.test_on.contains(&recording.name) {
            return Some(true);
        }
        (options.fit_on.is_empty() || options.fit_on.contains(&recording.name)).then_some(false)
    };
    let roles: Vec<Option<bool>> = recordings.iter().map(role).collect();
    if !roles.contains(&Some(false)) {
        return Err(MismatchError::NothingToFit { tested_on: options.test_on.clone() });
    }
    Ok(roles)
}

impl<'a> Prepared<'a> {
    /// A recording by itself, under the models that it declares.
    ///
    /// # Errors
    /// The recording has no nominal model and its odometry is not of commands, or the model lacks a robot.
    pub(crate) fn alone(recording: &'a Recording, by_reference: bool) -> Result<Self, MismatchError> {
        let models = builtin::models(recording)?;
        let evidence = if by_reference {
            Evidence::by_reference(recording, &models)
        } else {
            Evidence::new(recording, &models)
        };
        Ok(Self { recording, evidence, models, tested: false })
    }

    /// A robot with what the recording declares of it; `None` if it is not known.
    pub(crate) fn member(&self, robot: RobotId) -> Option<Member> {
        Some(member(self.recording, robot, self.models.get(&robot)?))
    }

    /// The robots for which `wanted` holds, each by itself.
    pub(crate) fn units(&'a self, wanted: impl Fn(RobotId) -> bool) -> Vec<Unit<'a>> {
        let models = self.models.iter().filter(|(robot, _)| wanted(**robot));
        models.map(|(&robot, model)| unit(0, self, robot, model)).collect()
    }
}

/// A robot by itself.
fn unit<'a>(index: usize, own: &'a Prepared<'a>, robot: RobotId, model: &RobotModel<f64>) -> Unit<'a> {
    Unit::new(&own.evidence, index, vec![member(own.recording, robot, model)])
}

/// A robot with what its recording declares.
pub(crate) fn member(recording: &Recording, robot: RobotId, model: &RobotModel<f64>) -> Member {
    let floors = recording.nominal.as_ref().map_or_else(Floors::default, |nominal| Floors {
        lateral_slip_s: nominal.noise.odometry_floor_lateral_slip_s,
        sensor_lag_s: nominal.noise.gyro_floor_lag_s,
        command_lag_s: nominal.noise.command_floor_lag_s,
        servo_time_constant_s: model.nominal.servo_time_constant_s,
    });
    let jitter_s = recording.nominal.as_ref().map_or(0.0, |nominal| nominal.noise.command_jitter_s);
    Member { robot, nominal: model.clone(), floors, jitter_sigma_s: jitter_s * UNIFORM_SIGMA }
}

/// What could not be compared at all.
fn notes(prepared: &[Prepared<'_>], units: &[Unit<'_>], fitted: &[&Unit<'_>]) -> Vec<String> {
    let mut notes = Vec::new();
    for unit in units {
        let name = &prepared[unit.recording].recording.name;
        for stretch in &unit.stretches {
            let few = stretch.rows / FEW;
            for omission in stretch.omissions.iter().filter(|omission| omission.matters(few)) {
                notes.push(format!("{name}, robot {}, {}: {omission}", unit.robot(), stretch.channel));
            }
        }
    }
    let mut robots: Vec<RobotId> = fitted.iter().map(|unit| unit.robot()).collect();
    robots.sort_unstable();
    robots.dedup();
    for (robot, lasting_s) in robots.into_iter().map(|robot| (robot, lasting_s(fitted, robot))) {
        if lasting_s < SHORT_S {
            notes.push(format!(
                "robot {robot}: {lasting_s:.1} s can be compared; below {SHORT_S} s nothing is"
            ));
        }
    }
    for own in prepared.iter().filter(|own| own.models.is_empty()) {
        notes.push(format!("{}: no robot recorded anything", own.recording.name));
    }
    notes
}

/// What one row in so many lacks is not worth a note.
const FEW: usize = 20;

fn judgements(
    units: &[&Unit<'_>],
    tests: &[&Unit<'_>],
    fit: &Fit,
    groups: &[Vec<usize>],
    (pool, alone): (&Pool, bool),
    count: usize,
) -> Vec<Judgement> {
    let each = parallel::map(groups, |group| {
        let mut support = support(units, fit, group, pool, count)?;
        if alone {
            support.members.truncate(group.len());
        }
        let acting: Vec<&Unit<'_>> = support.units.iter().map(|&unit| units[unit]).collect();
        let gain = if tests.is_empty() {
            cross_fitted(&acting, &support.with, &support.without)
        } else {
            on_tests(tests, &fit.terms[group[0]], &support)
        };
        let judged = judge(units, &support, gain, count);
        Some(Judgement { group: group.clone(), support, judged, gain, unnamed_rivals: Vec::new() })
    });
    each.into_iter().flatten().collect()
}

/// The gain on recordings that were not fitted on.
fn on_tests(tests: &[&Unit<'_>], term: &Term, support: &Support) -> Gain {
    let acting: Vec<&Unit<'_>> = tests.iter().copied().filter(|unit| unit.has(term)).collect();
    let at = |fit: &Fit| -> Option<Vec<State>> { states(&acting, &fit.terms) };
    match (at(&support.with), at(&support.without)) {
        (Some(with), Some(without)) => compared(&acting, &with, &without),
        _ => Gain::default(),
    }
}

/// Those with a verdict, the largest gain first.
fn ordered(judgements: &[Judgement]) -> Vec<&Judgement> {
    let mut found: Vec<&Judgement> = judgements.iter().filter(|own| own.judged.verdict.is_some()).collect();
    found.sort_by(|a, b| b.gain.total.total_cmp(&a.gain.total));
    found
}

/// The terms of findings.
fn kept(fit: &Fit, judgements: &[Judgement]) -> Vec<Term> {
    let found = judgements.iter().filter(|own| own.judged.verdict.is_some());
    found.flat_map(|own| own.group.iter().map(|&term| fit.terms[term].clone())).collect()
}

/// The entries that have no candidate, because they change no prediction of what was recorded.
fn hidden(units: &[&Unit<'_>], entries: &[Entry], fit: &Fit, pool: &Pool) -> Vec<Untestable> {
    let shows: BTreeSet<Entry> =
        pool.candidates().map(|candidate| (candidate.term.effect, candidate.term.whose)).collect();
    let known = |entry: &Entry| shows.contains(entry) || fit.terms.iter().any(|term| term.effect == entry.0);
    entries.iter().filter(|entry| !known(entry)).map(|&entry| unseen(units, entry)).collect()
}

/// That nothing is missing is said if, of what was `tried`, more could be tested than could not.
fn overall(findings: &[Finding], tried: usize, untestable: usize) -> Verdict {
    let order = [Verdict::Named, Verdict::BadData, Verdict::CannotTell, Verdict::Form, Verdict::Unnameable];
    order
        .into_iter()
        .find(|verdict| findings.iter().any(|finding| finding.verdict == *verdict))
        .unwrap_or(if tried > 2 * untestable { Verdict::NothingMissing } else { Verdict::Untestable })
}

/// What is said where nothing could be compared.
fn nothing(prepared: &[Prepared<'_>], entries: Entries, mut notes: Vec<String>, empty: bool) -> Diagnosis {
    if !empty {
        notes.push(
            "the nominal model predicts values that are no finite numbers; nothing was fitted".to_owned(),
        );
    }
    let findings = Findings {
        verdict: Verdict::Untestable,
        recordings: prepared.iter().map(|own| own.recording.name.clone()).collect(),
        fit_on: prepared.iter().filter(|own| !own.tested).map(|own| own.recording.name.clone()).collect(),
        test_on: prepared.iter().filter(|own| own.tested).map(|own| own.recording.name.clone()).collect(),
        findings: Vec::new(),
        undetected: Vec::new(),
        untestable: entries.untestable,
        roll_outs: Vec::new(),
        notes,
    };
    let corrected =
        prepared.iter().map(|own| (own.recording.name.clone(), corrected::corrected(own, &[]))).collect();
    Diagnosis { findings, plots: crate::view::Plots::default(), corrected }
}
