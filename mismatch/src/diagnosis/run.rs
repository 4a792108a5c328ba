//! The pipeline: compare, select, judge, show.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::DMatrix;
use pleiad_estimation::RobotId;
use pleiad_physics::{Effect, Floors, RobotModel};
use pleiad_recording::Recording;

use crate::builtin;
use crate::diagnose::{DiagnoseOptions, Diagnosis, TruthUse};
use crate::diagnosis::corrected;
use crate::diagnosis::entries::{Entries, entries};
use crate::diagnosis::fit::{Fit, State, states};
use crate::diagnosis::held_out::{Gain, compared, cross_fitted};
use crate::diagnosis::naming::{Estimated, Judged, disguise, judge};
use crate::diagnosis::parallel;
use crate::diagnosis::power::undetected;
use crate::diagnosis::rolled::{self, Roller};
use crate::diagnosis::select::{Pool, Scored, covariance, select};
use crate::diagnosis::series;
use crate::diagnosis::spread::{self, SpreadTerm};
use crate::diagnosis::support::{Support, support};
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::unit::Unit;
use crate::error::MismatchError;
use crate::evidence::Evidence;
use crate::findings::{Finding, Findings, HeldOut, Verdict};

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
    pub(crate) position: usize,
    pub(crate) support: Support,
    pub(crate) judged: Judged,
    pub(crate) gain: Gain,
}

pub(crate) fn run(recordings: &[Recording], options: &DiagnoseOptions) -> Result<Diagnosis, MismatchError> {
    if options.truth == TruthUse::No {
        return Err(MismatchError::WithoutTruth);
    }
    let tested = roles(recordings, options)?;
    let mut prepared = Vec::new();
    for (recording, role) in recordings.iter().zip(tested) {
        let Some(tested) = role else { continue };
        let models = builtin::models(recording)?;
        let evidence = Evidence::new(recording, &models);
        prepared.push(Prepared { recording, evidence, models, tested });
    }
    let mut all: Vec<Unit<'_>> = prepared
        .iter()
        .enumerate()
        .flat_map(|(index, own)| own.models.iter().map(move |(&robot, model)| (index, own, robot, model)))
        .map(|(index, own, robot, model)| unit(index, own, robot, model))
        .collect();
    let swaps = spread::swaps(&mut all);
    let units: Vec<&Unit<'_>> =
        all.iter().filter(|unit| !prepared[unit.recording].tested && !unit.rows.is_empty()).collect();
    let tests: Vec<&Unit<'_>> =
        all.iter().filter(|unit| prepared[unit.recording].tested && !unit.rows.is_empty()).collect();
    let mut entries = entries(&all.iter().filter(|unit| !prepared[unit.recording].tested).collect::<Vec<_>>());
    let spread_entries = spread::take(&mut entries, &units);

    let mut notes = notes(&prepared, &all);
    let selected = select(&units, &entries.entries);
    let (fit, count) = match selected {
        Some(selected) => (selected.fit, selected.tests + spread_entries.len() + swaps.tests),
        None => return Ok(nothing(&prepared, entries, notes, units.is_empty())),
    };
    let covariance =
        covariance(&units, &fit).unwrap_or_else(|| DMatrix::from_element(fit.slots.len(), fit.slots.len(), f64::NAN));
    let pool = Pool::default().scored(&units, &entries.entries, &fit);
    let mut judgements = judgements(&units, &tests, &fit, &covariance, &pool, count);
    let spread = spread::spread(&units, &tests, &fit, &spread_entries, &swaps, count);
    spread.explain(&mut judgements, &mut notes);
    let found: Vec<&Judgement> = ordered(&judgements);

    for (effect, [first, second]) in disguise(&fit.terms) {
        let both = [first, second].map(|term| found.iter().any(|own| own.position == term));
        if both == [true, true] {
            notes.push(format!(
                "{} together with {} cannot be told from {} by any data: they move the robot alike",
                fit.terms[first].effect.name(),
                fit.terms[second].effect.name(),
                effect.name()
            ));
        }
    }
    let unexplained = judgements.iter().filter(|own| !spread.explains(own.position));
    notes.extend(unexplained.filter(|own| own.judged.verdict.is_none()).map(|own| nuisance(&own.judged)));
    notes.extend(spread.nuisances());
    notes.extend(
        found
            .iter()
            .filter(|own| own.judged.one_off)
            .map(|own| format!("{} happened once and could not be cross-validated", own.judged.estimated.term.effect.name())),
    );

    let roller = Roller { prepared: &prepared, units: &units, tests: &tests };
    let mut findings: Vec<Finding> =
        parallel::map(&found, |own| finding(&units, &roller, &fit, &judgements, own, &entries));
    findings.extend(spread.found().into_iter().map(SpreadTerm::finding));
    let mut undetected = undetected(&units, &pool, count);
    undetected.extend_from_slice(&spread.undetected);
    entries.untestable.extend_from_slice(&spread.untestable);
    let kept: Vec<Term> = found.iter().map(|own| fit.terms[own.position].clone()).collect();
    let corrected_terms: Vec<&Judged> =
        found.iter().map(|own| &own.judged).chain(spread.found().into_iter().map(|own| &own.judged)).collect();
    let names = |tested: bool| -> Vec<String> {
        prepared.iter().filter(|own| own.tested == tested).map(|own| own.recording.name.clone()).collect()
    };
    let findings = Findings {
        verdict: overall(&findings, &units),
        recordings: recordings.iter().map(|recording| recording.name.clone()).collect(),
        fit_on: names(false),
        test_on: names(true),
        findings,
        undetected,
        untestable: entries.untestable,
        roll_outs: rolled::per_robot(&roller, &fit, &kept),
        notes,
    };
    let plots = series::plots(&prepared, &units, &fit, &kept, &found);
    let corrected = prepared
        .iter()
        .map(|own| (own.recording.name.clone(), corrected::corrected(own, &corrected_terms)))
        .collect();
    Ok(Diagnosis { findings, plots, corrected })
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

fn unit<'a>(index: usize, own: &'a Prepared<'a>, robot: RobotId, model: &RobotModel<f64>) -> Unit<'a> {
    let floors = own.recording.nominal.as_ref().map_or_else(Floors::default, |nominal| Floors {
        lateral_slip_s: nominal.noise.odometry_floor_lateral_slip_s,
        sensor_lag_s: nominal.noise.gyro_floor_lag_s,
        command_lag_s: nominal.noise.command_floor_lag_s,
        servo_time_constant_s: model.nominal.servo_time_constant_s,
    });
    let jitter_s = own.recording.nominal.as_ref().map_or(0.0, |nominal| nominal.noise.command_jitter_s);
    Unit::new(&own.evidence, index, robot, model.clone(), floors, jitter_s * UNIFORM_SIGMA)
}

/// What could not be compared at all.
fn notes(prepared: &[Prepared<'_>], units: &[Unit<'_>]) -> Vec<String> {
    let mut notes = Vec::new();
    for unit in units {
        let name = &prepared[unit.recording].recording.name;
        for stretch in &unit.stretches {
            for omission in &stretch.omissions {
                notes.push(format!("{name}, robot {}, {}: {omission}", unit.robot, stretch.channel));
            }
        }
        let (first_s, last_s) = unit.span_s;
        if !unit.rows.is_empty() && last_s - first_s < SHORT_S {
            notes.push(format!(
                "{name}, robot {}: {:.1} s can be compared; below {SHORT_S} s nothing is named",
                unit.robot,
                last_s - first_s
            ));
        }
    }
    notes
}

/// Below this, seconds, there are too few blocks of time for a robust variance.
pub(crate) const SHORT_S: f64 = 20.0;

fn judgements(
    units: &[&Unit<'_>],
    tests: &[&Unit<'_>],
    fit: &Fit,
    covariance: &DMatrix<f64>,
    pool: &[Scored],
    count: usize,
) -> Vec<Judgement> {
    let mut all = Vec::new();
    for position in 0..fit.terms.len() {
        let Some(support) = support(units, fit, position, pool) else { continue };
        let acting: Vec<&Unit<'_>> = support.units.iter().map(|&unit| units[unit]).collect();
        let gain = if tests.is_empty() {
            cross_fitted(&acting, &support.with, &support.without)
        } else {
            on_tests(tests, &fit.terms[position], &support)
        };
        let estimated = Estimated::of(fit, covariance, position);
        let judged = judge(units, &support, estimated, (fit, covariance, position), gain, count);
        all.push(Judgement { position, support, judged, gain });
    }
    all
}

/// The gain on recordings that were not fitted on.
fn on_tests(tests: &[&Unit<'_>], term: &Term, support: &Support) -> Gain {
    let acting: Vec<&Unit<'_>> = tests.iter().copied().filter(|unit| term.acts_on(unit.robot)).collect();
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

/// Says what was significant and is no finding.
pub(crate) fn nuisance(judged: &Judged) -> String {
    let term = &judged.estimated.term;
    let whose = match term.whose {
        Whose::Robot(robot) => format!("robot {robot}"),
        Whose::Everyone => "all robots".to_owned(),
    };
    let values: Vec<String> = judged
        .estimated
        .parameters()
        .into_iter()
        .map(|(label, estimate)| format!("{label} = {:.3e} {}", estimate.value, estimate.unit))
        .collect();
    format!(
        "{whose}: {} ({}) is there, but too small to matter or of no use on data left out; it is no finding",
        term.effect.name(),
        values.join(", ")
    )
}

fn finding(
    units: &[&Unit<'_>],
    roller: &Roller<'_, '_>,
    fit: &Fit,
    judgements: &[Judgement],
    own: &Judgement,
    entries: &Entries,
) -> Finding {
    let term = &own.judged.estimated.term;
    let info = term.effect.info();
    let robots: BTreeSet<u32> =
        own.support.units.iter().map(|&unit| units[unit].robot.0).collect();
    let mut support_set: Vec<String> =
        own.support.members.iter().map(|effect| effect.name().to_owned()).collect();
    support_set.dedup();
    let verdict = own.judged.verdict.unwrap_or(Verdict::CannotTell);
    let rivals: Vec<Effect> = own.support.members.iter().skip(1).copied().collect();
    let _ = entries;
    let manoeuvre = (!rivals.is_empty()).then(|| info.broken_by.to_owned());
    let kept: Vec<Term> = judgements
        .iter()
        .filter(|other| other.judged.verdict.is_some())
        .map(|other| fit.terms[other.position].clone())
        .collect();
    Finding {
        verdict,
        robots: robots.into_iter().collect(),
        stage: info.stage.name().to_owned(),
        channel: own.judged.channel.name().to_owned(),
        effect: Some(info.name.to_owned()),
        expression: None,
        expression_units: None,
        support_set,
        parameters: own.judged.estimated.parameters(),
        place: own.judged.place.clone(),
        p_familywise: own.judged.p_familywise,
        held_out: HeldOut {
            log_score_gain: own.gain.total,
            log_score_gain_se: own.gain.standard_error,
            rollout_rmse: rolled::of_finding(roller, own, &kept),
        },
        manoeuvre,
        summary: info.summary.to_owned(),
        equation: Some(info.equation.to_owned()),
        configuration: corrected::section(&own.judged.estimated),
    }
}

fn overall(findings: &[Finding], units: &[&Unit<'_>]) -> Verdict {
    let order = [Verdict::Named, Verdict::BadData, Verdict::CannotTell, Verdict::Unnameable];
    let tested = units.iter().any(|unit| unit.span_s.1 - unit.span_s.0 >= SHORT_S);
    order
        .into_iter()
        .find(|verdict| findings.iter().any(|finding| finding.verdict == *verdict))
        .unwrap_or(if tested { Verdict::NothingMissing } else { Verdict::Untestable })
}

/// What is said where nothing could be compared.
fn nothing(prepared: &[Prepared<'_>], entries: Entries, mut notes: Vec<String>, empty: bool) -> Diagnosis {
    if !empty {
        notes.push("the nominal model predicts values that are no finite numbers; nothing was fitted".to_owned());
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
