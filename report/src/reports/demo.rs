//! The report of the observability demonstration.

use crate::figures::{Extent, error_figures, map_figure, sigma_figure, sigma_patterns};
use crate::number::{bytes, count, duration};
use crate::reports::{MAP_CAPTION, SIGMA_MEANING};
use crate::{Document, Panel, ReportError, Table, TeamSeries, Verdict, quantity};

/// Late by early team sigma from which a case counts as growing; up to it, as bounded. Wide enough for the
/// waves of a bounded sigma, narrow against the growth of an unbounded one over a run of minutes.
const GROWTH: f64 = 1.25;

/// What the demonstration showed.
#[derive(Clone, Debug, PartialEq)]
pub struct DemoReport {
    /// Duration of every case, seconds.
    pub seconds: f64,
    /// Seed of world and noise.
    pub seed: u64,
    /// Number of robots.
    pub robots: usize,
    /// The cases: the same world and noise with other sensors.
    pub cases: Vec<DemoCase>,
    /// The command that makes this report again.
    pub command: String,
}

/// One case of the demonstration.
#[derive(Clone, Debug, PartialEq)]
pub struct DemoCase {
    /// Name, for people: `relative only`.
    pub name: String,
    /// Estimates and truth.
    pub series: TeamSeries,
    /// Rank of the observability matrix.
    pub rank: usize,
    /// Dimension of the team's state, three per robot.
    pub dimension: usize,
    /// The directions that nothing observes, for people: `x of the whole team`.
    pub unobservable: Vec<String>,
    /// Position sigma, root mean square over the robots, early in the run, metres.
    pub team_sigma_early_m: f64,
    /// The same late in the run, metres.
    pub team_sigma_late_m: f64,
    /// Largest position sigma of any robot at the end, metres.
    pub final_position_sigma_m: f64,
    /// Position error, root mean square over robots and time, metres.
    pub position_rmse_m: f64,
    /// Operating-system processes that took part.
    pub processes: usize,
    /// Facts that the robots agreed on.
    pub facts: u64,
    /// Messages sent.
    pub messages: u64,
    /// Their size, bytes.
    pub bytes: u64,
    /// Remarks, for people.
    pub notes: Vec<String>,
}

impl DemoCase {
    fn is_observable(&self) -> bool {
        self.rank == self.dimension
    }

    fn grows(&self) -> bool {
        self.team_sigma_late_m > GROWTH * self.team_sigma_early_m
    }

    /// Rank and sigma agree: what is not fully observed grows, what is stays bounded.
    fn is_as_predicted(&self) -> bool {
        let finite = self.team_sigma_early_m.is_finite() && self.team_sigma_late_m.is_finite();
        finite && self.grows() != self.is_observable()
    }

    fn sentence(&self) -> String {
        let (early, late) = (quantity(self.team_sigma_early_m, "m"), quantity(self.team_sigma_late_m, "m"));
        let course = if self.grows() {
            format!("the team's position sigma grows from {early} to {late}")
        } else {
            format!("the team's position sigma stays bounded, {early} early and {late} late")
        };
        format!("With “{}”, rank {} of {}: {course}.", self.name, self.rank, self.dimension)
    }
}

/// The report of the demonstration: verdict and comparison first, then sigmas, maps, errors, explanation.
///
/// # Errors
/// [`ReportError::ColumnLength`] if the columns of a robot differ in length.
pub fn demo_report(demo: &DemoReport) -> Result<Document, ReportError> {
    let verdict = if !demo.cases.is_empty() && demo.cases.iter().all(DemoCase::is_as_predicted) {
        Verdict::Holds
    } else {
        Verdict::Fails
    };
    let sentences: Vec<String> = demo.cases.iter().map(DemoCase::sentence).collect();
    let mut document = Document::new("A team of robots is one estimator: what it can and cannot know")
        .lead(format!(
            "{} robots drive for {} and localize as one distributed Kalman filter that no machine owns. \
             Theory says: seeing only each other, they know how they stand to one another but lose where they are; \
             absolute observations of a single robot hold all of them.",
            demo.robots,
            duration(demo.seconds)
        ))
        .verdict(verdict, sentences.join(" "))
        .table(comparison(demo))
        .section("How sure the robots are");
    let cases: Vec<(&str, &TeamSeries)> =
        demo.cases.iter().map(|case| (case.name.as_str(), &case.series)).collect();
    document = document.figure(
        sigma_figure(&cases)?,
        format!(
            "Position sigma of every robot in every case on one axis. Colour tells the robot, line pattern the case \
             ({}); the labels give the root mean square over the robots at the end. {SIGMA_MEANING}",
            sigma_patterns(&cases)
        ),
    );
    document = document.section("Where they thought they were").panels(maps(demo)?, maps_caption());
    document = errors(document, demo)?;
    document = explanation(document, demo);
    let notes = demo
        .cases
        .iter()
        .flat_map(|case| case.notes.iter().map(move |note| format!("{}: {note}", case.name)));
    let notes: Vec<String> = notes.collect();
    if !notes.is_empty() {
        document = document.section("Remarks").list(notes);
    }
    Ok(document.reproduce(
        format!("The same seed ({}) gives the same world and the same noise.", demo.seed),
        demo.command.clone(),
    ))
}

fn comparison(demo: &DemoReport) -> Table {
    let header = std::iter::once(String::new()).chain(demo.cases.iter().map(|case| case.name.clone()));
    let caption = format!(
        "The cases share world, motion and noise (seed {}); only the sensors differ. Team sigma: root mean square of the \
         robots' position sigmas.",
        demo.seed
    );
    let row = |name: &str, cell: &dyn Fn(&DemoCase) -> String| -> Vec<String> {
        std::iter::once(name.to_owned()).chain(demo.cases.iter().map(cell)).collect()
    };
    Table::new(caption, header)
        .numeric()
        .row(row("Observable directions", &|case| format!("{} of {}", case.rank, case.dimension)))
        .row(row("Team position sigma, early", &|case| quantity(case.team_sigma_early_m, "m")))
        .row(row("Team position sigma, late", &|case| quantity(case.team_sigma_late_m, "m")))
        .row(row("Largest position sigma at the end", &|case| quantity(case.final_position_sigma_m, "m")))
        .row(row("Position error against truth (RMS)", &|case| quantity(case.position_rmse_m, "m")))
        .row(row("Processes", &|case| case.processes.to_string()))
        .row(row("Facts agreed on", &|case| count(case.facts)))
        .row(row("Messages", &|case| format!("{} ({})", count(case.messages), bytes(case.bytes))))
}

fn maps(demo: &DemoReport) -> Result<Vec<Panel>, ReportError> {
    let teams: Vec<&TeamSeries> = demo.cases.iter().map(|case| &case.series).collect();
    let extent = Extent::around(&teams, &[]);
    let map = |case: &DemoCase| {
        Ok(Panel { heading: sentence_case(&case.name), figure: map_figure(&case.series, &[], extent)? })
    };
    demo.cases.iter().map(map).collect()
}

fn maps_caption() -> String {
    format!(
        "The same drive, localized in every case, at one scale. {MAP_CAPTION} Ellipses too wide for the frame are cut."
    )
}

fn errors(mut document: Document, demo: &DemoReport) -> Result<Document, ReportError> {
    document = document.section("Errors against the filter's own bounds").prose(
        "A filter is consistent if its errors stay within the bounds it claims, whether these are narrow or wide: \
         99.7 % of Gaussian errors lie within three sigma.",
    );
    for case in &demo.cases {
        document = document.panels(
            error_figures(&case.series)?,
            format!(
                "{}: error of x, y and yaw (line) within three sigma (grey) for every robot, in the map frame, at one \
                 scale. Bounds beyond the frame are cut.",
                sentence_case(&case.name)
            ),
        );
    }
    Ok(document)
}

fn explanation(mut document: Document, demo: &DemoReport) -> Document {
    document = document.section("Why: observability").prose(
        "A relative observation, such as one robot's range and bearing to another, reads the same if the whole team is moved \
         or turned as one. Three directions of the joint state (x, y and heading of the team as a whole) therefore never \
         show in any such observation: the observability matrix of N robots has rank 3N − 3 of 3N. Along these directions \
         odometry noise adds up and nothing takes it away, so the sigmas grow without bound, although the robots know \
         their places relative to each other well. Absolute observations of one robot (a position now and then \
         while it moves is enough) make the rank full, and the correlations that the joint filter keeps carry them to \
         every other robot.",
    );
    for case in &demo.cases {
        if case.unobservable.is_empty() {
            continue;
        }
        document = document
            .prose(format!("Directions that nothing observes in the case “{}”:", case.name))
            .list(case.unobservable.clone());
    }
    document
}

fn sentence_case(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or(String::new(), |first| first.to_uppercase().chain(characters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case(rank: usize, early: f64, late: f64) -> DemoCase {
        DemoCase {
            name: "relative only".into(),
            series: TeamSeries::default(),
            rank,
            dimension: 15,
            unobservable: Vec::new(),
            team_sigma_early_m: early,
            team_sigma_late_m: late,
            final_position_sigma_m: late,
            position_rmse_m: 0.1,
            processes: 6,
            facts: 1,
            messages: 1,
            bytes: 1,
            notes: Vec::new(),
        }
    }

    #[test]
    fn the_verdict_asks_rank_and_sigma_to_agree() {
        assert!(case(12, 0.2, 1.5).is_as_predicted());
        assert!(case(15, 0.2, 0.21).is_as_predicted());
        // Planted faults: a deficient case that does not grow, a full one that does, a missing number.
        assert!(!case(12, 0.2, 0.2).is_as_predicted());
        assert!(!case(15, 0.2, 1.5).is_as_predicted());
        assert!(!case(15, 0.2, f64::NAN).is_as_predicted());
    }

    #[test]
    fn a_failed_prediction_is_not_called_a_success() {
        let report =
            |cases| DemoReport { seconds: 60.0, seed: 1, robots: 5, cases, command: "pleiad demo".into() };
        let failed = demo_report(&report(vec![case(15, 0.2, 1.5)])).unwrap().render();
        assert!(failed.contains("Not as predicted.") && !failed.contains("<b>As predicted.</b>"));
        let held = demo_report(&report(vec![case(12, 0.2, 1.5)])).unwrap().render();
        assert!(held.contains("<b>As predicted.</b>"));
        let nothing = demo_report(&report(Vec::new())).unwrap().render();
        assert!(nothing.contains("Not as predicted."));
    }
}
