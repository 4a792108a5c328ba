//! Against the normal distribution of all residuals at once, written out: what the noise and the unknown beginnings make
//! of them, as one dense covariance.

use nalgebra::{DMatrix, DVector};
use pleiad_physics::Pose;

use super::*;
use crate::diagnosis::mesh::{Of, carried, gradient};

/// Scales: moves forward, left, yaw of both robots; headings; ranges; bearings.
const SCALES: [f64; 6] = [0.03, 0.02, 0.05, 0.01, 0.04, 0.02];

fn number(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
}

/// Two robots on arcs; each sees a landmark and the other, one has a compass. One is lost once.
fn mesh() -> (Mesh, usize) {
    let mut events = Vec::new();
    let mut poses = [Pose::new(1.0, 0.5, 0.3), Pose::new(-1.0, 2.0, -1.2)];
    let (mut element, mut reads) = (0, 0);
    for step in 0..6 {
        for (robot, pose) in poses.iter_mut().enumerate() {
            if step == 3 && robot == 1 {
                events.push(Event::Lost(STATES));
            }
            let measured = Pose::new(0.2, 0.01, 0.15);
            let start = *pose;
            let end = start.compose(&measured);
            let middle = start.yaw_rad + 0.5 * measured.yaw_rad;
            let (sin, cos) = (middle.sin(), middle.cos());
            let into = [[-cos, sin, -end.y_m], [-sin, -cos, end.x_m], [0.0, 0.0, -1.0]];
            let (at, span_s) = (STATES * robot, 0.5 + 0.1 * f64::from(step));
            events.push(Event::Move(Move {
                at,
                element,
                into,
                start,
                measured,
                span_s,
                scale: 0,
                until_s: 0.0,
            }));
            element += STATES;
            *pose = end;
        }
        let mut read = |scale, of, own, is_robot, other| {
            events.push(Event::Read(Read { element, of, is_robot, scale, own, other }));
            element += 1;
            reads += 1;
        };
        read(3, Of::Heading, (0, [0.0, 0.0, 1.0]), false, (0, [0.0; 3]));
        for robot in 0..2 {
            let (own, other) = (poses[robot], poses[1 - robot]);
            for (is_bearing, is_robot) in [(false, false), (true, false), (false, true), (true, true)] {
                let target = if is_robot { other.position() } else { [3.0, -0.5] };
                let (towards, turning) = gradient(is_bearing, &own, target);
                let weights = carried(towards.map(|value| -value), turning, &own);
                let there = if is_robot { carried(towards, 0.0, &other) } else { [0.0; 3] };
                let of = if is_bearing { Of::Bearing } else { Of::Range }(own, target);
                let scale = if is_bearing { 5 } else { 4 };
                read(scale, of, (STATES * robot, weights), is_robot, (STATES * (1 - robot), there));
            }
        }
    }
    let prior = poses.map(|_| [[0.3, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.1]]).to_vec();
    (Mesh { size: 6, prior, events, reads }, element)
}

/// What the residuals of moves and the independent causes make of the states and readings: the matrix of the readings
/// by moves' residuals, and the covariance of what is left.
fn dense(mesh: &Mesh, elements: usize) -> Dense {
    let lost = 3 * mesh.events.iter().filter(|event| matches!(event, Event::Lost(_))).count();
    let moves = mesh.events.iter().filter(|event| matches!(event, Event::Move(_))).count();
    let causes = mesh.size + lost + STATES * moves;
    let mut states_by_cause = DMatrix::zeros(mesh.size, causes);
    let mut states_by_element = DMatrix::zeros(mesh.size, elements);
    let mut variance = DVector::zeros(causes);
    for robot in 0..2 {
        for offset in 0..STATES {
            let state = STATES * robot + offset;
            states_by_cause[(state, state)] = 1.0;
            variance[state] = mesh.prior[robot][offset][offset];
        }
    }
    let mut cause = mesh.size;
    let (mut by_element, mut by_cause) =
        (DMatrix::zeros(mesh.reads, elements), DMatrix::zeros(mesh.reads, causes));
    let (mut noise, mut order) = (DVector::zeros(mesh.reads), Vec::new());
    for event in &mesh.events {
        match event {
            Event::Lost(at) => {
                for (offset, value) in Mesh::lost().into_iter().enumerate() {
                    states_by_cause[(at + offset, cause)] = 1.0;
                    variance[cause] = value;
                    cause += 1;
                }
            }
            Event::Move(own) => {
                for component in 0..STATES {
                    for row in 0..STATES {
                        let value = own.into[row][component];
                        states_by_element[(own.at + row, own.element + component)] = value;
                        states_by_cause[(own.at + row, cause)] = value;
                    }
                    variance[cause] = SCALES[own.scale + component].powi(2) * own.span_s;
                    cause += 1;
                }
            }
            Event::Read(own) => {
                let reading = order.len();
                let mut weights = DMatrix::zeros(1, mesh.size);
                for (at, part) in [own.own, own.other] {
                    for (offset, value) in part.into_iter().enumerate() {
                        weights[(0, at + offset)] += value;
                    }
                }
                by_element.row_mut(reading).copy_from(&(&weights * &states_by_element));
                by_cause.row_mut(reading).copy_from(&(&weights * &states_by_cause));
                noise[reading] = SCALES[own.scale].powi(2);
                order.push(own.element);
            }
        }
    }
    let covariance =
        &by_cause * DMatrix::from_diagonal(&variance) * by_cause.transpose() + DMatrix::from_diagonal(&noise);
    let ends = &states_by_cause * DMatrix::from_diagonal(&variance) * by_cause.transpose();
    Dense { by_element, covariance, order, states_by_element, ends }
}

/// What readings and states are made of.
struct Dense {
    /// Readings by the residuals of moves.
    by_element: DMatrix<f64>,
    /// Of the readings.
    covariance: DMatrix<f64>,
    /// The element of each reading.
    order: Vec<usize>,
    /// States at the end by the residuals of moves.
    states_by_element: DMatrix<f64>,
    /// Covariance of the states at the end with the readings.
    ends: DMatrix<f64>,
}

/// One lane.
fn whitened(filter: &Filter, mesh: &Mesh, residuals: &[f64]) -> Vec<f64> {
    let mut values: Vec<[f64; 1]> = residuals.iter().map(|value| [*value]).collect();
    filter.whiten(mesh, &mut values);
    values.into_iter().map(|[value]| value).collect()
}

fn residuals(elements: usize, size: f64) -> Vec<f64> {
    let mut state = 7;
    (0..elements).map(|_| size * number(&mut state)).collect()
}

/// What the readings are off by once moves are taken for as they were measured.
fn left(mesh: &Mesh, residuals: &[f64]) -> (DVector<f64>, Dense) {
    let dense = dense(mesh, residuals.len());
    let own =
        DVector::from_iterator(dense.order.len(), dense.order.iter().map(|&element| residuals[element]));
    (own - &dense.by_element * DVector::from_column_slice(residuals), dense)
}

#[test]
fn innovations_have_the_likelihood_of_the_whole_with_the_unknown_integrated_out() {
    let (mesh, elements) = mesh();
    let residuals = residuals(elements, 0.1);
    let (left, Dense { covariance, .. }) = left(&mesh, &residuals);
    let factor = covariance.cholesky().unwrap();
    let expected_log: f64 = 2.0 * factor.l().diagonal().iter().map(|value| value.ln()).sum::<f64>();
    let expected = left.dot(&factor.solve(&left));

    let filter = Filter::new(&mesh, &SCALES, vec![1.0; mesh.reads]);
    let whitened = whitened(&filter, &mesh, &residuals);
    let log: f64 = -2.0 * filter.roots.iter().map(|root| root.ln()).sum::<f64>();
    let square: f64 = whitened.iter().map(|value| value * value).sum();
    assert!((log - expected_log).abs() < 1e-8 * expected_log.abs(), "{log} {expected_log}");
    assert!((square - expected).abs() < 1e-8 * expected, "{square} {expected}");
}

#[test]
fn lanes_are_what_each_is_alone() {
    let (mesh, elements) = mesh();
    let filter = Filter::new(&mesh, &SCALES, vec![1.0; mesh.reads]);
    let columns: Vec<Vec<f64>> = (0..LANES).map(|lane| residuals(elements, 0.1 + lane as f64)).collect();
    let mut together: Vec<[f64; LANES]> =
        (0..elements).map(|element| std::array::from_fn(|lane| columns[lane][element])).collect();
    filter.whiten(&mesh, &mut together);
    for (lane, column) in columns.into_iter().enumerate() {
        let alone = whitened(&filter, &mesh, &column);
        for (value, together) in alone.iter().zip(&together) {
            assert!((value - together[lane]).abs() < 1e-9 * (1.0 + value.abs()));
        }
    }
}

#[test]
fn small_residuals_are_linear_and_large_ones_are_not() {
    let (mesh, elements) = mesh();
    let filter = Filter::new(&mesh, &SCALES, vec![1.0; mesh.reads]);
    let apart = |size: f64| {
        let mut exact = residuals(elements, size);
        let linear = whitened(&filter, &mesh, &exact);
        filter.innovate(&mesh, &mut exact);
        exact.iter().zip(&linear).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let (small, tenfold) = (apart(1e-4), apart(1e-3));
    // What is neglected is of second order.
    assert!(small > 0.0 && (50.0..200.0).contains(&(tenfold / small)), "{small} {tenfold}");
}

#[test]
fn references_begin_and_end_where_the_whole_says() {
    let (mesh, elements) = mesh();
    let residuals = residuals(elements, 0.1);
    let (left, Dense { covariance, states_by_element, ends, .. }) = left(&mesh, &residuals);
    // The beginning given everything: its covariance with the readings, through their inverse.
    let mut begun: DMatrix<f64> = DMatrix::zeros(mesh.reads, mesh.size);
    let mut reading = 0;
    for event in &mesh.events {
        let Event::Read(own) = event else { continue };
        for (at, part) in [own.own, own.other] {
            for (offset, value) in part.into_iter().enumerate() {
                let state = at + offset;
                begun[(reading, state)] += value * mesh.prior[state / STATES][state % STATES][state % STATES];
            }
        }
        reading += 1;
    }
    let solved = covariance.cholesky().unwrap().solve(&left);
    let expected = begun.transpose() * &solved;
    let expected_end = states_by_element * DVector::from_column_slice(&residuals) + ends * solved;
    let filter = Filter::new(&mesh, &SCALES, vec![1.0; mesh.reads]);
    let found = filter.smoothed(&mesh, &SCALES, &residuals);
    for robot in 0..2 {
        assert_eq!(found[robot].len(), 7);
        for offset in 0..STATES {
            for (place, expected) in [(0, &expected), (6, &expected_end)] {
                let (value, wanted) = (found[robot][place][offset], expected[STATES * robot + offset]);
                assert!((value - wanted).abs() < 1e-8 * (1.0 + wanted.abs()), "{place}: {value} {wanted}");
            }
        }
    }
}

#[test]
fn noise_is_estimated_where_its_likelihood_is_greatest() {
    let (mesh, elements) = mesh();
    let residuals = residuals(elements, 0.12);
    let mut scales = SCALES.to_vec();
    let filter = Filter::estimated(&mesh, &mut scales, &residuals, &|_, _| true);
    assert!(filter.weights.iter().all(|weight| (*weight - 1.0).abs() < 1e-12), "none is wild");
    let cost = |scales: &[f64]| {
        let filter = Filter::new(&mesh, scales, vec![1.0; mesh.reads]);
        let whitened = whitened(&filter, &mesh, &residuals);
        let log: f64 = -filter.roots.iter().map(|root| root.ln()).sum::<f64>();
        log + 0.5 * whitened.iter().map(|value| value * value).sum::<f64>()
    };
    let least = cost(&scales);
    for scale in 0..scales.len() {
        for factor in [0.8, 1.25] {
            let mut other = scales.clone();
            other[scale] *= factor;
            assert!(cost(&other) > least - 0.05, "scale {scale} times {factor}: {} {least}", cost(&other));
        }
    }
    assert!(least < cost(&SCALES));
}
