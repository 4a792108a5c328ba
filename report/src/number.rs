//! Numbers for people and numbers for the page.

use serde_json::Value;

/// A number with three significant digits and its unit (`0.124 m`); without the unit if that is empty.
/// What is not finite reads `n/a`.
pub fn quantity(value: f64, unit: &str) -> String {
    if !value.is_finite() {
        return "n/a".to_owned();
    }
    let magnitude = value.abs();
    let number = if magnitude == 0.0 {
        "0".to_owned()
    } else if !(5e-4..1e7).contains(&magnitude) {
        format!("{value:.2e}")
    } else if magnitude >= 99.95 {
        grouped(value.abs().round(), value < 0.0)
    } else if magnitude >= 9.995 {
        format!("{value:.1}")
    } else if magnitude >= 0.9995 {
        format!("{value:.2}")
    } else {
        format!("{value:.3}")
    };
    if unit.is_empty() { number } else { format!("{number} {unit}") }
}

/// An estimate with its 95 % confidence interval (`1.00 % (0.97..1.03 %)`), with as many decimals as the
/// interval supports; the estimate alone where the interval is unknown.
pub fn with_interval(value: f64, ci95: [f64; 2], unit: &str) -> String {
    let half_width = (ci95[1] - ci95[0]).abs() / 2.0;
    let unit = if unit.is_empty() || unit == "1" { String::new() } else { format!(" {unit}") };
    if !half_width.is_finite() || !value.is_finite() {
        return format!("{}{unit} (interval unknown)", quantity(value, ""));
    }
    let decimals = decimals_for(if half_width > 0.0 { half_width } else { value.abs() / 100.0 });
    // Minus zero would read oddly.
    let at = |value: f64| format!("{:.decimals$}", if value == 0.0 { 0.0 } else { value });
    format!("{}{unit} ({}..{}{unit})", at(value), at(ci95[0]), at(ci95[1]))
}

/// A size of which only the order and a second digit matter (`0.0021`).
pub(crate) fn two_digits(value: f64) -> String {
    if !value.is_finite() || value == 0.0 || !(1e-6..1e6).contains(&value.abs()) {
        return quantity(value, "");
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 0..=7")]
    let decimals = (1.0 - value.abs().log10().floor()).clamp(0.0, 7.0) as usize;
    format!("{value:.decimals$}")
}

/// Decimals that show one significant digit of `width`, two of one that begins with 1 or 2; at most nine.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 0..=9")]
fn decimals_for(width: f64) -> usize {
    if width <= 0.0 {
        return 0;
    }
    let decades = width.log10().floor();
    let digits = if width / 10_f64.powf(decades) < 2.95 { 1.0 } else { 0.0 };
    (digits - decades).clamp(0.0, 9.0) as usize
}

/// A whole number with its thousands apart (`12,345`).
pub(crate) fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (position, digit) in digits.chars().enumerate() {
        if position > 0 && (digits.len() - position).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the caller bounds it below 1e7")]
fn grouped(magnitude: f64, negative: bool) -> String {
    format!("{}{}", if negative { "-" } else { "" }, count(magnitude as u64))
}

/// A whole number of bytes in a readable unit (`1.20 MB`).
pub(crate) fn bytes(value: u64) -> String {
    let value = value as f64;
    if value < 1e3 {
        format!("{value} B")
    } else if value < 1e6 {
        quantity(value / 1e3, "kB")
    } else {
        quantity(value / 1e6, "MB")
    }
}

/// A duration: seconds below two minutes, else minutes and seconds.
pub(crate) fn duration(seconds: f64) -> String {
    if !seconds.is_finite() || seconds < 120.0 {
        return quantity(seconds, "s");
    }
    let whole = seconds.round();
    let (minutes, rest) = ((whole / 60.0).floor(), whole % 60.0);
    if rest == 0.0 { format!("{minutes} min") } else { format!("{minutes} min {rest} s") }
}

/// The values as JSON with as many digits as a picture shows: an error of at most 5e-6 of their span
/// *and* of at most 5e-5 of each value (the second matters on logarithmic axes). What is not finite
/// becomes `null`, which Plotly draws as a gap.
pub(crate) fn compact(values: &[f64]) -> Vec<Value> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    let least = finite().fold(f64::INFINITY, f64::min);
    let greatest = finite().fold(f64::NEG_INFINITY, f64::max);
    let span_decimals = if greatest > least { 5.0 - (greatest - least).log10().floor() } else { 0.0 };
    values
        .iter()
        .map(|&value| {
            let own_decimals = if value == 0.0 { 0.0 } else { 4.0 - value.abs().log10().floor() };
            Value::from(rounded(value, span_decimals.max(own_decimals)))
        })
        .collect()
}

/// The value with `decimals` decimals; as it is where that is beyond the digits of a double.
#[allow(clippy::cast_possible_truncation, reason = "checked to lie within -15..=15")]
fn rounded(value: f64, decimals: f64) -> f64 {
    if !value.is_finite() || !(-15.0..=15.0).contains(&decimals) {
        return value;
    }
    let scale = 10_f64.powi(decimals as i32);
    let result = (value * scale).round() / scale;
    // Minus zero would read oddly in the page.
    if result == 0.0 { 0.0 } else { result }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_have_three_significant_digits() {
        let cases = [
            (0.0, "0 m"),
            (0.1239, "0.124 m"),
            (1.234_56, "1.23 m"),
            (12.3456, "12.3 m"),
            (-123.456, "-123 m"),
            (12_345.6, "12,346 m"),
            (0.000_012_3, "1.23e-5 m"),
            (f64::NAN, "n/a"),
        ];
        for (value, text) in cases {
            assert_eq!(quantity(value, "m"), text);
        }
        assert_eq!(quantity(2.0, ""), "2.00");
    }

    #[test]
    fn estimates_have_the_decimals_that_their_intervals_support() {
        let cases = [
            (1.0004, [0.9703, 1.0304], "%", "1.00 % (0.97..1.03 %)"),
            (1.0004, [0.9903, 1.0104], "%", "1.000 % (0.990..1.010 %)"),
            (12.0, [-3.1, 27.4], "ms", "12 ms (-3..27 ms)"),
            (0.02, [0.02, 0.02], "m", "0.02000 m (0.02000..0.02000 m)"),
            (0.5, [f64::NAN, 1.0], "m", "0.500 m (interval unknown)"),
            (3.0, [2.0, 4.0], "1", "3.0 (2.0..4.0)"),
        ];
        for (value, ci95, unit, text) in cases {
            assert_eq!(with_interval(value, ci95, unit), text);
        }
    }

    #[test]
    fn sizes_have_two_digits() {
        let cases = [(0.002_09, "0.0021"), (3.12, "3.1"), (41.4, "41"), (0.0, "0"), (f64::NAN, "n/a")];
        for (value, text) in cases {
            assert_eq!(two_digits(value), text);
        }
    }

    #[test]
    fn counts_and_bytes_are_readable() {
        assert_eq!(count(7), "7");
        assert_eq!(count(1_234_567), "1,234,567");
        assert_eq!(duration(90.0), "90.0 s");
        assert_eq!(duration(1_500.2), "25 min");
        assert_eq!(duration(150.0), "2 min 30 s");
        assert_eq!(bytes(512), "512 B");
        assert_eq!(bytes(1_234_567), "1.23 MB");
    }

    #[test]
    fn non_finite_values_become_null() {
        let json = compact(&[1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY]);
        assert_eq!(json, [Value::from(1.0), Value::Null, Value::Null, Value::Null]);
    }

    #[test]
    fn rounding_stays_within_its_stated_error() {
        // A Unix epoch with a small span, a wide logarithmic range, a line through zero.
        let columns = [
            (0..500).map(|i| 1_248_273_546.275 + f64::from(i) * 0.0137).collect::<Vec<_>>(),
            (0..500).map(|i| 1e-4 * 1.05_f64.powi(i)).collect(),
            (0..500).map(|i| (f64::from(i) - 250.0) * 0.012_345_678_9).collect(),
        ];
        for column in columns {
            let span = column[499] - column[0];
            for (before, after) in column.iter().zip(compact(&column)) {
                let error = (before - after.as_f64().unwrap()).abs();
                // One ulp of the largest value on top, for the epoch column.
                let allowed =
                    (5.1e-6 * span).min(5.1e-5 * before.abs()) + 2.4e-7_f64.min(before.abs() * 1e-15);
                assert!(error <= allowed, "{before}: {error} > {allowed}");
            }
        }
    }
}
