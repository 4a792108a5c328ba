//! A recording in memory, and the readers and writers of its forms: the recording folder, the MRCLAM
//! folder, TUM trajectories.

mod types;

pub use types::{
    Command, Nominal, NominalNoise, NominalRangeSensor, NominalRobot, Recording, RobotRecording, TruthSample,
};
