//! The residuals of a channel in a few numbers.

use pleiad_physics::Scalar;

use crate::residual::ChannelResiduals;

/// The fewest residuals that are summarized.
pub const MIN_RESIDUALS: usize = 10;

/// The median absolute deviation of a normal distribution times this is its standard deviation.
const NORMAL_OVER_MAD: f64 = 1.482_602_218_505_602;

/// One component of the residuals of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// How many residuals.
    pub count: usize,
    /// Their mean.
    pub mean: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// The spread about the median: median absolute deviation, scaled to a normal distribution's standard
    /// deviation.
    pub spread: f64,
}

/// A summary per component; `None` if there are fewer than [`MIN_RESIDUALS`].
pub fn summarize<S: Scalar>(residuals: &ChannelResiduals<S>) -> Option<Vec<Summary>> {
    if residuals.rows.len() < MIN_RESIDUALS {
        return None;
    }
    let component =
        |index: usize| -> Vec<f64> { residuals.rows.iter().map(|row| row.values()[index].value()).collect() };
    Some((0..residuals.channel.components().len()).map(|index| of(component(index))).collect())
}

/// `values` are finite and at least one.
fn of(mut values: Vec<f64>) -> Summary {
    let count = values.len();
    let mean = values.iter().sum::<f64>() / count as f64;
    let rms = (values.iter().map(|value| value * value).sum::<f64>() / count as f64).sqrt();
    let middle = median(&mut values);
    for value in &mut values {
        *value = (*value - middle).abs();
    }
    Summary { count, mean, rms, spread: NORMAL_OVER_MAD * median(&mut values) }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    if values.len().is_multiple_of(2) { f64::midpoint(values[half - 1], values[half]) } else { values[half] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_wild_value_moves_the_mean_and_not_the_spread() {
        let summary = of(vec![1.0, 2.0, 3.0, 4.0, 1000.0]);
        assert_eq!(summary.count, 5);
        assert!((summary.mean - 202.0).abs() < 1e-12);
        assert!((summary.rms - (1_000_030.0_f64 / 5.0).sqrt()).abs() < 1e-9);
        // Deviations from the median 3: 2, 1, 0, 1, 997; their median is 1.
        assert!((summary.spread - NORMAL_OVER_MAD).abs() < 1e-12);
    }
}
