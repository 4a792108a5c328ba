//! The signal chain of a planar robot, command -> actuator -> wheel -> body -> world -> sensor -> clock ->
//! identity, and the catalogue of effects that a simulation leaves out of it.
//!
//! An effect is one file in `effects/`: its entry in the catalogue ([`EffectInfo`]) and its equation as
//! hooks of [`EffectModel`]. [`chain`] applies the hooks of a [`RobotModel`] stage by stage and serves a
//! simulator; [`predict`] does so for one window of a recording, from the measured upstream channel. All of
//! it is generic over [`Scalar`]: with [`Dual`] a prediction carries its derivatives with respect to any
//! parameters of effects or of the nominal robot. [`correct`] goes the other way: it takes effects that are
//! known out of readings.
//!
//! ```
//! use pleiad_physics::{ActiveEffect, Context, Drive, Effect, Motion, Nominal, Pose, RobotModel, Variable};
//! use pleiad_physics::{Scalar, chain::sensors};
//!
//! let bias = ActiveEffect::new(Effect::GyroBias, &[0.01])?;
//! let model = RobotModel::nominal(Drive::Differential, Nominal::ideal(0.05, 0.3)).with(bias);
//! let model = model.differentiated(&[Variable::Effect { index: 0, parameter: 0 }]);
//! let at_rest = Context::new(&model.nominal, 0.0, Motion::at_rest(Pose::identity()));
//! let reading = sensors::gyro(&model, &at_rest, &mut Scalar::zero());
//! assert_eq!((reading.value(), reading.derivatives()), (0.01, &[1.0]));
//! # Ok::<(), pleiad_physics::PhysicsError>(())
//! ```
//!
//! There are no files, no clock and no randomness here: draws for effects of chance come in with the
//! [`Context`].

mod catalogue;
pub mod chain;
mod context;
pub mod correct;
mod dual;
mod effect;
mod effects;
mod error;
mod info;
mod model;
mod nominal;
mod pose;
pub mod predict;
mod relevance;
mod scalar;
pub mod signal;
mod typical;

pub use context::{Chance, Context, Motion, Surroundings};
pub use dual::Dual;
pub use effect::EffectModel;
pub use effects::Effect;
pub use error::PhysicsError;
pub use info::{Channel, EffectInfo, Fit, Parameter, Stage};
pub use model::{ActiveEffect, Drive, MAX_PARAMETERS, Region, RobotModel, Scope, Variable};
pub use nominal::{Nominal, NominalParameter};
pub use pose::Pose;
pub use relevance::{Floors, Relevance};
pub use scalar::Scalar;
