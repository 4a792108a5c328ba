//! Makes an enumeration with static dispatch of a list of effects.

/// Declares the modules of the effects and `enum Effect`, which calls their hooks without dynamic dispatch:
/// hooks are generic over the scalar, so no trait object could.
macro_rules! catalogue {
    ($($module:ident :: $Name:ident;)*) => {
        $(mod $module;)*

        /// An effect of the catalogue; see [`Effect::info`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Effect {
            $(#[doc = concat!("`", stringify!($module), "`")] $Name,)*
        }

        impl Effect {
            /// Every effect, in the order of the catalogue.
            pub const ALL: &'static [Self] = &[$(Self::$Name),*];

            /// The entry in the catalogue.
            pub const fn info(self) -> &'static EffectInfo {
                match self {
                    $(Self::$Name => &<$module::$Name as EffectModel>::INFO,)*
                }
            }
        }

        dispatch! { [$($module::$Name)*]
            command_timing(CommandTiming<S>)
            set_point(SetPoint<S>)
            wheel_set_point(WheelSetPoint<S>)
            servo(Servo<S>)
            transmission(Transmission<S>)
            geometry(Geometry<S>)
            rolling(Rolling<S>)
            body(BodyMotion<S>)
            world(MapMotion<S>)
            encoder(EncoderReading<S>)
            gyro(GyroReading<S>)
            gps(GpsReading<S>)
            heading(HeadingReading<S>)
            sighting_geometry(SightingGeometry<S>)
            sighting(Sighting<S>)
            truth(TruthReading<S>)
            clock(Stamp<S>)
            identity(Identity<'_>)
            noise(Noise<S>)
        }
    };
}

/// Writes [`Effect`](crate::Effect)'s method for each hook.
macro_rules! dispatch {
    ($effects:tt) => {};
    ($effects:tt $hook:ident($($Signal:tt)+) $($rest:tt)*) => {
        dispatch_one! { $effects $hook($($Signal)+) }
        dispatch! { $effects $($rest)* }
    };
}

macro_rules! dispatch_one {
    ([$($module:ident :: $Name:ident)*] $hook:ident($($Signal:tt)+)) => {
        impl Effect {
            #[doc = concat!("Calls the effect's hook [`EffectModel::", stringify!($hook), "`].")]
            pub fn $hook<S: Scalar>(self, values: &[S], context: &Context<S>, signal: &mut $($Signal)+) {
                match self {
                    $(Self::$Name => <$module::$Name as EffectModel>::$hook(values, context, signal),)*
                }
            }
        }
    };
}

pub(crate) use {catalogue, dispatch, dispatch_one};
