//! The diagnosis: which effects of the catalogue recordings show.
//!
//! [`unit`] makes one long vector of a robot's residuals, [`fit`] fits effects to it, [`candidate`] and
//! [`starts`] say what could be added, [`white`] tests it, [`select`] adds and prunes, [`support`],
//! [`held_out`] and [`naming`] decide what may be said of it, [`spread`] does the same for effects that leave the
//! mean of the residuals where it is, [`open`] asks what none of them explains, [`run`] joins them.
//!
//! Without truth, [`mesh`] says how the residuals of a team hang together, and [`mesh_filter`] makes innovations of
//! them.

mod candidate;
mod chi_square;
mod corrected;
mod correlation;
mod design;
mod entries;
mod explained;
mod fit;
mod held_out;
mod known;
mod lag;
mod linearize;
mod mesh;
mod mesh_filter;
mod naming;
mod noise;
mod open;
mod pairs;
mod power;
mod profile;
mod refine;
mod related;
mod rest;
mod robust;
mod rolled;
mod run;
mod said;
mod scan;
mod seldom;
mod select;
mod series;
mod spread;
mod starts;
mod steady;
mod support;
mod term;
mod touch;
mod unit;
mod wald;
mod white;
mod without_truth;

pub(crate) use chi_square::upper_tail;
pub(crate) use corrected::section;
pub use design::{Design, DesignColumn, design};
pub use entries::composition;
pub use explained::{Explained, Rival, Structure, explained};
pub use known::{Interval, KnownFit, KnownParameter, acts_on_every_robot, fit_known, log_likelihood};
pub(crate) use mesh::{LOST, STATES, about, carried, gradient};
pub(crate) use run::{Prepared, run};
pub(crate) use select::familywise;
