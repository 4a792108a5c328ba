//! A node that is told a model of its robot takes the model's effects out of what it reads, deterministically:
//! from its own samples alone, and from its journal as it did live.

use std::collections::BTreeMap;

use pleiad_agent::config::{AgentConfig, VelocityName, YawName};
use pleiad_agent::{Node, Record};
use pleiad_estimation::fact::{Absolute, Body, Entry, Observation, Quantity};
use pleiad_estimation::geometry::Vector3;
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{LandmarkId, Pose2, RobotId};
use pleiad_physics::Effect;
use pleiad_recording::{Nominal, NominalRobot};

use crate::support::model::{model, robot, told, written};
use crate::support::team::{Crash, Net, world};
use crate::support::{
    agent, assert_pose, circle, feed, folded, held, node_of, observations, sample, seconds, sighting, start,
    velocity,
};

fn wheels(time_s: f64, left_rad: f64, right_rad: f64) -> Sample {
    sample(time_s, Reading::Wheels { left_rad, right_rad })
}

fn node_with(effects: &[(Effect, &[f64])], change: impl Fn(&mut AgentConfig)) -> Node {
    let folder = tempfile::tempdir().unwrap();
    let mut config = told(agent(1), folder.path(), effects);
    change(&mut config);
    node_of(&config, 1)
}

/// The node's own trajectory, which begins at the prior.
fn reckoned(node: &mut Node) -> Pose2 {
    node.estimate().expect("a place in the map").odom_from_robot
}

/// The observation that the node makes of a sample.
fn fact_of(node: &mut Node, sample: Sample) -> Observation {
    let handled = feed(node, sample);
    assert!(handled.notices.is_empty(), "{:?}", handled.notices);
    *observations(&handled.published).last().expect("an observation")
}

#[test]
fn larger_wheels_farther_apart_drive_another_circle() {
    let effects: [(Effect, &[f64]); 2] =
        [(Effect::WheelRadiusError, &[0.02]), (Effect::TrackWidthError, &[0.05])];
    // Whatever geometry the configuration has, angles of wheels are turned into motion by the model.
    for believed in [None, Some(0.2)] {
        let mut node = node_with(&effects, |config| {
            (config.motion.wheel_radius_m, config.motion.track_width_m) = (believed, believed);
        });
        for tick in 0..=100 {
            let turned = f64::from(tick) * 0.1;
            feed(&mut node, wheels(f64::from(tick) * 0.1, 3.0 * turned, 4.0 * turned));
        }
        let (left, right) = (3.0 * 0.05 * 1.02, 4.0 * 0.05 * 1.02);
        let expected = circle(start(), 0.5 * (left + right), (right - left) / (0.3 * 1.05), 10.0);
        assert_pose(&reckoned(&mut node), &expected, 1e-9);
    }
}

#[test]
fn velocity_is_scaled_as_the_wheels_and_commands_also_by_the_servo() {
    let effects: [(Effect, &[f64]); 2] =
        [(Effect::WheelRadiusError, &[0.02]), (Effect::ActuatorGain, &[0.1, 0.1])];
    for (kind, gain) in [(VelocityName::Measured, 1.02), (VelocityName::Commanded, 1.02 * 1.1)] {
        let mut node = node_with(&effects, |config| config.motion.velocity = kind);
        for tick in 0..=100 {
            feed(&mut node, velocity(f64::from(tick) * 0.1));
        }
        let expected = circle(start(), 0.8 * gain, 0.4 * gain, 10.0);
        assert_pose(&reckoned(&mut node), &expected, 1e-9);
    }
}

#[test]
fn increments_were_made_by_the_geometry_of_the_configuration() {
    let folder = tempfile::tempdir().unwrap();
    let fitted = NominalRobot { wheel_radius: 0.06, track_width: 0.33, ..robot(&[]) };
    let mut config = agent(1);
    config.model = Some(written(folder.path(), &model(&fitted)));
    (config.motion.wheel_radius_m, config.motion.track_width_m) = (Some(0.05), Some(0.3));
    let mut node = node_of(&config, 1);
    let increment = Reading::Increment(Pose2::exp(Vector3::new(0.08, 0.0, 0.04)));
    for tick in 0..=100 {
        feed(&mut node, sample(f64::from(tick) * 0.1, increment));
    }
    let expected = circle(start(), 0.8 * 0.06 / 0.05, 0.4 * (0.06 / 0.05) / (0.33 / 0.3), 10.0);
    assert_pose(&reckoned(&mut node), &expected, 1e-9);
}

#[test]
fn a_model_of_nothing_changes_nothing_but_rounding() {
    let mut plain = node_of(&agent(1), 1);
    let mut modelled = node_with(&[], |_| {});
    for tick in 0..=100 {
        for node in [&mut plain, &mut modelled] {
            feed(node, velocity(f64::from(tick) * 0.1));
        }
    }
    assert_pose(&reckoned(&mut modelled), &reckoned(&mut plain), 1e-9);
    let reading = Relative::RangeBearing { range_m: 2.0, bearing_rad: 0.5 };
    let seen = sighting(9.5, Target::Landmark(LandmarkId(7)), reading);
    let (ours, theirs) = (fact_of(&mut modelled, seen), fact_of(&mut plain, seen));
    assert_eq!(ours.time, theirs.time);
    let Quantity::Landmark { relative: Relative::RangeBearing { range_m, bearing_rad }, .. } = ours.quantity
    else {
        panic!("{ours:?}")
    };
    assert!((range_m - 2.0).abs() < 1e-12 && (bearing_rad - 0.5).abs() < 1e-12);
}

#[test]
fn a_position_is_of_the_axle_at_the_instant_it_was_taken() {
    let mut node = node_with(&[(Effect::GpsLeverArm, &[0.2, -0.1]), (Effect::GpsLatency, &[0.3])], |_| {});
    for time_s in [0.0, 1.0, 2.0] {
        feed(&mut node, sample(time_s, Reading::Velocity { forward_m_s: 0.5, yaw_rate_rad_s: 0.0 }));
    }
    let fact = fact_of(&mut node, sample(1.8, Reading::Gps { x_m: 5.0, y_m: 6.0 }));
    assert_eq!(fact.time, seconds(1.5));
    let Quantity::Absolute(Absolute::Position([x, y])) = fact.quantity else { panic!("{fact:?}") };
    let (sin, cos) = 0.5_f64.sin_cos();
    assert!((x - (5.0 - 0.2 * cos - 0.1 * sin)).abs() < 1e-9, "{x}");
    assert!((y - (6.0 - 0.2 * sin + 0.1 * cos)).abs() < 1e-9, "{y}");
}

#[test]
fn a_clock_that_is_ahead_is_set_back_on_every_sample() {
    let mut node = node_with(&[(Effect::ClockOffset, &[0.25])], |_| {});
    let said = feed(&mut node, velocity(10.25)).published;
    let Body::Boot(boot) = said[0].body else { panic!("no boot") };
    assert_eq!(boot.time, seconds(10.0));
    feed(&mut node, velocity(11.25));
    let handled = feed(&mut node, sample(10.75, Reading::Heading { heading_rad: 0.6 }));
    assert_eq!(observations(&handled.published)[0].time, seconds(10.5));
    // The journal keeps what was read.
    let Some(Record::Sample(kept)) = handled.journal.last() else { panic!("no sample") };
    assert_eq!(kept.time, seconds(10.75));
}

#[test]
fn a_clock_that_drifts_has_drifted_since_the_first_sample_where_stamps_are_unix_time() {
    // 500 ppm for 4000 s are 2 s. Since 1970 they would be a week.
    let mut node = node_with(&[(Effect::ClockDrift, &[500.0])], |_| {});
    let began_s = 1_248_272_000.0;
    let boots_at = |said: Vec<Entry>| {
        let boot = said.iter().find_map(|entry| match &entry.body {
            Body::Boot(boot) => Some(boot.time),
            _ => None,
        });
        boot.expect("a boot").seconds_since(seconds(began_s))
    };
    let first_s = boots_at(feed(&mut node, velocity(began_s)).published);
    assert!(first_s.abs() < 1e-6, "{first_s}");
    // After so long a gap the robot boots anew.
    let second_s = boots_at(feed(&mut node, velocity(began_s + 4000.0)).published);
    assert!((second_s - 3998.0).abs() < 0.01, "{second_s}");
}

#[test]
fn biases_are_taken_out_once_by_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let biased = NominalRobot { range_bias_m: 0.2, gyro_bias_rad_s: 0.05, ..robot(&[]) };
    let mut config = agent(1);
    config.model = Some(written(folder.path(), &model(&biased)));
    (config.sensors.range_bias_m, config.motion.gyro_bias_rad_s) = (0.2, 0.05);
    config.motion.yaw_source = YawName::Gyro;
    let mut node = node_of(&config, 1);
    for tick in 0..=10 {
        feed(&mut node, sample(f64::from(tick) * 0.1, Reading::Gyro { yaw_rate_rad_s: 0.45 }));
        feed(&mut node, velocity(f64::from(tick) * 0.1));
    }
    assert_pose(&reckoned(&mut node), &circle(start(), 0.8, 0.4, 1.0), 1e-9);
    let reading = Relative::Range { range_m: 3.2 };
    let fact = fact_of(&mut node, sighting(0.5, Target::Landmark(LandmarkId(7)), reading));
    let Quantity::Landmark { relative: Relative::Range { range_m }, .. } = fact.quantity else {
        panic!("{fact:?}")
    };
    assert!((range_m - 3.0).abs() < 1e-12, "{range_m}");
}

#[test]
fn what_is_refused_without_a_model_is_refused_with_it_and_leaves_no_trace() {
    let effects: [(Effect, &[f64]); 2] = [(Effect::WheelRadiusError, &[0.02]), (Effect::RangeBias, &[0.5])];
    let mut clean = node_with(&effects, |_| {});
    let mut disturbed = node_with(&effects, |_| {});
    for tick in 0..=20 {
        let time_s = f64::from(tick) * 0.1;
        let good = wheels(time_s, time_s, 1.5 * time_s);
        feed(&mut clean, good);
        feed(&mut disturbed, good);
        for bad in [
            wheels(time_s + 0.05, f64::NAN, 0.0),
            wheels(time_s - 0.05, 0.0, 0.0),
            velocity(time_s + 0.05),
            sample(time_s, Reading::Gyro { yaw_rate_rad_s: f64::INFINITY }),
            sample(time_s, Reading::Gps { x_m: f64::NAN, y_m: 0.0 }),
            // Nearer than its bias: no range is left.
            sighting(time_s, Target::Landmark(LandmarkId(7)), Relative::Range { range_m: 0.4 }),
        ] {
            assert!(feed(&mut disturbed, bad).published.is_empty(), "{bad:?}");
        }
    }
    assert_eq!(held(&disturbed), held(&clean));
    assert_eq!(disturbed.settled(), clean.settled());
    assert_eq!(disturbed.status().samples.refused, 21 * 6);
}

/// Effects that remember (servo, delay), that look at the heading and the place, and that move stamps.
const MANY: &[(Effect, &[f64])] = &[
    (Effect::ActuatorLag, &[0.2]),
    (Effect::CommandDelay, &[0.13]),
    (Effect::WorldDrift, &[0.02, -0.01]),
    (Effect::ClockDrift, &[500.0]),
    (Effect::GpsLeverArm, &[0.2, -0.1]),
    (Effect::CameraLatency, &[0.05]),
    (Effect::SensorLeverArm, &[0.1, 0.0]),
    (Effect::CompassHardIron, &[0.05, 0.02]),
];

fn modelled(mut configs: BTreeMap<RobotId, AgentConfig>, model: &Nominal) -> BTreeMap<RobotId, AgentConfig> {
    // Kept until the process ends: nodes are recovered again and again.
    let folder = tempfile::tempdir().unwrap().keep();
    let path = written(&folder, model);
    for config in configs.values_mut() {
        config.model = Some(path.clone());
        config.motion.velocity = VelocityName::Commanded;
    }
    configs
}

#[test]
fn a_recovered_node_with_a_model_knows_what_the_killed_one_knew() {
    let mut world = world(9, 3, 4.0);
    world.configs = modelled(world.configs, &model(&robot(MANY)));
    let mut net = Net::new(&world.configs, 9);
    net.live(&world.samples);
    net.settle();
    for (robot, node) in &mut net.nodes {
        let records = net.journals[robot].iter().flatten().cloned();
        let mut again = Node::recover(world.configs[robot].node().unwrap(), 5, records);
        let (before, after) = (node.status(), again.status());
        assert_eq!((before.estimate, before.logs), (after.estimate, after.logs));
        assert_eq!(node.settled(), again.settled());
        assert_eq!(node.distance_m().to_bits(), again.distance_m().to_bits());
    }
}

#[test]
fn killed_after_any_frame_a_modelled_robot_does_not_contradict_itself() {
    let (seed, victim) = (7, RobotId(1));
    let mut world = world(seed, 2, 2.0);
    world.configs = modelled(world.configs, &model(&robot(MANY)));
    let live = |crash| {
        let mut net = Net::new(&world.configs, seed);
        net.crash = crash;
        net.live(&world.samples);
        let settled = net.settle();
        let fold = world.configs[&victim].node().unwrap().fold;
        assert_eq!(folded(net.said.values(), fold).fingerprint(), settled, "{crash:?}");
        assert!(net.nodes.values().all(|node| node.ledger().quarantined().is_empty()));
        net
    };
    let frames = live(None).journals[&victim].len();
    for cut in 1..frames {
        live(Some(Crash { robot: victim, frames: cut, silent: cut % 2 == 0 }));
    }
}

/// Observations with their nominal states do not depend on what the network did, though the effects look
/// at the estimated pose and the estimate depends on what has arrived.
#[test]
fn corrected_readings_do_not_depend_on_what_arrives_from_peers() {
    let mut world = world(4, 3, 6.0);
    world.configs = modelled(world.configs, &model(&robot(MANY)));
    let said = |seed: u64, lost: f64| {
        let mut net = Net::new(&world.configs, seed);
        (net.lost, net.repeated) = (lost, lost);
        net.live(&world.samples);
        net.settle();
        let mut facts = BTreeMap::<RobotId, Vec<Observation>>::new();
        for entry in net.said.values() {
            if let Body::Observation(observation) = entry.body {
                facts.entry(entry.id.robot).or_default().push(observation);
            }
        }
        facts
    };
    let calm = said(1, 0.0);
    assert!(calm.values().map(Vec::len).sum::<usize>() > 40);
    assert_eq!(said(2, 0.3), calm);
    // The effects really look at the pose: without the drift, which is in the map, the facts are others.
    world.configs = modelled(world.configs, &model(&robot(&MANY[..2])));
    let mut net = Net::new(&world.configs, 1);
    net.live(&world.samples);
    assert!(net.said.values().all(|entry| match entry.body {
        Body::Observation(observation) if observation.time > seconds(1.0) => {
            !calm[&entry.id.robot].contains(&observation)
        }
        _ => true,
    }));
}
