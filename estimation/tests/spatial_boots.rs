//! Restarts of a robot in space.

#![allow(clippy::unwrap_used, reason = "a failed expectation is a failed test")]

#[path = "support/space.rs"]
mod space;

use pleiad_estimation::fold::FactKey;
use pleiad_estimation::geometry::{LieGroup, Pose3, Tangent6};
use pleiad_estimation::group_fold::{
    Continuation, Fact, FactSet, FoldConfig, Joint, NominalState, Outcome, Quantity, Symmetric,
};
use pleiad_estimation::{BootIndex, RobotId, Timestamp};
use space::{Options, run};

const ACCEPT: FoldConfig<6> = FoldConfig { gate: [f64::INFINITY; 6] };

#[test]
fn a_restart_without_a_gap_changes_nothing_and_a_lost_one_ends_the_robot() {
    let run = run(5, &Options::default());
    let own = |key: &FactKey| key.id.robot == RobotId(1);
    let facts_of_1 = run.facts.iter().filter(|(key, _)| own(key)).collect::<Vec<_>>();
    let (at, middle) = facts_of_1[facts_of_1.len() / 2];
    let Fact::Observation { observer: last, .. } = middle else { panic!("an observation") };
    let begin = Pose3::exp(&Tangent6::new(-2.0, 7.0, 1.0, 0.4, -0.2, 1.3));
    let s = begin.compose(&last.nominal.inverse());
    let moved = |state: &NominalState<Pose3, 6>| NominalState {
        nominal: s.compose(&state.nominal),
        noise_sum: state.noise_sum.minus(&last.noise_sum).congruence(&LieGroup::adjoint(&s)),
    };
    let split = |continuation| {
        let mut set = FactSet::new();
        let mut id = at.id;
        id.boot = BootIndex(1);
        let boot = Fact::Boot { nominal: begin, continuation };
        set.insert(FactKey::boot(Timestamp(at.time.0 + 1), id), boot).unwrap();
        for (key, fact) in &run.facts {
            let Fact::Observation { quantity, noise, mut observer, mut other } = *fact else { continue };
            let mut key = *key;
            if key.time > at.time {
                if own(&key) {
                    key.id.boot = BootIndex(1);
                    observer = moved(&observer);
                }
                if matches!(quantity, Quantity::Robot { robot: RobotId(1), .. }) {
                    other = other.map(|(_, state)| (BootIndex(1), moved(&state)));
                }
            }
            set.insert(key, Fact::Observation { quantity, noise, observer, other }).unwrap();
        }
        set.fold(&ACCEPT)
    };
    let (whole, records) = run.set().fold(&ACCEPT);
    let carried = Continuation { previous: BootIndex(0), last: *last, gap: Symmetric::zero() };
    let (joint, again) = split(Some(carried));
    assert_eq!(again.len(), records.len() + 1);
    let largest = whole.covariance().to_dense().amax();
    assert!((joint.covariance().to_dense() - whole.covariance().to_dense()).amax() < 1e-10 * largest);
    for ((_, a), (_, b)) in joint.members().zip(whole.members()) {
        // Compared as poses: the corrections of the restarted robot apply to another nominal trajectory.
        let (a, b) = (a.correction.compose(&a.nominal), b.correction.compose(&b.nominal));
        assert!(a.between(&b).log().norm() < 1e-10);
    }
    let gap = Symmetric::from_sigmas([1.0, 1.0, 1.0, 0.2, 0.2, 0.2]);
    let (wider, _) = split(Some(Continuation { gap, ..carried }));
    let sum = |joint: &Joint<Pose3, 6>| joint.covariance().to_dense().trace();
    assert!(sum(&wider) > sum(&joint));
    let (lost, records) = split(None);
    assert_eq!(lost.index(RobotId(1)), None);
    assert!(records.iter().any(|(_, record)| matches!(record.outcome, Outcome::Skipped(_))));
}
