//! A recording in memory, and the readers and writers of its forms: the recording folder, the MRCLAM
//! folder, MCAP files, TUM trajectories; ROS 2 bags and foreign csv files through a mapping.
//!
//! [`open`] tells the forms apart by what a path holds and returns the recording together with an
//! [`IngestReport`]: whatever was dropped, reordered or missing is counted there. Damaged input is an
//! error naming file and line unless [`ReadOptions::skip_bad_rows`] is set.
//!
//! A model of the robots (`nominal.toml`, and `corrected.toml` with effects in it) is read by [`read_model`]
//! and becomes a physical model by [`Nominal::model`].

mod bag;
mod effect_spec;
mod error;
mod estimates;
mod folder;
mod ingest;
mod mcap;
mod model;
mod mrclam;
mod nominal;
mod number;
mod open;
pub mod parallel;
mod report;
mod suggest;
mod table;
mod tidy;
pub mod tum;
mod types;
mod view;

pub use effect_spec::{DeclaredEffect, EffectSpec, ScopeSpec, SpecError};
pub use error::RecordingError;
pub use estimates::{read_estimates, write_estimates};
pub use folder::{FORMAT_VERSION, Overwrite, read_folder, write_folder};
pub use ingest::ReadOptions;
pub use mcap::{Estimate, LogLevel, LogLine, McapContents, write_mcap};
pub use model::{effect_epoch, nominal_model, read_model, write_model};
pub use mrclam::read_mrclam;
pub use nominal::{read_nominal, write_nominal};
pub use open::{Opened, open, open_mapped};
pub use report::{FileReport, Form, Gaps, IngestReport, SkippedRow};
pub use types::{
    BeamSample, Command, Nominal, NominalNoise, NominalRangeSensor, NominalRobot, Recording, RobotRecording,
    SteerSample, TruthSample,
};
