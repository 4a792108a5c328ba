//! The reports of the commands.

mod demo;
pub(crate) mod diagnose;
mod evaluate;
mod faults;
mod replay;

pub use demo::{DemoCase, DemoReport, demo_report};
pub use diagnose::{
    Claim, DiagnoseReport, DiagnosedRecording, Evidence, Found, HorizonError, NotTested, ParameterEstimate,
    ResidualColumns, RobotRollOut, STAGES, ShapeColumns, SmallestDetectable, StageTest, diagnose_report,
};
pub use evaluate::{EvaluateReport, EvaluateRow, evaluate_report};
pub use faults::{FaultsReport, FaultsRow, faults_report};
pub use replay::{FactCount, ReplayReport, RobotScore, replay_report, run_report};

/// Caption of what a map shows, shared by all reports.
pub(crate) const MAP_CAPTION: &str = "Thin line: estimate; wide pale line: truth; ellipses: 95 % of the position at \
     regular times; open circle: start; dot: end.";

/// What position sigma means, shared by all reports.
pub(crate) const SIGMA_MEANING: &str = "Position sigma is √(P_xx + P_yy), the root mean square distance from the \
     true position that the filter itself expects.";
