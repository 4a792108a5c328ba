//! The subcommands.

mod observability;
mod replay;
mod runner;
mod shells;

use crate::cli::Command;

/// Runs a subcommand to its end.
pub fn run(command: Command) -> anyhow::Result<()> {
    match command {
        Command::Replay(args) => replay::run(&args),
        Command::Observability(args) => observability::run(&args),
        Command::Completions { shell } => shells::completions(shell),
        _ => anyhow::bail!("x"),
    }
}
