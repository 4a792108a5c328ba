//! The algebra of the map against central differences, a dense filter written apart, and closed forms.

use nalgebra::{DMatrix, DVector};

use super::*;
use crate::fact::Noise;
use crate::geometry::{Vector2, Vector3};
use crate::joint::ErrorForm;
use crate::sample::Relative;
use crate::strategy::Noises;
use crate::symmetric::Symmetric3;
use crate::{LandmarkId, Pose2, Timestamp};

const FORMS: [ErrorForm; 2] = [ErrorForm::Invariant, ErrorForm::Additive];
const OPEN: [f64; 3] = [f64::INFINITY; 3];

fn noises() -> Noises {
    Noises {
        range_bearing: Some(Noise::from_sigmas(&[0.1, 0.02])),
        bearing: Some(Noise::from_sigmas(&[0.02])),
        ..Noises::default()
    }
}

fn range_bearing(from: &Pose2, point: Vector2) -> Relative {
    let seen = from.inverse().act(point);
    Relative::RangeBearing { range_m: seen.norm(), bearing_rad: seen.y.atan2(seen.x) }
}

fn bearing(from: &Pose2, point: Vector2) -> Relative {
    let seen = from.inverse().act(point);
    Relative::Bearing { bearing_rad: seen.y.atan2(seen.x) }
}

/// A repeatable number in -1..1.
fn noise(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
}

#[test]
fn new_landmarks_have_the_derivatives_of_central_differences() {
    let (a, b, point) = (Pose2::new(3.0, -2.0, 0.4), Pose2::new(7.0, 1.0, 2.0), Vector2::new(9.0, 6.0));
    let rb = Noise::from_sigmas(&[0.1, 0.02]);
    let one = Noise::from_sigmas(&[0.02]);
    let single = |a: &Pose2| {
        from_one(&Sight {
            observer: *a,
            relative: range_bearing(&Pose2::new(3.0, -2.0, 0.4), point),
            noise: rb,
        })
        .unwrap()
    };
    let (first, second) = (bearing(&a, point), bearing(&b, point));
    let pair = |a: &Pose2, b: &Pose2| {
        let first = Sight { observer: *a, relative: first, noise: one };
        let second = Sight { observer: *b, relative: second, noise: one };
        from_bearings([&first, &second]).unwrap()
    };
    assert!((single(&a).point - point).norm() < 1e-12 && (pair(&a, &b).point - point).norm() < 1e-9);
    let h = 1e-6;
    for axis in 0..3 {
        let mut step = Vector3::zeros();
        step[axis] = h;
        let moved = |pose: &Pose2, sign: f64| Pose2::exp(step * sign).compose(pose);
        let of_one = (single(&moved(&a, 1.0)).point - single(&moved(&a, -1.0)).point) / (2.0 * h);
        let by_a = (pair(&moved(&a, 1.0), &b).point - pair(&moved(&a, -1.0), &b).point) / (2.0 * h);
        let by_b = (pair(&a, &moved(&b, 1.0)).point - pair(&a, &moved(&b, -1.0)).point) / (2.0 * h);
        let expected = pair(&a, &b).d_point_d_observer;
        assert!((of_one - single(&a).d_point_d_observer[0].column(axis)).norm() < 1e-6);
        assert!((by_a - expected[0].column(axis)).norm() < 1e-6, "axis {axis}");
        assert!((by_b - expected[1].column(axis)).norm() < 1e-6, "axis {axis}");
    }
    let sum = pair(&a, &b).d_point_d_observer[0] + pair(&a, &b).d_point_d_observer[1];
    let common = nalgebra::Matrix2x3::new(1.0, 0.0, -point.y, 0.0, 1.0, point.x);
    assert!((sum - common).norm() < 1e-12, "a common error moves the point with its observers");
}

#[test]
fn the_noise_of_a_new_landmark_is_that_of_its_polar_coordinates() {
    // Range along the line of sight, distance times bearing across it; at 30 degrees.
    let turned = Pose2::new(1.0, 2.0, std::f64::consts::FRAC_PI_6);
    let sight = Sight {
        observer: turned,
        relative: Relative::RangeBearing { range_m: 5.0, bearing_rad: 0.0 },
        noise: Noise::from_sigmas(&[0.1, 0.02]),
    };
    let covariance = from_one(&sight).unwrap().covariance;
    let (c, s) = (0.75f64.sqrt(), 0.5);
    let turn = nalgebra::Matrix2::new(c, -s, s, c);
    let expected = turn * nalgebra::Matrix2::new(0.01, 0.0, 0.0, 0.01) * turn.transpose();
    assert!((covariance - expected).norm() < 1e-12, "{covariance}");
}

#[test]
fn parallel_bearings_and_bearings_that_meet_behind_make_no_landmark() {
    let sight = |x: f64, bearing_rad: f64| Sight {
        observer: Pose2::new(x, 0.0, 0.0),
        relative: Relative::Bearing { bearing_rad },
        noise: Noise::from_sigmas(&[0.02]),
    };
    assert!(from_bearings([&sight(0.0, 1.0), &sight(1.0, 1.0)]).is_err());
    assert!(from_bearings([&sight(0.0, 1.5), &sight(1.0, 1.0)]).is_err(), "they meet behind");
    assert!(from_bearings([&sight(0.0, 1.0), &sight(1.0, 1.5)]).is_ok());
}

/// A state with a vehicle that has moved and three landmarks, one of them founded from two past poses.
fn state(form: ErrorForm) -> (SlamState, Vec<Block>) {
    let noises = noises();
    let (rb, one) = (noises.range_bearing.unwrap(), noises.bearing.unwrap());
    let mut state =
        SlamState::new(form, Pose2::new(2.0, 1.0, 0.3), Symmetric3([0.04, 0.01, 0.05, 0.002, 0.001, 0.01]));
    let mut blocks = Vec::new();
    for point in [Vector2::new(6.0, 2.0), Vector2::new(4.0, 5.0)] {
        let relative = range_bearing(&state.vehicle(), point);
        let landmark = from_one(&Sight { observer: state.vehicle(), relative, noise: rb }).unwrap();
        blocks.push(state.insert(&landmark, [SlamState::VEHICLE; 2]));
    }
    let past = state.keep_pose();
    for _ in 0..5 {
        state.propagate(&Vector3::new(0.6, 0.02, 0.1), Symmetric3::diagonal(1e-3, 1e-4, 4e-4));
    }
    let point = Vector2::new(8.0, 8.0);
    let sight = |observer: Pose2| Sight { observer, relative: bearing(&observer, point), noise: one };
    let landmark = from_bearings([&sight(state.place(past)), &sight(state.vehicle())]).unwrap();
    blocks.push(state.insert(&landmark, [past, SlamState::VEHICLE]));
    state.remove(past);
    (state, blocks)
}

/// Position covariance of the vehicle and the landmarks, dense.
fn published(state: &SlamState, blocks: &[Block]) -> DMatrix<f64> {
    let all: Vec<Block> = std::iter::once(SlamState::VEHICLE).chain(blocks.iter().copied()).collect();
    state.map_covariance(&all)
}

#[test]
fn both_forms_agree_before_the_first_update() {
    // Founding and moving are linear in the error: without an update the forms differ by coordinates alone.
    let (invariant, blocks) = state(ErrorForm::Invariant);
    let (additive, others) = state(ErrorForm::Additive);
    let difference = published(&invariant, &blocks) - published(&additive, &others);
    assert!(difference.amax() < 1e-12, "{difference}");
    let between = invariant.vehicle_covariance().minus(additive.vehicle_covariance());
    assert!(between.0.iter().all(|entry| entry.abs() < 1e-12));
}

#[test]
fn an_update_is_that_of_a_dense_kalman_filter() {
    for form in FORMS {
        let (mut state, blocks) = state(form);
        let rows: Vec<Block> = std::iter::once(SlamState::VEHICLE).chain(blocks.iter().copied()).collect();
        let dense = |state: &SlamState| {
            let mut p = DMatrix::zeros(3 * rows.len(), 3 * rows.len());
            for (i, a) in rows.iter().enumerate() {
                for (j, b) in rows.iter().enumerate() {
                    p.view_mut((3 * i, 3 * j), (3, 3)).copy_from(&state.error_covariance(*a, *b));
                }
            }
            p
        };
        // H by central differences of what would be measured, each block moved by its error.
        let predict = |errors: &DVector<f64>| {
            let moved = |index: usize| {
                let e = errors.fixed_rows::<3>(3 * index).into_owned();
                let place = state.place(rows[index]);
                match form {
                    ErrorForm::Invariant => Pose2::exp(e).compose(&place),
                    ErrorForm::Additive => {
                        Pose2::new(place.x_m() + e.x, place.y_m() + e.y, place.yaw_rad() + e.z)
                    }
                }
            };
            let Relative::RangeBearing { range_m, bearing_rad } =
                range_bearing(&moved(0), moved(2).position())
            else {
                unreachable!()
            };
            DVector::from_vec(vec![range_m, bearing_rad])
        };
        let size = 3 * rows.len();
        let mut h = DMatrix::zeros(2, size);
        for column in 0..size {
            let mut step = DVector::zeros(size);
            step[column] = 1e-6;
            h.set_column(column, &((predict(&step) - predict(&-step)) / 2e-6));
        }
        let expected_z = predict(&DVector::zeros(size));
        let innovation = DVector::from_vec(vec![0.15, -0.03]);
        let relative = Relative::RangeBearing {
            range_m: expected_z[0] + innovation[0],
            bearing_rad: expected_z[1] + innovation[1],
        };
        let p = dense(&state);
        let r = DMatrix::from_diagonal(&DVector::from_vec(vec![0.01, 0.0004]));
        let s = &h * &p * h.transpose() + r;
        let inverse = s.cholesky().unwrap().inverse();
        let gain = &p * h.transpose() * &inverse;
        let (delta, after) = (&gain * &innovation, &p - &gain * &h * &p);
        let nis = (innovation.transpose() * inverse * &innovation)[(0, 0)];
        let before: Vec<Pose2> = rows.iter().map(|block| state.place(*block)).collect();
        let predicted = state
            .innovation(SlamState::VEHICLE, rows[2], &relative, &noises().range_bearing.unwrap())
            .unwrap();
        assert!((predicted.nis - nis).abs() < 1e-6 * nis);
        state
            .update(SlamState::VEHICLE, rows[2], &relative, &noises().range_bearing.unwrap(), &OPEN)
            .unwrap();
        assert!((dense(&state) - after).amax() < 1e-8, "{form:?}");
        for (index, before) in before.iter().enumerate() {
            let e = delta.fixed_rows::<3>(3 * index).into_owned();
            let expected = match form {
                ErrorForm::Invariant => Pose2::exp(e).compose(before),
                ErrorForm::Additive => {
                    Pose2::new(before.x_m() + e.x, before.y_m() + e.y, before.yaw_rad() + e.z)
                }
            };
            assert!(expected.between(&state.place(rows[index])).log().norm() < 1e-7, "{form:?} {index}");
        }
    }
}

/// A vehicle that stands still and sees a landmark, with noise, again and again.
fn parked(form: ErrorForm) -> (Symmetric3, Symmetric3, SlamState, Block) {
    let rb = noises().range_bearing.unwrap();
    let prior = Symmetric3::diagonal(0.04, 0.04, 0.03);
    let mut state = SlamState::new(form, Pose2::new(2.0, 1.0, 0.3), prior);
    let before = state.vehicle_covariance();
    let point = Vector2::new(12.0, 4.0);
    let mut random = 5;
    let mut see = |state: &SlamState| match range_bearing(&state.vehicle(), point) {
        Relative::RangeBearing { range_m, bearing_rad } => Relative::RangeBearing {
            range_m: range_m + 0.17 * noise(&mut random),
            bearing_rad: bearing_rad + 0.035 * noise(&mut random),
        },
        other => other,
    };
    let relative = see(&state);
    let landmark = from_one(&Sight { observer: state.vehicle(), relative, noise: rb }).unwrap();
    let block = state.insert(&landmark, [SlamState::VEHICLE; 2]);
    for _ in 0..500 {
        // What the true vehicle sees; it is where it was told.
        let from = Pose2::new(2.0, 1.0, 0.3);
        let Relative::RangeBearing { range_m, bearing_rad } = range_bearing(&from, point) else {
            unreachable!()
        };
        let relative = Relative::RangeBearing {
            range_m: range_m + 0.17 * noise(&mut random),
            bearing_rad: bearing_rad + 0.035 * noise(&mut random),
        };
        state.update(SlamState::VEHICLE, block, &relative, &rb, &OPEN).unwrap();
    }
    (before, state.vehicle_covariance(), state, block)
}

#[test]
fn a_parked_vehicle_learns_nothing_of_itself_from_new_landmarks_unless_the_error_is_additive() {
    // Julier and Uhlmann 2001: the additive filter grows sure of a heading that nobody measured.
    let (before, after, state, block) = parked(ErrorForm::Invariant);
    assert!(before.minus(after).0.iter().all(|change| change.abs() < 1e-10), "{before:?} {after:?}");
    // What is left of the landmark is the vehicle's covariance carried to it, and R/501.
    let lever = state.place(block).position() - state.vehicle().position();
    let m = nalgebra::Matrix2x3::new(1.0, 0.0, -lever.y, 0.0, 1.0, lever.x);
    let limit = m * before.to_matrix() * m.transpose();
    let left = state.position_covariance(block, block) - limit;
    assert!(left.symmetric_eigenvalues().min() > 0.0);
    assert!(left.symmetric_eigenvalues().max() < 1.2 * (10.44f64 * 0.02).powi(2) / 501.0, "{left}");
    let (before, after, ..) = parked(ErrorForm::Additive);
    assert!(after.0[5] < 0.95 * before.0[5], "heading variance {} before, {} after", before.0[5], after.0[5]);
}

#[test]
fn a_pose_that_is_kept_is_the_vehicle_and_one_that_is_removed_leaves_no_trace() {
    for form in FORMS {
        let (mut state, blocks) = state(form);
        let before = published(&state, &blocks);
        let past = state.keep_pose();
        assert_eq!(
            state.error_covariance(past, past),
            state.error_covariance(SlamState::VEHICLE, SlamState::VEHICLE)
        );
        assert_eq!(
            state.error_covariance(past, blocks[1]),
            state.error_covariance(SlamState::VEHICLE, blocks[1])
        );
        state.remove(past);
        assert_eq!(published(&state, &blocks), before);
        let again = state.insert_known(Vector2::new(1.0, 1.0));
        assert_eq!(again, past, "its place is used again");
        assert!(state.position_covariance(again, again).norm() == 0.0);
    }
}

fn drive(slam: &mut Slam, truth: &mut Pose2, motion: Vector3) {
    *truth = truth.compose(&Pose2::exp(motion));
    slam.propagate(&motion, Symmetric3::diagonal(1e-6, 1e-8, 1e-7));
}

#[test]
fn a_landmark_of_bearings_is_founded_once_they_cross_and_not_before() {
    for form in FORMS {
        let mut truth = Pose2::identity();
        let mut slam =
            Slam::new(SlamSettings::new(form, noises()), truth, Symmetric3::diagonal(1e-4, 1e-4, 1e-5));
        let point = Vector2::new(6.0, 8.0);
        let (mut random, mut founded_at) = (3, None);
        for k in 0..40 {
            let Relative::Bearing { bearing_rad } = bearing(&truth, point) else { unreachable!() };
            let relative = Relative::Bearing { bearing_rad: bearing_rad + 0.03 * noise(&mut random) };
            let time = Timestamp::from_seconds(f64::from(k));
            let outcome = slam.scan(time, &[(LandmarkId(7), relative)]).unwrap()[0];
            if let Outcome::Founded { .. } = outcome {
                founded_at = Some(truth);
            }
            drive(&mut slam, &mut truth, Vector3::new(0.3, 0.0, 0.0));
        }
        let at = founded_at.expect("founded");
        // Both directions of sight, from the start and from here, differ by the parallax asked for at least.
        let angle = |from: Vector2| (point - from).y.atan2((point - from).x);
        assert!((angle(at.position()) - angle(Vector2::zeros())).abs() > 0.15, "{at:?}");
        let entry = slam.map()[0];
        let error = slam.position(&entry) - point;
        let covariance = slam.state().position_covariance(entry.block, entry.block);
        let nees = (error.transpose() * covariance.cholesky().unwrap().solve(&error))[(0, 0)];
        assert!(nees < 13.8, "{form:?} {nees}");
        assert!(error.norm() < 0.3, "{error}");
        assert_eq!(slam.waiting_poses(), 0, "no pose is kept for nothing");
    }
}

#[test]
fn bearings_straight_ahead_never_make_a_landmark_and_the_poses_kept_are_bounded() {
    let mut truth = Pose2::identity();
    let settings = SlamSettings::new(ErrorForm::Invariant, noises());
    let mut slam = Slam::new(settings, truth, Symmetric3::diagonal(1e-4, 1e-4, 1e-5));
    for k in 0..200 {
        let relative = Relative::Bearing { bearing_rad: 0.0 };
        let outcome = slam.scan(Timestamp::from_seconds(f64::from(k)), &[(LandmarkId(1), relative)]).unwrap();
        assert_eq!(outcome, [Outcome::Waiting]);
        assert!(slam.waiting_poses() <= settings.delayed.most_poses);
        drive(&mut slam, &mut truth, Vector3::new(0.3, 0.0, 0.0));
    }
}

#[test]
fn sightings_without_names_find_their_landmarks_and_a_passing_ghost_is_forgotten() {
    let mut truth = Pose2::identity();
    let settings = SlamSettings {
        association: Association::Nearest,
        ..SlamSettings::new(ErrorForm::Invariant, noises())
    };
    let mut slam = Slam::new(settings, truth, Symmetric3::diagonal(1e-4, 1e-4, 1e-5));
    let points = [Vector2::new(6.0, 3.0), Vector2::new(7.0, -3.0), Vector2::new(9.0, 1.0)];
    for k in 0..30 {
        let mut scan: Vec<_> = points.iter().map(|p| (LandmarkId(0), range_bearing(&truth, *p))).collect();
        if k == 3 {
            scan.push((LandmarkId(0), Relative::RangeBearing { range_m: 3.0, bearing_rad: 1.5 }));
        }
        let outcomes = slam.scan(Timestamp::from_seconds(f64::from(k)), &scan).unwrap();
        for (index, outcome) in outcomes.iter().enumerate() {
            let expected = MapId(u32::try_from(index).unwrap());
            match outcome {
                Outcome::Founded { landmark } => assert!(k == 0 || (k == 3 && index == 3), "{landmark:?}"),
                Outcome::Used { landmark, .. } => assert_eq!(*landmark, expected),
                other => panic!("{other:?}"),
            }
        }
        drive(&mut slam, &mut truth, Vector3::new(0.1, 0.0, 0.02));
    }
    assert_eq!(slam.map().len(), 3, "the ghost is gone");
    assert!(slam.map().iter().all(|entry| entry.confirmed));
}

#[test]
fn known_landmarks_stay_where_they_are() {
    let mut slam = Slam::new(
        SlamSettings::new(ErrorForm::Invariant, noises()),
        Pose2::new(0.1, 0.0, 0.0),
        Symmetric3::diagonal(0.04, 0.04, 0.01),
    );
    let point = Vector2::new(5.0, 2.0);
    slam.know(LandmarkId(1), point, Timestamp(0));
    for k in 0..20 {
        let seen = range_bearing(&Pose2::identity(), point);
        slam.scan(Timestamp::from_seconds(f64::from(k)), &[(LandmarkId(1), seen)]).unwrap();
    }
    assert_eq!(slam.position(&slam.map()[0]), point);
    assert!(slam.state().vehicle_covariance().0[0] < 0.04);
}
