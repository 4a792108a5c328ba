//! Where the search for the place of a frame begins.

use super::Problem;
use crate::Pose2;
use crate::geometry::Vector2;
use crate::joint::{Measured, Tie};
use crate::sample::Relative;

const HEADINGS: u32 = 12;
const DIRECTIONS: u32 = 12;
const DISTANCES_M: [f64; 5] = [0.7, 1.5, 3.0, 6.0, 12.0];

impl Problem<'_> {
    /// Where to begin: at what a full pose says, else with every heading, and the place that one tie gives then.
    pub(super) fn starts(&self) -> Vec<Pose2> {
        let mut starts = Vec::new();
        for (_, tie) in &self.ties {
            if let (Measured::Relative(Relative::Pose(seen)), Some([from, to])) =
                (&tie.measured, self.poses(tie, &Pose2::identity()))
            {
                starts.push(if self.moved_end(tie) == 1 {
                    from.compose(seen).compose(&to.inverse())
                } else {
                    to.compose(&seen.inverse()).compose(&from.inverse())
                });
            }
        }
        if !starts.is_empty() {
            return starts;
        }
        let Some((tie, points)) = self.seed() else { return starts };
        let Some([from, to]) = self.poses(tie, &Pose2::identity()) else { return starts };
        for heading in 0..HEADINGS {
            let yaw = std::f64::consts::TAU * f64::from(heading) / f64::from(HEADINGS);
            let turn = Pose2::new(0.0, 0.0, yaw);
            for point in &points {
                let seen = from.act(*point);
                let place = if self.moved_end(tie) == 1 {
                    seen - turn.rotate(to.position())
                } else {
                    to.position() - turn.rotate(seen)
                };
                starts.push(Pose2::new(place.x, place.y, yaw));
            }
        }
        starts
    }

    /// The tie that says most about a place, and where it may have seen what it saw, in the frame it sees from.
    fn seed(&self) -> Option<(&Tie, Vec<Vector2>)> {
        let polar =
            |range: f64, bearing: f64| Vector2::new(range * libm::cos(bearing), range * libm::sin(bearing));
        let points = |tie: &Tie| match &tie.measured {
            Measured::Relative(Relative::Position { x_m, y_m }) => vec![Vector2::new(*x_m, *y_m)],
            Measured::Relative(Relative::RangeBearing { range_m, bearing_rad }) => {
                vec![polar(*range_m, *bearing_rad)]
            }
            Measured::Relative(Relative::Range { range_m }) => {
                let turn = std::f64::consts::TAU / f64::from(DIRECTIONS);
                (0..DIRECTIONS).map(|direction| polar(*range_m, turn * f64::from(direction))).collect()
            }
            Measured::Relative(Relative::Bearing { bearing_rad }) => {
                DISTANCES_M.iter().map(|range| polar(*range, *bearing_rad)).collect()
            }
            Measured::Relative(Relative::Pose(_)) | Measured::Heading(_) => Vec::new(),
        };
        let seeds = self.ties.iter().map(|(_, tie)| (*tie, points(tie)));
        seeds.filter(|(_, points)| !points.is_empty()).min_by_key(|(_, points)| points.len())
    }
}
