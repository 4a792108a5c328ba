//! What `[filter]` and `[calibration]` take, and what is wrong in them by its name.

#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

use pleiad_agent::config::NodeConfig;
use pleiad_agent::{AgentConfig, ConfigError};

/// The node of the least configuration with more in it.
fn of(text: &str) -> Result<NodeConfig, ConfigError> {
    let config: AgentConfig = toml::from_str(&format!("team = 'blue'\nrobot = 1\n{text}")).unwrap();
    config.node()
}

#[test]
fn facts_are_linearized_together_over_times_that_make_sense() {
    let fold = of("[filter]\nrelinearize = { block_s = 2.0, ahead_s = 4.0, passes = 3 }\n").unwrap().fold;
    let how = fold.relinearize.unwrap();
    assert_eq!((how.block_ns, how.ahead_ns, how.passes, how.cell_ns), (2_000_000_000, 4_000_000_000, 3, 0));
    assert_ne!(fold.hash(), of("").unwrap().fold.hash(), "the bits differ, so does the configuration");
    let closing = "[ledger]\nmembers = [1, 2]\ncell_s = 6.0\n";
    let how =
        of(&format!("[filter]\nrelinearize = {{ block_s = 2.0 }}\n{closing}")).unwrap().fold.relinearize;
    assert_eq!(how.unwrap().cell_ns, 6_000_000_000);
    for (text, key) in [
        ("[filter]\nrelinearize = { block_s = 0.0 }\n".to_owned(), "filter.relinearize.block_s"),
        ("[filter]\nrelinearize = { ahead_s = -1.0 }\n".to_owned(), "filter.relinearize.ahead_s"),
        ("[filter]\nrelinearize = { passes = 0 }\n".to_owned(), "filter.relinearize.passes"),
        ("[filter]\nerror = 'additive'\nrelinearize = {}\n".to_owned(), "filter.error"),
        ("strategy = 'pairwise'\n[filter]\nrelinearize = {}\n".to_owned(), "strategy"),
        (format!("[filter]\nrelinearize = {{ block_s = 4.0 }}\n{closing}"), "ledger.cell_s"),
    ] {
        let said = of(&text).unwrap_err().to_string();
        assert!(said.contains(key), "{text}: {said}");
    }
}

#[test]
fn what_is_to_be_found_out_has_values_that_make_sense() {
    let plain = of("").unwrap();
    assert_eq!((plain.calibration, plain.fold.clutter, plain.fold.join), (None, None, false));
    // A table alone is the robot whose clock is the team's: it states its velocity, and is sure.
    assert!(of("[calibration]\n").unwrap().calibration.is_some_and(|calibration| calibration.is_none()));
    let asked = of("[calibration]\nsigma_clock_offset_s = 0.1\nsigma_clock_drift_ppm = 50.0\n").unwrap();
    let [offset_s, drift] = asked.calibration.unwrap().clock;
    assert!((offset_s - 0.1).abs() < 1e-12 && (drift - 50.0e-6).abs() < 1e-12);
    for text in [
        "[filter]\njoin = true\n",
        "[filter]\nclutter = { share = 0.1, reach_m = 8.0 }\n",
        "[filter]\ninflation = {}\n",
        "[filter]\nquarantine = {}\n",
    ] {
        assert_ne!(of(text).unwrap().fold.hash(), plain.fold.hash(), "{text}");
    }
    for (text, key) in [
        ("[filter]\nclutter = { share = 0.0, reach_m = 8.0 }\n", "filter.clutter.share"),
        ("[filter]\nclutter = { share = 1.0, reach_m = 8.0 }\n", "filter.clutter.share"),
        ("[filter]\nclutter = { share = 0.1, reach_m = -8.0 }\n", "filter.clutter.reach_m"),
        ("strategy = 'pairwise'\n[filter]\nclutter = { share = 0.1, reach_m = 8.0 }\n", "strategy"),
        ("[filter]\nclutter = { share = 0.1, reach_m = 8.0, misnamed = 0.95 }\n", "filter.clutter.misnamed"),
        (
            "[filter]\nrelinearize = {}\nclutter = { share = 0.1, reach_m = 8.0, misnamed = 0.05 }\n",
            "filter.clutter.misnamed",
        ),
        ("[filter]\ninflation = { readings = 0.5 }\n", "filter.inflation.readings"),
        ("[filter]\ninflation = { most = 1.0 }\n", "filter.inflation.most"),
        ("[filter]\nquarantine = { level = 0.0 }\n", "filter.quarantine.level"),
        ("[filter]\nquarantine = { window_s = nan }\n", "filter.quarantine.window_s"),
        ("strategy = 'pairwise'\n[filter]\nquarantine = {}\n", "strategy"),
        ("[calibration]\nsigma_mount_m = -0.1\n", "calibration.sigma_mount_m"),
        ("[filter]\nerror = 'additive'\n[calibration]\n", "filter.error"),
        ("strategy = 'pairwise'\n[calibration]\n", "strategy"),
        ("[filter]\nerror = 'additive'\njoin = true\n", "filter.error"),
        ("strategy = 'independent'\n[sensors]\nunknown_landmarks = 'map'\n", "strategy"),
    ] {
        let said = of(text).unwrap_err().to_string();
        assert!(said.contains(key), "{text}: {said}");
    }
}
