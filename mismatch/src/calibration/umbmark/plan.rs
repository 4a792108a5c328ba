//! What is driven: commands to a robot that drives by its own odometry, with what is known of its wheels so far.

use std::f64::consts::FRAC_PI_2;

use super::factors::WheelFactors;
use super::run::Turning;

/// How fast, and how commands are given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Along a side, m/s. Slow, so that little of the error is slip.
    pub speed_m_s: f64,
    /// In a turn on the spot, rad/s.
    pub yaw_rate_rad_s: f64,
    /// Standing between motions, seconds: long enough for a servo to come to rest.
    pub pause_s: f64,
    /// Commands are given so far apart, seconds: every motion lasts a whole number of them.
    pub period_s: f64,
    /// Distance between the wheels as the firmware believes, metres.
    pub track_m: f64,
}

impl Pace {
    /// A motion at a constant speed, and the pause after it: `[forward m/s, yaw rate rad/s, seconds]`.
    fn motion(&self, known: WheelFactors, [forward_m, yaw_rad]: [f64; 2]) -> [[f64; 3]; 2] {
        let least_s = (forward_m.abs() / self.speed_m_s).max(yaw_rad.abs() / self.yaw_rate_rad_s);
        let lasts_s = self.whole(least_s);
        let [forward_m, yaw_rad] = commanded(known, self.track_m, [forward_m, yaw_rad]);
        [[forward_m / lasts_s, yaw_rad / lasts_s, lasts_s], [0.0, 0.0, self.whole(self.pause_s)]]
    }

    /// The next longer time of whole periods.
    fn whole(&self, lasts_s: f64) -> f64 {
        (lasts_s / self.period_s - 1e-9).ceil() * self.period_s
    }
}

/// A square from the middle of the axle ahead, with a turn on the spot after every side, the last one too.
pub fn square_commands(pace: &Pace, known: WheelFactors, side_m: f64, turning: Turning) -> Vec<[f64; 3]> {
    let side = pace.motion(known, [side_m, 0.0]);
    let corner = pace.motion(known, [0.0, turning.sign() * FRAC_PI_2]);
    (0..4).flat_map(|_| [side, corner]).flatten().collect()
}

/// A straight line ahead.
pub fn straight_commands(pace: &Pace, known: WheelFactors, length_m: f64) -> Vec<[f64; 3]> {
    pace.motion(known, [length_m, 0.0]).to_vec()
}

/// A turn on the spot.
pub fn turn_commands(pace: &Pace, known: WheelFactors, angle_rad: f64) -> Vec<[f64; 3]> {
    pace.motion(known, [0.0, angle_rad]).to_vec()
}

/// What the firmware, which believes in the nominal geometry, has to be told for the body to move so.
fn commanded(known: WheelFactors, track_m: f64, [forward_m, yaw_rad]: [f64; 2]) -> [f64; 2] {
    let turn_m = 0.5 * yaw_rad * known.track * track_m;
    let (left_m, right_m) = ((forward_m - turn_m) / known.left, (forward_m + turn_m) / known.right);
    [f64::midpoint(left_m, right_m), (right_m - left_m) / track_m]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::umbmark::WheelErrors;

    const PACE: Pace =
        Pace { speed_m_s: 0.4, yaw_rate_rad_s: 0.5, pause_s: 1.0, period_s: 0.04, track_m: 0.34 };

    #[test]
    fn a_square_of_a_nominal_robot_is_four_sides_and_four_quarter_turns() {
        let rows = square_commands(&PACE, WheelFactors::NONE, 4.0, Turning::Clockwise);
        assert_eq!(rows.len(), 16);
        let driven: f64 = rows.iter().map(|row| row[0] * row[2]).sum();
        let turned: f64 = rows.iter().map(|row| row[1] * row[2]).sum();
        assert!((driven - 16.0).abs() < 1e-12 && (turned + 4.0 * FRAC_PI_2).abs() < 1e-12);
        for [speed, rate, lasts] in rows {
            assert!(speed <= 0.4 + 1e-12 && rate.abs() <= 0.5 + 1e-12);
            assert!(((lasts / 0.04).round() - lasts / 0.04).abs() < 1e-9, "{lasts}");
        }
    }

    #[test]
    fn a_robot_whose_wheels_are_known_moves_as_was_planned() {
        // Forward kinematics of the actual wheels, from the commands.
        let known = WheelErrors { e_d: 1.01, e_b: 1.05, e_s: 0.98 }.factors();
        for wanted in [[4.0, 0.0], [0.0, FRAC_PI_2], [1.0, -0.3]] {
            let [forward, yaw] = commanded(known, 0.34, wanted);
            let left = known.left * (forward - 0.5 * 0.34 * yaw);
            let right = known.right * (forward + 0.5 * 0.34 * yaw);
            assert!((0.5 * (left + right) - wanted[0]).abs() < 1e-12);
            assert!(((right - left) / (known.track * 0.34) - wanted[1]).abs() < 1e-12);
        }
    }
}
