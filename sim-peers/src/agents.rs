//! What the agent of a simulated robot has to be told: the geometry that is declared of it, the noises and
//! the start that its world was made with.

use std::collections::BTreeMap;

use pleiad_agent::config::{
    AngleNoise, BusSection, ClockSection, FilterSection, LandmarkRow, LedgerSection, LengthNoise,
    MotionSection, OutputSection, PoseNoise, PriorSection, RangeBearingNoise, RangeNoise, SensorsSection,
};
use pleiad_agent::{AgentConfig, ConfigError, NodeConfig};
use pleiad_estimation::RobotId;
use pleiad_estimation::strategy::StrategyKind;

use crate::scenario::{RelativeKind, RobotSettings};
use crate::{Prior, Scenario, SimulatedRun};

/// A robot that is told a limit of zero could never have moved in a gap of its odometry.
const LEAST_LIMIT: f64 = 0.1;

/// `[motion]` of a simulated robot.
pub fn motion(settings: &RobotSettings) -> MotionSection {
    let noise = &settings.odometry.noise;
    let declared = &settings.declared;
    let track_width_m = declared.track_width.unwrap_or(settings.track_width_m);
    MotionSection {
        wheel_radius_m: Some(declared.wheel_radius.unwrap_or(settings.wheel_radius_m)),
        track_width_m: Some(settings.drive.effective_track_m(track_width_m)),
        forward_m_per_sqrt_s: noise.speed_m_per_sqrt_s,
        lateral_m_per_sqrt_s: noise.lateral_m_per_sqrt_s,
        yaw_rad_per_sqrt_s: noise.yaw_rad_per_sqrt_s,
        forward_m_per_sqrt_m: noise.speed_m_per_sqrt_m,
        yaw_rad_per_sqrt_rad: noise.yaw_rad_per_sqrt_rad,
        quiet_at_standstill: noise.quiet_at_standstill,
        speed_limit_m_s: settings.motion.speed_m_s.max(LEAST_LIMIT),
        yaw_rate_limit_rad_s: settings.motion.max_yaw_rate_rad_s.max(LEAST_LIMIT),
        ..MotionSection::default()
    }
}

/// `[sensors]` of a simulated robot: those it has.
pub fn sensors(settings: &RobotSettings) -> SensorsSection {
    let relative = &settings.relative;
    let kind = (relative.rate_hz > 0.0).then_some(relative.kind);
    let is = |wanted: RelativeKind| kind == Some(wanted);
    let length = |sigma_m: f64| LengthNoise { sigma_m };
    SensorsSection {
        relative_pose: is(RelativeKind::Pose).then_some(PoseNoise {
            sigma_position_m: relative.sigma_position_m,
            sigma_yaw_rad: relative.sigma_yaw_rad,
        }),
        // A sensor of poses gives the position of a landmark, which has no heading.
        relative_position: (is(RelativeKind::Position) || is(RelativeKind::Pose))
            .then_some(length(relative.sigma_position_m)),
        range: is(RelativeKind::Range)
            .then_some(RangeNoise { sigma_m: relative.sigma_range_m, sigma_per_m: 0.0 }),
        bearing: is(RelativeKind::Bearing).then_some(AngleNoise { sigma_rad: relative.sigma_bearing_rad }),
        range_bearing: is(RelativeKind::RangeBearing).then_some(RangeBearingNoise {
            sigma_range_m: relative.sigma_range_m,
            sigma_range_per_m: 0.0,
            sigma_bearing_rad: relative.sigma_bearing_rad,
        }),
        gps: (settings.gps.rate_hz > 0.0).then_some(length(settings.gps.sigma_m)),
        heading: (settings.heading.rate_hz > 0.0)
            .then_some(AngleNoise { sigma_rad: settings.heading.sigma_rad }),
        ..SensorsSection::default()
    }
}

/// `[prior]` of a simulated robot, for its first boot.
pub fn prior(prior: &Prior) -> PriorSection {
    PriorSection {
        x_m: prior.pose.x_m(),
        y_m: prior.pose.y_m(),
        heading_rad: prior.pose.yaw_rad(),
        sigma_position_m: prior.sigma_position_m,
        sigma_heading_rad: prior.sigma_heading_rad,
        for_boot: 0,
    }
}

/// How rarely a node publishes what is not asked for, Hz: runs in one process look at the nodes themselves.
const PUBLISHED_HZ: f64 = 0.01;

/// A simulated team as nodes in one process take it: told what the scenario tells them, the map included.
///
/// # Errors
/// [`ConfigError`] if a robot's settings do not make a node.
pub fn nodes(
    scenario: &Scenario,
    run: &SimulatedRun,
    strategy: StrategyKind,
) -> Result<BTreeMap<RobotId, NodeConfig>, ConfigError> {
    let rows = run.recording.landmarks.iter();
    let landmarks: Vec<LandmarkRow> =
        rows.map(|(id, [x_m, y_m])| LandmarkRow { id: id.0, x_m: *x_m, y_m: *y_m }).collect();
    let node = |(robot, settings): (&RobotId, &RobotSettings)| {
        let agent = AgentConfig {
            team: "pleiad".to_owned(),
            robot: robot.0,
            strategy,
            filter: FilterSection::default(),
            model: None,
            prior: run.priors.get(robot).map(prior),
            motion: motion(settings),
            sensors: sensors(settings),
            calibration: None,
            clock: ClockSection::default(),
            landmarks: landmarks.clone(),
            bus: BusSection::default(),
            ledger: LedgerSection::default(),
            output: OutputSection::default(),
            faults: None,
        };
        Ok((*robot, NodeConfig { estimate_rate_hz: PUBLISHED_HZ, ..agent.node()? }))
    };
    scenario.robots.iter().map(node).collect()
}
