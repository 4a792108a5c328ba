//! Results of cases in a file, a line each, so that a run can be taken up again.

use std::collections::BTreeMap;
use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::baseline::Selection;
use crate::class::{Class, Noise};
use crate::error::BenchmarkError;
use crate::oracle::Oracle;
use crate::score::Scored;

/// What came of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaseResult {
    /// Its name.
    pub id: String,
    /// SHA-256 of the answer that it was scored against.
    pub answer_sha256: String,
    /// Its class.
    pub class: Class,
    /// Its noise.
    pub noise: Noise,
    /// The size of the effect over the typical one, where there is one.
    pub size: Option<f64>,
    /// What could be reached.
    pub oracle: Oracle,
    /// What the diagnosis said.
    pub tool: Scored,
    /// The same of diagnoses that lack a part, by its name.
    pub ablations: BTreeMap<String, Scored>,
    /// After the manoeuvre that was proposed had been driven; `None` if none was, or nothing needed it.
    pub added: Option<Scored>,
    /// What other methods selected, by their names.
    pub baselines: BTreeMap<String, Selection>,
}

/// Reads the results that there are. A last line without an end was being written when the run stopped; it is
/// taken off the file.
///
/// # Errors
/// The file cannot be read, a line is no result, or a result belongs to another answer than `expected` has.
pub fn read(
    file: &Path,
    expected: &BTreeMap<String, String>,
) -> Result<BTreeMap<String, CaseResult>, BenchmarkError> {
    let source = |source| BenchmarkError::File { file: file.to_owned(), source };
    let text = match fs::read_to_string(file) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(BTreeMap::new()),
        Err(error) => return Err(source(error)),
    };
    let whole = text.rfind('\n').map_or(0, |end| end + 1);
    if whole < text.len() {
        fs::write(file, &text[..whole]).map_err(source)?;
    }
    let mut all = BTreeMap::new();
    for (index, line) in text[..whole].lines().enumerate() {
        let result: CaseResult = serde_json::from_str(line).map_err(|error| BenchmarkError::Damaged {
            file: file.to_owned(),
            line: index + 1,
            why: error.to_string(),
        })?;
        // Cases that were not asked for this time stay where they are.
        if let Some(hash) = expected.get(&result.id) {
            if *hash != result.answer_sha256 {
                return Err(BenchmarkError::OtherAnswers {
                    file: file.to_owned(),
                    line: index + 1,
                    id: result.id,
                    found: result.answer_sha256,
                    expected: hash.clone(),
                });
            }
            all.insert(result.id.clone(), result);
        }
    }
    Ok(all)
}

/// Adds a result to the file.
///
/// # Errors
/// The file cannot be written.
pub fn append(file: &Path, result: &CaseResult) -> Result<(), BenchmarkError> {
    let source = |source| BenchmarkError::File { file: file.to_owned(), source };
    let mut line = serde_json::to_string(result)?;
    line.push('\n');
    let mut open = OpenOptions::new().create(true).append(true).open(file).map_err(source)?;
    open.write_all(line.as_bytes()).map_err(source)
}
