//! A square as a robot truly drives it that believes its nominal model, in closed form.

use std::f64::consts::FRAC_PI_2;

use pleiad_physics::Pose;

use super::factors::WheelErrors;
use super::run::Turning;

/// Where a robot ends, in the frame of its start, that drives sides of `side_m` ahead and turns by 90 degrees on the
/// spot after each, as its odometry has it. Sides and turns are arcs of the two wheels' paths.
pub fn square_end(errors: WheelErrors, nominal_track_m: f64, side_m: f64, turning: Turning) -> Pose<f64> {
    let mut pose = Pose::identity();
    for motion in motions(errors, nominal_track_m, side_m, turning) {
        pose = pose.compose(&arc(motion, 1.0));
    }
    pose
}

/// The path to [`square_end`]: positions in metres, `steps` to a motion.
pub fn square_path(
    errors: WheelErrors,
    nominal_track_m: f64,
    side_m: f64,
    turning: Turning,
    steps: u32,
) -> Vec<[f64; 2]> {
    let mut pose = Pose::identity();
    let mut path = vec![pose.position()];
    for motion in motions(errors, nominal_track_m, side_m, turning) {
        let from = pose;
        for step in 1..=steps {
            pose = from.compose(&arc(motion, f64::from(step) / f64::from(steps)));
            path.push(pose.position());
        }
    }
    path
}

/// The track, as actual over nominal, with which a robot of this ratio of diameters comes home on squares of one
/// direction: sides bend by as much as corners are turned short (to the left), or too far.
///
/// With `k = (E_d - 1) / (E_d + 1)` and nominal track `b`: `E_b = 1 +- 4 k L / (pi b)`.
pub fn masking_track(e_d: f64, nominal_track_m: f64, side_m: f64, turning: Turning) -> f64 {
    let unequal = (e_d - 1.0) / (e_d + 1.0);
    1.0 + turning.sign() * 2.0 * unequal * side_m / (nominal_track_m * FRAC_PI_2)
}

/// Four times a side and a turn, as `[forward m, yaw rad]` of the body.
fn motions(errors: WheelErrors, nominal_track_m: f64, side_m: f64, turning: Turning) -> Vec<[f64; 2]> {
    let factors = errors.factors();
    let moved = |left_m: f64, right_m: f64| {
        let (left_m, right_m) = (factors.left * left_m, factors.right * right_m);
        [f64::midpoint(left_m, right_m), (right_m - left_m) / (factors.track * nominal_track_m)]
    };
    let turn_m = turning.sign() * FRAC_PI_2 * 0.5 * nominal_track_m;
    let side_and_turn = [moved(side_m, side_m), moved(-turn_m, turn_m)];
    (0..4).flat_map(|_| side_and_turn).collect()
}

/// A share of a motion.
fn arc([forward_m, yaw_rad]: [f64; 2], share: f64) -> Pose<f64> {
    Pose::exp(forward_m * share, 0.0, yaw_rad * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MASKED: WheelErrors = WheelErrors { e_d: 1.004, e_b: 1.0339, e_s: 1.0 };

    /// The same square with points on circles, without the exponential map: centre of rotation, sine and cosine.
    fn by_circles(errors: WheelErrors, track_m: f64, side_m: f64, sense: f64) -> [f64; 2] {
        let (left, right) = (2.0 / (errors.e_d + 1.0), 2.0 * errors.e_d / (errors.e_d + 1.0));
        let actual_m = errors.e_b * track_m;
        let [mut x, mut y, mut yaw] = [0.0_f64; 3];
        let quarter_m = sense * 0.25 * std::f64::consts::PI * track_m;
        for (left_m, right_m) in [(side_m, side_m), (-quarter_m, quarter_m)].repeat(4) {
            let (left_m, right_m) = (left * left_m, right * right_m);
            let turned = (right_m - left_m) / actual_m;
            let radius_m = 0.5 * (left_m + right_m) / turned;
            x += radius_m * ((yaw + turned).sin() - yaw.sin());
            y -= radius_m * ((yaw + turned).cos() - yaw.cos());
            yaw += turned;
        }
        [x, y]
    }

    #[test]
    fn one_direction_masks_two_errors_and_the_other_shows_them() {
        // The published example: 0.3 mm one way, 1.22 m the other.
        let home = square_end(MASKED, 0.3, 4.0, Turning::CounterClockwise);
        let away = square_end(MASKED, 0.3, 4.0, Turning::Clockwise);
        assert!((home.x_m.hypot(home.y_m) - 0.0003).abs() < 0.000_05, "{home:?}");
        assert!((away.x_m.hypot(away.y_m) - 1.22).abs() < 0.005, "{away:?}");
        let track = masking_track(1.004, 0.3, 4.0, Turning::CounterClockwise);
        assert!((track - 1.0339).abs() < 5e-5, "{track}");
    }

    #[test]
    fn arcs_agree_with_points_on_circles() {
        for (turning, sense) in [(Turning::CounterClockwise, 1.0), (Turning::Clockwise, -1.0)] {
            let end = square_end(MASKED, 0.3, 4.0, turning);
            let [x, y] = by_circles(MASKED, 0.3, 4.0, sense);
            assert!((end.x_m - x).abs() < 1e-9 && (end.y_m - y).abs() < 1e-9, "{end:?} {x} {y}");
            let path = square_path(MASKED, 0.3, 4.0, turning, 7);
            let last = path[path.len() - 1];
            assert!(path.len() == 57 && (last[0] - x).abs() < 1e-9 && (last[1] - y).abs() < 1e-9);
        }
    }

    #[test]
    fn a_square_does_not_show_the_scale() {
        let errors = WheelErrors { e_d: 1.0, e_b: 1.03, e_s: 1.03 };
        let end = square_end(errors, 0.3, 4.0, Turning::CounterClockwise);
        assert!(end.x_m.hypot(end.y_m) < 1e-12, "{end:?}");
    }
}
