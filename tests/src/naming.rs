//! Whether an effect that acts is named: the benchmark behind `docs/benchmarks/naming.md`.

#![allow(clippy::expect_used, clippy::missing_panics_doc, reason = "helpers of tests fail by panicking")]

use std::fmt::Write as _;

use pleiad_mismatch::{DiagnoseOptions, Finding, Findings, Verdict, acts_on_every_robot, diagnose};
use pleiad_physics::{Effect, EffectInfo};
use pleiad_sim_peers::simulate;

use crate::clean::told;
use crate::known_effects::{Case, ROBOT};

/// What became of an effect that acted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// Named, alone, on the right robots.
    Named,
    /// One of several that these data are said not to tell apart.
    InSet,
    /// Something else was found and it was not.
    Wrong,
    /// Nothing was found.
    Missed,
    /// It is said that it cannot be tested.
    Untestable,
}

/// What was said where an effect acted.
pub struct Told {
    /// What became of it.
    pub fate: Fate,
    /// Its rivals; where it is not found, every finding and what is said to be none.
    pub rivals: Vec<String>,
    /// Findings beside the right one, each a false one.
    pub extra: Vec<String>,
}

/// Simulates and diagnoses a case from a seed.
#[must_use]
pub fn tell(case: &Case, seed: u64) -> Told {
    let run = simulate(&case.scenario, seed).expect("a scenario that is valid");
    let found =
        diagnose(&[run.recording], &DiagnoseOptions::default()).expect("a recording with its nominal");
    let robots: Vec<u32> = if acts_on_every_robot(case.effect) {
        case.scenario.robots.keys().map(|robot| robot.0).collect()
    } else {
        vec![ROBOT.0]
    };
    judged(case.effect, &robots, &found.findings)
}

fn judged(effect: Effect, robots: &[u32], found: &Findings) -> Told {
    let info: &EffectInfo = effect.info();
    let right =
        |own: &&Finding| own.robots == robots && own.support_set.iter().any(|member| member == info.name);
    let Some(own) = found.findings.iter().find(right) else {
        let mut all: Vec<String> = found.findings.iter().map(told).collect();
        let untestable = found.untestable.iter().any(|one| one.effect == info.name);
        // Two effects that together are the same as this one, as is said.
        let said = format!("cannot be told from {} ", info.name);
        if let Some(note) = found.notes.iter().find(|note| note.contains(&said)) {
            let part = |own: &&Finding| own.effect.as_deref().is_some_and(|effect| note.contains(effect));
            let extra = found.findings.iter().filter(|own| !part(own)).map(told).collect();
            let rivals = found.findings.iter().filter(part).map(told).collect();
            return Told { fate: Fate::InSet, rivals, extra };
        }
        let fate = match (all.is_empty(), untestable) {
            (true, true) => Fate::Untestable,
            (true, false) => Fate::Missed,
            (false, _) => Fate::Wrong,
        };
        all.extend(found.notes.iter().filter(|note| note.contains("no finding")).cloned());
        return Told { fate, rivals: all, extra: Vec::new() };
    };
    let alone = matches!(own.verdict, Verdict::Named | Verdict::BadData) && own.support_set.len() == 1;
    let rivals = own.support_set.iter().filter(|member| *member != info.name).cloned().collect();
    let extra = found.findings.iter().filter(|other| !std::ptr::eq(*other, own)).map(told).collect();
    Told { fate: if alone { Fate::Named } else { Fate::InSet }, rivals, extra }
}

/// A row per case: what became of it from each seed, and what was said instead or besides.
#[must_use]
pub fn row(case: &Case, all: &[Told]) -> String {
    let info = case.effect.info();
    let of = |fate: Fate| all.iter().filter(|own| own.fate == fate).count();
    let mut words: Vec<String> = Vec::new();
    for own in all {
        let what = match own.fate {
            Fate::InSet => "with ",
            Fate::Wrong => "instead: ",
            _ => "",
        };
        words.extend(own.rivals.iter().map(|rival| format!("{what}{rival}")));
        words.extend(own.extra.iter().map(|extra| format!("besides: {extra}")));
    }
    words.dedup();
    let mut text = format!("| {} | `{}` |", info.number, info.name);
    for fate in FATES {
        let count = of(fate);
        let shown = if count == 0 { String::new() } else { count.to_string() };
        // Writing to a string cannot fail.
        let _ = write!(text, " {shown} |");
    }
    let extra = all.iter().filter(|own| !own.extra.is_empty()).count();
    let _ = writeln!(
        text,
        " {} | {} |",
        if extra == 0 { String::new() } else { extra.to_string() },
        words.join("; ")
    );
    text
}

const FATES: [Fate; 5] = [Fate::Named, Fate::InSet, Fate::Wrong, Fate::Missed, Fate::Untestable];

/// The table, and below it how many of all recordings had which fate.
#[must_use]
pub fn table(all: &[(&Case, Vec<Told>)]) -> String {
    let mut text = String::from(
        "| # | injected | named | one of several | wrong | missed | untestable | more besides | what else was said |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    for (case, told) in all {
        text += &row(case, told);
    }
    let told: Vec<&Told> = all.iter().flat_map(|(_, told)| told).collect();
    let of = |fate: Fate| told.iter().filter(|own| own.fate == fate).count();
    let [named, set, wrong, missed, untestable] = FATES.map(of);
    let extra = told.iter().filter(|own| !own.extra.is_empty()).count();
    let _ = writeln!(
        text,
        "\nOf {} recordings: named {named}, one of several {set}, wrong {wrong}, missed {missed}, said to be \
         untestable {untestable}; with a finding besides the right one {extra}.",
        told.len()
    );
    text
}
