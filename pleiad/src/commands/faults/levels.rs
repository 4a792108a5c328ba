//! From the faults of a file and the levels of the command line to plans.

use anyhow::bail;
use pleiad_bus::FaultPlan;
use pleiad_bus::faults::{Fault, Rule};

/// One column of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// Percent.
    pub loss_percent: f64,
    /// Mean number of messages lost in a row; 1 is independent loss.
    pub burst: f64,
    /// What goes wrong.
    pub plan: FaultPlan,
}

/// The faults of a file with their loss replaced by each level; where the file says nothing of loss, a loss
/// in the middle third of the run is added.
pub fn levels(base: &FaultPlan, loss: &[f64], bursts: &[f64], seconds: f64) -> anyhow::Result<Vec<Level>> {
    let is_loss = |rule: &Rule| matches!(rule.fault, Fault::Loss { .. } | Fault::Burst { .. });
    let mut base = base.clone();
    if !base.rules.iter().any(is_loss) {
        let window = match base.window_s() {
            Some((start_s, end_s)) if end_s.is_finite() => (start_s, end_s),
            _ => (seconds / 3.0, 2.0 * seconds / 3.0),
        };
        base.rules.push(Rule::always(Fault::Loss { loss: 0.0 }).between(window.0, window.1));
    }
    let mut levels = Vec::new();
    for percent in loss {
        if !(0.0..=100.0).contains(percent) {
            bail!("--loss {percent}: expected percentages from 0 to 100, as in 0,50,90");
        }
        for burst in bursts {
            if !burst.is_finite() || *burst < 1.0 {
                bail!("--burst {burst}: expected numbers of messages from 1, as in 1,10,100");
            }
            // Without loss there are no bursts.
            if *percent == 0.0 && levels.iter().any(|level: &Level| level.loss_percent == 0.0) {
                continue;
            }
            let share = percent / 100.0;
            let fault = if *burst > 1.0 && share > 0.0 {
                Fault::Burst { loss: share, mean_length: *burst }
            } else {
                Fault::Loss { loss: share }
            };
            let mut plan = base.clone();
            for rule in plan.rules.iter_mut().filter(|rule| is_loss(rule)) {
                rule.fault = fault.clone();
                if let Err(wrong) = rule.check() {
                    bail!("--loss {percent} with --burst {burst}: {wrong}");
                }
            }
            let burst = if *percent == 0.0 { 1.0 } else { *burst };
            levels.push(Level { loss_percent: *percent, burst, plan });
        }
    }
    if levels.is_empty() {
        bail!("--loss and --burst: expected at least one value each");
    }
    Ok(levels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_replaces_the_loss_of_the_file_and_keeps_its_other_faults() {
        let text = "[[fault]]\nwhat = \"loss\"\nloss = 0.3\nstart_s = 10\nend_s = 20\n\
                    [[fault]]\nwhat = \"delay\"\ndelay_s = 0.1\n";
        let base = FaultPlan::from_toml(text, "f.toml").unwrap();
        let levels = levels(&base, &[0.0, 50.0], &[1.0, 10.0], 60.0).unwrap();
        let found: Vec<_> = levels.iter().map(|level| (level.loss_percent, level.burst)).collect();
        assert_eq!(found, [(0.0, 1.0), (50.0, 1.0), (50.0, 10.0)]);
        assert_eq!(levels[2].plan.rules[0].fault, Fault::Burst { loss: 0.5, mean_length: 10.0 });
        assert!(levels.iter().all(|level| level.plan.rules[1] == base.rules[1]));
        assert!(levels.iter().all(|level| level.plan.rules[0].end_s.total_cmp(&20.0).is_eq()));
    }

    #[test]
    fn without_a_loss_in_the_file_the_middle_third_is_lossy() {
        let levels = levels(&FaultPlan::default(), &[90.0], &[1.0], 90.0).unwrap();
        let rule = Rule::always(Fault::Loss { loss: 0.9 }).between(30.0, 60.0);
        assert_eq!(levels[0].plan.rules, [rule]);
    }

    #[test]
    fn levels_that_cannot_be_are_refused_by_name() {
        let error = |loss: f64, burst: f64| {
            levels(&FaultPlan::default(), &[loss], &[burst], 90.0).unwrap_err().to_string()
        };
        assert!(error(120.0, 1.0).contains("--loss 120"));
        assert!(error(50.0, 0.5).contains("--burst 0.5"));
        assert!(error(90.0, 2.0).contains("mean_length is 2; expected at least loss / (1 - loss)"));
    }
}
