//! A silence of the odometry longer than `motion.longest_gap_s` begins a continued boot: the pose is carried
//! on, and the unseen motion enters as the squared motion limits times the gap.

use pleiad_agent::{Event, Node, Notice};
use pleiad_estimation::fact::{
    Answer, Body, Boot, Continuation, Entry, EntryId, Half, NominalState, Quantity,
};
use pleiad_estimation::reference::{ErrorForm, JointEkf, facts_from_entries};
use pleiad_estimation::sample::{Reading, Relative, Target};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, Pose2, RobotId};

use crate::support::{
    agent, assert_pose, drive, entry, feed, gps, handle, held, id, node, node_of, on_circle, sample, seconds,
    sighting, standing_log, start, velocity,
};

const SPEED_M_S: f64 = 0.9;
const YAW_RATE_RAD_S: f64 = 1.2;

fn limited() -> Node {
    let mut config = agent(1);
    config.motion.speed_limit_m_s = SPEED_M_S;
    config.motion.yaw_rate_limit_rad_s = YAW_RATE_RAD_S;
    config.motion.longest_gap_s = 0.5;
    node_of(&config, 1)
}

fn boots(node: &Node) -> Vec<(BootIndex, Boot)> {
    let boot = |entry: &Entry| match entry.body {
        Body::Boot(boot) => Some((entry.id.boot, boot)),
        _ => None,
    };
    held(node).iter().filter_map(boot).collect()
}

/// `diag(L^2)` of a gap, with L the limits times its length.
fn unseen(gap_s: f64) -> [f64; 3] {
    [SPEED_M_S * gap_s, SPEED_M_S * gap_s, YAW_RATE_RAD_S * gap_s].map(|limit| limit * limit)
}

fn assert_close(found: Symmetric3, expected: Symmetric3, tolerance: f64) {
    let apart = found.minus(expected);
    assert!(apart.0.iter().all(|entry| entry.abs() < tolerance), "found {found:?}, expected {expected:?}");
}

#[test]
fn the_longest_gap_is_still_no_gap() {
    let mut node = limited();
    drive(&mut node, 10.0, 11.0, 0.5);
    assert_eq!(boots(&node).len(), 1);
    assert_pose(&node.estimate().unwrap().odom_from_robot, &on_circle(start(), 1.0), 1e-12);
}

#[test]
fn a_longer_gap_begins_a_continued_boot_where_the_last_one_ended() {
    let mut node = limited();
    drive(&mut node, 10.0, 11.0, 0.1);
    let handled = feed(&mut node, velocity(13.0));
    let (from, to) = (seconds(11.0), seconds(13.0));
    assert_eq!(handled.notices, [Notice::OdometryGap { from, to, boot: BootIndex(1) }]);
    let [_, (index, boot)] = boots(&node)[..] else { panic!("{:?}", boots(&node)) };
    assert_eq!((index, boot.time), (BootIndex(1), seconds(13.0)));
    let Some(Continuation { previous, time, last, gap }) = boot.continuation else {
        panic!("no continuation")
    };
    assert_eq!((previous, time), (BootIndex(0), seconds(11.0)));
    assert_pose(&last.nominal, &on_circle(start(), 1.0), 1e-12);
    assert!((last.noise_sum.0[5] - 1e-4).abs() < 1e-15, "yaw noise of a second");
    // `odom` stays continuous.
    assert_eq!(boot.nominal, last.nominal);
    let [x, y, yaw] = unseen(2.0);
    assert_close(gap, Symmetric3::diagonal(x, y, yaw), 1e-15);
    // No second prior: the robot has its place.
    assert!(!handled.published.iter().any(|entry| matches!(entry.body, Body::Observation(_))));
}

#[test]
fn the_covariance_grows_by_the_unseen_motion_and_the_pose_stays() {
    let mut node = limited();
    drive(&mut node, 10.0, 11.0, 0.1);
    // A fact after which process noise is partly folded, partly still to come.
    feed(&mut node, gps(10.63));
    let before = node.estimate().unwrap();
    let after = feed(&mut node, velocity(13.0)).estimates.pop().unwrap();
    assert_eq!((after.boot, after.time), (BootIndex(1), seconds(13.0)));
    assert_pose(&after.map_from_robot, &before.map_from_robot, 1e-13);
    // In body axes; equal in x and y, so that turning them into the map changes nothing.
    let [x, y, yaw] = unseen(2.0);
    assert_close(after.covariance.minus(before.covariance), Symmetric3::diagonal(x, y, yaw), 1e-12);
}

#[test]
fn dead_reckoning_goes_on_after_a_gap_without_the_gap() {
    let mut node = limited();
    drive(&mut node, 10.0, 11.0, 0.1);
    drive(&mut node, 15.0, 16.0, 0.1);
    let estimate = node.estimate().unwrap();
    assert_pose(&estimate.odom_from_robot, &on_circle(start(), 2.0), 1e-12);
    assert!((node.distance_m() - 1.6).abs() < 1e-12);
}

#[test]
fn every_gap_is_a_boot_of_its_own() {
    let mut node = limited();
    for time in [10.0, 11.0, 12.0, 12.1, 20.0] {
        feed(&mut node, velocity(time));
    }
    let found: Vec<_> = boots(&node).iter().map(|(index, boot)| (index.0, boot.time)).collect();
    assert_eq!(found, [(0, 10.0), (1, 11.0), (2, 12.0), (3, 20.0)].map(|(index, t)| (index, seconds(t))));
    let previous: Vec<_> =
        boots(&node).iter().filter_map(|(_, boot)| boot.continuation.map(|c| c.previous.0)).collect();
    assert_eq!(previous, [0, 1, 2]);
    // 1 s, 1 s and 7.9 s of unseen motion, whose variances add.
    let yaw: f64 = [1.0, 1.0, 7.9].map(|gap_s| unseen(gap_s)[2]).iter().sum();
    let driven = 0.1;
    let expected = 0.05f64.powi(2) + 1e-4 * driven + yaw;
    assert!((node.estimate().unwrap().covariance.0[5] - expected).abs() < 1e-12);
}

#[test]
fn a_gap_of_a_robot_without_a_place_leaves_it_without_one() {
    let mut config = agent(1);
    config.prior = None;
    let mut node = node_of(&config, 1);
    feed(&mut node, velocity(10.0));
    let handled = feed(&mut node, velocity(20.0));
    assert!(handled.estimates.is_empty());
    assert_eq!(node.estimate(), None);
    assert_pose(&boots(&node)[1].1.nominal, &Pose2::identity(), 1e-15);
}

#[test]
fn cross_terms_survive_a_gap_as_in_the_reference_filter() {
    let mut node = node(1);
    drive(&mut node, 0.0, 1.0, 0.1);
    // Robot 2 stands at the origin: both see each other, then robot 1 is lost for five seconds.
    let entries = standing_log(2, node.config().fold, &[(0.55, 1)]);
    handle(&mut node, Event::Entries(entries));
    let origin = Relative::Pose(on_circle(start(), 0.93).inverse());
    feed(&mut node, sighting(0.93, Target::Robot(RobotId(2)), origin));
    let half = Half { observation: observation_of(&node, 2), answer: standing() };
    handle(&mut node, Event::Entries(vec![entry(id(2, 0, 3), Body::Half(half))]));
    drive(&mut node, 6.0, 7.0, 0.1);
    // At the last odometry, so that the reference filter's last event is where the estimate is.
    let place = on_circle(start(), 2.0);
    feed(&mut node, sample(7.0, Reading::Gps { x_m: place.x_m() + 0.3, y_m: place.y_m() - 0.2 }));
    let status = node.status();
    assert_eq!((status.facts.relative, status.facts.absolute, status.facts.used), (2, 1, 3));

    let reference = JointEkf::new(ErrorForm::Invariant).fold(&facts_from_entries(&held(&node)));
    let robot = *reference.robot(RobotId(1)).expect("placed");
    assert_eq!(robot.boot, BootIndex(1));
    let estimate = node.estimate().unwrap();
    assert_pose(&estimate.map_from_robot, &robot.pose(), 1e-9);
    let block = |a: u32, b: u32| reference.covariance.block(RobotId(a), RobotId(b)).expect("placed");
    let map = robot.pose().additive_from_invariant();
    assert_close(estimate.covariance, Symmetric3::from_lower(&(map * block(1, 1) * map.transpose())), 1e-9);
    let joint = node.ledger().joint();
    let (one, two) = (joint.index(RobotId(1)).unwrap(), joint.index(RobotId(2)).unwrap());
    let cross = joint.covariance().block(one, two);
    assert!((cross - block(1, 2)).norm() < 1e-9, "{cross}");
    assert!(cross.norm() > 1e-5, "what was learned before the gap still ties the two together: {cross}");
}

/// The identity of robot 1's only observation of a robot.
fn observation_of(node: &Node, robot: u32) -> EntryId {
    let names = |entry: &&Entry| match entry.body {
        Body::Observation(fact) => {
            matches!(fact.quantity, Quantity::Robot { robot: RobotId(b), .. } if b == robot)
        }
        _ => false,
    };
    held(node).iter().find(names).expect("an observation").id
}

fn standing() -> Answer {
    let state = NominalState::new(Pose2::identity(), Symmetric3::zero());
    Answer::State { boot: BootIndex(0), state }
}
