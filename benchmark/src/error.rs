//! Errors of this crate.

use std::path::PathBuf;

use crate::class::Class;

/// Why a benchmark cannot be run or scored.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BenchmarkError {
    /// A class that there is not.
    #[error("there is no class {found:?}; expected one of {}", Class::ALL.map(Class::name).join(", "))]
    UnknownClass {
        /// What was asked for.
        found: String,
    },
    /// A number of seeds that is none.
    #[error("found {found:?}, expected a class, or a class and how many seeds, as clean:100")]
    NoNumber {
        /// What was asked for.
        found: String,
    },
    /// No seed.
    #[error("0 seeds: nothing would be run; ask for at least 1")]
    NoSeeds,
    /// Nothing that could be left away.
    #[error("found {found:?}, expected one of {}", crate::ABLATIONS.join(", "))]
    NoAblation {
        /// What was asked for.
        found: String,
    },
    /// Nothing has a name like this.
    #[error("no case of the classes asked for has {} in its name; names are as {example}", found.join(" or "))]
    NoCase {
        /// What was asked for.
        found: Vec<String>,
        /// A name.
        example: String,
    },
    /// A file that cannot be read or written.
    #[error("{}: {source}", file.display())]
    File {
        /// Which.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Results without `--resume`.
    #[error("{}: results are there already; resume them, or name another folder", file.display())]
    AlreadyThere {
        /// The file.
        file: PathBuf,
    },
    /// A line that is no result.
    #[error("{}:{line}: found no result: {why}; remove the line, and its case is run again", file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// Which line, from 1.
        line: usize,
        /// What the reader said.
        why: String,
    },
    /// Results of other answers.
    #[error(
        "{}:{line}: the result of {id} belongs to the answer {found}, this program's answer is {expected}: it is of \
         another version; name another folder",
        file.display()
    )]
    OtherAnswers {
        /// The file.
        file: PathBuf,
        /// Which line, from 1.
        line: usize,
        /// The case.
        id: String,
        /// The hash it names.
        found: String,
        /// The hash of the answer.
        expected: String,
    },
    /// The answers changed while cases were run.
    #[error(
        "the answers hash to {found}, but {sealed} was sealed before the first diagnosis: nothing is scored"
    )]
    BrokenSeal {
        /// Now.
        found: String,
        /// What was written first.
        sealed: String,
    },
    /// An effect cannot be injected.
    #[error("{id}: {why}")]
    Case {
        /// The case.
        id: String,
        /// What is wrong.
        why: String,
    },
    /// A scenario that cannot be simulated.
    #[error("{id}: {source}")]
    Simulation {
        /// The case.
        id: String,
        /// What the simulator said.
        source: Box<pleiad_sim_peers::Error>,
    },
    /// A recording that cannot be diagnosed.
    #[error("{id}: {source}")]
    Mismatch {
        /// The case.
        id: String,
        /// What the tool said.
        source: pleiad_mismatch::MismatchError,
    },
    /// Something that is no JSON.
    #[error("a result cannot be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
}
