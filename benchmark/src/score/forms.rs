//! The forms that are right where an effect is left out of the catalogue: what its equation adds to which quantity,
//! as far as a product of what the robot does can say it. From the equations of the catalogue (`docs/effects.md`).

use pleiad_physics::Effect;

/// The forms of an effect, each with its unit, as findings say them; empty if no product is its equation.
pub fn right(effect: Effect) -> &'static [&'static str] {
    match effect {
        Effect::UnequalWheelRadii | Effect::SteerTrim => &["yaw rate += c v [rad/m]"],
        Effect::TrackWidthError => &["yaw rate += c w [1]"],
        Effect::WheelRadiusError => &["forward velocity += c v [1]", "yaw rate += c w [1]"],
        Effect::PayloadOffset => &["yaw rate += c v [rad/m]", "yaw rate += c w [1]"],
        Effect::LongitudinalSlip => &["forward velocity += c a [s]"],
        Effect::LateralSkid => &["left velocity += c v w [s]"],
        Effect::LowFrictionOverall => &["forward velocity += c a [s]", "left velocity += c v w [s]"],
        Effect::IcrOffset => &["left velocity += c w [m]"],
        Effect::Crab => &["left velocity += c v [1]"],
        Effect::SpeedDependentScale => &["forward velocity += c v |v| [s/m]"],
        Effect::TurnLoss => &["forward velocity += c v |w| [s]"],
        Effect::QuadraticDrag => &["driven speed += c v |v| [s/m]"],
        Effect::ActuatorGain => &["driven speed += c v [1]", "driven yaw rate += c w [1]"],
        Effect::ActuatorLag => &["driven speed += c a [s]", "driven yaw rate += c dw/dt [s]"],
        Effect::FloorTilt | Effect::WorldForce => {
            &["driven speed += c cos(heading) [m/s]", "driven speed += c sin(heading) [m/s]"]
        }
        Effect::WorldDrift => &[
            "forward velocity += c cos(heading) [m/s]",
            "forward velocity += c sin(heading) [m/s]",
            "left velocity += c cos(heading) [m/s]",
            "left velocity += c sin(heading) [m/s]",
        ],
        Effect::WheelEccentricity => &[
            "yaw rate += c v cos(left wheel) [rad/m]",
            "yaw rate += c v sin(left wheel) [rad/m]",
            "yaw rate += c v cos(right wheel) [rad/m]",
            "yaw rate += c v sin(right wheel) [rad/m]",
            "forward velocity += c v cos(left wheel) [1]",
            "forward velocity += c v sin(left wheel) [1]",
            "forward velocity += c v cos(right wheel) [1]",
            "forward velocity += c v sin(right wheel) [1]",
        ],
        Effect::Understeer => &["yaw rate += c v^2 w [s^2/m^2]"],
        Effect::GyroBias => &["gyro reading += c [rad/s]"],
        Effect::GyroScale => &["gyro reading += c w [1]"],
        Effect::CompassHardIron => {
            &["heading reading += c cos(heading) [rad]", "heading reading += c sin(heading) [rad]"]
        }
        Effect::CompassSoftIron => {
            &["heading reading += c cos(2 heading) [rad]", "heading reading += c sin(2 heading) [rad]"]
        }
        Effect::SunSensorMisalignment | Effect::HeadingOffset => &["heading reading += c [rad]"],
        Effect::GpsLeverArm => &["GPS position forward += c [m]", "GPS position left += c [m]"],
        Effect::GpsLatency => &["GPS position forward += c v [s]"],
        Effect::SensorYawMisalignment => &["bearing reading += c [rad]"],
        Effect::RangeBias => &["range reading += c [m]"],
        Effect::RangeScale => &["range reading += c r [1]"],
        Effect::BearingDependentRangeBias => &["range reading += c b^2 [m]"],
        Effect::BearingDistortion => &["bearing reading += c b [1]", "bearing reading += c b^3 [1]"],
        Effect::CameraLatency => &[
            "bearing reading += c w [s]",
            "bearing reading += c v sin(b) 1/r [rad s]",
            "range reading += c v cos(b) [s]",
        ],
        Effect::TruthMarkerOffset => {
            &["forward velocity += c w [m]", "left velocity += c w [m]", "left velocity += c v [1]"]
        }
        _ => &[],
    }
}

/// Whether what was said without a name, as [`told`](super::told) says it, is the right form and nothing else.
pub fn is_right(effect: Effect, said: &[String]) -> bool {
    let right = right(effect);
    let form = |said: &String| {
        let (expression, _) = said.strip_prefix("form ")?.rsplit_once(" on [")?;
        right.iter().find(|own| **own == expression)
    };
    !said.is_empty() && said.iter().all(|said| form(said).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_form_is_right_with_its_quantity_and_its_unit_and_nothing_beside_it() {
        let said = |all: &[&str]| all.iter().map(|own| (*own).to_owned()).collect::<Vec<_>>();
        let drag = |all: &[&str]| is_right(Effect::QuadraticDrag, &said(all));
        assert!(drag(&["form driven speed += c v |v| [s/m] on [1]"]));
        assert!(!drag(&["form driven speed += c v |v| [1] on [1]"]));
        assert!(!drag(&["form forward velocity += c v |v| [s/m] on [1]"]));
        assert!(!drag(&["unnameable driven speed += c v |v| [s/m] on [1]"]));
        assert!(!drag(&["form driven speed += c v |v| [s/m] on [1]", "form yaw rate += c w [1] on [2]"]));
        assert!(!drag(&[]));
        assert!(!is_right(Effect::Push, &said(&["form yaw rate += c w [1] on [2]"])));
    }
}
