//! The stages of the signal chain as functions: each takes what the stage before delivers, lets the active
//! effects act and passes on the result.

pub mod actuator;
pub mod body;
pub mod robot;
pub mod sensors;
pub mod servo;
