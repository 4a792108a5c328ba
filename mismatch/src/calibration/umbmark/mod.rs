//! UMBmark (`borenstein1996`): the systematic errors of a differential drive from squares driven in both directions.
//!
//! With `D` wheel diameters and `b` the track, three ratios say what is wrong with the nominal robot:
//! `E_d = D_R / D_L`, `E_b = b_actual / b_nominal`, `E_s = D_average / D_nominal`.
//!
//! Squares that close say nothing of the scale: they give `E_d` and the ratio of turning, `E_b / E_s`, and so does a
//! turn on the spot (of it alone). A straight run between two measured points gives `E_s`, and with it `E_b`.

mod calibrate;
mod corrected;
mod error;
mod factors;
mod plan;
mod run;
mod square;

pub use calibrate::{Angles, Centre, Interval, Stage, Umbmark, calibrate, left_out, return_error, stage};
pub use corrected::{believed, corrected};
pub use error::UmbmarkError;
pub use factors::{WheelErrors, WheelFactors};
pub use plan::{Pace, square_commands, straight_commands, turn_commands};
pub use run::{Kind, Run, Turning};
pub use square::{masking_track, square_end, square_path};
