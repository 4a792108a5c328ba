//! Which recordings are fitted on and which are tested on.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::bail;

use crate::cli::DiagnoseArgs;

/// The recordings to use, with the names to fit and to test on: both empty if all take part in both.
pub(super) struct Chosen {
    /// Names and folders.
    pub recordings: Vec<(String, PathBuf)>,
    pub fit_on: Vec<String>,
    pub test_on: Vec<String>,
    /// Remarks, for people.
    pub notes: Vec<String>,
}

/// Chooses by name, before anything is read.
pub(super) fn choose(args: &DiagnoseArgs) -> anyhow::Result<Chosen> {
    let recordings: Vec<(String, PathBuf)> =
        args.recordings.iter().map(|path| (name(path), path.clone())).collect();
    let names: Vec<String> = recordings.iter().map(|(name, _)| name.clone()).collect();
    let mut seen = BTreeSet::new();
    if let Some((name, path)) = recordings.iter().find(|(name, _)| !seen.insert(name)) {
        bail!("{}: a second recording called {name}; give its folder another name", path.display());
    }
    for (option, asked) in [("--fit-on", &args.fit_on), ("--test-on", &args.test_on)] {
        if asked.iter().any(String::is_empty) {
            bail!("{option}: a name is empty; expected names of recordings separated by commas, as in a,b");
        }
        if let Some(unknown) = asked.iter().find(|name| !names.contains(name)) {
            bail!("{option}: no recording is called {unknown}; there is {}", names.join(", "));
        }
    }
    if let Some(name) = args.fit_on.iter().find(|name| args.test_on.contains(name)) {
        bail!(
            "{name} is named by --fit-on and by --test-on, but a model is tested on what it was not fitted on; take \
             the name out of one of them"
        );
    }
    if args.fit_on.is_empty() && args.test_on.is_empty() {
        return Ok(Chosen { recordings, fit_on: Vec::new(), test_on: Vec::new(), notes: Vec::new() });
    }
    let others = |taken: &[String]| -> Vec<String> {
        names.iter().filter(|name| !taken.contains(name)).cloned().collect()
    };
    let fit_on = if args.fit_on.is_empty() { others(&args.test_on) } else { args.fit_on.clone() };
    let test_on = if args.test_on.is_empty() { others(&args.fit_on) } else { args.test_on.clone() };
    if fit_on.is_empty() {
        bail!(
            "--test-on names every recording, so that no recording is left to fit on; add one, or leave one out"
        );
    }
    let (recordings, unused): (Vec<_>, Vec<_>) =
        recordings.into_iter().partition(|(name, _)| fit_on.contains(name) || test_on.contains(name));
    let notes = unused.iter().map(|(name, _)| format!("{name}: neither fitted nor tested on, so not used"));
    Ok(Chosen { recordings, fit_on, test_on, notes: notes.collect() })
}

/// The name of the folder or, without its ending, of the file that was given.
fn name(path: &Path) -> String {
    let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let own = if whole.is_file() { whole.file_stem() } else { whole.file_name() };
    own.map_or_else(|| whole.display().to_string(), |name| name.to_string_lossy().into_owned())
}
