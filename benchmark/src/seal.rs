//! Answers, and the hash that seals them before anything is diagnosed.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde::{Deserialize, Serialize};
use sha2_const_stable::Sha256;

use crate::class::{Class, Noise};

/// An effect that acts, or a value of the nominal model that is wrong, as the effect that says the same.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Injected {
    /// The name in the catalogue.
    pub effect: String,
    /// The robots it acts on.
    pub robots: Vec<u32>,
    /// The values by label, with those of labels and shapes.
    pub parameters: BTreeMap<String, f64>,
    /// When it acts, seconds; `None`: throughout, or from an onset.
    pub time_s: Option<[f64; 2]>,
    /// Where it acts, `[x0, x1, y0, y1]`, metres; `None`: everywhere.
    pub region_m: Option<[f64; 4]>,
}

/// What is to be found in a recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The name of the case.
    pub id: String,
    /// Its class.
    pub class: Class,
    /// The noise.
    pub noise: Noise,
    /// The size over the typical one, where there is one.
    pub size: Option<f64>,
    /// SHA-256 of all that the recording is made from: the seed and the settings. Another recording is another answer.
    pub recording_sha256: String,
    /// What acts.
    pub injected: Vec<Injected>,
    /// Effects that the tool's catalogue is made to lack.
    pub left_out: Vec<String>,
}

impl Answer {
    /// SHA-256 of the answer as one line of JSON, in hexadecimal digits.
    ///
    /// # Errors
    /// A number that JSON does not have.
    pub fn hash(&self) -> Result<String, serde_json::Error> {
        Ok(sha256(serde_json::to_string(self)?.as_bytes()))
    }
}

/// The answers as lines of JSON, in the order of the cases: what the seal is the hash of.
///
/// # Errors
/// As [`Answer::hash`].
pub fn answers_text(answers: &[Answer]) -> Result<String, serde_json::Error> {
    let mut text = String::new();
    for answer in answers {
        text += &serde_json::to_string(answer)?;
        text.push('\n');
    }
    Ok(text)
}

/// SHA-256 (FIPS 180-4) in hexadecimal digits.
pub fn sha256(bytes: &[u8]) -> String {
    digest(bytes).iter().fold(String::with_capacity(64), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// SHA-256.
pub(crate) fn digest(bytes: &[u8]) -> [u8; 32] {
    Sha256::new().update(bytes).finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer() -> Answer {
        Answer {
            id: "single/crab/x1/white/1".to_owned(),
            class: Class::Single,
            noise: Noise::White,
            size: Some(1.0),
            recording_sha256: sha256(b"a scenario"),
            injected: vec![Injected {
                effect: "crab".to_owned(),
                robots: vec![2],
                parameters: BTreeMap::from([("rad".to_owned(), 0.01)]),
                time_s: None,
                region_m: None,
            }],
            left_out: Vec::new(),
        }
    }

    #[test]
    fn hashes_are_those_of_the_standard() {
        // FIPS 180-4, example of one block.
        assert_eq!(sha256(b"abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    }

    #[test]
    fn another_value_of_an_answer_is_another_seal() {
        let mut other = answer();
        other.injected[0].parameters.insert("rad".to_owned(), 0.010_000_001);
        let seal = |answers: &[Answer]| sha256(answers_text(answers).unwrap().as_bytes());
        assert_ne!(answer().hash().unwrap(), other.hash().unwrap());
        assert_ne!(seal(&[answer(), answer()]), seal(&[answer(), other]));
        assert_eq!(seal(&[answer()]), seal(&[answer()]));
    }
}
