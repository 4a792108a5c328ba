//! Windows that do not overlap.

/// From one sample of a series to a later one, by their positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Window {
    pub(crate) first: usize,
    pub(crate) last: usize,
}

/// Windows between samples, each at least `length_s` long to within half a sample, and how many were given
/// up because a pause interrupts them. A window begins where the one before ended.
pub(crate) fn windows<T>(
    samples: &[T],
    time_s: impl Fn(&T) -> f64,
    length_s: f64,
    pause_s: f64,
) -> (Vec<Window>, usize) {
    let (mut found, mut interrupted) = (Vec::new(), 0);
    let mut first = 0;
    for last in 1..samples.len() {
        let now_s = time_s(&samples[last]);
        let step_s = now_s - time_s(&samples[last - 1]);
        if step_s > pause_s {
            first = last;
            interrupted += 1;
        } else if now_s - time_s(&samples[first]) >= length_s - 0.5 * step_s {
            found.push(Window { first, last });
            first = last;
        }
    }
    (found, interrupted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_join_and_none_spans_a_pause() {
        let times = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 2.0, 2.1, 2.2, 2.3];
        let (found, interrupted) = windows(&times, |&time_s| time_s, 0.2, 0.5);
        let pairs: Vec<_> = found.iter().map(|window| (window.first, window.last)).collect();
        assert_eq!(pairs, [(0, 2), (2, 4), (6, 8)]);
        assert_eq!(interrupted, 1);
    }
}
