//! Writes the figures of `docs/benchmarks/mrclam-diagnosis.md`:
//! `cargo run -p pleiad-tests --example mrclam_diagnosis -- differences`, with `controls`, or with
//! `directions MODEL MODEL`: two `corrected.toml` that `pleiad diagnose` fitted on dataset 6 and on dataset 2.

use std::io::{self, Write as _};
use std::path::Path;

use pleiad_estimation::RobotId;
use pleiad_mismatch::{Finding, Findings, models};
use pleiad_recording::Recording;
use pleiad_tests::mrclam::{
    CHANGES, CONTROLS, Direction, Of, agents_error_m, differences, directions, fitted_and_tested, mean_of,
    read, recording, refitted,
};

fn main() -> io::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["differences"] => print_differences(),
        ["controls"] => print_controls(),
        ["directions", on_six, on_two] => print_directions([on_six, on_two].map(Path::new)),
        _ => writeln!(io::stderr(), "expected differences, controls, or directions with two models"),
    }
}

fn print_differences() -> io::Result<()> {
    let mut out = io::stdout();
    let recording = recording(6);
    for change in CHANGES {
        for own in differences(&recording, change) {
            writeln!(
                out,
                "| {} | {} | {} | {:+.4} | {:+.4} | {:+.4} | {:.4} |",
                own.change,
                own.robot,
                own.parameter,
                own.unchanged,
                own.found(),
                own.injected,
                own.half_width
            )?;
        }
    }
    Ok(())
}

fn print_controls() -> io::Result<()> {
    let recordings = [6, 2].map(recording);
    for (name, control) in CONTROLS {
        writeln!(io::stdout(), "{name}")?;
        let [six, two] = recordings.clone().map(control);
        print_findings(&fitted_and_tested(&six, &two).findings)?;
    }
    Ok(())
}

/// Errors of agents that are told nothing and of agents that load the corrected model.
fn print_agents(number: u32, model: &Path) -> io::Result<()> {
    for landmarks in ["none", "known"] {
        let [without, with] = [None, Some(model)].map(|model| agents_error_m(number, landmarks, model));
        writeln!(io::stdout(), "agents on {number}, landmarks {landmarks}: {without:.4} -> {with:.4} m")?;
    }
    Ok(())
}

/// What the models found on dataset 6 and on dataset 2 are worth on the other.
fn print_directions(found: [&Path; 2]) -> io::Result<()> {
    let mut out = io::stdout();
    let recordings = [6, 2].map(recording);
    let mut all: Vec<Direction> = Vec::new();
    for ([first, second], model) in [[0, 1], [1, 0]].into_iter().zip(found) {
        let (fit_on, test_on): (&Recording, &Recording) = (&recordings[first], &recordings[second]);
        print_agents([6, 2][second], model)?;
        let refitted = refitted(fit_on, test_on);
        let nominal = models(test_on).map_err(io::Error::other)?;
        let corrected = read(model, test_on);
        for own in directions(test_on, &refitted, &corrected, 5.0) {
            let RobotId(robot) = own.robot;
            writeln!(
                out,
                "| {robot} | {} | heading {:.4} -> {:.4} | position {:.4} -> {:.4} |",
                test_on.name,
                rms(own.heading.iter().map(|pair| pair.before)),
                rms(own.heading.iter().map(|pair| pair.after)),
                rms(own.position.iter().map(|pair| pair.before)),
                rms(own.position.iter().map(|pair| pair.after)),
            )?;
            all.push(own);
        }
        for own in directions(test_on, &nominal, &corrected, 5.0) {
            writeln!(
                out,
                "  nominal heading {:.4} position {:.4}",
                rms(own.heading.iter().map(|pair| pair.before)),
                rms(own.position.iter().map(|pair| pair.before))
            )?;
        }
    }
    for (name, of) in [("heading", Of::Heading), ("position", Of::Position)] {
        let found = mean_of(&all, of);
        writeln!(out, "{name}: {:.4} [{:.4}, {:.4}]", found.mean, found.ci95[0], found.ci95[1])?;
    }
    Ok(())
}

fn print_findings(findings: &Findings) -> io::Result<()> {
    let mut out = io::stdout();
    for own in &findings.findings {
        let Finding { verdict, robots, effect, support_set, held_out, .. } = own;
        let (gain, error) = (held_out.log_score_gain, held_out.log_score_gain_se);
        writeln!(
            out,
            "  {verdict:?} {robots:?} {} {support_set:?} p {:.1e} gain {gain:.1} +- {error:.1}",
            effect.as_deref().unwrap_or("-"),
            own.p_familywise
        )?;
        for (label, estimate) in &own.parameters {
            let [low, high] = estimate.ci95;
            writeln!(out, "      {label} {:+.4} [{low:+.4}, {high:+.4}] {}", estimate.value, estimate.unit)?;
        }
    }
    for note in findings.notes.iter().filter(|note| note.ends_with("no finding")) {
        writeln!(out, "  note: {note}")?;
    }
    Ok(())
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value * value, count + 1.0));
    (sum / count).sqrt()
}
