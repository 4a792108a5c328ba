//! Arguments of `pleiad tune`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use pleiad_estimation::likelihood::Level;

use super::{LandmarksArg, ReadingArgs};
use crate::levels;

#[derive(Debug, Args)]
pub struct TuneArgs {
    /// A recording folder, a run folder, an MRCLAM folder, an .mcap file, or a bag with a mapping. The robots of a run start as they were told
    /// then (priors.toml), others where the ground truth says; nothing else of the ground truth is used.
    pub recording: PathBuf,
    /// Which landmarks the robots know: known, none, numbers as in 6,7, or team: none, and the team maps them.
    #[arg(long, default_value = "known")]
    pub landmarks: LandmarksArg,
    /// Begin this many seconds into the time that all robots cover.
    #[arg(long, default_value_t = 0.0)]
    pub start: f64,
    /// Length in seconds; to the end if absent.
    #[arg(long)]
    pub seconds: Option<f64>,
    /// Noise to begin with, and geometry of the robots: a file with the sections filter, motion and sensors of an
    /// agent's configuration. Default: noise.toml in the recording, or what is built in for its form.
    #[arg(long)]
    pub noise: Option<PathBuf>,
    /// A model of the robots, such as a corrected.toml: its effects are taken out of what they read.
    /// Default: model.toml in the recording, if it is there.
    #[arg(long)]
    pub model: Option<PathBuf>,
    /// Levels that are zero at the beginning and may become more: auto (each that BIC asks for), none, or
    /// keys as in motion.yaw_rad_per_sqrt_rad,sensors.range_bearing.sigma_range_per_m.
    #[arg(long, default_value = "auto")]
    pub also: AlsoArg,
    #[command(flatten)]
    pub reading: ReadingArgs,
    /// File for the noise found, which `replay --noise` and agents read, with [filter.clutter] if there was garbage; of
    /// robots whose geometry differs, a file for each: NAME-rN.toml for robot N. Printed in any case.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// Which levels that are zero may become more.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AlsoArg {
    /// Those that raise the likelihood by enough.
    Auto,
    /// These, whatever they bring.
    Only(Vec<Level>),
}

impl FromStr for AlsoArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "none" => Ok(Self::Only(Vec::new())),
            list => list
                .split(',')
                .map(|key| {
                    let key = key.trim();
                    Level::ALL.into_iter().find(|level| levels::key(*level) == key).ok_or_else(|| {
                        let known: Vec<_> = Level::ALL.into_iter().map(levels::key).collect();
                        format!("found {key:?}, expected auto, none, or keys out of {}", known.join(", "))
                    })
                })
                .collect::<Result<_, _>>()
                .map(Self::Only),
        }
    }
}
