//! Definitions of messages: the text that MCAP and rosbag2 store with a channel, and the hash that tells versions
//! of a type apart.

use std::collections::BTreeMap;
use std::fmt::Write;

use sha2_const_stable::Sha256;

/// The definition of a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Description {
    /// Full name, as in `nav_msgs/msg/Odometry`.
    pub name: &'static str,
    /// Named values of its fields.
    pub constants: Vec<Constant>,
    /// Its fields in order.
    pub fields: Vec<Field>,
}

/// A named value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Constant {
    /// Its name.
    pub name: &'static str,
    /// Its type.
    pub kind: Kind,
    /// Its value in decimal.
    pub value: String,
}

/// A field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// Its type.
    pub kind: Kind,
    /// What it is where nobody says; the type's zero if `None`.
    pub default: Option<&'static str>,
}

/// The type of a field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A number, truth value or text.
    Primitive(Primitive),
    /// Another message.
    Message(Box<Description>),
    /// As many as stated.
    Array(Box<Kind>, usize),
    /// Any number.
    Sequence(Box<Kind>),
}

/// Types that are no messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are those of ROS interface definitions")]
pub enum Primitive {
    Int8,
    Uint8,
    Int16,
    Uint16,
    Int32,
    Uint32,
    Int64,
    Uint64,
    Float32,
    Float64,
    Bool,
    Text,
}

impl Primitive {
    /// Its name in a definition, and its number in `type_description_interfaces/msg/FieldType`.
    const fn named(self) -> (&'static str, u8) {
        match self {
            Self::Int8 => ("int8", 2),
            Self::Uint8 => ("uint8", 3),
            Self::Int16 => ("int16", 4),
            Self::Uint16 => ("uint16", 5),
            Self::Int32 => ("int32", 6),
            Self::Uint32 => ("uint32", 7),
            Self::Int64 => ("int64", 8),
            Self::Uint64 => ("uint64", 9),
            Self::Float32 => ("float32", 10),
            Self::Float64 => ("float64", 11),
            Self::Bool => ("bool", 15),
            Self::Text => ("string", 17),
        }
    }
}

/// Number of a nested message in `FieldType`, and what arrays and sequences add to the number of their elements.
const NESTED: u8 = 1;
const ARRAY: u8 = 48;
const SEQUENCE: u8 = 144;

impl Kind {
    /// As in `float64[36]` or `std_msgs/Header`.
    fn text(&self) -> String {
        match self {
            Self::Primitive(primitive) => primitive.named().0.to_owned(),
            Self::Message(nested) => nested.short_name(),
            Self::Array(of, count) => format!("{}[{count}]", of.text()),
            Self::Sequence(of) => format!("{}[]", of.text()),
        }
    }

    /// The message in it, if there is one.
    fn message(&self) -> Option<&Description> {
        match self {
            Self::Primitive(_) => None,
            Self::Message(nested) => Some(nested),
            Self::Array(of, _) | Self::Sequence(of) => of.message(),
        }
    }

    /// Number, capacity and nested name of `FieldType`.
    fn numbered(&self) -> (u8, usize, &'static str) {
        match self {
            Self::Primitive(primitive) => (primitive.named().1, 0, ""),
            Self::Message(nested) => (NESTED, 0, nested.name),
            Self::Array(of, count) => {
                let (number, _, nested) = of.numbered();
                (number + ARRAY, *count, nested)
            }
            Self::Sequence(of) => {
                let (number, _, nested) = of.numbered();
                (number + SEQUENCE, 0, nested)
            }
        }
    }
}

impl Description {
    /// The name without `msg`, as definitions write it: `nav_msgs/Odometry`.
    pub fn short_name(&self) -> String {
        self.name.replace("/msg/", "/")
    }

    /// The name of the type in DDS, and in keys of `rmw_zenoh`: `nav_msgs::msg::dds_::Odometry_`.
    pub fn dds_name(&self) -> String {
        let (package, kind) = self.name.split_once("/msg/").unwrap_or(("", self.name));
        format!("{package}::msg::dds_::{kind}_")
    }

    /// The definition with those of all messages in it, as the schema encoding `ros2msg` of MCAP wants it.
    pub fn text(&self) -> String {
        let mut text = self.own_text();
        let mut seen = vec![self.name];
        self.append_nested(&mut text, &mut seen);
        text
    }

    fn append_nested(&self, text: &mut String, seen: &mut Vec<&'static str>) {
        for nested in self.fields.iter().filter_map(|field| field.kind.message()) {
            if seen.contains(&nested.name) {
                continue;
            }
            seen.push(nested.name);
            // Writing to a string cannot fail, here and below.
            let _ = write!(text, "{}\nMSG: {}\n{}", "=".repeat(80), nested.short_name(), nested.own_text());
            nested.append_nested(text, seen);
        }
    }

    fn own_text(&self) -> String {
        let mut text = String::new();
        for Constant { name, kind, value } in &self.constants {
            let _ = writeln!(text, "{} {name}={value}", kind.text());
        }
        for Field { name, kind, default } in &self.fields {
            let default = default.map(|value| format!(" {value}")).unwrap_or_default();
            let _ = writeln!(text, "{} {name}{default}", kind.text());
        }
        text
    }

    /// The type hash of REP 2016: SHA-256 over the type's description and those of the types that it refers to, as
    /// JSON with a blank behind every comma and colon. Constants and defaults do not enter.
    pub fn hash(&self) -> String {
        let mut nested = BTreeMap::new();
        self.collect(&mut nested);
        nested.remove(self.name);
        let referenced: Vec<String> = nested.values().map(|description| description.json()).collect();
        let json = format!(
            r#"{{"type_description": {}, "referenced_type_descriptions": [{}]}}"#,
            self.json(),
            referenced.join(", ")
        );
        let digest = Sha256::new().update(json.as_bytes()).finalize();
        digest.iter().fold("RIHS01_".to_owned(), |mut text, byte| {
            let _ = write!(text, "{byte:02x}");
            text
        })
    }

    fn collect<'a>(&'a self, into: &mut BTreeMap<&'static str, &'a Self>) {
        into.insert(self.name, self);
        for nested in self.fields.iter().filter_map(|field| field.kind.message()) {
            nested.collect(into);
        }
    }

    fn json(&self) -> String {
        let field = |field: &Field| {
            let (number, capacity, nested) = field.kind.numbered();
            format!(
                r#"{{"name": "{}", "type": {{"type_id": {number}, "capacity": {capacity}, "string_capacity": 0, "nested_type_name": "{nested}"}}}}"#,
                field.name
            )
        };
        let fields: Vec<String> = self.fields.iter().map(field).collect();
        format!(r#"{{"type_name": "{}", "fields": [{}]}}"#, self.name, fields.join(", "))
    }
}
