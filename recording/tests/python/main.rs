//! What others say of our files and we of theirs: the Python packages rosbags, mcap, pymap3d, evo and
//! foxglove-schemas-protobuf.

#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail by panicking")]

mod bags;
mod errors;
mod runs;

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// The interpreter with the packages of `.ci/python-requirements.txt`.
fn python() -> PathBuf {
    let in_target = || {
        let target = std::env::var_os("CARGO_TARGET_DIR");
        let here = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../target");
        target.map_or_else(here, PathBuf::from).join("python/bin/python")
    };
    let path = std::env::var_os("PLEIAD_PYTHON").map_or_else(in_target, PathBuf::from);
    assert!(
        path.is_file(),
        "{} is missing: run .ci/python-venv, or name an interpreter that has the packages of \
         .ci/python-requirements.txt in PLEIAD_PYTHON",
        path.display()
    );
    path
}

/// What the script `name` of this folder prints.
fn ask(name: &str, arguments: &[&Path]) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python").join(name);
    let output = Command::new(python()).arg(script).args(arguments).output().unwrap();
    assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Numbers that look random and are the same every time: a linear congruential generator (Knuth, TAOCP 2, 3.3.4).
struct Chance(u64);

impl Chance {
    /// Between -1 and 1.
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / f64::from(1 << 26) / f64::from(1 << 26) - 1.0
    }
}
