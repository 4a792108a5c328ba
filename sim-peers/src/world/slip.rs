//! Slip: how the body departs from what its wheels do, white and lasting.

use pleiad_estimation::RobotId;
use pleiad_estimation::geometry::Vector3;
use rand_chacha::ChaCha12Rng;

use super::random::{Channel, Seed, Tails, normal};
use crate::scenario::{LastingSlip, RobotSettings};

/// Where the slip of a robot comes from.
pub(super) struct Slip {
    white: ChaCha12Rng,
    tails: Tails,
    lasting: Lasting,
}

impl Slip {
    pub(super) fn new(seed: Seed, robot: RobotId, settings: &RobotSettings) -> Self {
        Self {
            white: seed.stream(robot, Channel::Slip),
            tails: Tails::new(seed, robot, Channel::Slip, settings.noise_degrees_of_freedom),
            lasting: Lasting::new(seed, robot, settings.odometry.lasting),
        }
    }

    /// The slip since the beginning of a tick at each of its knots, which are `knot_s` seconds apart. `sigmas` are
    /// those of white slip from knot to knot. The variates are drawn even where their variance is zero, so that
    /// standing still does not shift what comes later.
    pub(super) fn tick(&mut self, knots: usize, sigmas: [f64; 3], knot_s: f64, moving: bool) -> Vec<Vector3> {
        let tail = self.tails.factor();
        let mut sum = Vector3::zeros();
        (0..knots)
            .map(|_| {
                for (component, sigma) in sum.iter_mut().zip(sigmas) {
                    *component += sigma * tail * normal(&mut self.white);
                }
                let displacement = self.lasting.step(knot_s);
                if moving {
                    sum += displacement;
                }
                sum
            })
            .collect()
    }
}

/// Three independent Ornstein-Uhlenbeck velocities. A robot that has none draws nothing.
struct Lasting {
    sigmas: [f64; 3],
    time_constant_s: f64,
    stream: ChaCha12Rng,
    velocity: [f64; 3],
}

impl Lasting {
    fn new(seed: Seed, robot: RobotId, settings: LastingSlip) -> Self {
        let sigmas = [settings.speed_m_s, settings.lateral_m_s, settings.yaw_rad_s];
        let mut stream = seed.stream(robot, Channel::Lasting);
        // It has lasted for ever.
        let velocity = sigmas.map(|sigma| sigma * normal(&mut stream));
        Self { sigmas, time_constant_s: settings.time_constant_s, stream, velocity }
    }

    /// Moves the velocities on and gives the displacement meanwhile. Both are drawn together from their joint
    /// normal distribution (`gillespie1996`), so that the length of the step does not matter.
    fn step(&mut self, step_s: f64) -> Vector3 {
        let mut displacement = Vector3::zeros();
        if self.sigmas.iter().all(|sigma| *sigma == 0.0) {
            return displacement;
        }
        let (tau, spans) = (self.time_constant_s, step_s / self.time_constant_s);
        let kept = (-spans).exp();
        // Given the velocity at the beginning, in units of sigma: standard deviation of the velocity, covariance
        // with the displacement over it, and what of the displacement remains.
        let spread = (1.0 - kept * kept).sqrt();
        let shared = tau * (1.0 - kept).powi(2) / spread;
        let whole = tau * tau * (2.0 * spans - 3.0 + 4.0 * kept - kept * kept);
        let rest = (whole - shared * shared).max(0.0).sqrt();
        for axis in 0..3 {
            let sigma = self.sigmas[axis];
            let [first, second] = [normal(&mut self.stream), normal(&mut self.stream)];
            displacement[axis] =
                tau * (1.0 - kept) * self.velocity[axis] + sigma * (shared * first + rest * second);
            self.velocity[axis] = kept * self.velocity[axis] + sigma * spread * first;
        }
        displacement
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: LastingSlip =
        LastingSlip { speed_m_s: 0.02, lateral_m_s: 0.01, yaw_rad_s: 0.03, time_constant_s: 2.0 };

    /// Displacements over windows of `window_s` made of `steps` steps.
    fn windows(window_s: f64, steps: u32, count: usize) -> Vec<Vector3> {
        let mut lasting = Lasting::new(Seed(3), RobotId(1), SETTINGS);
        let step_s = window_s / f64::from(steps);
        let window = |_| (0..steps).map(|_| lasting.step(step_s)).sum();
        (0..count).map(window).collect()
    }

    /// Bartlett's formula for a variance estimated from correlated windows: the windows of this test have an
    /// integrated squared correlation below 3, so that 200 000 of them give it to 0.6 % (one sigma).
    const COUNT: usize = 200_000;
    const TOLERANCE: f64 = 0.03;

    #[test]
    fn displacements_have_the_variance_of_the_integrated_process() {
        for (window_s, steps) in [(1.0, 1), (1.0, 20), (4.0, 3)] {
            let all = windows(window_s, steps, COUNT);
            let expected = SETTINGS.variance(window_s);
            for axis in 0..3 {
                let found = all.iter().map(|own| own[axis].powi(2)).sum::<f64>() / COUNT as f64;
                let ratio = found / expected[axis];
                assert!((ratio - 1.0).abs() < TOLERANCE, "{window_s} s in {steps} steps: {ratio}");
            }
        }
    }

    #[test]
    fn neighbouring_windows_are_correlated_as_the_autocovariance_says() {
        // cov = sigma^2 tau^2 (1 - exp(-T / tau))^2 for neighbours, times exp(-T / tau) for those one farther.
        let (window_s, tau): (f64, f64) = (1.0, SETTINGS.time_constant_s);
        let all = windows(window_s, 5, COUNT);
        let kept = (-window_s / tau).exp();
        for (lag, factor) in [(1, 1.0), (2, kept)] {
            let expected = (SETTINGS.speed_m_s * tau * (1.0 - kept)).powi(2) * factor;
            let pairs = all.iter().zip(&all[lag..]);
            let found = pairs.map(|(a, b)| a.x * b.x).sum::<f64>() / (COUNT - lag) as f64;
            let ratio = found / expected;
            assert!((ratio - 1.0).abs() < TOLERANCE, "lag {lag}: {ratio}");
        }
    }

    #[test]
    fn heavy_tails_keep_the_variance_and_put_more_beyond_four_sigmas() {
        // P(|t_5| sqrt(3/5) > 4) = 0.003573 by its distribution function; a normal one has 6.3e-5.
        let degrees = 5.0;
        let mut tails = Tails::new(Seed(5), RobotId(1), Channel::Slip, degrees);
        let mut stream = Seed(5).stream(RobotId(1), Channel::Slip);
        let draws: Vec<f64> = (0..COUNT).map(|_| tails.factor() * normal(&mut stream)).collect();
        let variance = draws.iter().map(|draw| draw * draw).sum::<f64>() / COUNT as f64;
        // The kurtosis of t_5 is 9: the variance of the mean square is 8 / COUNT.
        assert!((variance - 1.0).abs() < 4.0 * (8.0 / COUNT as f64).sqrt(), "variance {variance}");
        let beyond = draws.iter().filter(|draw| draw.abs() > 4.0).count() as f64 / COUNT as f64;
        let expected = 0.003_573;
        assert!((beyond - expected).abs() < 4.0 * (expected / COUNT as f64).sqrt(), "beyond {beyond}");
        assert_eq!(Tails::new(Seed(5), RobotId(1), Channel::Slip, 0.0).factor().to_bits(), 1.0_f64.to_bits());
    }
}
