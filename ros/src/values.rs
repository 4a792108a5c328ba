//! Values with a CDR form: numbers, text, arrays, sequences, messages.

use crate::cdr::{Reader, Writer};
use crate::description::{Description, Kind, Primitive};
use crate::error::{Fault, Problem};

/// A value that a field of a message can have.
pub trait Value: Sized {
    /// Fewest bytes that it takes, which bounds how many of it a payload can hold.
    const LEAST_BYTES: usize;

    /// How the definition of a message names it.
    fn kind() -> Kind;

    /// What a new message has where its definition gives no default.
    fn empty() -> Self;

    /// Appends it to a payload.
    ///
    /// # Errors
    /// It has no form in CDR.
    fn write(&self, writer: &mut Writer) -> Result<(), Fault>;

    /// Takes it from a payload.
    ///
    /// # Errors
    /// The payload holds something else.
    fn read(reader: &mut Reader<'_>) -> Result<Self, Fault>;
}

/// A ROS 2 message.
pub trait Message: Value + Clone + Default + PartialEq + std::fmt::Debug {
    /// Its full name, as in `nav_msgs/msg/Odometry`.
    const NAME: &'static str;

    /// Its definition.
    fn description() -> Description;
}

macro_rules! number {
    ($type:ty, $primitive:ident) => {
        impl Value for $type {
            const LEAST_BYTES: usize = size_of::<$type>();

            fn kind() -> Kind {
                Kind::Primitive(Primitive::$primitive)
            }

            fn empty() -> Self {
                Self::default()
            }

            fn write(&self, writer: &mut Writer) -> Result<(), Fault> {
                writer.number(self.to_be_bytes());
                Ok(())
            }

            fn read(reader: &mut Reader<'_>) -> Result<Self, Fault> {
                Ok(Self::from_be_bytes(reader.number()?))
            }
        }
    };
}

number!(i8, Int8);
number!(u8, Uint8);
number!(i16, Int16);
number!(u16, Uint16);
number!(i32, Int32);
number!(u32, Uint32);
number!(i64, Int64);
number!(u64, Uint64);
number!(f32, Float32);
number!(f64, Float64);

impl Value for bool {
    const LEAST_BYTES: usize = 1;

    fn kind() -> Kind {
        Kind::Primitive(Primitive::Bool)
    }

    fn empty() -> Self {
        false
    }

    fn write(&self, writer: &mut Writer) -> Result<(), Fault> {
        writer.bytes(&[u8::from(*self)]);
        Ok(())
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, Fault> {
        match reader.number()? {
            [0] => Ok(false),
            [1] => Ok(true),
            [found] => Err(reader.fault(Problem::Truth { found })),
        }
    }
}

impl Value for String {
    const LEAST_BYTES: usize = 4;

    fn kind() -> Kind {
        Kind::Primitive(Primitive::Text)
    }

    fn empty() -> Self {
        Self::new()
    }

    fn write(&self, writer: &mut Writer) -> Result<(), Fault> {
        if self.contains('\0') {
            return Err(writer.fault(Problem::Text));
        }
        writer.length(self.len() + 1)?;
        writer.bytes(self.as_bytes());
        writer.bytes(&[0]);
        Ok(())
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, Fault> {
        let length = reader.length(1)?;
        // Some writers leave empty text without even its zero byte.
        if length == 0 {
            return Ok(Self::new());
        }
        let [text @ .., 0] = reader.bytes(length)? else {
            return Err(reader.fault(Problem::Unterminated));
        };
        match std::str::from_utf8(text) {
            Ok(text) if !text.contains('\0') => Ok(text.to_owned()),
            _ => Err(reader.fault(Problem::Text)),
        }
    }
}

impl<T: Value + Copy, const N: usize> Value for [T; N] {
    const LEAST_BYTES: usize = N * T::LEAST_BYTES;

    fn kind() -> Kind {
        Kind::Array(Box::new(T::kind()), N)
    }

    fn empty() -> Self {
        [T::empty(); N]
    }

    fn write(&self, writer: &mut Writer) -> Result<(), Fault> {
        self.iter().enumerate().try_for_each(|(at, value)| value.write(writer).map_err(|fault| fault.at(at)))
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, Fault> {
        let mut values = Self::empty();
        for (at, value) in values.iter_mut().enumerate() {
            *value = T::read(reader).map_err(|fault| fault.at(at))?;
        }
        Ok(values)
    }
}

impl<T: Value> Value for Vec<T> {
    const LEAST_BYTES: usize = 4;

    fn kind() -> Kind {
        Kind::Sequence(Box::new(T::kind()))
    }

    fn empty() -> Self {
        Self::new()
    }

    fn write(&self, writer: &mut Writer) -> Result<(), Fault> {
        writer.length(self.len())?;
        self.iter().enumerate().try_for_each(|(at, value)| value.write(writer).map_err(|fault| fault.at(at)))
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, Fault> {
        let length = reader.length(T::LEAST_BYTES)?;
        (0..length).map(|at| T::read(reader).map_err(|fault| fault.at(at))).collect()
    }
}
