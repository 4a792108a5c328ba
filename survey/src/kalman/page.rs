//! The study's claims, tables and figures.

use pleiad_report::{Axis, Colour, Dash, Figure, Table, Trace, quantity, with_interval};
use serde_json::json;

use super::NAME;
use super::consistency::{Consistency, System, Told, consistency, one_run};
use super::steady::{
    AlphaBeta, ScalarWalk, Settled, kalata, settle_constant_velocity, settle_walk, vanishing_noise,
};
use crate::error::SurveyError;
use crate::pages::{blank, claim, figure, number, table};
use crate::study::Study;

/// Ratios of process to measurement noise.
const RATIOS: [f64; 10] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1e4];
/// Measurement noises.
const NOISES: [f64; 3] = [1e-4, 1.0, 2500.0];
/// Kalata's tracking indices.
const INDICES: [f64; 7] = [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0];
/// The bound of the closed form of the scalar filter, a share of the variance.
const WALK_BOUND: f64 = 1e-12;
/// That of Kalata's: its square roots cancel four digits at the smallest index.
const KALATA_BOUND: f64 = 1e-10;
const LEAD: &str = "The Kalman filter on systems whose answer is known in closed form: a scalar random walk and a target of \
constant velocity. The filters of the studies of one robot are made of the same two steps: `pleiad_estimation::linear`. Sources: Kalman 1960; \
Bar-Shalom, Li and Kirubarajan 2001; Kalata 1984.";

pub(super) fn study(seeds: &[u64]) -> Result<Study, SurveyError> {
    let mut page = blank(NAME, "Kalman filter", LEAD);
    scalar(&mut page)?;
    without_process_noise(&mut page)?;
    alpha_beta(&mut page)?;
    consistent(&mut page, seeds)?;
    Ok(page)
}

fn scalar(page: &mut Study) -> Result<(), SurveyError> {
    let mut worst = 0.0_f64;
    let mut below = true;
    let mut rows = Table::new(
        "Random walk with R = 1: posterior variance and gain in the steady state.",
        ["Q / R", "P, filter", "P, closed form", "gain", "steps"],
    )
    .numeric();
    let mut drawn: Vec<(f64, Settled, ScalarWalk)> = Vec::new();
    for r in NOISES {
        for ratio in RATIOS {
            let walk = ScalarWalk { q: ratio * r, r };
            let settled = settle_walk(walk)?;
            worst = worst.max((settled.variance / walk.steady_variance() - 1.0).abs());
            worst = worst.max((settled.gain / walk.steady_gain() - 1.0).abs());
            below &= settled.variance < r;
            if (r - 1.0).abs() < f64::EPSILON {
                let form = format!("{:.6e}", walk.steady_variance());
                let row = [format!("{ratio}"), format!("{:.6e}", settled.variance), form];
                rows =
                    rows.row(row.into_iter().chain([quantity(settled.gain, ""), settled.steps.to_string()]));
                drawn.push((ratio, settled, walk));
            }
        }
    }
    claim(
        page,
        "The scalar filter settles to P = (-Q + sqrt(Q^2 + 4QR)) / 2, to 1e-12 of it",
        format!("largest relative difference of P and of the gain over 30 pairs of Q and R: {worst:.1e}"),
        worst <= WALK_BOUND,
    );
    claim(page, "P is below R, whatever Q", format!("in {} of 30 pairs", if below { 30 } else { 0 }), below);
    number(page, "steady_state_largest_relative_difference", worst);
    let column = |pick: fn(&(f64, Settled, ScalarWalk)) -> f64| drawn.iter().map(pick).collect::<Vec<f64>>();
    let (ratios, gains) = (column(|d| d.0), column(|d| d.1.gain));
    let drawing = Figure::new(
        Axis::new("process over measurement noise Q / R", "-").logarithmic(),
        Axis::new("gain in the steady state", "-").logarithmic(),
    )
    .trace(Trace::line("closed form", &ratios, &column(|d| d.2.steady_gain()), Colour::Muted))
    .trace(
        Trace::line(
            "sqrt(Q/R)",
            &ratios,
            &ratios.iter().map(|q| q.sqrt()).collect::<Vec<_>>(),
            Colour::Muted,
        )
        .dash(Dash::Dot),
    )
    .trace(Trace::markers("filter", &ratios, &gains, Colour::Series(0), "circle", 8.0))
    .height(340);
    table(page, rows);
    figure(
        page,
        drawing,
        "Gain of the scalar filter in the steady state. It vanishes with Q, as the root of Q/R, and comes near one where the \
         state wanders more than is measured wrongly.",
    );
    Ok(())
}

fn without_process_noise(page: &mut Study) -> Result<(), SurveyError> {
    let small = ScalarWalk { q: 1e-8, r: 1.0 };
    let ratio = settle_walk(small)?.gain / small.q.sqrt();
    let gains = vanishing_noise(1.0, 4.0, 10_000)?;
    let worst = gains.iter().map(|[found, form]| (found / form - 1.0).abs()).fold(0.0, f64::max);
    let last = gains.last().map_or(f64::NAN, |own| own[0]);
    // To first order the gain is sqrt(Q/R) (1 - sqrt(Q/R)/2): 5e-5 below it here.
    let holds = (ratio - 1.0).abs() < 1e-4 && worst < 1e-10;
    claim(
        page,
        "With Q to 0 the gain goes to 0",
        format!(
            "gain / sqrt(Q/R) at Q/R = 1e-8: {ratio:.6}; at Q = 0 the gain is 1 / (k + R/P0) to {worst:.0e} over 10,000 \
             measurements, the last {last:.2e}"
        ),
        holds,
    );
    number(page, "gain_over_root_at_1e_minus_8", ratio);
    number(page, "gain_without_process_noise_largest_relative_difference", worst);
    Ok(())
}

fn alpha_beta(page: &mut Study) -> Result<(), SurveyError> {
    let mut rows = Table::new(
        "Constant velocity, the filter's steady gains next to Kalata's: alpha of the position, beta of the velocity times the \
         period.",
        ["tracking index", "alpha, filter", "alpha, Kalata", "beta, filter", "beta, Kalata"],
    )
    .numeric();
    let mut worst = 0.0_f64;
    let mut found = Vec::new();
    for index in INDICES {
        let form = kalata(index);
        for (period_s, sigma_m) in [(1.0, 1.0), (0.1, 0.8)] {
            let own = settle_constant_velocity(index, period_s, sigma_m)?;
            let pairs = [(own.alpha, form.alpha), (own.beta, form.beta)];
            let all = pairs.into_iter().chain(own.posterior.into_iter().zip(form.posterior));
            worst = all.map(|(a, b)| (a / b - 1.0).abs()).fold(worst, f64::max);
            if period_s < 1.0 {
                let cells = [index, own.alpha, form.alpha, own.beta, form.beta];
                rows = rows.row(
                    cells
                        .iter()
                        .enumerate()
                        .map(|(k, value)| if k == 0 { value.to_string() } else { format!("{value:.9}") }),
                );
                found.push(own);
            }
        }
    }
    claim(
        page,
        "The constant-velocity filter settles to Kalata's alpha and beta and their covariance, to 1e-10",
        format!("largest relative difference over 7 tracking indices and 2 periods: {worst:.1e}"),
        worst <= KALATA_BOUND,
    );
    number(page, "alpha_beta_largest_relative_difference", worst);
    let fine: Vec<f64> = (-200..=100).map(|k| 10_f64.powf(f64::from(k) / 100.0)).collect();
    let form =
        |pick: fn(AlphaBeta) -> f64| fine.iter().map(|index| pick(kalata(*index))).collect::<Vec<f64>>();
    let own = |pick: fn(&AlphaBeta) -> f64| found.iter().map(pick).collect::<Vec<f64>>();
    let drawing = Figure::new(
        Axis::new("tracking index", "-").logarithmic(),
        Axis::new("gain in the steady state", "-").from_zero(),
    )
    .trace(Trace::line("alpha, Kalata", &fine, &form(|own| own.alpha), Colour::Series(0)))
    .trace(Trace::line("beta, Kalata", &fine, &form(|own| own.beta), Colour::Series(1)))
    .trace(Trace::markers("alpha, filter", &INDICES, &own(|own| own.alpha), Colour::Series(0), "circle", 8.0))
    .trace(Trace::markers("beta, filter", &INDICES, &own(|own| own.beta), Colour::Series(1), "diamond", 8.0))
    .height(340);
    table(page, rows);
    figure(page, drawing, "The steady gains of the constant-velocity filter next to Kalata's closed form.");
    Ok(())
}

fn consistent(page: &mut Study, seeds: &[u64]) -> Result<(), SurveyError> {
    let wrong = [
        ("the truth", Told::TRUTH),
        ("a tenth of the process noise", Told { process: 0.1, measurement: 1.0 }),
        ("a quarter of the measurement noise", Told { process: 1.0, measurement: 0.25 }),
    ];
    let mut rows = Table::new(
        format!(
            "Normalized errors (NEES) and innovations (NIS) per dimension over {} draws: 1 for a consistent filter. Of the \
             five times at which errors are judged the one farthest from 1 is shown.",
            seeds.len()
        ),
        ["system", "the filter is told", "NEES", "its 99 % interval", "NIS", "its 95 % interval"],
    );
    let mut told_apart = true;
    for (k, (words, told)) in wrong.into_iter().enumerate() {
        let walk = consistency(&System::walk(), told, seeds)?;
        let velocity = consistency(&System::constant_velocity(), told, seeds)?;
        for (system, own) in [("random walk", &walk), ("constant velocity", &velocity)] {
            rows = rows.row(cells(system, words, own));
        }
        let both = walk.holds() && velocity.holds();
        if k == 0 {
            let measured = [&walk, &velocity].map(|own| {
                let nees = own.nees.overall.unwrap_or(f64::NAN);
                format!("NEES {nees:.3}, NIS {}", with_interval(own.nis.mean_per_degree, around(own), ""))
            });
            claim(
                page,
                "The filter is as good as it says: NEES and NIS lie in their intervals",
                format!("random walk {}; constant velocity {}", measured[0], measured[1]),
                both,
            );
            for (name, own) in [("walk", &walk), ("constant_velocity", &velocity)] {
                number(page, &format!("{name}_nees_per_dimension"), json!(own.nees.overall));
                number(page, &format!("{name}_nis_per_dimension"), own.nis.mean_per_degree);
                number(page, &format!("{name}_nis_interval_95"), json!(own.nis.interval_95));
            }
        } else {
            told_apart &= !walk.holds() && !velocity.holds();
        }
    }
    claim(
        page,
        "A filter that is told wrong noises is found out",
        format!(
            "both systems, both wrong noises: {}",
            if told_apart { "all four found" } else { "not all found" }
        ),
        told_apart,
    );
    number(page, "runs", seeds.len());
    table(page, rows);
    if let Some(seed) = seeds.first() {
        figure(
            page,
            one_walk(*seed)?,
            "One draw of the random walk: the estimate with the band of two standard deviations, which narrows to the steady \
             state within ten measurements.",
        );
    }
    Ok(())
}

/// The interval that a mean of normalized innovations stands in, were it off by what chance allows.
fn around(own: &Consistency) -> [f64; 2] {
    let half = 0.5 * (own.nis.interval_95.1 - own.nis.interval_95.0);
    [own.nis.mean_per_degree - half, own.nis.mean_per_degree + half]
}

fn cells(system: &str, words: &str, own: &Consistency) -> [String; 6] {
    let distance = |anees: Option<f64>| anees.map_or(f64::INFINITY, |anees| (anees - 1.0).abs());
    let farthest = own.nees.times.iter().max_by(|a, b| distance(a.anees).total_cmp(&distance(b.anees)));
    let (anees, interval) = farthest
        .map_or((f64::NAN, (f64::NAN, f64::NAN)), |time| (time.anees.unwrap_or(f64::NAN), time.interval));
    let between = |(low, high): (f64, f64)| format!("{low:.3}..{high:.3}");
    [
        system.to_owned(),
        words.to_owned(),
        format!("{anees:.3}"),
        between(interval),
        format!("{:.3}", own.nis.mean_per_degree),
        between(own.nis.interval_95),
    ]
}

fn one_walk(seed: u64) -> Result<Figure, SurveyError> {
    let run = one_run(&System::walk(), Told::TRUTH, seed)?;
    let steps: Vec<f64> = (1..=run.truth.len()).map(|k| k as f64).collect();
    let truth: Vec<f64> = run.truth.iter().map(|state| state[0]).collect();
    let estimate: Vec<f64> = run.beliefs.iter().map(|own| own.mean[0]).collect();
    let bound = |sign: f64| -> Vec<f64> {
        run.beliefs.iter().map(|own| own.mean[0] + sign * 2.0 * own.sigma(0)).collect()
    };
    Ok(Figure::new(Axis::new("measurement", "-"), Axis::new("state", "-"))
        .trace(Trace::band("two sigma", &steps, &bound(-1.0), &bound(1.0), Colour::Series(0)))
        .trace(Trace::markers("measured", &steps, &run.measured, Colour::Muted, "circle-open", 5.0))
        .trace(Trace::line("truth", &steps, &truth, Colour::Ink))
        .trace(Trace::line("estimate", &steps, &estimate, Colour::Series(0))))
}
