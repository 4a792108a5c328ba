//! One run of one strategy, and how it went.

use std::collections::BTreeMap;

use pleiad_bus::FaultPlan;
use pleiad_estimation::fact::{Body, Entry, Quantity};
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::reference::{JointEkf, JointEstimate, facts_from_entries};
use pleiad_estimation::strategy::{Counts, Deviation, JointView, Strategy, StrategyKind};
use pleiad_estimation::{Pose2, RobotId};
use pleiad_sim_peers::strategies::{Snapshot, StrategyOptions, StrategyOutcome, run};

use crate::commands::worlds::World;

/// Times within the fault at which consistency is judged, as shares of it.
const JUDGED: [f64; 4] = [0.25, 0.5, 0.75, 1.0];
/// From the end of a fault until the team counts as healed, s.
const HEALING_S: f64 = 5.0;

/// When a fault begins and ends, seconds into the run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    pub start_s: f64,
    pub end_s: f64,
}

impl Window {
    /// Of a plan, within a run.
    pub fn of(plan: &FaultPlan, seconds: f64) -> Self {
        let (start_s, end_s) = plan.window_s().unwrap_or((0.0, seconds));
        Self { start_s: start_s.min(seconds), end_s: end_s.min(seconds) }
    }
}

/// How a run went.
#[derive(Clone, Debug, Default)]
pub struct RunScore {
    pub rmse_during_m: Option<f64>,
    pub rmse_end_m: Option<f64>,
    pub rmse_healed_m: Option<f64>,
    /// At the judged times.
    pub joint: Vec<Option<Deviation>>,
    /// Least over greatest eigenvalue of the joint covariance, the least of all looks.
    pub least_definiteness: Option<f64>,
    /// Per robot, at the judged times.
    pub robots: BTreeMap<RobotId, Vec<Option<Deviation>>>,
    pub bytes: u64,
    pub messages: u64,
    pub refused_messages: u64,
    pub counts: Counts,
    pub facts_lost: Option<u64>,
    pub facts_counted_twice: u64,
    pub facts_pending: u64,
    /// Final poses.
    pub last: BTreeMap<RobotId, Pose2>,
    /// Of the exact strategy: the largest difference of any replica to the oracle over the accepted facts,
    /// poses and covariance; and whether all replicas have the same bits.
    pub oracle_difference: Option<f64>,
    pub identical: Option<bool>,
}

/// Runs a strategy on a world.
pub fn play(world: &World, kind: StrategyKind, plan: &FaultPlan, window: Window) -> anyhow::Result<RunScore> {
    let options = StrategyOptions {
        seed: world.seed,
        plan: plan.clone(),
        settling_rounds: 200,
        ..StrategyOptions::new(kind)
    };
    let mut outcome = run(&world.configs, &world.samples, &options)?;
    let mut score = RunScore {
        bytes: outcome.total().1,
        messages: outcome.total().0,
        refused_messages: outcome.refused_messages,
        ..RunScore::default()
    };
    accuracy(&mut score, world, &outcome.snapshots, window);
    consistency(&mut score, world, &outcome.snapshots, window);
    score.last = outcome.last.views.iter().map(|(robot, (_, view))| (*robot, view.pose)).collect();
    for participant in outcome.participants.values_mut() {
        add(&mut score.counts, &participant.counts());
    }
    if kind == StrategyKind::Exact {
        facts_of_replicas(&mut score, world, &mut outcome);
    } else {
        facts_of_messages(&mut score, kind, outcome.participants.len() as u64);
    }
    Ok(score)
}

fn accuracy(score: &mut RunScore, world: &World, snapshots: &[Snapshot], window: Window) {
    let rmse = |from_s: f64, to_s: f64| {
        let within = snapshots.iter().filter(|snapshot| (from_s..=to_s).contains(&snapshot.t_s));
        let squares: Vec<f64> = within
            .flat_map(|snapshot| &snapshot.views)
            .filter_map(|(robot, (time, view))| {
                let truth = world.truth.at(*robot, *time)?;
                Some((truth.position() - view.pose.position()).norm_squared())
            })
            .collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    };
    score.rmse_during_m = rmse(window.start_s, window.end_s);
    score.rmse_end_m = rmse(window.end_s - 1.0, window.end_s);
    score.rmse_healed_m = rmse(window.end_s + HEALING_S, f64::INFINITY);
}

fn consistency(score: &mut RunScore, world: &World, snapshots: &[Snapshot], window: Window) {
    let times = JUDGED.map(|share| window.start_s + share * (window.end_s - window.start_s));
    for time_s in times {
        let nearest =
            |a: &&Snapshot, b: &&Snapshot| (a.t_s - time_s).abs().total_cmp(&(b.t_s - time_s).abs());
        let Some(snapshot) = snapshots.iter().min_by(nearest) else { return };
        let truths: BTreeMap<RobotId, Pose2> = snapshot
            .views
            .iter()
            .filter_map(|(robot, (time, _))| Some((*robot, world.truth.at(*robot, *time)?)))
            .collect();
        // Where two robots do not agree on their cross term, there is no joint covariance.
        let joint = snapshot.joint.as_ref().filter(|joint| joint.disagreeing == 0);
        score.joint.push(joint.and_then(|joint| joint.deviation(&truths)));
        for robot in world.configs.keys() {
            let view = snapshot.views.get(robot).map(|(_, view)| view);
            let deviation = view.zip(truths.get(robot)).map(|(view, truth)| view.deviation(truth));
            score.robots.entry(*robot).or_default().push(deviation);
        }
    }
    let known = snapshots.iter().filter_map(|snapshot| snapshot.joint.as_ref());
    let agreeing = known.filter(|joint| joint.disagreeing == 0);
    score.least_definiteness = agreeing.map(JointView::definiteness).min_by(f64::total_cmp);
}

/// The sums of two counts.
fn add(sum: &mut Counts, counts: &Counts) {
    sum.relative += counts.relative;
    sum.absolute += counts.absolute;
    sum.used += counts.used;
    sum.completed += counts.completed;
    sum.broadcast += counts.broadcast;
    sum.applied += counts.applied;
    sum.rejected += counts.rejected;
    sum.pending += counts.pending;
    sum.repeated += counts.repeated;
    sum.counted_twice += counts.counted_twice;
    sum.refused += counts.refused;
    sum.disagreed += counts.disagreed;
    sum.samples_refused += counts.samples_refused;
}

fn facts_of_messages(score: &mut RunScore, kind: StrategyKind, robots: u64) {
    let counts = &score.counts;
    let unheard = (counts.broadcast * robots.saturating_sub(1))
        .saturating_sub(counts.applied.saturating_sub(counts.counted_twice));
    score.facts_lost = (kind != StrategyKind::Independent)
        .then(|| counts.relative.saturating_sub(counts.completed + counts.rejected) + unheard);
    score.facts_counted_twice = counts.counted_twice;
    score.facts_pending = counts.pending;
}

fn entries(ledger: &Ledger) -> Vec<Entry> {
    ledger.digests().flat_map(|digest| ledger.entries(digest.log, 0)).cloned().collect()
}

/// What became of the facts in the replicas, against the oracle over all that was ever said.
fn facts_of_replicas(score: &mut RunScore, world: &World, outcome: &mut StrategyOutcome) {
    let mut said: Vec<Entry> = Vec::new();
    for (robot, participant) in &outcome.participants {
        let Some(node) = participant.node() else { continue };
        said.extend(entries(node.ledger()).into_iter().filter(|entry| entry.id.robot == *robot));
    }
    let observed = said.iter().filter(|entry| match &entry.body {
        Body::Observation(observation) => matches!(observation.quantity, Quantity::Robot { .. }),
        _ => false,
    });
    let observed = observed.count() as u64;
    let Some(fold) = world.configs.values().next().map(|config| config.fold) else { return };
    let oracle = JointEkf { form: fold.form, gate: fold.gate }.fold(&facts_from_entries(&said));
    let used = oracle.nis().count();
    let (mut lost, mut twice, mut pending, mut difference) = (0, 0, 0, 0.0_f64);
    let mut prints = Vec::new();
    for participant in outcome.participants.values_mut() {
        let Some(node) = participant.node_mut() else { continue };
        prints.push(node.status().estimate);
        let counts = node.ledger().counts();
        let decided = (counts.relative + counts.void) as u64;
        lost = lost.max(observed.saturating_sub(decided));
        pending = pending.max(counts.pending as u64);
        // Every fact that the oracle decided on is in the fold once.
        let folded = counts.used + counts.rejected;
        twice = twice.max(folded.saturating_sub(used) as u64);
        difference = difference.max(apart(node.ledger(), &oracle));
    }
    score.facts_lost = Some(lost);
    score.facts_counted_twice = twice;
    score.facts_pending = pending;
    score.oracle_difference = Some(difference);
    score.identical = Some(prints.windows(2).all(|pair| pair[0] == pair[1]));
}

/// The largest difference of any number of a replica and the oracle: corrections and covariance.
fn apart(ledger: &Ledger, oracle: &JointEstimate) -> f64 {
    let joint = ledger.joint();
    let mut largest = 0.0_f64;
    for own in &oracle.robots {
        let (Some(member), Some(row)) = (joint.member(own.robot), joint.index(own.robot)) else {
            return f64::INFINITY;
        };
        let between = member.correction.between(&own.correction);
        for part in [between.x_m(), between.y_m(), between.yaw_rad()] {
            largest = largest.max(part.abs());
        }
        for other in &oracle.robots {
            let Some(column) = joint.index(other.robot) else { return f64::INFINITY };
            let Some(block) = oracle.covariance.block(own.robot, other.robot) else { return f64::INFINITY };
            largest = largest.max((joint.covariance().block(row, column) - block).amax());
        }
    }
    largest
}
