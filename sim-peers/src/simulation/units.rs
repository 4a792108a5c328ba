//! The same facts in other units of length. Nothing follows from that but other roundings: how far an
//! estimate moves tells how well it is determined by its facts in double precision.

use pleiad_estimation::Pose2;
use pleiad_estimation::fact::{Absolute, Boot, Noise, NominalState, Quantity};
use pleiad_estimation::fold::{Fact, FactKey, FoldConfig, Others, joint_among};
use pleiad_estimation::joint::Joint;
use pleiad_estimation::reference::{FactContent, Measurement, ReferenceFact};
use pleiad_estimation::sample::Relative;
use pleiad_estimation::symmetric::Symmetric3;

/// Lengths of the other units, in metres to one unit. Not powers of two, which would round alike.
pub const UNITS: [f64; 4] = [1.0 / 3.0, 0.7, 1.9, 11.0];

/// A length in metres in units of `1 / scale` metres.
pub fn pose(pose: &Pose2, scale: f64) -> Pose2 {
    Pose2::new(scale * pose.x_m(), scale * pose.y_m(), pose.yaw_rad())
}

/// A covariance whose components have the scales given, lower triangle by rows.
fn lower(of: [f64; 6], by: [f64; 3]) -> [f64; 6] {
    let [a, b, c] = by;
    let scales = [a * a, b * a, b * b, c * a, c * b, c * c];
    std::array::from_fn(|place| of[place] * scales[place])
}

fn symmetric(of: Symmetric3, scale: f64) -> Symmetric3 {
    Symmetric3(lower(of.0, [scale, scale, 1.0]))
}

fn state(of: NominalState, scale: f64) -> NominalState {
    NominalState::new(pose(&of.nominal, scale), symmetric(of.noise_sum, scale))
}

fn boot(of: &Boot, scale: f64) -> Boot {
    let continuation = of.continuation.map(|mut from| {
        from.last = state(from.last, scale);
        from.gap = symmetric(from.gap, scale);
        from
    });
    Boot { nominal: pose(&of.nominal, scale), continuation, ..*of }
}

/// What was seen, and the scales of its components.
fn relative(of: Relative, scale: f64) -> (Relative, [f64; 3]) {
    match of {
        Relative::Pose(seen) => (Relative::Pose(pose(&seen, scale)), [scale, scale, 1.0]),
        Relative::Position { x_m, y_m } => {
            (Relative::Position { x_m: scale * x_m, y_m: scale * y_m }, [scale, scale, 1.0])
        }
        Relative::Range { range_m } => (Relative::Range { range_m: scale * range_m }, [scale, 1.0, 1.0]),
        Relative::Bearing { .. } => (of, [1.0; 3]),
        Relative::RangeBearing { range_m, bearing_rad } => {
            (Relative::RangeBearing { range_m: scale * range_m, bearing_rad }, [scale, 1.0, 1.0])
        }
    }
}

fn measurement(of: &Measurement, scale: f64) -> Measurement {
    let (quantity, scales) = match of.quantity {
        Quantity::Robot { robot, relative: seen } => {
            let (relative, scales) = relative(seen, scale);
            (Quantity::Robot { robot, relative }, scales)
        }
        Quantity::Landmark { landmark, position_m, relative: seen } => {
            let (relative, scales) = relative(seen, scale);
            let position_m = position_m.map(|axis| scale * axis);
            (Quantity::Landmark { landmark, position_m, relative }, scales)
        }
        Quantity::Feature { landmark, relative: seen } => {
            let (relative, scales) = relative(seen, scale);
            (Quantity::Feature { landmark, relative }, scales)
        }
        Quantity::Absolute(Absolute::Pose(at)) => {
            (Quantity::Absolute(Absolute::Pose(pose(&at, scale))), [scale, scale, 1.0])
        }
        Quantity::Absolute(Absolute::Position(at)) => {
            let at = at.map(|axis| scale * axis);
            (Quantity::Absolute(Absolute::Position(at)), [scale, scale, 1.0])
        }
        Quantity::Absolute(Absolute::Heading(_)) => (of.quantity, [1.0; 3]),
    };
    let mut scaled = of.clone();
    scaled.quantity = quantity;
    scaled.noise = Noise { lower: lower(of.noise.lower, scales), ..of.noise };
    scaled.observer.nominal = state(of.observer.nominal, scale);
    if let Some(observed) = &mut scaled.observed {
        observed.nominal = state(observed.nominal, scale);
    }
    scaled
}

/// Facts in units of `1 / scale` metres.
pub fn in_units(facts: &[ReferenceFact], scale: f64) -> Vec<ReferenceFact> {
    let content = |content: &FactContent| match content {
        FactContent::Boot(begun) => FactContent::Boot(boot(begun, scale)),
        FactContent::Measurement(measured) => FactContent::Measurement(measurement(measured, scale)),
    };
    facts.iter().map(|fact| ReferenceFact { content: content(&fact.content), ..fact.clone() }).collect()
}

/// The facts folded as the ledger does it.
pub fn folded(facts: &[ReferenceFact], config: &FoldConfig, others: &Others<'_>) -> Joint {
    let mut sorted: Vec<&ReferenceFact> = facts.iter().collect();
    sorted.sort_by_key(|fact| fact.order());
    let facts = sorted.into_iter().map(|fact| match &fact.content {
        FactContent::Boot(boot) => (FactKey::boot(fact.time, fact.id), Fact::Boot(*boot)),
        FactContent::Measurement(measured) => {
            let other = measured.observed.map(|other| (other.boot, other.nominal));
            let (quantity, noise) = (measured.quantity, Some(measured.noise));
            let observer = measured.observer.nominal;
            let content = Fact::Observation { quantity, noise, observer, other };
            (FactKey::observation(fact.time, fact.id), content)
        }
    });
    joint_among(config, &facts.collect::<Vec<_>>(), others)
}
