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
    let write = |name: &str, text: String| {
        let path = folder.join(name);
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
    };
    let mut priors = BTreeMap::new();
    for (robot, agent) in agents {
        let noise = NoiseFile {
            filter: agent.filter.clone(),
            motion: agent.motion.clone(),
            sensors: agent.sensors.clone(),
            calibration: agent.calibration,
        };
        write(&format!("noise-r{robot}.toml"), toml::to_string(&noise)?)?;
        if let Some(prior) = &agent.prior {
            priors.insert(robot.to_string(), prior);
        }
    }
    if let Some(model) = agents.values().find_map(|agent| agent.model.as_ref()) {
        copy_model(model, &folder.join(MODEL))?;
    }
    write(PRIORS, toml::to_string(&priors)?)
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
