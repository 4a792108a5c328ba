//! What people and scripts see: text or one JSON object on stdout, everything else on stderr.

use std::io::Write;

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

/// Prints lines for people, or the object for scripts.
pub fn print(json: bool, object: &impl Serialize, text: &str) -> anyhow::Result<()> {
    if json {
        raw(&format!("{}\n", serde_json::to_string_pretty(object)?))
    } else {
        raw(&format!("{}\n", text.trim_end()))
    }
}

/// Prints text as it is. Whoever reads it may stop reading.
pub fn raw(text: &str) -> anyhow::Result<()> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        outcome => Ok(outcome?),
    }
}

/// The error and what led to it, a line each.
#[allow(clippy::print_stderr, reason = "the one place that reports a failure")]
pub fn error(error: &anyhow::Error) {
    eprintln!("error: {error}");
    for cause in error.chain().skip(1) {
        eprintln!("  because: {cause}");
    }
}

/// Whether `NO_COLOR` is set to something (<https://no-color.org>).
pub fn colours_are_unwanted() -> bool {
    std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty())
}

/// What is being done, on stderr; nothing where stderr is no terminal.
pub fn spinner(message: &str) -> ProgressBar {
    let spinner = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}  {elapsed}") {
        spinner.set_style(style);
    }
    spinner.set_message(message.to_owned());
    spinner.enable_steady_tick(std::time::Duration::from_millis(120));
    spinner
}

/// A bar over team time in seconds on stderr; nothing where stderr is no terminal.
pub fn progress(label: &str, seconds: f64) -> ProgressBar {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "seconds of a run")]
    let bar = ProgressBar::new(seconds.max(0.0) as u64);
    let style = ProgressStyle::with_template("{msg:32} {bar:40} {pos:>5}/{len} s  {elapsed}");
    if let Ok(style) = style {
        bar.set_style(style);
    }
    bar.set_message(label.to_owned());
    bar
}
