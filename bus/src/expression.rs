//! Keys and expressions, checked alike for every bus, and matched for the in-memory one.

use crate::BusError;

/// Refuses what is not a plain key.
pub fn check_key(operation: &'static str, key: &str) -> Result<(), BusError> {
    check(operation, key, key.split('/').all(is_plain), "a key: non-empty segments without * $ ? # or @")
}

/// Refuses what is not an expression in its shortest form.
pub fn check_expression(operation: &'static str, expression: &str) -> Result<(), BusError> {
    let segments: Vec<_> = expression.split('/').collect();
    let good = segments.iter().all(|segment| matches!(*segment, "*" | "**") || is_plain(segment));
    let shortest = segments.windows(2).all(|pair| pair[0] != "**" || !matches!(pair[1], "*" | "**"));
    let expected = "an expression: segments as in a key, * or **, but no * or ** after **";
    check(operation, expression, good && shortest, expected)
}

fn check(operation: &'static str, key: &str, good: bool, expected: &str) -> Result<(), BusError> {
    if good {
        return Ok(());
    }
    Err(BusError::Operation { operation, key: key.to_owned(), cause: format!("expected {expected}") })
}

fn is_plain(segment: &str) -> bool {
    !segment.is_empty() && !segment.contains(['*', '$', '?', '#', '@'])
}

/// Whether an expression covers a key.
pub fn matches(expression: &str, key: &str) -> bool {
    covers(&expression.split('/').collect::<Vec<_>>(), &key.split('/').collect::<Vec<_>>())
}

fn covers(expression: &[&str], key: &[&str]) -> bool {
    match (expression, key) {
        ([], []) => true,
        (["**", rest @ ..], _) => (0..=key.len()).any(|skipped| covers(rest, &key[skipped..])),
        ([first, rest @ ..], [segment, others @ ..]) => {
            (*first == "*" || first == segment) && covers(rest, others)
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use zenoh::key_expr::keyexpr;

    use super::*;

    fn random(rng: &mut ChaCha8Rng, alphabet: &[&str]) -> String {
        let length = rng.random_range(1..6);
        let segments: Vec<_> = (0..length).map(|_| alphabet[rng.random_range(0..alphabet.len())]).collect();
        segments.join("/")
    }

    #[test]
    fn matching_agrees_with_zenoh() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut matched, mut compared) = (0, 0);
        for _ in 0..20_000 {
            let key = random(&mut rng, &["a", "b", "ab"]);
            let expression = random(&mut rng, &["a", "b", "ab", "*", "**"]);
            check_key("publish", &key).unwrap();
            let zenoh = keyexpr::new(&expression);
            assert_eq!(check_expression("subscribe", &expression).is_ok(), zenoh.is_ok(), "{expression}");
            let Ok(zenoh) = zenoh else { continue };
            let expected = zenoh.intersects(keyexpr::new(&key).unwrap());
            assert_eq!(matches(&expression, &key), expected, "{expression} {key}");
            compared += 1;
            matched += usize::from(expected);
        }
        assert!(matched > 1000 && compared - matched > 1000, "{matched} of {compared}");
    }

    #[test]
    fn what_is_not_a_key_is_refused_with_its_operation() {
        for key in ["", "/a", "a/", "a//b", "a/*", "**", "a?b", "a#", "$*", "@a"] {
            let refused = check_key("publish", key);
            assert!(
                matches!(&refused, Err(BusError::Operation { operation: "publish", key: k, .. }) if k == key),
                "{key}: {refused:?}"
            );
        }
        for expression in ["", "a//b", "**/**", "**/*", "a*", "a$*"] {
            assert!(check_expression("watch", expression).is_err(), "{expression}");
        }
    }
}
