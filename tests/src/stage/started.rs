//! The processes of a stage.

use std::fs::File;
use std::path::Path;
use std::process::{Command, Stdio};

use pleiad_coordinator::CoordinatorConfig;
use pleiad_estimation::RobotId;

use super::Stage;
use crate::program;

impl Stage {
    /// Starts a coordinator as a process of its own; returns the process.
    pub fn start_coordinator(&self, config: &CoordinatorConfig) -> std::process::Child {
        let path = self.folder.path().join("coordinator.toml");
        std::fs::write(&path, toml::to_string(config).unwrap()).unwrap();
        self.start("coordinator", &path)
    }

    /// Starts a robot's agent by hand, as on a machine of its own.
    pub fn start_agent(&self, robot: RobotId) -> std::process::Child {
        self.start("agent", &self.config_path(robot))
    }

    /// The same through another program that runs what it is given last, as `ip netns exec NAME` does.
    pub fn start_agent_through(&self, robot: RobotId, words: &[&str]) -> std::process::Child {
        let mut command = Command::new(words[0]);
        command.args(&words[1..]).arg(program::pleiad());
        self.start_by(command, "agent", &self.config_path(robot))
    }

    fn start(&self, what: &str, config: &Path) -> std::process::Child {
        self.start_by(Command::new(program::pleiad()), what, config)
    }

    fn start_by(&self, mut command: Command, what: &str, config: &Path) -> std::process::Child {
        let log = File::create(config.with_extension("log")).unwrap();
        command.arg(what).arg("--config").arg(config).current_dir(self.folder.path());
        command.stdin(Stdio::null()).stdout(log.try_clone().unwrap()).stderr(log).spawn().unwrap()
    }

    /// The ids of all processes that work in this stage's folder.
    pub fn processes(&self) -> Vec<u32> {
        let folder = self.folder.path().as_os_str().as_encoded_bytes();
        let works_here = |pid: &u32| {
            let line = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
            line.windows(folder.len()).any(|part| part == folder)
        };
        let entries = std::fs::read_dir("/proc").unwrap().filter_map(Result::ok);
        let pids = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
        pids.filter(works_here).collect()
    }
}
