//! Recordings of robots without encoders, made by an integration of its own: forward Euler in small steps,
//! on which the signal chain has no influence.

use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};
use pleiad_recording::{Command, Recording, TruthSample};

/// Step of the integration, seconds: its positions are right to a micrometre and a microradian a second.
const STEP_S: f64 = 1e-4;
/// Truth at 50 Hz and commands at 66.7 Hz, in steps.
const TRUTH_EVERY: usize = 200;
const COMMAND_EVERY: usize = 150;

/// How the robot that is recorded departs from the ideal one.
#[derive(Clone, Copy, Default)]
pub struct Departure {
    pub lag_s: f64,
    pub delay_s: f64,
    pub speed_relative: f64,
    pub turn_relative: f64,
}

/// Robot 1 does for `lasting_s` what `commanded` says at each stamp of a command, held to the next. Truth
/// has no noise.
pub fn driven(lasting_s: f64, departure: Departure, commanded: impl Fn(f64) -> [f64; 2]) -> Recording {
    let mut recording = Recording { name: "driven".to_owned(), ..Recording::default() };
    let own = recording.robots.entry(RobotId(1)).or_default();
    let (mut speed, mut yaw_rate, mut pose) = (0.0, 0.0, [0.3, -0.2, 0.9]);
    let mut held: Vec<[f64; 2]> = Vec::new();
    let delay_steps = steps(departure.delay_s);
    for step in 0..=steps(lasting_s) {
        let time_s = step as f64 * STEP_S;
        if step % COMMAND_EVERY == 0 {
            let [forward_m_s, yaw_rate_rad_s] = commanded(time_s);
            held.push([forward_m_s, yaw_rate_rad_s]);
            let time = Timestamp::from_seconds(time_s);
            own.commands.push(Command { time, forward_m_s, yaw_rate_rad_s });
            own.push(Sample { time, reading: Reading::Velocity { forward_m_s, yaw_rate_rad_s } });
        }
        if step % TRUTH_EVERY == 70 {
            let pose = Pose2::new(pose[0], pose[1], pose[2]);
            own.truth.push(TruthSample { time: Timestamp::from_seconds(time_s), pose });
        }
        let acting = step.checked_sub(delay_steps).map_or([0.0; 2], |sent| held[sent / COMMAND_EVERY]);
        let target =
            [acting[0] * (1.0 + departure.speed_relative), acting[1] * (1.0 + departure.turn_relative)];
        let share = if departure.lag_s > 0.0 { STEP_S / departure.lag_s } else { 1.0 };
        // The mean of a step's ends is its middle: the position is right to second order.
        let before = [speed, yaw_rate];
        speed += share * (target[0] - speed);
        yaw_rate += share * (target[1] - yaw_rate);
        let (forward, turn) = if departure.lag_s > 0.0 {
            (0.5 * (before[0] + speed) * STEP_S, 0.5 * (before[1] + yaw_rate) * STEP_S)
        } else {
            (speed * STEP_S, yaw_rate * STEP_S)
        };
        let middle = pose[2] + 0.5 * turn;
        pose = [pose[0] + forward * middle.cos(), pose[1] + forward * middle.sin(), pose[2] + turn];
    }
    recording
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small and positive")]
fn steps(time_s: f64) -> usize {
    (time_s / STEP_S).round() as usize
}

/// Joystick-like: the speed changes every 0.9 s, the yaw rate every 0.7 s.
pub fn joystick(time_s: f64) -> [f64; 2] {
    let speed = 0.05 + 0.03 * (1.7 * (time_s / 0.9).floor()).sin();
    let yaw_rate = 0.5 * (2.3 * (time_s / 0.7).floor()).sin();
    [speed, yaw_rate]
}

/// Adds robot 2, which stands at `place`, and exact sightings at 5 Hz of it and of landmark 7 by robot 1.
pub fn with_sightings(recording: &mut Recording, place: [f64; 2], landmark: [f64; 2]) {
    recording.landmarks.insert(LandmarkId(7), landmark);
    let mut other = recording.robots[&RobotId(1)].clone();
    for sample in &mut other.truth {
        sample.pose = Pose2::new(place[0], place[1], 0.0);
    }
    // A standing robot's truth jitters a little; one that repeats exactly is a stuck channel.
    other.truth[0].pose = Pose2::new(place[0], place[1], 1e-9);
    for sample in &mut other.odometry {
        sample.reading = Reading::Velocity { forward_m_s: 0.0, yaw_rate_rad_s: 0.0 };
    }
    other.commands.clear();
    recording.robots.insert(RobotId(2), other);
    let own = recording.robots.get_mut(&RobotId(1)).expect("driven");
    let truth: Vec<_> = own.truth.iter().copied().step_by(10).collect();
    for sample in truth {
        for (target, [x, y]) in
            [(Target::Landmark(LandmarkId(7)), landmark), (Target::Robot(RobotId(2)), place)]
        {
            let (dx, dy) = (x - sample.pose.x_m(), y - sample.pose.y_m());
            let bearing_rad = dy.atan2(dx) - sample.pose.yaw_rad();
            let relative = Relative::RangeBearing { range_m: dx.hypot(dy), bearing_rad };
            own.push(Sample { time: sample.time, reading: Reading::Sighting { target, relative } });
        }
    }
}

/// Takes away what was recorded from the first to before the second instant.
pub fn without(recording: &mut Recording, (from_s, to_s): (f64, f64), truth: bool) {
    let kept = |time: Timestamp| !(from_s..to_s).contains(&time.seconds());
    for own in recording.robots.values_mut() {
        if truth {
            own.truth.retain(|sample| kept(sample.time));
        } else {
            own.commands.retain(|command| kept(command.time));
            own.odometry.retain(|sample| kept(sample.time));
        }
    }
}
