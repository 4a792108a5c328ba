//! Where chance comes from: one generator per robot, channel and item, each keyed by all of them.
//! ChaCha is a keyed function whose outputs under different keys are unrelated, so a further robot or
//! sensor takes nothing from the others' streams.

use pleiad_estimation::RobotId;
use pleiad_physics::Chance;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{ChiSquared, Distribution, StandardNormal, StandardUniform};

/// The seed of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seed(pub(super) u64);

/// What a stream is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Channel {
    Landmarks = 1,
    Placement = 2,
    Prior = 3,
    Waypoints = 4,
    Slip = 5,
    Odometry = 6,
    Gyro = 7,
    Gps = 8,
    Heading = 9,
    Relative = 10,
    Commands = 11,
    Truth = 12,
    /// The spread of heavy-tailed sightings.
    Tails = 13,
    /// Draws of effects of chance in sightings.
    Chances = 14,
    /// Draws of effects of chance in the gyro.
    GyroChances = 15,
    /// When a robot's commands take effect.
    Jitter = 16,
    /// Slip that lasts.
    Lasting = 17,
    /// The spread of heavy-tailed noise of a robot's own channels: an item per channel.
    OwnTails = 18,
    /// What the left wheel turns without rolling.
    LeftWheel = 19,
    /// The same of the right wheel.
    RightWheel = 20,
    /// The steering angle.
    Steer = 21,
    /// Noise of range scans.
    Scan = 22,
}

/// Ends every key, so that no other use of a bare seed shares a stream with the world.
const PURPOSE: &[u8; 8] = b"worldsim";
/// Marks the phase of a channel among its items; targets are below.
const PHASE_ITEM: u64 = u64::MAX;

impl Seed {
    /// The stream of a robot's channel.
    pub(super) fn stream(self, robot: RobotId, channel: Channel) -> ChaCha12Rng {
        self.item_stream(robot, channel, 0)
    }

    /// The stream of one item of a robot's channel: a target it may see.
    pub(super) fn item_stream(self, robot: RobotId, channel: Channel, item: u64) -> ChaCha12Rng {
        let mut key = [0; 32];
        key[..8].copy_from_slice(&self.0.to_le_bytes());
        key[8..12].copy_from_slice(&robot.0.to_le_bytes());
        key[12..16].copy_from_slice(&(channel as u32).to_le_bytes());
        key[16..24].copy_from_slice(&item.to_le_bytes());
        key[24..].copy_from_slice(PURPOSE);
        ChaCha12Rng::from_seed(key)
    }

    /// Where in its period a channel samples, as a share of the period in `[0, 1)`.
    pub(super) fn phase(self, robot: RobotId, channel: Channel) -> f64 {
        uniform(&mut self.item_stream(robot, channel, PHASE_ITEM))
    }
}

/// Three draws for the effects of chance.
pub(super) fn chance(stream: &mut ChaCha12Rng) -> Chance {
    Chance { uniform: uniform(stream), choice: uniform(stream), normal: normal(stream) }
}

/// A standard normal variate divided by this has Student's distribution of so many degrees of freedom.
pub(super) fn student_divisor(stream: &mut ChaCha12Rng, degrees_of_freedom: f64) -> f64 {
    match ChiSquared::new(degrees_of_freedom) {
        Ok(spread) if degrees_of_freedom.is_finite() => (spread.sample(stream) / degrees_of_freedom).sqrt(),
        _ => 1.0,
    }
}

/// What normal noise is multiplied by, draw by draw, to have Student's distribution and the same standard
/// deviation.
pub(super) struct Tails {
    degrees_of_freedom: f64,
    stream: ChaCha12Rng,
}

impl Tails {
    /// Of a channel of a robot; 0 degrees of freedom: always one.
    pub(super) fn new(seed: Seed, robot: RobotId, channel: Channel, degrees_of_freedom: f64) -> Self {
        Self { degrees_of_freedom, stream: seed.item_stream(robot, Channel::OwnTails, channel as u64) }
    }

    pub(super) fn factor(&mut self) -> f64 {
        if self.degrees_of_freedom == 0.0 {
            return 1.0;
        }
        // The variance of Student's distribution is n / (n - 2).
        let spread = ((self.degrees_of_freedom - 2.0) / self.degrees_of_freedom).sqrt();
        spread / student_divisor(&mut self.stream, self.degrees_of_freedom)
    }
}

/// A standard normal variate.
pub(super) fn normal(stream: &mut ChaCha12Rng) -> f64 {
    StandardNormal.sample(stream)
}

/// A uniform variate in `[0, 1)`.
pub(super) fn uniform(stream: &mut ChaCha12Rng) -> f64 {
    StandardUniform.sample(stream)
}

/// A uniform variate between two numbers.
pub(super) fn between(stream: &mut ChaCha12Rng, least: f64, greatest: f64) -> f64 {
    least + (greatest - least) * uniform(stream)
}
