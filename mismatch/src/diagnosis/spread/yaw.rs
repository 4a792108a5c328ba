//! What the gyro reads beyond the encoders, and what truth turns beyond them, in one likelihood: that of a Kalman
//! filter's innovations (`schweppe1965`).
//!
//! Slip turns the body, so that gyro and truth show it alike; a bias of the gyro only the gyro shows. Slip is white,
//! and an Ornstein-Uhlenbeck process beside it (`uhlenbeck1930`): what lasts for seconds wanders on the gyro as a bias
//! would. Its size and its time constant are unknown.
//!
//! What the encoders say of the yaw rate is wrong at the ends of a window, by a part of a tick, and so is truth: two
//! neighbours have this error with opposite signs.

use crate::diagnosis::noise;
use crate::diagnosis::spread::density::bounded;
use crate::diagnosis::spread::maximum::Density;

/// Logarithm of the sigma of a window of the gyro.
pub(super) const NOISE: usize = 0;
/// The bias at the first window, rad/s.
pub(super) const FIRST: usize = 1;
/// The square of the density of the walk.
pub(super) const WALK: usize = 2;
/// The bias gained by warming up, rad/s, and the logarithm of its time constant.
pub(super) const WARM: usize = 3;
pub(super) const TIME: usize = 4;
/// The variance of the first bias about its parameter: so large that it says nothing, or zero.
pub(super) const UNKNOWN: usize = 5;
/// The variance that the error at one end of a window adds, (rad/s)^2.
pub(super) const EDGE: usize = 6;
/// The variance of the slip's yaw rate that lasts, (rad/s)^2, and the logarithm of its time constant.
pub(super) const SLIP: usize = 7;
pub(super) const LASTING: usize = 8;
/// The variance that white slip gains in a second, rad^2.
pub(super) const SPREAD: usize = 9;
/// The variances of one true heading, and of the change of heading over a window beside it, rad^2.
pub(super) const TRUTH: usize = 10;
pub(super) const TURNED: usize = 11;
pub(super) const PARAMETERS: usize = 12;

/// The state: yaw rate of the slip that lasts; the angle slipped since the window of the gyro began, less the error at
/// its beginning; the same of the window of truth; the bias; the error at the end of what is read.
const RATE: usize = 0;
const SINCE_GYRO: usize = 1;
const SINCE_TRUTH: usize = 2;
const BIAS: usize = 3;
const END: usize = 4;
const STATES: usize = 5;

/// What happens at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Event {
    /// A recording begins: what was before it says nothing.
    First,
    /// A window begins that the one before did not end at.
    GyroBegins,
    TruthBegins,
    /// A window ends: seconds since the recording's first row, the residual (rad/s, rad).
    Gyro(f64, f64),
    Truth(f64),
}

/// Events in their order, each with the seconds since the one before.
pub(super) struct Readings {
    pub(super) events: Vec<(f64, Event)>,
    /// One for each event that is read.
    pub(super) blocks: Vec<usize>,
    /// The length of a window of the gyro, seconds.
    pub(super) window_s: f64,
}

struct Filter {
    mean: [f64; STATES],
    covariance: [[f64; STATES]; STATES],
}

impl Filter {
    /// Slip and bias go on for a time.
    fn pass(&mut self, step_s: f64, parameters: &[f64], constant_s: f64) {
        let (variance, ratio) = (parameters[SLIP], step_s / constant_s);
        self.covariance[BIAS][BIAS] += parameters[WALK] * step_s;
        if variance == 0.0 {
            // No slip lasts: its rate is zero, and known to be.
            for angle in [SINCE_GYRO, SINCE_TRUTH] {
                self.covariance[angle][SINCE_GYRO] += parameters[SPREAD] * step_s;
                self.covariance[angle][SINCE_TRUTH] += parameters[SPREAD] * step_s;
            }
            return;
        }
        let lost = -libm::expm1(-ratio);
        let kept = 1.0 - lost;
        let turned_s = constant_s * lost;
        // The rate goes on as a part of itself; both angles gain the same.
        for angle in [SINCE_GYRO, SINCE_TRUTH] {
            self.mean[angle] += turned_s * self.mean[RATE];
            for other in 0..STATES {
                self.covariance[angle][other] += turned_s * self.covariance[RATE][other];
            }
            for other in 0..STATES {
                self.covariance[other][angle] += turned_s * self.covariance[other][RATE];
            }
        }
        self.mean[RATE] *= kept;
        for other in 0..STATES {
            self.covariance[RATE][other] *= kept;
        }
        for other in 0..STATES {
            self.covariance[other][RATE] *= kept;
        }
        // Exact integrals of the process; for short steps the difference of what nearly cancels is its series.
        let of_angle = if ratio < 1e-2 {
            ratio * ratio * ratio * (2.0 / 3.0 - 0.5 * ratio)
        } else {
            2.0 * ratio - 3.0 + 4.0 * kept - kept * kept
        };
        let of_angle = variance * constant_s * constant_s * of_angle + parameters[SPREAD] * step_s;
        let between = variance * constant_s * lost * lost;
        for angle in [SINCE_GYRO, SINCE_TRUTH] {
            self.covariance[angle][SINCE_GYRO] += of_angle;
            self.covariance[angle][SINCE_TRUTH] += of_angle;
            self.covariance[angle][RATE] += between;
            self.covariance[RATE][angle] += between;
        }
        self.covariance[RATE][RATE] += variance * (1.0 - kept * kept);
    }

    /// A window begins at an error `share` times that of the last end.
    fn begin(&mut self, angle: usize, share: f64) {
        self.mean[angle] = share * self.mean[END];
        for other in (0..STATES).filter(|other| *other != angle) {
            self.covariance[angle][other] = share * self.covariance[END][other];
            self.covariance[other][angle] = self.covariance[angle][other];
        }
        self.covariance[angle][angle] = share * share * self.covariance[END][END];
    }

    /// A new error at the end of a window.
    fn end(&mut self, variance: f64) {
        self.mean[END] = 0.0;
        for other in 0..STATES {
            self.covariance[END][other] = 0.0;
            self.covariance[other][END] = 0.0;
        }
        self.covariance[END][END] = variance;
    }

    /// Takes in a value that is this sum of the states, with white noise; says its log-density.
    fn read(&mut self, value: f64, sum: [f64; STATES], white: f64) -> f64 {
        let mut with = [0.0; STATES];
        for (with, row) in with.iter_mut().zip(&self.covariance) {
            *with = row.iter().zip(&sum).map(|(a, b)| a * b).sum();
        }
        let variance = with.iter().zip(&sum).map(|(a, b)| a * b).sum::<f64>() + white;
        let expected: f64 = self.mean.iter().zip(&sum).map(|(a, b)| a * b).sum();
        let sigma = variance.sqrt();
        let z = (value - expected) / sigma;
        // What is too far off to be of this noise moves the state no further than the likelihood counts it.
        let innovation = z.clamp(-noise::CLIP, noise::CLIP) / sigma;
        for (mean, with) in self.mean.iter_mut().zip(&with) {
            *mean += with * innovation;
        }
        for (row, one) in self.covariance.iter_mut().zip(&with) {
            for (value, other) in row.iter_mut().zip(&with) {
                *value -= one * other / variance;
            }
        }
        bounded(z, sigma)
    }
}

impl Density for Readings {
    fn rows(&self) -> usize {
        self.blocks.len()
    }

    fn blocks(&self) -> &[usize] {
        &self.blocks
    }

    fn fill(&self, parameters: &[f64], into: &mut [f64]) {
        let white = libm::exp(2.0 * parameters[NOISE]);
        let warming_s = libm::exp(parameters[TIME]);
        let lasting_s = libm::exp(parameters[LASTING]);
        let mut filter = Filter { mean: [0.0; STATES], covariance: [[0.0; STATES]; STATES] };
        let mut values = into.iter_mut();
        let mut put = |value: f64| {
            if let Some(into) = values.next() {
                *into = value;
            }
        };
        for (step_s, event) in &self.events {
            if *event == Event::First {
                filter = Filter { mean: [0.0; STATES], covariance: [[0.0; STATES]; STATES] };
                filter.mean[BIAS] = parameters[FIRST];
                filter.covariance[BIAS][BIAS] = parameters[UNKNOWN];
                filter.covariance[RATE][RATE] = parameters[SLIP];
                continue;
            }
            filter.pass(*step_s, parameters, lasting_s);
            match *event {
                Event::First => {}
                Event::GyroBegins => {
                    filter.end(parameters[EDGE]);
                    filter.begin(SINCE_GYRO, -self.window_s);
                }
                Event::TruthBegins => {
                    filter.end(parameters[TRUTH]);
                    filter.begin(SINCE_TRUTH, -1.0);
                }
                Event::Gyro(age_s, residual) => {
                    filter.end(parameters[EDGE]);
                    let warm = match parameters[WARM] {
                        0.0 => 0.0,
                        warm => warm * -libm::expm1(-age_s / warming_s),
                    };
                    put(filter.read(residual - warm, [0.0, 1.0 / self.window_s, 0.0, 1.0, 1.0], white));
                    filter.begin(SINCE_GYRO, -self.window_s);
                }
                Event::Truth(residual) => {
                    filter.end(parameters[TRUTH]);
                    put(filter.read(residual, [0.0, 0.0, 1.0, 0.0, 1.0], parameters[TURNED]));
                    filter.begin(SINCE_TRUTH, -1.0);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;

    #[test]
    fn innovations_have_the_density_of_the_whole() {
        // Windows of the gyro of 0.5 s, of truth of 1 s; each pauses once.
        let gyro = [(0.0, 0.5), (0.5, 1.0), (1.0, 1.5), (1.8, 2.3)];
        let truth = [(0.2, 1.2), (1.2, 2.2), (2.4, 3.4)];
        let residuals = [0.03, -0.01, 0.04, 0.09, 0.02, 0.05, -0.03];
        let mut events: Vec<(f64, Event)> = Vec::new();
        for (index, (begin, end)) in gyro.into_iter().enumerate() {
            if index == 0 || index == 3 {
                events.push((begin, Event::GyroBegins));
            }
            events.push((end, Event::Gyro(end, residuals[index])));
        }
        for (index, (begin, end)) in truth.into_iter().enumerate() {
            if index != 1 {
                events.push((begin, Event::TruthBegins));
            }
            events.push((end, Event::Truth(residuals[4 + index])));
        }
        events.sort_by(|a, b| a.0.total_cmp(&b.0));
        // The order in which they end.
        let ended = [0, 1, 4, 2, 5, 3, 6];
        let mut before = 0.0;
        let mut steps = vec![(0.0, Event::First)];
        for (time_s, event) in events {
            steps.push((time_s - before, event));
            before = time_s;
        }
        let readings = Readings { events: steps, blocks: vec![0; 7], window_s: 0.5 };
        let mut parameters = [0.0; PARAMETERS];
        let (sigma, first, walk, warm, constant_s, unknown) = (0.04_f64, 0.01, 9e-4, 0.02, 1.5_f64, 0.0025);
        let (edge, slip, lasting_s, spread) = (7e-4, 4e-4, 0.8_f64, 2e-4);
        let (heading, turned) = (3e-4, 5e-4);
        for (index, value) in [
            (NOISE, sigma.ln()),
            (FIRST, first),
            (WALK, walk),
            (WARM, warm),
            (TIME, constant_s.ln()),
            (UNKNOWN, unknown),
            (EDGE, edge),
            (SLIP, slip),
            (LASTING, lasting_s.ln()),
            (SPREAD, spread),
            (TRUTH, heading),
            (TURNED, turned),
        ] {
            parameters[index] = value;
        }
        let mut values = vec![0.0; 7];
        readings.fill(&parameters, &mut values);
        // The covariance of the slip between two windows is summed over small pieces of them.
        let shared = |one: (f64, f64), other: (f64, f64)| {
            let pieces = 400;
            let middle = |(begin, end): (f64, f64), k: u32| {
                begin + (end - begin) * (f64::from(k) + 0.5) / f64::from(pieces)
            };
            let mut sum = 0.0;
            for i in 0..pieces {
                for j in 0..pieces {
                    sum += (-(middle(one, i) - middle(other, j)).abs() / lasting_s).exp();
                }
            }
            let lengths = (one.1 - one.0) * (other.1 - other.0);
            let overlap = (one.1.min(other.1) - one.0.max(other.0)).max(0.0);
            slip * sum * lengths / f64::from(pieces * pieces) + spread * overlap
        };
        let window = |row: usize| if row < 4 { gyro[row] } else { truth[row - 4] };
        let meets =
            |of: (f64, f64), with: (f64, f64)| (of.1 - with.0).abs() < 1e-9 || (with.1 - of.0).abs() < 1e-9;
        let covariance = DMatrix::from_fn(7, 7, |a, b| {
            let (i, j) = (ended[a], ended[b]);
            let per_s = |row: usize| if row < 4 { 2.0 } else { 1.0 };
            let (of, with) = (window(i), window(j));
            let mut sum = shared(of, with) * per_s(i) * per_s(j);
            if i < 4 && j < 4 {
                sum += unknown + walk * of.1.min(with.1);
            }
            if i == j {
                sum += if i < 4 { sigma * sigma + 2.0 * edge } else { turned + 2.0 * heading };
            } else if (i < 4) == (j < 4) && meets(of, with) {
                sum -= if i < 4 { edge } else { heading };
            }
            sum
        });
        let error = DVector::from_fn(7, |a, _| {
            let row = ended[a];
            let mean = first + warm * (1.0 - (-window(row).1 / constant_s).exp());
            residuals[row] - if row < 4 { mean } else { 0.0 }
        });
        let factor = covariance.cholesky().unwrap();
        let square = error.dot(&factor.solve(&error));
        let log_determinant: f64 = factor.l().diagonal().iter().map(|own| 2.0 * own.ln()).sum();
        let expected = -0.5 * (square + log_determinant + 7.0 * std::f64::consts::TAU.ln());
        assert!((values.iter().sum::<f64>() - expected).abs() < 1e-4, "{values:?} {expected}");
    }
}
