//! The reports of a run and of a replayed recording.

use pleiad_estimation::RobotId;

use crate::figures::{bar_figure, error_figures, map_figure, nis_figure, share_within_bounds, sigma_figure};
use crate::number::{count, duration};
use crate::reports::{MAP_CAPTION, SIGMA_MEANING};
use crate::{
    Accuracy, Axis, Colour, Document, Landmark, NisSeries, Panel, ReportError, Table, TeamSeries, quantity,
};

/// What a run or a replay showed.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplayReport {
    /// Name of the scenario or recording.
    pub name: String,
    /// Duration, seconds.
    pub seconds: f64,
    /// The settled estimates: those made of all facts up to each instant.
    pub series: TeamSeries,
    /// The map.
    pub landmarks: Vec<Landmark>,
    /// Numbers per robot.
    pub scores: Vec<RobotScore>,
    /// Innovations per kind of observation.
    pub nis: Vec<NisSeries>,
    /// What became of the facts, per kind.
    pub facts: Vec<FactCount>,
    /// More to know at a glance: name and value.
    pub highlights: Vec<(String, String)>,
    /// Remarks, for people.
    pub notes: Vec<String>,
    /// Commands: what each reproduces, and the command.
    pub commands: Vec<(String, String)>,
}

/// How well one robot was localized.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotScore {
    /// Which.
    pub robot: RobotId,
    /// Distance driven, metres.
    pub distance_m: f64,
    /// Of settled estimates; `None` without truth.
    pub settled: Option<Accuracy>,
    /// Of online estimates, made of the facts held when they were emitted.
    pub online: Option<Accuracy>,
    /// Of odometry alone.
    pub dead_reckoning: Option<Accuracy>,
}

/// What became of the facts of one kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FactCount {
    /// What kind, for people: `range and bearing to a robot`.
    pub kind: String,
    /// Used by the filter.
    pub used: u64,
    /// Rejected by its gate.
    pub rejected: u64,
    /// Waiting for a missing half or an earlier entry.
    pub pending: u64,
}

/// The report of a run.
///
/// # Errors
/// As [`replay_report`].
pub fn run_report(report: &ReplayReport) -> Result<Document, ReportError> {
    team_report(report, &format!("Run: {}", report.name))
}

/// The report of a replayed recording.
///
/// # Errors
/// [`ReportError::ColumnLength`] if the columns of a robot differ in length,
/// [`ReportError::NisDimension`] for an innovation of a dimension other than 1 to 6.
pub fn replay_report(report: &ReplayReport) -> Result<Document, ReportError> {
    team_report(report, &format!("Replay: {}", report.name))
}

fn team_report(report: &ReplayReport, title: &str) -> Result<Document, ReportError> {
    let mut document = Document::new(title)
        .lead(lead(report))
        .fact("Robots", report.series.robots.len().to_string())
        .fact("Duration", duration(report.seconds))
        .fact("Facts used", count(report.facts.iter().map(|fact| fact.used).sum()));
    for (key, value) in &report.highlights {
        document = document.fact(key, value);
    }
    document = document.table(scores_table(&report.scores));
    if report.scores.iter().any(|score| score.settled.is_some() && score.dead_reckoning.is_some()) {
        document = document.figure(
            scores_figure(&report.scores)?,
            "Position error per robot (root mean square): the team's estimates against odometry alone.",
        );
    }
    document = document
        .section("Trajectories")
        .figure(
            map_figure(&report.series, &report.landmarks, None)?,
            format!(
                "{MAP_CAPTION} Diamonds: landmarks. Dead reckoning, where recorded, can be switched on in the legend."
            ),
        )
        .section("Uncertainty")
        .figure(
            sigma_figure(&[("settled", &report.series)])?,
            format!("Position sigma of every robot over time. {SIGMA_MEANING}"),
        );
    let errors = error_figures(&report.series)?;
    if !errors.is_empty() {
        document = document.section("Errors against the filter's own bounds").panels(
            errors,
            "Error of x, y and yaw (line) within three sigma (grey) for every robot with known truth, in the map frame, \
             at one scale. A consistent filter keeps 99.7 % within. Bounds beyond the frame are cut.",
        );
    }
    document = innovations(document, report)?;
    if !report.notes.is_empty() {
        document = document.section("Remarks").list(report.notes.clone());
    }
    for (what, command) in &report.commands {
        document = document.reproduce(what, command);
    }
    Ok(document)
}

fn lead(report: &ReplayReport) -> String {
    let mean_square = |of: &dyn Fn(&RobotScore) -> Option<Accuracy>| {
        let squares: Vec<f64> =
            report.scores.iter().filter_map(of).map(|accuracy| accuracy.position_rmse_m.powi(2)).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    };
    match (mean_square(&|score| score.settled), mean_square(&|score| score.dead_reckoning)) {
        (Some(settled), Some(odometry)) => format!(
            "Localized as a team, the robots were {} from their true positions (root mean square, settled estimates); \
             odometry alone was {} off.",
            quantity(settled, "m"),
            quantity(odometry, "m")
        ),
        (Some(settled), None) => format!(
            "Localized as a team, the robots were {} from their true positions (root mean square, settled estimates).",
            quantity(settled, "m")
        ),
        (None, _) => "No ground truth is known here: the report shows estimates, their claimed uncertainty and whether \
                      the innovations agree with it."
            .to_owned(),
    }
}

fn scores_table(scores: &[RobotScore]) -> Table {
    let header = [
        "Robot",
        "Distance (m)",
        "Settled (m)",
        "Online (m)",
        "Odometry (m)",
        "Settled (rad)",
        "Online (rad)",
        "Odometry (rad)",
    ];
    let metres = |accuracy: &Option<Accuracy>| cell(accuracy.map(|accuracy| accuracy.position_rmse_m));
    let radians = |accuracy: &Option<Accuracy>| cell(accuracy.map(|accuracy| accuracy.heading_rmse_rad));
    let mut table = Table::new(
        "Root mean square errors of position (m) and heading (rad) against truth. Settled: with all facts up to each \
         instant. Online: with the facts held when the estimate was emitted. Odometry: dead reckoning without any \
         observation.",
        header,
    )
    .numeric();
    for score in scores {
        table = table.row([
            score.robot.to_string(),
            quantity(score.distance_m, ""),
            metres(&score.settled),
            metres(&score.online),
            metres(&score.dead_reckoning),
            radians(&score.settled),
            radians(&score.online),
            radians(&score.dead_reckoning),
        ]);
    }
    table
}

fn cell(value: Option<f64>) -> String {
    value.map_or("–".to_owned(), |value| quantity(value, ""))
}

fn scores_figure(scores: &[RobotScore]) -> Result<crate::Figure, ReportError> {
    let robots: Vec<String> = scores.iter().map(|score| crate::figures::robot_name(score.robot)).collect();
    let values = |of: &dyn Fn(&RobotScore) -> Option<Accuracy>| -> Vec<f64> {
        scores.iter().map(|score| of(score).map_or(f64::NAN, |accuracy| accuracy.position_rmse_m)).collect()
    };
    let mut groups = vec![("settled", Colour::Series(0), values(&|score| score.settled))];
    if scores.iter().any(|score| score.online.is_some()) {
        groups.push(("online", Colour::Series(4), values(&|score| score.online)));
    }
    groups.push(("odometry alone", Colour::Muted, values(&|score| score.dead_reckoning)));
    bar_figure("robot", &robots, Axis::new("position error, RMS", "m"), &groups)
}

fn innovations(mut document: Document, report: &ReplayReport) -> Result<Document, ReportError> {
    if report.nis.is_empty() && report.facts.is_empty() {
        return Ok(document);
    }
    document = document.section("Observations");
    if !report.facts.is_empty() {
        let caption = "Facts by kind. Rejected: the innovation did not pass the gate. Pending: waiting for a missing half or \
                       an earlier entry.";
        let mut table = Table::new(caption, ["Kind", "Used", "Rejected", "Pending"]).numeric();
        for fact in &report.facts {
            table =
                table.row([fact.kind.clone(), count(fact.used), count(fact.rejected), count(fact.pending)]);
        }
        document = document.table(table);
    }
    let mut panels = Vec::new();
    for series in report.nis.iter().filter(|series| !series.points.is_empty()) {
        let share = share_within_bounds(series)?
            .map_or(String::new(), |share| format!(": {:.1} % within bounds", 100.0 * share));
        panels.push(Panel { heading: format!("{}{share}", series.name), figure: nis_figure(series)? });
    }
    Ok(document.panels(
        panels,
        "Normalized innovation squared (NIS) of every observation. The share within bounds is that of the used ones. Of a consistent filter 95 % lie between the dashed \
         bounds; many above mean that it is too sure of itself, many below that it is too cautious.",
    ))
}
