//! Facts linearized together against the most probable trajectory, found by dense Gauss-Newton on all poses at once with
//! numeric derivatives.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]

mod support;

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use pleiad_estimation::fact::{NominalState, Quantity};
use pleiad_estimation::fold::{Fact, FoldConfig, Outcome, Relinearization};
use pleiad_estimation::geometry::wrap_angle;
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::sample::Relative;
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{Pose2, RobotId};
use support::{Kinds, Options, PRIOR_SIGMA_M, PRIOR_SIGMA_RAD, team};

/// Rows of a whitened residual.
type Whitened = Vec<f64>;

/// What is asked of the corrections `G`, one for every event of every robot.
enum Factor {
    /// `G = exp(xi) start`, the prior.
    Prior { node: usize, start: Pose2, root: Matrix3<f64> },
    /// `G_next = G_node exp(w)`.
    Walk { node: usize, next: usize, root: Matrix3<f64> },
    /// Range and bearing from one to the other.
    Sighting {
        observer: (usize, Pose2),
        other: (usize, Pose2),
        range_m: f64,
        bearing_rad: f64,
        sigmas: [f64; 2],
    },
}

impl Factor {
    fn whitened(&self, nodes: &[Pose2]) -> Whitened {
        match self {
            Self::Prior { node, start, root } => {
                (root * nodes[*node].compose(&start.inverse()).log()).iter().copied().collect()
            }
            Self::Walk { node, next, root } => {
                (root * nodes[*node].between(&nodes[*next]).log()).iter().copied().collect()
            }
            Self::Sighting { observer, other, range_m, bearing_rad, sigmas } => {
                let seen = nodes[observer.0].compose(&observer.1).between(&nodes[other.0].compose(&other.1));
                let (x, y) = (seen.x_m(), seen.y_m());
                let bearing = wrap_angle(bearing_rad - y.atan2(x));
                vec![(range_m - x.hypot(y)) / sigmas[0], bearing / sigmas[1]]
            }
        }
    }
}

/// `L^-1` of a covariance `L L^T`.
fn root(covariance: Matrix3<f64>) -> Matrix3<f64> {
    let covariance = covariance + Matrix3::identity() * 1e-10;
    let factor = covariance.cholesky().expect("positive definite").l();
    factor.solve_lower_triangular(&Matrix3::identity()).expect("positive definite")
}

struct Problem {
    nodes: Vec<Pose2>,
    factors: Vec<Factor>,
    /// Last node of each robot.
    last: BTreeMap<RobotId, usize>,
}

impl Problem {
    fn of(ledger: &Ledger) -> Self {
        let mut problem = Self { nodes: Vec::new(), factors: Vec::new(), last: BTreeMap::new() };
        let mut folded: BTreeMap<RobotId, Symmetric3> = BTreeMap::new();
        for (key, record) in ledger.facts() {
            let Fact::Observation { quantity, noise, observer, other } = &record.fact else { continue };
            let outcome = record.residual.expect("folded").outcome;
            if outcome == Outcome::Placed {
                let start = observer.nominal.compose(&observer.nominal.inverse());
                let adjoint = observer.nominal.adjoint();
                let spread = [PRIOR_SIGMA_M, PRIOR_SIGMA_M, PRIOR_SIGMA_RAD].map(|sigma| sigma * sigma);
                let covariance =
                    adjoint * Matrix3::from_diagonal(&Vector3::from(spread)) * adjoint.transpose();
                let node = problem.nodes.len();
                problem.nodes.push(start);
                problem.factors.push(Factor::Prior { node, start, root: root(covariance) });
                problem.last.insert(key.id.robot, node);
                folded.insert(key.id.robot, observer.noise_sum);
                continue;
            }
            assert_eq!(outcome, Outcome::Used, "the gate is open");
            let Quantity::Robot { robot, relative: Relative::RangeBearing { range_m, bearing_rad } } =
                *quantity
            else {
                panic!("only ranges and bearings: {quantity:?}")
            };
            let (_, half) = other.expect("two robots");
            let mut step = |robot: RobotId, state: &NominalState| {
                let (node, next) = (problem.last[&robot], problem.nodes.len());
                let grown = state.noise_sum.minus(folded[&robot]).to_matrix();
                problem.nodes.push(problem.nodes[node]);
                problem.factors.push(Factor::Walk { node, next, root: root(grown) });
                problem.last.insert(robot, next);
                folded.insert(robot, state.noise_sum);
                (next, state.nominal)
            };
            let (observer, other) = (step(key.id.robot, observer), step(robot, &half));
            let lower = noise.expect("declared").lower;
            let sigmas = [lower[0].sqrt(), lower[2].sqrt()];
            problem.factors.push(Factor::Sighting { observer, other, range_m, bearing_rad, sigmas });
        }
        problem
    }

    fn whitened(&self, nodes: &[Pose2]) -> DVector<f64> {
        DVector::from_vec(self.factors.iter().flat_map(|factor| factor.whitened(nodes)).collect())
    }

    fn moved(nodes: &[Pose2], step: &DVector<f64>) -> Vec<Pose2> {
        let turn = |(index, node): (usize, &Pose2)| {
            Pose2::exp(step.fixed_rows::<3>(3 * index).into_owned()).compose(node)
        };
        nodes.iter().enumerate().map(turn).collect()
    }

    /// The most probable corrections, and the covariance there.
    fn solved(&self) -> (Vec<Pose2>, DMatrix<f64>) {
        let mut nodes = self.nodes.clone();
        let size = 3 * nodes.len();
        let mut information = DMatrix::zeros(size, size);
        for _ in 0..12 {
            let here = self.whitened(&nodes);
            let mut jacobian = DMatrix::zeros(here.len(), size);
            for column in 0..size {
                let mut step = DVector::zeros(size);
                step[column] = 1e-6;
                let ahead = self.whitened(&Self::moved(&nodes, &step));
                step[column] = -1e-6;
                let behind = self.whitened(&Self::moved(&nodes, &step));
                jacobian.set_column(column, &((ahead - behind) / 2e-6));
            }
            information = jacobian.transpose() * &jacobian;
            let right = jacobian.transpose() * here;
            let step = information.clone().cholesky().expect("definite").solve(&right);
            nodes = Self::moved(&nodes, &-step);
        }
        (nodes, information.cholesky().expect("definite").inverse())
    }
}

fn ledger(seed: u64, relinearize: Option<Relinearization>) -> Ledger {
    let config = FoldConfig { gate: [f64::INFINITY; 3], relinearize, ..FoldConfig::default() };
    let options =
        Options { robots: 2, seconds: 8, kinds: Kinds::Relative, only: Some(4), spread_m: 4.0, config };
    let mut ledger = Ledger::new(config);
    for entry in team(seed, &options).entries {
        ledger.insert(entry);
    }
    ledger.settle();
    ledger
}

#[test]
fn one_block_in_many_passes_is_the_most_probable_trajectory() {
    let together = Relinearization { block_ns: i64::MAX, ahead_ns: 0, passes: 12, cell_ns: 0 };
    let (mut off, mut off_once) = (0.0_f64, 0.0_f64);
    for seed in 1..=20 {
        let (once, together) = (ledger(seed, None), ledger(seed, Some(together)));
        let problem = Problem::of(&together);
        let (nodes, covariance) = problem.solved();
        for (robot, node) in &problem.last {
            let sigma = covariance[(3 * node + 2, 3 * node + 2)].sqrt();
            let apart = |ledger: &Ledger| {
                let correction = ledger.joint().member(*robot).expect("placed").correction;
                let apart = nodes[*node].compose(&correction.inverse()).log();
                // In standard deviations.
                let block = covariance.fixed_view::<3, 3>(3 * node, 3 * node).into_owned();
                apart.dot(&block.cholesky().expect("definite").solve(&apart)).sqrt()
            };
            off = off.max(apart(&together));
            off_once = off_once.max(apart(&once));
            let stated = together.joint().covariance().block(
                together.joint().index(*robot).expect("placed"),
                together.joint().index(*robot).expect("placed"),
            );
            let ratio = stated[(2, 2)].sqrt() / sigma;
            assert!((ratio - 1.0).abs() < 0.01, "seed {seed}, robot {robot}: heading sigma off by {ratio}");
        }
    }
    // What is left is of second order in the noise between two events.
    assert!(off < 0.05, "{off} standard deviations from the most probable trajectory");
    assert!(off_once > 3.0 * off, "the filter that linearizes once is as near: {off_once} and {off}");
}

#[test]
fn with_one_pass_the_fold_is_the_filter() {
    let once = Relinearization { block_ns: 1_000_000_000, ahead_ns: 500_000_000, passes: 1, cell_ns: 0 };
    let (filter, together) = (ledger(7, None), ledger(7, Some(once)));
    for robot in [1, 2].map(RobotId) {
        let [a, b] =
            [&filter, &together].map(|ledger| ledger.joint().member(robot).expect("placed").correction);
        assert!(a.between(&b).log().norm() < 1e-9, "{a:?} {b:?}");
    }
    let largest =
        |ledger: &Ledger| ledger.joint().covariance().lower().iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    for (a, b) in filter.joint().covariance().lower().iter().zip(together.joint().covariance().lower()) {
        assert!((a - b).abs() < 1e-9 * largest(&filter));
    }
}
