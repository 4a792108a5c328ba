//! `summary.json`: the numbers of a run for programs.

use std::path::Path;

use serde::Serialize;
use serde_json::{Map, Value};

use crate::ReportError;
use crate::document::write_atomically;

/// The summary as indented JSON with keys in alphabetical order at every depth and a final newline, so
/// that equal numbers give equal bytes. Numbers that are not finite become `null`.
///
/// # Errors
/// From the serializer, for instance for a map whose keys are not text.
pub fn summary_text(summary: &impl Serialize) -> Result<String, serde_json::Error> {
    let sorted = with_sorted_keys(serde_json::to_value(summary)?);
    Ok(serde_json::to_string_pretty(&sorted)? + "\n")
}

/// Writes [`summary_text`] to `path`; a reader sees the old file or the new one, never half of it.
///
/// # Errors
/// [`ReportError::Summary`] if it cannot be expressed as JSON, [`ReportError::Write`] if the file cannot
/// be written.
pub fn write_summary(path: &Path, summary: &impl Serialize) -> Result<(), ReportError> {
    let text =
        summary_text(summary).map_err(|source| ReportError::Summary { path: path.to_owned(), source })?;
    write_atomically(path, &text)
}

fn with_sorted_keys(value: Value) -> Value {
    match value {
        Value::Object(map) => {
            let mut entries: Vec<(String, Value)> = map.into_iter().collect();
            entries.sort_by(|a, b| a.0.cmp(&b.0));
            Value::Object(entries.into_iter().map(|(k, v)| (k, with_sorted_keys(v))).collect::<Map<_, _>>())
        }
        Value::Array(items) => Value::Array(items.into_iter().map(with_sorted_keys).collect()),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Numbers {
        zeta: f64,
        alpha: Vec<f64>,
    }

    #[test]
    fn keys_are_sorted_and_non_finite_numbers_are_null() {
        let text = summary_text(&Numbers { zeta: f64::INFINITY, alpha: vec![1.5, f64::NAN] }).unwrap();
        assert_eq!(text, "{\n  \"alpha\": [\n    1.5,\n    null\n  ],\n  \"zeta\": null\n}\n");
    }

    #[test]
    fn a_missing_folder_is_named() {
        let error = write_summary(Path::new("/nonexistent/summary.json"), &1).unwrap_err();
        assert!(error.to_string().contains("/nonexistent/summary.json"), "{error}");
    }
}
