//! Tables and figures of the rules of motion.

use pleiad_report::{Axis, Colour, Figure, Table, Trace};

use super::team::{Case, Run};
use super::{
    BLOCKED_S, Outcome, TASK_M, after_block_rmse_m, blocked_rmse_m, late_rmse_m, task_rmse_m, task_time_s,
    words,
};
use crate::Shown;

/// Points of a curve.
const POINTS: usize = 48;

pub(super) fn shown(outcome: &Outcome) -> Vec<Shown> {
    vec![
        Shown::Table(tasks(outcome)),
        Shown::Figure(
            curve(outcome, Axis::new("time", "s"), outcome.duration_s, |look| look.t_s),
            "Position error of the robots that move, root mean square over robots and runs, against time.".to_owned(),
        ),
        Shown::Figure(
            curve(outcome, Axis::new("distance driven by the team", "m"), 2.0 * TASK_M, |look| look.distance_m),
            "The same error against the distance that the team has driven together: what a metre costs in accuracy."
                .to_owned(),
        ),
        Shown::Figure(
            trade(outcome),
            format!("Time needed for {TASK_M:.0} m of the team, and the error at its end; one dot is one run."),
        ),
        Shown::Table(blocked(outcome)),
        Shown::Figure(
            blocked_curve(outcome),
            format!(
                "Nobody sees anybody from {} s to {} s: the error of the joint filter on each rule's motion.",
                BLOCKED_S[0], BLOCKED_S[1]
            ),
        ),
    ]
}

fn tasks(outcome: &Outcome) -> Table {
    let caption = format!(
        "Means over {} runs with 95 % intervals. Errors are those of the robots that move. Sight: share of the time of \
         moving robots in which they see as many standing ones as their system needs (2, 3, 1).",
        outcome.seeds
    );
    let header = [
        "rule".to_owned(),
        "team distance per second".to_owned(),
        format!("time for {TASK_M:.0} m"),
        format!("RMSE at {TASK_M:.0} m"),
        format!("RMSE at {:.0} s", outcome.duration_s),
        "sight that the rule needs".to_owned(),
        "a robot sees nobody".to_owned(),
    ];
    let mut table = Table::new(caption, header).numeric();
    for case in Case::ALL {
        let percent = |of: fn(&Run) -> Option<f64>| words(outcome.free(case, of), "%");
        table = table.row([
            case.name().to_owned(),
            words(outcome.free(case, |run| Some(run.pace_m_s())), "m/s"),
            words(outcome.free(case, task_time_s), "s"),
            words(outcome.free(case, task_rmse_m), "m"),
            words(outcome.free(case, late_rmse_m), "m"),
            if case.needs().is_some() {
                percent(|run| Some(100.0 * run.in_sight?))
            } else {
                "none needed".into()
            },
            percent(|run| Some(100.0 * run.alone)),
        ]);
    }
    table
}

fn blocked(outcome: &Outcome) -> Table {
    let caption = "Nobody sees anybody for 30 s. By sight alone, as the camera and the beacons have it, a robot is where it \
                   was last seen; the joint filter goes on by odometry.";
    let header =
        ["rule", "by sight alone, off by", "joint filter at the end of the block", "joint filter 10 s later"];
    let mut table = Table::new(caption, header).numeric();
    for case in Case::ALL {
        let alone = words(outcome.blocked(case, |run| run.off_by_sight_m), "m");
        table = table.row([
            case.name().to_owned(),
            if case.needs().is_some() { alone } else { "not located by sight".into() },
            words(outcome.blocked(case, blocked_rmse_m), "m"),
            words(outcome.blocked(case, after_block_rmse_m), "m"),
        ]);
    }
    table
}

fn line(runs: &[Run], until: f64, along: impl Fn(&super::Look) -> f64) -> (Vec<f64>, Vec<f64>) {
    let width = until / POINTS as f64;
    let (mut xs, mut ys) = (Vec::new(), Vec::new());
    for bin in 0..POINTS {
        let (from, to) = (bin as f64 * width, (bin + 1) as f64 * width);
        let looks = runs.iter().flat_map(|run| &run.looks).filter(|look| (from..to).contains(&along(look)));
        let squares: Vec<f64> = looks.map(|look| look.square_m2).collect();
        // A team that drives no further in its time ends its curve: a few runs that came further are not its mean.
        let all_there = runs.iter().all(|run| run.looks.iter().any(|look| along(look) >= from));
        if all_there && !squares.is_empty() {
            xs.push(0.5 * (from + to));
            ys.push((squares.iter().sum::<f64>() / squares.len() as f64).sqrt());
        }
    }
    (xs, ys)
}

fn curve(outcome: &Outcome, x: Axis, until: f64, along: fn(&super::Look) -> f64) -> Figure {
    let mut figure = Figure::new(x, Axis::new("position RMSE", "m").logarithmic());
    for (index, (case, runs)) in outcome.free.iter().enumerate() {
        let (xs, ys) = line(runs, until, along);
        figure = figure.trace(Trace::line(case.name(), &xs, &ys, Colour::Series(index)));
    }
    figure
}

fn blocked_curve(outcome: &Outcome) -> Figure {
    let mut figure = Figure::new(Axis::new("time", "s"), Axis::new("position RMSE", "m").logarithmic());
    for (index, (case, runs)) in outcome.blocked.iter().enumerate() {
        let (xs, ys) = line(runs, super::BLOCKED_RUN_S, |look| look.t_s);
        figure = figure.trace(Trace::line(case.name(), &xs, &ys, Colour::Series(index)));
    }
    figure
}

fn trade(outcome: &Outcome) -> Figure {
    let mut figure = Figure::new(
        Axis::new("time for the task", "s").from_zero(),
        Axis::new("position RMSE at its end", "m").logarithmic(),
    );
    for (index, (case, runs)) in outcome.free.iter().enumerate() {
        let pairs = runs.iter().filter_map(|run| Some((task_time_s(run)?, task_rmse_m(run)?)));
        let (xs, ys): (Vec<f64>, Vec<f64>) = pairs.unzip();
        figure = figure.trace(Trace::markers(case.name(), &xs, &ys, Colour::Series(index), "circle", 7.0));
    }
    figure
}
