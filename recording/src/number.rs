//! Decimal numbers and instants, read from and written to text without loss.

use std::fmt::Write;

use pleiad_estimation::Timestamp;

/// Powers of ten that a double holds exactly.
const POWERS_OF_TEN: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

/// Integers up to here are doubles without rounding.
const LARGEST_EXACT_INTEGER: u64 = 1 << 53;

/// Digits that always fit a `u64`.
const SAFE_DIGITS: usize = 19;

/// Digits behind the point of a time in seconds.
const NANOSECOND_DIGITS: usize = 9;

const NANOS_PER_SECOND: u64 = 1_000_000_000;

/// The number that `str::parse::<f64>` makes of `text`, to the bit, or `None` where it makes none.
///
/// A plain decimal whose digits fit a double exactly needs one correctly rounded division (Clinger 1990);
/// everything else goes to the standard library.
pub(crate) fn parse_f64(text: &[u8]) -> Option<f64> {
    plain_decimal(text).or_else(|| std::str::from_utf8(text).ok()?.parse().ok())
}

fn plain_decimal(text: &[u8]) -> Option<f64> {
    let (negative, digits) = split_sign(text);
    let mut mantissa: u64 = 0;
    let mut count = 0;
    let mut decimals = None;
    for &byte in digits {
        match byte {
            b'0'..=b'9' if count < SAFE_DIGITS => {
                mantissa = mantissa * 10 + u64::from(byte - b'0');
                count += 1;
                if let Some(decimals) = &mut decimals {
                    *decimals += 1;
                }
            }
            b'.' if decimals.is_none() => decimals = Some(0),
            _ => return None,
        }
    }
    if count == 0 || mantissa > LARGEST_EXACT_INTEGER {
        return None;
    }
    let value = mantissa as f64 / POWERS_OF_TEN.get(decimals.unwrap_or(0))?;
    Some(if negative { -value } else { value })
}

/// An instant from decimal seconds, exact to the nanosecond whatever the epoch; further digits are
/// rounded, half away from zero. `None` for what is no finite number or beyond 292 years from the epoch.
pub(crate) fn parse_time(text: &[u8]) -> Option<Timestamp> {
    if let Some(time) = plain_time(text) {
        return Some(time);
    }
    // Left over: exponents, and what is too large or no number at all.
    let seconds = parse_f64(text)?;
    let exponent = text.iter().any(|byte| matches!(byte, b'e' | b'E'));
    (exponent && seconds.abs() < 9.2e9).then(|| Timestamp::from_seconds(seconds))
}

fn plain_time(text: &[u8]) -> Option<Timestamp> {
    let (negative, digits) = split_sign(text);
    let point = digits.iter().position(|&byte| byte == b'.');
    let (whole, fraction) = match point {
        Some(point) => (&digits[..point], &digits[point + 1..]),
        None => (digits, &[][..]),
    };
    if whole.is_empty() && fraction.is_empty() {
        return None;
    }
    let mut nanos: u64 = 0;
    for &byte in whole {
        nanos = nanos.checked_mul(10)?.checked_add(digit(byte)?)?;
    }
    nanos = nanos.checked_mul(NANOS_PER_SECOND)?;
    let mut weight = NANOS_PER_SECOND / 10;
    for (place, &byte) in fraction.iter().enumerate() {
        let digit = digit(byte)?;
        if place < NANOSECOND_DIGITS {
            nanos = nanos.checked_add(digit * weight)?;
            weight /= 10;
        } else if place == NANOSECOND_DIGITS && digit >= 5 {
            nanos = nanos.checked_add(1)?;
        }
    }
    let signed = if negative { 0_i64.checked_sub_unsigned(nanos) } else { 0_i64.checked_add_unsigned(nanos) };
    signed.map(Timestamp)
}

fn split_sign(text: &[u8]) -> (bool, &[u8]) {
    match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, text),
    }
}

fn digit(byte: u8) -> Option<u64> {
    byte.is_ascii_digit().then(|| u64::from(byte - b'0'))
}

/// Appends `time` in seconds with nine decimals, which [`parse_time`] reads back exactly.
pub(crate) fn push_time(text: &mut String, time: Timestamp) {
    let sign = if time.0 < 0 { "-" } else { "" };
    let nanos = time.0.unsigned_abs();
    // Writing to a string cannot fail.
    let _ = write!(text, "{sign}{}.{:09}", nanos / NANOS_PER_SECOND, nanos % NANOS_PER_SECOND);
}

/// `time` in seconds, exactly: through a double, Unix times would be some nanoseconds off.
pub(crate) fn time_text(time: Timestamp) -> String {
    let mut text = String::new();
    push_time(&mut text, time);
    text
}

/// Appends `value` by the shortest digits that read back to the same bits.
pub(crate) fn push_number(text: &mut String, value: f64) {
    // Writing to a string cannot fail.
    let _ = write!(text, "{value:?}");
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn same_as_standard_library(text: &str) {
        let expected = text.parse::<f64>().ok().map(f64::to_bits);
        assert_eq!(parse_f64(text.as_bytes()).map(f64::to_bits), expected, "{text:?}");
    }

    #[test]
    fn odd_spellings_parse_as_the_standard_library_does() {
        for text in [
            "",
            "-",
            "+",
            ".",
            "-.",
            "1.",
            ".5",
            "-0",
            "-0.0",
            "+1.5",
            "1e5",
            "1E-5",
            "1.2.3",
            "--1",
            "1_0",
            "0x1",
            "nan",
            "-inf",
            "infinity",
            " 1",
            "1 ",
            "9007199254740992",
            "9007199254740993",
            "9007199254740993.0",
            "0.1",
            "0.30000000000000004",
            "123456789012345678901234567890",
            "0.00000000000000000000001",
            "9999999999999999999",
            "99999999999999999999",
            "1.7976931348623157e308",
            "4.9e-324",
            "1\u{e9}",
        ] {
            same_as_standard_library(text);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn decimals_parse_to_the_bits_of_the_standard_library(text in r"[+-]?[0-9]{0,12}(\.[0-9]{0,14})?") {
            same_as_standard_library(&text);
        }

        #[test]
        fn numbers_survive_writing_and_reading(value in proptest::num::f64::ANY) {
            let mut text = String::new();
            push_number(&mut text, value);
            if value.is_finite() {
                prop_assert_eq!(parse_f64(text.as_bytes()).map(f64::to_bits), Some(value.to_bits()));
            }
        }

        #[test]
        fn instants_survive_writing_and_reading(nanos in any::<i64>()) {
            let mut text = String::new();
            push_time(&mut text, Timestamp(nanos));
            prop_assert_eq!(parse_time(text.as_bytes()), Some(Timestamp(nanos)));
        }
    }

    #[test]
    fn unix_seconds_are_exact_to_the_nanosecond() {
        // Through a double, the first would come out 64 ns off.
        for (text, nanos) in [
            ("1248444175.103", 1_248_444_175_103_000_000),
            ("1248444175.103000001", 1_248_444_175_103_000_001),
            ("-0.5", -500_000_000),
            ("0.0000000005", 1),
            ("0.00000000049", 0),
            ("0.9999999999", 1_000_000_000),
            ("7", 7_000_000_000),
            ("7.", 7_000_000_000),
            (".25", 250_000_000),
            ("1.5e2", 150_000_000_000),
            ("-9223372036.854775808", i64::MIN),
        ] {
            assert_eq!(parse_time(text.as_bytes()), Some(Timestamp(nanos)), "{text}");
        }
    }

    #[test]
    fn what_is_no_instant_is_refused() {
        for text in
            ["", "-", ".", "nan", "inf", "1:30", "12,5", "1e300", "9223372036.854775808", "99999999999"]
        {
            assert_eq!(parse_time(text.as_bytes()), None, "{text}");
        }
    }
}
