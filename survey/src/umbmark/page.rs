//! What was measured, as claims, figures and numbers.

use pleiad_mismatch::calibration::umbmark::{Stage, WheelErrors};
use pleiad_report::Table;
use serde_json::{Map, Value, json};

use super::shown::{angles, masked, masked_ends_m, recovered, returns, spread_m, stages};
use super::{NAME, SQUARES, Trial, Trials};
use crate::monte_carlo::{Estimate, share};
use crate::study::{Claim, Shown, Study};

/// A mean error may be this share of what was injected less 1, or this much where nothing was injected.
const SHARE: f64 = 0.1;
const LEAST: f64 = 2e-4;
/// The paper speaks of an order of magnitude; below half of that the method would not do what it is known for.
const IMPROVEMENT: f64 = 5.0;

type Pick = fn(WheelErrors) -> f64;
const RATIOS: [(&str, Pick); 3] =
    [("E_d", |errors| errors.e_d), ("E_b", |errors| errors.e_b), ("E_s", |errors| errors.e_s)];

pub(super) fn study(trials: &Trials) -> Study {
    let own = &trials.own;
    let mut claims = Vec::new();
    let mut numbers = Map::new();
    for ratio in RATIOS {
        claims.extend(recovery(own, ratio, &mut numbers));
    }
    claims.extend(coverage(own, &mut numbers));
    claims.extend(improvement(own, &mut numbers));
    claims.extend(of_turns(own, &mut numbers));
    claims.push(swapped(own));
    claims.extend(drawn(&trials.drawn, &mut numbers));
    claims.push(one_direction());
    let mut shown = Vec::new();
    if let Some(first) = own.first() {
        let own_stages: [(&str, &Stage); 2] =
            [("before", &first.calibration.before), ("after, fresh runs", &first.after)];
        shown.push(returns(&own_stages));
        let mut all = own_stages.to_vec();
        all.push(("track alone corrected", &first.track_alone));
        all.push(("c_L and c_R exchanged", &first.swapped));
        shown.push(stages(&all));
        shown.push(angles(&first.calibration));
        insert_first(first, &mut numbers);
    }
    shown.push(Shown::Table(spread(own)));
    shown.push(recovered(&trials.drawn));
    shown.extend(masked());
    Study {
        name: NAME,
        title: "UMBmark: systematic odometry errors from squares in both directions".to_owned(),
        lead: format!(
            "A robot drives {SQUARES} squares clockwise and {SQUARES} counter-clockwise by its own odometry; the pose is \
             measured at start and end alone. The centres of gravity of the return errors give E_d, the right wheel's \
             diameter over the left one's, and E_b, the track over the nominal one (Borenstein and Feng 1996); straight lines \
             give E_s, the mean diameter over the nominal one. The correction is tried on \
             fresh runs. Over {} seeds.",
            own.len()
        ),
        claims,
        shown,
        numbers,
    }
}

/// The calibration of the first seed: what the corrected model is written from.
fn insert_first(first: &Trial, numbers: &mut Map<String, Value>) {
    let calibration = &first.calibration;
    let errors = calibration.factors.errors();
    let own = [
        ("before", json!(calibration.before)),
        ("after", json!(first.after)),
        ("swapped", json!(first.swapped)),
        ("e_d", json!(errors.e_d)),
        ("e_b", json!(errors.e_b)),
        ("e_s", json!(calibration.e_s.map(|e_s| e_s.value))),
        (
            "ci95",
            json!({
                "e_d": calibration.e_d.ci95, "e_b": calibration.e_b.ci95, "e_s": calibration.e_s.and_then(|e_s| e_s.ci95),
            }),
        ),
        ("turn_ratio", json!(calibration.turn_ratio)),
        ("c_l", json!(calibration.factors.left)),
        ("c_r", json!(calibration.factors.right)),
        ("alpha_rad", json!(calibration.angles.alpha_rad)),
        ("beta_rad", json!(calibration.angles.beta_rad)),
        ("angles", json!(calibration.angles)),
        ("radius_m", json!(calibration.radius_m)),
        ("side_m", json!(calibration.side_m)),
        ("injected", json!(first.injected)),
        ("seeds_note", json!("before, after and the ratios are those of the first seed; claims are of all")),
    ];
    numbers.extend(own.map(|(name, value)| (name.to_owned(), value)));
}

/// A ratio against what was injected.
fn recovery(own: &[Trial], (name, pick): (&str, Pick), numbers: &mut Map<String, Value>) -> Option<Claim> {
    let injected = pick(own.first()?.injected);
    let errors: Vec<f64> =
        own.iter().map(|trial| pick(trial.calibration.factors.errors()) - pick(trial.injected)).collect();
    let error = Estimate::of(&errors)?;
    let bound = (SHARE * (injected - 1.0).abs()).max(LEAST);
    numbers.insert(format!("{}_error", name.to_lowercase()), json!(error));
    Some(Claim {
        statement: format!(
            "{name}, injected as {injected:.5}, is recovered with a mean error within {bound:.5} (a tenth of what it departs \
             from 1)"
        ),
        measured: format!(
            "mean error {:+.6}, interval {:+.6} to {:+.6}; one procedure scatters by {:.6}",
            error.mean, error.interval[0], error.interval[1], error.spread
        ),
        holds: error.interval.iter().all(|end| end.abs() <= bound),
    })
}

/// Whether the intervals that are reported hold what they should.
fn coverage(own: &[Trial], numbers: &mut Map<String, Value>) -> Option<Claim> {
    let mut hits = [0, 0];
    for trial in own {
        let intervals = [
            (trial.calibration.e_d.ci95?, trial.injected.e_d),
            (trial.calibration.e_b.ci95?, trial.injected.e_b),
        ];
        for (hits, ([low, high], injected)) in hits.iter_mut().zip(intervals) {
            *hits += usize::from((low..=high).contains(&injected));
        }
    }
    let shares = hits.map(|hits| share(hits, own.len()));
    numbers.insert("coverage".into(), json!({"e_d": hits[0], "e_b": hits[1], "of": own.len()}));
    Some(Claim {
        statement: "The 95 % intervals that a calibration states for E_d and E_b hold what was injected as often as they \
                    say"
            .to_owned(),
        measured: format!(
            "E_d in {} of {} ({:.0} to {:.0} %), E_b in {} ({:.0} to {:.0} %)",
            hits[0],
            own.len(),
            100.0 * shares[0][0],
            100.0 * shares[0][1],
            hits[1],
            100.0 * shares[1][0],
            100.0 * shares[1][1],
        ),
        holds: shares.iter().all(|[low, high]| (*low..=*high).contains(&0.95)),
    })
}

fn improvement(own: &[Trial], numbers: &mut Map<String, Value>) -> Option<Claim> {
    let logs: Vec<f64> = own.iter().map(|trial| trial.improvement().ln()).collect();
    let ratio = Estimate::of(&logs)?;
    let [low, high] = ratio.interval.map(f64::exp);
    let mean = |of: fn(&Trial) -> f64| own.iter().map(of).sum::<f64>() / own.len() as f64;
    let before_m = mean(|trial| trial.calibration.before.e_max_syst_m);
    let after_m = mean(|trial| trial.after.e_max_syst_m);
    let noise_m = mean(|trial| spread_m([&trial.after.clockwise, &trial.after.counter_clockwise]));
    let scale = json!({"geometric_mean": ratio.mean.exp(), "interval": [low, high], "runs": ratio.runs});
    numbers.insert("improvement".into(), scale);
    numbers.insert("mean_e_max_syst_m".into(), json!({"before": before_m, "after": after_m}));
    Some(Claim {
        statement: format!(
            "On fresh runs the correction divides E_max,syst by more than {IMPROVEMENT:.0} (the paper: about an order of \
             magnitude)"
        ),
        measured: format!(
            "by {:.1}, interval {low:.1} to {high:.1}: {before_m:.3} m to {after_m:.3} m; single runs scatter by \
             {noise_m:.3} m per axis, so that a mean of {SQUARES} is not known better than {:.3} m",
            ratio.mean.exp(),
            noise_m / (SQUARES as f64).sqrt()
        ),
        holds: low > IMPROVEMENT,
    })
}

/// Turns on the spot show `E_s / E_b`, and nothing of `E_s` alone.
fn of_turns(own: &[Trial], numbers: &mut Map<String, Value>) -> Option<Claim> {
    let ratios: Option<Vec<f64>> =
        own.iter().map(|trial| Some(trial.calibration.turn_ratio?.value)).collect();
    let ratio = Estimate::of(&ratios?)?;
    let injected = own.first()?.injected;
    let expected = injected.e_s / injected.e_b;
    numbers.insert("turn_ratio_over_seeds".into(), json!(ratio));
    Some(Claim {
        statement: format!(
            "A turn on the spot measures E_s / E_b (injected {expected:.5}), as the squares do; E_s = {:.5} alone it gives only \
             where the track is nominal",
            injected.e_s
        ),
        measured: format!(
            "true over reckoned angle {:.6}, interval {:.6} to {:.6}",
            ratio.mean, ratio.interval[0], ratio.interval[1]
        ),
        holds: ratio.interval.iter().all(|end| (end - expected).abs() < 1e-3),
    })
}

/// The labels of the correction factors.
fn swapped(own: &[Trial]) -> Claim {
    let worse =
        own.iter().filter(|trial| trial.swapped.e_max_syst_m > trial.track_alone.e_max_syst_m).count();
    Claim {
        statement: "D_L = 2 / (E_d + 1) D_a with E_d = D_R / D_L; with c_L and c_R on each other's wheels it is worse than with the \
                    track alone corrected"
            .to_owned(),
        measured: format!("worse in {worse} of {}", own.len()),
        holds: worse == own.len(),
    }
}

/// Robots drawn at random.
fn drawn(drawn: &[(WheelErrors, WheelErrors)], numbers: &mut Map<String, Value>) -> Option<Claim> {
    let mut measured = Vec::new();
    let mut holds = true;
    for (name, pick) in RATIOS {
        let square = |of: &dyn Fn(&(WheelErrors, WheelErrors)) -> f64| {
            let squares: Vec<f64> = drawn.iter().map(|pair| of(pair).powi(2)).collect();
            Estimate::of(&squares)
        };
        let error = square(&|(injected, found)| pick(*found) - pick(*injected))?;
        let injected = square(&|(injected, _)| pick(*injected) - 1.0)?;
        let (error, bound) = (error.interval[1].max(0.0).sqrt(), injected.mean.sqrt());
        holds &= error < 0.2 * bound;
        numbers.insert(
            format!("{}_drawn", name.to_lowercase()),
            json!({"rms_error_at_most": error, "rms_injected": bound}),
        );
        measured.push(format!("{name}: at most {error:.5} of {bound:.5}"));
    }
    Some(Claim {
        statement: format!(
            "Of {} robots drawn at random the ratios are recovered with a root mean square error below a fifth of what they \
             depart from 1",
            drawn.len()
        ),
        measured: measured.join("; "),
        holds,
    })
}

fn one_direction() -> Claim {
    let [home_m, away_m] = masked_ends_m();
    Claim {
        statement: "One direction can hide both errors: E_d = 1.004 with a track 1.0339 times the nominal 0.3 m comes home \
                    within 0.3 mm counter-clockwise and misses by 1.22 m clockwise"
            .to_owned(),
        measured: format!("in closed form {:.2} mm and {away_m:.3} m", 1e3 * home_m),
        holds: (home_m - 3e-4).abs() < 5e-5 && (away_m - 1.22).abs() < 5e-3,
    }
}

fn spread(own: &[Trial]) -> Table {
    let mut table = Table::new(
        "Over the seeds: mean and standard deviation of one procedure.",
        ["", "injected", "mean", "standard deviation"],
    )
    .numeric();
    let Some(injected) = own.first().map(|trial| trial.injected) else { return table };
    for (name, pick) in RATIOS {
        let values: Vec<f64> = own.iter().map(|trial| pick(trial.calibration.factors.errors())).collect();
        if let Some(estimate) = Estimate::of(&values) {
            let cells = [pick(injected), estimate.mean, estimate.spread].map(|value| format!("{value:.5}"));
            table = table.row(std::iter::once(name.to_owned()).chain(cells));
        }
    }
    table
}
