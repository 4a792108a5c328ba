//! What the filter is given: from a scenario and a seed, or made by the caller from a recording.

use std::collections::BTreeMap;

use pleiad_estimation::fact::Noise;
use pleiad_estimation::motion::MotionModel;
use pleiad_estimation::sample::{Reading, Relative, Sample};
use pleiad_estimation::strategy::Noises;
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{LandmarkId, Pose2, RobotId};
use pleiad_recording::RobotRecording;
use pleiad_sim_peers::scenario::RobotSettings;
use pleiad_sim_peers::{Scenario, simulate};

use crate::error::SurveyError;
use crate::solo;

/// One robot's samples, and what it is told.
#[derive(Clone, Debug)]
pub struct SlamInput {
    /// Who.
    pub robot: RobotId,
    /// Dead reckoning.
    pub motion: MotionModel,
    /// How well it measures.
    pub noises: Noises,
    /// Where it is told to start.
    pub start: Pose2,
    /// How well, in the frame of that pose: m^2, rad^2.
    pub start_noise: Symmetric3,
    /// What it is fed, in order.
    pub samples: Vec<Sample>,
    /// What it recorded: the truth, for judging.
    pub recorded: RobotRecording,
    /// Where the landmarks are, for judging; and for the reference that knows them.
    pub landmarks: BTreeMap<LandmarkId, [f64; 2]>,
}

/// Chance, or none of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Luck {
    /// Everything as the scenario says.
    Drawn,
    /// Sensors, wheels and the told start are exact, while the filter is told the scenario's noises: its estimates stay
    /// at the truth, and so does its linearization.
    None,
}

impl SlamInput {
    /// The first robot of a scenario.
    ///
    /// # Errors
    /// A scenario that cannot be simulated, or whose first robot is told no start or sees no landmarks.
    pub fn simulated(scenario: &Scenario, seed: u64, luck: Luck) -> Result<Self, SurveyError> {
        let unfit = |what: &str| SurveyError::Scenario { study: super::NAME, source: what.into() };
        let (&robot, settings) = scenario.robots.iter().next().ok_or_else(|| unfit("it has no robot"))?;
        let mut world = scenario.clone();
        if luck == Luck::None
            && let Some(settings) = world.robots.get_mut(&robot)
        {
            without_chance(settings);
        }
        let mut run = simulate(&world, seed)
            .map_err(|error| SurveyError::Scenario { study: super::NAME, source: Box::new(error) })?;
        let prior = run.priors.get(&robot).ok_or_else(|| {
            unfit("robot 1 is told no start (prior.known = false): the map needs an origin; set prior.known = true")
        })?;
        let recorded = run.recording.robots.remove(&robot).unwrap_or_default();
        if recorded.sightings.is_empty() {
            return Err(unfit(
                "its first robot sees nothing: set relative.rate_hz above 0 and relative.see = \"landmarks\"",
            ));
        }
        let square = |sigma: f64| sigma * sigma;
        let told = settings.prior;
        Ok(Self {
            robot,
            motion: solo::motion(settings),
            noises: noises(settings),
            start: prior.pose,
            start_noise: Symmetric3::diagonal(
                square(told.sigma_position_m),
                square(told.sigma_position_m),
                square(told.sigma_heading_rad),
            ),
            samples: recorded.samples(),
            recorded,
            landmarks: run.recording.landmarks,
        })
    }

    /// Everything that is fed, in order. Without ranges if asked so.
    pub fn fed(&self, without_ranges: bool) -> Vec<Sample> {
        let mut samples = self.samples.clone();
        if without_ranges {
            for sample in &mut samples {
                if let Reading::Sighting { relative, .. } = &mut sample.reading
                    && let Relative::RangeBearing { bearing_rad, .. } = *relative
                {
                    *relative = Relative::Bearing { bearing_rad };
                }
            }
        }
        samples
    }

    /// The noises with that of a bearing alone, if only that of ranges and bearings is there.
    pub fn noises_with_bearing(&self) -> Noises {
        let alone = |noise: Noise| Noise::from_sigmas(&[noise.lower[2].sqrt()]);
        Noises { bearing: self.noises.bearing.or(self.noises.range_bearing.map(alone)), ..self.noises }
    }
}

/// A scenario's noises have to be above zero where the sensor is there: this is as good as none.
const NEXT_TO_NOTHING: f64 = 1e-12;

fn without_chance(settings: &mut RobotSettings) {
    settings.prior.sigma_position_m = NEXT_TO_NOTHING;
    settings.prior.sigma_heading_rad = NEXT_TO_NOTHING;
    let noise = &mut settings.odometry.noise;
    noise.speed_m_per_sqrt_s = 0.0;
    noise.lateral_m_per_sqrt_s = 0.0;
    noise.yaw_rad_per_sqrt_s = 0.0;
    noise.speed_m_per_sqrt_m = 0.0;
    noise.yaw_rad_per_sqrt_rad = 0.0;
    settings.relative.sigma_range_m = NEXT_TO_NOTHING;
    settings.relative.sigma_bearing_rad = NEXT_TO_NOTHING;
    settings.relative.sigma_position_m = NEXT_TO_NOTHING;
}

fn noises(settings: &RobotSettings) -> Noises {
    let sensor = &settings.relative;
    Noises {
        relative_position: Some(Noise::from_sigmas(&[sensor.sigma_position_m; 2])),
        range: Some(Noise::from_sigmas(&[sensor.sigma_range_m])),
        bearing: Some(Noise::from_sigmas(&[sensor.sigma_bearing_rad])),
        range_bearing: Some(Noise::from_sigmas(&[sensor.sigma_range_m, sensor.sigma_bearing_rad])),
        ..Noises::default()
    }
}
