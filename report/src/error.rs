//! What can go wrong when a report is made.

use std::path::PathBuf;

use pleiad_estimation::RobotId;

/// Why a report could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// The columns of one robot's series differ in length.
    #[error(
        "series of robot {robot}: `{column}` has {found} entries where `time_s` has {expected}; \
         give one entry per instant"
    )]
    ColumnLength {
        /// Whose series.
        robot: RobotId,
        /// The column that differs.
        column: &'static str,
        /// Its length.
        found: usize,
        /// The length of `time_s`.
        expected: usize,
    },
    /// The columns of a series of residuals differ in length.
    #[error(
        "residuals of robot {robot}, {channel}: a column has {found} entries where `time_s` has {expected}; \
         give one entry per instant"
    )]
    ResidualColumns {
        /// Whose residuals.
        robot: RobotId,
        /// Of which channel.
        channel: String,
        /// The length of the column that differs.
        found: usize,
        /// The length of `time_s`.
        expected: usize,
    },
    /// A NIS of a dimension whose bounds are not tabulated.
    #[error("NIS series `{name}`: bounds are known for 1 to 6 degrees of freedom, found {found}")]
    NisDimension {
        /// The series.
        name: String,
        /// Its degrees of freedom.
        found: usize,
    },
    /// A bar chart whose group has another number of values than there are categories.
    #[error("bars `{name}`: {found} values for {expected} categories; give one value per category")]
    BarCount {
        /// The group of bars.
        name: String,
        /// Its values.
        found: usize,
        /// The categories.
        expected: usize,
    },
    /// A file could not be written.
    #[error("cannot write {}: {source}; check that the folder exists and is writable", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A summary could not be expressed as JSON.
    #[error("cannot express the summary {} as JSON: {source}", path.display())]
    Summary {
        /// The file that was to be written.
        path: PathBuf,
        /// What the serializer said.
        source: serde_json::Error,
    },
}
