//! After the blows: everything works again, and the team must agree.

use pleiad_agent::Event;
use pleiad_estimation::RobotId;

use super::{Due, HEALED_S, ROUNDS, Run, STATUS_S, Violation, Weather};

impl Run<'_> {
    /// Everything works again, and the team goes on for a while.
    pub(super) fn heal(&mut self) -> Result<(), Violation> {
        self.network.sides = None;
        self.network.weather = Weather { delay_s: 0.01, jitter_s: 0.01, ..Weather::default() };
        self.due.retain(|_, due| !matches!(due, Due::Blow(_)));
        for robot in self.robots.values_mut() {
            robot.doomed = None;
            robot.disk.full = false;
        }
        self.until(self.now.plus_seconds(HEALED_S))
    }

    /// The input ends, and the team must come to agree.
    pub(super) fn agree(&mut self) -> Result<(), Violation> {
        self.due.retain(|_, due| !matches!(due, Due::Tick(_)));
        let robots: Vec<RobotId> = self.robots.keys().copied().collect();
        for robot in &robots {
            self.act(*robot, Event::InputEnded)?;
        }
        for _ in 0..ROUNDS {
            self.until(self.now.plus_seconds(STATUS_S))?;
            if self.agreed() {
                return self.judge(&robots);
            }
        }
        let mut states = Vec::new();
        for (id, robot) in &mut self.robots {
            if let Some(node) = &mut robot.node {
                let status = node.status();
                let logs: Vec<String> = status
                    .logs
                    .iter()
                    .map(|log| format!("{}.{}:{}", log.log.robot, log.log.boot, log.held))
                    .collect();
                states.push(format!(
                    "robot {id}: estimate {}, {:?}, drained {}, {:?}, logs {}",
                    status.estimate,
                    status.facts,
                    status.drained,
                    status.closure,
                    logs.join(" ")
                ));
            }
        }
        Err(self.checks.violation(None, format!("the team does not agree: {}", states.join("; "))))
    }

    fn agreed(&mut self) -> bool {
        let mut statuses = self.robots.values_mut().filter_map(|robot| Some(robot.node.as_mut()?.status()));
        let Some(first) = statuses.next() else { return false };
        let fine = |status: &pleiad_protocol::Status| {
            let member = status.closure.as_ref().is_none_or(|closure| closure.joining.is_none());
            status.drained && status.facts.pending == 0 && member
        };
        let mut all = 1;
        let same = statuses.all(|status| {
            all += 1;
            status.estimate == first.estimate && fine(&status)
        });
        same && fine(&first) && all == self.robots.len()
    }

    fn judge(&mut self, robots: &[RobotId]) -> Result<(), Violation> {
        self.checks.snapshots()?;
        let closing = self.plan.cell_s.is_some();
        for id in robots {
            let Some(robot) = self.robots.get_mut(id) else { continue };
            let Some(node) = &mut robot.node else { continue };
            let fold = robot.config.fold;
            self.checks.node(node)?;
            self.checks.settled(node, &fold)?;
            // Nothing but the last two cells can be open, and what the others may still ask for.
            let kept = node.ledger().kept();
            if closing && kept > 300 * robots.len() {
                return Err(self.checks.violation(Some(*id), format!("{kept} items are kept")));
            }
            let counts = node.ledger().counts();
            self.outcome.facts = self.outcome.facts.max(counts.used);
            self.outcome.expired = self.outcome.expired.max(counts.expired);
        }
        Ok(())
    }
}
