//! Writes the rows of `docs/benchmarks/mrclam.md`, landmarks known: what each part of a model, and noise chosen for it,
//! brings. `cargo run -p pleiad-tests --example mrclam_landmarks -- DATASET CORRECTED_TOML`: noise is chosen on that dataset,
//! with the model that `pleiad diagnose` made of it, and measured on the other one. Takes some ten minutes.

#![allow(clippy::expect_used, reason = "a program of measurements fails by panicking")]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::path::Path;

use pleiad_tests::{mrclam, program};
use serde_json::Value;
use toml::Table;

/// Stages: name, which effects of the model are kept (all if `None`; no model at all if empty).
const STAGES: [(&str, Option<&[&str]>); 4] = [
    ("no model", Some(&[])),
    ("lag and delay", Some(&["command_delay", "actuator_lag"])),
    (
        "all of the body",
        Some(&["command_delay", "actuator_lag", "actuator_gain", "turn_loss", "crab", "icr_offset"]),
    ),
    ("corrected.toml", None),
];
/// Forward m/sqrt(s), yaw rad/sqrt(s), range m, bearing rad: where the search begins without and with a model.
const BEGIN: [[f64; 4]; 2] = [[0.036, 0.15, 0.12, 0.04], [0.012, 0.05, 0.18, 0.04]];
/// In which order the search tries them.
const ORDER: [usize; 4] = [1, 0, 3, 2];
/// Less is no improvement, m.
const LEAST_M: f64 = 1e-4;

fn main() -> io::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [dataset, model] = arguments.as_slice() else {
        return writeln!(
            io::stderr(),
            "expected a dataset, 2 or 6, and the corrected.toml of pleiad diagnose on it"
        );
    };
    let chosen_on: u32 = dataset.parse().expect("2 or 6");
    let text = std::fs::read_to_string(model)?;
    let folder = tempfile::tempdir()?;
    for (stage, kept) in STAGES {
        let bench = Bench { within: folder.path(), model: filtered(folder.path(), &text, kept)? };
        let noise = bench.chosen(chosen_on, BEGIN[usize::from(kept != Some(&[]))]);
        let other = 8 - chosen_on;
        writeln!(
            io::stdout(),
            "{stage}, chosen on {chosen_on}: {noise:?}, there {}",
            bench.run(chosen_on, noise, &TEN_MINUTES)
        )?;
        for (what, options) in [
            ("ten minutes", &TEN_MINUTES[..]),
            ("together", &["--seconds", "600", "--relinearize", "5:10:6"]),
            ("no landmarks", &["--seconds", "600", "--landmarks", "none"]),
            ("whole", &[]),
        ] {
            writeln!(io::stdout(), "  on {other}, {what}: {}", bench.run(other, noise, options))?;
        }
    }
    Ok(())
}

const TEN_MINUTES: [&str; 2] = ["--seconds", "600"];

/// A model of the robots, and where to put files.
struct Bench<'a> {
    within: &'a Path,
    model: Option<String>,
}

/// What a replay says: mean position error, NIS per degree, refused.
#[derive(Clone, Copy)]
struct Said {
    error_m: f64,
    nis: f64,
    rejected: f64,
}

impl std::fmt::Display for Said {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "{:.4} m, NIS {:.2}, {} refused", self.error_m, self.nis, self.rejected)
    }
}

impl Bench<'_> {
    fn run(&self, dataset: u32, noise: [f64; 4], options: &[&str]) -> Said {
        let [forward, yaw, range, bearing] = noise;
        let mut text = String::new();
        let _ = write!(
            text,
            "[motion]\nvelocity = \"commanded\"\nforward_m_per_sqrt_s = {forward:?}\nlateral_m_per_sqrt_s = 0.0\n\
             yaw_rad_per_sqrt_s = {yaw:?}\nquiet_at_standstill = true\nspeed_limit_m_s = 0.2\n\
             yaw_rate_limit_rad_s = 1.5\nlongest_gap_s = 2.0\n[sensors.range_bearing]\nsigma_range_m = {range:?}\n\
             sigma_bearing_rad = {bearing:?}\n"
        );
        std::fs::write(self.within.join("noise.toml"), text).expect("a file can be written");
        let recording = mrclam::folder(dataset);
        let recording = recording.to_str().expect("a path that is text");
        let out = tempfile::tempdir_in(self.within).expect("a temporary folder");
        let out = out.path().join("run");
        let mut words = vec!["replay", recording, "--noise", "noise.toml", "--json", "--out"];
        words.push(out.to_str().expect("a path that is text"));
        words.extend(self.model.iter().flat_map(|model| ["--model", model.as_str()]));
        words.extend(options);
        let said = program::run(self.within, words).json();
        let number = |value: &Value| value.as_f64().expect("a number");
        Said {
            error_m: number(&said["mean_position_rmse_m"]),
            nis: number(&said["nis"]["mean"]),
            rejected: number(&said["facts"]["rejected"]),
        }
    }

    /// Coordinate search: one value at a time by 1.5, and by its root when nothing improves any more.
    fn chosen(&self, dataset: u32, begin: [f64; 4]) -> [f64; 4] {
        let mut known: BTreeMap<[u64; 4], f64> = BTreeMap::new();
        let mut error = |noise: [f64; 4]| {
            *known
                .entry(noise.map(f64::to_bits))
                .or_insert_with(|| self.run(dataset, noise, &TEN_MINUTES).error_m)
        };
        let (mut best, mut least, mut factor) = (begin, error(begin), 1.5_f64);
        while factor > 1.2 {
            let mut better = false;
            for which in ORDER {
                for by in [factor, 1.0 / factor] {
                    let mut noise = best;
                    noise[which] = (noise[which] * by * 1e5).round() / 1e5;
                    let found = error(noise);
                    if found < least - LEAST_M {
                        (best, least, better) = (noise, found, true);
                        break;
                    }
                }
            }
            if !better {
                factor = factor.sqrt();
            }
        }
        best
    }
}

/// Writes the model with the kept effects alone, and gives its file.
fn filtered(within: &Path, text: &str, kept: Option<&[&str]>) -> io::Result<Option<String>> {
    if kept == Some(&[]) {
        return Ok(None);
    }
    let mut model: Table = text.parse().expect("a model file");
    let robots = model["robots"].as_table_mut().expect("robots");
    for (_, robot) in robots.iter_mut() {
        if let (Some(kept), Some(effects)) =
            (kept, robot.get_mut("effects").and_then(toml::Value::as_array_mut))
        {
            effects.retain(|effect| effect["name"].as_str().is_some_and(|name| kept.contains(&name)));
        }
    }
    let path = within.join("model.toml");
    std::fs::write(&path, model.to_string())?;
    Ok(path.to_str().map(str::to_owned))
}
