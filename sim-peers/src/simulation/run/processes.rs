//! What strikes processes, disks and links, and how processes begin.

use std::collections::BTreeSet;

use pleiad_agent::{Event, Node};
use pleiad_estimation::fact::LogId;
use pleiad_estimation::{RobotId, Timestamp};

use super::{Blow, Due, Run, Violation};

impl Run<'_> {
    pub(super) fn strike(&mut self, blow: Blow) -> Result<(), Violation> {
        match blow {
            Blow::Weather(weather) => self.network.weather = weather,
            Blow::Partition(sides) => {
                self.network.sides = Some((1..).map(RobotId).zip(sides).collect());
            }
            Blow::Heal => self.network.sides = None,
            Blow::Kill { robot, commands, back_s } => {
                if let Some(robot) = self.robots.get_mut(&RobotId(robot)) {
                    robot.doomed = Some((commands, back_s));
                }
            }
            Blow::PowerLoss { robot, back_s } => {
                let robot = RobotId(robot);
                self.checks.damages(robot);
                if self.die(robot, back_s)
                    && let Some(robot) = self.robots.get_mut(&robot)
                {
                    robot.disk.lose_power();
                }
            }
            Blow::DiskLoss { robot, back_s } => {
                let robot = RobotId(robot);
                self.checks.damages(robot);
                if self.die(robot, back_s)
                    && let Some(robot) = self.robots.get_mut(&robot)
                {
                    robot.disk.erase();
                }
            }
            Blow::DiskFull { robot, seconds } => {
                let robot = RobotId(robot);
                if let Some(robot) = self.robots.get_mut(&robot) {
                    robot.disk.full = true;
                }
                self.after(seconds, Due::DiskFree(robot));
            }
            Blow::Evict { robot, at } => self.act(RobotId(at), Event::Evict(RobotId(robot)))?,
        }
        Ok(())
    }

    /// The process of a robot ends; `false` if it was not running.
    pub(super) fn die(&mut self, id: RobotId, back_s: f64) -> bool {
        let Some(robot) = self.robots.get_mut(&id) else { return false };
        robot.doomed = None;
        let ran = robot.node.take().is_some();
        if ran {
            self.outcome.deaths += 1;
            self.after(back_s, Due::Start(id));
        }
        ran
    }

    /// A process begins, from what it finds on its disk.
    pub(super) fn start(&mut self, id: RobotId) -> Result<(), Violation> {
        let torn = self.chance.happens(0.5).then(|| self.chance.unit());
        let nonce = self.chance.bits();
        let Some(robot) = self.robots.get_mut(&id) else { return Ok(()) };
        if robot.node.is_some() {
            return Ok(());
        }
        let records = match robot.disk.found(torn) {
            Ok(records) => records,
            Err(error) => return Err(self.checks.violation(Some(id), error.to_string())),
        };
        #[allow(unused_mut, reason = "a mistake may be planted")]
        let mut node = Node::recover(robot.config.clone(), nonce, records);
        // Who has lost his disk asks the others first; as long as not all are there who know, he waits.
        let lost = self.now > Timestamp(0) && !node.has_lived();
        let full = robot.disk.full;
        let all = self.robots.iter().all(|(other, robot)| {
            *other == id
                || (robot.node.is_some() && self.network.connected(id, *other))
                || (robot.node.is_none() && robot.disk.is_empty())
        });
        if full || (lost && !all) {
            self.after(0.5, Due::Start(id));
            return Ok(());
        }
        #[cfg(feature = "planted")]
        if let Some(planted) = self.options.planted {
            node.plant(planted);
        }
        if let Some(robot) = self.robots.get_mut(&id) {
            robot.node = Some(node);
        }
        if lost {
            // What reached nobody was never said.
            let others = self.robots.iter().filter(|(other, _)| **other != id);
            let heard =
                others.filter_map(|(_, robot)| robot.node.as_ref()).flat_map(|node| node.ledger().digests());
            let heard: BTreeSet<LogId> =
                heard.map(|digest| digest.log).filter(|log| log.robot == id).collect();
            self.checks.unsaid(id, &heard);
            let others: Vec<RobotId> = self.robots.keys().copied().filter(|other| *other != id).collect();
            for other in others {
                let status =
                    self.robots.get_mut(&other).and_then(|robot| Some(robot.node.as_mut()?.status()));
                if let Some(status) = status {
                    self.act(id, Event::Status(status))?;
                }
            }
        }
        Ok(())
    }
}
