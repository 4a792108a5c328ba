//! Shares found and false alarms by threshold, and shares found by size.

use serde::Serialize;

use super::{CaseResult, Class, Share};
use crate::class::Noise;

/// Points of a curve.
#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    /// What it is.
    pub name: String,
    /// What `x` is.
    pub x: &'static str,
    /// What `y` is.
    pub y: &'static str,
    /// In the order of `at`.
    pub points: Vec<Point>,
}

/// A point of a curve.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Point {
    /// The threshold or the size.
    pub at: f64,
    /// See [`Curve::x`].
    pub x: f64,
    /// See [`Curve::y`].
    pub y: Share,
}

/// What recordings are put in order by.
type Score = fn(&CaseResult) -> f64;

/// All curves that there are results for.
pub(super) fn curves(results: &[CaseResult]) -> Vec<Curve> {
    let mut all = Vec::new();
    let scores: [(&str, Score); 2] =
        [("minus log10 p", |own| own.tool.evidence), ("gain in standard errors", |own| own.tool.gain_z)];
    for (name, score) in scores {
        all.extend(roc(name, results, score));
    }
    for noise in [Noise::White, Noise::Coloured] {
        all.extend(response(noise, results));
    }
    all
}

/// Found are recordings with a single effect, at any size, whose strongest finding is above a threshold; false
/// alarms are clean ones.
fn roc(name: &str, results: &[CaseResult], score: Score) -> Option<Curve> {
    let of = |class: Class| results.iter().filter(move |own| own.class == class).map(score);
    let mut thresholds: Vec<f64> = of(Class::Clean).chain(of(Class::Single)).collect();
    thresholds.sort_by(f64::total_cmp);
    thresholds.dedup();
    let point = |at: f64| {
        let x = Share::of(of(Class::Clean).map(|own| own > at))?;
        let y = Share::of(of(Class::Single).map(|own| own > at))?;
        Some(Point { at, x: x.count as f64 / x.of as f64, y })
    };
    let points: Vec<Point> = thresholds.into_iter().filter_map(point).collect();
    let name = format!("receiver operating characteristic by {name}");
    let curve =
        Curve { name, x: "share of clean recordings", y: "share of recordings with an effect", points };
    (!curve.points.is_empty()).then_some(curve)
}

fn response(noise: Noise, results: &[CaseResult]) -> Option<Curve> {
    let own = || results.iter().filter(|own| own.class == Class::Single && own.noise == noise);
    let mut sizes: Vec<f64> = own().filter_map(|own| own.size).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.dedup();
    let point = |size: f64| {
        let at = own().filter(|own| own.size.is_some_and(|known| known.total_cmp(&size).is_eq()));
        let y = Share::of(at.flat_map(|own| own.tool.matches.iter().map(|one| one.top1)))?;
        Some(Point { at: size, x: size, y })
    };
    let points: Vec<Point> = sizes.into_iter().filter_map(point).collect();
    let name = format!("named by size, {noise} noise");
    let curve = Curve { name, x: "size over the typical one", y: "share named", points };
    (!curve.points.is_empty()).then_some(curve)
}
