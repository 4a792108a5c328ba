//! The subcommands.

mod agent;
mod calibrate;
mod concealed;
mod coordinator;
mod demo;
mod diagnose;
mod effects;
mod evaluate;
mod evict;
mod export;
mod faults;
mod init;
mod observability;
mod replay;
mod run;
mod runner;
mod shells;
mod sim_peers;
mod simulate;
mod slam;
mod study;
mod survey;
mod tune;
mod why;
mod worlds;

pub use runner::{Survived, with_samples};

use crate::cli::{Benchmark, Command};

/// Runs a subcommand to its end.
pub fn run(command: Command) -> anyhow::Result<()> {
    match command {
        Command::Demo(args) => demo::run(&args),
        Command::Init(args) => init::run(&args),
        Command::Run(args) => run::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Why(args) => why::run(&args),
        Command::Tune(args) => tune::run(&args),
        Command::Observability(args) => observability::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Diagnose(args) => diagnose::run(&args),
        Command::Benchmark(Benchmark::Concealed(args)) => concealed::run(&args),
        Command::Faults(args) => faults::run(&args),
        Command::Evaluate(args) => evaluate::run(&args),
        Command::Slam(args) => slam::run(&args),
        Command::Survey(args) => survey::run(&args),
        Command::Calibrate(command) => calibrate::run(&command),
        Command::Effects(args) => effects::run(&args),
        Command::Agent(args) => agent::run(&args),
        Command::Coordinator(args) => coordinator::run(&args),
        Command::Evict(args) => evict::run(&args),
        Command::SimPeers(args) => sim_peers::run(&args),
        Command::Completions { shell } => shells::completions(shell),
    }
}
