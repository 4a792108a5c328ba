//! Range scans: beams from the robot's true pose to the walls.

use std::f64::consts::PI;

use pleiad_recording::BeamSample;

use super::OBSERVATIONS_FROM_S;
use super::random::{Channel, normal};
use super::sensors::Channels;
use crate::scenario::RangeScan;

/// A beam does not meet what is nearer than this, metres.
const NEAREST_M: f64 = 1e-3;

/// Every scan, beam after beam. Noise is drawn for every beam, so that a wall changes nothing but what it hides.
pub(super) fn scans(channels: &Channels<'_>, walls: &[[f64; 4]]) -> Vec<BeamSample> {
    let scan = channels.settings.scan;
    let mut stream = channels.seed.stream(channels.robot, Channel::Scan);
    let bearings = bearings(&scan);
    let mut beams = Vec::new();
    for time in channels.instants(Channel::Scan, scan.rate_hz, OBSERVATIONS_FROM_S) {
        let pose = channels.track().pose_at(time);
        for &bearing_rad in &bearings {
            let noise_m = scan.sigma_m * normal(&mut stream);
            let from = [pose.x_m(), pose.y_m()];
            let Some(range_m) = distance(from, pose.yaw_rad() + bearing_rad, walls) else { continue };
            if range_m <= scan.max_range_m && range_m + noise_m > NEAREST_M {
                beams.push(BeamSample {
                    time: channels.stamp(time),
                    bearing_rad,
                    range_m: range_m + noise_m,
                });
            }
        }
    }
    beams
}

/// Directions of the beams: over a full turn the first is not repeated by the last.
fn bearings(scan: &RangeScan) -> Vec<f64> {
    let full_turn = scan.half_fov_rad > PI - 1e-3;
    let gaps = if full_turn { scan.beams } else { scan.beams.saturating_sub(1).max(1) };
    let step = 2.0 * scan.half_fov_rad.min(PI) / f64::from(gaps);
    (0..scan.beams).map(|beam| f64::from(beam) * step - scan.half_fov_rad.min(PI)).collect()
}

/// How far the nearest wall is in this direction, metres.
fn distance([x, y]: [f64; 2], direction_rad: f64, walls: &[[f64; 4]]) -> Option<f64> {
    let (sine, cosine) = direction_rad.sin_cos();
    let mut nearest: Option<f64> = None;
    for &[x0, y0, x1, y1] in walls {
        let (along_x, along_y) = (x1 - x0, y1 - y0);
        let across = cosine * along_y - sine * along_x;
        if across == 0.0 {
            continue;
        }
        let range_m = ((x0 - x) * along_y - (y0 - y) * along_x) / across;
        let share = ((x0 - x) * sine - (y0 - y) * cosine) / across;
        if range_m > NEAREST_M && (0.0..=1.0).contains(&share) {
            nearest = Some(nearest.map_or(range_m, |nearest| nearest.min(range_m)));
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A room of 4 m by 2 m about the origin.
    const ROOM: [[f64; 4]; 4] =
        [[-2.0, -1.0, 2.0, -1.0], [2.0, -1.0, 2.0, 1.0], [2.0, 1.0, -2.0, 1.0], [-2.0, 1.0, -2.0, -1.0]];

    #[test]
    fn a_beam_meets_the_wall_of_a_room_where_trigonometry_has_it() {
        for step in -20..20 {
            let direction = 0.157 * f64::from(step) + 0.01;
            // From (0.5, 0.25): the nearer of the wall ahead along x and the one along y.
            let (sine, cosine) = direction.sin_cos();
            let to_x = (2.0 * cosine.signum() - 0.5) / cosine;
            let to_y = (sine.signum() - 0.25) / sine;
            let found = distance([0.5, 0.25], direction, &ROOM).unwrap();
            assert!((found - to_x.min(to_y)).abs() < 1e-12, "{direction}: {found}");
        }
    }

    #[test]
    fn a_beam_that_points_away_meets_nothing() {
        assert_eq!(distance([0.0, 0.0], 0.0, &[[-1.0, -1.0, -1.0, 1.0]]), None);
        assert_eq!(distance([0.0, 0.0], 0.0, &[[1.0, 0.5, 1.0, 2.0]]), None);
    }

    #[test]
    fn beams_are_even_and_a_full_turn_has_none_twice() {
        let ring = bearings(&RangeScan { beams: 8, ..RangeScan::default() });
        assert!((ring[1] - ring[0] - PI / 4.0).abs() < 1e-12 && (ring[7] - 0.75 * PI).abs() < 1e-12);
        let fan = bearings(&RangeScan { beams: 5, half_fov_rad: 1.0, ..RangeScan::default() });
        assert!((fan[0] + 1.0).abs() < 1e-12 && (fan[4] - 1.0).abs() < 1e-12);
    }
}
