//! A robot: nominal parameters and the effects that act on it.

use crate::context::Context;
use crate::dual::Dual;
use crate::effects::Effect;
use crate::error::PhysicsError;
use crate::nominal::{Nominal, NominalParameter};
use crate::scalar::Scalar;

/// The most parameters an effect has.
pub const MAX_PARAMETERS: usize = 6;

/// How wheels make a body move.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Drive {
    /// Two driven wheels.
    #[default]
    Differential,
    /// Wheels that skid in turns: a differential drive whose effective track is wider by this ratio
    /// (`goel1999`; 1.5 to 1.75 is usual).
    SkidSteer {
        /// Effective over geometric track.
        track_ratio: f64,
    },
    /// Steered wheels; the steering angle comes with the surroundings.
    CarLike {
        /// From the axle that is not steered, where the robot's frame is, forward to the one that is, metres:
        /// negative for rear steering.
        wheelbase_m: f64,
    },
}

/// A rectangle of the map, borders included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Least and greatest x, metres.
    pub x_m: (f64, f64),
    /// Least and greatest y, metres.
    pub y_m: (f64, f64),
}

impl Region {
    /// From `[x0, x1, y0, y1]`, the order of `region_m` in findings.
    pub fn from_bounds([x0, x1, y0, y1]: [f64; 4]) -> Self {
        Self { x_m: (x0, x1), y_m: (y0, y1) }
    }

    /// Whether a point is inside.
    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        (self.x_m.0..=self.x_m.1).contains(&x) && (self.y_m.0..=self.y_m.1).contains(&y)
    }
}

/// Where and when an effect acts; everywhere and always by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scope {
    /// Only here.
    pub region: Option<Region>,
    /// Only from the first to before the second, seconds.
    pub window_s: Option<(f64, f64)>,
}

impl Scope {
    fn contains<S: Scalar>(&self, context: &Context<S>) -> bool {
        self.window_s.is_none_or(|(from, to)| (from..to).contains(&context.time_s))
            && self.region.is_none_or(|region| region.contains(context.motion.pose.position().map(S::value)))
    }
}

/// An effect with values for its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActiveEffect<S> {
    effect: Effect,
    values: [S; MAX_PARAMETERS],
    /// How many of the values are parameters: hooks ask millions of times.
    count: usize,
    /// Where and when it acts.
    pub scope: Scope,
}

impl<S: Scalar> ActiveEffect<S> {
    /// An effect with its values in the order of its parameters, everywhere and always.
    ///
    /// # Errors
    /// The number of values is wrong, or one is not a number. Infinity is one: it switches limits off.
    pub fn new(effect: Effect, values: &[S]) -> Result<Self, PhysicsError> {
        let info = effect.info();
        if values.len() != info.parameters.len() {
            let (expected, found) = (info.parameters.len(), values.len());
            return Err(PhysicsError::ValueCount { effect: info.name, expected, found });
        }
        let mut all = [S::zero(); MAX_PARAMETERS];
        for ((slot, &value), parameter) in all.iter_mut().zip(values).zip(info.parameters) {
            if value.value().is_nan() {
                let label = parameter.label();
                return Err(PhysicsError::NotANumber { effect: info.name, label, value: value.value() });
            }
            *slot = value;
        }
        Ok(Self { effect, values: all, count: values.len(), scope: Scope::default() })
    }

    /// The effect with every parameter at the value that switches it off.
    pub fn off(effect: Effect) -> Self {
        let mut values = [S::zero(); MAX_PARAMETERS];
        let parameters = effect.info().parameters;
        for (slot, parameter) in values.iter_mut().zip(parameters) {
            *slot = S::constant(parameter.off);
        }
        Self { effect, values, count: parameters.len(), scope: Scope::default() }
    }

    /// The same within a scope.
    pub fn within(self, scope: Scope) -> Self {
        Self { scope, ..self }
    }

    /// Which effect.
    pub fn effect(&self) -> Effect {
        self.effect
    }

    /// The values in the order of the parameters.
    pub fn values(&self) -> &[S] {
        &self.values[..self.count]
    }

    /// Replaces one value, found by its label.
    ///
    /// # Errors
    /// The effect has no such parameter.
    pub fn set(&mut self, label: &str, value: S) -> Result<(), PhysicsError> {
        let info = self.effect.info();
        let (index, _) = info.parameter(label).ok_or_else(|| PhysicsError::unknown_parameter(info, label))?;
        self.values[index] = value;
        Ok(())
    }
}

/// One number of a model that predictions can be differentiated with respect to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variable {
    /// A nominal parameter.
    Nominal(NominalParameter),
    /// A parameter of an active effect, by their positions.
    Effect {
        /// Position in [`RobotModel::effects`].
        index: usize,
        /// Position among the effect's parameters.
        parameter: usize,
    },
}

/// A robot: its drive, its nominal parameters and the effects that act on it.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotModel<S> {
    /// How wheels make the body move.
    pub drive: Drive,
    /// What the nominal simulation believes.
    pub nominal: Nominal<S>,
    /// What it leaves out, applied in this order.
    pub effects: Vec<ActiveEffect<S>>,
}

impl<S: Scalar> RobotModel<S> {
    /// A robot on which no effect acts.
    pub fn nominal(drive: Drive, nominal: Nominal<S>) -> Self {
        Self { drive, nominal, effects: Vec::new() }
    }

    /// The same with one more effect.
    pub fn with(mut self, effect: ActiveEffect<S>) -> Self {
        self.effects.push(effect);
        self
    }

    /// Whether an effect on the motion of the body, or on the gyro, depends on where the robot is or where it heads.
    pub(crate) fn places_body(&self) -> bool {
        self.effects.iter().any(|active| active.effect.places_body() || active.scope.region.is_some())
    }

    /// Calls `hook` with every effect whose scope contains the context.
    #[inline]
    pub fn apply(&self, context: &Context<S>, mut hook: impl FnMut(Effect, &[S])) {
        for active in self.effects.iter().filter(|active| active.scope.contains(context)) {
            hook(active.effect, active.values());
        }
    }
}

impl RobotModel<f64> {
    /// The same model with derivatives: prediction `k` with respect to `variables[i]` is the `i`th
    /// derivative of the value. A variable that names no active effect gets derivatives of zero.
    pub fn differentiated<const P: usize>(&self, variables: &[Variable; P]) -> RobotModel<Dual<P>> {
        let mut nominal = self.nominal.lift();
        let mut effects: Vec<_> = self
            .effects
            .iter()
            .map(|active| ActiveEffect {
                effect: active.effect,
                values: active.values.map(Dual::constant),
                count: active.count,
                scope: active.scope,
            })
            .collect();
        for (position, &variable) in variables.iter().enumerate() {
            match variable {
                Variable::Nominal(parameter) => {
                    nominal.set(parameter, Dual::variable(self.nominal.get(parameter), position));
                }
                Variable::Effect { index, parameter } => {
                    let slot = effects.get_mut(index).and_then(|active| active.values.get_mut(parameter));
                    if let Some(value) = slot {
                        *value = Dual::variable(value.value(), position);
                    }
                }
            }
        }
        RobotModel { drive: self.drive, nominal, effects }
    }
}
