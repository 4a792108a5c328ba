//! What the stage says, in the form of findings.

use crate::diagnosis::corrected::sections;
use crate::diagnosis::run::Judgement;
use crate::diagnosis::spread::{Explained, Spread, SpreadTerm};
use crate::findings::{Finding, HeldOut, Verdict};

impl Spread {
    /// Takes from terms of the mean what an effect of spread explains of them, and gives them the rivals that only
    /// this stage knows; says so.
    pub(crate) fn explain(&self, judgements: &mut [Judgement], notes: &mut Vec<String>) {
        for &Explained { position, by, part } in &self.explained {
            for own in judgements.iter_mut().filter(|own| own.group.contains(&position)) {
                let term = &mut own.judged.estimated[0].term;
                let name = term.effect.name();
                if let Some(part) = part {
                    term.values[0] -= part;
                    notes.push(format!("{name} is what remains beside {}: {part:.3e} less", by.name()));
                } else {
                    notes.push(format!("{name} is no finding: it is what {} does to the mean", by.name()));
                    own.judged.verdict = None;
                }
            }
        }
        for &(position, rival) in &self.rivals {
            for own in judgements.iter_mut().filter(|own| own.group.contains(&position)) {
                if own.judged.verdict.is_some() && !own.support.members.contains(&rival) {
                    own.support.members.push(rival);
                    own.judged.verdict = Some(Verdict::CannotTell);
                }
            }
        }
    }

    /// Whether nothing is left of a term of the mean.
    pub(crate) fn explains(&self, position: usize) -> bool {
        self.explained.iter().any(|own| own.position == position && own.part.is_none())
    }

    /// Those with a verdict, the largest gain first.
    pub(crate) fn found(&self) -> Vec<&SpreadTerm> {
        let mut found: Vec<&SpreadTerm> =
            self.terms.iter().filter(|own| own.judged.verdict.is_some()).collect();
        found.sort_by(|a, b| b.gain.total.total_cmp(&a.gain.total));
        found
    }

    /// What is there and no finding.
    pub(crate) fn nuisances(&self) -> Vec<String> {
        let nuisances = self.terms.iter().filter(|own| own.judged.verdict.is_none());
        nuisances.map(|own| crate::diagnosis::said::nuisance(&own.judged.estimated[0].term)).collect()
    }
}

impl SpreadTerm {
    pub(crate) fn finding(&self) -> Finding {
        let info = self.judged.estimated[0].term.effect.info();
        let verdict = self.judged.verdict.unwrap_or(Verdict::CannotTell);
        let robots: Vec<u32> = self.robots.iter().map(|robot| robot.0).collect();
        Finding {
            verdict,
            configuration: sections(&robots, &self.judged.estimated),
            robots,
            stage: info.stage.name().to_owned(),
            channel: self.judged.channel.name().to_owned(),
            effect: Some(info.name.to_owned()),
            expression: None,
            expression_units: None,
            support_set: self
                .support
                .iter()
                .map(|effect| effect.name().to_owned())
                .chain(self.unnamed_rivals.iter().cloned())
                .collect(),
            parameters: self.judged.estimated[0].parameters(),
            place: self.judged.place.clone(),
            p_familywise: self.judged.p_familywise,
            // A wider or a heavier spread moves no prediction.
            held_out: HeldOut {
                log_score_gain: self.gain.total,
                log_score_gain_se: self.gain.standard_error,
                rollout_rmse: Vec::new(),
            },
            shape: None,
            manoeuvre: (self.support.len() > 1).then(|| info.broken_by.to_owned()),
            summary: String::new(),
            equation: Some(info.equation.to_owned()),
        }
    }
}
