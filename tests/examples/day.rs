//! A day of a simulated team that closes its past, and what it keeps: `cargo run --release -p pleiad-tests
//! --example day -- [ROBOTS] [HOURS] [AWAY_FROM_HOUR AWAY_TO_HOUR]`. `docs/benchmarks/ledger.md` has the figures.

#![allow(clippy::print_stdout, reason = "a program of its own")]

use std::error::Error;
use std::time::Instant;

use pleiad_estimation::Timestamp;
use pleiad_estimation::fact::{Answer, Entry, EntryId, Fingerprint, NominalState};
use pleiad_estimation::fold::FactKey;
use pleiad_estimation::ledger::FactRecord;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let robots = arguments.next().map_or(Ok(5), |text| text.parse())?;
    let hours = arguments.next().map_or(Ok(24.0), |text| text.parse())?;
    let away: Vec<f64> = arguments.map(|text| text.parse()).collect::<Result<_, _>>()?;
    let away = match away[..] {
        [] => None,
        [from, to] if from < to => Some((from, to)),
        _ => return Err("AWAY_FROM_HOUR AWAY_TO_HOUR: two hours, ascending".into()),
    };
    let begun = Instant::now();
    println!(
        "hour  kept at most  entries  facts  odometry  in memory, B  journal, records  journal, B  unanswered  used  cuts"
    );
    let outcome = pleiad_sim_peers::simulation::operate(robots, hours, away, |hour| {
        // Without what maps and vectors take beyond their contents.
        let bytes = hour.entries * (size_of::<Entry>() + size_of::<Fingerprint>())
            + hour.facts_kept * (size_of::<FactKey>() + size_of::<FactRecord>())
            + (hour.kept - (hour.entries + hour.facts_kept).min(hour.kept)) * size_of::<(EntryId, Answer)>()
            + hour.ticks * size_of::<(Timestamp, NominalState)>();
        println!(
            "{:5.2}  {:11}  {:7}  {:6}  {:8}  {bytes:12}  {:16}  {:10}  {:10}  {:6}  {:6}",
            hour.hour,
            hour.kept,
            hour.entries,
            hour.facts_kept,
            hour.ticks,
            hour.records,
            hour.journal_bytes,
            hour.pending,
            hour.facts,
            hour.cuts
        );
    });
    outcome.map_err(|violation| violation.to_string())?;
    println!("{:.0} s", begun.elapsed().as_secs_f64());
    Ok(())
}
