//! Whether innovations tell of the next ones.

/// Correlation of each innovation with the next of the same stream, over all streams.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Whiteness {
    /// Pairs of successive innovations.
    pub pairs: usize,
    /// Their correlation: 0 for a consistent filter.
    pub correlation: f64,
    /// Where it lies with 95 % probability, either side of 0, if innovations are white.
    pub bound_95: f64,
}

impl Whiteness {
    /// From streams of innovations of one sensor and target each, in the order of time, per component. `None` without two
    /// successive ones, or if all are zero.
    pub fn from_streams<'a>(streams: impl IntoIterator<Item = &'a [f64]>) -> Option<Self> {
        let (mut pairs, mut products, mut squares) = (0_usize, 0.0, 0.0);
        for stream in streams {
            for pair in stream.windows(2) {
                pairs += 1;
                products += pair[0] * pair[1];
                squares += f64::midpoint(pair[0] * pair[0], pair[1] * pair[1]);
            }
        }
        (squares > 0.0).then(|| Self {
            pairs,
            correlation: products / squares,
            bound_95: 1.96 / (pairs as f64).sqrt(),
        })
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    #[test]
    fn white_noise_is_white_and_what_remembers_half_of_itself_is_not() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let white: Vec<f64> = (0..4000).map(|_| StandardNormal.sample(&mut random)).collect();
        let found = Whiteness::from_streams([&white[..2000], &white[2000..]]).unwrap();
        assert_eq!(found.pairs, 3998);
        assert!(found.correlation.abs() < found.bound_95, "{found:?}");
        let mut last = 0.0;
        let remembering: Vec<f64> = white
            .iter()
            .map(|value| {
                last = 0.5 * last + value;
                last
            })
            .collect();
        // The correlation of an autoregressive process is its coefficient.
        let found = Whiteness::from_streams([remembering.as_slice()]).unwrap();
        assert!((found.correlation - 0.5).abs() < 0.05, "{found:?}");
    }

    #[test]
    fn single_innovations_say_nothing() {
        assert_eq!(Whiteness::from_streams([[1.0].as_slice(), &[]]), None);
        assert_eq!(Whiteness::from_streams([[0.0, 0.0].as_slice()]), None);
    }
}
