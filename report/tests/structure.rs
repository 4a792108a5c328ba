//! What every report must have: axes with units, data in every figure, nothing fetched, nothing injected.

#![allow(clippy::unwrap_used, reason = "helpers of tests may fail as tests do")]

use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{LandmarkId, Pose2, RobotId};
use pleiad_report::{
    Accuracy, Axis, Colour, DemoCase, DemoReport, Document, FactCount, Figure, Landmark, NisPoint, NisSeries,
    ReplayReport, ReportError, RobotScore, RobotSeries, Table, TeamSeries, Trace, Verdict, demo_report,
    replay_report, run_report,
};

mod page;

use page::{PLOTLY, check_figures, figures, outside_references};

const HOSTILE: &str = "</script><script>alert('x')</script><img src=\"http://evil.example/\" onerror=a&b>";

fn team(robots: u32, instants: usize) -> TeamSeries {
    let series = |robot: u32| {
        let poses: Vec<Pose2> = (0..instants)
            .map(|i| Pose2::new((i as f64 * 0.01).cos() * f64::from(robot), (i as f64 * 0.013).sin(), 0.1))
            .collect();
        RobotSeries {
            robot: RobotId(robot),
            time_s: (0..instants).map(|i| i as f64 * 0.02).collect(),
            covariance: vec![Symmetric3::diagonal(0.01, 0.02, 0.001); instants],
            truth: poses.iter().enumerate().map(|(i, pose)| (i % 10 != 3).then_some(*pose)).collect(),
            dead_reckoning: Some(vec![(0.0, Pose2::identity()), (1.0, Pose2::new(1.0, 0.0, 0.0))]),
            estimate: poses,
        }
    };
    TeamSeries { robots: (1..=robots).map(series).collect() }
}

fn demo(name: &str, instants: usize) -> DemoReport {
    let case = |name: &str, rank: usize, late: f64| DemoCase {
        name: name.into(),
        series: team(3, instants),
        rank,
        dimension: 9,
        unobservable: vec![name.into()],
        team_sigma_early_m: 0.1,
        team_sigma_late_m: late,
        final_position_sigma_m: late,
        position_rmse_m: 0.05,
        processes: 4,
        facts: 100,
        messages: 1_000,
        bytes: 123_456,
        notes: vec![name.into()],
    };
    DemoReport {
        seconds: 60.0,
        seed: 1,
        robots: 3,
        cases: vec![case(name, 6, 2.0), case("with absolute", 9, 0.1)],
        command: format!("pleiad demo {name}"),
    }
}

fn replay(name: &str, robots: u32, instants: usize) -> ReplayReport {
    let accuracy = |position_rmse_m| Some(Accuracy { position_rmse_m, heading_rmse_rad: 0.02 });
    let score = |robot| RobotScore {
        robot: RobotId(robot),
        distance_m: 100.0,
        settled: accuracy(0.1),
        online: accuracy(0.12),
        dead_reckoning: accuracy(1.5),
    };
    let point = |i: u32| NisPoint { time_s: f64::from(i), nis: f64::from(i) * 0.1, used: i < 90 };
    ReplayReport {
        name: name.into(),
        seconds: 100.0,
        series: team(robots, instants),
        landmarks: vec![Landmark { id: LandmarkId(6), x_m: 1.0, y_m: 2.0 }],
        scores: (1..=robots).map(score).collect(),
        nis: vec![NisSeries {
            name: name.into(),
            degrees_of_freedom: 2,
            points: (0..100).map(point).collect(),
        }],
        facts: vec![FactCount { kind: name.into(), used: 90, rejected: 10, pending: 0 }],
        highlights: vec![(name.into(), name.into())],
        notes: vec![name.into()],
        commands: vec![(name.into(), name.into())],
    }
}

#[test]
fn every_figure_of_every_report_has_units_and_data() {
    check_figures(&demo_report(&demo("relative only", 200)).unwrap().render());
    check_figures(&replay_report(&replay("mrclam-1", 2, 200)).unwrap().render());
    check_figures(&run_report(&replay("arena", 2, 200)).unwrap().render());
}

#[test]
fn a_report_refers_to_nothing_outside_itself() {
    for html in [
        demo_report(&demo("relative only", 200)).unwrap().render(),
        replay_report(&replay("mrclam-1", 2, 200)).unwrap().render(),
    ] {
        assert_eq!(outside_references(&html), Vec::<String>::new());
        assert_eq!(html.matches(PLOTLY).count(), 1);
        assert!(html.contains("default-src 'none'"));
    }
}

#[test]
fn the_search_for_outside_references_finds_planted_ones() {
    for planted in ["<img src=\"a.png\">", "<script>fetch('x')</script>", "<p>https://example.org</p>"] {
        let html = Document::new("clean").render().replace("</main>", planted);
        assert!(!outside_references(&html).is_empty(), "{planted}");
    }
}

#[test]
fn hostile_text_stays_text_everywhere() {
    let document = Document::new(HOSTILE)
        .lead(HOSTILE)
        .verdict(Verdict::Holds, HOSTILE)
        .fact(HOSTILE, HOSTILE)
        .table(Table::new(HOSTILE, [HOSTILE, HOSTILE]).numeric().row([HOSTILE, HOSTILE]))
        .section(HOSTILE)
        .prose(format!("`{HOSTILE}` and ` {HOSTILE}"))
        .list([HOSTILE])
        .figure(
            Figure::new(Axis::new(HOSTILE, HOSTILE), Axis::category(HOSTILE))
                .trace(Trace::line(HOSTILE, &[0.0], &[1.0], Colour::Ink))
                .note(0.0, 0.0, HOSTILE),
            HOSTILE,
        )
        .reproduce(HOSTILE, HOSTILE);
    let documents =
        [document, demo_report(&demo(HOSTILE, 50)).unwrap(), replay_report(&replay(HOSTILE, 1, 50)).unwrap()];
    for document in documents {
        let html = document.render();
        let own = html.replace(PLOTLY, "");
        // Scripts of the page: one of data per figure, the library, the page's own.
        assert_eq!(own.matches("<script").count(), figures(&html).len() + 2);
        assert_eq!(own.matches("<script").count(), own.matches("</script").count());
        assert!(!own.contains("<img"), "not escaped");
    }
}

#[test]
fn equal_data_give_equal_bytes() {
    let render = || demo_report(&demo("relative only", 300)).unwrap().render();
    assert_eq!(render(), render());
}

#[test]
fn five_robots_over_twenty_five_minutes_stay_below_eight_megabytes() {
    // 25 min at 50 Hz.
    let html = replay_report(&replay("long", 5, 75_000)).unwrap().render();
    assert!(html.len() < 8_000_000, "{} bytes", html.len());
    assert!(html.contains("Long series are thinned"));
    assert!(!replay_report(&replay("short", 2, 200)).unwrap().render().contains("Long series are thinned"));
}

#[test]
fn non_finite_estimates_are_gaps_and_not_numbers() {
    let mut report = replay("broken", 1, 50);
    report.series.robots[0].covariance[20] = Symmetric3([f64::NAN; 6]);
    report.series.robots[0].estimate[30] = Pose2::new(f64::INFINITY, 0.0, 0.0);
    report.scores[0].distance_m = f64::NAN;
    let html = replay_report(&report).unwrap().render();
    check_figures(&html);
    assert!(html.contains("n/a") && html.contains("null"));
    let own = html.replace(PLOTLY, "");
    assert!(!own.contains("NaN") && !own.contains(":inf"));
}

#[test]
fn robots_without_truth_have_no_error_figures() {
    let mut report = replay("no truth", 2, 50);
    for robot in &mut report.series.robots {
        robot.truth.fill(None);
    }
    for score in &mut report.scores {
        (score.settled, score.online, score.dead_reckoning) = (None, None, None);
    }
    let html = replay_report(&report).unwrap().render();
    check_figures(&html);
    assert!(html.contains("No ground truth") && !html.contains("% within 3σ"));
}

#[test]
fn columns_of_unequal_length_are_refused() {
    let mut report = demo("relative only", 50);
    report.cases[1].series.robots[2].truth.pop();
    let error = demo_report(&report).unwrap_err();
    assert!(
        matches!(error, ReportError::ColumnLength { column: "truth", found: 49, expected: 50, .. }),
        "{error}"
    );
}

#[test]
fn a_written_report_is_complete_and_leaves_nothing_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.html");
    std::fs::write(&path, "old").unwrap();
    let document = demo_report(&demo("relative only", 50)).unwrap();
    document.write(&path).unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), document.render());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn the_library_is_the_version_that_its_note_states() {
    let note = include_str!("../assets/README.md");
    let version = PLOTLY.lines().nth(1).unwrap().rsplit(' ').next().unwrap().trim_start_matches('v');
    assert!(note.contains(&format!("plotly.js {version}")), "{version}");
    assert!(!PLOTLY.contains("</script") && !PLOTLY.contains("<!--"), "cannot stand inside a script element");
}
