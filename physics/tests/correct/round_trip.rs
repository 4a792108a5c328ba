//! Every effect of the catalogue, there and back: a robot is simulated with it in millisecond steps, and
//! what it read, corrected in steps of its channels, is compared with what a nominal robot would have read.

use std::collections::BTreeMap;

use pleiad_physics::chain::actuator::{Command, schedule};
use pleiad_physics::chain::robot::Robot;
use pleiad_physics::chain::sensors::{self, Seen};
use pleiad_physics::correct::{Correction, OdometryCorrection, OdometryReading, Place, Polar, limit};
use pleiad_physics::signal::Target;
use pleiad_physics::{
    ActiveEffect, Chance, Context, Drive, Effect, Motion, Nominal, Pose, RobotModel, Scalar, Stage,
    Surroundings,
};

use super::ideal;

const STEP_MS: u32 = 1;
const ENCODERS_MS: u32 = 20;
const COMMANDS_MS: u32 = 40;
const DURATION_MS: u32 = 12_000;

/// A robot with declared imperfections, none of which the estimator knows of.
fn imperfect(drive: Drive) -> RobotModel<f64> {
    let nominal = Nominal {
        wheel_radius: 0.0505,
        track_width: 0.31,
        servo_time_constant_s: 0.06,
        servo_time_constant_turn_s: 0.04,
        gyro_bias_rad_s: 0.001,
        gyro_scale: 1.01,
        gps_mount_x_m: 0.1,
        gps_mount_y_m: 0.02,
        gps_latency_s: 0.05,
        clock_offset_s: 0.004,
        clock_drift_ppm: 20.0,
        sensor_mount_x_m: 0.08,
        sensor_mount_y_m: -0.01,
        sensor_mount_yaw_rad: 0.02,
        sensor_latency_s: 0.01,
        range_bias_m: 0.03,
        range_scale: 1.01,
        ..ideal()
    };
    RobotModel::nominal(drive, nominal)
}

fn typical(effect: Effect, drive: Drive) -> RobotModel<f64> {
    imperfect(drive).with(ActiveEffect::new(effect, &effect.typical_values()).unwrap())
}

/// Arcs to both sides, at several speeds, forwards and backwards, standing and starting again, around the
/// origin, where the patches of the typical sizes are.
fn script(time_s: f64) -> (f64, f64) {
    match time_s {
        t if t < 1.0 => (0.3, 0.4),
        t if t < 3.0 => (0.45, -0.8),
        t if t < 4.5 => (-0.25, 0.5),
        t if t < 4.8 => (0.0, 0.0),
        t if t < 5.2 => (0.03, 0.0),
        t if t < 6.5 => (0.02, 0.9),
        t if t < 9.0 => (0.6, 0.3),
        _ => (-0.35, -0.3),
    }
}

struct Driven {
    commands: Vec<Command>,
    /// Time, wheel angles, true pose.
    encoders: Vec<(f64, [f64; 2], Pose<f64>)>,
    motions: Vec<(f64, Motion<f64>)>,
}

/// Drives a robot by the script; the wheels of a car are steered as commanded.
fn drive(model: &RobotModel<f64>) -> Driven {
    let commands: Vec<Command> = (0..DURATION_MS / COMMANDS_MS)
        .map(|tick| {
            let time_s = f64::from(tick * COMMANDS_MS) * 1e-3;
            let (speed_m_s, yaw_rate_rad_s) = script(time_s);
            Command { time_s, speed_m_s, yaw_rate_rad_s }
        })
        .collect();
    let scheduled = schedule(model, &commands, |_| Chance::EXPECTED);
    let mut robot = Robot::at_rest(Pose::new(-0.4, 0.1, -0.2));
    let mut driven = Driven { commands, encoders: Vec::new(), motions: Vec::new() };
    for tick in 0..=DURATION_MS / STEP_MS {
        let time_ms = tick * STEP_MS;
        let time_s = f64::from(time_ms) * 1e-3;
        robot.time_s = time_s;
        if time_ms.is_multiple_of(ENCODERS_MS) {
            driven.encoders.push((time_s, robot.motion.wheel_angle_rad, robot.motion.pose));
        }
        if time_ms % 370 == 200 {
            driven.motions.push((time_s, robot.motion));
        }
        let held = &driven.commands[((time_ms / COMMANDS_MS) as usize).min(driven.commands.len() - 1)];
        let (speed, yaw_rate) = (held.speed_m_s, held.yaw_rate_rad_s);
        let steer_rad = match model.drive {
            Drive::CarLike { wheelbase_m } if speed != 0.0 => (wheelbase_m * yaw_rate / speed).atan(),
            _ => 0.0,
        };
        robot.drive(
            model,
            &scheduled,
            Surroundings { steer_rad, ..Surroundings::default() },
            f64::from(STEP_MS) * 1e-3,
        );
    }
    driven
}

/// Root mean square of errors of position (m) and yaw (rad, over a lever of one metre).
fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
}

fn gap(found: &Pose<f64>, expected: &Pose<f64>) -> f64 {
    let apart = expected.between(found);
    apart.x_m.hypot(apart.y_m).hypot(apart.yaw_rad)
}

/// Errors of the motion over 2 s, rolled out from encoder readings or commands by `correction`. Effects that
/// look at the pose are told the true one, as from a perfect filter.
fn rolled_out(correction: &Correction, driven: &Driven, commanded: bool) -> Vec<f64> {
    let readings: Vec<(f64, OdometryReading)> = if commanded {
        let told = |command: &Command| OdometryReading::Commanded {
            speed_m_s: command.speed_m_s,
            yaw_rate_rad_s: command.yaw_rate_rad_s,
        };
        driven.commands.iter().map(|command| (command.time_s, told(command))).collect()
    } else {
        driven
            .encoders
            .iter()
            .map(|(time_s, angles, _)| (*time_s, OdometryReading::Wheels(*angles)))
            .collect()
    };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a position in a short list")]
    let truth = |time_s: f64| driven.encoders[(time_s * 1e3 / f64::from(ENCODERS_MS)).round() as usize].2;
    let mut odometry = OdometryCorrection::default();
    // From rest, so that what happened before does not matter.
    odometry.restart(
        correction,
        readings[0].0,
        match readings[0].1 {
            OdometryReading::Commanded { .. } => {
                OdometryReading::Commanded { speed_m_s: 0.0, yaw_rate_rad_s: 0.0 }
            }
            wheels => wheels,
        },
    );
    if commanded {
        // The first command of the script, an instant after.
        odometry.step(correction, truth(0.0), 1e-9, readings[0].1);
    }
    let mut errors = Vec::new();
    let (mut begun, mut moved) = (truth(0.0), Pose::identity());
    let window = if commanded { 50 } else { 100 };
    for (index, (time_s, reading)) in readings.iter().enumerate().skip(1) {
        moved = moved.compose(&odometry.step(correction, truth(readings[index - 1].0), *time_s, *reading));
        if index % window == 0 {
            errors.push(gap(&moved, &begun.between(&truth(*time_s))));
            (begun, moved) = (truth(*time_s), Pose::identity());
        }
    }
    errors
}

/// The plain robot with the model's drive, told of nothing but the declared parameters.
fn untold(drive: Drive) -> Correction {
    Correction::new(imperfect(drive), ideal())
}

fn drive_of(effect: Effect) -> Drive {
    match effect {
        Effect::SteerTrim | Effect::Understeer => Drive::CarLike { wheelbase_m: 0.4 },
        _ => Drive::Differential,
    }
}

/// With the effect known, what is left of its error is of the order of a step: a tenth at most, or what
/// steps of 20 ms instead of 1 ms make of any robot (`floor`). Tells whether the effect acts at all.
fn check_odometry(effect: Effect, commanded: bool) -> bool {
    let drive_kind = drive_of(effect);
    let model = typical(effect, drive_kind);
    let driven = drive(&model);
    let left = rms(&rolled_out(&Correction::new(model, ideal()), &driven, commanded));
    let untold = rms(&rolled_out(&untold(drive_kind), &driven, commanded));
    let plain = imperfect(drive_kind);
    let floor = rms(&rolled_out(&Correction::new(plain.clone(), ideal()), &drive(&plain), commanded));
    let acts = untold > 10.0 * floor;
    let name = effect.name();
    let figures =
        format!("{name}, commanded {commanded}: {left:.2e}, untold {untold:.2e}, floor {floor:.2e}");
    assert!(left < 0.1 * untold + 2.0 * floor, "{figures}");
    acts
}

#[test]
fn known_effects_are_taken_out_of_wheel_and_command_odometry() {
    let mut acted = BTreeMap::new();
    for &effect in Effect::ALL {
        if limit(effect).is_none() {
            let wheels = drive_of(effect) == Drive::Differential && check_odometry(effect, false);
            let commands = check_odometry(effect, true);
            acted.insert(effect, (wheels, commands));
        }
    }
    // The check is of no worth where nothing acts: what belongs to these stages has to.
    for (effect, (wheels, commands)) in acted {
        let info = effect.info();
        let name = effect.name();
        let moves = matches!(info.stage, Stage::Wheel | Stage::Body | Stage::World);
        let actuator =
            info.stage == Stage::Actuator || matches!(effect, Effect::FloorTilt | Effect::WorldForce);
        let car = drive_of(effect) != Drive::Differential;
        assert_eq!(wheels, moves && !actuator && !car, "{name} on wheels");
        assert_eq!(commands, moves || actuator, "{name} on commands");
    }
}

/// Readings of a motion under a model, as the sensors of the chain give them, by the stamps of the robot.
struct Read {
    gps_m: [f64; 2],
    heading_rad: f64,
    gyro_rad_s: f64,
    sightings: Vec<Polar>,
}

const LANDMARKS: [(u32, [f64; 2]); 3] = [(1, [2.5, 1.0]), (2, [-1.0, 2.0]), (3, [0.3, -1.5])];

fn read(model: &RobotModel<f64>, time_s: f64, motion: Motion<f64>) -> Read {
    let context = Context::new(&model.nominal, time_s, motion);
    let polar = |&(id, place_m): &(u32, [f64; 2])| {
        let seen = sensors::sighting(model, &context, &Seen::landmark(id, place_m));
        Polar { range_m: seen.range_m, bearing_rad: seen.bearing_rad }
    };
    Read {
        gps_m: sensors::gps(model, &context),
        heading_rad: sensors::heading(model, &context),
        gyro_rad_s: sensors::gyro(model, &context, &mut 0.0),
        sightings: LANDMARKS.iter().map(polar).collect(),
    }
}

/// The greatest error of corrected readings against those of ideal sensors, in units of a metre or a radian.
fn sensor_errors(model: &RobotModel<f64>, correction: &Correction) -> f64 {
    let nominal = RobotModel::nominal(Drive::Differential, ideal());
    let mut worst = 0.0_f64;
    let mut note = |error: f64| worst = worst.max(if error.is_nan() { f64::INFINITY } else { error.abs() });
    for (time_s, motion) in drive(&imperfect(Drive::Differential)).motions {
        // The chain is asked for a reading by its stamp in common time; it puts the clock in itself.
        let read_then = read(model, time_s, motion);
        // What an ideal sensor reads at an earlier instant, and the place of it.
        let earlier = |age_s: f64| {
            let then = Motion { pose: motion.carried(-age_s), ..motion };
            let place = Place { time_s: time_s - age_s, pose: then.pose };
            (read(&nominal, time_s - age_s, then), place)
        };
        let clock_s = correction.clock_error_s(time_s);
        let (ideal_then, place) = earlier(clock_s);
        note((correction.heading(&place, read_then.heading_rad) - ideal_then.heading_rad).wrapped());
        note(correction.gyro(&place, read_then.gyro_rad_s) - ideal_then.gyro_rad_s);
        let (ideal_then, place) = earlier(clock_s + correction.gps_latency_s(&place));
        let [x, y] = correction.gps(&place, read_then.gps_m);
        note(x - ideal_then.gps_m[0]);
        note(y - ideal_then.gps_m[1]);
        let target = Target::Landmark(1);
        let (ideal_then, place) = earlier(clock_s + correction.sighting_latency_s(&place, target));
        for (index, &(id, place_m)) in LANDMARKS.iter().enumerate() {
            let (seen, own) = (read_then.sightings[index], ideal_then.sightings[index]);
            // In front of the robot. A bent bearing of what is behind it could be that of two places.
            if own.bearing_rad.abs() > 1.5 {
                continue;
            }
            let target = Target::Landmark(id);
            let found = correction.sighting(&place, target, seen);
            note(found.range_m - own.range_m);
            note((found.bearing_rad - own.bearing_rad).wrapped());
            note(correction.range(&place, target, Some(place_m), seen.range_m) - own.range_m);
            note(
                (correction.bearing(&place, target, Some(place_m), seen.bearing_rad) - own.bearing_rad)
                    .wrapped(),
            );
        }
    }
    worst
}

/// What the chain and the correction treat differently: the chain looks up the error of a compass at the
/// heading of the stamp, the correction at that of the reading, 4 ms before.
fn tolerance(effect: Effect) -> f64 {
    match effect {
        Effect::CompassHardIron | Effect::CompassSoftIron => 5e-4,
        // The error of the clock at the stamp and at the instant of the reading: 50 ms times 20e-6.
        _ => 2e-6,
    }
}

#[test]
fn known_effects_are_taken_out_of_readings() {
    let untold = Correction::new(imperfect(Drive::Differential), ideal());
    for &effect in Effect::ALL {
        let model = typical(effect, Drive::Differential);
        let told = Correction::new(model.clone(), ideal());
        let (left, without) = (sensor_errors(&model, &told), sensor_errors(&model, &untold));
        let name = effect.name();
        assert!(left < tolerance(effect), "{name}: {left:.2e}, untold {without:.2e}");
        // The check is of no worth where nothing acts.
        let stage = effect.info().stage;
        let acts = matches!(stage, Stage::Sensor | Stage::Clock) && limit(effect).is_none();
        assert_eq!(without > 10.0 * tolerance(effect), acts, "{name}: {without:.2e}");
    }
}

#[test]
fn what_cannot_be_taken_out_is_said() {
    let model = typical(Effect::HeavyTails, Drive::Differential)
        .with(ActiveEffect::new(Effect::GyroBias, &[0.1]).unwrap());
    let found = Correction::new(model, ideal()).not_corrected();
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].0, Effect::HeavyTails);
}
