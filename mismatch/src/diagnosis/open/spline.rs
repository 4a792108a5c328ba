//! Natural cubic splines (`reinsch1967`), written by their values at the knots.

/// So many knots, if the regressor has as many different values.
const KNOTS: usize = 9;
/// Knots are no nearer than this share of the whole range.
const LEAST_STEP: f64 = 0.02;

/// One function per knot: it is one there and zero at the others.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Basis {
    pub(crate) knots: Vec<f64>,
    /// By knot, the second derivatives at all knots of its function.
    bends: Vec<Vec<f64>>,
}

impl Basis {
    /// Knots where so many of the values lie between two; `None` of fewer than four.
    pub(crate) fn new(values: &[f64]) -> Option<Self> {
        let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let (&first, &last) = (sorted.first()?, sorted.last()?);
        // Few rows at the ends carry little: the ends are the 1 % and 99 % quantiles.
        let quantile = |share: f64| {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a position in it")]
            let position = (share * (sorted.len() - 1) as f64).round() as usize;
            sorted[position]
        };
        let mut knots: Vec<f64> = Vec::new();
        for index in 0..KNOTS {
            let share = 0.01 + 0.98 * index as f64 / (KNOTS - 1) as f64;
            let knot = quantile(share);
            if knots.last().is_none_or(|before| knot - before > LEAST_STEP * (last - first)) {
                knots.push(knot);
            }
        }
        Self::at(knots)
    }

    pub(crate) fn at(knots: Vec<f64>) -> Option<Self> {
        let count = knots.len();
        if count < 4 {
            return None;
        }
        let bends = (0..count).map(|own| bends(&knots, own)).collect();
        Some(Self { knots, bends })
    }

    /// The function of a knot; beyond the knots, its value at the last. Zero where the regressor is not known.
    pub(crate) fn value(&self, own: usize, x: f64) -> f64 {
        self.locate(x).map_or(0.0, |place| self.at_place(own, &place))
    }

    /// Where a value lies among the knots; `None` where the regressor is not known.
    fn locate(&self, x: f64) -> Option<Located> {
        if !x.is_finite() {
            return None;
        }
        let last = self.knots.len() - 1;
        let x = x.clamp(self.knots[0], self.knots[last]);
        let after = self.knots.partition_point(|knot| *knot < x).clamp(1, last);
        let (from, to) = (self.knots[after - 1], self.knots[after]);
        let step = to - from;
        let (a, b) = ((to - x) / step, (x - from) / step);
        let bends = [a * a * a - a, b * b * b - b].map(|bend| bend * step * step / 6.0);
        Some(Located { after, shares: [a, b], bends })
    }

    fn at_place(&self, own: usize, place: &Located) -> f64 {
        let at = |knot: usize| if knot == own { 1.0 } else { 0.0 };
        let [before, after] = [place.after - 1, place.after];
        let bend = &self.bends[own];
        place.shares[0] * at(before)
            + place.shares[1] * at(after)
            + place.bends[0] * bend[before]
            + place.bends[1] * bend[after]
    }

    /// By knot, its function at many values, each of which is looked up once.
    pub(crate) fn values(&self, at: impl Iterator<Item = f64>) -> Vec<Vec<f64>> {
        let places: Vec<Option<Located>> = at.map(|x| self.locate(x)).collect();
        let value = |own: usize, place: &Option<Located>| {
            place.as_ref().map_or(0.0, |place| self.at_place(own, place))
        };
        (0..self.knots.len()).map(|own| places.iter().map(|place| value(own, place)).collect()).collect()
    }
}

/// A value between two knots: the second of them, the shares of both, and what their bends count.
struct Located {
    after: usize,
    shares: [f64; 2],
    bends: [f64; 2],
}

/// Second derivatives of the spline that is one at a knot: a tridiagonal system.
fn bends(knots: &[f64], own: usize) -> Vec<f64> {
    let count = knots.len();
    let at = |knot: usize| if knot == own { 1.0 } else { 0.0 };
    let step = |knot: usize| knots[knot + 1] - knots[knot];
    let mut upper = vec![0.0; count];
    let mut right = vec![0.0; count];
    for knot in 1..count - 1 {
        let (before, after) = (step(knot - 1), step(knot));
        let slopes = (at(knot + 1) - at(knot)) / after - (at(knot) - at(knot - 1)) / before;
        let pivot = 2.0 * (before + after) - before * upper[knot - 1];
        upper[knot] = after / pivot;
        right[knot] = (6.0 * slopes - before * right[knot - 1]) / pivot;
    }
    let mut found = vec![0.0; count];
    for knot in (1..count - 1).rev() {
        found[knot] = right[knot] - upper[knot] * found[knot + 1];
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_is_itself_and_values_at_knots_are_kept() {
        let basis = Basis::at(vec![0.0, 1.0, 2.5, 3.0, 7.0]).unwrap();
        let line = |x: f64| 2.0 - 3.0 * x;
        for x in [0.0, 0.3, 1.7, 2.9, 6.0, 7.0] {
            let sum: f64 = (0..5).map(|own| line(basis.knots[own]) * basis.value(own, x)).sum();
            assert!((sum - line(x)).abs() < 1e-12, "{x}: {sum}");
        }
        assert!((basis.value(2, 2.5) - 1.0).abs() < 1e-12 && basis.value(2, 3.0).abs() < 1e-12);
        assert!(basis.value(1, f64::NAN).abs() < 1e-12);
    }

    #[test]
    fn a_natural_spline_through_known_values_is_that_of_a_textbook() {
        // Through (0, 0), (1, 1), (2, 0), (3, 1): second derivatives 0, -4, 4, 0, so S(0.5) = 0.5 + 4/16 = 0.75.
        let basis = Basis::at(vec![0.0, 1.0, 2.0, 3.0]).unwrap();
        let sum = |x: f64| basis.value(1, x) + basis.value(3, x);
        assert!((sum(0.5) - 0.75).abs() < 1e-12, "{}", sum(0.5));
        assert!((sum(1.5) - 0.5).abs() < 1e-12, "{}", sum(1.5));
    }

    #[test]
    fn knots_need_different_values() {
        assert!(Basis::new(&[1.0; 50]).is_none());
        let values: Vec<f64> = (0..100).map(f64::from).collect();
        assert_eq!(Basis::new(&values).unwrap().knots.len(), KNOTS);
    }
}
