//! Bytes nobody meant.

use super::*;

/// Whatever decodes is within its limits, so that it encodes and decodes again.
fn decodes_soundly(bytes: &[u8]) -> bool {
    let Ok(message) = Message::decode(bytes) else { return false };
    assert_eq!(Message::decode(&message.encode()), Ok(message));
    true
}

#[test]
fn random_bytes_never_panic() {
    let mut accepted = 0;
    for seed in 0..20_000 {
        let mut rng = rng(seed);
        let mut bytes = vec![0; rng.random_range(0..300)];
        rng.fill_bytes(&mut bytes);
        if rng.random_bool(0.9) {
            // Past the frame, where nearly all would end.
            let kind = rng.random_range(1..11);
            bytes = sealed(kind, |body| body.extend_from_slice(&bytes));
        }
        accepted += usize::from(decodes_soundly(&bytes));
    }
    assert!(accepted < 2000, "{accepted} of 20000 random messages accepted");
}

#[test]
fn a_message_with_flipped_bits_is_always_refused() {
    for seed in 0..20_000 {
        let mut rng = rng(seed);
        let good = testing::message(&mut rng).encode();
        let mut bytes = good.clone();
        for _ in 0..rng.random_range(1..6) {
            let index = rng.random_range(0..bytes.len());
            bytes[index] ^= 1 << rng.random_range(0..8);
        }
        // Two flips may have undone one another.
        assert_eq!(Message::decode(&bytes).is_ok(), bytes == good, "seed {seed}");
    }
}

/// As a sender with a fault in its memory would seal it: the checks of the fields are all there is.
#[test]
fn bits_flipped_before_the_checksum_never_panic() {
    let mut refused = 0;
    for seed in 0..5000 {
        let mut rng = rng(seed);
        let good = testing::message(&mut rng).encode();
        let mut body = good[2..good.len() - limits::CHECKSUM_BYTES].to_vec();
        if body.is_empty() {
            continue;
        }
        for _ in 0..rng.random_range(1..4) {
            let index = rng.random_range(0..body.len());
            body[index] ^= 1 << rng.random_range(0..8);
        }
        let bytes = sealed(good[1], |bytes| bytes.extend_from_slice(&body));
        refused += usize::from(!decodes_soundly(&bytes));
    }
    assert!(refused > 500, "only {refused} of 5000 damaged messages refused");
}

#[test]
fn truncated_messages_are_always_refused() {
    for seed in 0..200 {
        let bytes = testing::message(&mut rng(seed)).encode();
        for length in 0..bytes.len() {
            assert!(
                Message::decode(&bytes[..length]).is_err(),
                "seed {seed}, {length} of {} bytes",
                bytes.len()
            );
        }
    }
}
