use std::f64::consts::FRAC_PI_2;

use nalgebra::DMatrix;

use super::*;
use crate::fact::{
    Absolute, Answer, Body, Boot, Entry, EntryId, Half, Noise, NoiseRef, NominalState, Observation, Quantity,
};
use crate::geometry::Vector2;
use crate::reference::{ErrorForm, linearize};
use crate::sample::Relative;
use crate::symmetric::Symmetric3;
use crate::{BootIndex, Pose2, RobotId, Sequence, Timestamp};

fn team(robots: u32) -> Vec<RobotId> {
    (1..=robots).map(RobotId).collect()
}

/// `[I -I]` between two robots.
fn difference(a: usize, b: usize) -> MeasurementRow {
    let identity = DMatrix::identity(3, 3);
    MeasurementRow { blocks: vec![(a, identity.clone()), (b, -identity)] }
}

fn absolute(a: usize) -> MeasurementRow {
    MeasurementRow { blocks: vec![(a, DMatrix::identity(3, 3))] }
}

fn bounded(analysis: &Observability) -> Vec<(bool, bool)> {
    analysis.bounds.iter().map(|bounds| (bounds.position, bounds.heading)).collect()
}

const COMMON: [&str; 3] = ["common translation in x", "common translation in y", "common rotation"];

#[test]
fn three_robots_with_relative_measurements_have_rank_six_of_nine() {
    // Roumeliotis & Bekey 2002: Phi = I, so that H Phi, H Phi^2 add nothing.
    let rows = [difference(0, 1), difference(1, 2), difference(0, 2)];
    let steps = vec![rows.to_vec(); 3];
    let identity = DMatrix::identity(9, 9);
    let matrix = stack(9, &steps, &[identity.clone(), identity]);
    let analysis = Observability::of_matrix(&team(3), &Coordinates::Linear, &matrix, DEFAULT_TOLERANCE);
    assert_eq!((analysis.rank, analysis.states, analysis.null_space.ncols()), (6, 9, 3));
    assert_eq!(analysis.unobservable, COMMON);
    assert_eq!(bounded(&analysis), [(false, false); 3]);
    // Laplacian of a triangle: eigenvalues 0, 3, 3; three times over, thus singular value 3.
    for (index, value) in analysis.singular_values.iter().enumerate() {
        assert!((value - if index < 6 { 3.0 } else { 0.0 }).abs() < 1e-12);
    }
}

#[test]
fn one_absolute_measurement_on_one_robot_makes_it_nine_of_nine() {
    let rows = [difference(0, 1), difference(1, 2), absolute(2)];
    let analysis = Observability::of_rows(&team(3), &Coordinates::Linear, &rows);
    assert_eq!(analysis.rank, 9);
    assert!(analysis.unobservable.is_empty());
    assert_eq!(bounded(&analysis), [(true, true); 3]);
}

#[test]
fn motion_can_make_observable_what_one_measurement_does_not() {
    // A position and a velocity in x, of which the position is measured: rank 1 at once, 2 over two steps.
    let mut transition = DMatrix::identity(3, 3);
    transition[(0, 1)] = 0.1;
    let row = MeasurementRow { blocks: vec![(0, DMatrix::from_row_slice(1, 3, &[1.0, 0.0, 0.0]))] };
    let rank = |steps: usize| {
        let matrix = stack(3, &vec![vec![row.clone()]; steps], &vec![transition.clone(); steps]);
        Observability::of_matrix(&team(1), &Coordinates::Linear, &matrix, DEFAULT_TOLERANCE).rank
    };
    assert_eq!((rank(1), rank(2), rank(40)), (1, 2, 2));
}

#[test]
fn disconnected_teams_are_told_apart() {
    let rows = [difference(0, 1), difference(2, 3), absolute(0)];
    let analysis = Observability::of_rows(&team(5), &Coordinates::Linear, &rows);
    assert_eq!(analysis.rank, 9);
    assert_eq!(
        analysis.unobservable,
        [
            "common translation in x of robots 3, 4",
            "common translation in y of robots 3, 4",
            "common rotation of robots 3, 4",
            "position of robot 5",
            "heading of robot 5",
        ]
    );
    let (yes, no) = ((true, true), (false, false));
    assert_eq!(bounded(&analysis), [yes, yes, no, no, no]);
}

#[test]
fn without_measurements_every_robot_is_free() {
    let analysis = Observability::of_rows(&team(2), &Coordinates::Linear, &[]);
    assert_eq!(analysis.rank, 0);
    assert_eq!(
        analysis.unobservable,
        ["position of robot 1", "heading of robot 1", "position of robot 2", "heading of robot 2"]
    );
}

fn row(quantity: &Quantity, a: (usize, Pose2), b: Option<(usize, Pose2)>) -> MeasurementRow {
    let seen = b.as_ref().map(|(_, pose)| pose);
    let linearized = linearize(ErrorForm::Invariant, quantity, &a.1, seen).unwrap();
    let target = b.map(|(index, _)| index).zip(linearized.d_measurement_d_observed);
    MeasurementRow {
        blocks: std::iter::once((a.0, linearized.d_measurement_d_observer)).chain(target).collect(),
    }
}

fn sees(relative: Relative) -> Quantity {
    Quantity::Robot { robot: RobotId(2), relative }
}

fn analyse(poses: &[Pose2], rows: &[MeasurementRow]) -> Observability {
    let positions: Vec<Vector2> = poses.iter().map(Pose2::position).collect();
    Observability::of_rows(
        &team(u32::try_from(poses.len()).unwrap()),
        &Coordinates::Invariant(positions),
        rows,
    )
}

#[test]
fn a_robot_seen_once_but_not_seeing_keeps_its_heading_to_itself() {
    let (a, b) = (Pose2::new(40.0, -25.0, 0.3), Pose2::new(44.0, -22.0, 2.0));
    let position = sees(Relative::Position { x_m: 0.0, y_m: 0.0 });
    let analysis = analyse(&[a, b], &[row(&position, (0, a), Some((1, b)))]);
    assert_eq!(analysis.unobservable, [&COMMON[..], &["heading of robot 2"]].concat());
    let map = analyse(&[a, b], &[row(&position, (0, a), Some((1, b))), absolute(0)]);
    assert_eq!(map.unobservable, ["heading of robot 2"]);
    assert_eq!(bounded(&map), [(true, true), (true, false)]);
    // Seen from a second place, the heading follows from the direction of its own motion.
    let later = Pose2::new(46.0, -22.0, 2.0);
    let rows = [row(&position, (0, a), Some((1, b))), row(&position, (0, a), Some((1, later))), absolute(0)];
    assert!(analyse(&[a, later], &rows).unobservable.is_empty());
}

#[test]
fn a_single_range_leaves_both_headings_and_the_common_pose() {
    let (a, b) = (Pose2::new(1.0, 2.0, 0.3), Pose2::new(4.0, -2.0, 2.0));
    let analysis = analyse(&[a, b], &[row(&sees(Relative::Range { range_m: 5.0 }), (0, a), Some((1, b)))]);
    assert_eq!(analysis.rank, 1);
    assert_eq!(analysis.unobservable, [&COMMON[..], &["heading of robot 1", "heading of robot 2"]].concat());
}

#[test]
fn a_position_fix_of_one_robot_leaves_a_rotation_about_it() {
    let (a, b) = (Pose2::new(7.0, -3.0, 0.3), Pose2::new(11.0, 2.0, FRAC_PI_2));
    let fix = Quantity::Absolute(Absolute::Position([0.0, 0.0]));
    let rows = [row(&sees(Relative::Pose(Pose2::identity())), (0, a), Some((1, b))), row(&fix, (0, a), None)];
    let analysis = analyse(&[a, b], &rows);
    assert_eq!(analysis.unobservable, ["common rotation about (7.00, -3.00)"]);
    assert_eq!(bounded(&analysis), [(true, false), (false, false)]);
    // A compass on the other robot settles it.
    let compass = row(&Quantity::Absolute(Absolute::Heading(0.0)), (1, b), None);
    assert_eq!(analyse(&[a, b], &[rows[0].clone(), rows[1].clone(), compass]).rank, 6);
}

#[test]
fn a_compass_alone_leaves_the_position() {
    let a = Pose2::new(7.0, -3.0, 0.3);
    let analysis = analyse(&[a], &[row(&Quantity::Absolute(Absolute::Heading(0.0)), (0, a), None)]);
    assert_eq!(analysis.unobservable, ["position of robot 1"]);
    assert_eq!(bounded(&analysis), [(false, true)]);
}

#[test]
fn what_has_no_name_is_a_combination() {
    // Robot 1 is tied to x + y of itself only.
    let odd = MeasurementRow { blocks: vec![(0, DMatrix::from_row_slice(1, 3, &[1.0, 1.0, 0.0]))] };
    let heading = MeasurementRow { blocks: vec![(0, DMatrix::from_row_slice(1, 3, &[0.0, 0.0, 1.0]))] };
    let analysis = Observability::of_rows(&team(1), &Coordinates::Linear, &[odd, heading]);
    assert_eq!(analysis.unobservable, ["a combination of x of robot 1, y of robot 1"]);
}

/// Two robots in their logs: boots, priors, and one sighting per second for five seconds.
fn entries() -> Vec<Entry> {
    let mut entries = Vec::new();
    let mut push = |robot: u32, sequence: u64, body: Body| {
        let id = EntryId { robot: RobotId(robot), boot: BootIndex(0), sequence: Sequence(sequence) };
        entries.push(Entry { id, body, extension: Vec::new() });
        id
    };
    let state = |robot: u32, second: u32| {
        NominalState::new(
            Pose2::new(f64::from(second), 3.0 * f64::from(robot), 0.1 * f64::from(second * robot)),
            Symmetric3::zero(),
        )
    };
    let observation = |second: u32, quantity, noise: &[f64], observer| {
        Body::Observation(Observation {
            time: Timestamp::from_seconds(f64::from(second)),
            quantity,
            noise: NoiseRef::Explicit(Noise::from_sigmas(noise)),
            observer,
        })
    };
    for robot in [1, 2] {
        let start = state(robot, 0);
        let boot = Boot {
            time: Timestamp(0),
            nonce: 0,
            configuration: 0,
            nominal: start.nominal,
            continuation: None,
            calibration: None,
        };
        push(robot, 0, Body::Boot(boot));
        let prior = Quantity::Absolute(Absolute::Pose(start.nominal));
        push(robot, 1, observation(0, prior, &[0.1, 0.1, 0.1], start));
    }
    for second in 1..=5 {
        let seen = sees(Relative::RangeBearing { range_m: 3.0, bearing_rad: 1.5 });
        let id = push(1, 1 + u64::from(second), observation(second, seen, &[0.1, 0.1], state(1, second)));
        let answer = Answer::State { boot: BootIndex(0), state: state(2, second) };
        push(2, 1 + u64::from(second), Body::Half(Half { observation: id, answer }));
    }
    entries
}

#[test]
fn entries_are_analysed_without_their_priors() {
    let entries = entries();
    let as_is = |_, _, state: &NominalState| Some(state.nominal);
    let (robots, poses, rows) = rows_from(&entries, as_is);
    assert_eq!((robots, rows.len()), (team(2), 5));
    assert_eq!(poses[1].position(), Vector2::new(5.0, 6.0));
    let analysis = of_entries(&entries, as_is);
    assert_eq!((analysis.rank, analysis.states), (3, 6));
    assert_eq!(analysis.unobservable, COMMON);

    // A second absolute pose of robot 1 is a measurement.
    let mut fixed = entries.clone();
    let mut again = entries[1].clone();
    again.id.sequence = Sequence(20);
    if let Body::Observation(observation) = &mut again.body {
        observation.time = Timestamp::from_seconds(6.0);
    }
    fixed.push(again);
    assert_eq!(of_entries(&fixed, as_is).rank, 6);

    // Without poses there is nothing to linearize at.
    assert_eq!(of_entries(&entries, |_, _, _| None).states, 0);
}
