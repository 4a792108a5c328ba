//! Strategies that need no answer: the observer tells the robot it saw what it measured and what it believes
//! of itself, and the robot that was seen updates itself alone.

use super::block::{Block, Instant};
use super::fusion::{self, Fused, Measured, Split};
use super::peer::{Core, Out, Seen, too_late};
use super::{Command, Counts, MeetingId, Message, Sighting, StrategyKind, View};
use crate::fact::{Noise, Quantity};
use crate::geometry::Matrix3;
use crate::measurement;
use crate::nominal::NominalTrajectory;
use crate::sample::Relative;
use crate::symmetric::Symmetric3;
use crate::{Pose2, RobotId};

/// `independent`, `naive`, `intersection` and `split_intersection`.
#[derive(Debug)]
pub(super) struct OneWay {
    robot: RobotId,
    kind: StrategyKind,
    gate: [f64; 3],
    block: Option<Block>,
    number: u64,
    seen: Seen,
    counts: Counts,
}

impl OneWay {
    pub fn new(robot: RobotId, kind: StrategyKind, gate: [f64; 3]) -> Self {
        Self { robot, kind, gate, block: None, number: 0, seen: Seen::default(), counts: Counts::default() }
    }

    /// What the observer's message says of this robot, by how much of it may be correlated.
    fn measured(&self, own: &Pose2, sighting: &Sighting) -> Option<(Split, Measured)> {
        let at = measurement::of_robot(&sighting.relative, &sighting.pose, own).ok()?;
        let h = at.jacobian;
        let noise = measurement::noise_matrix(&sighting.noise);
        // H_a = -H_b, and the sign does not matter in a square.
        let seen_from = |covariance: Symmetric3| covariance.congruence(&h).to_matrix();
        let (correlated, independent) = (seen_from(sighting.correlated), seen_from(sighting.independent));
        let block = self.block.as_ref()?;
        let zero = Matrix3::zeros();
        let (prior, correlated, independent, noise) = match self.kind {
            StrategyKind::Naive => {
                let prior = Split { correlated: zero, independent: block.covariance };
                (prior, zero, correlated + independent, noise)
            }
            StrategyKind::SplitIntersection => (block.split(), correlated, independent, noise),
            _ => {
                let prior = Split { correlated: block.covariance, independent: zero };
                (prior, correlated + independent + noise, zero, zero)
            }
        };
        let measured = Measured {
            dimension: at.dimension,
            innovation: at.innovation,
            jacobian: h,
            correlated,
            independent,
            noise,
        };
        Some((prior, measured))
    }

    fn fused(&self, prior: &Split, measured: &Measured) -> Option<Fused> {
        match self.kind {
            StrategyKind::Naive => fusion::fuse(prior, measured, 0.5),
            _ => fusion::fuse_best(prior, measured),
        }
    }
}

impl Core for OneWay {
    fn place(&mut self, at: &Instant, pose: &Pose2, noise: &Noise) {
        self.block = Some(Block::placed(at, pose, noise));
    }

    fn absolute(&mut self, at: &Instant, quantity: &Quantity, noise: &Noise, _out: &mut Out) {
        let Some(block) = &mut self.block else { return };
        *block = block.at(at);
        match block.against_map(at, quantity, noise, &self.gate) {
            Some(Ok((fused, _))) => {
                block.take(&fused);
                self.counts.absolute += 1;
            }
            Some(Err(_)) => self.counts.rejected += 1,
            None => self.counts.refused += 1,
        }
    }

    fn sight(&mut self, at: &Instant, robot: RobotId, relative: &Relative, noise: &Noise, out: &mut Out) {
        self.counts.relative += 1;
        if self.kind == StrategyKind::Independent {
            return;
        }
        let Some(block) = &mut self.block else { return };
        *block = block.at(at);
        let split = block.split();
        let split_form = self.kind == StrategyKind::SplitIntersection;
        let symmetric = |m: &Matrix3| Symmetric3::from_lower(m);
        let (correlated, independent) = if split_form {
            (symmetric(&fusion::positive(&split.correlated)), symmetric(&split.independent))
        } else {
            (symmetric(&block.covariance), Symmetric3::zero())
        };
        let id = MeetingId { observer: self.robot, number: self.number };
        self.number += 1;
        let message = Message::Sighting(Sighting {
            id,
            time: at.time,
            relative: *relative,
            noise: *noise,
            pose: block.pose(&at.state),
            correlated,
            independent,
        });
        // What has been told is in somebody else's estimate from now on, and comes back correlated.
        block.independent = Matrix3::zeros();
        out.push(Command::Send { to: robot, message });
    }

    fn receive(&mut self, from: RobotId, message: Message, trajectory: &NominalTrajectory, _out: &mut Out) {
        let Message::Sighting(sighting) = message else {
            self.counts.refused += 1;
            return;
        };
        if self.kind == StrategyKind::Independent || sighting.id.observer != from {
            self.counts.refused += 1;
            return;
        }
        if self.seen.repeated(sighting.id) {
            self.counts.repeated += 1;
            return;
        }
        let state = trajectory.at(sighting.time);
        let (Some(block), Ok(state)) = (&mut self.block, state) else {
            self.counts.refused += 1;
            return;
        };
        if too_late(block.last, sighting.time) {
            self.counts.refused += 1;
            return;
        }
        let at = Instant { time: sighting.time, state };
        *block = block.at(&at);
        let own = block.pose(&state);
        let Some((prior, measured)) = self.measured(&own, &sighting) else {
            self.counts.refused += 1;
            return;
        };
        let Some(fused) = self.fused(&prior, &measured) else {
            // Nothing new in it.
            self.counts.used += 1;
            self.counts.completed += 1;
            return;
        };
        if fused.nis > self.gate[measured.dimension - 1] {
            self.counts.rejected += 1;
        } else if let Some(block) = &mut self.block {
            block.take(&fused);
            self.counts.used += 1;
            self.counts.completed += 1;
        }
    }

    fn view(&self, at: &Instant) -> Option<View> {
        self.block.as_ref().map(|block| block.view(at))
    }

    fn counts(&self) -> Counts {
        self.counts
    }
}
