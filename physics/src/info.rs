//! What the catalogue says of an effect, apart from its equations in code.

use crate::relevance::Relevance;

/// The stage of the signal chain that an effect belongs to, in the order a signal passes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Between the command and the turning of the wheels.
    Actuator,
    /// Between the turning of the wheels and the distance they roll.
    Wheel,
    /// Between the rolled distances and the motion of the body.
    Body,
    /// What the surroundings add: slope, wind, a push.
    World,
    /// Between the state and a reading.
    Sensor,
    /// Between an instant and its stamp.
    Clock,
    /// Between what was seen and the name it is given.
    Identity,
}

impl Stage {
    /// The word used in files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Actuator => "actuator",
            Self::Wheel => "wheel",
            Self::Body => "body",
            Self::World => "world",
            Self::Sensor => "sensor",
            Self::Clock => "clock",
            Self::Identity => "identity",
        }
    }
}

/// A recorded channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Channel {
    /// Velocity commands.
    Command,
    /// Wheel angles.
    Encoders,
    /// Yaw rate.
    Gyro,
    /// Absolute position.
    Gps,
    /// Absolute heading.
    Heading,
    /// Range and bearing to landmarks and robots.
    Relative,
    /// Reference pose.
    Truth,
    /// Steering angle.
    Steer,
    /// Supply voltage.
    Voltage,
}

impl Channel {
    /// The word used in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Command => "command",
            Self::Encoders => "encoders",
            Self::Gyro => "gyro",
            Self::Gps => "gps",
            Self::Heading => "heading",
            Self::Relative => "relative",
            Self::Truth => "truth",
            Self::Steer => "steer",
            Self::Voltage => "voltage",
        }
    }
}

/// How a parameter can be found from data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fit {
    /// Predictions are smooth in it: Gauss-Newton from the off value.
    Smooth,
    /// Predictions jump in it, stay constant or have several optima (onsets, borders, thresholds, delays): a
    /// grid, then a profile.
    Grid,
    /// A label, such as which wheel: one fit per choice.
    Choice,
}

/// One parameter of an effect. SI units and radians.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// The name in findings, scenarios and model files.
    pub name: &'static str,
    /// Which component, for a vector that goes by one name.
    pub component: Option<&'static str>,
    /// The unit; `1` for a pure number.
    pub unit: &'static str,
    /// How it can be found.
    pub fit: Fit,
    /// The value (or, in a place or an onset, a value) at which the effect is not there.
    pub off: f64,
    /// Least and greatest value worth searching.
    pub plausible: (f64, f64),
    /// The size below which a significant value is not a finding.
    pub relevance: Relevance,
}

impl Parameter {
    /// A parameter in which predictions are smooth and that is off at zero.
    pub const fn smooth(
        name: &'static str,
        unit: &'static str,
        plausible: (f64, f64),
        relevance: Relevance,
    ) -> Self {
        Self { name, component: None, unit, fit: Fit::Smooth, off: 0.0, plausible, relevance }
    }

    /// A parameter to be searched on a grid, with the value at which it is off.
    pub const fn grid(name: &'static str, unit: &'static str, off: f64, plausible: (f64, f64)) -> Self {
        Self { name, component: None, unit, fit: Fit::Grid, off, plausible, relevance: Relevance::Unbounded }
    }

    /// A label among `plausible`, both ends included.
    pub const fn choice(name: &'static str, plausible: (f64, f64)) -> Self {
        Self {
            name,
            component: None,
            unit: "1",
            fit: Fit::Choice,
            off: plausible.0,
            plausible,
            relevance: Relevance::Unbounded,
        }
    }

    /// The same parameter as a component of a vector.
    pub const fn component(self, component: &'static str) -> Self {
        Self { component: Some(component), ..self }
    }

    /// The same parameter with another threshold of relevance.
    pub const fn relevant_from(self, relevance: Relevance) -> Self {
        Self { relevance, ..self }
    }

    /// The same parameter with another off value.
    pub const fn off_at(self, off: f64) -> Self {
        Self { off, ..self }
    }

    /// The name with its component: `offset_body_m.forward`.
    pub fn label(&self) -> String {
        match self.component {
            None => self.name.to_owned(),
            Some(component) => format!("{}.{component}", self.name),
        }
    }
}

/// The catalogue's entry of an effect.
#[derive(Clone, Copy, Debug)]
pub struct EffectInfo {
    /// The number in the catalogue; entries of one cause share it.
    pub number: u8,
    /// The name in findings, scenarios and model files.
    pub name: &'static str,
    /// What it is, in words.
    pub summary: &'static str,
    /// The stage it belongs to.
    pub stage: Stage,
    /// Whether a finding says that data are bad rather than that physics was left out.
    pub bad_data: bool,
    /// The parameters, in the order of their values.
    pub parameters: &'static [Parameter],
    /// The channels without which it cannot be tested.
    pub channels: &'static [Channel],
    /// The model equation as text. `d = (dx, dy, dw)` is what it adds to the body velocity.
    pub equation: &'static str,
    /// What explains the same data, and on which.
    pub confounded_with: &'static str,
    /// The manoeuvre or channel that tells them apart.
    pub broken_by: &'static str,
}

impl EffectInfo {
    /// The parameter of this label, with its position.
    pub fn parameter(&self, label: &str) -> Option<(usize, &'static Parameter)> {
        self.parameters.iter().enumerate().find(|(_, parameter)| parameter.label() == label)
    }
}
