//! `pleiad tune`: noise levels that are known, found again from what the robots saw alone.

use std::f64::consts::PI;
use std::path::Path;

use pleiad_tests::program::run;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value;

use crate::{list, number, numbers};

const SCENARIO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/tune.toml");

/// The levels that `scenarios/tune.toml` is made with.
const TRUE: [(&str, f64); 6] = [
    ("motion.forward_m_per_sqrt_s", 0.04),
    ("motion.yaw_rad_per_sqrt_s", 0.03),
    ("sensors.range_bearing.sigma_range_m", 0.1),
    ("sensors.range_bearing.sigma_bearing_rad", 0.03),
    ("sensors.gps.sigma_m", 0.3),
    ("sensors.heading.sigma_rad", 0.05),
];

/// Writes `noise.toml` with the true levels, each multiplied by one of the factors.
fn told(within: &Path, factors: [f64; 6]) {
    let [forward, yaw, range, bearing, gps, heading]: [f64; 6] =
        std::array::from_fn(|index| TRUE[index].1 * factors[index]);
    let text = format!(
        "[motion]\nforward_m_per_sqrt_s = {forward:?}\nyaw_rad_per_sqrt_s = {yaw:?}\n[sensors]\n\
         range_bearing = {{ sigma_range_m = {range:?}, sigma_bearing_rad = {bearing:?} }}\n\
         gps = {{ sigma_m = {gps:?} }}\nheading = {{ sigma_rad = {heading:?} }}\n"
    );
    std::fs::write(within.join("noise.toml"), text).unwrap();
}

const RIGHT: [f64; 6] = [1.0; 6];
/// Off by three, in ways that do not hide one another.
const WRONG: [f64; 6] = [3.0, 1.0 / 3.0, 1.0 / 3.0, 3.0, 1.0 / 3.0, 3.0];

/// Simulates the scenario as the folder `recording`.
fn simulated(within: &Path, seed: u64, seconds: &str) {
    let seed = seed.to_string();
    let words = ["simulate", SCENARIO, "--seed", &seed, "--seconds", seconds, "--out", "recording"];
    run(within, words).success();
}

fn tune(within: &Path, more: &[&str]) -> Value {
    let words = ["tune", "recording", "--noise", "noise.toml", "--json"];
    run(within, words.iter().chain(more)).json()
}

fn level<'a>(found: &'a Value, key: &str) -> &'a Value {
    let is = |level: &&Value| level["key"] == key;
    list(found, "levels").iter().find(is).unwrap_or_else(|| panic!("{key} is not in {found}"))
}

/// How many of the true levels lie in their 95 % intervals.
fn inside(found: &Value) -> usize {
    let holds = |(key, value): &&(&str, f64)| {
        let level = level(found, key);
        assert_eq!(level["determined"], true, "{level}");
        let interval = numbers(level, "interval_95");
        (interval[0]..=interval[1]).contains(value)
    };
    TRUE.iter().filter(holds).count()
}

/// Changes the range and bearing of every sighting.
fn changed(within: &Path, seed: u64, change: impl Fn(&mut ChaCha8Rng, f64, f64) -> (f64, f64)) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for robot in 1..=3 {
        let path = within.join(format!("recording/r{robot}/relative.csv"));
        let text = std::fs::read_to_string(&path).unwrap();
        let mut lines = vec![text.lines().next().unwrap().to_owned()];
        for line in text.lines().skip(1) {
            let cells: Vec<&str> = line.split(',').collect();
            let (range, bearing) = change(&mut random, cells[3].parse().unwrap(), cells[4].parse().unwrap());
            lines.push(format!("{},{range:?},{bearing:?}", cells[..3].join(",")));
        }
        std::fs::write(&path, lines.join("\n") + "\n").unwrap();
    }
}

/// Probability below 0.3 % of fewer than 41 of 48 at 95 % each.
const LEAST_OF_48: usize = 41;

#[test]
fn true_levels_lie_in_their_intervals_whatever_the_search_begins_with() {
    let mut held = 0;
    for seed in 501..=508 {
        let folder = tempfile::tempdir().unwrap();
        simulated(folder.path(), seed, "100");
        told(folder.path(), WRONG);
        let found = tune(folder.path(), &["--also", "none"]);
        held += inside(&found);
        let judged = |when: &str, key: &str| number(&found[when], key);
        assert!(judged("after", "log_likelihood") > judged("before", "log_likelihood") + 100.0, "{found}");
        // A gate takes the upper 0.1 %, about 1 % of the sum; five sigmas of some 3,000 degrees are 0.13.
        assert!((judged("after", "nis_used") - 1.0).abs() < 0.14, "{found}");
        assert!((judged("before", "nis_used") - 1.0).abs() > 0.14, "{found}");
    }
    assert!(held >= LEAST_OF_48, "{held} of 48");
}

#[test]
fn who_is_told_the_truth_is_told_it_again_and_nothing_is_added() {
    let folder = tempfile::tempdir().unwrap();
    simulated(folder.path(), 511, "100");
    told(folder.path(), RIGHT);
    let found = tune(folder.path(), &["--out", "found.toml"]);
    // Fewer than 4 of 6 have a probability of 0.2 %.
    assert!(inside(&found) >= 4, "{found}");
    assert!(list(&found, "tried").iter().all(|tried| tried["kept"] == false), "{found}");
    assert!(number(&found["outliers"], "share") < 2e-3, "{found}");
    assert!(found["maximum"] == true, "{found}");
    assert!(found["outliers"]["found"] == false, "{found}");
    let written = std::fs::read_to_string(folder.path().join("found.toml")).unwrap();
    assert!(!written.contains("clutter"), "{written}");
    // The file is one that a replay takes.
    let words = ["replay", "recording", "--noise", "found.toml", "--json", "--out", "out"];
    let replay = run(folder.path(), words).json();
    let (nis, after) = (number(&replay["nis"], "mean"), number(&found["after"], "nis"));
    assert!((nis - after).abs() < 2e-3 * after, "{nis} {after}");
}

#[test]
fn one_sighting_in_twenty_of_nothing_does_not_move_the_levels() {
    let mut held = 0;
    for seed in 521..=524 {
        let folder = tempfile::tempdir().unwrap();
        simulated(folder.path(), seed, "100");
        changed(folder.path(), seed, |random, range, bearing| {
            if random.random_range(0.0..1.0) < 0.05 {
                (random.random_range(0.2..9.0), random.random_range(-PI..PI))
            } else {
                (range, bearing)
            }
        });
        told(folder.path(), WRONG);
        let found = tune(folder.path(), &["--also", "none", "--out", "found.toml"]);
        held += inside(&found);
        // Of all measurements, fixes and headings with them; 5 % of the sightings.
        let share = number(&found["outliers"], "share");
        assert!((0.02..0.06).contains(&share), "{share}");
        let written = std::fs::read_to_string(folder.path().join("found.toml")).unwrap();
        assert!(written.contains("[filter.clutter]"), "{written}");
    }
    // Fewer than 19 of 24 have a probability of 0.2 %.
    assert!(held >= 19, "{held} of 24");
}

#[test]
fn range_noise_that_grows_with_the_distance_is_found_where_it_is() {
    let folder = tempfile::tempdir().unwrap();
    simulated(folder.path(), 531, "100");
    changed(folder.path(), 531, |random, range, bearing| {
        let one: f64 = StandardNormal.sample(random);
        ((range + 0.08 * range * one).max(0.01), bearing)
    });
    told(folder.path(), RIGHT);
    let found = tune(folder.path(), &["--out", "found.toml"]);
    let growing = level(&found, "sensors.range_bearing.sigma_range_per_m");
    let interval = numbers(growing, "interval_95");
    assert!((interval[0]..=interval[1]).contains(&0.08), "{growing}");
    let words = ["replay", "recording", "--noise", "found.toml", "--json", "--out", "out"];
    let replay = run(folder.path(), words).json();
    // Each sighting now states its own noise; the NIS is that which was told.
    let (nis, after) = (number(&replay["nis"], "mean"), number(&found["after"], "nis"));
    assert!((nis - after).abs() < 2e-3 * after, "{nis} {after}");
}

#[test]
fn what_the_data_do_not_say_keeps_its_value_and_is_named() {
    let folder = tempfile::tempdir().unwrap();
    simulated(folder.path(), 541, "40");
    // There is no sideways noise: the data cannot tell a little of it from none.
    told(folder.path(), RIGHT);
    let text = std::fs::read_to_string(folder.path().join("noise.toml")).unwrap();
    let text = text.replace("[sensors]", "lateral_m_per_sqrt_s = 1e-5\n[sensors]");
    std::fs::write(folder.path().join("noise.toml"), text).unwrap();
    let found = tune(folder.path(), &["--also", "none"]);
    let lateral = level(&found, "motion.lateral_m_per_sqrt_s");
    assert_eq!((&lateral["determined"], number(lateral, "value")), (&false.into(), 1e-5), "{lateral}");
    assert!(number(lateral, "at_most") < 0.02, "{lateral}");
    let said = |note: &Value| note.as_str().unwrap_or_default().contains("motion.lateral_m_per_sqrt_s");
    assert!(list(&found, "notes").iter().any(said), "{found}");
}

#[test]
fn what_cannot_be_tuned_is_refused_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    simulated(folder.path(), 551, "20");
    told(folder.path(), RIGHT);
    let noise = std::fs::read_to_string(folder.path().join("noise.toml")).unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("blind.toml", noise.split("[sensors]").next().unwrap());
    write("joining.toml", &format!("[filter]\njoin = true\n{noise}"));
    write(
        "misnamed.toml",
        &format!("[filter.clutter]\nshare = 0.02\nreach_m = 9.0\nmisnamed = 0.1\n{noise}"),
    );
    write("calibrated.toml", &format!("{noise}[calibration]\nsigma_forward_scale = 0.01\n"));
    for (arguments, words) in [
        (&["--noise", "blind.toml"][..], &["no observation", "pleiad replay"][..]),
        (&["--noise", "joining.toml"], &["filter.join", "take it out"]),
        (&["--noise", "misnamed.toml"], &["filter.clutter.misnamed", "take it out"]),
        (&["--noise", "calibrated.toml"], &["[calibration]", "take the table out"]),
        (&["--noise", "noise.toml", "--also", "sensors.bearing.sigma_rad"], &["sensors.bearing.sigma_rad"]),
        (
            &["--noise", "noise.toml", "--also", "motion.sideways"],
            &["motion.sideways", "motion.lateral_m_per_sqrt_s"],
        ),
        (&["--noise", "absent.toml"], &["absent.toml"]),
    ] {
        let stderr = run(folder.path(), ["tune", "recording"].iter().chain(arguments)).failure();
        for word in words {
            assert!(stderr.contains(word), "{word} is missing in: {stderr}");
        }
    }
}
