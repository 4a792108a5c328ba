//! Decisions that wait for later sightings, against nearest neighbour, on places and errors chosen by hand.

use super::*;
use crate::fact::Noise;
use crate::geometry::{Vector2, Vector3};
use crate::joint::ErrorForm;
use crate::sample::{Relative, SampleRefusal};
use crate::strategy::Noises;
use crate::symmetric::Symmetric3;
use crate::{LandmarkId, Pose2, Timestamp};

fn settings() -> SlamSettings {
    let noises = Noises { range_bearing: Some(Noise::from_sigmas(&[0.1, 0.02])), ..Noises::default() };
    SlamSettings { association: Association::Joint, ..SlamSettings::new(ErrorForm::Invariant, noises) }
}

fn seen(from: &Pose2, point: Vector2) -> (LandmarkId, Relative) {
    let seen = from.inverse().act(point);
    (LandmarkId(0), Relative::RangeBearing { range_m: seen.norm(), bearing_rad: seen.y.atan2(seen.x) })
}

/// Where the vehicle begins, known well.
fn start() -> (Slam, JointSlam) {
    let noise = Symmetric3::diagonal(1e-4, 1e-4, 1e-6);
    let one = Slam::new(settings(), Pose2::identity(), noise);
    (one, JointSlam::new(settings(), JointRules::default(), Pose2::identity(), noise))
}

#[test]
fn a_look_alike_that_deceives_nearest_neighbour_is_found_out_by_what_is_seen_later() {
    // The first two differ by 0.4 rad as seen from the start. The vehicle turns by 0.4 rad more than its wheels say, which
    // have a standard deviation of 0.15 rad: the first then appears where the second should be. The third comes later.
    let at = |angle: f64, range: f64| Vector2::new(range * angle.cos(), range * angle.sin());
    let points = [at(0.2, 6.0), at(-0.2, 6.0), at(1.0, 5.0)];
    let (mut nearest, mut joint) = start();
    for k in 0..6 {
        let scan: Vec<_> = points.iter().map(|point| seen(&Pose2::identity(), *point)).collect();
        nearest.scan(Timestamp::from_seconds(f64::from(k)), &scan).unwrap();
        joint.scan(Timestamp::from_seconds(f64::from(k)), &scan).unwrap();
    }
    assert_eq!((nearest.map().len(), joint.best().map().len()), (3, 3));
    let turned = Pose2::new(0.0, 0.0, 0.4);
    let noise = Symmetric3::diagonal(1e-6, 1e-6, 0.15 * 0.15);
    nearest.propagate(&Vector3::zeros(), noise);
    joint.propagate(&Vector3::zeros(), noise);
    let second = |outcome: &Outcome| matches!(outcome, Outcome::Used { landmark: MapId(1), .. });
    let first = |outcome: &Outcome| matches!(outcome, Outcome::Used { landmark: MapId(0), .. });
    let alone = [seen(&turned, points[0])];
    assert!(second(&nearest.scan(Timestamp::from_seconds(10.0), &alone).unwrap()[0]));
    assert!(second(&joint.scan(Timestamp::from_seconds(10.0), &alone).unwrap()[0]), "as yet");
    assert!(joint.maps() > 1, "but not for sure");
    for k in 0..3 {
        let scan = [seen(&turned, points[2])];
        nearest.scan(Timestamp::from_seconds(11.0 + f64::from(k)), &scan).unwrap();
        joint.scan(Timestamp::from_seconds(11.0 + f64::from(k)), &scan).unwrap();
    }
    assert!((nearest.state().vehicle().yaw_rad() - 0.4).abs() > 0.3, "deceived");
    assert_eq!(nearest.map().len(), 4, "and the third landmark is there twice");
    assert!((joint.best().state().vehicle().yaw_rad() - 0.4).abs() < 0.02);
    assert_eq!(joint.best().map().len(), 3);
    let outcomes = joint.outcomes();
    assert_eq!(outcomes.len(), 6 * 3 + 1 + 3);
    assert!(first(&outcomes[18]), "taken back: {:?}", outcomes[18]);
}

#[test]
fn where_nothing_is_in_doubt_joint_and_nearest_agree_and_a_passing_ghost_is_forgotten() {
    let points = [Vector2::new(6.0, 3.0), Vector2::new(7.0, -3.0), Vector2::new(9.0, 1.0)];
    let (mut nearest, mut joint) = start();
    let mut truth = Pose2::identity();
    for k in 0..30 {
        let mut scan: Vec<_> = points.iter().map(|point| seen(&truth, *point)).collect();
        if k == 3 {
            scan.push((LandmarkId(0), Relative::RangeBearing { range_m: 3.0, bearing_rad: 1.5 }));
        }
        nearest.scan(Timestamp::from_seconds(f64::from(k)), &scan).unwrap();
        joint.scan(Timestamp::from_seconds(f64::from(k)), &scan).unwrap();
        assert!(joint.maps() <= JointRules::default().most);
        let motion = Vector3::new(0.1, 0.0, 0.02);
        truth = truth.compose(&Pose2::exp(motion));
        nearest.propagate(&motion, Symmetric3::diagonal(1e-6, 1e-8, 1e-7));
        joint.propagate(&motion, Symmetric3::diagonal(1e-6, 1e-8, 1e-7));
    }
    assert_eq!((nearest.map().len(), joint.best().map().len()), (3, 3));
    for (one, other) in nearest.map().iter().zip(joint.best().map()) {
        assert!((nearest.position(one) - joint.best().position(other)).norm() < 1e-9);
    }
    assert!(truth.between(&joint.best().state().vehicle()).log().norm() < 0.02);
}

#[test]
fn a_bearing_alone_is_unusable_and_a_kind_without_noise_is_refused_before_anything_changes() {
    let (_, mut joint) = start();
    let bearing = [(LandmarkId(0), Relative::Bearing { bearing_rad: 0.1 })];
    let refused = joint.scan(Timestamp(0), &bearing);
    assert!(matches!(refused, Err(SampleRefusal::NoNoise { .. })), "{refused:?}");
    assert!(joint.outcomes().is_empty());
    let mut settings = settings();
    settings.noises.bearing = Some(Noise::from_sigmas(&[0.02]));
    let noise = Symmetric3::diagonal(1e-4, 1e-4, 1e-6);
    let mut joint = JointSlam::new(settings, JointRules::default(), Pose2::identity(), noise);
    assert_eq!(joint.scan(Timestamp(0), &bearing), Ok(vec![Outcome::Unusable]));
    assert_eq!(joint.maps(), 1);
}
