//! Values of the command line that are more than a number or a word.

use std::str::FromStr;

use pleiad_agent::config::{
    CalibrationSection, ClutterSection, InflationSection, QuarantineSection, RelinearizeSection,
};
use pleiad_estimation::{LandmarkId, RobotId};

/// `known`, `none`, `team`, or a list of numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LandmarksArg {
    Known,
    None,
    /// Nobody knows where they are; the team finds out.
    Team,
    Only(Vec<LandmarkId>),
}

impl FromStr for LandmarksArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "known" => Ok(Self::Known),
            "none" => Ok(Self::None),
            "team" => Ok(Self::Team),
            list => list
                .split(',')
                .map(|id| id.trim().parse().map(LandmarkId))
                .collect::<Result<_, _>>()
                .map(Self::Only)
                .map_err(|_| format!("found {text:?}, expected known, none, team, or numbers as in 6,7")),
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

/// `all`, `none`, or a list of numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ToldArg {
    All,
    Only(Vec<RobotId>),
}

impl FromStr for ToldArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "all" => Ok(Self::All),
            "none" => Ok(Self::Only(Vec::new())),
            list => list
                .split(',')
                .map(|id| id.trim().parse().map(RobotId))
                .collect::<Result<_, _>>()
                .map(Self::Only)
                .map_err(|_| format!("found {text:?}, expected all, none, or numbers as in 1,2")),
        }
    }
}

/// `SHARE:REACH_M`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClutterArg(pub ClutterSection);

impl FromStr for ClutterArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (of_nothing, misnamed) = match text.rsplit_once(':') {
            Some((front, last)) if front.contains(':') => (front, Some(last)),
            _ => (text, None),
        };
        let expected = "SHARE:REACH_M or SHARE:REACH_M:MISNAMED as in 0.05:10:0.02";
        let [share, reach_m] = two(of_nothing, expected)?;
        let misnamed = misnamed.map_or(Ok(0.0), str::parse);
        let misnamed = misnamed.map_err(|_| format!("found {text:?}, expected {expected}"))?;
        Ok(Self(ClutterSection { share, reach_m, misnamed }))
    }
}

/// Two numbers with a colon between them.
fn two(text: &str, expected: &str) -> Result<[f64; 2], String> {
    let parsed = text.split_once(':').and_then(|(a, b)| Some([a.parse().ok()?, b.parse().ok()?]));
    parsed.ok_or_else(|| format!("found {text:?}, expected {expected}"))
}

/// `READINGS:MOST`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InflateArg(pub InflationSection);

impl FromStr for InflateArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let [readings, most] = two(text, "READINGS:MOST as in 20:10")?;
        Ok(Self(InflationSection { readings, most }))
    }
}

/// `LEVEL:WINDOW_S`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuarantineArg(pub QuarantineSection);

impl FromStr for QuarantineArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let [level, window_s] = two(text, "LEVEL:WINDOW_S as in 15:30")?;
        Ok(Self(QuarantineSection { level, window_s }))
    }
}

/// `NAME=SIGMA,...`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrateArg(pub CalibrationSection);

impl FromStr for CalibrateArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut section = CalibrationSection::default();
        for part in text.split(',') {
            let wrong = || {
                format!(
                    "found {part:?}, expected forward, yaw, bias, mount_m, mount_rad, clock or drift_ppm with a sigma, \
                     as in forward=0.05,clock=0.1"
                )
            };
            let (name, sigma) = part.split_once('=').ok_or_else(wrong)?;
            let slot = match name {
                "forward" => &mut section.sigma_forward_scale,
                "yaw" => &mut section.sigma_yaw_scale,
                "bias" => &mut section.sigma_yaw_rate_bias_rad_s,
                "mount_m" => &mut section.sigma_mount_m,
                "mount_rad" => &mut section.sigma_mount_rad,
                "clock" => &mut section.sigma_clock_offset_s,
                "drift_ppm" => &mut section.sigma_clock_drift_ppm,
                _ => return Err(wrong()),
            };
            *slot = sigma.parse().map_err(|_| wrong())?;
        }
        Ok(Self(section))
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
