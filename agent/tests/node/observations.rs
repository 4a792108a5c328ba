//! When an observation becomes a fact, and which never do.

use pleiad_agent::{Event, Node, Notice, SampleRefusal};
use pleiad_estimation::fact::{Absolute, NoiseRef, Quantity};
use pleiad_estimation::motion::OdometryRefusal;
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{LandmarkId, Pose2, RobotId};

use crate::support::{
    agent, assert_pose, drive, feed, gps, handle, node, node_of, observations, on_circle, sample, seconds,
    sees, sighting, start, velocity,
};

fn driving() -> Node {
    let mut node = node(1);
    drive(&mut node, 10.0, 11.0, 0.1);
    node
}

fn samples(node: &mut Node) -> (u64, u64) {
    let counts = node.status().samples;
    (counts.accepted, counts.refused)
}

#[test]
fn an_observation_within_the_odometry_is_a_fact_at_once_at_the_interpolated_pose() {
    let mut node = driving();
    let [fact] = observations(&feed(&mut node, gps(10.537)).published)[..] else { panic!("no fact") };
    assert_eq!(fact.time, seconds(10.537));
    assert_eq!(fact.quantity, Quantity::Absolute(Absolute::Position([1.5, 2.5])));
    assert_eq!(fact.noise, NoiseRef::Profile(5));
    assert_pose(&fact.observer.nominal, &on_circle(start(), 0.537), 1e-12);
}

#[test]
fn an_observation_at_the_very_first_odometry_is_a_fact() {
    let mut node = driving();
    let [fact] = observations(&feed(&mut node, gps(10.0)).published)[..] else { panic!("no fact") };
    assert_eq!(fact.observer.nominal, start());
    assert_eq!(fact.observer.noise_sum, Symmetric3::zero());
}

#[test]
fn an_observation_ahead_of_the_odometry_waits_until_it_is_reached() {
    let mut node = driving();
    assert!(feed(&mut node, gps(11.25)).published.is_empty());
    assert!(feed(&mut node, velocity(11.2)).published.is_empty());
    let [fact] = observations(&feed(&mut node, velocity(11.3)).published)[..] else { panic!("no fact") };
    assert_pose(&fact.observer.nominal, &on_circle(start(), 1.25), 1e-12);
}

#[test]
fn observations_that_waited_become_facts_in_the_order_of_their_stamps() {
    let mut node = driving();
    for time in [11.08, 11.02, 11.05, 11.02] {
        feed(&mut node, gps(time));
    }
    let facts = observations(&feed(&mut node, velocity(11.1)).published);
    let times: Vec<_> = facts.iter().map(|fact| fact.time).collect();
    assert_eq!(times, [11.02, 11.02, 11.05, 11.08].map(seconds));
}

#[test]
fn an_observation_before_the_first_odometry_is_refused_as_soon_as_that_is_known() {
    let mut node = node(1);
    assert!(feed(&mut node, gps(9.9)).notices.is_empty());
    let handled = feed(&mut node, velocity(10.0));
    let refusal = SampleRefusal::BeforeBoot { time: seconds(9.9) };
    assert_eq!(handled.notices, [Notice::SampleRefused(refusal)]);
    assert_eq!(samples(&mut node), (1, 1));
}

#[test]
fn refused_samples_leave_no_trace_and_are_counted_by_reason() {
    let nan = f64::NAN;
    let landmark = |number| Target::Landmark(LandmarkId(number));
    let robot = |number| Target::Robot(RobotId(number));
    let time = seconds(10.5);
    let bad = SampleRefusal::BadValue { time };
    let not_finite = SampleRefusal::Odometry(OdometryRefusal::NotFinite { time: seconds(11.1) });
    let out_of_order =
        |t| SampleRefusal::Odometry(OdometryRefusal::OutOfOrder { time: seconds(t), last: seconds(11.0) });
    let seen = |target, relative| sighting(10.5, target, relative);
    let odometry =
        |forward_m_s, yaw_rate_rad_s| sample(11.1, Reading::Velocity { forward_m_s, yaw_rate_rad_s });
    let range = |range_m| Relative::Range { range_m };
    let table: Vec<(Sample, SampleRefusal)> = vec![
        (velocity(11.0), out_of_order(11.0)),
        (velocity(10.95), out_of_order(10.95)),
        (velocity(-3.0), out_of_order(-3.0)),
        (odometry(nan, 0.0), not_finite),
        (odometry(0.0, f64::INFINITY), not_finite),
        (
            sample(11.1, Reading::Wheels { left_rad: 0.0, right_rad: 0.0 }),
            SampleRefusal::Odometry(OdometryRefusal::KindChanged { time: seconds(11.1) }),
        ),
        (sample(10.5, Reading::Gyro { yaw_rate_rad_s: nan }), bad),
        (sample(10.5, Reading::Gps { x_m: nan, y_m: 0.0 }), bad),
        (sample(10.5, Reading::Heading { heading_rad: f64::NEG_INFINITY }), bad),
        (seen(robot(2), Relative::Pose(Pose2::new(0.0, nan, 0.0))), bad),
        (seen(robot(2), Relative::Position { x_m: 0.0, y_m: nan }), bad),
        (seen(robot(2), Relative::Bearing { bearing_rad: nan }), bad),
        (seen(robot(2), range(0.0)), bad),
        (seen(robot(2), range(-1.0)), bad),
        (seen(robot(2), Relative::RangeBearing { range_m: -1.0, bearing_rad: 0.0 }), bad),
        (seen(landmark(8), range(1.0)), SampleRefusal::UnknownLandmark(LandmarkId(8))),
        (seen(landmark(7), Relative::Pose(Pose2::identity())), SampleRefusal::LandmarkPose(LandmarkId(7))),
        (seen(robot(1), range(1.0)), SampleRefusal::Itself(RobotId(1))),
        (gps(9.0), SampleRefusal::BeforeBoot { time: seconds(9.0) }),
    ];
    for (sample, expected) in table {
        let mut node = driving();
        let before = (node.status(), node.estimate());
        let handled = feed(&mut node, sample);
        assert_eq!(handled.notices, [Notice::SampleRefused(expected)], "{sample:?}");
        assert!(handled.published.is_empty() && handled.journal.is_empty(), "{sample:?}");
        let after = (node.status(), node.estimate());
        assert_eq!(after.0.samples.refused, before.0.samples.refused + 1);
        assert_eq!(after.0.samples.accepted, before.0.samples.accepted);
        assert_eq!((after.0.logs, after.0.estimate, after.1), (before.0.logs, before.0.estimate, before.1));
        assert_eq!(node.refusals().map(|(_, count)| count).sum::<u64>(), 1);
    }
}

#[test]
fn a_kind_without_noise_is_refused_with_the_key_to_add() {
    let every = [
        (Reading::Gps { x_m: 0.0, y_m: 0.0 }, "gps"),
        (Reading::Heading { heading_rad: 0.0 }, "heading"),
        (sees(0.0, 2).reading, "relative_pose"),
    ];
    let seen = [
        (Relative::Position { x_m: 1.0, y_m: 1.0 }, "relative_position"),
        (Relative::Range { range_m: 1.0 }, "range"),
        (Relative::Bearing { bearing_rad: 1.0 }, "bearing"),
        (Relative::RangeBearing { range_m: 1.0, bearing_rad: 1.0 }, "range_bearing"),
    ];
    let target = Target::Landmark(LandmarkId(7));
    let seen = seen.map(|(relative, kind)| (Reading::Sighting { target, relative }, kind));
    for (reading, kind) in every.into_iter().chain(seen) {
        let mut config = agent(1);
        config.sensors = pleiad_agent::config::SensorsSection::default();
        let mut node = node_of(&config, 1);
        drive(&mut node, 10.0, 11.0, 0.1);
        let handled = feed(&mut node, sample(10.5, reading));
        assert_eq!(handled.notices, [Notice::SampleRefused(SampleRefusal::NoNoise { kind })]);
        assert!(handled.notices[0].to_string().contains(&format!("[sensors.{kind}]")));
        assert!(handled.published.is_empty());
    }
}

#[test]
fn wheel_angles_without_geometry_begin_no_boot() {
    let mut node = node(1);
    let handled = feed(&mut node, sample(10.0, Reading::Wheels { left_rad: 0.0, right_rad: 0.0 }));
    let refusal = SampleRefusal::Odometry(OdometryRefusal::NoGeometry);
    assert_eq!(handled.notices, [Notice::SampleRefused(refusal)]);
    assert!(handled.published.is_empty());
    assert_eq!(node.status().logs, []);
}

#[test]
fn an_observation_older_than_the_kept_trajectory_is_refused() {
    let mut config = agent(1);
    config.motion.history_samples = 4;
    let mut node = node_of(&config, 1);
    drive(&mut node, 10.0, 11.0, 0.1);
    let handled = feed(&mut node, gps(10.55));
    let refusal = SampleRefusal::TooOld { time: seconds(10.55) };
    assert_eq!(handled.notices, [Notice::SampleRefused(refusal)]);
    assert_eq!(observations(&feed(&mut node, gps(10.75)).published).len(), 1);
}

#[test]
fn only_the_first_refusal_of_a_reason_is_a_notice() {
    let mut node = driving();
    assert_eq!(feed(&mut node, velocity(10.0)).notices.len(), 1);
    assert_eq!(feed(&mut node, velocity(10.1)).notices.len(), 0);
    assert_eq!(feed(&mut node, gps(9.0)).notices.len(), 1);
    assert_eq!(samples(&mut node), (11, 3));
    let reasons: Vec<(String, u64)> = node.refusals().map(|(reason, n)| (reason.to_owned(), n)).collect();
    assert_eq!(reasons, [("BeforeBoot".to_owned(), 1), ("Odometry".to_owned(), 2)]);
}

#[test]
fn what_still_waits_when_the_input_ends_is_refused() {
    let mut node = driving();
    feed(&mut node, gps(11.5));
    assert_eq!(samples(&mut node), (12, 0));
    let handled = handle(&mut node, Event::InputEnded);
    let refusal = SampleRefusal::AfterLastOdometry { time: seconds(11.5) };
    assert_eq!(handled.notices, [Notice::SampleRefused(refusal)]);
    assert_eq!(samples(&mut node), (11, 1));
    // What comes later was never accepted.
    feed(&mut node, gps(11.6));
    assert_eq!(samples(&mut node), (11, 2));
    assert!(node.drained());
}

#[test]
fn a_known_range_bias_is_subtracted_from_ranges_and_from_nothing_else() {
    let mut config = agent(1);
    config.sensors.range_bias_m = 0.25;
    let read_and_said = [
        (Relative::Range { range_m: 2.0 }, Relative::Range { range_m: 1.75 }),
        (
            Relative::RangeBearing { range_m: 2.0, bearing_rad: 0.5 },
            Relative::RangeBearing { range_m: 1.75, bearing_rad: 0.5 },
        ),
        (Relative::Position { x_m: 2.0, y_m: 0.5 }, Relative::Position { x_m: 2.0, y_m: 0.5 }),
        (Relative::Bearing { bearing_rad: 0.5 }, Relative::Bearing { bearing_rad: 0.5 }),
    ];
    for (read, said) in read_and_said {
        let mut node = node_of(&config, 1);
        drive(&mut node, 10.0, 11.0, 0.1);
        let handled = feed(&mut node, sighting(10.5, Target::Robot(RobotId(2)), read));
        let [fact] = observations(&handled.published)[..] else { panic!("no fact") };
        assert_eq!(fact.quantity, Quantity::Robot { robot: RobotId(2), relative: said });
    }
}
