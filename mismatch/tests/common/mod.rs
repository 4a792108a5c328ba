//! A recording made by the signal chain itself, with noise of known size.

#![allow(dead_code, reason = "every test file uses a part of it")]

pub mod commanded;

use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};
use pleiad_mismatch::nominal_model;
use pleiad_physics::chain::actuator::{Command, schedule};
use pleiad_physics::chain::robot::Robot;
use pleiad_physics::chain::sensors::{self, Seen};
use pleiad_physics::{ActiveEffect, Chance, Drive, Effect, Pose, RobotModel, Scalar, Surroundings};
use pleiad_recording::{Nominal, NominalNoise, NominalRangeSensor, NominalRobot, Recording, TruthSample};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Track width, metres.
pub const TRACK_M: f64 = 0.4;
/// Wheel radius, metres.
pub const RADIUS_M: f64 = 0.05;
/// One sigma of every noise: truth (m, rad), gyro, GPS, heading, range, bearing.
pub const SIGMAS: [f64; 6] = [0.001, 0.004, 0.04, 0.012, 0.025, 0.01];

const STEP_S: f64 = 0.001;
const MILLISECONDS: u32 = 120_000;

/// What the recording declares.
pub fn declared() -> Nominal {
    let robot = NominalRobot {
        wheel_radius: RADIUS_M,
        track_width: TRACK_M,
        servo_time_constant_s: 0.03,
        servo_time_constant_turn_s: 0.02,
        gyro_scale: 1.0,
        ..NominalRobot::default()
    };
    let range_sensor = NominalRangeSensor {
        max_range_m: 50.0,
        half_fov_rad: 3.2,
        detection_probability: 1.0,
        range_scale: 1.0,
        ..NominalRangeSensor::default()
    };
    let noise = NominalNoise::default();
    Nominal { noise, range_sensor, robots: [(RobotId(1), robot)].into() }
}

/// Robot 1 drives for two minutes on wide curves at a speed that swings about 0.4 m/s, with this effect.
pub fn recorded(effect: Option<(Effect, &[f64])>) -> Recording {
    let nominal = declared();
    let mut model = nominal_model(&nominal.robots[&RobotId(1)], &nominal.range_sensor, &nominal.noise);
    assert_eq!(model.drive, Drive::Differential);
    if let Some((effect, values)) = effect {
        model = model.with(ActiveEffect::new(effect, values).expect("as many values as parameters"));
    }
    let mut recording = Recording {
        name: "made".to_owned(),
        landmarks: [(LandmarkId(7), [3.0, 2.0]), (LandmarkId(8), [-4.0, 1.0])].into(),
        nominal: Some(nominal),
        ..Recording::default()
    };
    let commands: Vec<Command> = (0..MILLISECONDS / 40)
        .map(|index| {
            let time_s = 0.04 * f64::from(index);
            let speed_m_s = 0.4 + 0.3 * (0.9 * time_s).sin();
            Command { time_s, speed_m_s, yaw_rate_rad_s: 0.7 * (0.31 * time_s).sin() }
        })
        .collect();
    let own = recording.robots.entry(RobotId(1)).or_default();
    own.commands = commands
        .iter()
        .map(|command| pleiad_recording::Command {
            time: Timestamp::from_seconds(command.time_s),
            forward_m_s: command.speed_m_s,
            yaw_rate_rad_s: command.yaw_rate_rad_s,
        })
        .collect();
    let landmarks = recording.landmarks.clone();
    drive(&model, &commands, |millisecond, robot, noise| {
        let time = Timestamp::from_seconds(f64::from(millisecond) * STEP_S);
        let context = robot.context(&model, Surroundings::default(), Chance::EXPECTED);
        let mut push = |reading| own.push(Sample { time, reading });
        if millisecond % 20 == 0 {
            let [left_rad, right_rad] = sensors::encoders(&model, &context);
            push(Reading::Wheels { left_rad, right_rad });
        }
        if millisecond % 20 == 7 {
            let rate = sensors::gyro(&model, &context, &mut 0.0);
            push(Reading::Gyro { yaw_rate_rad_s: rate + SIGMAS[1] * noise() });
        }
        if millisecond % 250 == 3 {
            let [x, y] = sensors::gps(&model, &context);
            push(Reading::Gps { x_m: x + SIGMAS[2] * noise(), y_m: y + SIGMAS[2] * noise() });
        }
        if millisecond % 200 == 11 {
            let heading = sensors::heading(&model, &context) + SIGMAS[3] * noise();
            push(Reading::Heading { heading_rad: heading.wrapped() });
            for (&id, &place) in &landmarks {
                let seen = sensors::sighting(&model, &context, &Seen::landmark(id.0, place));
                let range_m = seen.range_m + SIGMAS[4] * noise();
                let bearing_rad = (seen.bearing_rad + SIGMAS[5] * noise()).wrapped();
                let relative = Relative::RangeBearing { range_m, bearing_rad };
                push(Reading::Sighting { target: Target::Landmark(id), relative });
            }
        }
        if millisecond % 20 == 13 {
            let pose = sensors::truth(&model, &context);
            let [x, y, yaw] = [pose.x_m, pose.y_m, pose.yaw_rad].map(|exact| exact + SIGMAS[0] * noise());
            own.truth.push(TruthSample { time, pose: Pose2::new(x, y, yaw) });
        }
    });
    recording
}

/// Drives in steps of a millisecond; `record` gets the robot after each, and a normal draw.
fn drive(
    model: &RobotModel<f64>,
    commands: &[Command],
    mut record: impl FnMut(u32, &Robot<f64>, &mut dyn FnMut() -> f64),
) {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut noise = || StandardNormal.sample(&mut rng);
    let scheduled = schedule(model, commands, |_| Chance::EXPECTED);
    let mut robot = Robot::at_rest(Pose::identity());
    for millisecond in 0..MILLISECONDS {
        robot.time_s = f64::from(millisecond) * STEP_S;
        record(millisecond, &robot, &mut noise);
        robot.drive(model, &scheduled, Surroundings::default(), STEP_S);
    }
}
