//! Readings of sensors as the nominal sensor would have given them.

use super::solve::solve;
use super::{Correction, Place};
use crate::chain::sensors::{self, Seen};
use crate::model::RobotModel;
use crate::pose::Pose;
use crate::scalar::Scalar;
use crate::signal::Target;

/// How far a target is taken to be whose bearing alone is known, metres: so far that a lever arm of the
/// sensor does not matter.
const FAR_M: f64 = 1e3;

/// Range and bearing, metres and radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polar {
    /// Metres.
    pub range_m: f64,
    /// Radians, left positive.
    pub bearing_rad: f64,
}

impl Polar {
    /// Of a point of the body frame.
    pub fn of([x, y]: [f64; 2]) -> Self {
        Self { range_m: x.hypot(y), bearing_rad: Scalar::atan2(y, x) }
    }

    /// The point of the body frame.
    pub fn point(self) -> [f64; 2] {
        [self.range_m * Scalar::cos(self.bearing_rad), self.range_m * Scalar::sin(self.bearing_rad)]
    }
}

impl Correction {
    /// How old a position is at its stamp, seconds: to be subtracted from the stamp.
    pub fn gps_latency_s(&self, place: &Place) -> f64 {
        sensors::gps_reading(&self.model, &place.context(&self.model)).latency_s
    }

    /// How old range and bearing are at their stamp, seconds: to be subtracted from the stamp.
    pub fn sighting_latency_s(&self, place: &Place, target: Target) -> f64 {
        sensors::sighting_geometry(&self.model, &place.context(&self.model), target, [0.0; 2]).latency_s
    }

    /// A position, metres in the map. The place is that of the instant the position is of.
    pub fn gps(&self, place: &Place, position_m: [f64; 2]) -> [f64; 2] {
        let expected = sensors::gps(&self.model, &place.context(&self.model));
        let believed = sensors::gps(&self.nominal, &place.context(&self.nominal));
        [0, 1].map(|axis| position_m[axis] - (expected[axis] - believed[axis]))
    }

    /// A heading, radians, not wrapped.
    pub fn heading(&self, place: &Place, heading_rad: f64) -> f64 {
        let at = |yaw_rad: f64| Place { pose: Pose { yaw_rad, ..place.pose }, ..*place };
        let missing = |[yaw_rad, _]: [f64; 2]| {
            let expected = sensors::heading(&self.model, &at(yaw_rad).context(&self.model));
            [Scalar::wrapped(heading_rad - expected), 0.0]
        };
        let [true_rad, _] = solve([heading_rad, 0.0], missing);
        sensors::heading(&self.nominal, &at(true_rad).context(&self.nominal))
    }

    /// A yaw rate from a gyro, rad/s.
    pub fn gyro(&self, place: &Place, rate_rad_s: f64) -> f64 {
        let read = |model: &RobotModel<f64>, rate: f64| {
            let mut context = place.context(model);
            context.motion.yaw_rate_rad_s = rate;
            sensors::gyro(model, &context, &mut 0.0)
        };
        // A gyro is linear in the yaw rate, so that two points of the line give its inverse.
        let (at_rest, at_one) = (read(&self.model, 0.0), read(&self.model, 1.0));
        let turning = (rate_rad_s - at_rest) / (at_one - at_rest);
        read(&self.nominal, turning)
    }

    /// The name that a sighting should bear. Undoes what is known for certain, such as two landmarks that
    /// are swapped.
    pub fn target(&self, place: &Place, named: Target) -> Target {
        sensors::identity(&self.model, &place.context(&self.model), named, &[])
    }

    /// Range and bearing of a target.
    pub fn sighting(&self, place: &Place, target: Target, read: Polar) -> Polar {
        self.solved(&self.model, place, target, read, [true, true])
    }

    /// A range without a bearing. `known_m`, where the target is in the map, tells the direction; without
    /// it the mount of the sensor is left as it is.
    pub fn range(&self, place: &Place, target: Target, known_m: Option<[f64; 2]>, range_m: f64) -> f64 {
        let (model, bearing_rad) = match known_m {
            Some(point) => (&self.model, Polar::of(place.pose.point_seen(point)).bearing_rad),
            None => (&self.unmounted, 0.0),
        };
        self.solved(model, place, target, Polar { range_m, bearing_rad }, [true, false]).range_m
    }

    /// A bearing without a range. `known_m`, where the target is in the map, tells the distance; without it
    /// the target is taken to be far away.
    pub fn bearing(&self, place: &Place, target: Target, known_m: Option<[f64; 2]>, bearing_rad: f64) -> f64 {
        let range_m = known_m.map_or(FAR_M, |point| Polar::of(place.pose.point_seen(point)).range_m);
        self.solved(&self.model, place, target, Polar { range_m, bearing_rad }, [false, true]).bearing_rad
    }

    /// The relative yaw of a robot whose pose was seen, radians.
    pub fn relative_yaw(&self, place: &Place, target: Target, yaw_rad: f64) -> f64 {
        let of = |model: &RobotModel<f64>| {
            sensors::sighting_geometry(model, &place.context(model), target, [0.0; 2]).yaw_rad
        };
        yaw_rad + of(&self.model) - of(&self.nominal)
    }

    /// Finds the point, seen from the body, of which the model reads what was read, and reads it with the
    /// nominal sensor. A component that was not read is given in `read` as that of the point.
    fn solved(
        &self,
        model: &RobotModel<f64>,
        place: &Place,
        target: Target,
        read: Polar,
        [ranged, aimed]: [bool; 2],
    ) -> Polar {
        let missing = |[range_m, bearing_rad]: [f64; 2]| {
            let expected = seen(model, place, target, Polar { range_m, bearing_rad });
            let range_m = if ranged { read.range_m - expected.range_m } else { 0.0 };
            let bearing_rad = if aimed { read.bearing_rad - expected.bearing_rad } else { 0.0 };
            [range_m, Scalar::wrapped(bearing_rad)]
        };
        let [range_m, bearing_rad] = solve([read.range_m, read.bearing_rad], missing);
        // Behind the sensor there is no target: its bearing would be another.
        let range_m = if range_m > 0.0 { range_m } else { f64::NAN };
        let point = Polar { range_m, bearing_rad };
        let mut as_nominal = seen(&self.nominal, place, target, point);
        as_nominal.bearing_rad = Scalar::wrapped(as_nominal.bearing_rad);
        as_nominal
    }
}

/// What a model reads of a point of the body frame, which is at rest.
fn seen(model: &RobotModel<f64>, place: &Place, target: Target, point: Polar) -> Polar {
    let [x, y] = point.point();
    let in_map = place.pose.compose(&Pose::new(x, y, 0.0));
    let target = Seen { target, position_m: in_map.position(), velocity_m_s: [0.0; 2] };
    let sighting = sensors::sighting(model, &place.context(model), &target);
    Polar { range_m: sighting.range_m, bearing_rad: sighting.bearing_rad }
}
