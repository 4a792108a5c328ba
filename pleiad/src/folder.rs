//! Run folders.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

/// The folder asked for, or the next free `runs/<name>-NNN`. A folder that already holds something is
/// refused unless it was asked for and is empty.
pub fn create(asked: Option<&Path>, name: &str) -> anyhow::Result<PathBuf> {
    if let Some(folder) = asked {
        if folder.read_dir().is_ok_and(|mut entries| entries.next().is_some()) {
            bail!("{} is not empty: name another folder with --out, or empty it", folder.display());
        }
        std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
        return Ok(folder.to_owned());
    }
    let runs = Path::new("runs");
    std::fs::create_dir_all(runs).context("cannot create the folder runs/ here; name one with --out")?;
    for number in 1..100_000 {
        let folder = runs.join(format!("{name}-{number:03}"));
        match std::fs::create_dir(&folder) {
            Ok(()) => return Ok(folder),
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error).with_context(|| format!("cannot create {}", folder.display())),
        }
    }
    bail!("runs/ is full of {name} folders: remove some, or name one with --out")
}

/// Folder of one robot's agent within a run.
pub fn agent(run: &Path, robot: pleiad_estimation::RobotId) -> PathBuf {
    run.join("agents").join(format!("r{robot}"))
}
