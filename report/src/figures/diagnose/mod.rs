//! The figures of a diagnosis.

mod chain;
mod evidence;
mod floor;
mod residuals;
mod roll_outs;
mod scale;

pub(crate) use chain::{MANY, chain_drawing};
pub(crate) use evidence::{name_of, name_of_shape, partial_figure, shape_figure, strip_figure};
pub(crate) use floor::{gain_floor, residual_floors};
pub(crate) use residuals::{series_panels, spread_figure};
pub(crate) use roll_outs::roll_out_panels;
