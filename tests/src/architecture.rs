//! Checks that the workspace is what `ARCHITECTURE.md` says: functions over data, so that they can be
//! tested with a planted fault.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// What the tables of `ARCHITECTURE.md` allow.
#[derive(Clone, Debug, Default)]
pub struct Rules {
    /// One row per crate, by folder.
    pub crates: BTreeMap<String, Row>,
    /// Dependencies that one crate alone may name, and its folder.
    pub owners: BTreeMap<String, String>,
}

/// One row of the table of crates.
#[derive(Clone, Debug, Default)]
pub struct Row {
    /// The crate is announced but has no folder yet.
    pub later: bool,
    /// Folders of the crates it may depend on.
    pub may_depend_on: BTreeSet<String>,
    /// Dependencies it must not name.
    pub must_not_name: BTreeSet<String>,
}

/// The normal and build dependencies of one crate; what only its tests use is not an arrow.
#[derive(Clone, Debug, Default)]
pub struct Dependencies {
    /// Crates of the workspace, by folder.
    pub internal: BTreeSet<String>,
    /// Everything else, by package name.
    pub external: BTreeSet<String>,
}

/// The crates of the workspace by folder.
pub type Workspace = BTreeMap<String, Dependencies>;

impl Rules {
    /// Reads both tables: rows that begin with a folder (`` | `bus/` | ``) and rows whose second cell is one.
    ///
    /// # Errors
    /// A message naming the row that cannot be read, or saying that a table is missing.
    pub fn parse(markdown: &str) -> Result<Self, String> {
        let mut rules = Self::default();
        let mut allowed = BTreeMap::new();
        for line in markdown.lines().filter(|line| line.starts_with('|')) {
            let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
            let quoted: Vec<BTreeSet<String>> = cells.iter().map(|cell| in_backticks(cell)).collect();
            if let Some(folder) = quoted.first().and_then(single_folder) {
                let [first, _, arrows, _] = cells[..] else {
                    return Err(format!("ARCHITECTURE.md: expected 4 cells in the row of {folder}: {line}"));
                };
                allowed.insert(folder.clone(), arrows.to_owned());
                let row = Row {
                    later: first.contains("(later)"),
                    may_depend_on: BTreeSet::new(),
                    must_not_name: quoted[3].clone(),
                };
                if rules.crates.insert(folder.clone(), row).is_some() {
                    return Err(format!("ARCHITECTURE.md: two rows for {folder}"));
                }
            } else if let Some(folder) = quoted.get(1).and_then(single_folder) {
                rules.owners.extend(quoted[0].iter().map(|name| (name.clone(), folder.clone())));
            }
        }
        if rules.crates.is_empty() || rules.owners.is_empty() {
            return Err(
                "ARCHITECTURE.md: the table of crates or the table of sole dependencies is missing".into()
            );
        }
        let known: BTreeSet<String> = rules.crates.keys().cloned().collect();
        for (folder, cell) in &allowed {
            let arrows = parse_arrows(cell, &known).map_err(|unknown| {
                format!("ARCHITECTURE.md: the row of {folder} names {unknown}, which has no row")
            })?;
            if let Some(row) = rules.crates.get_mut(folder) {
                row.may_depend_on = arrows.into_iter().filter(|name| name != folder).collect();
            }
        }
        Ok(rules)
    }
}

/// `-`, `all`, `all but a, b` or `a, b`.
fn parse_arrows(cell: &str, known: &BTreeSet<String>) -> Result<BTreeSet<String>, String> {
    let listed = |names: &str| -> Result<BTreeSet<String>, String> {
        let names: BTreeSet<String> = names.split(',').map(|name| name.trim().to_owned()).collect();
        match names.difference(known).next() {
            Some(unknown) => Err(unknown.clone()),
            None => Ok(names),
        }
    };
    match cell {
        "-" => Ok(BTreeSet::new()),
        "all" => Ok(known.clone()),
        _ => match cell.strip_prefix("all but ") {
            Some(names) => Ok(known.difference(&listed(names)?).cloned().collect()),
            None => listed(cell),
        },
    }
}

fn in_backticks(cell: &str) -> BTreeSet<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

fn single_folder(names: &BTreeSet<String>) -> Option<String> {
    match names.len() {
        1 => names.first()?.strip_suffix('/').map(str::to_owned),
        _ => None,
    }
}

/// Reads the output of `cargo metadata --no-deps --format-version 1`.
///
/// # Errors
/// A message saying what is not as cargo writes it.
pub fn parse_metadata(json: &str) -> Result<Workspace, String> {
    let text = |value: &serde_json::Value, key: &str| {
        value[key].as_str().map(str::to_owned).ok_or_else(|| format!("cargo metadata: no `{key}` in {value}"))
    };
    let metadata: serde_json::Value =
        serde_json::from_str(json).map_err(|error| format!("cargo metadata: {error}"))?;
    let packages = metadata["packages"].as_array().ok_or("cargo metadata: no `packages`")?;
    let mut folders = BTreeMap::new();
    for package in packages {
        let manifest = PathBuf::from(text(package, "manifest_path")?);
        let folder =
            manifest.parent().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
        folders.insert(text(package, "name")?, folder.ok_or("cargo metadata: a manifest without a folder")?);
    }
    let mut workspace = Workspace::new();
    for package in packages {
        let mut found = Dependencies::default();
        for dependency in package["dependencies"].as_array().into_iter().flatten() {
            if dependency["kind"].as_str() == Some("dev") {
                continue;
            }
            let name = text(dependency, "name")?;
            match folders.get(&name) {
                Some(folder) => found.internal.insert(folder.clone()),
                None => found.external.insert(name),
            };
        }
        workspace.insert(folders[&text(package, "name")?].clone(), found);
    }
    Ok(workspace)
}

/// Everything in which the workspace differs from the rules, one sentence each.
pub fn violations(rules: &Rules, workspace: &Workspace) -> Vec<String> {
    let mut found = Vec::new();
    for (folder, row) in &rules.crates {
        match (row.later, workspace.contains_key(folder)) {
            (false, false) => found.push(format!("{folder} has a row but no crate: mark it *(later)*")),
            (true, true) => found.push(format!("{folder} is marked *(later)* but exists")),
            _ => {}
        }
    }
    for (folder, dependencies) in workspace {
        let Some(row) = rules.crates.get(folder) else {
            found.push(format!("{folder} has no row in the table of crates"));
            continue;
        };
        for name in dependencies.internal.difference(&row.may_depend_on) {
            found.push(format!("{folder} depends on {name}, which its row does not allow"));
        }
        for name in dependencies.external.intersection(&row.must_not_name) {
            found.push(format!("{folder} depends on {name}, which it must not know"));
        }
        for name in &dependencies.external {
            if let Some(owner) = rules.owners.get(name).filter(|owner| *owner != folder) {
                found.push(format!("{folder} depends on {name}, which only {owner} may name"));
            }
        }
    }
    found
}

/// Words that must not occur in some sources.
#[derive(Clone, Copy, Debug)]
pub struct Absence {
    /// Path prefixes under the root of the workspace.
    pub within: &'static [&'static str],
    /// Path prefixes left out.
    pub except: &'static [&'static str],
    /// What must not occur.
    pub words: &'static [&'static str],
    /// Why.
    pub because: &'static str,
}

/// The lines of a source that contain one of the words, with their numbers from 1. Comments are not read,
/// nor what follows `#[cfg(test)]`.
pub fn lines_with<'a>(source: &'a str, words: &[&str]) -> Vec<(usize, &'a str)> {
    let contains = |line: &str, word: &str| {
        line.match_indices(word).any(|(at, _)| {
            let before = line[..at].chars().next_back();
            !word.starts_with(char::is_alphabetic)
                || !before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':')
        })
    };
    source
        .lines()
        .enumerate()
        .take_while(|(_, line)| line.trim() != "#[cfg(test)]")
        .filter(|(_, line)| {
            let code = line.split("//").next().unwrap_or_default();
            words.iter().any(|word| contains(code, word))
        })
        .map(|(index, line)| (index + 1, line.trim()))
        .collect()
}

/// Where sources under `root` contain what they must not, one sentence each.
///
/// # Errors
/// A message naming the file that cannot be read.
pub fn occurrences(root: &Path, absence: &Absence) -> Result<Vec<String>, String> {
    let mut found = Vec::new();
    for path in rust_sources(root)? {
        let name = path.strip_prefix(root).unwrap_or(&path).to_string_lossy().replace('\\', "/");
        let within = |prefixes: &[&str]| prefixes.iter().any(|prefix| name.starts_with(prefix));
        if !within(absence.within) || within(absence.except) || name.ends_with("/tests.rs") {
            continue;
        }
        let source = std::fs::read_to_string(&path).map_err(|error| format!("{name}: {error}"))?;
        for (line, text) in lines_with(&source, absence.words) {
            found.push(format!("{name}:{line}: `{text}`: {}", absence.because));
        }
    }
    Ok(found)
}

/// All `<crate>/src/**/*.rs`, in order.
fn rust_sources(root: &Path) -> Result<Vec<PathBuf>, String> {
    let mut folders: Vec<PathBuf> =
        entries(root)?.into_iter().map(|path| path.join("src")).filter(|path| path.is_dir()).collect();
    let mut sources = Vec::new();
    while let Some(folder) = folders.pop() {
        for path in entries(&folder)? {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                sources.push(path);
            }
        }
    }
    sources.sort();
    Ok(sources)
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let at = |error: std::io::Error| format!("{}: {error}", folder.display());
    std::fs::read_dir(folder).map_err(at)?.map(|entry| entry.map(|entry| entry.path()).map_err(at)).collect()
}
