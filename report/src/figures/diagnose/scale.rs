//! Small quantities in readable units.

/// Below this largest value a unit a thousand times smaller reads better.
const SMALL: f64 = 0.1;

/// What values of `unit` are to be multiplied with, and the unit that they then have: thousandths, where all
/// are small and the unit has a name for them.
pub(super) fn readable<'a>(values: impl IntoIterator<Item = &'a f64>, unit: &str) -> (f64, String) {
    let finite = values.into_iter().copied().filter(|value| value.is_finite());
    let largest = finite.map(f64::abs).fold(0.0, f64::max);
    match unit {
        "m" | "rad" | "rad/s" | "m/s" | "s" if largest < SMALL => (1e3, format!("m{unit}")),
        "1" | "" => (1.0, "-".to_owned()),
        other => (1.0, other.to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_lengths_are_shown_in_millimetres() {
        assert_eq!(readable(&[0.02, -0.05, f64::NAN], "m"), (1e3, "mm".to_owned()));
        assert_eq!(readable(&[0.02, -0.5], "m"), (1.0, "m".to_owned()));
        assert_eq!(readable(&[0.01], "1"), (1.0, "-".to_owned()));
    }
}
