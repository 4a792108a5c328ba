//! Landmarks of which only bearings are known: they wait until their bearings cross well (`bailey2003`).

use super::initialize::{Initialized, Sight, from_bearings, parallax_rad};
use super::state::{Block, SlamState};
use crate::fact::Noise;
use crate::geometry::{Vector2, wrap_angle};
use crate::sample::Relative;
use crate::{LandmarkId, Pose2, Timestamp};

/// When a landmark of which only bearings are known enters the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DelayedRules {
    /// Bearings are kept at poses so far apart, metres.
    pub baseline_m: f64,
    /// At most so many past poses are in the state; the oldest go first.
    pub most_poses: usize,
    /// Two bearings have to cross under this angle at least, radians.
    pub parallax_rad: f64,
    /// The landmark's standard deviation as seen from the vehicle, over its distance, has to be below this: what
    /// range and bearing are linear enough for.
    pub relative_sigma: f64,
    /// Landmarks are looked for between these distances, metres, where bearings carry no name.
    pub distance_m: [f64; 2],
}

impl Default for DelayedRules {
    fn default() -> Self {
        Self {
            baseline_m: 0.5,
            most_poses: 24,
            parallax_rad: 0.25,
            relative_sigma: 0.1,
            distance_m: [0.5, 50.0],
        }
    }
}

/// A bearing and the past pose it was taken from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeptBearing {
    /// The pose, in the state.
    pub pose: Block,
    /// Bearing, radians.
    pub bearing_rad: f64,
}

/// The bearings of one landmark that is not in the state yet.
#[derive(Clone, Debug, PartialEq)]
pub struct BearingTrack {
    /// Its name, where sightings carry one.
    pub name: Option<LandmarkId>,
    /// Bearings from past poses, in the order in which they were taken.
    pub kept: Vec<KeptBearing>,
    /// When it was seen last.
    pub last_seen: Timestamp,
    /// From where, and under which bearing.
    pub last: (Pose2, f64),
}

impl BearingTrack {
    /// How far, in radians, a bearing lies outside the bearings that the landmark can have from `observer`, given that
    /// it was last seen as it was and lies within the distances of the rules; negative inside.
    pub fn misfit_rad(&self, observer: &Pose2, bearing_rad: f64, rules: &DelayedRules) -> f64 {
        let (sin, cos) = libm::sincos(self.last.1);
        let seen_from = |distance_m: f64| {
            let point = self.last.0.act(Vector2::new(distance_m * cos, distance_m * sin));
            let offset = observer.rotate_back(point - observer.position());
            libm::atan2(offset.y, offset.x)
        };
        let [near, far] = rules.distance_m.map(seen_from);
        let half = 0.5 * wrap_angle(near - far);
        wrap_angle(bearing_rad - wrap_angle(far + half)).abs() - half.abs()
    }

    /// The landmark, and which of the kept bearings it comes from, if one of them crosses the present bearing well
    /// enough.
    pub fn cross(
        &self,
        state: &SlamState,
        bearing_rad: f64,
        noise: &Noise,
        rules: &DelayedRules,
    ) -> Option<(usize, Initialized)> {
        let sight = |observer: Pose2, bearing_rad: f64| Sight {
            observer,
            relative: Relative::Bearing { bearing_rad },
            noise: *noise,
        };
        let now = sight(state.vehicle(), bearing_rad);
        let past = |kept: &KeptBearing| sight(state.place(kept.pose), kept.bearing_rad);
        let parallax = |kept: &KeptBearing| parallax_rad([&past(kept), &now]).unwrap_or(0.0);
        // Nearest to a right angle.
        let quality = |kept: &KeptBearing| libm::sin(parallax(kept));
        let best = (0..self.kept.len())
            .max_by(|a, b| quality(&self.kept[*a]).total_cmp(&quality(&self.kept[*b])))?;
        let kept = &self.kept[best];
        if quality(kept) < libm::sin(rules.parallax_rad) {
            return None;
        }
        let landmark = from_bearings([&past(kept), &now]).ok()?;
        let distance_m = (landmark.point - state.vehicle().position()).norm();
        let sigma_m = seen_from_vehicle(state, kept.pose, &landmark).symmetric_eigenvalues().max().sqrt();
        (sigma_m <= rules.relative_sigma * distance_m).then_some((best, landmark))
    }
}

/// Covariance of the landmark as the vehicle sees it: `T_1 Cov(xi_1 - xi_v) T_1^T + Cov(n)`, since
/// `T_1 + T_2 = [I, J p]`. An error that both poses share does not count.
fn seen_from_vehicle(state: &SlamState, past: Block, landmark: &Initialized) -> super::initialize::Matrix2 {
    let vehicle = SlamState::VEHICLE;
    let to_invariant = |block: Block| match state.form() {
        crate::joint::ErrorForm::Invariant => crate::geometry::Matrix3::identity(),
        crate::joint::ErrorForm::Additive => state.place(block).invariant_from_additive(),
    };
    let (a, b) = (to_invariant(past), to_invariant(vehicle));
    let cross = a * state.error_covariance(past, vehicle) * b.transpose();
    let difference = a * state.error_covariance(past, past) * a.transpose()
        + b * state.error_covariance(vehicle, vehicle) * b.transpose()
        - cross
        - cross.transpose();
    let t = &landmark.d_point_d_observer[0];
    t * difference * t.transpose() + landmark.covariance
}
