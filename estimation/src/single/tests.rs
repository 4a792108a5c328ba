use nalgebra::{Matrix2, SMatrix, SVector};

use super::*;
use crate::linear::Gaussian;

const WALKS: RandomWalks = RandomWalks {
    position_m: 0.01,
    heading_rad: 0.02,
    speed_m_s: 0.3,
    yaw_rate_rad_s: 0.4,
    gyro_bias_rad_s: 0.1,
};
/// Central differences with this step are exact to about its square, and to rounding over it.
const STEP: f64 = 1e-5;
const WITHIN: f64 = 1e-9;

fn seconds(s: f64) -> Timestamp {
    Timestamp::from_seconds(s)
}

/// Central differences of a function of the state, one column for each state.
fn differences<const N: usize, const M: usize>(
    state: &SVector<f64, N>,
    function: impl Fn(&SVector<f64, N>) -> SVector<f64, M>,
) -> SMatrix<f64, M, N> {
    let mut jacobian = SMatrix::<f64, M, N>::zeros();
    for column in 0..N {
        let (mut above, mut below) = (*state, *state);
        above[column] += STEP;
        below[column] -= STEP;
        jacobian.set_column(column, &((function(&above) - function(&below)) / (2.0 * STEP)));
    }
    jacobian
}

fn check_process<const N: usize>(process: &impl Process<N>, state: SVector<f64, N>) {
    for dt in [0.005, 0.1, 1.0] {
        let numerical = differences(&state, |state| process.predict(state, dt).mean);
        let analytical = process.predict(&state, dt).transition;
        assert!((numerical - analytical).abs().max() < WITHIN, "{dt} s: {numerical} {analytical}");
    }
}

#[test]
fn transitions_match_central_differences() {
    for (speed, rate) in [(0.5, 0.3), (-0.4, 1.2), (0.0, -0.7)] {
        check_process(&Unicycle { walks: WALKS }, SVector::from([1.0, -2.0, 0.6, speed, rate]));
        let own = SVector::from([1.0, -2.0, 0.6, speed - 0.1, speed + 0.3, rate, 0.02]);
        check_process(&PairOfWheels { walks: WALKS }, own);
    }
}

#[test]
fn sensors_match_central_differences() {
    let sensors = [
        Sensor::of(Unicycle::X),
        Sensor::of_angle(Unicycle::HEADING),
        Sensor::sum(&[(Unicycle::SPEED, 1.0), (Unicycle::YAW_RATE, -0.2)]),
        Sensor::Steering { wheelbase_m: 0.4, speed: Unicycle::SPEED, yaw_rate: Unicycle::YAW_RATE },
        Sensor::Steering { wheelbase_m: -0.4, speed: Unicycle::SPEED, yaw_rate: Unicycle::YAW_RATE },
    ];
    for (speed, rate) in [(0.5, 0.3), (-0.4, 1.2), (0.1, -0.07)] {
        let state = SVector::from([1.0, -2.0, 0.6, speed, rate]);
        for sensor in sensors {
            let value = |state: &SVector<f64, 5>| SVector::from([sensor.predict(state).unwrap().0]);
            let numerical = differences(&state, value).transpose();
            let row = sensor.predict(&state).unwrap().1;
            // The steering angle of 0.1 m/s bends more: its third derivative is some 2e3.
            assert!((numerical - row).abs().max() < 1e-6, "{sensor:?}: {numerical} {row}");
        }
    }
}

#[test]
fn a_constant_turn_is_driven_as_a_chord_of_the_circle() {
    // Radius 2 m, a turn of 0.5 rad: the chord is 2 R sin(0.25) long, the model's step R 0.5; both at 0.25 rad.
    let state = SVector::from([0.0, 0.0, 0.0, 1.0, 0.5]);
    let after = Unicycle { walks: WALKS }.predict(&state, 1.0).mean;
    let chord = 4.0 * 0.25_f64.sin();
    assert!((after[0] - chord * 0.25_f64.cos()).abs() < chord * 0.25 * 0.25 / 6.0 * 1.05);
    assert!((after[2] - 0.5).abs() < 1e-15);
    assert!((after[1] / after[0] - 0.25_f64.tan()).abs() < 1e-14);
}

#[test]
fn a_steering_angle_says_nothing_at_standstill_and_follows_the_sign_of_rear_steering() {
    let sensor = |wheelbase_m| Sensor::<5>::Steering {
        wheelbase_m,
        speed: Unicycle::SPEED,
        yaw_rate: Unicycle::YAW_RATE,
    };
    assert_eq!(sensor(0.4).predict(&SVector::from([0.0, 0.0, 0.0, 0.0, 0.2])), None);
    let turning = SVector::from([0.0, 0.0, 0.0, 0.5, 0.25]);
    let (front, _) = sensor(0.4).predict(&turning).unwrap();
    let (rear, _) = sensor(-0.4).predict(&turning).unwrap();
    assert!((front - 0.2_f64.atan()).abs() < 1e-15 && (front + rear).abs() < 1e-15);
}

/// Readings of both wheels, a gyro and a heading sensor of a robot that drives a curve.
fn readings() -> Vec<Measurement<5>> {
    let wheel = |side: f64| Sensor::sum(&[(Unicycle::SPEED, 1.0), (Unicycle::YAW_RATE, side * 0.2)]);
    let steer = Sensor::Steering { wheelbase_m: 0.4, speed: Unicycle::SPEED, yaw_rate: Unicycle::YAW_RATE };
    (0..200)
        .map(|k| {
            let wobble = f64::from(k % 7) * 0.01;
            let (sensor, value, variance) = match k % 5 {
                0 => (wheel(-1.0), 0.44 + wobble, 1e-3),
                1 => (wheel(1.0), 0.56 - wobble, 2e-3),
                2 => (Sensor::of(Unicycle::YAW_RATE), 0.3 + wobble, 1e-4),
                3 => (Sensor::of_angle(Unicycle::HEADING), 0.006 * f64::from(k) + wobble, 4e-4),
                _ => (steer, 0.24, 0.01),
            };
            Measurement { time: seconds(f64::from(k / 5) * 0.02), sensor, value, variance }
        })
        .collect()
}

fn begin() -> Ekf<Unicycle, 5> {
    let belief = Gaussian::from_sigmas([0.0, 0.0, 0.0, 0.4, 0.2], [0.05, 0.05, 0.02, 0.3, 0.3]);
    Ekf::new(Unicycle { walks: WALKS }, seconds(0.0), belief)
}

#[test]
fn the_two_wheels_one_by_one_are_speed_and_yaw_rate_with_their_correlation() {
    // V = (R + L)/2 and w = (R - L)/a of independent noises have this covariance; H reads V and w.
    let (left, right, track) = (1e-3, 4e-3, 0.4);
    let cross = (right - left) / (2.0 * track);
    let noise = Matrix2::new((left + right) / 4.0, cross, cross, (left + right) / (track * track));
    let mut observation = SMatrix::<f64, 2, 5>::zeros();
    observation[(0, Unicycle::SPEED)] = 1.0;
    observation[(1, Unicycle::YAW_RATE)] = 1.0;
    let mut at_once = *begin().belief();
    at_once.update(&SVector::from([0.52, 0.31]), &observation, &noise).unwrap();

    let mut filter = begin();
    for (side, variance) in [(-1.0, left), (1.0, right)] {
        let half = side * 0.5 * track;
        let sensor = Sensor::sum(&[(Unicycle::SPEED, 1.0), (Unicycle::YAW_RATE, half)]);
        let value = 0.52 + half * 0.31;
        filter.take(&Measurement { time: seconds(0.0), sensor, value, variance }).unwrap();
    }
    assert!((filter.belief().mean - at_once.mean).abs().max() < 1e-14);
    assert!((filter.belief().covariance - at_once.covariance).abs().max() < 1e-15);
}

#[test]
fn readings_in_any_order_of_arrival_give_the_bits_of_the_order_in_which_they_were_taken() {
    let readings = readings();
    let mut in_order = begin();
    for reading in &readings {
        in_order.take(reading).unwrap();
    }
    // A fixed permutation of 200: 77 has no factor in common with it.
    let mut replay = Replay::new(begin(), 60.0);
    for k in 0..readings.len() {
        let own = k * 77 % readings.len();
        replay.take(readings[own], u32::try_from(own % 5).unwrap()).unwrap();
    }
    assert_eq!(replay.filter(), &in_order);

    // What is applied at its arrival instead of at its instant does not: the planted fault.
    let mut naive = begin();
    for reading in &readings {
        let late = matches!(reading.sensor, Sensor::Linear { angle: true, .. });
        let time = if late { reading.time.plus_seconds(0.5) } else { reading.time };
        let shifted = Measurement { time: time.max(naive.time()), ..*reading };
        naive.take(&shifted).unwrap();
    }
    assert_ne!(naive.belief(), in_order.belief());
}

#[test]
fn what_is_older_than_the_window_is_refused_and_changes_nothing() {
    let readings = readings();
    let mut replay = Replay::new(begin(), 0.1);
    for (k, reading) in readings.iter().enumerate() {
        replay.take(*reading, u32::try_from(k % 5).unwrap()).unwrap();
    }
    // 0.1 s and both its ends, five readings each 0.02 s.
    assert_eq!(replay.kept(), 6 * 5);
    let before = replay.filter().clone();
    let old = Measurement { time: seconds(0.3), ..readings[3] };
    assert!(matches!(replay.take(old, 9), Err(SingleError::TooOld { .. })));
    assert_eq!(replay.filter(), &before);
    assert!(matches!(
        begin().take(&Measurement { time: seconds(-1.0), ..old }),
        Err(SingleError::BeforeNow { .. })
    ));
    assert!(matches!(
        replay.take(Measurement { value: f64::NAN, ..readings[199] }, 9),
        Err(SingleError::Value { .. })
    ));
    assert_eq!(replay.filter(), &before);
}

#[test]
fn a_question_leaves_the_filter_where_it_is() {
    let mut filter = begin();
    filter.take(&readings()[0]).unwrap();
    let before = filter.clone();
    let later = filter.at(seconds(2.0));
    assert_eq!(filter, before);
    assert!(later.sigma(Unicycle::HEADING) > before.belief().sigma(Unicycle::HEADING));
    assert_eq!(filter.state("heading_rad").unwrap().0.to_bits(), before.belief().mean[2].to_bits());
    assert_eq!(filter.state("altitude_m"), None);
}

#[test]
fn headings_are_compared_around_the_circle() {
    let belief = Gaussian::from_sigmas([0.0, 0.0, 3.1, 0.0, 0.0], [0.1; 5]);
    let mut filter = Ekf::new(Unicycle { walks: WALKS }, seconds(0.0), belief);
    let reading = Measurement {
        time: seconds(0.0),
        sensor: Sensor::of_angle(Unicycle::HEADING),
        value: -3.1,
        variance: 0.01,
    };
    let Outcome::Used { innovation, .. } = filter.take(&reading).unwrap() else { panic!("unused") };
    // The short way, and half of it at equal weights: across pi.
    assert!((innovation - (std::f64::consts::TAU - 6.2)).abs() < 1e-12);
    assert!((filter.belief().mean[2].abs() - std::f64::consts::PI).abs() < 1e-12);
}
