//! What is said of terms: a finding with everything that belongs to it, or that it is none.

use std::collections::{BTreeMap, BTreeSet};

use pleiad_estimation::RobotId;

use crate::diagnosis::corrected;
use crate::diagnosis::naming::Estimated;
use crate::diagnosis::rolled::{self, Rolled};
use crate::diagnosis::run::Judgement;
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::unit::Unit;
use crate::findings::{Estimate, Finding, HeldOut, Verdict};

/// Says what was significant and is no finding.
pub(crate) fn nuisance(term: &Term) -> String {
    let whose = match term.whose {
        Whose::Robot(robot) => format!("robot {robot}"),
        Whose::Everyone => "all robots".to_owned(),
    };
    let each = term.parameters().iter().zip(&term.values);
    let values: Vec<String> = each
        .map(|(parameter, value)| format!("{} = {value:.3e} {}", parameter.label(), parameter.unit))
        .collect();
    format!(
        "{whose}: {} ({}) is there, but too small to matter or of no use on data left out; it is no finding",
        term.effect.name(),
        values.join(", ")
    )
}

/// A judgement as a finding.
pub(crate) fn finding(units: &[&Unit<'_>], rolled: &BTreeMap<RobotId, Rolled>, own: &Judgement) -> Finding {
    let info = own.judged.estimated[0].term.effect.info();
    let term = &own.judged.estimated[0].term;
    let acted_on = own.support.units.iter().flat_map(|&unit| units[unit].acted_on(term));
    let robots: BTreeSet<u32> = acted_on.map(|member| member.robot.0).collect();
    let robots: Vec<u32> = robots.into_iter().collect();
    let mut support_set: Vec<String> =
        own.support.members.iter().map(|effect| effect.name().to_owned()).collect();
    support_set.dedup();
    support_set.extend_from_slice(&own.unnamed_rivals);
    let verdict = own.judged.verdict.unwrap_or(Verdict::CannotTell);
    let manoeuvre = (verdict == Verdict::CannotTell).then(|| info.broken_by.to_owned());
    Finding {
        verdict,
        configuration: corrected::sections(&robots, &own.judged.estimated),
        robots,
        stage: info.stage.name().to_owned(),
        channel: own.judged.channel.name().to_owned(),
        effect: Some(info.name.to_owned()),
        expression: None,
        expression_units: None,
        support_set,
        parameters: own.parameters(),
        place: own.judged.place.clone(),
        p_familywise: own.judged.p_familywise.max(f64::MIN_POSITIVE),
        held_out: HeldOut {
            log_score_gain: own.gain.total,
            log_score_gain_se: own.gain.standard_error,
            rollout_rmse: rolled::of_finding(rolled, units, own),
        },
        shape: None,
        manoeuvre,
        // Sentences are the reader's: who writes the findings fills this.
        summary: String::new(),
        equation: Some(info.equation.to_owned()),
    }
}

impl Judgement {
    pub(crate) fn name(&self) -> &'static str {
        self.judged.estimated[0].term.effect.name()
    }

    /// The parameters of its terms, and what only they together have.
    fn parameters(&self) -> BTreeMap<String, Estimate> {
        let mut all: BTreeMap<String, Estimate> =
            self.judged.estimated.iter().flat_map(Estimated::parameters).collect();
        all.extend(self.judged.total.clone());
        all
    }
}
