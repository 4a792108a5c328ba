//! The path by the wheels, and what to drive in its place.

use pleiad_physics::RobotModel;

use crate::track::Track;

/// Standing turns: slower than this forward, faster than this about, m/s and rad/s.
const STANDING: (f64, f64) = (0.05, 0.1);

/// Time, distance and turn of each step of the wheels under the declared geometry.
pub(super) fn steps(track: &Track, model: &RobotModel<f64>) -> Vec<[f64; 3]> {
    let (radius_m, width_m) = (model.nominal.wheel_radius, model.nominal.track_width);
    let step = |pair: &[pleiad_physics::predict::EncoderSample]| {
        let [left, right] =
            [0, 1].map(|wheel| radius_m * (pair[1].angle_rad[wheel] - pair[0].angle_rad[wheel]));
        [pair[1].time_s, f64::midpoint(left, right), (right - left) / width_m.max(f64::MIN_POSITIVE)]
    };
    track.encoders.windows(2).map(step).collect()
}

/// Root mean square distance from the places on the way to its end, metres.
pub(super) fn reach_m(steps: &[[f64; 3]], from_s: f64, to_s: f64) -> f64 {
    let (mut x, mut y, mut yaw) = (0.0, 0.0, 0.0_f64);
    let mut places = Vec::new();
    for [time_s, forward, turn] in steps {
        if (from_s..=to_s).contains(time_s) {
            let heading = yaw + 0.5 * turn;
            x += forward * heading.cos();
            y += forward * heading.sin();
            yaw += turn;
            places.push([x, y]);
        }
    }
    let square = places.iter().map(|own| (own[0] - x).powi(2) + (own[1] - y).powi(2)).sum::<f64>();
    (square / places.len().max(1) as f64).sqrt()
}

/// What to drive, in words: the path the other way round if that shows what is hidden.
pub(super) fn advice(steps: &[[f64; 3]], suffices: bool) -> String {
    let turned: f64 = steps.iter().map(|step| step[2]).sum();
    let way = if turned > 0.0 { "clockwise" } else { "counter-clockwise" };
    let path = if is_square(steps) { "square" } else { "same path" };
    if suffices && turned.abs() > std::f64::consts::PI {
        format!(
            "drive the {path} {way}, from reference pose to reference pose as before, and diagnose both together"
        )
    } else {
        format!(
            "drive the {path} {way}, and a straight line and a turn on the spot each between two reference poses; or \
             record the truth all along"
        )
    }
}

/// Straight legs of one length, and turns on the spot of a quarter each.
fn is_square(steps: &[[f64; 3]]) -> bool {
    let (mut legs, mut turns) = (Vec::new(), Vec::new());
    let (mut leg, mut turn) = (0.0_f64, 0.0_f64);
    // The first step is as long as the second.
    let first = steps.first().zip(steps.get(1)).map(|(first, second)| second[0] - first[0]);
    let lengths_s = first.into_iter().chain(steps.windows(2).map(|pair| pair[1][0] - pair[0][0]));
    for (&[_, forward, turned], length_s) in steps.iter().zip(lengths_s) {
        let length_s = length_s.max(f64::MIN_POSITIVE);
        let turning = (forward / length_s).abs() < STANDING.0 && (turned / length_s).abs() > STANDING.1;
        if turning {
            if leg > STANDING.0 {
                legs.push(leg);
            }
            leg = 0.0;
            turn += turned;
        } else {
            if turn.abs() > STANDING.1 {
                turns.push(turn.abs());
            }
            turn = 0.0;
            leg += forward;
        }
    }
    let near = |own: f64, wanted: f64| (own - wanted).abs() < 0.1 * wanted;
    let quarter = std::f64::consts::FRAC_PI_2;
    legs.len() >= 3
        && turns.len() >= 3
        && turns.iter().all(|own| near(*own, quarter))
        && legs.iter().all(|own| near(*own, legs[0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten steps a leg, five a quarter turn.
    fn square(way: f64, quarter: f64) -> Vec<[f64; 3]> {
        let mut steps = Vec::new();
        for _ in 0..4 {
            steps.extend([[0.0, 0.4, 0.0]; 10]);
            steps.extend([[0.0, 0.0, way * quarter / 5.0]; 5]);
        }
        for (index, step) in steps.iter_mut().enumerate() {
            step[0] = index as f64;
        }
        steps
    }

    const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_square_is_to_be_driven_the_other_way_round() {
        assert!(advice(&square(1.0, QUARTER), true).starts_with("drive the square clockwise,"));
        assert!(advice(&square(-1.0, QUARTER), true).starts_with("drive the square counter-clockwise,"));
        assert!(advice(&square(1.0, 0.7 * QUARTER), true).starts_with("drive the same path clockwise,"));
        assert!(advice(&square(1.0, QUARTER), false).contains("a straight line"));
    }

    #[test]
    fn the_reach_of_a_straight_line_is_its_length_over_the_root_of_three() {
        let steps: Vec<[f64; 3]> = (1..=1000).map(|index| [f64::from(index) * 0.001, 0.001, 0.0]).collect();
        assert!((reach_m(&steps, 0.0, 2.0) - 1.0 / 3.0_f64.sqrt()).abs() < 1e-3);
    }
}
