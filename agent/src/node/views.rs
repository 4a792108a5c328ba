//! What can be asked of a node: its estimate, its settled history, its status.

use std::collections::BTreeMap;

use pleiad_estimation::fact::NominalState;
use pleiad_estimation::ledger::FactCounts;
use pleiad_estimation::sample::SampleRefusal;
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, Pose2, RobotId, Timestamp};
use pleiad_protocol::{Estimate, LogStatus, SampleCounts, Status};

use super::segments::Segment;
use super::{Node, Notice, Standing};
use crate::results::Found;

/// One point of a settled trajectory: the estimate at a time on all facts up to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettledEstimate {
    /// When.
    pub time: Timestamp,
    /// During which boot.
    pub boot: BootIndex,
    /// `map_from_robot`.
    pub pose: Pose2,
    /// Covariance of position in the map and yaw.
    pub covariance: Symmetric3,
    /// Dead reckoning from the prior: `odom_from_robot`.
    pub nominal: Pose2,
}

impl Node {
    /// The nominal trajectories of this robot's boots, as far as they are kept, tick by tick.
    pub fn nominal_ticks(
        &self,
    ) -> impl Iterator<Item = (BootIndex, impl Iterator<Item = (Timestamp, NominalState)> + '_)> + '_ {
        self.segments.iter().map(|segment| (segment.boot, segment.trajectory.ticks()))
    }

    /// The estimate at the last odometry, on the facts held now; `None` while the robot has no place in
    /// the map.
    pub fn estimate(&mut self) -> Option<Estimate> {
        let (boot, trajectory) = self.segments.last()?;
        let (time, state) = trajectory.end();
        let joint = self.ledger.settle();
        joint.member(self.config.robot).filter(|member| member.boot == boot)?;
        let odom = self.segments.odom();
        let map_from_odom = joint.correction_at(self.config.robot, time, &state)?.compose(&odom.inverse());
        let (map_from_robot, covariance) = joint.estimate(self.config.robot, time, &state)?;
        let [xx, _, yy, _, _, yaw] = covariance.0;
        Some(Estimate {
            robot: self.config.robot,
            boot,
            time,
            map_from_odom,
            odom_from_robot: odom.compose(&state.nominal),
            map_from_robot,
            covariance,
            sigma: [xx, yy, yaw].map(|variance| variance.max(0.0).sqrt()),
            facts_used: joint.updates(),
        })
    }

    /// The settled trajectory on the grid of estimate times, since the last cut if the team closes its past.
    pub fn settled(&self) -> Vec<SettledEstimate> {
        self.settled_until(Timestamp::MAX)
    }

    /// The settled trajectory after the last cut and up to `until`.
    pub(super) fn settled_until(&self, until: Timestamp) -> Vec<SettledEstimate> {
        let cut = self.ledger.cut();
        let history = self.ledger.settled_history(self.config.robot);
        let mut estimates = Vec::new();
        for Segment { boot, trajectory, odom } in self.segments.iter() {
            let rate = self.config.estimate_rate_hz;
            #[allow(clippy::cast_possible_truncation, reason = "seconds times a rate")]
            let cells = (
                (trajectory.start().seconds() * rate).ceil() as i64,
                (trajectory.end().0.min(until).seconds() * rate).floor() as i64,
            );
            #[allow(clippy::cast_possible_truncation, reason = "seconds times a rate")]
            let first = cut.map_or(cells.0, |cut| cells.0.max((cut.seconds() * rate).floor() as i64));
            for cell in first..=cells.1 {
                let time = Timestamp::from_seconds(cell as f64 / rate);
                if cut.is_some_and(|cut| time <= cut) || time > until {
                    continue;
                }
                let Ok(state) = trajectory.at(time) else { continue };
                let known = history.partition_point(|point| point.time <= time);
                let Some(point) = known.checked_sub(1).map(|last| &history[last]) else { continue };
                // A boot that began at this very instant has taken over.
                if point.boot == *boot {
                    estimates.push(settled(
                        time,
                        *boot,
                        odom.compose(&state.nominal),
                        point.estimate(time, &state),
                    ));
                }
            }
        }
        estimates
    }

    /// What this node holds and does: its digest for peers, its state for operators.
    pub fn status(&mut self) -> Status {
        let estimate = self.ledger.fingerprint();
        // Also logs of which only later entries have come: their author may have lost his journal, and must
        // not begin them again.
        let logs = self.ledger.digests().filter(|digest| digest.held > 0 || digest.waiting > 0);
        let logs: Vec<_> = logs
            .map(|digest| LogStatus { log: digest.log, held: digest.held, chain: digest.chain })
            .collect();
        let FactCounts { relative, absolute, used, rejected, pending, void, .. } = self.ledger.counts();
        let count = |count: usize| count as u64;
        Status {
            robot: self.config.robot,
            boot: self.boot.unwrap_or_default(),
            configuration: self.ledger.configuration(),
            logs,
            facts: pleiad_protocol::FactCounts {
                relative: count(relative),
                absolute: count(absolute),
                used: count(used),
                rejected: count(rejected),
                pending: count(pending),
                void: count(void),
            },
            estimate,
            odometry_until: self.segments.last().map(|(_, trajectory)| trajectory.end().0),
            samples: SampleCounts { accepted: self.counts.accepted, refused: self.counts.refused },
            input_ended: self.input_ended,
            drained: self.drained(),
            closure: self.closure_status(),
        }
    }

    /// Whether nothing is left to be done here: the input has ended and every observation that names this
    /// robot is answered.
    pub fn drained(&self) -> bool {
        self.input_ended
            && self.waiting.is_empty()
            && self.ledger.unanswered(self.config.robot).next().is_none()
    }

    /// Why samples were refused, and how often.
    pub fn refusals(&self) -> impl Iterator<Item = (&str, u64)> {
        self.counts.reasons.iter().map(|(reason, count)| (reason.as_str(), *count))
    }

    /// Why the sample refused last was refused. Notices are given for the first of a reason only.
    pub fn last_refusal(&self) -> Option<SampleRefusal> {
        self.counts.last
    }

    /// Tells of robots that are believed less, or more, than was told last.
    pub(super) fn tell_standings(&mut self) {
        if self.config.fold.quarantine.is_none() {
            return;
        }
        let joint = self.ledger.settle();
        let now: BTreeMap<RobotId, Standing> =
            joint.members().map(|member| (member.robot, Standing::of(joint, member))).collect();
        let last = |robot: &RobotId| self.standings.get(robot).copied().unwrap_or(Standing::Sound);
        let changed: Vec<_> = now.iter().filter(|(robot, standing)| last(robot) != **standing).collect();
        let changed: Vec<_> = changed.into_iter().map(|(robot, standing)| (*robot, *standing)).collect();
        self.standings = now;
        for (robot, standing) in changed {
            self.notice(Notice::Standing { robot, standing });
        }
    }

    /// What was found out besides poses.
    pub fn found(&mut self) -> Found {
        Found::of(self.ledger.settle())
    }

    /// Distance travelled by dead reckoning, m.
    pub fn distance_m(&self) -> f64 {
        self.segments.distance_m()
    }
}

fn settled(
    time: Timestamp,
    boot: BootIndex,
    nominal: Pose2,
    (pose, covariance): (Pose2, Symmetric3),
) -> SettledEstimate {
    SettledEstimate { time, boot, pose, covariance, nominal }
}
