//! The filter backwards: the adjoint (`bryson1969`, `dejong1989`), which gives what each noise was and by how much the
//! references are off.

use super::Filter;
use crate::diagnosis::mesh::{Event, Mesh, Read, STATES};

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

/// The sums of a variance: what was, and what was expected.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    found: f64,
    expected: f64,
}

impl Filter {
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
        let mut before = vec![[0.0; STATES]; mesh.events.len()];
        let mut end = Vec::new();
        let mut whitened: Vec<[f64; 1]> = residuals.iter().map(|value| [*value]).collect();
        self.linear(mesh, &mut whitened, &mut |index, states| match mesh.events.get(index) {
            Some(Event::Move(own)) => before[index] = std::array::from_fn(|row| states[own.at + row][0]),
            _ => end = states.iter().map(|[state]| *state).collect(),
        });
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
        let innovations = self.innovations(mesh, &whitened);
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

    /// Innovations by reading, of what is whitened.
    fn innovations(&self, mesh: &Mesh, whitened: &[[f64; 1]]) -> Vec<f64> {
        let read = |event: &Event| match event {
            Event::Read(own) => Some(own.element),
            _ => None,
        };
        let elements = mesh.events.iter().filter_map(read);
        elements
            .zip(&self.roots)
            .map(|(element, root)| if *root > 0.0 { whitened[element][0] / root } else { 0.0 })
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
        let mut whitened: Vec<[f64; 1]> = residuals.iter().map(|value| [*value]).collect();
        self.whiten(mesh, &mut whitened);
        let innovations = self.innovations(mesh, &whitened);
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
