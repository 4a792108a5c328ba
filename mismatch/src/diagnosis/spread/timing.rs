//! The likelihood of windows of the wheels whose commands come at random times or not at all: see
//! [`executed`](super::executed).

use crate::diagnosis::noise;
use crate::diagnosis::spread::check::{Check, LEAST_OF_TARGET};
use crate::diagnosis::spread::density::{Student, log_sum_of};
use crate::diagnosis::spread::maximum::Density;

/// Logarithms of the white noise of both components.
pub(super) const NOISE: usize = 0;
/// A delay of all commands, seconds.
pub(super) const DELAY: usize = 2;
/// The square of the jitter's greatest delay.
pub(super) const JITTER: usize = 3;
/// The logarithm of the probability of a loss.
pub(super) const LOSS: usize = 4;
/// The reciprocal of the degrees of freedom of the noise: windows that nothing here explains.
pub(super) const TAILS: usize = 5;
/// The logarithm of a probability that is as good as zero.
pub(super) const NEVER: f64 = -14.0;
/// A delay of this length, seconds, shows in a window beyond its noise if it is to be looked at.
const MATTERS_S: f64 = 0.05;

/// One window of the wheels: their mean, and right minus left.
pub(super) struct Row {
    pub(super) residual: [f64; 2],
    /// Change with a delay of every command, rad/s.
    pub(super) delayed: [f64; 2],
    /// The sum of the squares of the same, command by command.
    pub(super) agitation: [f64; 2],
    /// What each of the commands asked for changes if it is lost.
    pub(super) lost: Vec<[f64; 2]>,
    pub(super) declared_jitter_s: f64,
    pub(super) time_s: f64,
}

pub(super) struct Windows {
    pub(super) rows: Vec<Row>,
    pub(super) blocks: Vec<usize>,
}

/// What commands may have done in a window: so many were lost, and what each wheel is off then, in sigmas.
struct Case {
    lost: f64,
    errors: [f64; 2],
    log_density: f64,
}

/// What is the same for every row.
struct Weighed<'p> {
    parameters: &'p [f64],
    white: [f64; 2],
    student: Student,
    /// The logarithm of the probability that a command is not lost.
    kept: f64,
}

impl<'p> Weighed<'p> {
    fn new(parameters: &'p [f64]) -> Self {
        Self {
            parameters,
            white: [0, 1].map(|part| libm::exp(2.0 * parameters[NOISE + part])),
            student: Student::new(parameters[TAILS]),
            kept: libm::log1p(-libm::exp(parameters[LOSS])),
        }
    }

    fn sigma(&self, row: &Row) -> [f64; 2] {
        let jitter = (self.parameters[JITTER] + row.declared_jitter_s.powi(2)) / 12.0;
        [0, 1].map(|part: usize| (self.white[part] + jitter * row.agitation[part]).sqrt())
    }

    /// Writes what may have happened in a row, none, one or two commands lost, and gives its log-density.
    fn cases(&self, row: &Row, cases: &mut Vec<Case>) -> f64 {
        cases.clear();
        let sigma = self.sigma(row);
        let log_scales = libm::log(sigma[0] * sigma[1]);
        let delay_s = self.parameters[DELAY];
        let plain =
            [0, 1].map(|part: usize| (row.residual[part] - delay_s * row.delayed[part]) / sigma[part]);
        let mut add = |changes: [f64; 2], lost: f64, weight: f64| {
            let errors = [0, 1].map(|part: usize| plain[part] - changes[part] / sigma[part]);
            let log_density = self.student.log_density_by(errors, log_scales) + weight;
            cases.push(Case { lost, errors, log_density });
        };
        let lost = self.parameters[LOSS];
        if lost == f64::NEG_INFINITY || row.lost.is_empty() {
            add([0.0; 2], 0.0, 0.0);
        } else {
            let count = row.lost.len() as f64;
            add([0.0; 2], 0.0, count * self.kept);
            for (index, one) in row.lost.iter().enumerate() {
                add(*one, 1.0, lost + (count - 1.0) * self.kept);
                for other in &row.lost[..index] {
                    let both = [one[0] + other[0], one[1] + other[1]];
                    add(both, 2.0, 2.0 * lost + (count - 2.0) * self.kept);
                }
            }
        }
        log_sum_of(cases.iter().map(|case| case.log_density))
    }

    /// The derivatives of the log-density of a row, which is `whole`, by the parameters before the weight of tails.
    fn scores(&self, row: &Row, whole: f64, cases: &[Case]) -> [f64; TAILS] {
        let sigma = self.sigma(row);
        let odds = libm::exp(self.parameters[LOSS] - self.kept);
        let mut scores = [0.0; TAILS];
        for case in cases {
            let share = if cases.len() == 1 { 1.0 } else { libm::exp(case.log_density - whole) };
            for part in 0..2 {
                let wider = share * self.student.slope(case.errors[part]) / (sigma[part] * sigma[part]);
                scores[NOISE + part] += wider * self.white[part];
                scores[JITTER] += wider * row.agitation[part] / 24.0;
                let pulled = share * self.student.pull(case.errors[part]);
                scores[DELAY] += pulled * row.delayed[part] / sigma[part];
            }
            if !row.lost.is_empty() {
                scores[LOSS] += share * (case.lost - (row.lost.len() as f64 - case.lost) * odds);
            }
        }
        scores
    }
}

impl Density for Windows {
    fn rows(&self) -> usize {
        self.rows.len()
    }

    fn blocks(&self) -> &[usize] {
        &self.blocks
    }

    fn fill(&self, parameters: &[f64], into: &mut [f64]) {
        let weighed = Weighed::new(parameters);
        let mut cases = Vec::new();
        for (row, value) in self.rows.iter().zip(into) {
            *value = weighed.cases(row, &mut cases);
        }
    }

    /// Those of the weight of tails are to be differenced: their closed form loses its digits where there are none.
    fn scores(&self, parameters: &[f64], free: &[usize]) -> Vec<Option<Vec<f64>>> {
        let weighed = Weighed::new(parameters);
        let mut all: Vec<[f64; TAILS]> = Vec::with_capacity(self.rows.len());
        let mut cases = Vec::new();
        for row in &self.rows {
            let whole = weighed.cases(row, &mut cases);
            all.push(weighed.scores(row, whole, &cases));
        }
        let of = |&index: &usize| (index < TAILS).then(|| all.iter().map(|own| own[index]).collect());
        free.iter().map(of).collect()
    }

    /// A jitter and a loss are drawn anew for every command: neither they nor what they leave of a delay know the time,
    /// or how much was asked for. What no loss explains is looked at: of windows with one nothing is said.
    fn checks(&self, parameters: &[f64]) -> Vec<Check> {
        let each = |part: usize| {
            let mut late = Vec::new();
            let mut blocks = Vec::new();
            let (mut times, mut sizes) = (Vec::new(), Vec::new());
            for (row, &block) in self.rows.iter().zip(&self.blocks) {
                let jitter = (parameters[JITTER] + row.declared_jitter_s.powi(2)) / 12.0;
                let sigma = (libm::exp(2.0 * parameters[NOISE + part]) + jitter * row.agitation[part]).sqrt();
                let z = (row.residual[part] - parameters[DELAY] * row.delayed[part]) / sigma;
                // Where no command changes anything a delay does not show.
                if row.agitation[part].sqrt() * MATTERS_S < sigma {
                    continue;
                }
                let z = z * row.delayed[part].signum();
                late.push(0.5 * z.clamp(-noise::CLIP, noise::CLIP));
                blocks.push(block);
                times.push(row.time_s);
                sizes.push(row.agitation[part]);
            }
            Check {
                of: "delays",
                left: late,
                blocks,
                drivers: vec![("time", times), ("size", sizes)],
                targets: Vec::new(),
                least_of_target: LEAST_OF_TARGET,
            }
        };
        if parameters[LOSS] > NEVER { Vec::new() } else { vec![each(0), each(1)] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scores_are_the_slopes_of_the_density() {
        let row = |lost: &[[f64; 2]]| Row {
            residual: [0.4, -0.7],
            delayed: [-1.5, 2.5],
            agitation: [2.25, 6.25],
            lost: lost.to_vec(),
            declared_jitter_s: 0.02,
            time_s: 0.0,
        };
        let lost = [[0.5, -0.2], [-0.1, 0.9], [0.3, 0.3]];
        let windows = Windows { rows: vec![row(&[]), row(&lost[..1]), row(&lost)], blocks: vec![0; 3] };
        for parameters in
            [[-1.2, -0.8, 0.01, 4e-3, -2.0, 0.1], [-1.2, -0.8, 0.01, 4e-3, f64::NEG_INFINITY, 0.0]]
        {
            let free: Vec<usize> = (0..=TAILS).filter(|&own| parameters[own].is_finite()).collect();
            let scores = windows.scores(&parameters, &free);
            for (&own, found) in free.iter().zip(&scores) {
                let Some(found) = found else {
                    assert_eq!(own, TAILS);
                    continue;
                };
                let step = 1e-6 * parameters[own].abs();
                let at = |change: f64| {
                    let mut moved = parameters;
                    moved[own] += change;
                    let mut values = vec![0.0; 3];
                    windows.fill(&moved, &mut values);
                    values
                };
                for ((above, below), found) in at(step).iter().zip(at(-step)).zip(found) {
                    let slope = (above - below) / (2.0 * step);
                    assert!((found - slope).abs() < 1e-5 * (1.0 + slope.abs()), "{own}: {found} {slope}");
                }
            }
        }
    }
}
