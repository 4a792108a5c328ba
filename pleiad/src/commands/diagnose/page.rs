//! A diagnosis as the report draws it.

use std::collections::BTreeSet;
use std::path::PathBuf;

use pleiad_estimation::{LandmarkId, RobotId};
use pleiad_mismatch::{Channel, Diagnosis, Finding, Findings, RollOut, Verdict};
use pleiad_physics::Effect;
use pleiad_recording::Recording;
use pleiad_report::{
    Claim, DiagnoseReport, DiagnosedRecording, Evidence, Found, HorizonError, Landmark, NotTested,
    ParameterEstimate, ResidualColumns, RobotRollOut, ShapeColumns, SmallestDetectable, StageTest,
};

use super::corrected::seconds;
use super::sentences::{sentences, title};
use crate::commands::replay::command_line;

pub(super) fn report(
    diagnosis: &Diagnosis,
    recordings: &[Recording],
    chosen: &[(String, PathBuf)],
) -> DiagnoseReport {
    let Diagnosis { findings, plots, .. } = diagnosis;
    let robots: BTreeSet<RobotId> =
        recordings.iter().flat_map(|recording| recording.robots.keys().copied()).collect();
    let mut residuals: Vec<ResidualColumns> = plots.residuals.iter().map(residual).collect();
    // Along the chain, robot by robot.
    let order = |series: &ResidualColumns| Channel::ALL.iter().position(|own| words(*own) == series.channel);
    residuals.sort_by_key(|series| (order(series), series.robot));
    DiagnoseReport {
        recordings: recordings
            .iter()
            .map(|recording| DiagnosedRecording { name: recording.name.clone(), seconds: seconds(recording) })
            .collect(),
        fit_on: findings.fit_on.clone(),
        test_on: findings.test_on.clone(),
        claim: claim(findings.verdict),
        findings: findings.findings.iter().map(found).collect(),
        tested: tested(findings, &robots),
        robots: robots.into_iter().collect(),
        roll_outs: findings
            .roll_outs
            .iter()
            .map(|own| RobotRollOut {
                robot: RobotId(own.robot),
                horizons: own.horizons.iter().map(horizon).collect(),
                per_100_m: own.error_per_100_m,
            })
            .collect(),
        undetected: findings
            .undetected
            .iter()
            .map(|own| SmallestDetectable {
                title: title(&own.effect).to_owned(),
                robot: own.robot.map(RobotId),
                parameter: own.parameter.clone(),
                size: own.minimum_detectable,
                unit: own.unit.clone(),
            })
            .collect(),
        untestable: findings
            .untestable
            .iter()
            .map(|own| NotTested {
                title: title(&own.effect).to_owned(),
                robot: own.robot.map(RobotId),
                why: own.why.clone(),
            })
            .collect(),
        notes: findings.notes.clone(),
        residuals,
        evidence: plots.partial.iter().map(evidence).collect(),
        shapes: plots.shapes.iter().map(shape).collect(),
        paths: plots.paths.iter().map(|(robot, path)| (RobotId(*robot), path.clone())).collect(),
        landmarks: plots
            .landmarks
            .iter()
            .map(|(id, [x_m, y_m])| Landmark { id: LandmarkId(*id), x_m: *x_m, y_m: *y_m })
            .collect(),
        commands: commands(chosen),
    }
}

fn commands(chosen: &[(String, PathBuf)]) -> Vec<(String, String)> {
    let mut commands = vec![("This report:".to_owned(), command_line())];
    for (_, path) in chosen {
        let command = format!("pleiad simulate --from {}", path.display());
        commands.push(("Every residual under the nominal model, as tables:".to_owned(), command));
    }
    commands
}

fn claim(verdict: Verdict) -> Claim {
    match verdict {
        Verdict::Named => Claim::Named,
        Verdict::CannotTell => Claim::CannotTell,
        Verdict::Form => Claim::Form,
        Verdict::Unnameable => Claim::Unnameable,
        Verdict::BadData => Claim::BadData,
        Verdict::NothingMissing => Claim::NothingMissing,
        Verdict::Untestable => Claim::Untestable,
    }
}

fn found(finding: &Finding) -> Found {
    let name = finding.effect.as_deref().or(finding.expression.as_deref());
    let own = finding.effect.as_ref().or(finding.expression.as_ref());
    let rivals = finding.support_set.iter().filter(|rival| own != Some(rival));
    Found {
        claim: claim(finding.verdict),
        robots: finding.robots.iter().map(|robot| RobotId(*robot)).collect(),
        stage: finding.stage.clone(),
        channel: channel_words(&finding.channel),
        effect: finding.effect.clone(),
        title: name.map_or("something unnamed", title).to_owned(),
        sentences: sentences(finding),
        parameters: finding
            .parameters
            .iter()
            .map(|(name, own)| ParameterEstimate {
                name: name.clone(),
                value: own.value,
                ci95: own.ci95,
                unit: own.unit.clone(),
            })
            .collect(),
        rivals: rivals.map(|rival| title(rival).to_owned()).collect(),
        time_s: finding.place.time.clone(),
        region_m: finding.place.region_m,
        regime: finding.place.regime.clone(),
        p_familywise: finding.p_familywise,
        gain: [finding.held_out.log_score_gain, finding.held_out.log_score_gain_se],
        roll_outs: finding.held_out.rollout_rmse.iter().map(horizon).collect(),
        manoeuvre: finding.manoeuvre.clone(),
        equation: finding.equation.clone(),
        configuration: finding.configuration.clone(),
    }
}

fn horizon(own: &RollOut) -> HorizonError {
    HorizonError {
        horizon_s: own.horizon_s,
        position_m: [own.nominal, own.refit, own.corrected],
        heading_rad: own.heading_rad,
    }
}

/// Which stages of which robot could be tested: those of the effects that were, or that could not be.
fn tested(findings: &Findings, robots: &BTreeSet<RobotId>) -> Vec<StageTest> {
    let stage = |name: &str| Effect::from_name(name).map(|effect| effect.info().stage.name().to_owned());
    let whose = |robot: Option<u32>| {
        robots.iter().copied().filter(move |own| robot.is_none_or(|robot| own.0 == robot))
    };
    let mut tests = Vec::new();
    for own in &findings.undetected {
        let stage = stage(&own.effect);
        tests.extend(
            whose(own.robot)
                .filter_map(|robot| Some(StageTest { robot, stage: stage.clone()?, testable: true })),
        );
    }
    for own in &findings.untestable {
        let stage = stage(&own.effect);
        tests.extend(
            whose(own.robot)
                .filter_map(|robot| Some(StageTest { robot, stage: stage.clone()?, testable: false })),
        );
    }
    tests
}

fn residual(series: &pleiad_mismatch::ResidualSeries) -> ResidualColumns {
    let (component, unit) = component(series.channel, series.component);
    ResidualColumns {
        recording: series.recording.clone(),
        robot: RobotId(series.robot),
        channel: words(series.channel).to_owned(),
        component,
        unit,
        time_s: series.time_s.clone(),
        nominal: series.nominal.clone(),
        corrected: series.corrected.clone(),
        sigma: series.sigma,
        position_m: series.position_m.clone(),
    }
}

fn evidence(own: &pleiad_mismatch::PartialResidual) -> Evidence {
    let (component, unit) = component(own.channel, own.component);
    Evidence {
        finding: own.finding,
        recording: own.recording.clone(),
        robot: RobotId(own.robot),
        channel: words(own.channel).to_owned(),
        component,
        unit,
        time_s: own.time_s.clone(),
        predicted: own.predicted.clone(),
        residual: own.residual.clone(),
        gain: own.gain.clone(),
    }
}

fn shape(own: &pleiad_mismatch::ShapePlot) -> ShapeColumns {
    let (component, unit) = component(own.channel, own.component);
    ShapeColumns {
        finding: own.finding,
        recording: own.recording.clone(),
        robot: RobotId(own.robot),
        channel: words(own.channel).to_owned(),
        component,
        unit,
        regressor: own.regressor.clone(),
        regressor_unit: own.regressor_unit.clone(),
        x: own.x.clone(),
        residual: own.residual.clone(),
        curve: own.curve.clone(),
    }
}

/// A channel for people; one that has no words yet goes by its name.
fn words(channel: Channel) -> &'static str {
    match channel.name() {
        "actuator" => "wheels against commands",
        "body" => "motion against wheels",
        "commanded_body" => "motion against commands",
        "gps" => "GPS",
        "heading" => "absolute heading",
        "range_to_landmark" => "range to landmarks",
        "bearing_to_landmark" => "bearing of landmarks",
        "range_to_robot" => "range to robots",
        "bearing_to_robot" => "bearing of robots",
        name => name,
    }
}

fn channel_words(name: &str) -> String {
    Channel::ALL
        .into_iter()
        .find(|channel| channel.name() == name)
        .map_or_else(|| name.replace('_', " "), |channel| format!("the channel “{}”", words(channel)))
}

/// A component for people, and its unit; the channel itself if it has only one.
fn component(channel: Channel, position: usize) -> (String, String) {
    let components = channel.components();
    let Some(own) = components.get(position) else { return (position.to_string(), String::new()) };
    if components.len() == 1 {
        return (words(channel).to_owned(), own.unit.to_owned());
    }
    let suffix = format!("_{}", own.unit.replace('/', "_"));
    (own.name.trim_end_matches(&suffix).replace('_', " "), own.unit.to_owned())
}

#[cfg(test)]
mod tests {
    use pleiad_mismatch::Plots;
    use pleiad_recording::RobotRecording;
    use pleiad_report::{diagnose_report, summary_text};

    use super::super::fixture;
    use super::*;

    fn recording() -> Recording {
        let robots = [1, 2].map(|robot| (RobotId(robot), RobotRecording::default()));
        Recording { name: "square".into(), robots: robots.into(), ..Recording::default() }
    }

    #[test]
    fn a_diagnosis_becomes_a_page_with_its_findings_where_they_belong() {
        let diagnosis =
            Diagnosis { findings: fixture::findings(), plots: Plots::default(), corrected: [].into() };
        let report = report(&diagnosis, &[recording()], &[("square".to_owned(), PathBuf::from("square"))]);
        assert_eq!(report.findings[0].title, "unequal wheel diameters");
        assert!(report.findings[0].rivals.is_empty(), "an effect is no rival of itself");
        assert_eq!(report.findings[1].rivals, ["actuator lag (first order)"]);
        // Tested with a sensor effect on robot 1 only; an effect of the body that no robot can show.
        let stages: Vec<_> =
            report.tested.iter().map(|test| (test.robot.0, &*test.stage, test.testable)).collect();
        assert_eq!(stages, [(1, "sensor", true), (1, "body", false), (2, "body", false)]);
        let html = diagnose_report(&report).unwrap().render();
        assert!(html.contains("cannot tell transport delay from actuator lag (first order)"));
    }

    #[test]
    fn a_number_that_is_not_finite_is_null_in_json() {
        let text = summary_text(&fixture::findings()).unwrap();
        assert!(text.contains("\"minimum_detectable\": null"), "{text}");
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
    }
}
