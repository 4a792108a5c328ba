//! How the errors of windows that follow each other are correlated, and how they are freed of it.
//!
//! A window ends at the reading with which the next one begins: its error counts in both, with opposite signs, a moving
//! average of order one. Slip lasts longer than a window: its part of the errors is an autoregression of order one.
//! With share `c` of the lasting part,
//!
//! ```text
//! e[t] = sqrt(c) z[t] + sqrt(1 - c) (d[t] w[t] + b[t] w[t-1]),   z[t+1] = f[t] z[t] + sqrt(1 - f[t]^2) v[t]
//! ```
//!
//! with `w`, `v` independent of variance one; an exact Kalman filter of `z` and `w` gives the factor `L` of the
//! correlation (`e = L u`, `u` independent). Its parameters are those of greatest likelihood. Without the lasting
//! part, sums over blocks of 2.5 s miss more than half of the variance of what a slip that lasts 2 s leaves in a slow
//! effect.

/// The parameter of the moving average is searched from this to zero, in so many steps. Near -1 all that a slow effect
/// shows cancels.
const MOST_SHARED: f64 = -0.98;
const SHARED_STEPS: u32 = 49;
/// Of the first search, which the second one refines.
const COARSE: usize = 4;
/// The shares of the lasting part that are tried, and the steps that it lasts.
const SHARES: [f64; 9] = [0.02, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.75, 0.9];
const LASTS: [f64; 7] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0];

/// Windows one after the other.
pub(super) struct Chain {
    /// From each to the next, in median steps.
    pub(super) steps: Vec<f64>,
    /// Whether a window ends where the next begins, less what agitates either: 0 to 1.
    pub(super) links: Vec<f64>,
    /// The share of each error's standard deviation that nothing agitates.
    pub(super) steady: Vec<f64>,
}

/// What a correlation is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shape {
    /// The parameter of the moving average, -1 to 0.
    pub(super) theta: f64,
    /// The share of the lasting part, 0 to 1.
    pub(super) share: f64,
    /// The median steps that it lasts: its time constant.
    pub(super) lasts: f64,
}

/// The factor `L` of a correlation, row by row.
pub(super) struct Correlation {
    rows: Vec<Row>,
}

/// A step of the filter: `e = h z + b w + s u`; then `z = f z + kz u`, `w = kw u`.
#[derive(Clone, Copy)]
struct Row {
    h: f64,
    b: f64,
    s: f64,
    f: f64,
    kz: f64,
    kw: f64,
}

/// Products of spreads that are far from what a number can hold.
const HELD: std::ops::Range<f64> = 1e-200..1e200;

/// What is kept from each value to the next of what lasts for so many steps.
fn kept(lasts: f64, chain: &Chain) -> Vec<f64> {
    chain.steps.iter().map(|steps| libm::exp(-steps / lasts)).collect()
}

impl Correlation {
    #[cfg(test)]
    pub(super) fn new(shape: Shape, chain: &Chain) -> Self {
        Self::kept(shape, chain, &kept(shape.lasts, chain))
    }

    /// The same from what is kept of what lasts.
    fn kept(shape: Shape, chain: &Chain, kept: &[f64]) -> Self {
        let rho = shape.theta / (1.0 + shape.theta * shape.theta);
        let count = chain.steady.len();
        let mut rows = Vec::with_capacity(count);
        // Of the moving average: its diagonal, and what a value has of the one before.
        let (mut diagonal, mut below) = (1.0, 0.0);
        // What the filter does not know of z and w.
        let (mut zz, mut zw, mut ww) = (1.0, 0.0, 0.0);
        for t in 0..count {
            let h = shape.share.sqrt() * chain.steady[t];
            let own = (1.0 - h * h).max(0.0).sqrt();
            let (b, d) = (own * below, own * diagonal);
            let (k0, k1, k2) = (h * zz + b * zw, h * zw + b * ww, d);
            let variance = h * k0 + b * k1 + d * k2;
            let s = variance.sqrt();
            let f = kept.get(t).copied().unwrap_or(0.0);
            rows.push(Row { h, b, s, f, kz: f * k0 / s, kw: k2 / s });
            let posterior = zz - k0 * k0 / variance;
            zz = f * f * posterior + 1.0 - f * f;
            zw = -f * k0 * k2 / variance;
            ww = (1.0 - k2 * k2 / variance).max(0.0);
            if let Some(link) = chain.links.get(t) {
                below = rho * link / diagonal;
                diagonal = (1.0 - below * below).sqrt();
            }
        }
        Self { rows }
    }

    /// The one that makes values likeliest, their variance being what it then is.
    pub(super) fn likeliest(values: &[f64], chain: &Chain) -> Option<(Shape, Self)> {
        let count = values.len();
        if count == 0 || chain.steady.len() != count || chain.links.len() + 1 != count {
            return None;
        }
        let theta = |step: u32| MOST_SHARED * f64::from(step) / f64::from(SHARED_STEPS);
        let plain = |theta| Shape { theta, share: 0.0, lasts: 1.0 };
        let mut best: Option<(f64, Shape, Self)> = None;
        let mut take = |shape: Shape, kept: &[f64]| {
            let own = Self::kept(shape, chain, kept);
            let likelihood = own.log_likelihood(values);
            if likelihood.is_finite() && best.as_ref().is_none_or(|(most, ..)| likelihood > *most) {
                best = Some((likelihood, shape, own));
            }
        };
        let nothing = kept(plain(0.0).lasts, chain);
        for step in 0..=SHARED_STEPS {
            take(plain(theta(step)), &nothing);
        }
        let lasting = LASTS.map(|lasts| (lasts, kept(lasts, chain)));
        for share in SHARES {
            for (lasts, kept) in &lasting {
                for step in (0..=SHARED_STEPS).step_by(COARSE) {
                    take(Shape { theta: theta(step), share, lasts: *lasts }, kept);
                }
            }
        }
        best.map(|(_, shape, own)| (shape, own))
    }

    fn log_likelihood(&self, values: &[f64]) -> f64 {
        let squares: f64 = self.freed(values).iter().map(|value| value * value).sum();
        // The logarithm of a product, taken as seldom as it can be held.
        let (mut spread, mut product) = (0.0, 1.0);
        for row in &self.rows {
            product *= row.s;
            if !HELD.contains(&product) {
                spread += libm::log(product);
                product = 1.0;
            }
        }
        spread += libm::log(product);
        -0.5 * values.len() as f64 * libm::log(squares) - spread
    }

    /// `L^-1 e`.
    pub(super) fn freed(&self, values: &[f64]) -> Vec<f64> {
        let (mut z, mut w) = (0.0, 0.0);
        let one = |(value, row): (&f64, &Row)| {
            let u = (value - row.h * z - row.b * w) / row.s;
            z = row.f * z + row.kz * u;
            w = row.kw * u;
            u
        };
        values.iter().zip(&self.rows).map(one).collect()
    }

    /// `L' a`.
    pub(super) fn gathered(&self, values: &[f64]) -> Vec<f64> {
        let (mut z, mut w) = (0.0, 0.0);
        let mut all: Vec<f64> = values
            .iter()
            .zip(&self.rows)
            .rev()
            .map(|(a, row)| {
                let own = row.s * a + row.kz * z + row.kw * w;
                z = row.h * a + row.f * z;
                w = row.b * a;
                own
            })
            .collect();
        all.reverse();
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Normal(u64);

    impl Normal {
        fn draw(&mut self) -> f64 {
            (0..12).fold(-6.0, |sum, _| {
                self.0 =
                    self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                sum + (self.0 >> 11) as f64 / (1_u64 << 53) as f64
            })
        }
    }

    fn even(count: usize) -> Chain {
        Chain { steps: vec![1.0; count - 1], links: vec![1.0; count - 1], steady: vec![1.0; count] }
    }

    fn plain(theta: f64) -> Shape {
        Shape { theta, share: 0.0, lasts: 1.0 }
    }

    fn product(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    /// The variance of a product with a column.
    fn variance(own: &Correlation, column: &[f64]) -> f64 {
        own.gathered(column).iter().map(|value| value * value).sum()
    }

    #[test]
    fn what_windows_share_is_freed_and_products_stay() {
        let chain = Chain { steps: vec![1.0; 4], links: vec![1.0, 0.5, 0.0, 1.0], steady: vec![1.0; 5] };
        // A correlation of -0.4.
        let own = Correlation::new(plain(-0.5), &chain);
        let (errors, column) = ([0.3, -1.2, 0.8, 2.0, -0.1], [1.0, 0.5, -2.0, 0.25, 3.0]);
        assert!(
            (product(&own.freed(&errors), &own.gathered(&column)) - product(&errors, &column)).abs() < 1e-12
        );
        // The variance of a product with a column: a' R a with the correlations written out.
        let pairs: f64 = (0..4).map(|t| 2.0 * -0.4 * chain.links[t] * column[t] * column[t + 1]).sum();
        assert!((variance(&own, &column) - (product(&column, &column) + pairs)).abs() < 1e-12);
    }

    #[test]
    fn what_lasts_has_the_correlation_of_its_equation() {
        let steps = vec![1.0, 2.5, 1.0, 1.0];
        let steady = vec![1.0, 0.8, 1.0, 0.5, 1.0];
        let chain = Chain { steps: steps.clone(), links: vec![1.0, 0.0, 0.7, 1.0], steady: steady.clone() };
        let shape = Shape { theta: -0.5, share: 0.6, lasts: 3.0 };
        let own = Correlation::new(shape, &chain);
        let mut stamps = vec![0.0];
        for step in &steps {
            stamps.push(stamps[stamps.len() - 1] + step);
        }
        let lasting = |t: usize| 0.6_f64.sqrt() * steady[t];
        let rest = |t: usize| (1.0 - lasting(t).powi(2)).sqrt();
        let column = [1.0, 0.5, -2.0, 0.25, 3.0];
        let mut expected = 0.0;
        for i in 0..5 {
            for j in 0..5 {
                let gap: f64 = (stamps[i] - stamps[j]) / 3.0;
                let mut correlation = lasting(i) * lasting(j) * (-gap.abs()).exp();
                if i == j {
                    correlation += rest(i) * rest(i);
                } else if i.abs_diff(j) == 1 {
                    correlation += rest(i) * rest(j) * -0.4 * chain.links[i.min(j)];
                }
                expected += column[i] * column[j] * correlation;
            }
        }
        assert!((variance(&own, &column) - expected).abs() < 1e-12);
        let errors = [0.3, -1.2, 0.8, 2.0, -0.1];
        assert!(
            (product(&own.freed(&errors), &own.gathered(&column)) - product(&errors, &column)).abs() < 1e-12
        );
    }

    #[test]
    fn a_slow_effect_is_as_sure_as_the_readings_at_both_ends() {
        // Differences of readings with errors of one: of their mean only the first and the last are left.
        let mut normal = Normal(1);
        let readings: Vec<f64> = (0..401).map(|_| normal.draw()).collect();
        let scale = 0.5_f64.sqrt();
        let errors: Vec<f64> = readings.windows(2).map(|pair| scale * (pair[1] - pair[0])).collect();
        let (shape, own) = Correlation::likeliest(&errors, &even(400)).unwrap();
        // One of all readings: 2 * scale^2 = 1, instead of 400 of independent errors.
        let found = variance(&own, &[1.0; 400]);
        assert!((0.5..8.0).contains(&found), "{found} {shape:?}");
        // Readings that are not shared stay independent.
        let (shape, own) = Correlation::likeliest(&readings[..400], &even(400)).unwrap();
        let found = variance(&own, &[1.0; 400]);
        assert!((250.0..=520.0).contains(&found), "{found} {shape:?}");
    }

    #[test]
    fn slip_that_lasts_two_windows_is_seen_to() {
        // e = z + w / 2 in 180 windows; of their sum the variance is that of z times (1 + f) / (1 - f), and that of w.
        let (count, f) = (180_usize, libm::exp(-0.5));
        let mut all = Vec::new();
        for seed in 0..40 {
            let mut normal = Normal(1000 + seed);
            let mut z = normal.draw();
            let mut errors = Vec::new();
            for _ in 0..count {
                errors.push(z + 0.5 * normal.draw());
                z = f * z + (1.0 - f * f).sqrt() * normal.draw();
            }
            let scale = (product(&errors, &errors) / count as f64).sqrt();
            for error in &mut errors {
                *error /= scale;
            }
            let (_, own) = Correlation::likeliest(&errors, &even(count)).unwrap();
            all.push(variance(&own, &vec![1.0; count]) / count as f64);
        }
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let expected = ((1.0 + f) / (1.0 - f) + 0.25) / 1.25;
        assert!((mean / expected - 1.0).abs() < 0.15, "{mean} instead of {expected}");
    }
}
