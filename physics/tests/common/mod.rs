//! One short recording's worth of every prediction, for tests over the whole catalogue.

#![allow(clippy::unwrap_used, reason = "helpers of tests, outside a test function")]

use pleiad_physics::chain::actuator::{ActuatorState, Command, schedule};
use pleiad_physics::chain::body::BodyState;
use pleiad_physics::chain::robot::Robot;
use pleiad_physics::chain::sensors::{self, Seen};
use pleiad_physics::predict::{
    Anchor, BodyWindow, CommandWindow, EncoderSample, Instant, Path, body_motion, commanded_truth_change,
    gps, heading, mean_gyro, sighting, truth, truth_change, wheel_turns,
};
use pleiad_physics::signal::Target;
use pleiad_physics::{Chance, Context, Drive, Motion, Nominal, Pose, RobotModel, Scalar, Surroundings};

/// A prediction with its name.
pub type Named<S> = (String, S);

/// A robot with every declared imperfection that a recording may have.
pub fn nominal() -> Nominal<f64> {
    let mut nominal = Nominal::ideal(0.05, 0.3);
    nominal.encoder_ticks_per_rev = 1024.0;
    (nominal.servo_time_constant_s, nominal.servo_time_constant_turn_s) = (0.06, 0.04);
    // Odd, so that commands do not take effect on the edge of a window.
    nominal.command_latency_s = 0.0113;
    (nominal.gyro_bias_rad_s, nominal.gyro_scale) = (0.001, 1.01);
    (nominal.gps_mount_x_m, nominal.gps_mount_y_m, nominal.gps_latency_s) = (0.1, 0.02, 0.05);
    (nominal.clock_offset_s, nominal.clock_drift_ppm) = (0.004, 20.0);
    (nominal.sensor_mount_x_m, nominal.sensor_mount_y_m) = (0.08, -0.01);
    (nominal.sensor_mount_yaw_rad, nominal.sensor_latency_s) = (0.02, 0.01);
    (nominal.range_bias_m, nominal.range_scale, nominal.detection_probability) = (0.03, 1.01, 0.95);
    nominal.gyro_sigma_rad_s = 0.004;
    (nominal.range_sigma_m, nominal.bearing_sigma_rad) = (0.02, 0.01);
    nominal
}

/// Speed and yaw rate of the script: creeping, fast with a turn, backing up, spinning, standing.
fn script(time_s: f64) -> (f64, f64) {
    match time_s {
        t if t < 0.3 => (0.02, 0.0),
        t if t < 1.2 => (0.2 + 0.4 * t, 0.3),
        t if t < 2.0 => (0.25, -0.9),
        t if t < 2.6 => (-0.3, 0.2),
        t if t < 3.1 => (0.0, 1.1),
        _ => (0.0, 0.0),
    }
}

/// Odd instants, so that no prediction sits on an onset.
fn instants(count: u32, step_s: f64) -> impl Iterator<Item = f64> {
    (0..count).map(move |i| 0.013 + step_s * f64::from(i))
}

fn surroundings(time_s: f64) -> Surroundings {
    Surroundings { steer_rad: 0.2, voltage_change_v: -0.3 * time_s, partner_m: Some([0.8, 0.4]) }
}

/// Now and then a draw that makes an unlikely thing happen.
fn chance(position: usize) -> Chance {
    if position % 7 == 3 { Chance { uniform: 0.01, choice: 0.2, normal: 1.0 } } else { Chance::EXPECTED }
}

fn motion(time_s: f64) -> Motion<f64> {
    let (speed, yaw_rate) = script(time_s);
    let mut motion = Motion::at_rest(Pose::new(0.3 * time_s - 0.4, 0.2 * time_s - 0.3, 0.8 * time_s - 0.5));
    (motion.speed_m_s, motion.yaw_rate_rad_s, motion.acceleration_m_s2) = (speed, yaw_rate, 0.4);
    motion.wheel_angle_rad = [7.0 * time_s, 9.0 * time_s];
    motion
}

fn commands() -> Vec<Command> {
    let of = |time_s| {
        let (speed_m_s, yaw_rate_rad_s) = script(time_s);
        Command { time_s, speed_m_s, yaw_rate_rad_s }
    };
    instants(90, 0.04).map(of).collect()
}

fn encoders() -> Vec<EncoderSample> {
    let mut angle_rad = [0.0; 2];
    let mut samples = Vec::new();
    for time_s in instants(180, 0.02) {
        samples.push(EncoderSample { time_s, angle_rad, steer_rad: surroundings(time_s).steer_rad });
        let (speed, yaw_rate) = script(time_s);
        angle_rad[0] += (speed - 0.15 * yaw_rate) / 0.05 * 0.02;
        angle_rad[1] += (speed + 0.15 * yaw_rate) / 0.05 * 0.02;
    }
    samples
}

/// Every prediction of the model, for the drive it has.
pub fn predictions<S: Scalar>(model: &RobotModel<S>) -> Vec<Named<S>> {
    let mut out = Vec::new();
    actuator(model, &mut out);
    body(model, &mut out);
    readings(model, &mut out);
    chances(model, &mut out);
    drive(model, &mut out);
    out
}

/// Every prediction, of a robot with two driven wheels and of a car.
pub fn of_both_drives<S: Scalar>(model: &RobotModel<S>) -> Vec<Named<S>> {
    let mut out = predictions(model);
    let car = RobotModel { drive: Drive::CarLike { wheelbase_m: 0.4 }, ..model.clone() };
    out.extend(predictions(&car).into_iter().map(|(name, value)| (format!("car {name}"), value)));
    out
}

fn push_pose<S: Scalar>(out: &mut Vec<Named<S>>, name: &str, pose: Pose<S>) {
    for (part, value) in [("x", pose.x_m), ("y", pose.y_m), ("yaw", pose.yaw_rad)] {
        out.push((format!("{name} {part}"), value));
    }
}

fn actuator<S: Scalar>(model: &RobotModel<S>, out: &mut Vec<Named<S>>) {
    let scheduled = schedule(model, &commands(), chance);
    let mut state = ActuatorState::default();
    let mut robot = Robot::at_rest(Pose::identity());
    for from_s in instants(17, 0.2) {
        let middle_s = from_s + 0.1;
        let window = CommandWindow {
            from_s,
            to_s: from_s + 0.2,
            motion: motion(middle_s),
            surroundings: surroundings(middle_s),
        };
        let [left, right] = wheel_turns(model, &scheduled, &window, &mut state);
        out.push((format!("turn left {from_s:.2}"), left));
        out.push((format!("turn right {from_s:.2}"), right));
        let driven = commanded_truth_change(model, &scheduled, &window, &mut robot);
        push_pose(out, &format!("commanded {from_s:.2}"), driven);
    }
}

fn body<S: Scalar>(model: &RobotModel<S>, out: &mut Vec<Named<S>>) {
    let samples = encoders();
    let mut states = [BodyState::default(); 3];
    let partner_m: Vec<_> = (0..=25).map(|index| Some([0.7 + 0.008 * f64::from(index), 0.4])).collect();
    for (first, from_s) in (0..150).step_by(25).zip(instants(6, 0.5)) {
        let window = BodyWindow {
            track: &samples,
            ends: [first, first + 25],
            start: motion(from_s).pose,
            surroundings: surroundings(from_s),
            partner_m: if first % 2 == 0 { &partner_m } else { &[] },
        };
        // Reference poses between samples, by a different way at each end.
        let [first_s, last_s] = window.stamps_s();
        let stamps_s = [first_s - 0.007, last_s + 0.004];
        push_pose(out, &format!("body {from_s:.2}"), body_motion(model, &window, &mut states[0]));
        push_pose(
            out,
            &format!("truth change {from_s:.2}"),
            truth_change(model, &window, stamps_s, &mut states[1]),
        );
        out.push((format!("gyro {from_s:.2}"), mean_gyro(model, &window, &mut states[2])));
    }
}

/// A circle, driven at constant velocity.
struct Circle;

impl Path for Circle {
    fn motion_at(&self, time_s: f64) -> Option<Motion<f64>> {
        let (speed, yaw_rate) = (0.4, 0.5);
        let mut motion = Motion::at_rest(Pose::exp(speed * time_s, 0.0, yaw_rate * time_s));
        (motion.speed_m_s, motion.yaw_rate_rad_s) = (speed, yaw_rate);
        Some(motion)
    }
}

/// An instant of a reading; every other one is near a reference pose.
fn instant(time_s: f64, anchored: bool) -> Instant<'static> {
    let motion = motion(time_s);
    let on_path = [time_s - 0.008, time_s].map(|stamp_s| Circle.motion_at(stamp_s).unwrap());
    let anchor = Anchor { time_s: time_s - 0.008, pose: motion.pose, path: &Circle, on_path };
    let anchor = anchored.then_some(anchor);
    Instant { time_s, motion, surroundings: surroundings(time_s), anchor, target: None }
}

fn readings<S: Scalar>(model: &RobotModel<S>, out: &mut Vec<Named<S>>) {
    for (position, time_s) in instants(6, 0.55).enumerate() {
        let instant = instant(time_s, position % 2 == 1);
        let [x, y] = gps(model, &instant);
        out.push((format!("gps x {time_s:.2}"), x));
        out.push((format!("gps y {time_s:.2}"), y));
        out.push((format!("heading {time_s:.2}"), heading(model, &instant)));
        push_pose(out, &format!("truth {time_s:.2}"), truth(model, &instant));
        let partner = Seen { target: Target::Robot(3), position_m: [2.0, -0.5], velocity_m_s: [0.1, 0.2] };
        for seen in [Seen::landmark(1, [2.5, 1.0]), Seen::landmark(2, [1.5, 2.0]), partner] {
            let name = format!("{:?} {time_s:.2}", seen.target);
            let path: &dyn Path = &Circle;
            let target = matches!(seen.target, Target::Robot(_)).then_some(path);
            let instant = Instant { target: target.filter(|_| position % 2 == 1), ..instant };
            let sighting = sighting(model, &instant, &seen);
            out.push((format!("range {name}"), sighting.range_m));
            out.push((format!("bearing {name}"), sighting.bearing_rad));
            out.push((format!("detection {name}"), sighting.detection_probability));
        }
    }
}

/// Noise, stamps, names, and what chance does.
fn chances<S: Scalar>(model: &RobotModel<S>, out: &mut Vec<Named<S>>) {
    let mut walk = S::zero();
    let targets = [Target::Landmark(1), Target::Landmark(2), Target::Robot(3)];
    for (position, time_s) in instants(8, 0.3).enumerate() {
        let mut context = Context::new(&model.nominal, time_s, motion(time_s).lift::<S>());
        context = context.over(S::constant(0.02));
        context.chance = chance(position);
        let noise = sensors::noise(model, &context, S::constant(2.0), S::constant(0.3));
        for (name, value) in [
            ("encoder sigma", noise.encoder_sigma_rad),
            ("delay sigma", noise.command_delay_sigma_s),
            ("loss", noise.command_loss_probability),
            ("gyro sigma", noise.gyro_sigma_rad_s),
            ("gyro walk variance", noise.gyro_walk_variance),
            ("range sigma", noise.range_sigma_m),
            ("bearing sigma", noise.bearing_sigma_rad),
            ("tails", S::one() / noise.degrees_of_freedom),
            ("wrong identity", noise.wrong_identity_probability),
            ("stamp", sensors::stamp(model, &context)),
            ("walking gyro", sensors::gyro(model, &context, &mut walk)),
            ("ticks", sensors::encoders(model, &context)[0]),
        ] {
            out.push((format!("{name} {time_s:.2}"), value));
        }
        for target in targets {
            let others: Vec<_> = targets.iter().copied().filter(|other| *other != target).collect();
            let named = sensors::identity(model, &context, target, &others);
            let number = targets.iter().position(|other| *other == named).unwrap();
            out.push((format!("identity {target:?} {time_s:.2}"), S::constant(number as f64)));
        }
    }
}

fn drive<S: Scalar>(model: &RobotModel<S>, out: &mut Vec<Named<S>>) {
    let scheduled = schedule(model, &commands(), chance);
    let mut robot = Robot::at_rest(Pose::constant(-0.4, -0.3, 0.2));
    robot.time_s = 0.013;
    for step in 0..170 {
        robot.drive(model, &scheduled, surroundings(robot.time_s), 0.02);
        if step % 40 == 39 {
            push_pose(out, &format!("drive {step}"), robot.motion.pose);
        }
    }
}
