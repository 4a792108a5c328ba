//! The channels of residuals.

use std::fmt;

/// The most components a residual has.
pub const MAX_COMPONENTS: usize = 3;

/// One number of a residual.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Component {
    /// Its name, with the unit.
    pub name: &'static str,
    /// The unit alone.
    pub unit: &'static str,
}

/// A measured channel and what it is predicted from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Channel {
    /// Turning of the wheels over 0.2 s against the servo driven by the commands.
    Actuator,
    /// Change of the true pose over 1 s against the roll-out of the encoders, in the mid-window frame.
    Body,
    /// Change of the true pose over 1 s against the chain driven by the commands, in the mid-window frame:
    /// for recordings without encoders.
    CommandedBody,
    /// Mean of the gyro over 0.5 s against the yaw rate of the encoders.
    Gyro,
    /// Position against the true pose, in the robot's true frame.
    Gps,
    /// Absolute heading against the true one.
    Heading,
    /// Range to landmarks against that from the true pose.
    RangeToLandmark,
    /// Bearing of landmarks against that from the true pose.
    BearingToLandmark,
    /// Range to robots against that between the true poses.
    RangeToRobot,
    /// Bearing of robots against that between the true poses.
    BearingToRobot,
}

const fn component(name: &'static str, unit: &'static str) -> Component {
    Component { name, unit }
}

const ACTUATOR: &[Component] = &[component("mean_rad", "rad"), component("difference_rad", "rad")];
const BODY: &[Component] =
    &[component("forward_m", "m"), component("left_m", "m"), component("yaw_rad", "rad")];
const GYRO: &[Component] = &[component("yaw_rate_rad_s", "rad/s")];
const GPS: &[Component] = &[component("forward_m", "m"), component("left_m", "m")];
const HEADING: &[Component] = &[component("heading_rad", "rad")];
const RANGE: &[Component] = &[component("range_m", "m")];
const BEARING: &[Component] = &[component("bearing_rad", "rad")];

impl Channel {
    /// Every channel, along the signal chain.
    pub const ALL: [Self; 10] = [
        Self::Actuator,
        Self::Body,
        Self::CommandedBody,
        Self::Gyro,
        Self::Gps,
        Self::Heading,
        Self::RangeToLandmark,
        Self::BearingToLandmark,
        Self::RangeToRobot,
        Self::BearingToRobot,
    ];

    /// Range and bearing of landmarks, range and bearing of robots.
    pub(crate) const SIGHTINGS: [[Self; 2]; 2] =
        [[Self::RangeToLandmark, Self::BearingToLandmark], [Self::RangeToRobot, Self::BearingToRobot]];

    /// Its name, as files and tables have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Actuator => "actuator",
            Self::Body => "body",
            Self::CommandedBody => "commanded_body",
            Self::Gyro => "gyro",
            Self::Gps => "gps",
            Self::Heading => "heading",
            Self::RangeToLandmark => "range_to_landmark",
            Self::BearingToLandmark => "bearing_to_landmark",
            Self::RangeToRobot => "range_to_robot",
            Self::BearingToRobot => "bearing_to_robot",
        }
    }

    /// What a residual consists of.
    pub const fn components(self) -> &'static [Component] {
        match self {
            Self::Actuator => ACTUATOR,
            Self::Body | Self::CommandedBody => BODY,
            Self::Gyro => GYRO,
            Self::Gps => GPS,
            Self::Heading => HEADING,
            Self::RangeToLandmark | Self::RangeToRobot => RANGE,
            Self::BearingToLandmark | Self::BearingToRobot => BEARING,
        }
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
