//! Several hypotheses on a known map with look-alike landmarks and recognition that errs (Roumeliotis & Bekey 2000).

mod drive;
mod page;
mod plain;

use pleiad_estimation::hypotheses::Settings;
use pleiad_estimation::statistics::chi_square_interval;
use pleiad_report::{quantity, with_interval};
use pleiad_sim_peers::Scenario;
use serde_json::json;

use crate::{Claim, Estimate, Study, StudyOptions, SurveyError, over_seeds, share};
use drive::{Recognition, Run, carried_off, left_alone, localize};

pub(crate) const NAME: &str = "hypotheses";

const SCENARIO: &str = include_str!("../../../scenarios/hypotheses.toml");
const SYMMETRIC: &str = include_str!("../../../scenarios/hypotheses_symmetric.toml");
/// Recognition says the right one of three kinds so often.
const RECOGNITION: Recognition = Recognition { right: 0.8, kinds: 3 };
/// So many runs, unless asked otherwise.
const SEEDS: usize = 100;
const LEAST_SEEDS: usize = 4;
/// Runs compared with the plain filter.
const PLAIN_RUNS: usize = 10;
/// Runs without pruning and merging.
const UNPRUNED_RUNS: usize = 2;
/// So many hypotheses are allowed by the default settings.
const ALLOWED: usize = 512;

/// Bounds of the claims, fixed before the seeds of the study were run.
mod bound {
    /// Least share of runs that converge to the right place, or recover; the lower end of the interval.
    pub const CONVERGED: f64 = 0.9;
    /// Largest share of runs that do what they must not; the upper end of the interval.
    pub const FAILED: f64 = 0.05;
    /// Largest share that recover without a reserve; the upper end.
    pub const WITHOUT_RESERVE: f64 = 0.5;
    /// Largest mean number of hypotheses over a run, upper end; of 512 allowed.
    pub const KEPT: f64 = 50.0;
    /// Without pruning and merging there are at least so many times as many.
    pub const TIMES: f64 = 3.0;
    /// Largest difference to the plain filter.
    pub const PLAIN: f64 = 1e-9;
    /// Weights of a pose and its image on the symmetric map.
    pub const IMAGE: [f64; 2] = [0.4, 0.6];
}

/// All runs of all seeds.
struct Outcome {
    kidnapped_at_s: f64,
    duration_s: f64,
    clean: Vec<Run>,
    kidnapped: Vec<Run>,
    without_reserve: Vec<Run>,
    symmetric: Vec<Run>,
    unpruned: Vec<Run>,
    plain: Vec<f64>,
    scenario: Scenario,
    symmetric_scenario: Scenario,
}

/// Runs the study.
///
/// # Errors
/// [`SurveyError`] if a scenario cannot be simulated or there are too few seeds.
pub fn study(options: &StudyOptions) -> Result<Study, SurveyError> {
    let outcome = runs(options)?;
    let claims = claims(&outcome);
    Ok(Study {
        name: NAME,
        title: "Several hypotheses on a map of look-alikes".to_owned(),
        lead: "A robot knows the map, twelve landmarks of three kinds, but not where it is; recognition says the \
               wrong kind of every fifth landmark. One dead reckoning carries all hypotheses; at a sighting each is \
               tried with each landmark and weighed by Bayes' rule (Roumeliotis and Bekey 2000). A reserve of \
               probability stands for `none of these`."
            .to_owned(),
        numbers: numbers(&outcome),
        shown: page::shown(&outcome),
        claims,
    })
}

fn runs(options: &StudyOptions) -> Result<Outcome, SurveyError> {
    let count = options.seeds.unwrap_or(SEEDS);
    if count < LEAST_SEEDS {
        return Err(SurveyError::TooFewSeeds { study: NAME, found: count, least: LEAST_SEEDS });
    }
    let load = |text: &str, file: &str| {
        Scenario::from_toml(text, file)
            .map_err(|source| SurveyError::Scenario { study: NAME, source: Box::new(source) })
    };
    let scenario = load(SCENARIO, "hypotheses.toml")?;
    let symmetric_scenario = load(SYMMETRIC, "hypotheses_symmetric.toml")?;
    let kidnapped_at_s = scenario.robots.values().flat_map(|own| &own.kidnap).map(|kidnap| kidnap.time_s);
    let kidnapped_at_s = kidnapped_at_s.fold(f64::INFINITY, f64::min);
    let seeds: Vec<u64> = (0..count as u64).map(|k| options.first_seed.saturating_add(k)).collect();
    let usual = Settings::default();
    let unpruned = Settings { least_weight: 0.0, merge_below: 0.0, ..usual };
    let no_reserve = Settings { carried_off_hz: 0.0, ..usual };
    let clean = left_alone(&scenario);
    let (scenario_of, first) = (&scenario, options.first_seed);
    let run = |world: &Scenario, seed, settings| {
        localize(world, seed, RECOGNITION, settings, if seed == first { 12 } else { 0 })
    };
    Ok(Outcome {
        kidnapped_at_s,
        duration_s: scenario.duration_s,
        clean: over_seeds(&seeds, |seed| run(&clean, seed, usual))?,
        kidnapped: over_seeds(&seeds, |seed| run(&carried_off(scenario_of, seed), seed, usual))?,
        without_reserve: over_seeds(&seeds, |seed| run(&carried_off(scenario_of, seed), seed, no_reserve))?,
        symmetric: over_seeds(&seeds, |seed| run(&symmetric_scenario, seed, usual))?,
        unpruned: over_seeds(&seeds[..UNPRUNED_RUNS.min(count)], |seed| run(&clean, seed, unpruned))?,
        plain: over_seeds(&seeds[..PLAIN_RUNS.min(count)], |seed| plain::difference(&clean, seed))?,
        symmetric_scenario,
        scenario,
    })
}

/// A share of runs in words, with its exact interval.
fn of_runs(hits: usize, of: usize) -> String {
    let [low, high] = share(hits, of);
    format!("{hits} of {of} runs ({:.1}..{:.1} %)", 100.0 * low, 100.0 * high)
}

/// So many runs at least make an interval that says something.
const LEAST_RUNS: usize = 5;

/// A mean over runs in words.
fn mean(values: &[f64], unit: &str) -> String {
    Estimate::of(values)
        .filter(|own| own.runs >= LEAST_RUNS)
        .map_or_else(|| "too few to say".to_owned(), |own| with_interval(own.mean, own.interval, unit))
}

impl Outcome {
    /// Time to convergence of the runs without kidnapping that did converge to the right place.
    fn converged_s(&self) -> Vec<f64> {
        self.clean.iter().filter_map(|run| run.settled_s(0.0, f64::INFINITY)).collect()
    }

    /// Time from the kidnapping until the right place was believed again.
    fn recovered_s(&self, runs: &[Run]) -> Vec<f64> {
        let at = self.kidnapped_at_s;
        runs.iter().filter_map(|run| Some(run.settled_s(at, f64::INFINITY)? - at)).collect()
    }

    /// Runs that had converged before the kidnapping.
    fn converged_before(&self, runs: &[Run]) -> usize {
        runs.iter().filter(|run| run.settled_s(0.0, self.kidnapped_at_s).is_some()).count()
    }

    fn most(&self) -> usize {
        let all = [&self.clean, &self.kidnapped, &self.without_reserve, &self.symmetric];
        all.into_iter().flatten().map(|run| run.most).max().unwrap_or(0)
    }

    /// Mean number of hypotheses over each of some runs.
    fn kept(runs: &[Run]) -> Vec<f64> {
        let mean = |run: &Run| {
            run.moments.iter().map(|moment| moment.count as f64).sum::<f64>()
                / run.moments.len().max(1) as f64
        };
        runs.iter().map(mean).collect()
    }

    /// Runs on the symmetric map that keep the pose and its image at like weights in the end.
    fn undecided(&self) -> usize {
        let [low, high] = bound::IMAGE;
        let like = |weight: f64| (low..=high).contains(&weight);
        let kept =
            |run: &&Run| run.moments.last().is_some_and(|last| like(last.at_truth) && like(last.at_image));
        self.symmetric.iter().filter(kept).count()
    }

    /// Average NEES per degree of freedom of the winners that are right, and where it lies with 99 % were they
    /// consistent.
    fn anees(&self) -> (f64, [f64; 2]) {
        let winners =
            self.clean.iter().filter(|run| run.moments.last().is_some_and(|last| last.one && last.right));
        let values: Vec<f64> = winners.map(|run| run.nees).collect();
        let degrees = 3.0 * values.len() as f64;
        let (low, high) = chi_square_interval(degrees, 0.01);
        (values.iter().sum::<f64>() / degrees, [low / degrees, high / degrees])
    }
}

fn claims(outcome: &Outcome) -> Vec<Claim> {
    let of = outcome.clean.len();
    let claim = |statement: &str, measured: String, holds: bool| Claim {
        statement: statement.to_owned(),
        measured,
        holds,
    };
    let converged = outcome.converged_s();
    let strayed = outcome.clean.iter().filter(|run| run.strayed()).count();
    let recovered = outcome.recovered_s(&outcome.kidnapped);
    let not_recovered = outcome.recovered_s(&outcome.without_reserve);
    let before = outcome.converged_before(&outcome.without_reserve);
    let decided = outcome.symmetric.iter().filter(|run| run.moments.iter().any(|moment| moment.one)).count();
    let undecided = outcome.undecided();
    let plain = outcome.plain.iter().copied().fold(0.0, f64::max);
    let errors: Vec<f64> = outcome.clean.iter().map(|run| run.error_m).collect();
    let (anees, [low, high]) = outcome.anees();
    let most = outcome.most();
    let [kept, unpruned] = [&outcome.clean, &outcome.unpruned].map(|runs| Outcome::kept(runs));
    let [own, without] = [&kept, &unpruned].map(|counts| Estimate::of(counts));
    let few = own.is_some_and(|own| own.interval[1] < bound::KEPT);
    let many = own.zip(without).is_some_and(|(own, without)| without.mean > bound::TIMES * own.mean);
    vec![
        claim(
            "From a uniform start over a map of look-alikes it converges to one hypothesis, the right one",
            format!("{}; after {}", of_runs(converged.len(), of), mean(&converged, "s")),
            share(converged.len(), of)[0] > bound::CONVERGED,
        ),
        claim(
            "Pruning and merging keep few hypotheses; without them there are many times as many",
            format!(
                "mean over a run {}, never more than {most} of {ALLOWED}; without them {}",
                mean(&kept, ""),
                mean(&unpruned, "")
            ),
            few && many,
        ),
        claim(
            "A robot that is carried off finds itself again",
            format!("{}; after {}", of_runs(recovered.len(), of), mean(&recovered, "s")),
            share(recovered.len(), of)[0] > bound::CONVERGED,
        ),
        claim(
            "A robot that is left alone does not believe itself carried off",
            format!("another place believed after the right one in {}", of_runs(strayed, of)),
            share(strayed, of)[1] < bound::FAILED,
        ),
        claim(
            "Planted fault: without a reserve it does not find itself again",
            format!("{} do; {before} had converged before", of_runs(not_recovered.len(), of)),
            share(not_recovered.len(), of)[1] < bound::WITHOUT_RESERVE,
        ),
        claim(
            "On a map that is its own image it does not decide, and keeps both places",
            format!(
                "decided in {}; both at weights of 0.4 to 0.6 at the end in {}",
                of_runs(decided, of),
                of_runs(undecided, of)
            ),
            share(decided, of)[1] < bound::FAILED && share(undecided, of)[0] > bound::CONVERGED,
        ),
        claim(
            "With recognition that is certain and a start that is told it is the plain filter",
            format!(
                "largest difference of any number over {} runs {}",
                outcome.plain.len(),
                quantity(plain, "")
            ),
            plain < bound::PLAIN,
        ),
        claim(
            "The winner is as good as it says",
            format!(
                "average NEES per degree {anees:.2} (99 % of consistent filters: {low:.2}..{high:.2}); position error {}",
                mean(&errors, "m")
            ),
            (low..=high).contains(&anees),
        ),
    ]
}

fn numbers(outcome: &Outcome) -> serde_json::Map<String, serde_json::Value> {
    let mut numbers = serde_json::Map::new();
    let mut put = |name: &str, value: serde_json::Value| {
        numbers.insert(name.to_owned(), value);
    };
    let of = outcome.clean.len();
    let converged = outcome.converged_s();
    let recovered = outcome.recovered_s(&outcome.kidnapped);
    put("seeds", json!(of));
    put("converged_share", json!({"hits": converged.len(), "interval": share(converged.len(), of)}));
    put("converged_after_s", json!(Estimate::of(&converged)));
    put("recovered_share", json!({"hits": recovered.len(), "interval": share(recovered.len(), of)}));
    put("recovered_after_s", json!(Estimate::of(&recovered)));
    put("recovered_without_reserve", json!(outcome.recovered_s(&outcome.without_reserve).len()));
    put("strayed", json!(outcome.clean.iter().filter(|run| run.strayed()).count()));
    let farthest: Vec<f64> = outcome.clean.iter().map(Run::farthest_believed_m).collect();
    put("farthest_believed_m", json!(farthest.iter().copied().fold(0.0, f64::max)));
    put("ever_wrong", json!(outcome.clean.iter().filter(|run| run.ever_wrong()).count()));
    put("most_hypotheses", json!(outcome.most()));
    put("mean_hypotheses", json!(Estimate::of(&Outcome::kept(&outcome.clean))));
    put("mean_hypotheses_unpruned", json!(Estimate::of(&Outcome::kept(&outcome.unpruned))));
    put("symmetric_undecided", json!(outcome.undecided()));
    put("plain_largest_difference", json!(outcome.plain.iter().copied().fold(0.0, f64::max)));
    put("anees", json!(outcome.anees().0));
    let errors: Vec<f64> = outcome.clean.iter().map(|run| run.error_m).collect();
    put("final_position_error_m", json!(Estimate::of(&errors)));
    numbers
}
