//! Shell completions.

use clap::CommandFactory;

use crate::cli::Cli;
use crate::output;

/// Prints the completions of a shell.
pub fn completions(shell: clap_complete::Shell) -> anyhow::Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "pleiad", &mut text);
    output::raw(&String::from_utf8(text)?)
}
