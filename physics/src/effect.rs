//! The interface of an effect: its entry in the catalogue and a hook per stage.

use crate::context::Context;
use crate::info::EffectInfo;
use crate::scalar::Scalar;

/// Declares the trait from the list of hooks, so that each is a line.
macro_rules! hooks {
    ($($(#[doc = $doc:literal])* $hook:ident($($Signal:tt)+);)*) => {
        /// One effect of the catalogue.
        ///
        /// A hook takes the parameters' values in the order of [`EffectInfo::parameters`], looks at the
        /// context and changes the signal of its stage. Hooks are pure: what an effect remembers is part of
        /// the signal and kept by the stage. The defaults change nothing; an effect writes the hooks of its
        /// equation.
        pub trait EffectModel {
            /// The entry in the catalogue.
            const INFO: EffectInfo;

            $(
                $(#[doc = $doc])*
                #[inline]
                fn $hook<S: Scalar>(_values: &[S], _context: &Context<S>, _signal: &mut $($Signal)+) {}
            )*
        }
    };
}

hooks! {
    /// When a command takes effect.
    command_timing(crate::signal::CommandTiming<S>);
    /// What the servo is asked for.
    set_point(crate::signal::SetPoint<S>);
    /// What each wheel is asked for.
    wheel_set_point(crate::signal::WheelSetPoint<S>);
    /// How the servo follows.
    servo(crate::signal::Servo<S>);
    /// From shaft to wheel.
    transmission(crate::signal::Transmission<S>);
    /// Radii, track and steering.
    geometry(crate::signal::Geometry<S>);
    /// The distance wheels roll.
    rolling(crate::signal::Rolling<S>);
    /// The motion of the body.
    body(crate::signal::BodyMotion<S>);
    /// What the surroundings add.
    world(crate::signal::MapMotion<S>);
    /// Wheel angles as read.
    encoder(crate::signal::EncoderReading<S>);
    /// Yaw rate as read.
    gyro(crate::signal::GyroReading<S>);
    /// How GPS sees the robot.
    gps(crate::signal::GpsReading<S>);
    /// Heading as read.
    heading(crate::signal::HeadingReading<S>);
    /// From where, when and at what the range sensor looks.
    sighting_geometry(crate::signal::SightingGeometry<S>);
    /// Range and bearing as read.
    sighting(crate::signal::Sighting<S>);
    /// How the reference system sees the robot.
    truth(crate::signal::TruthReading<S>);
    /// The stamp of the robot's clock.
    clock(crate::signal::Stamp<S>);
    /// The name a sighting is given.
    identity(crate::signal::Identity<'_>);
    /// The spread of readings.
    noise(crate::signal::Noise<S>);
}
