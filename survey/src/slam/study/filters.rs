//! What the choice of the error does, association without names, bearings alone, claimed.

use pleiad_estimation::statistics::{Alignment, chi_square_interval};
use pleiad_report::{Axis, Colour, Figure, Table, Trace};
use serde_json::{Value, json};

use super::super::judge::Associated;
use super::super::measure::{Ended, Measured, NEES_AT_S, Nees, Watched};
use super::{AT_LIMIT, Parts};
use crate::monte_carlo::{Estimate, share};
use crate::study::Shown;

/// Probability that a consistent filter fails a test of NEES anywhere.
const ALPHA: f64 = 0.01;

pub(super) fn forms(all: &[Measured], parts: &mut Parts) {
    let least = |form: usize| -> Vec<f64> {
        all.iter().filter_map(|run| Some(run.forms[form].over_limit?.least)).collect()
    };
    let (invariant, additive) = (least(0), least(1));
    let lowest = invariant.iter().copied().fold(f64::INFINITY, f64::min);
    let below = additive.iter().filter(|ratio| **ratio < AT_LIMIT).count();
    parts.claim(
        "With chance (heading told to 0.1 rad, sensor noise doubled) the invariant filter keeps the limit of theorem 3 exactly, at any \
         linearization; the additive one falls below it: it gains information that no sensor gave",
        format!(
            "least covariance over the limit: invariant {lowest:.7} (worst of {}); additive {} (mean over seeds), below 1 in {below} of {} \
             seeds",
            invariant.len(),
            Estimate::of(&additive).map_or("-".to_owned(), |estimate| {
                format!("{:.3} ({:.3} to {:.3})", estimate.mean, estimate.interval[0], estimate.interval[1])
            }),
            additive.len()
        ),
        lowest >= AT_LIMIT && below == additive.len() && !additive.is_empty(),
    );
    parts.number("invariant_least_over_limit", json!(lowest));
    parts.number("additive_least_over_limit", json!(Estimate::of(&additive)));
}

/// Average NEES per degree of freedom at each time, and where it would lie.
struct Anees {
    value: f64,
    interval: [f64; 2],
}

impl Anees {
    fn of(runs: impl Iterator<Item = Nees> + Clone, alpha: f64) -> Self {
        let dimension: usize = runs.clone().map(|nees| nees.dimension).sum();
        let dof = dimension as f64;
        let (low, high) = chi_square_interval(dof, alpha);
        Self { value: runs.map(|nees| nees.sum).sum::<f64>() / dof, interval: [low / dof, high / dof] }
    }

    fn consistent(&self) -> bool {
        (self.interval[0]..=self.interval[1]).contains(&self.value)
    }
}

fn anees(runs: &[&Watched], what: usize) -> Vec<Anees> {
    (0..NEES_AT_S.len())
        .map(|at| {
            let of = runs.iter().filter_map(|run| run.nees.get(at).map(|nees| nees[what]));
            Anees::of(of, ALPHA / NEES_AT_S.len() as f64)
        })
        .collect()
}

fn list(anees: &[Anees]) -> String {
    anees.iter().map(|at| format!("{:.2}", at.value)).collect::<Vec<_>>().join(", ")
}

pub(super) fn consistency(all: &[Measured], parts: &mut Parts) {
    let of = |form: usize| -> Vec<&Watched> { all.iter().map(|run| &run.forms[form]).collect() };
    let [pose, map] = [0, 1].map(|what| anees(&of(0), what));
    let [additive_pose, additive_map] = [0, 1].map(|what| anees(&of(1), what));
    let consistent = |anees: &[Anees]| anees.iter().all(Anees::consistent);
    let [low, high] = pose.first().map_or([f64::NAN; 2], |at| at.interval);
    let [map_low, map_high] = map.last().map_or([f64::NAN; 2], |at| at.interval);
    parts.claim(
        "Consistency on the same runs: the invariant filter's NEES over seeds lies in its interval at every time (1 % to fail \
         anywhere), of the pose and of the map as the vehicle sees it; the additive filter's does not",
        format!(
            "per degree of freedom at 60 to 299 s: pose {} (interval {low:.2} to {high:.2}), map {} (at the end {map_low:.2} to {map_high:.2}); \
             additive: pose {}, map {}",
            list(&pose),
            list(&map),
            list(&additive_pose),
            list(&additive_map)
        ),
        consistent(&pose) && consistent(&map) && !(consistent(&additive_pose) && consistent(&additive_map)),
    );
    let column = |anees: &[Anees], of: fn(&Anees) -> f64| anees.iter().map(of).collect::<Vec<f64>>();
    let mut rows = Vec::new();
    for (name, pose, map) in [("invariant", &pose, &map), ("additive", &additive_pose, &additive_map)] {
        rows.push(json!({
            "error": name, "at_s": NEES_AT_S, "pose": column(pose, |at| at.value), "map": column(map, |at| at.value),
            "pose_consistent": consistent(pose), "map_consistent": consistent(map),
        }));
    }
    parts.number("nees_per_dof", Value::Array(rows));
    let bound = |anees: &[Anees]| (column(anees, |at| at.interval[0]), column(anees, |at| at.interval[1]));
    let ((pose_low, pose_high), (map_low, map_high)) = (bound(&pose), bound(&map));
    let line = |name: &str, anees: &[Anees], k: usize, row: usize| {
        Trace::line(name, &NEES_AT_S, &column(anees, |at| at.value), Colour::Series(k)).in_row(row)
    };
    parts.shown.push(Shown::Figure(
        Figure::new(Axis::new("time", "s"), Axis::new("NEES of the pose per dof", "-").logarithmic())
            .row(Axis::new("NEES of the map per dof", "-").logarithmic())
            .height(520)
            .trace(Trace::band("99 % interval, all times", &NEES_AT_S, &pose_low, &pose_high, Colour::Muted))
            .trace(line("invariant", &pose, 0, 0))
            .trace(line("additive", &additive_pose, 1, 0))
            .trace(
                Trace::band("interval", &NEES_AT_S, &map_low, &map_high, Colour::Muted).in_row(1).unlisted(),
            )
            .trace(line("invariant", &map, 0, 1).unlisted())
            .trace(line("additive", &additive_map, 1, 1).unlisted()),
        "Consistency: what the errors are over what the filters say they are.".to_owned(),
    ));
}

fn summed(all: &[Measured], of: fn(&Measured) -> &Ended) -> Associated {
    all.iter().fold(Associated::default(), |sum, run| sum.plus(of(run).associated))
}

fn mean(values: impl Iterator<Item = Option<f64>>) -> f64 {
    let values: Vec<f64> = values.flatten().collect();
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

pub(super) fn association(all: &[Measured], parts: &mut Parts) {
    type Of = fn(&Measured) -> &Ended;
    let cases: [(&str, Of); 3] = [
        ("clean", |run| &run.nearest),
        ("gate a thousand times too wide", |run| &run.wide_gate),
        ("a look-alike 0.35 m beside every landmark", |run| &run.twins),
    ];
    let mut table = Table::new(
        "Nearest neighbour without names: right, wrong, landmarks founded a second time, left open; over all seeds.",
        ["", "right", "wrong", "twice", "left open", "share right", "95 % interval", "map error (m)", "way error (m)"],
    )
    .numeric();
    let mut rows = Vec::new();
    let mut found = Vec::new();
    for (name, of) in cases {
        let sum = summed(all, of);
        let [low, high] = share(sum.right, sum.decided());
        let right = sum.right as f64 / sum.decided().max(1) as f64;
        let (map, way) = (
            mean(all.iter().map(|run| of(run).map_error_m)),
            mean(all.iter().map(|run| of(run).way_error_m)),
        );
        table = table.row([
            name.to_owned(),
            sum.right.to_string(),
            sum.wrong.to_string(),
            sum.again.to_string(),
            sum.ambiguous.to_string(),
            format!("{:.3} %", 100.0 * right),
            format!("{:.3} to {:.3} %", 100.0 * low, 100.0 * high),
            format!("{map:.3}"),
            format!("{way:.3}"),
        ]);
        rows.push(json!({ "case": name, "associated": sum, "share_right": right, "interval": [low, high],
            "map_error_aligned_m": map, "way_error_m": way }));
        found.push((sum, high));
    }
    let [(clean, _), (wide, wide_high), (twins, twins_high)] = found[..] else { return };
    let [clean_low, _] = share(clean.right, clean.decided());
    parts.claim(
        "Association without names: none wrong in the clean case; a gate far too wide and look-alikes make mistakes that are seen",
        format!(
            "clean: {} of {} wrong or twice; wide gate: {} wrong or twice of {}; look-alikes: {} of {}",
            clean.wrong + clean.again,
            clean.decided(),
            wide.wrong + wide.again,
            wide.decided(),
            twins.wrong + twins.again,
            twins.decided()
        ),
        clean.wrong + clean.again == 0
            && clean.decided() > 0
            && wide_high < clean_low
            && twins_high < clean_low,
    );
    parts.number("association", Value::Array(rows));
    parts.shown.push(Shown::Table(table));
}

pub(super) fn bearings(all: &[Measured], there: usize, parts: &mut Parts) {
    let runs: Vec<&Watched> = all.iter().map(|run| &run.bearing).collect();
    let [pose, map] = [0, 1].map(|what| anees(&runs, what));
    let missed: usize = runs.iter().map(|run| there.saturating_sub(run.ran.map.len())).sum();
    let worst = runs.iter().map(|run| there.saturating_sub(run.ran.map.len())).max().unwrap_or(there);
    let errors: Vec<f64> = runs.iter().filter_map(|run| run.ran.map_error_m(Alignment::Se2)).collect();
    let poses = runs.iter().map(|run| run.ran.most_waiting_poses).max().unwrap_or(0);
    let error = Estimate::of(&errors);
    let consistent = |anees: &[Anees]| anees.iter().all(Anees::consistent);
    parts.claim(
        "Bearings alone: landmarks enter once two bearings cross well, five of six at least in every run, and the pose stays consistent",
        format!(
            "{missed} of {} landmarks missed, at most {worst} in a run; map error {} m; NEES of the pose per degree of freedom at 60 to \
             299 s: {}; at most {poses} past poses at once",
            there * runs.len(),
            error.map_or("-".to_owned(), |error| format!(
                "{:.3} ({:.3} to {:.3})",
                error.mean, error.interval[0], error.interval[1]
            )),
            list(&pose)
        ),
        6 * worst <= there && consistent(&pose),
    );
    let bounds = |anees: &[Anees]| {
        let upper: Vec<String> = anees.iter().map(|at| format!("{:.2}", at.interval[1])).collect();
        upper.join(", ")
    };
    parts.shown.push(Shown::Prose(format!(
        "Bearings alone, NEES of the map as the vehicle sees it, per degree of freedom at 60 to 299 s: {} (upper ends of the interval: {}): \
         the map is {}. A landmark that has just entered is farther from Gaussian than its ellipse says.",
        list(&map),
        bounds(&map),
        if consistent(&map) { "consistent" } else { "not consistent at every time" }
    )));
    parts.number("bearing_map_consistent", json!(consistent(&map)));
    let nameless = summed(all, |run| &run.bearing_nearest);
    let [low, high] = share(nameless.right, nameless.decided());
    let landmarks = mean(all.iter().map(|run| Some(run.bearing_nearest.landmarks as f64)));
    let nameless_error = mean(all.iter().map(|run| run.bearing_nearest.map_error_m));
    parts.shown.push(Shown::Prose(format!(
        "Bearings alone and without names: {} right, {} wrong, {} landmarks founded a second time ({:.2} to {:.2} % right), {} left \
         open; {landmarks:.1} landmarks of {there}, map error {nameless_error:.3} m. A bearing says little of which landmark it is of.",
        nameless.right,
        nameless.wrong,
        nameless.again,
        100.0 * low,
        100.0 * high,
        nameless.ambiguous
    )));
    parts.number("bearing_map_error_aligned_m", json!(error));
    parts.number("bearing_landmarks_missed", json!(missed));
    parts.number("bearing_most_waiting_poses", json!(poses));
    parts.number(
        "bearing_nees_per_dof",
        json!({ "pose": pose.iter().map(|at| at.value).collect::<Vec<_>>(), "map": map.iter().map(|at| at.value).collect::<Vec<_>>() }),
    );
    parts.number(
        "bearing_without_names",
        json!({ "associated": nameless, "landmarks": landmarks, "map_error_aligned_m": nameless_error }),
    );
}
