//! The messages, by package, as ROS 2 Humble to Kilted define them (`common_interfaces`, `rcl_interfaces`,
//! `geometry2`); among these releases none of them changed.

pub mod builtin_interfaces;
pub mod geometry_msgs;
pub mod nav_msgs;
pub mod sensor_msgs;
pub mod std_msgs;
pub mod tf2_msgs;

/// Declares a message: its struct, its form in CDR and its definition, so that the three cannot differ.
macro_rules! message {
    (
        $(#[$doc:meta])*
        $name:ident = $full:literal {
            $( [ $( $constant:ident: $constant_type:ty = $value:expr; )* ] )?
            $( $(#[$field_doc:meta])* $field:ident: $type:ty $(= $default:literal as $told:literal)?, )*
        }
    ) => {
        $(#[$doc])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name {
            $( $(#[$field_doc])* pub $field: $type, )*
        }

        impl $name {
            $($(
                #[allow(missing_docs, reason = "the name is that of the definition")]
                pub const $constant: $constant_type = $value;
            )*)?
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $( $field: $crate::messages::message!(@default $type $(, $default)?), )* }
            }
        }

        impl $crate::values::Message for $name {
            const NAME: &'static str = $full;

            fn description() -> $crate::description::Description {
                $crate::description::Description {
                    name: $full,
                    constants: vec![$($( $crate::description::Constant {
                        name: stringify!($constant),
                        kind: <$constant_type as $crate::values::Value>::kind(),
                        value: Self::$constant.to_string(),
                    }, )*)?],
                    fields: vec![$( $crate::description::Field {
                        name: stringify!($field),
                        kind: <$type as $crate::values::Value>::kind(),
                        default: $crate::messages::message!(@told $($told)?),
                    }, )*],
                }
            }
        }

        impl $crate::values::Value for $name {
            const LEAST_BYTES: usize = 0 $( + <$type as $crate::values::Value>::LEAST_BYTES )*;

            fn kind() -> $crate::description::Kind {
                $crate::description::Kind::Message(Box::new(<Self as $crate::values::Message>::description()))
            }

            fn empty() -> Self {
                Self::default()
            }

            fn write(&self, writer: &mut $crate::cdr::Writer) -> Result<(), $crate::error::Fault> {
                $(
                    $crate::values::Value::write(&self.$field, writer)
                        .map_err(|fault| fault.within(stringify!($field)))?;
                )*
                Ok(())
            }

            fn read(reader: &mut $crate::cdr::Reader<'_>) -> Result<Self, $crate::error::Fault> {
                Ok(Self {
                    $( $field: $crate::values::Value::read(reader)
                        .map_err(|fault| fault.within(stringify!($field)))?, )*
                })
            }
        }
    };
    (@default $type:ty) => { <$type as $crate::values::Value>::empty() };
    (@default $type:ty, $default:literal) => { $default };
    (@told) => { None };
    (@told $told:literal) => { Some($told) };
}
pub(crate) use message;
