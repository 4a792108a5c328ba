//! The Kalman filter of a [`Mesh`]: residuals to innovations, and back to the noise and to the references.
//!
//! Readings are taken one number at a time. The covariance does not depend on residuals, so that one run serves every
//! residual and every derivative. Backwards runs the adjoint (`bryson1969`, `dejong1989`), which gives what each noise
//! was and by how much the references are off.

use pleiad_physics::Pose;

use crate::diagnosis::mesh::{Event, Mesh, Move, Read, STATES};

/// Columns that are filtered at once.
pub(crate) const LANES: usize = 8;
/// Squares of standardized errors count as this at most in a variance.
const TRIM: f64 = 9.0;
/// The mean of `min(z^2, 9)` of a standard normal.
const NORMAL_MEAN: f64 = 0.995_007_302_8;
/// A reading off by more than so many sigmas is taken for as much less sure.
const CLIP: f64 = 5.0;
/// Moves are at least this unsure, metres or radians per root of a second.
const LEAST_MOVE: f64 = 1e-4;
/// Rounds in which the noise settles, and the change of a logarithm at which it has.
const ROUNDS: usize = 24;
const SETTLED: f64 = 0.005;
/// Steps that shrink by less than this are as good as even; a leap is at most this, of a logarithm.
const MOST_RATIO: f64 = 0.95;
const MOST_LEAP: f64 = 1.5;

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

/// The sums of a variance: what was, and what was expected.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    found: f64,
    expected: f64,
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

    /// The same, linearized at the references.
    fn whiten(&self, mesh: &Mesh, values: &mut [f64]) {
        let mut states = vec![0.0; mesh.size];
        let mut next = 0;
        for event in &mesh.events {
            match event {
                Event::Lost(_) => {}
                Event::Move(own) => {
                    let moved = &mut values[own.element..own.element + STATES];
                    for (row, into) in own.into.iter().enumerate() {
                        states[own.at + row] += into[0] * moved[0] + into[1] * moved[1] + into[2] * moved[2];
                    }
                    moved.fill(0.0);
                }
                Event::Read(own) => {
                    let innovation = values[own.element] - expected(own, &states);
                    let gains = &self.gains[next * mesh.size..(next + 1) * mesh.size];
                    for (state, gain) in states.iter_mut().zip(gains) {
                        *state += gain * innovation;
                    }
                    values[own.element] = innovation * self.roots[next];
                    next += 1;
                }
            }
        }
    }

    /// The same of several at once: element by element, one lane each.
    pub(crate) fn whiten_lanes(&self, mesh: &Mesh, values: &mut [[f64; LANES]]) {
        let mut states = vec![[0.0; LANES]; mesh.size];
        let mut next = 0;
        for event in &mesh.events {
            match event {
                Event::Lost(_) => {}
                Event::Move(own) => {
                    let moved = &mut values[own.element..own.element + STATES];
                    for (row, into) in own.into.iter().enumerate() {
                        let state = &mut states[own.at + row];
                        for lane in 0..LANES {
                            state[lane] += into[0] * moved[0][lane]
                                + into[1] * moved[1][lane]
                                + into[2] * moved[2][lane];
                        }
                    }
                    moved.fill([0.0; LANES]);
                }
                Event::Read(own) => {
                    let mut innovation = values[own.element];
                    for (at, weights) in [&own.own, &own.other] {
                        for (offset, weight) in weights.iter().enumerate() {
                            let state = &states[at + offset];
                            for lane in 0..LANES {
                                innovation[lane] -= weight * state[lane];
                            }
                        }
                    }
                    let gains = &self.gains[next * mesh.size..(next + 1) * mesh.size];
                    for (state, gain) in states.iter_mut().zip(gains) {
                        for lane in 0..LANES {
                            state[lane] += gain * innovation[lane];
                        }
                    }
                    let root = self.roots[next];
                    values[own.element] = innovation.map(|value| value * root);
                    next += 1;
                }
            }
        }
    }

    /// Where the references should be: the correction `xi` of the robot at the stamp before each move and at the end,
    /// by the position of the event.
    pub(crate) fn smoothed(&self, mesh: &Mesh, scales: &[f64], residuals: &[f64]) -> Vec<Vec<[f64; STATES]>> {
        let size = mesh.size;
        let robots = size / STATES;
        // Rows of the covariance and states before each move of a robot, and of all at the end.
        let mut rows: Vec<Vec<f64>> = vec![Vec::new(); mesh.events.len()];
        let mut last = Vec::new();
        let mut own = self.clone();
        own.run(mesh, scales, &mut |index, covariance| match mesh.events.get(index) {
            Some(Event::Move(own)) => {
                rows[index] = covariance[own.at * size..(own.at + STATES) * size].to_vec();
            }
            _ => last = covariance.to_vec(),
        });
        let (before, end) = self.states(mesh, residuals);
        let mut adjoint = vec![0.0; size];
        let mut found: Vec<Vec<[f64; STATES]>> = vec![Vec::new(); robots];
        let corrected = |states: &[f64], rows: &[f64], adjoint: &[f64]| -> [f64; STATES] {
            std::array::from_fn(|row| {
                let line = &rows[row * size..(row + 1) * size];
                states[row] + line.iter().zip(adjoint).map(|(a, b)| a * b).sum::<f64>()
            })
        };
        for (robot, found) in found.iter_mut().enumerate() {
            let at = STATES * robot;
            found.push(corrected(&end[at..at + STATES], &last[at * size..(at + STATES) * size], &adjoint));
        }
        let innovations = self.innovations(mesh, residuals);
        let mut next = mesh.reads;
        for (index, event) in mesh.events.iter().enumerate().rev() {
            match event {
                Event::Lost(_) => {}
                Event::Move(own) => {
                    found[own.at / STATES].push(corrected(&before[index], &rows[index], &adjoint));
                }
                Event::Read(own) => {
                    next -= 1;
                    let error = self.error(next, size, innovations[next], &adjoint);
                    spread(own, error, &mut adjoint);
                }
            }
        }
        for found in &mut found {
            found.reverse();
        }
        found
    }

    /// The states of a robot before each of its moves, by the position of the event, and of all at the end.
    fn states(&self, mesh: &Mesh, residuals: &[f64]) -> (Vec<[f64; STATES]>, Vec<f64>) {
        let mut states = vec![0.0; mesh.size];
        let mut before = vec![[0.0; STATES]; mesh.events.len()];
        let mut next = 0;
        for (index, event) in mesh.events.iter().enumerate() {
            match event {
                Event::Lost(_) => {}
                Event::Move(own) => {
                    before[index] = std::array::from_fn(|row| states[own.at + row]);
                    let moved = &residuals[own.element..own.element + STATES];
                    for (row, into) in own.into.iter().enumerate() {
                        states[own.at + row] += into[0] * moved[0] + into[1] * moved[1] + into[2] * moved[2];
                    }
                }
                Event::Read(own) => {
                    let innovation = residuals[own.element] - expected(own, &states);
                    let gains = &self.gains[next * mesh.size..(next + 1) * mesh.size];
                    for (state, gain) in states.iter_mut().zip(gains) {
                        *state += gain * innovation;
                    }
                    next += 1;
                }
            }
        }
        (before, states)
    }

    /// Innovations by reading.
    fn innovations(&self, mesh: &Mesh, residuals: &[f64]) -> Vec<f64> {
        let mut whitened = residuals.to_vec();
        self.whiten(mesh, &mut whitened);
        let read = |event: &Event| match event {
            Event::Read(own) => Some(own.element),
            _ => None,
        };
        let elements = mesh.events.iter().filter_map(read);
        elements
            .zip(&self.roots)
            .map(|(element, root)| if *root > 0.0 { whitened[element] / root } else { 0.0 })
            .collect()
    }

    /// The error of a reading by all others, over its variance.
    fn error(&self, reading: usize, size: usize, innovation: f64, adjoint: &[f64]) -> f64 {
        let root = self.roots[reading];
        if root == 0.0 {
            return 0.0;
        }
        let gains = &self.gains[reading * size..(reading + 1) * size];
        innovation * root * root - gains.iter().zip(adjoint).map(|(a, b)| a * b).sum::<f64>()
    }

    /// Noise scales by maximum likelihood, from those given: each is multiplied by what its noise was over what it was
    /// expected to be, until that is one. Scales of nothing in the mesh stay.
    pub(crate) fn estimated(
        mesh: &Mesh,
        scales: &mut [f64],
        residuals: &[f64],
        used: &dyn Fn(&Read, f64) -> bool,
    ) -> Self {
        let mut weights = vec![1.0; mesh.reads];
        let readings = mesh.events.iter().filter_map(|event| match event {
            Event::Read(own) => Some(own),
            _ => None,
        });
        for (weight, read) in weights.iter_mut().zip(readings) {
            if !used(read, residuals[read.element]) {
                *weight = f64::INFINITY;
            }
        }
        let mut own = Self::new(mesh, scales, weights);
        let mut before: Option<Vec<f64>> = None;
        for _ in 0..ROUNDS {
            let begun = scales.to_vec();
            own.round(mesh, scales, residuals);
            let steps: Vec<f64> = scales.iter().zip(&begun).map(|(to, from)| libm::log(to / from)).collect();
            let largest = steps.iter().fold(0.0_f64, |largest, step| largest.max(step.abs()));
            // What is hardly known moves slowly, by steps that shrink evenly: they are summed (Aitken).
            if let Some(before) = before.take() {
                for ((scale, first), second) in scales.iter_mut().zip(&before).zip(&steps) {
                    let ratio = second / first;
                    if ratio > 0.0 && ratio < MOST_RATIO {
                        let rest = second * ratio / (1.0 - ratio);
                        *scale *= libm::exp(rest.clamp(-MOST_LEAP, MOST_LEAP));
                    } else if ratio >= MOST_RATIO {
                        *scale *= libm::exp((4.0 * second).clamp(-MOST_LEAP, MOST_LEAP));
                    }
                }
            } else {
                before = Some(steps);
            }
            own = Self::new(mesh, scales, std::mem::take(&mut own.weights));
            if largest < SETTLED {
                break;
            }
        }
        own
    }

    /// One round: new scales and weights.
    fn round(&mut self, mesh: &Mesh, scales: &mut [f64], residuals: &[f64]) {
        let size = mesh.size;
        let innovations = self.innovations(mesh, residuals);
        let mut sums = vec![Sums::default(); scales.len()];
        let mut is_move = vec![false; scales.len()];
        let mut adjoint = vec![0.0; size];
        let mut variance = vec![0.0; size * size];
        let mut product = vec![0.0; size];
        let mut next = mesh.reads;
        for event in mesh.events.iter().rev() {
            match event {
                Event::Lost(_) => {}
                Event::Move(own) => {
                    for component in 0..STATES {
                        let into = [0, 1, 2].map(|row| own.into[row][component]);
                        let mut found = 0.0;
                        let mut expected = 0.0;
                        for (row, a) in into.iter().enumerate() {
                            found += a * adjoint[own.at + row];
                            for (column, b) in into.iter().enumerate() {
                                expected += a * b * variance[(own.at + row) * size + own.at + column];
                            }
                        }
                        let sum = &mut sums[own.scale + component];
                        sum.found += own.span_s * found * found;
                        sum.expected += own.span_s * expected;
                        is_move[own.scale + component] = true;
                    }
                }
                Event::Read(own) => {
                    next -= 1;
                    let root = self.roots[next];
                    if root == 0.0 {
                        continue;
                    }
                    let gains = &self.gains[next * size..(next + 1) * size];
                    let error = self.error(next, size, innovations[next], &adjoint);
                    // product = variance * gains; spread = 1/S + gains' variance gains.
                    let mut inner = 0.0;
                    for (row, value) in product.iter_mut().enumerate() {
                        let line = &variance[row * size..(row + 1) * size];
                        *value = line.iter().zip(gains).map(|(a, b)| a * b).sum();
                        inner += *value * gains[row];
                    }
                    let expected = root * root + inner;
                    let square = error * error / expected;
                    let weight = &mut self.weights[next];
                    let sum = &mut sums[own.scale];
                    sum.found += *weight * square.min(TRIM) / NORMAL_MEAN * expected;
                    sum.expected += *weight * expected;
                    *weight = (square.sqrt() * weight.sqrt() / CLIP).max(1.0);
                    adjoin(own, &product, expected, &mut variance, size);
                    spread(own, error, &mut adjoint);
                }
            }
        }
        for ((scale, sum), is_move) in scales.iter_mut().zip(&sums).zip(is_move) {
            if sum.expected <= 0.0 {
                continue;
            }
            let least = if is_move { LEAST_MOVE } else { f64::MIN_POSITIVE };
            let factor = (sum.found / sum.expected).sqrt().clamp(0.1, 10.0);
            *scale = (*scale * factor).max(least);
        }
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

/// Adds what a reading says to the adjoint.
fn spread(own: &Read, error: f64, adjoint: &mut [f64]) {
    for (at, weights) in [&own.own, &own.other] {
        for (offset, weight) in weights.iter().enumerate() {
            adjoint[at + offset] += weight * error;
        }
    }
}

/// Adds what a reading says to the variance of the adjoint: `(I - K h)' V (I - K h) + h' h / S`, where `product` is
/// `V K`.
fn adjoin(own: &Read, product: &[f64], expected: f64, variance: &mut [f64], size: usize) {
    for (at, weights) in [&own.own, &own.other] {
        for (offset, weight) in weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
            let index = at + offset;
            for (other, value) in product.iter().enumerate() {
                variance[index * size + other] -= weight * value;
                variance[other * size + index] -= weight * value;
            }
        }
    }
    for (at, weights) in [&own.own, &own.other] {
        for (offset, weight) in weights.iter().enumerate() {
            for (other_at, other_weights) in [&own.own, &own.other] {
                for (other_offset, other_weight) in other_weights.iter().enumerate() {
                    variance[(at + offset) * size + other_at + other_offset] +=
                        weight * other_weight * expected;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
