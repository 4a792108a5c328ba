//! The correction as a model of the robot.

use pleiad_physics::{ActiveEffect, Effect, RobotModel, Scope};
use pleiad_recording::{DeclaredEffect, NominalRobot};

use super::factors::{WheelErrors, WheelFactors};

/// Entries of the catalogue that say `E_d`, `E_b` and `E_s`.
const WHEELS: [Effect; 3] = [Effect::UnequalWheelRadii, Effect::TrackWidthError, Effect::WheelRadiusError];

/// What a model says of its wheels already, everywhere and always.
pub fn believed(effects: &[DeclaredEffect]) -> WheelFactors {
    of(effects.iter().map(|declared| &declared.active))
}

fn of<'a>(effects: impl Iterator<Item = &'a ActiveEffect<f64>>) -> WheelFactors {
    let mut factors = WheelFactors::NONE;
    for active in effects.filter(|active| says_wheels(active)) {
        let value = active.values()[0];
        match active.effect() {
            Effect::UnequalWheelRadii => {
                factors.left *= 1.0 + 0.5 * value;
                factors.right *= 1.0 - 0.5 * value;
            }
            Effect::TrackWidthError => factors.track *= 1.0 + value,
            _ => {
                factors.left *= 1.0 + value;
                factors.right *= 1.0 + value;
            }
        }
    }
    factors
}

fn says_wheels(active: &ActiveEffect<f64>) -> bool {
    WHEELS.contains(&active.effect()) && active.scope == Scope::default()
}

/// The values of the effects by which these factors are said: `r_left = r (1 + ratio/2)` and so on.
fn values(factors: WheelFactors) -> [f64; 3] {
    let WheelErrors { e_d, e_b, e_s } = factors.errors();
    [2.0 * (1.0 - e_d) / (1.0 + e_d), e_b - 1.0, e_s - 1.0]
}

/// A model with these factors in place of those it has.
pub(super) fn with_factors(model: &RobotModel<f64>, factors: WheelFactors) -> RobotModel<f64> {
    let mut model = model.clone();
    model.effects.retain(|active| !says_wheels(active));
    for (effect, value) in WHEELS.into_iter().zip(values(factors)) {
        model.effects.extend(ActiveEffect::new(effect, &[value]));
    }
    model
}

/// The declared robot with these factors in place of those it has, as effects of the catalogue; `ci95` are intervals of
/// `E_d`, `E_b`, `E_s`, where they are known. A factor that changes nothing is left out.
pub fn corrected(
    robot: &NominalRobot,
    factors: WheelFactors,
    [e_d, e_b, e_s]: [Option<[f64; 2]>; 3],
) -> NominalRobot {
    let mut corrected = robot.clone();
    corrected.effects.retain(|declared| !says_wheels(&declared.active));
    // The ratio of the catalogue falls as E_d rises.
    let ratio = |e_d: f64| 2.0 * (1.0 - e_d) / (1.0 + e_d);
    let intervals = [
        e_d.map(|[low, high]| [ratio(high), ratio(low)]),
        e_b.map(|ends| ends.map(|end| end - 1.0)),
        e_s.map(|ends| ends.map(|end| end - 1.0)),
    ];
    for ((effect, value), ci95) in WHEELS.into_iter().zip(values(factors)).zip(intervals) {
        if value != 0.0
            && let Ok(active) = ActiveEffect::new(effect, &[value])
        {
            corrected.effects.push(DeclaredEffect { ci95: vec![ci95], ..DeclaredEffect::new(active) });
        }
    }
    corrected
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_of_the_wheels_is_what_is_read() {
        let factors = WheelErrors { e_d: 1.004, e_b: 0.97, e_s: 1.02 }.factors();
        let robot = NominalRobot { wheel_radius: 0.1, track_width: 0.3, ..NominalRobot::default() };
        let once = corrected(&robot, factors, [Some([1.003, 1.005]), None, None]);
        let read = believed(&once.effects);
        for (wanted, found) in
            [(factors.left, read.left), (factors.right, read.right), (factors.track, read.track)]
        {
            assert!((wanted - found).abs() < 1e-15, "{wanted} {found}");
        }
        // Left is the smaller wheel, so the ratio of the catalogue is negative, and its interval holds it.
        let ratio = once.effects[0].active.values()[0];
        let [low, high] = once.effects[0].ci95[0].unwrap();
        assert!(ratio < 0.0 && low < ratio && ratio < high);
        // A second correction takes the place of the first.
        assert_eq!(corrected(&once, factors, [None; 3]).effects.len(), 3);
        assert!(corrected(&once, WheelFactors::NONE, [None; 3]).effects.is_empty());
    }
}
