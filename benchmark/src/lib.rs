//! The mismatch tool on concealed data: recordings with something in them, answers that are sealed before anything
//! is diagnosed, scores by definitions that were fixed before, and other methods on the same recordings.
//!
//! Nothing here is part of the tool, and the tool sees nothing of it: it is given a recording whose nominal model
//! is what the simulation believes.

pub mod baseline;
mod cases;
mod class;
mod error;
pub mod manoeuvre;
pub mod oracle;
mod page;
mod results;
mod run;
pub mod score;
pub mod seal;
mod summary;

pub use cases::{Case, Plan, plans};
pub use class::{Asked, Class, Noise};
pub use error::BenchmarkError;
pub use page::page;
pub use results::CaseResult;
pub use run::{ABLATIONS, ANSWERS, Options, Outcome, RESULTS, SEAL, chosen, run};
pub use summary::{Curve, Mean, Point, Row, Share, Summary, clopper_pearson, summary};
