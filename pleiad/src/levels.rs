//! Noise levels in the files that agents read.

use pleiad_agent::config::{MotionSection, SensorsSection};
use pleiad_estimation::likelihood::{Level, Levels};

/// The key of a level in an agent's configuration.
pub fn key(level: Level) -> &'static str {
    match level {
        Level::Forward => "motion.forward_m_per_sqrt_s",
        Level::Lateral => "motion.lateral_m_per_sqrt_s",
        Level::Yaw => "motion.yaw_rad_per_sqrt_s",
        Level::ForwardPerMetre => "motion.forward_m_per_sqrt_m",
        Level::YawPerMetre => "motion.yaw_rad_per_sqrt_m",
        Level::YawPerRadian => "motion.yaw_rad_per_sqrt_rad",
        Level::PosePosition => "sensors.relative_pose.sigma_position_m",
        Level::PoseYaw => "sensors.relative_pose.sigma_yaw_rad",
        Level::Position => "sensors.relative_position.sigma_m",
        Level::Range => "sensors.range.sigma_m",
        Level::RangePerMetre => "sensors.range.sigma_per_m",
        Level::Bearing => "sensors.bearing.sigma_rad",
        Level::PolarRange => "sensors.range_bearing.sigma_range_m",
        Level::PolarRangePerMetre => "sensors.range_bearing.sigma_range_per_m",
        Level::PolarBearing => "sensors.range_bearing.sigma_bearing_rad",
        Level::Gps => "sensors.gps.sigma_m",
        Level::Heading => "sensors.heading.sigma_rad",
    }
}

/// Where a configuration keeps a level; `None` for a sensor that it does not list.
fn slot<'a>(
    motion: &'a mut MotionSection,
    sensors: &'a mut SensorsSection,
    level: Level,
) -> Option<&'a mut f64> {
    match level {
        Level::Forward => Some(&mut motion.forward_m_per_sqrt_s),
        Level::Lateral => Some(&mut motion.lateral_m_per_sqrt_s),
        Level::Yaw => Some(&mut motion.yaw_rad_per_sqrt_s),
        Level::ForwardPerMetre => Some(&mut motion.forward_m_per_sqrt_m),
        Level::YawPerMetre => Some(&mut motion.yaw_rad_per_sqrt_m),
        Level::YawPerRadian => Some(&mut motion.yaw_rad_per_sqrt_rad),
        Level::PosePosition => sensors.relative_pose.as_mut().map(|noise| &mut noise.sigma_position_m),
        Level::PoseYaw => sensors.relative_pose.as_mut().map(|noise| &mut noise.sigma_yaw_rad),
        Level::Position => sensors.relative_position.as_mut().map(|noise| &mut noise.sigma_m),
        Level::Range => sensors.range.as_mut().map(|noise| &mut noise.sigma_m),
        Level::RangePerMetre => sensors.range.as_mut().map(|noise| &mut noise.sigma_per_m),
        Level::Bearing => sensors.bearing.as_mut().map(|noise| &mut noise.sigma_rad),
        Level::PolarRange => sensors.range_bearing.as_mut().map(|noise| &mut noise.sigma_range_m),
        Level::PolarRangePerMetre => sensors.range_bearing.as_mut().map(|noise| &mut noise.sigma_range_per_m),
        Level::PolarBearing => sensors.range_bearing.as_mut().map(|noise| &mut noise.sigma_bearing_rad),
        Level::Gps => sensors.gps.as_mut().map(|noise| &mut noise.sigma_m),
        Level::Heading => sensors.heading.as_mut().map(|noise| &mut noise.sigma_rad),
    }
}

/// The levels of a configuration, `None` for those of sensors that it does not list.
pub fn stated(motion: &MotionSection, sensors: &SensorsSection) -> [Option<f64>; Level::COUNT] {
    let (mut motion, mut sensors) = (motion.clone(), sensors.clone());
    Level::ALL.map(|level| slot(&mut motion, &mut sensors, level).map(|value| *value))
}

/// Writes levels into a configuration; those of sensors that it does not list are left out.
pub fn write(levels: &Levels, motion: &mut MotionSection, sensors: &mut SensorsSection) {
    for level in Level::ALL {
        if let Some(value) = slot(motion, sensors, level) {
            *value = levels[level];
        }
    }
}
