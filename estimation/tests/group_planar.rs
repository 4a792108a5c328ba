//! The fold written for every group, against the planar fold: in the plane, and in space with everything in one plane.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed expectation is a failed test")]

mod support;

use pleiad_estimation::fact::{Absolute, Entry, Quantity as PlanarQuantity};
use pleiad_estimation::fold::{FactKey, FoldConfig as PlanarConfig};
use pleiad_estimation::geometry::{Pose3, Square, Tangent, Vector2, Vector3};
use pleiad_estimation::group_fold::{
    Continuation, Fact, FactSet, FoldConfig, Joint, Noise, NominalState, Outcome, Quantity, Space, Symmetric,
};
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::reference::{FactContent, Measurement, facts_from_entries};
use pleiad_estimation::sample::Relative;
use pleiad_estimation::spatial::{Absolute3, Direction, Relative3};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{Pose2, fact};
use proptest::prelude::*;
use support::{Kinds, Options, team};

/// Relative to one plus the magnitude for poses, to the largest entry for covariances.
const TOLERANCE: f64 = 1e-12;

fn ledger(entries: &[Entry], config: PlanarConfig) -> Ledger {
    let mut ledger = Ledger::new(config);
    for entry in entries {
        ledger.insert(entry.clone());
    }
    ledger.settle();
    ledger
}

fn planar_state(state: &fact::NominalState) -> NominalState<Pose2, 3> {
    NominalState { nominal: state.nominal, noise_sum: symmetric(&state.noise_sum) }
}

fn symmetric(planar: &Symmetric3) -> Symmetric<3> {
    Symmetric::from_packed(&planar.0).unwrap()
}

/// The facts of a planar run, by what takes its parts to another group.
fn facts<G: Space<D>, const D: usize>(
    entries: &[Entry],
    boot: impl Fn(&fact::Boot) -> Fact<G, D>,
    observation: impl Fn(&Measurement) -> Fact<G, D>,
) -> FactSet<G, D> {
    let mut set = FactSet::new();
    for fact in facts_from_entries(entries) {
        let (key, fact) = match &fact.content {
            FactContent::Boot(of) => (FactKey::boot(fact.time, fact.id), boot(of)),
            FactContent::Measurement(of) => (FactKey::observation(fact.time, fact.id), observation(of)),
        };
        set.insert(key, fact).unwrap();
    }
    set
}

fn in_the_plane(entries: &[Entry]) -> FactSet<Pose2, 3> {
    let boot = |of: &fact::Boot| Fact::Boot {
        nominal: of.nominal,
        continuation: of.continuation.map(|of| Continuation {
            previous: of.previous,
            last: planar_state(&of.last),
            gap: symmetric(&of.gap),
        }),
    };
    let observation = |of: &Measurement| Fact::Observation {
        quantity: match of.quantity {
            PlanarQuantity::Robot { robot, relative } => Quantity::Robot { robot, relative },
            PlanarQuantity::Landmark { landmark, position_m: [x, y], relative } => {
                Quantity::Landmark { landmark, position_m: Vector2::new(x, y), relative }
            }
            PlanarQuantity::Absolute(absolute) => Quantity::Absolute(absolute),
            PlanarQuantity::Feature { .. } => panic!("the team maps nothing"),
        },
        noise: Noise {
            dimension: usize::from(of.noise.dimension),
            covariance: Symmetric::from_packed(&of.noise.lower).unwrap(),
        },
        observer: planar_state(&of.observer.nominal),
        other: of.observed.map(|of| (of.boot, planar_state(&of.nominal))),
    };
    facts(entries, boot, observation)
}

fn check_plane(seed: u64, options: &Options) -> usize {
    let team = team(seed, options);
    let (joint, records) = in_the_plane(&team.entries).fold(&FoldConfig::default());
    let planar = ledger(&team.entries, options.config);
    assert_eq!(joint.members().count(), planar.joint().members().count());
    let largest =
        planar.joint().covariance().lower().iter().fold(0.0f64, |most, entry| most.max(entry.abs()));
    for (ours, theirs) in joint.covariance().lower().iter().zip(planar.joint().covariance().lower()) {
        assert!((ours - theirs).abs() <= TOLERANCE * largest, "seed {seed}: {ours} {theirs}");
    }
    for (_, member) in joint.members() {
        let theirs = &planar.joint().member(member.robot).unwrap().correction;
        let apart = member.correction.between(theirs).log().norm();
        assert!(apart < TOLERANCE * (1.0 + theirs.position().norm()), "seed {seed}: {apart}");
    }
    let used = records.iter().filter(|(_, record)| record.outcome == Outcome::Used).count();
    assert_eq!(used, planar.counts().used);
    used
}

#[test]
fn in_the_plane_every_kind_gives_the_numbers_of_the_planar_fold() {
    let options = Options { robots: 5, seconds: 120, ..Options::default() };
    assert!(check_plane(1, &options) > 300);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn in_the_plane_random_teams_give_the_numbers_of_the_planar_fold(seed in 0u64..1_000_000, robots in 2u32..=8,
                                                                     spread_m in 5.0..200.0f64) {
        check_plane(seed, &Options { robots, spread_m, ..Options::default() });
    }
}

/// Where the coordinates of the plane are among those of space.
const AXES: [usize; 3] = [0, 1, 5];
/// Standard deviations of what the plane does not have.
const REST: f64 = 0.1;

fn lifted(planar: &Symmetric3, rest: f64) -> Symmetric<6> {
    let planar = planar.to_matrix();
    let mut matrix = Square::<6>::from_diagonal_element(rest * rest);
    for (row, i) in AXES.into_iter().enumerate() {
        for (column, j) in AXES.into_iter().enumerate() {
            matrix[(i, j)] = planar[(row, column)];
        }
    }
    Symmetric::from_lower(&matrix)
}

fn lifted_state(state: &fact::NominalState) -> NominalState<Pose3, 6> {
    NominalState { nominal: Pose3::from_planar(&state.nominal), noise_sum: lifted(&state.noise_sum, 0.0) }
}

fn lifted_relative(relative: &Relative, noise: &fact::Noise) -> (Relative3, Noise<6>) {
    let bearing = |angle: f64| Direction::new(Vector3::new(libm::cos(angle), libm::sin(angle), 0.0)).unwrap();
    let [xx, _, yy, ..] = noise.lower;
    let sigmas = |variances: &[f64]| {
        Noise::from_sigmas(&variances.iter().map(|variance| libm::sqrt(*variance)).collect::<Vec<_>>())
    };
    match *relative {
        Relative::Pose(pose) => {
            let covariance = lifted(&Symmetric3(noise.lower), REST);
            (Relative3::Pose(Pose3::from_planar(&pose)), Noise { dimension: 6, covariance })
        }
        Relative::Position { x_m, y_m } => {
            (Relative3::Position(Vector3::new(x_m, y_m, 0.0)), sigmas(&[xx, yy, REST * REST]))
        }
        Relative::Range { range_m } => (Relative3::Range(range_m), sigmas(&[xx])),
        Relative::Bearing { bearing_rad } => (Relative3::Bearing(bearing(bearing_rad)), sigmas(&[xx, xx])),
        Relative::RangeBearing { range_m, bearing_rad } => {
            (Relative3::RangeBearing(range_m, bearing(bearing_rad)), sigmas(&[xx, yy, yy]))
        }
    }
}

fn in_space(entries: &[Entry]) -> FactSet<Pose3, 6> {
    let boot = |of: &fact::Boot| Fact::Boot { nominal: Pose3::from_planar(&of.nominal), continuation: None };
    let observation = |of: &Measurement| {
        let (quantity, noise) = match &of.quantity {
            PlanarQuantity::Robot { robot, relative } => {
                let (relative, noise) = lifted_relative(relative, &of.noise);
                (Quantity::Robot { robot: *robot, relative }, noise)
            }
            PlanarQuantity::Absolute(Absolute::Pose(pose)) => {
                let covariance = lifted(&Symmetric3(of.noise.lower), REST);
                let noise = Noise { dimension: 6, covariance };
                (Quantity::Absolute(Absolute3::Pose(Pose3::from_planar(pose))), noise)
            }
            other => panic!("not a relative kind: {other:?}"),
        };
        let other = of.observed.map(|of| (of.boot, lifted_state(&of.nominal)));
        Fact::Observation { quantity, noise, observer: lifted_state(&of.observer.nominal), other }
    };
    facts(entries, boot, observation)
}

fn part(joint: &Joint<Pose3, 6>, i: usize, j: usize) -> Square<3> {
    let block = joint.covariance().block(i, j);
    Square::<3>::from_fn(|row, column| block[(AXES[row], AXES[column])])
}

#[test]
fn in_space_a_team_in_one_plane_gives_the_numbers_of_the_planar_fold() {
    let accept = [f64::INFINITY; 3];
    let config = PlanarConfig { gate: accept, ..PlanarConfig::default() };
    for seed in 0..6 {
        let options = Options { kinds: Kinds::Relative, config, ..Options::default() };
        let team = team(seed, &options);
        let (joint, records) = in_space(&team.entries).fold(&FoldConfig { gate: [f64::INFINITY; 6] });
        assert!(records.iter().all(|(_, record)| !matches!(record.outcome, Outcome::Skipped(_))));
        let planar = ledger(&team.entries, config);
        let planar = planar.joint();
        for (i, member) in joint.members() {
            let theirs = Pose3::from_planar(&planar.member(member.robot).unwrap().correction);
            let apart: Tangent<6> = member.correction.between(&theirs).log();
            // Rotations by quaternions and by angles round differently; corrections pass it on.
            assert!(apart.norm() < 1e-10 * (1.0 + theirs.position().norm()), "seed {seed}: {apart}");
            for (j, other) in joint.members() {
                let (k, l) = (planar.index(member.robot).unwrap(), planar.index(other.robot).unwrap());
                let theirs = planar.covariance().block(k, l);
                assert!(
                    (part(&joint, i, j) - theirs).norm() < 1e-10 * planar.covariance().block(0, 0).norm()
                );
            }
        }
    }
}
