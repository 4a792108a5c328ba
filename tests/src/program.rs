//! The `pleiad` program, built once per test process and run as people and scripts run it.

#![allow(clippy::unwrap_used, clippy::panic, clippy::missing_panics_doc, reason = "helpers of tests")]

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use serde_json::Value;

/// Builds the program with the profile of this test, the first time, and says where it is.
pub fn pleiad() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        // target/<profile>/deps/<this test>
        let test = std::env::current_exe().unwrap();
        let profile = test.ancestors().nth(2).unwrap();
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| env!("CARGO").into());
        let mut build = Command::new(cargo);
        build.args(["build", "--quiet", "-p", "pleiad", "--target-dir"]).arg(profile.parent().unwrap());
        if !cfg!(debug_assertions) {
            build.arg("--release");
        }
        // What cargo tells a test about its package would look like a changed environment to build scripts
        // that read it, and half of the dependencies would be compiled again.
        for (variable, _) in std::env::vars_os() {
            let name = variable.to_string_lossy();
            if name.starts_with("CARGO_PKG_") || name.starts_with("CARGO_MANIFEST_") {
                build.env_remove(&variable);
            }
        }
        // Left in place, these have build scripts run again and half of the dependencies compiled anew.
        build.env_remove("CARGO_MANIFEST_DIR").env_remove("CARGO_MANIFEST_PATH");
        let built = build.current_dir(repository()).output().unwrap();
        assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
        profile.join("pleiad")
    })
}

/// The root of the workspace.
pub fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// Held by whoever has a team of processes: a port that a team has been assigned and not yet bound could
/// go to another, and two processors have enough to do with one.
pub fn turn() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs the program to its end, in the folder `within`, with nothing to read from.
pub fn run<S: AsRef<OsStr>>(within: &Path, arguments: impl IntoIterator<Item = S>) -> Ended {
    let mut command = Command::new(pleiad());
    command.args(arguments).current_dir(within).stdin(Stdio::null()).env_remove("PLEIAD_LOG");
    Ended { output: command.output().unwrap() }
}

/// A run of the program that has ended.
pub struct Ended {
    output: Output,
}

impl Ended {
    /// What it wrote to stdout.
    pub fn stdout(&self) -> String {
        String::from_utf8(self.output.stdout.clone()).unwrap()
    }

    /// What it wrote to stderr.
    pub fn stderr(&self) -> String {
        String::from_utf8(self.output.stderr.clone()).unwrap()
    }

    /// What it wrote to stdout, having succeeded.
    pub fn success(&self) -> String {
        let (status, stderr) = (self.output.status, self.stderr());
        assert!(status.success(), "{status}\nstdout: {}\nstderr: {stderr}", self.stdout());
        self.stdout()
    }

    /// The JSON object that is all of stdout, the program having succeeded.
    pub fn json(&self) -> Value {
        let stdout = self.success();
        let value: Value = serde_json::from_str(&stdout)
            .unwrap_or_else(|error| panic!("not one JSON value ({error}): {stdout}"));
        assert!(value.is_object(), "not an object: {stdout}");
        value
    }

    /// What it wrote to stderr, having failed by its exit code with nothing on stdout.
    pub fn failure(&self) -> String {
        let code = self.output.status.code().unwrap_or_else(|| panic!("{}", self.output.status));
        assert!(code != 0, "it did not fail: {}", self.stdout());
        assert_eq!(self.stdout(), "", "on stdout");
        let stderr = self.stderr();
        assert!(!stderr.contains("panicked"), "{stderr}");
        stderr
    }
}
