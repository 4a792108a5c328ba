//! Samples at increasing times, searched for an instant.

/// The first search reaches so far around where the sample would be at even steps.
const REACH: usize = 4;

/// The position of the first sample that is not `before`, as `partition_point` has it. Samples are nearly even in time:
/// those around where it would be are looked at first, then ever farther. A recording is larger than a cache, and
/// halving it misses at every step.
pub(crate) fn first_not<T>(
    samples: &[T],
    time_s: impl Fn(&T) -> f64,
    at_s: f64,
    before: impl Fn(f64) -> bool,
) -> usize {
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else { return 0 };
    let (first_s, last_s) = (time_s(first), time_s(last));
    let share = (at_s - first_s) / (last_s - first_s);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
    let guess = ((share * (samples.len() - 1) as f64) as usize).min(samples.len() - 1);
    // What lies below `low` is before, what lies from `high` on is not.
    let (mut low, mut high) = (guess, guess);
    let mut reach = REACH;
    while low > 0 && !before(time_s(&samples[low - 1])) {
        high = low - 1;
        low = low.saturating_sub(reach);
        reach *= 2;
    }
    if high == guess {
        while high < samples.len() && before(time_s(&samples[high])) {
            low = high + 1;
            high = (high + reach).min(samples.len());
            reach *= 2;
        }
    }
    low + samples[low..high].partition_point(|sample| before(time_s(sample)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_where_halving_finds_it() {
        let even: Vec<f64> = (0..100).map(f64::from).collect();
        let uneven: Vec<f64> = (0..100).map(|index| f64::from(index * index * (index % 7 + 1) / 7)).collect();
        let mut sorted = uneven;
        sorted.sort_by(f64::total_cmp);
        let paused: Vec<f64> =
            even.iter().map(|time_s| if *time_s > 40.0 { time_s + 1e4 } else { *time_s }).collect();
        for samples in [even, sorted, paused, vec![3.0; 9], vec![1.0], Vec::new()] {
            let around = samples.iter().flat_map(|time_s| [time_s - 0.3, *time_s, time_s + 0.3]);
            for at_s in around.chain([-1e9, 1e9, f64::NAN]) {
                for strict in [true, false] {
                    let before = |time_s: f64| if strict { time_s < at_s } else { time_s <= at_s };
                    let expected = samples.partition_point(|time_s| before(*time_s));
                    assert_eq!(first_not(&samples, |time_s| *time_s, at_s, before), expected, "{at_s}");
                }
            }
        }
    }
}
