//! Values of the command line that are more than a number or a word.

use std::str::FromStr;

use pleiad_agent::config::RelinearizeSection;
use pleiad_estimation::{LandmarkId, RobotId};

/// `known`, `none`, or a list of numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LandmarksArg {
    Known,
    None,
    Only(Vec<LandmarkId>),
}

impl FromStr for LandmarksArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "known" => Ok(Self::Known),
            "none" => Ok(Self::None),
            list => list
                .split(',')
                .map(|id| id.trim().parse().map(LandmarkId))
                .collect::<Result<_, _>>()
                .map(Self::Only)
                .map_err(|_| format!("found {text:?}, expected known, none, or numbers as in 6,7")),
        }
    }
}

/// `BLOCK_S:AHEAD_S:PASSES`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelinearizeArg(pub RelinearizeSection);

impl FromStr for RelinearizeArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = || {
            let mut parts = text.split(':');
            let (block, ahead, passes) = (parts.next()?, parts.next()?, parts.next()?);
            let (block_s, ahead_s) = (block.parse().ok()?, ahead.parse().ok()?);
            let whole = parts.next().is_none();
            whole.then_some(Self(RelinearizeSection { block_s, ahead_s, passes: passes.parse().ok()? }))
        };
        parsed().ok_or_else(|| format!("found {text:?}, expected BLOCK_S:AHEAD_S:PASSES as in 5:5:4"))
    }
}

/// `ROBOT@HZ:SIGMA_M`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AbsoluteArg {
    pub robot: RobotId,
    pub rate_hz: f64,
    pub sigma_m: f64,
}

impl FromStr for AbsoluteArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts =
            text.split_once('@').and_then(|(robot, rest)| rest.split_once(':').map(|(hz, m)| (robot, hz, m)));
        let parsed = parts.and_then(|(robot, hz, sigma)| {
            Some(Self {
                robot: RobotId(robot.parse().ok()?),
                rate_hz: hz.parse().ok().filter(|hz: &f64| hz.is_finite() && *hz > 0.0)?,
                sigma_m: sigma.parse().ok().filter(|sigma: &f64| sigma.is_finite() && *sigma > 0.0)?,
            })
        });
        parsed.ok_or_else(|| format!("found {text:?}, expected ROBOT@HZ:SIGMA_M as in 1@1.0:0.3"))
    }
}
