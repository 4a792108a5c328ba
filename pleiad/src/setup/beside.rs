//! What lies beside a recording and is no measurement: noise, geometry, start and model of the robots, which
//! a replay has to know.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use pleiad_agent::config::{AgentConfig, PriorSection};
use pleiad_estimation::RobotId;

use super::NoiseFile;

/// File of a recording that says what the robots were told of their start: a table per robot's number. A
/// robot that is not in it was told nothing.
const PRIORS: &str = "priors.toml";

/// The model of the robots that a run was told of, in its folder and in that of its recording.
pub const MODEL: &str = "model.toml";

/// Writes beside a recording what a replay has to know of its robots: noise, geometry and start.
pub fn write_beside(agents: &BTreeMap<RobotId, AgentConfig>, folder: &Path) -> anyhow::Result<()> {
    for (name, text) in beside_texts(agents)? {
        let path = folder.join(name);
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// The texts of the files that lie beside a recording, by name.
pub fn beside_texts(agents: &BTreeMap<RobotId, AgentConfig>) -> anyhow::Result<BTreeMap<String, String>> {
    let mut texts = BTreeMap::new();
    let mut priors = BTreeMap::new();
    for (robot, agent) in agents {
        let noise = NoiseFile {
            filter: agent.filter.clone(),
            motion: agent.motion.clone(),
            sensors: agent.sensors.clone(),
            calibration: agent.calibration,
        };
        texts.insert(format!("noise-r{robot}.toml"), toml::to_string(&noise)?);
        if let Some(prior) = &agent.prior {
            priors.insert(robot.to_string(), prior);
        }
    }
    if let Some(model) = agents.values().find_map(|agent| agent.model.as_ref()) {
        let text = std::fs::read_to_string(model)
            .with_context(|| format!("cannot read the model {}", model.display()))?;
        texts.insert(MODEL.to_owned(), text);
    }
    texts.insert(PRIORS.to_owned(), toml::to_string(&priors)?);
    Ok(texts)
}

/// Whether a file of this name lies beside a recording: noise of all robots or of one, starts, a model.
pub(super) fn is_beside(name: &str) -> bool {
    let of_robot = |name: &str| {
        let number = name.strip_prefix("noise-r").and_then(|rest| rest.strip_suffix(".toml"));
        number.is_some_and(|number| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()))
    };
    matches!(name, "noise.toml" | PRIORS | MODEL) || of_robot(name)
}

/// The texts of such files in `folder`, by name.
pub fn texts_beside(folder: &Path) -> anyhow::Result<BTreeMap<String, String>> {
    let mut texts = BTreeMap::new();
    let listed = std::fs::read_dir(folder).with_context(|| format!("cannot list {}", folder.display()))?;
    for entry in listed {
        let entry = entry.with_context(|| format!("cannot list {}", folder.display()))?;
        let Ok(name) = entry.file_name().into_string() else { continue };
        if is_beside(&name) {
            let path = entry.path();
            let text =
                std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
            texts.insert(name, text);
        }
    }
    Ok(texts)
}

/// Copies a model file.
pub fn copy_model(from: &Path, to: &Path) -> anyhow::Result<()> {
    std::fs::copy(from, to).with_context(|| format!("cannot copy {} to {}", from.display(), to.display()))?;
    Ok(())
}

/// What the robots of a recording were told of their start, if it says so.
pub(super) fn priors_beside(folder: &Path) -> anyhow::Result<Option<BTreeMap<RobotId, PriorSection>>> {
    let path = folder.join(PRIORS);
    if !path.is_file() {
        return Ok(None);
    }
    let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let tables: BTreeMap<String, PriorSection> =
        toml::from_str(&text).with_context(|| format!("{}", path.display()))?;
    let mut priors = BTreeMap::new();
    for (name, prior) in tables {
        let Ok(robot) = name.parse() else {
            bail!("{}: found the table [{name}], expected the number of a robot", path.display());
        };
        priors.insert(RobotId(robot), prior);
    }
    Ok(Some(priors))
}

/// The model to be used: the one asked for, or the one beside the recording.
pub(super) fn model_for(asked: Option<&Path>, folder: &Path) -> anyhow::Result<Option<PathBuf>> {
    let beside = folder.join(MODEL);
    let path = match asked {
        Some(path) => path,
        None if beside.is_file() => beside.as_path(),
        None => return Ok(None),
    };
    Ok(Some(std::path::absolute(path).with_context(|| format!("cannot find {}", path.display()))?))
}
