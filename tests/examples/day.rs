//! A day of a simulated team that closes its past, and what it keeps: `cargo run --release -p pleiad-tests
//! --example day -- [ROBOTS] [HOURS]`. `docs/benchmarks/ledger.md` has the figures.

#![allow(clippy::print_stdout, reason = "a program of its own")]

use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let robots = arguments.next().map_or(Ok(5), |text| text.parse())?;
    let hours = arguments.next().map_or(Ok(24.0), |text| text.parse())?;
    let begun = Instant::now();
    println!("hour  items in memory (most)  records in a journal (most)  facts used  cuts");
    let outcome = pleiad_sim_peers::simulation::operate(robots, hours, |hour| {
        println!(
            "{:5.2}  {:22}  {:27}  {:10}  {:5}",
            hour.hour, hour.kept, hour.records, hour.facts, hour.cuts
        );
    });
    outcome.map_err(|violation| violation.to_string())?;
    println!("{:.0} s", begun.elapsed().as_secs_f64());
    Ok(())
}
