use super::birth::{around, seen};
use super::mixture::{Hypothesis, joint_at};
use super::reduction::reduce;
use super::*;
use crate::fact::{Noise, NominalState};
use crate::geometry::{Matrix3, Vector2, Vector3};
use crate::measurement::of_point;
use crate::sample::Relative;
use crate::symmetric::Symmetric3;
use crate::{LandmarkId, Pose2, Timestamp};

const START: NominalState =
    NominalState { nominal: Pose2::identity(), noise_sum: Symmetric3([0.0; 6]), sensitivity: None };

fn landmark(id: u32, kind: usize, x: f64, y: f64) -> MappedLandmark {
    MappedLandmark { id: LandmarkId(id), kind: KindOfLandmark(kind), position_m: Vector2::new(x, y) }
}

fn map(landmarks: &[MappedLandmark]) -> KindedMap {
    KindedMap { landmarks: landmarks.to_vec(), bounds_m: [-10.0, 10.0, -10.0, 10.0] }
}

fn sighting(seconds: f64, range_m: f64, bearing_rad: f64, recognition: &[f64]) -> Sighting<'_> {
    Sighting {
        time: Timestamp::from_seconds(seconds),
        observer: START,
        relative: Relative::RangeBearing { range_m, bearing_rad },
        noise: Noise::from_sigmas(&[0.1, 0.03]),
        recognition,
    }
}

#[test]
fn a_pose_around_a_landmark_sees_it_as_measured_and_so_does_every_turn_about_it() {
    let landmark = landmark(1, 0, 3.0, -2.0);
    let relative = Relative::RangeBearing { range_m: 4.0, bearing_rad: 0.7 };
    let seen = seen(&relative, &Noise::from_sigmas(&[0.1, 0.03])).unwrap();
    for index in 0..8 {
        let (pose, covariance) = around(&landmark, &seen, index, 8);
        for turn in [0.0, 0.1, -0.4] {
            let about = Vector3::new(landmark.position_m.y, -landmark.position_m.x, 1.0) * turn;
            let turned = Pose2::exp(about).compose(&pose);
            let innovation = of_point(&relative, &turned, landmark.position_m).unwrap().innovation;
            assert!(innovation.norm() < 1e-12, "{index} {turn}: {innovation}");
        }
        // What is left of the range and bearing is their noise: H P H^T = R, where H sees no turn about the landmark.
        let h = of_point(&relative, &pose, landmark.position_m).unwrap().jacobian;
        let predicted = h * covariance * h.transpose();
        let expected = Matrix3::from_diagonal(&Vector3::new(0.01, 0.0009, 0.0));
        assert!((predicted - expected).amax() < 1e-12, "{predicted}");
        assert!(Symmetric3::from_lower(&covariance).is_positive_semidefinite());
    }
}

#[test]
fn weights_of_two_look_alikes_are_the_ratio_of_their_densities() {
    // Told the origin within 0.2 m and 0 rad; landmarks of one kind ahead at 5 m and at 5.5 m; 5.1 m are measured.
    let near_and_far = map(&[landmark(1, 0, 5.0, 0.0), landmark(2, 0, 5.5, 0.0)]);
    let told = Matrix3::from_diagonal(&Vector3::new(0.04, 0.04, 1e-12));
    let settings = Settings { merge_below: 0.0, carried_off_hz: 0.0, ..Settings::default() };
    let mut localizer = Localizer::told(near_and_far, settings, &Pose2::identity(), &told, &START);
    localizer.sighted(&sighting(1.0, 5.1, 0.0, &[1.0])).unwrap();
    let weights: Vec<f64> = localizer.standings(&START).iter().map(|standing| standing.weight).collect();
    // Range: variance 0.04 + 0.01 for both. Bearing, innovation 0: variance 0.04 / l^2 + 0.0009.
    let density = |offset: f64, l: f64| {
        (-0.5 * offset * offset / 0.05_f64).exp() / (0.04 / (l * l) + 0.0009_f64).sqrt()
    };
    let (near, far) = (density(0.1, 5.0), density(0.4, 5.5));
    assert_eq!(weights.len(), 2);
    assert!((weights[0] - near / (near + far)).abs() < 1e-9, "{weights:?}");
}

#[test]
fn recognition_that_is_sure_leaves_the_landmarks_of_its_kind_alone() {
    let two_kinds = map(&[landmark(1, 0, 5.0, 0.0), landmark(2, 1, -5.0, 0.0)]);
    let mut localizer = Localizer::anywhere(two_kinds, Settings::default());
    assert_eq!(localizer.belief(&START), Belief::Anywhere);
    localizer.sighted(&sighting(1.0, 2.0, 0.0, &[0.0, 1.0])).unwrap();
    let standings = localizer.standings(&START);
    assert_eq!(standings.len(), Settings::default().headings);
    let left = Vector2::new(-5.0, 0.0);
    assert!(standings.iter().all(|standing| ((standing.pose.position() - left).norm() - 2.0).abs() < 1e-9));
    assert!((standings.iter().map(|standing| standing.weight).sum::<f64>() - 1.0).abs() < 1e-12);
}

#[test]
fn a_pose_outside_the_map_is_no_hypothesis() {
    let corner = map(&[landmark(1, 0, 10.0, 10.0)]);
    let mut localizer = Localizer::anywhere(corner, Settings::default());
    localizer.sighted(&sighting(1.0, 3.0, 0.2, &[1.0])).unwrap();
    let standings = localizer.standings(&START);
    // A quarter of the circle about a corner is inside.
    assert_eq!(standings.len(), Settings::default().headings / 4);
}

#[test]
fn merging_keeps_weight_mean_and_covariance() {
    // Turns alike: the invariant error of position is plain position, and moments are those of two Gaussians.
    let p = Matrix3::from_diagonal(&Vector3::new(0.04, 0.01, 1e-4));
    let at =
        |x: f64, weight: f64| Hypothesis { joint: joint_at(&Pose2::new(x, 0.0, 0.0), &p, &START, 0), weight };
    let mut both = vec![at(0.0, 0.75), at(0.1, 0.25), at(8.0, 1e-3)];
    reduce(&mut both, &Settings::default());
    assert_eq!(both.len(), 2);
    let member = *both[0].joint.member(super::birth::ROBOT).unwrap();
    assert!((member.correction.x_m() - 0.025).abs() < 1e-12);
    let variance = both[0].joint.covariance().entry(0, 0);
    // 0.04 + 0.75 * 0.25 * 0.1^2
    assert!((variance - 0.041_875).abs() < 1e-12, "{variance}");
    assert!((both[0].weight - 1.0 / 1.001).abs() < 1e-12);
}

#[test]
fn never_more_are_kept_than_allowed() {
    let landmarks: Vec<_> = (0..9).map(|k| landmark(k, 0, f64::from(k) - 4.0, 0.0)).collect();
    let settings = Settings { most: 20, ..Settings::default() };
    let mut localizer = Localizer::anywhere(map(&landmarks), settings);
    localizer.sighted(&sighting(1.0, 2.0, 0.0, &[1.0])).unwrap();
    assert_eq!((localizer.standings(&START).len(), localizer.most_so_far()), (20, 20));
}

#[test]
fn what_cannot_be_used_is_said_and_leaves_no_trace() {
    let mut localizer = Localizer::anywhere(map(&[landmark(1, 2, 0.0, 0.0)]), Settings::default());
    let time = Timestamp::from_seconds(1.0);
    let kinds = localizer.sighted(&sighting(1.0, 2.0, 0.0, &[0.5, 0.5]));
    assert_eq!(kinds, Err(HypothesisError::Kinds { time, found: 2, kind: 2 }));
    let recognition = [1.0; 3];
    let range =
        Sighting { relative: Relative::Range { range_m: 2.0 }, ..sighting(1.0, 2.0, 0.0, &recognition) };
    assert_eq!(localizer.sighted(&range), Err(HypothesisError::NoPosition { time }));
    let noise = Noise::from_sigmas(&[0.1, 0.0]);
    let exact = Sighting { noise, ..sighting(1.0, 2.0, 0.0, &recognition) };
    assert_eq!(localizer.sighted(&exact), Err(HypothesisError::Noise { time }));
    assert_eq!(localizer.belief(&START), Belief::Anywhere);
}
