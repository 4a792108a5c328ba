//! Fewer points for the same picture.

use std::collections::BTreeSet;

/// Most points that one trace of a report holds: more than the pixels of a wide screen.
pub const MAX_POINTS: usize = 2_000;

/// Indices of at most about `limit` entries of columns of equal length, ascending, such that a drawing
/// of the kept ones looks like a drawing of all.
///
/// The columns are cut into equal runs, and of each run its smallest and largest value of every column
/// stay, and one non-finite entry, so that a gap stays a gap. First and last entries stay. With at most
/// `limit` entries, all stay. Columns of unequal length are read to the end of the shortest.
pub fn indices_keeping_extremes(columns: &[&[f64]], limit: usize) -> Vec<usize> {
    let length = columns.iter().map(|column| column.len()).min().unwrap_or(0);
    if length <= limit {
        return (0..length).collect();
    }
    let kept_per_run = 2 * columns.len() + 1;
    let runs = (limit.saturating_sub(2) / kept_per_run).max(1);
    let mut kept = BTreeSet::from([0, length - 1]);
    for run in 0..runs {
        let (start, end) = (length * run / runs, length * (run + 1) / runs);
        for column in columns {
            let finite = || (start..end).filter(|&i| column[i].is_finite());
            kept.extend(finite().min_by(|&i, &j| column[i].total_cmp(&column[j])));
            kept.extend(finite().max_by(|&i, &j| column[i].total_cmp(&column[j])));
        }
        kept.extend((start..end).find(|&i| columns.iter().any(|column| !column[i].is_finite())));
    }
    kept.into_iter().collect()
}

/// Indices of at most `limit` entries spread evenly over `length`: for clouds of points, whose density
/// would be falsified by keeping extremes.
pub fn even_sample(length: usize, limit: usize) -> Vec<usize> {
    if length <= limit {
        return (0..length).collect();
    }
    (0..limit).map(|k| k * length / limit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_columns_stay_whole() {
        assert_eq!(indices_keeping_extremes(&[&[3.0, 1.0, 2.0]], 3), [0, 1, 2]);
        assert!(indices_keeping_extremes(&[], 10).is_empty());
    }

    #[test]
    fn single_spikes_of_a_long_series_stay() {
        let mut values: Vec<f64> = (0..150_000).map(|i| f64::from(i % 7)).collect();
        values[77_777] = 1_000.0;
        values[99_001] = -1_000.0;
        let kept = indices_keeping_extremes(&[&values], MAX_POINTS);
        assert!(kept.len() <= MAX_POINTS, "{}", kept.len());
        assert!(kept.contains(&77_777) && kept.contains(&99_001));
        assert!(kept.contains(&0) && kept.contains(&149_999));
        assert!(kept.is_sorted());
    }

    #[test]
    fn extremes_of_every_column_stay() {
        let x: Vec<f64> = (0..50_000).map(|i| (f64::from(i) * 1e-3).cos()).collect();
        let y: Vec<f64> = (0..50_000).map(|i| (f64::from(i) * 1e-3).sin()).collect();
        let kept = indices_keeping_extremes(&[&x, &y], MAX_POINTS);
        for column in [&x, &y] {
            let of_all = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let of_kept = kept.iter().map(|&i| column[i]).fold(f64::NEG_INFINITY, f64::max);
            assert_eq!(of_all.to_bits(), of_kept.to_bits());
        }
    }

    #[test]
    fn an_even_sample_keeps_the_share_of_rare_entries() {
        // Every tenth entry is marked; a sample with a stride prime to ten keeps the share.
        let sample = even_sample(7 * MAX_POINTS, MAX_POINTS);
        assert_eq!(sample.len(), MAX_POINTS);
        assert_eq!(sample.iter().filter(|&&i| i % 10 == 0).count(), MAX_POINTS / 10);
        assert_eq!(even_sample(3, 5), [0, 1, 2]);
    }

    #[test]
    fn a_gap_stays_a_gap() {
        let mut values = vec![1.0; 40_000];
        values[20_000..20_003].fill(f64::NAN);
        let kept = indices_keeping_extremes(&[&values], MAX_POINTS);
        assert!(kept.iter().any(|&i| values[i].is_nan()));
    }
}
