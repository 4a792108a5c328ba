//! The Kalman filter of a [`Mesh`]: residuals to innovations, and back to the noise and to the references.
//!
//! Readings are taken one number at a time. The covariance does not depend on residuals, so that one run serves every
//! residual and every derivative. What runs backwards is in [`adjoint`].

mod adjoint;

use pleiad_physics::Pose;

use crate::diagnosis::mesh::{Event, Mesh, Move, Read, STATES};

/// Columns that are filtered at once.
pub(crate) const LANES: usize = 8;
/// Gains at given noise.
#[derive(Clone, Debug)]
pub(crate) struct Filter {
    /// As many per reading as there are states.
    gains: Vec<f64>,
    /// One over the standard deviation of each innovation; zero of a reading that is not used.
    pub(crate) roots: Vec<f64>,
    /// By what each reading's variance is larger than its scale says; infinite of one that is not used.
    pub(crate) weights: Vec<f64>,
}

impl Filter {
    /// At so many sigmas per scale; `weights` as in [`Filter`].
    pub(crate) fn new(mesh: &Mesh, scales: &[f64], weights: Vec<f64>) -> Self {
        let mut own =
            Self { gains: vec![0.0; mesh.size * mesh.reads], roots: vec![0.0; mesh.reads], weights };
        own.run(mesh, scales, &mut |_, _| {});
        own
    }

    /// Runs the covariance, and tells it before every move.
    fn run(&mut self, mesh: &Mesh, scales: &[f64], told: &mut dyn FnMut(usize, &[f64])) {
        let size = mesh.size;
        let mut covariance = prior(mesh);
        let mut next = 0;
        for (index, event) in mesh.events.iter().enumerate() {
            match event {
                Event::Lost(at) => {
                    for (offset, variance) in Mesh::lost().into_iter().enumerate() {
                        covariance[(at + offset) * size + at + offset] += variance;
                    }
                }
                Event::Move(own) => {
                    told(index, &covariance);
                    widen(&mut covariance, size, own, scales);
                }
                Event::Read(own) => {
                    let gains = &mut self.gains[next * size..(next + 1) * size];
                    let sigma = scales[own.scale];
                    let noise = sigma * sigma * self.weights[next];
                    self.roots[next] = update(&mut covariance, size, own, noise, gains);
                    next += 1;
                }
            }
        }
        told(mesh.events.len(), &covariance);
    }

    /// Residuals to innovations in sigmas; of moves nothing is left. The gains are those of the references, but what a
    /// correction makes of motion and readings is not linearized.
    pub(crate) fn innovate(&self, mesh: &Mesh, values: &mut [f64]) {
        let mut corrections = vec![Pose::identity(); mesh.size / STATES];
        let mut next = 0;
        for event in &mesh.events {
            match event {
                Event::Lost(_) => {}
                Event::Move(own) => {
                    let moved = &mut values[own.element..own.element + STATES];
                    let correction = &mut corrections[own.at / STATES];
                    *correction = own.corrected(correction, [moved[0], moved[1], moved[2]]);
                    moved.fill(0.0);
                }
                Event::Read(own) => {
                    let [one, other] = [own.own.0, own.other.0].map(|at| corrections[at / STATES]);
                    let innovation = values[own.element] - own.change(&one, &other);
                    let gains = &self.gains[next * mesh.size..(next + 1) * mesh.size];
                    for (correction, gains) in corrections.iter_mut().zip(gains.chunks(STATES)) {
                        let [x, y, yaw] = [0, 1, 2].map(|offset| gains[offset] * innovation);
                        *correction = Pose::exp(x, y, yaw).compose(correction);
                    }
                    values[own.element] = innovation * self.roots[next];
                    next += 1;
                }
            }
        }
    }

    /// The same of several at once, linearized at the references: element by element, one lane each.
    pub(crate) fn whiten<const L: usize>(&self, mesh: &Mesh, values: &mut [[f64; L]]) {
        self.linear(mesh, values, &mut |_, _| {});
    }

    /// The same; the states are told before every move, by the position of the event, and at the end.
    fn linear<const L: usize>(
        &self,
        mesh: &Mesh,
        values: &mut [[f64; L]],
        told: &mut dyn FnMut(usize, &[[f64; L]]),
    ) {
        let mut states = vec![[0.0; L]; mesh.size];
        let mut next = 0;
        for (index, event) in mesh.events.iter().enumerate() {
            match event {
                Event::Lost(_) => {}
                Event::Move(own) => {
                    told(index, &states);
                    let moved = &mut values[own.element..own.element + STATES];
                    for (row, into) in own.into.iter().enumerate() {
                        let state = &mut states[own.at + row];
                        for lane in 0..L {
                            state[lane] += into[0] * moved[0][lane]
                                + into[1] * moved[1][lane]
                                + into[2] * moved[2][lane];
                        }
                    }
                    moved.fill([0.0; L]);
                }
                Event::Read(own) => {
                    let mut innovation = values[own.element];
                    for (at, weights) in [&own.own, &own.other] {
                        for (offset, weight) in weights.iter().enumerate() {
                            let state = &states[at + offset];
                            for lane in 0..L {
                                innovation[lane] -= weight * state[lane];
                            }
                        }
                    }
                    let gains = &self.gains[next * mesh.size..(next + 1) * mesh.size];
                    for (state, gain) in states.iter_mut().zip(gains) {
                        for lane in 0..L {
                            state[lane] += gain * innovation[lane];
                        }
                    }
                    let root = self.roots[next];
                    values[own.element] = innovation.map(|value| value * root);
                    next += 1;
                }
            }
        }
        told(mesh.events.len(), &states);
    }
}

fn prior(mesh: &Mesh) -> Vec<f64> {
    let mut covariance = vec![0.0; mesh.size * mesh.size];
    for (robot, block) in mesh.prior.iter().enumerate() {
        for (row, line) in block.iter().enumerate() {
            for (column, value) in line.iter().enumerate() {
                covariance[(STATES * robot + row) * mesh.size + STATES * robot + column] = *value;
            }
        }
    }
    covariance
}

fn widen(covariance: &mut [f64], size: usize, own: &Move, scales: &[f64]) {
    let variances = [0, 1, 2].map(|component| scales[own.scale + component].powi(2) * own.span_s);
    for row in 0..STATES {
        for column in 0..STATES {
            let sum: f64 = (0..STATES)
                .map(|component| {
                    own.into[row][component] * own.into[column][component] * variances[component]
                })
                .sum();
            covariance[(own.at + row) * size + own.at + column] += sum;
        }
    }
}

/// What a reading is expected to be off by.
fn expected(own: &Read, states: &[f64]) -> f64 {
    let part = |(at, weights): &(usize, [f64; STATES])| -> f64 {
        weights.iter().enumerate().map(|(offset, weight)| weight * states[at + offset]).sum()
    };
    part(&own.own) + part(&own.other)
}

/// Takes a reading in; gives one over the standard deviation of its innovation, and its gains.
fn update(covariance: &mut [f64], size: usize, own: &Read, noise: f64, gains: &mut [f64]) -> f64 {
    if !noise.is_finite() {
        gains.fill(0.0);
        return 0.0;
    }
    for (row, gain) in gains.iter_mut().enumerate() {
        let line = &covariance[row * size..(row + 1) * size];
        *gain = expected(own, line);
    }
    let variance = expected(own, gains) + noise;
    let inverse = 1.0 / variance;
    for row in 0..size {
        let scaled = gains[row] * inverse;
        let line = &mut covariance[row * size..(row + 1) * size];
        for (value, other) in line.iter_mut().zip(gains.iter()) {
            *value -= scaled * other;
        }
    }
    for gain in gains.iter_mut() {
        *gain *= inverse;
    }
    inverse.sqrt()
}

#[cfg(test)]
mod tests;
