//! Runs simulated schedules of a team: `cargo run -p pleiad-tests --features planted --example schedules -- --seeds A..B`.
//!
//! `--partitions` leaves out everything but losses and partitions; `--evictions` adds evictions. `--most-items N`
//! sets `ledger.most_items`, `--relinearize` has facts linearized together,
//! `--calibrate` has parameters, landmarks and garbage found out. `--keep-going`
//! does not stop at the first seed that fails. `--resume FILE` keeps there how far it has come, and goes on
//! from there. `--plant NAME` plants a mistake and tells which seed finds it.
//! A seed that fails is printed with the command that replays it.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program of its own")]

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

use pleiad_sim_peers::simulation::{Options, Outcome, Plan, Planted, run};

fn planted(name: &str) -> Result<Planted, String> {
    Ok(match name {
        "count-duplicates" => Planted::CountDuplicates,
        "skip-rewind" => Planted::SkipRewind,
        "forget-late-noise" => Planted::ForgetLateNoise,
        "mix-boots" => Planted::MixBoots,
        "close-by-numbers" => Planted::CloseByNumbers,
        "answer-blindly" => Planted::AnswerBlindly,
        "publish-first" => Planted::PublishFirst,
        other => return Err(format!("--plant {other}: there is no such mistake")),
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (mut first, mut end) = (0_u64, 1000_u64);
    let mut options = Options::default();
    let mut resume: Option<PathBuf> = None;
    let mut plant = String::new();
    let mut keep_going = false;
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or_else(|| format!("{argument}: a value is missing"));
        match argument.as_str() {
            "--seeds" => {
                let range = value()?;
                let (from, to) = range.split_once("..").ok_or("--seeds A..B")?;
                (first, end) = (from.parse()?, to.parse()?);
            }
            "--partitions" => options.partitions_only = true,
            "--evictions" => options.evictions = true,
            "--most-items" => options.most_items = Some(value()?.parse()?),
            "--relinearize" => options.relinearize = true,
            "--calibrate" => options.calibrate = true,
            "--keep-going" => keep_going = true,
            "--resume" => resume = Some(PathBuf::from(value()?)),
            "--plant" => {
                plant = value()?;
                options.planted = Some(planted(&plant)?);
            }
            other => {
                return Err(format!(
                    "{other}: expected --seeds, --partitions, --evictions, --most-items, --relinearize, --calibrate, --keep-going, --resume or --plant"
                )
                .into());
            }
        }
    }
    if let Some(path) = resume.as_ref().filter(|path| path.exists()) {
        first = first.max(std::fs::read_to_string(path)?.trim().parse()?);
    }
    let begun = Instant::now();
    let mut total = Outcome::default();
    let mut failed = 0;
    for seed in first..end {
        match run(seed, &options) {
            Ok(outcome) => add(&mut total, &outcome),
            Err(violation) => {
                failed += 1;
                println!("seed {seed}: {violation}");
                let kind = match (options.partitions_only, options.evictions) {
                    (true, _) => " --partitions",
                    (false, true) => " --evictions",
                    (false, false) => "",
                };
                let most =
                    options.most_items.map_or_else(String::new, |items| format!(" --most-items {items}"));
                let most = if options.relinearize { format!("{most} --relinearize") } else { most };
                let most = if options.calibrate { format!("{most} --calibrate") } else { most };
                let plant = if plant.is_empty() { String::new() } else { format!(" --plant {plant}") };
                println!(
                    "replay: cargo run -p pleiad-tests --features planted --example schedules -- --seeds {seed}..{}{kind}{most}{plant}",
                    seed + 1
                );
                if end - first == 1 {
                    println!("{:#?}", Plan::new(seed, &options));
                }
                if !keep_going {
                    return Err(format!("a violation after {} schedules", seed - first + 1).into());
                }
            }
        }
        let done = seed - first + 1;
        if done.is_multiple_of(1000) || seed + 1 == end {
            let rate = done as f64 / begun.elapsed().as_secs_f64();
            println!("{done} schedules, {rate:.0}/s, {failed} failed: {total:?}");
            if let Some(path) = &resume {
                std::fs::write(path, (seed + 1).to_string())?;
            }
        }
    }
    if failed > 0 { Err(format!("{failed} schedules failed").into()) } else { Ok(()) }
}

fn add(total: &mut Outcome, outcome: &Outcome) {
    total.robots += outcome.robots;
    total.seconds += outcome.seconds;
    total.messages += outcome.messages;
    total.facts += outcome.facts;
    total.deaths += outcome.deaths;
    total.cuts += outcome.cuts;
    total.taken_over += outcome.taken_over;
    total.evictions += outcome.evictions;
    total.expired += outcome.expired;
    total.most_kept = total.most_kept.max(outcome.most_kept);
    total.most_records = total.most_records.max(outcome.most_records);
}
