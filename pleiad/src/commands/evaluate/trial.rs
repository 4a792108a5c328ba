//! One run of a team, its facts folded by every variant.

use std::collections::BTreeMap;

use anyhow::{Context, bail};
use pleiad_estimation::fact::{EntryId, NominalState, Quantity};
use pleiad_estimation::fold::{Fact, FactKey, FoldConfig, Others, Outcome, Residual, fold_on};
use pleiad_estimation::geometry::wrap_angle;
use pleiad_estimation::joint::Joint;
use pleiad_estimation::strategy::{Deviation, joint_of_replica};
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_sim_peers::reckoning::Reckoned;
use pleiad_sim_peers::{Fleet, FleetOptions};

use crate::commands::worlds::World;

/// Digest rounds granted after the last sample; without faults one is enough.
const SETTLING_ROUNDS: u32 = 200;

/// What came of a run.
pub struct Trial {
    /// Complete facts.
    pub facts: usize,
    /// By variant.
    pub scores: Vec<Score>,
}

/// How a variant did.
#[derive(Default)]
pub struct Score {
    /// By time.
    pub looks: Vec<Look>,
    /// NIS and dimension of every measurement, of those that the gate refused too.
    pub nis: Vec<(f64, usize)>,
    /// Measurements that the gate refused.
    pub rejected: usize,
    /// Innovations over their standard deviations on average, one stream for each observer, target and component.
    pub streams: Vec<Vec<f64>>,
    /// Seconds that folding took, over all times judged.
    pub seconds: f64,
}

/// The estimate at one time, against the truth.
pub struct Look {
    /// The error of the whole team in the coordinates of the filter, and its covariance.
    pub joint: Deviation,
    /// The same with the motion common to the team taken apart.
    pub apart: Option<Deviation>,
    /// Of each robot by itself.
    pub robots: Vec<Deviation>,
    /// Mean over the robots of the squared position error, m^2.
    pub position_m2: f64,
    /// Mean over the robots of the squared heading error, rad^2.
    pub heading_rad2: f64,
}

/// Runs the team once, and folds what it said by every configuration.
pub fn play(world: &World, configs: &[FoldConfig], times_s: &[f64]) -> anyhow::Result<Trial> {
    let options = FleetOptions { seed: world.seed, ..FleetOptions::default() };
    let mut fleet = Fleet::new(world.configs.values().cloned().collect(), &options)?;
    fleet.feed(&world.samples, |_| {});
    let samples = || world.samples.values().flatten().map(|sample| sample.time);
    let (begin, end) = samples().min().zip(samples().max()).context("there is not a single sample")?;
    if !fleet.settle(end, SETTLING_ROUNDS) {
        bail!("the team did not come to agree");
    }
    let mut reckoned = BTreeMap::new();
    for (robot, config) in &world.configs {
        reckoned.insert(*robot, Reckoned::of(config, &world.samples[robot])?);
    }
    let outcomes = fleet.into_outcomes();
    let ledger = outcomes.values().next().context("there is no robot")?.node.ledger();
    let facts: Vec<(FactKey, Fact)> = ledger.facts().map(|(key, record)| (*key, record.fact)).collect();
    // The last odometry sample of a robot may be a little before the last time asked for.
    let last = reckoned.values().map(|own| own.trajectory.end().0).min().unwrap_or(end);
    let times: Vec<Timestamp> = times_s.iter().map(|time| begin.plus_seconds(*time).min(last)).collect();
    let others = |id, robot| ledger.other_half(id, robot);
    let scores = configs.iter().map(|config| score(world, config, (&facts, &others), &reckoned, &times));
    Ok(Trial { facts: facts.len(), scores: scores.collect::<anyhow::Result<_>>()? })
}

fn score(
    world: &World,
    config: &FoldConfig,
    (facts, others): (&[(FactKey, Fact)], &Others<'_>),
    reckoned: &BTreeMap<RobotId, Reckoned>,
    times: &[Timestamp],
) -> anyhow::Result<Score> {
    let mut score = Score::default();
    let begun = std::time::Instant::now();
    let mut joints = Vec::with_capacity(times.len());
    for time in times {
        // What later facts would move must not be in it.
        let held = facts.partition_point(|(key, _)| key.time <= *time);
        let mut joint = Joint::new(config.form);
        fold_on(&mut joint, config, &facts[..held], others, &mut |_, _| {});
        joints.push(joint);
    }
    score.seconds = begun.elapsed().as_secs_f64();
    let mut residuals: BTreeMap<EntryId, Residual> = BTreeMap::new();
    fold_on(&mut Joint::new(config.form), config, facts, others, &mut |key, residual| {
        residuals.insert(key.id, residual);
    });
    innovations(&mut score, facts, &residuals);
    for (time, joint) in times.iter().zip(&joints) {
        score.looks.push(look(world, joint, reckoned, *time)?);
    }
    Ok(score)
}

/// Files the innovations of a run.
fn innovations(score: &mut Score, facts: &[(FactKey, Fact)], residuals: &BTreeMap<EntryId, Residual>) {
    let mut streams: BTreeMap<(RobotId, String, usize), Vec<f64>> = BTreeMap::new();
    for (key, fact) in facts {
        let (Some(residual), Fact::Observation { quantity, .. }) = (residuals.get(&key.id), fact) else {
            continue;
        };
        if residual.dimension == 0 {
            continue;
        }
        score.nis.push((residual.nis, residual.dimension));
        if matches!(residual.outcome, Outcome::Rejected { .. }) {
            score.rejected += 1;
            continue;
        }
        for component in 0..residual.dimension {
            let stream = streams.entry((key.id.robot, target(quantity), component)).or_default();
            stream.push(residual.innovation[component]);
        }
    }
    score.streams = streams
        .into_values()
        .map(|mut stream| {
            let square = stream.iter().map(|value| value * value).sum::<f64>() / stream.len() as f64;
            for value in &mut stream {
                *value /= square.sqrt().max(f64::MIN_POSITIVE);
            }
            stream
        })
        .collect();
}

fn target(quantity: &Quantity) -> String {
    match quantity {
        Quantity::Robot { robot, relative } => {
            format!("robot {robot} {:?}", std::mem::discriminant(relative))
        }
        Quantity::Landmark { landmark, relative, .. } | Quantity::Feature { landmark, relative } => {
            format!("landmark {landmark} {:?}", std::mem::discriminant(relative))
        }
        Quantity::Absolute(absolute) => format!("{:?}", std::mem::discriminant(absolute)),
    }
}

fn look(
    world: &World,
    joint: &Joint,
    reckoned: &BTreeMap<RobotId, Reckoned>,
    time: Timestamp,
) -> anyhow::Result<Look> {
    let states: Option<BTreeMap<RobotId, NominalState>> =
        reckoned.iter().map(|(robot, own)| Some((*robot, own.trajectory.at(time).ok()?))).collect();
    let states = states.with_context(|| format!("a robot has no odometry at {time}"))?;
    let view = joint_of_replica(joint, &states);
    let view = view.with_context(|| format!("a robot has no place in the map at {time}; give it a prior"))?;
    let truths: BTreeMap<RobotId, Pose2> =
        states.keys().filter_map(|robot| Some((*robot, world.truth.at(*robot, time)?))).collect();
    let deviation = view.deviation(&truths).with_context(|| format!("a robot has no truth at {time}"))?;
    let (mut position_m2, mut heading_rad2) = (0.0, 0.0);
    for (robot, pose) in &view.robots {
        let truth = &truths[robot];
        position_m2 += (truth.position() - pose.position()).norm_squared() / view.robots.len() as f64;
        heading_rad2 += wrap_angle(truth.yaw_rad() - pose.yaw_rad()).powi(2) / view.robots.len() as f64;
    }
    let own = |index: usize| {
        let error = deviation.0.rows(3 * index, 3).into_owned();
        (error, deviation.1.view((3 * index, 3 * index), (3, 3)).into_owned())
    };
    Ok(Look {
        robots: (0..view.robots.len()).map(own).collect(),
        apart: view.deviation_apart(&truths),
        joint: deviation,
        position_m2,
        heading_rad2,
    })
}
