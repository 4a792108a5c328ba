//! The nominal trajectory `N(t)` of one boot and its accumulated process noise `C(t)`.

use std::collections::VecDeque;

use crate::fact::{NominalState, Sensitivity};
use crate::geometry::{Matrix3, Vector3};
use crate::motion::Step;
use crate::symmetric::Symmetric3;
use crate::{Pose2, Timestamp};

/// Odometry integrated from the start of a boot, never corrected, with a history to look back into.
#[derive(Clone, Debug)]
pub struct NominalTrajectory {
    ticks: VecDeque<Tick>,
    /// Derivative of each tick's pose by what is uncertain of the odometry; empty if nothing is calibrated.
    derivatives: VecDeque<Matrix3>,
    horizon: usize,
    start: Timestamp,
    distance_m: f64,
}

#[derive(Clone, Copy, Debug)]
struct Tick {
    time: Timestamp,
    state: NominalState,
}

/// Why a trajectory has no state at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outside {
    /// Before its start.
    Before,
    /// Within it, but no longer kept.
    Forgotten,
    /// After its last odometry: it may still come.
    After,
}

impl NominalTrajectory {
    /// Starts at `time` with `N = nominal` and `C = 0`, keeping the last `horizon` ticks (at least two).
    pub fn new(time: Timestamp, nominal: Pose2, horizon: usize) -> Self {
        let state = NominalState::new(nominal, Symmetric3::zero());
        Self {
            ticks: VecDeque::from([Tick { time, state }]),
            derivatives: VecDeque::new(),
            horizon: horizon.max(2),
            start: time,
            distance_m: 0.0,
        }
    }

    /// Goes on from a state that was kept, with nothing before it.
    pub fn resume(time: Timestamp, state: NominalState, horizon: usize) -> Self {
        let mut trajectory = Self::new(time, state.nominal, horizon);
        trajectory.ticks[0].state = state;
        trajectory
    }

    /// Keeps, from its start, how the states depend on what is uncertain of the odometry.
    #[must_use]
    pub fn calibrated(mut self) -> Self {
        self.derivatives = self.ticks.iter().map(|_| Matrix3::zeros()).collect();
        self
    }

    /// Takes over a state that was computed before; earlier ones than the last are left out.
    pub fn restore(&mut self, time: Timestamp, state: NominalState) {
        let (last, before) = self.end();
        if time > last {
            let moved = state.nominal.position() - before.nominal.position();
            self.distance_m += (moved.x * moved.x + moved.y * moved.y).sqrt();
            // What was kept says nothing of it.
            self.derivatives.clear();
            self.push(Tick { time, state });
        }
    }

    fn push(&mut self, tick: Tick) {
        self.ticks.push_back(tick);
        if self.ticks.len() > self.horizon {
            self.ticks.pop_front();
            self.derivatives.pop_front();
        }
    }

    /// The states kept, by time.
    pub fn ticks(&self) -> impl Iterator<Item = (Timestamp, NominalState)> + '_ {
        self.ticks.iter().map(|tick| (tick.time, tick.state))
    }

    /// Forgets what is not needed to answer for times after `time`.
    pub fn forget_until(&mut self, time: Timestamp) {
        while self.ticks.len() > 2 && self.ticks[1].time <= time {
            self.ticks.pop_front();
            self.derivatives.pop_front();
        }
    }

    /// The first instant of the trajectory.
    pub fn start(&self) -> Timestamp {
        self.start
    }

    /// Path length so far, metres.
    pub fn distance_m(&self) -> f64 {
        self.distance_m
    }

    /// The last odometry.
    pub fn end(&self) -> (Timestamp, NominalState) {
        // The deque is never empty: it is built with one tick and only the oldest of two or more is dropped.
        let last = self.ticks.len() - 1;
        let Tick { time, state } = self.ticks[last];
        let derivative = self.derivatives.get(last).copied();
        let sensitivity = derivative.map(|motion| Sensitivity { motion, twist: self.twist(last.max(1)) });
        (time, NominalState { sensitivity, ..state })
    }

    /// Velocity in the body frame from the tick before the one with this index to it.
    fn twist(&self, next: usize) -> Vector3 {
        match (self.ticks.get(next.wrapping_sub(1)), self.ticks.get(next)) {
            (Some(last), Some(next)) => {
                last.state.nominal.between(&next.state.nominal).log() / next.time.seconds_since(last.time)
            }
            _ => Vector3::zeros(),
        }
    }

    /// `N <- N exp(u)`, `C <- C + Ad_N Q Ad_N^T` with the adjoint at the pose after the step
    /// (`docs/theory.md`, propagation).
    pub fn extend(&mut self, step: &Step) {
        let (_, last) = self.end();
        let nominal = last.nominal.compose(&Pose2::exp(step.motion));
        let added = step.covariance.congruence(&nominal.adjoint());
        let state = NominalState::new(nominal, last.noise_sum.plus(added));
        if let Some(derivative) = self.derivatives.back() {
            // At the middle of the step, where the mean of the adjoint over it is to second order.
            let middle = last.nominal.compose(&Pose2::exp(step.motion * 0.5)).adjoint();
            let (x, y, z) = (step.motion.x, step.motion.y, step.motion.z);
            let seconds = step.to.seconds_since(step.from);
            let columns = Matrix3::new(x, 0.0, 0.0, y, 0.0, 0.0, 0.0, z, -seconds);
            let derivative = derivative + middle * columns;
            self.derivatives.push_back(derivative);
        }
        self.distance_m += (step.motion.x * step.motion.x + step.motion.y * step.motion.y).sqrt();
        self.push(Tick { time: step.to, state });
    }

    /// The state at `time`: the pose interpolated on the group, the noise sum linearly.
    ///
    /// # Errors
    /// [`Outside`] if the trajectory does not cover `time`.
    pub fn at(&self, time: Timestamp) -> Result<NominalState, Outside> {
        if time < self.start {
            return Err(Outside::Before);
        }
        let after = self.ticks.partition_point(|tick| tick.time < time);
        let Some(next) = self.ticks.get(after) else { return Err(Outside::After) };
        if next.time == time {
            let derivative = self.derivatives.get(after).copied();
            let sensitivity =
                derivative.map(|motion| Sensitivity { motion, twist: self.twist(after.max(1)) });
            return Ok(NominalState { sensitivity, ..next.state });
        }
        if after == 0 {
            return Err(Outside::Forgotten);
        }
        let last = self.ticks[after - 1];
        let share = time.seconds_since(last.time) / next.time.seconds_since(last.time);
        let motion = last.state.nominal.between(&next.state.nominal).log();
        let nominal = last.state.nominal.compose(&Pose2::exp(motion * share));
        let grown = next.state.noise_sum.minus(last.state.noise_sum).scaled(share);
        let sensitivity = self.derivatives.get(after).map(|next| {
            let last = self.derivatives[after - 1];
            Sensitivity { motion: last + (next - last) * share, twist: self.twist(after) }
        });
        Ok(NominalState { sensitivity, ..NominalState::new(nominal, last.state.noise_sum.plus(grown)) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arc(ticks: u32, speed: f64, rate: f64, covariance: Symmetric3) -> NominalTrajectory {
        let mut trajectory = NominalTrajectory::new(Timestamp(0), Pose2::new(1.0, 2.0, 0.5), 10_000);
        for k in 0..i64::from(ticks) {
            let (from, to) = (Timestamp(k * 10_000_000), Timestamp((k + 1) * 10_000_000));
            let motion = Vector3::new(speed * 0.01, 0.0, rate * 0.01);
            trajectory.extend(&Step { from, to, motion, covariance });
        }
        trajectory
    }

    #[test]
    fn constant_velocity_follows_the_circle() {
        let trajectory = arc(1000, 0.8, 0.4, Symmetric3::zero());
        let (time, end) = trajectory.end();
        let (t, radius) = (time.seconds(), 0.8 / 0.4);
        let x = 1.0 + radius * ((0.5 + 0.4 * t).sin() - 0.5f64.sin());
        let y = 2.0 - radius * ((0.5 + 0.4 * t).cos() - 0.5f64.cos());
        assert!((end.nominal.x_m() - x).abs() < 1e-10 && (end.nominal.y_m() - y).abs() < 1e-10);
    }

    #[test]
    fn interpolation_lies_on_the_arc_and_stays_between_the_noise_sums() {
        let trajectory = arc(100, 0.8, 0.4, Symmetric3::diagonal(1e-4, 1e-5, 1e-6));
        let fine = arc(100, 0.8, 0.4, Symmetric3::zero());
        let t = Timestamp(503_700_000);
        let state = trajectory.at(t).unwrap();
        let expected = fine.at(Timestamp(500_000_000)).unwrap().nominal.compose(&Pose2::exp(Vector3::new(
            0.8 * 0.0037,
            0.0,
            0.4 * 0.0037,
        )));
        assert!((state.nominal.position() - expected.position()).norm() < 1e-13);
        let (before, after) =
            (trajectory.at(Timestamp(500_000_000)).unwrap(), trajectory.at(Timestamp(510_000_000)).unwrap());
        assert!(state.noise_sum.minus(before.noise_sum).is_positive_semidefinite());
        assert!(after.noise_sum.minus(state.noise_sum).is_positive_semidefinite());
    }

    #[test]
    fn noise_sum_carried_to_the_body_is_the_covariance_of_the_unicycle() {
        // Independent route: P <- F P F^T + Q in the body frame of the moving robot, F = Ad(exp(-u)).
        let q = Symmetric3::diagonal(1e-4, 1e-6, 4e-5);
        let trajectory = arc(300, 0.5, -0.7, q);
        let f = Pose2::exp(Vector3::new(-0.005, 0.0, 0.007)).adjoint();
        let mut body = Matrix3::zeros();
        for _ in 0..300 {
            body = f * body * f.transpose() + q.to_matrix();
        }
        let (_, end) = trajectory.end();
        let map_to_body = end.nominal.inverse().adjoint();
        let carried = end.noise_sum.congruence(&map_to_body).to_matrix();
        assert!((carried - body).norm() < 1e-12 * body.norm().max(1.0));
    }

    #[test]
    fn what_is_not_covered_is_said_apart() {
        let mut trajectory = arc(100, 0.8, 0.4, Symmetric3::zero());
        assert_eq!(trajectory.at(Timestamp(-1)), Err(Outside::Before));
        assert_eq!(trajectory.at(Timestamp(1_000_000_001)), Err(Outside::After));
        trajectory.horizon = 10;
        let step = Step {
            from: Timestamp(1_000_000_000),
            to: Timestamp(1_010_000_000),
            motion: Vector3::zeros(),
            covariance: Symmetric3::zero(),
        };
        for _ in 0..200 {
            trajectory.extend(&step);
        }
        assert_eq!(trajectory.at(Timestamp(5_000)), Err(Outside::Forgotten));
    }

    #[test]
    fn derivatives_are_those_of_other_odometry() {
        // Independent route: the trajectory integrated again with each parameter changed a little.
        let moved = |scale: f64, turn: f64, bias: f64| {
            let mut trajectory =
                NominalTrajectory::new(Timestamp(0), Pose2::new(1.0, 2.0, 0.5), 10_000).calibrated();
            for k in 0..500_i64 {
                let (from, to) = (Timestamp(k * 40_000_000), Timestamp((k + 1) * 40_000_000));
                let rate = if k < 200 { 0.6 } else { -0.9 };
                let motion =
                    Vector3::new(0.5 * 0.04 * (1.0 + scale), 0.0, rate * 0.04 * (1.0 + turn) - bias * 0.04);
                trajectory.extend(&Step { from, to, motion, covariance: Symmetric3::zero() });
            }
            trajectory.at(Timestamp(19_987_000_000)).unwrap()
        };
        let here = moved(0.0, 0.0, 0.0);
        let derivative = here.sensitivity.unwrap().motion;
        let small = 1e-5;
        for (column, other) in
            [moved(small, 0.0, 0.0), moved(0.0, small, 0.0), moved(0.0, 0.0, small)].iter().enumerate()
        {
            let found = other.nominal.compose(&here.nominal.inverse()).log() / small;
            let stated = derivative.column(column);
            assert!((found - stated).norm() < 2e-3 * found.norm(), "{column}: {found} {stated}");
        }
        let twist = here.sensitivity.unwrap().twist;
        assert!((twist - Vector3::new(0.5, 0.0, -0.9)).norm() < 1e-9, "{twist}");
    }
}
