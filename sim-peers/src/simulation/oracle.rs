//! The estimate of a ledger against the oracle's on the same facts.

use pleiad_estimation::RobotId;
use pleiad_estimation::fold::{FoldConfig, Others};
use pleiad_estimation::geometry::Matrix3;
use pleiad_estimation::joint::{Block, ErrorForm, Joint};
use pleiad_estimation::reference::{self, JointEkf, JointEstimate, ReferenceFact};

use super::units::{UNITS, folded, in_units, pose};

/// Relative difference from the oracle that rounding explains.
const TOLERANCE: f64 = 1e-9;

/// How many times what either of the two is moved by other units of length they may be apart, where the facts
/// determine the estimate so badly that this is more. Other units change nothing but roundings.
const ROUNDINGS: f64 = 4.0;

/// Whether a ledger believes what the oracle does, or what is off.
pub fn agrees(
    joint: &Joint,
    facts: &[ReferenceFact],
    others: &Others<'_>,
    fold: &FoldConfig,
) -> Result<(), String> {
    let parameters = |block: &Block| !matches!(block, Block::Robot(_));
    let more = fold.clutter.is_some() || fold.inflation.is_some() || fold.quarantine.is_some();
    if fold.relinearize.is_some() || more || joint.blocks().iter().any(parameters) {
        return at_once(joint, &folded(facts, fold, others));
    }
    let form = match fold.form {
        ErrorForm::Invariant => reference::ErrorForm::Invariant,
        ErrorForm::Additive => reference::ErrorForm::Additive,
    };
    let ekf = JointEkf { form, gate: fold.gate };
    let oracle = ekf.fold(facts);
    if !oracle.near_gate(&fold.gate, 1e-6).is_empty() {
        // Correct implementations may decide differently there.
        return Ok(());
    }
    let placed = joint.members().count();
    if placed != oracle.robots.len() {
        return Err(format!("{placed} robots placed, {} by the oracle", oracle.robots.len()));
    }
    let largest = oracle.covariance.matrix().amax();
    let mut rounding = None;
    let mut by_rounding = |apart: &dyn Fn(&Joint, &JointEstimate, f64) -> f64| {
        let other = rounding.get_or_insert_with(|| {
            let facts = UNITS.map(|scale| in_units(facts, scale));
            (
                facts.each_ref().map(|facts| folded(facts, fold, others)),
                facts.each_ref().map(|facts| ekf.fold(facts)),
            )
        });
        let moved = UNITS.iter().zip(other.0.iter().zip(&other.1));
        ROUNDINGS * moved.map(|(scale, (ours, theirs))| apart(ours, theirs, *scale)).fold(0.0, f64::max)
    };
    for expected in &oracle.robots {
        let robot = expected.robot;
        let Some(member) = joint.member(robot) else { return Err(format!("robot {robot} is not placed")) };
        let apart = member.correction.between(&expected.correction).log().amax();
        let scale = 1.0 + expected.correction.position().norm();
        let moved = |ours: &Joint, theirs: &JointEstimate, unit: f64| {
            let ours = ours.member(robot).map(|other| pose(&other.correction, 1.0 / unit));
            let theirs = theirs.robots.iter().find(|other| other.robot == robot);
            let theirs = theirs.map(|other| pose(&other.correction, 1.0 / unit));
            let ours = ours.map_or(0.0, |other| other.between(&member.correction).log().amax());
            ours.max(theirs.map_or(0.0, |other| other.between(&expected.correction).log().amax()))
        };
        let fine = apart <= TOLERANCE * scale || apart <= by_rounding(&moved);
        if !fine {
            return Err(format!("robot {robot} is {apart:e} off the oracle"));
        }
        for other in oracle.robots.iter().map(|other| other.robot) {
            let of_ours = |joint: &Joint| block(joint, robot, other);
            let of_theirs = |oracle: &JointEstimate| oracle.covariance.block(robot, other);
            let apart = of_ours(joint).zip(of_theirs(&oracle)).map_or(f64::NAN, |(a, b)| (a - b).amax());
            let moved = |ours: &Joint, theirs: &JointEstimate, unit: f64| {
                let back = |block: Option<Matrix3>| block.map(|block| in_metres(&block, unit));
                let ours = back(of_ours(ours)).zip(of_ours(joint)).map_or(0.0, |(a, b)| (a - b).amax());
                ours.max(back(of_theirs(theirs)).zip(of_theirs(&oracle)).map_or(0.0, |(a, b)| (a - b).amax()))
            };
            let fine = apart <= TOLERANCE * largest || apart <= by_rounding(&moved);
            if !fine {
                return Err(format!("P of {robot} and {other} is {apart:e} off"));
            }
        }
    }
    Ok(())
}

/// Whether the estimate of a ledger, which came about bit by bit and rests on cuts, is that of all facts folded at once.
fn at_once(joint: &Joint, whole: &Joint) -> Result<(), String> {
    let largest = whole.covariance().lower().iter().fold(0.0_f64, |largest, entry| largest.max(entry.abs()));
    for expected in whole.members() {
        let robot = expected.robot;
        let Some(member) = joint.member(robot) else { return Err(format!("robot {robot} is not placed")) };
        let apart = member.correction.between(&expected.correction).log().amax();
        let near = apart <= TOLERANCE * (1.0 + expected.correction.position().norm());
        if !near {
            return Err(format!("robot {robot} is {apart:e} off what all facts at once make"));
        }
        for other in whole.members().map(|other| other.robot) {
            let blocks = block(joint, robot, other).zip(block(whole, robot, other));
            let apart = blocks.map_or(f64::NAN, |(a, b)| (a - b).amax());
            let near = apart <= TOLERANCE * largest;
            if !near {
                return Err(format!("P of {robot} and {other} is {apart:e} off what all facts at once make"));
            }
        }
    }
    Ok(())
}

fn block(joint: &Joint, row: RobotId, column: RobotId) -> Option<Matrix3> {
    Some(joint.covariance().block(joint.index(row)?, joint.index(column)?))
}

/// A block of the covariance that stands in units of `1 / scale` metres.
fn in_metres(block: &Matrix3, scale: f64) -> Matrix3 {
    let by = [scale, scale, 1.0];
    Matrix3::from_fn(|row, column| block[(row, column)] / (by[row] * by[column]))
}
