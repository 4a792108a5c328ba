//! Rules of motion by which teams localized themselves before there was a joint filter, beside a team in which all
//! move and the joint filter does the rest.

mod page;
mod team;

use std::collections::BTreeMap;

use pleiad_report::with_interval;
use pleiad_sim_peers::Scenario;
use serde_json::json;

use crate::{Claim, Estimate, Study, StudyOptions, SurveyError, over_seeds};
use team::{Case, Look, Run, play};

pub(crate) const NAME: &str = "motion-policies";

const SCENARIO: &str = include_str!("../../../scenarios/motion_policies.toml");
const SEEDS: usize = 24;
const LEAST_SEEDS: usize = 4;
/// The task: so many metres driven by the team together.
const TASK_M: f64 = 100.0;
/// Errors at the end of the task are those over its last part, from this share of it.
const LAST_PART: f64 = 0.8;
/// Errors at a time are those over the seconds before it.
const LATE_S: f64 = 10.0;
/// Sight is blocked from and until, seconds, in runs that end some time later.
const BLOCKED_S: [f64; 2] = [60.0, 90.0];
const BLOCKED_RUN_S: f64 = 120.0;

/// All runs by case, in the order of the seeds.
struct Outcome {
    seeds: usize,
    duration_s: f64,
    free: BTreeMap<Case, Vec<Run>>,
    blocked: BTreeMap<Case, Vec<Run>>,
}

/// Runs the study.
///
/// # Errors
/// [`SurveyError`] if the scenario cannot be simulated or there are too few seeds.
pub fn study(options: &StudyOptions) -> Result<Study, SurveyError> {
    let outcome = runs(options)?;
    Ok(Study {
        name: NAME,
        title: "Rules of motion for teams".to_owned(),
        lead: "Four robots that see each other up to 8 m away, and nothing else, drive 100 m together: all at once, half \
               of them in turn (portable landmarks, Kurazume), one at a time past a triangle of beacons (millibots), or \
               two under the eyes of two that are parked. The joint filter reads them all; only the first row goes \
               without any exchange."
            .to_owned(),
        claims: claims(&outcome),
        shown: page::shown(&outcome),
        numbers: numbers(&outcome),
    })
}

fn runs(options: &StudyOptions) -> Result<Outcome, SurveyError> {
    let count = options.seeds.unwrap_or(SEEDS);
    if count < LEAST_SEEDS {
        return Err(SurveyError::TooFewSeeds { study: NAME, found: count, least: LEAST_SEEDS });
    }
    let base = Scenario::from_toml(SCENARIO, "motion_policies.toml")
        .map_err(|source| SurveyError::Scenario { study: NAME, source: Box::new(source) })?;
    let short = Scenario { duration_s: BLOCKED_RUN_S, ..base.clone() };
    let seeds: Vec<u64> = (0..count as u64).map(|k| options.first_seed.saturating_add(k)).collect();
    let (mut free, mut blocked) = (BTreeMap::new(), BTreeMap::new());
    for case in Case::ALL {
        free.insert(case, over_seeds(&seeds, |seed| play(&base, case, seed, None))?);
        blocked.insert(case, over_seeds(&seeds, |seed| play(&short, case, seed, Some(BLOCKED_S)))?);
    }
    Ok(Outcome { seeds: count, duration_s: base.duration_s, free, blocked })
}

/// What a run is measured by.
type Measure = fn(&Run) -> Option<f64>;

fn task_time_s(run: &Run) -> Option<f64> {
    run.time_to_s(TASK_M)
}

/// Error at the end of the task.
fn task_rmse_m(run: &Run) -> Option<f64> {
    run.time_to_s(TASK_M)?;
    run.rmse_m(|look: &Look| (LAST_PART * TASK_M..=TASK_M).contains(&look.distance_m))
}

/// Error after the time that the whole run lasts.
fn late_rmse_m(run: &Run) -> Option<f64> {
    let end_s = run.looks.last()?.t_s;
    run.rmse_m(|look| look.t_s >= end_s - LATE_S)
}

/// Error of the filter at the end of the block.
fn blocked_rmse_m(run: &Run) -> Option<f64> {
    run.rmse_m(|look| (BLOCKED_S[1] - 2.0..BLOCKED_S[1]).contains(&look.t_s))
}

/// And some time after it.
fn after_block_rmse_m(run: &Run) -> Option<f64> {
    run.rmse_m(|look| (BLOCKED_S[1] + 10.0..BLOCKED_S[1] + 15.0).contains(&look.t_s))
}

impl Outcome {
    fn values(runs: &BTreeMap<Case, Vec<Run>>, case: Case, measure: Measure) -> Vec<f64> {
        runs.get(&case).into_iter().flatten().filter_map(measure).collect()
    }

    fn free(&self, case: Case, measure: Measure) -> Option<Estimate> {
        Estimate::of(&Self::values(&self.free, case, measure))
    }

    fn blocked(&self, case: Case, measure: Measure) -> Option<Estimate> {
        Estimate::of(&Self::values(&self.blocked, case, measure))
    }

    /// Ratio of one case to another, seed by seed: the geometric mean with its interval.
    fn ratio(&self, over: Case, under: Case, measure: Measure) -> Option<Estimate> {
        let [over, under] = [over, under].map(|case| self.free.get(&case));
        let pairs = over?.iter().zip(under?);
        let logs: Vec<f64> =
            pairs.filter_map(|(over, under)| Some((measure(over)? / measure(under)?).ln())).collect();
        let own = Estimate::of(&logs)?;
        let [low, high] = own.interval.map(f64::exp);
        Some(Estimate { mean: own.mean.exp(), interval: [low, high], ..own })
    }
}

fn words(estimate: Option<Estimate>, unit: &str) -> String {
    estimate.map_or_else(|| "n/a".to_owned(), |own| with_interval(own.mean, own.interval, unit))
}

/// Whether the whole interval lies within these bounds.
fn within(estimate: Option<Estimate>, low: f64, high: f64) -> bool {
    estimate.is_some_and(|own| own.interval[0] >= low && own.interval[1] <= high)
}

/// Bounds of the claims, fixed before the seeds of the study were run.
mod bound {
    /// Team distance per time of all moving over half moving, and over one of four.
    pub const HALF: [f64; 2] = [1.8, 2.2];
    pub const ONE_OF_FOUR: [f64; 2] = [3.6, 4.4];
    /// Largest share of time with the sight that a rule needs, upper end.
    pub const SIGHT: f64 = 0.98;
    /// Error of the joint filter after a block over that by sight alone, ends of the intervals.
    pub const BLOCKED: f64 = 0.5;
}

fn claims(outcome: &Outcome) -> Vec<Claim> {
    let claim = |statement: &str, measured: String, holds: bool| Claim {
        statement: statement.to_owned(),
        measured,
        holds,
    };
    let rules = [Case::Portable, Case::OneMover, Case::Watched];
    let pace = |run: &Run| Some(run.pace_m_s());
    let [half, one] = [Case::Portable, Case::OneMover].map(|case| outcome.ratio(Case::AllMoving, case, pace));
    let [[half_low, half_high], [one_low, one_high]] = [bound::HALF, bound::ONE_OF_FOUR];
    let alone = outcome.ratio(Case::AllMoving, Case::Independent, task_rmse_m);
    let alone_late = outcome.ratio(Case::AllMoving, Case::Independent, late_rmse_m);
    let per_metre =
        [Case::Portable, Case::OneMover].map(|case| outcome.ratio(Case::AllMoving, case, task_rmse_m));
    let sights = rules.map(|case| outcome.free(case, |run| Some(100.0 * run.in_sight?)));
    let off = rules.map(|case| outcome.blocked(case, |run| run.off_by_sight_m));
    let joint = outcome.blocked(Case::AllMoving, blocked_rmse_m);
    let joint_high = joint.map_or(f64::INFINITY, |own| own.interval[1]);
    let named = |estimates: &[Option<Estimate>; 3], unit: &str| {
        let part = |(case, own): (&Case, &Option<Estimate>)| format!("{} {}", case.name(), words(*own, unit));
        rules.iter().zip(estimates).map(part).collect::<Vec<_>>().join("; ")
    };
    vec![
        claim(
            "A team in which all move drives twice as far in a time as one with portable landmarks, four times as far as one \
             with one mover",
            format!("ratio {} and {}", words(half, ""), words(one, "")),
            within(half, half_low, half_high) && within(one, one_low, one_high),
        ),
        claim(
            "Exchange helps: the joint filter is more accurate than no exchange, at the end of the task and of the run",
            format!("RMSE over that without exchange {} and {}", words(alone, ""), words(alone_late, "")),
            within(alone, 0.0, 1.0) && within(alone_late, 0.0, 1.0),
        ),
        claim(
            "Per metre the rules are the more accurate, for who stands still gathers no error: what they cost is time",
            format!(
                "RMSE of all moving at the end of the task over portable landmarks {}, over one mover {}",
                words(per_metre[0], ""),
                words(per_metre[1], "")
            ),
            per_metre.iter().all(|ratio| within(*ratio, 1.0, f64::INFINITY)),
        ),
        claim(
            "Robots that move about a hall lose the sight that each rule needs; the joint filter needs none in particular",
            named(&sights, "%"),
            sights.iter().all(|own| within(*own, 0.0, 100.0 * bound::SIGHT)),
        ),
        claim(
            "When sight is blocked for 30 s, who is located by sight alone is lost, and the joint filter is not",
            format!(
                "by sight alone off by: {}; joint filter, all moving: {}",
                named(&off, "m"),
                words(joint, "m")
            ),
            off.iter().all(|own| own.is_some_and(|own| joint_high < bound::BLOCKED * own.interval[0])),
        ),
    ]
}

fn numbers(outcome: &Outcome) -> serde_json::Map<String, serde_json::Value> {
    let mut numbers = serde_json::Map::new();
    numbers.insert("seeds".into(), json!(outcome.seeds));
    for case in Case::ALL {
        let share = |of: fn(&Run) -> Option<f64>| outcome.free(case, of);
        let own = json!({
            "pace_m_s": outcome.free(case, |run| Some(run.pace_m_s())),
            "task_time_s": outcome.free(case, task_time_s),
            "task_rmse_m": outcome.free(case, task_rmse_m),
            "rmse_at_the_end_m": outcome.free(case, late_rmse_m),
            "sight_needed_and_had": share(|run| run.in_sight),
            "alone": share(|run| Some(run.alone)),
            "rmse_blocked_m": outcome.blocked(case, blocked_rmse_m),
            "rmse_after_block_m": outcome.blocked(case, after_block_rmse_m),
            "off_by_sight_alone_m": outcome.blocked(case, |run| run.off_by_sight_m),
            "task_rmse_all_moving_over_this": outcome.ratio(Case::AllMoving, case, task_rmse_m),
            "end_rmse_all_moving_over_this": outcome.ratio(Case::AllMoving, case, late_rmse_m),
            "pace_all_moving_over_this": outcome.ratio(Case::AllMoving, case, |run| Some(run.pace_m_s())),
        });
        numbers.insert(case.key().into(), own);
    }
    numbers
}
