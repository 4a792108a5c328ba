//! Summaries, plots and self-contained HTML reports.
//!
//! A report is one file that opens anywhere without a network: the charting library, the style and the
//! data are inside it, and a content security policy in the page forbids every outside request.
//!
//! Nothing here knows where the numbers came from: callers fill plain data ([`TeamSeries`],
//! [`DemoReport`], [`ReplayReport`]), this crate draws them. Equal data give equal bytes; no clock is read.

mod accuracy;
mod card;
mod chi_square;
mod decimate;
mod document;
mod ellipse;
mod error;
mod figure;
pub mod figures;
mod html;
mod number;
mod palette;
mod reports;
mod series;
mod summary;
mod table;
mod trace;

pub use accuracy::Accuracy;
pub use card::Card;
pub use chi_square::{CONFIDENCE_95_TWO_DIMENSIONS, two_sided_95};
pub use decimate::{MAX_POINTS, even_sample, indices_keeping_extremes};
pub use document::{Document, Panel, Tone, Verdict};
pub use ellipse::ellipse_points;
pub use error::ReportError;
pub use figure::{Axis, Figure};
pub use number::{quantity, with_interval};
pub use palette::{Colour, Dash, OKABE_ITO};
pub use reports::{
    Claim, DemoCase, DemoReport, DiagnoseReport, DiagnosedRecording, EvaluateReport, EvaluateRow, Evidence,
    FactCount, FaultsReport, FaultsRow, Found, HorizonError, NotTested, ParameterEstimate, ReplayReport,
    ResidualColumns, RobotRollOut, RobotScore, STAGES, ShapeColumns, SmallestDetectable, StageTest,
    demo_report, diagnose_report, evaluate_report, faults_report, replay_report, run_report,
};
pub use series::{Landmark, NisPoint, NisSeries, RobotSeries, TeamSeries};
pub use summary::{summary_text, write_summary};
pub use table::Table;
pub use trace::Trace;
