//! An effect that a hypothesis holds to act.

use std::f64::consts::PI;

use pleiad_estimation::RobotId;
use pleiad_physics::{ActiveEffect, Effect, Fit, Parameter, Scalar, Scope};

/// The robots that an effect acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Whose {
    /// One robot's own.
    Robot(RobotId),
    /// Every robot's, with the same parameters: the world's, or the reference system's.
    Everyone,
}

/// An effect with values for its parameters.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Term {
    pub(crate) effect: Effect,
    pub(crate) whose: Whose,
    /// In the order of the effect's parameters.
    pub(crate) values: Vec<f64>,
    pub(crate) scope: Scope,
    /// Which values a fit may move; the others are labels, or have nothing to show them.
    pub(crate) free: Vec<bool>,
}

impl Term {
    pub(crate) fn new(effect: Effect, whose: Whose, values: Vec<f64>) -> Self {
        let free = effect.info().parameters.iter().map(|parameter| parameter.fit != Fit::Choice).collect();
        Self { effect, whose, values, scope: Scope::default(), free }
    }

    pub(crate) fn acts_on(&self, robot: RobotId) -> bool {
        match self.whose {
            Whose::Robot(own) => own == robot,
            Whose::Everyone => true,
        }
    }

    /// Whether it is of the same effect of the same robots.
    pub(crate) fn is_of(&self, other: &Self) -> bool {
        self.effect == other.effect && self.whose == other.whose
    }

    pub(crate) fn active(&self) -> ActiveEffect<f64> {
        // The values are as many as the effect's parameters and no fit makes them NaN.
        ActiveEffect::new(self.effect, &self.values)
            .unwrap_or_else(|_| ActiveEffect::off(self.effect))
            .within(self.scope)
    }

    pub(crate) fn parameters(&self) -> &'static [Parameter] {
        self.effect.info().parameters
    }

    /// Whether no fitted value was stopped by the end of what is plausible: then the effect is not what the
    /// data ask for. Angles have no end.
    #[allow(clippy::float_cmp, reason = "the end itself")]
    pub(crate) fn is_inside(&self) -> bool {
        let values = self.values.iter().zip(self.parameters()).zip(&self.free);
        values.filter(|(_, free)| **free).all(|((&value, parameter), _)| {
            let (least, greatest) = parameter.plausible;
            value == parameter.off || (value != least && value != greatest)
        })
    }

    /// Moves the values into what is plausible.
    pub(crate) fn clamp(&mut self) {
        let parameters = self.effect.info().parameters;
        for ((value, parameter), free) in self.values.iter_mut().zip(parameters).zip(&self.free) {
            if !*free || !value.is_finite() {
                continue;
            }
            let (least, greatest) = parameter.plausible;
            // An angle that may be anything goes round; so does the phase of what repeats twice in a turn.
            *value = match greatest - least {
                range if parameter.unit == "rad" && range > 2.0 * PI => value.wrapped(),
                range if parameter.unit == "rad" && range > PI => 0.5 * (2.0 * *value).wrapped(),
                _ => value.clamp(least, greatest),
            };
        }
    }
}
