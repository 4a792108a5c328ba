//! `pleiad init`: a scenario to begin with.

use std::fs::OpenOptions;
use std::io::Write as _;

use anyhow::{Context, bail};

use crate::cli::InitArgs;
use crate::output;

const SCENARIO: &str = include_str!("../../assets/init.toml");

pub fn run(args: &InitArgs) -> anyhow::Result<()> {
    let file = args.file.display();
    let mut opened = match OpenOptions::new().write(true).create_new(true).open(&args.file) {
        Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {
            bail!("{file} exists and is left as it is: name another file, or remove it")
        }
        opened => opened.with_context(|| format!("cannot create {file}"))?,
    };
    opened.write_all(SCENARIO.as_bytes()).with_context(|| format!("cannot write {file}"))?;
    output::raw(&format!("{file} is a scenario with comments. Now run: pleiad run {file}\n"))
}
