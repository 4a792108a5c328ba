//! The only GPS of a team fails, and then the robot that has it is cut off.

use std::collections::BTreeMap;
use std::path::Path;

use pleiad_tests::program::{self, repository, run};

/// The position's standard deviation of a robot's estimates by the second, m.
fn sigma_m(out: &Path, robot: u32, view: &str) -> BTreeMap<i64, f64> {
    let path = out.join(format!("agents/r{robot}/{view}.csv"));
    let text = std::fs::read_to_string(path).unwrap();
    let column =
        |name: &str| text.lines().next().unwrap().split(',').position(|found| found == name).unwrap();
    let (xx, yy) = (column("xx"), column("yy"));
    let row = |line: &str| {
        let values: Vec<&str> = line.split(',').collect();
        let variance_m2 = |column: usize| values[column].parse::<f64>().unwrap();
        let seconds = values[0].parse::<i64>().unwrap().div_euclid(1_000_000_000);
        (seconds, (variance_m2(xx) + variance_m2(yy)).sqrt())
    };
    text.lines().skip(1).map(row).collect()
}

#[test]
fn a_team_that_loses_its_only_gps_grows_unsure_and_has_all_of_it_back_afterwards() {
    let _turn = program::turn();
    let folder = tempfile::tempdir().unwrap();
    let within = folder.path();
    let scenario = repository().join("scenarios").join("faults_gps.toml");
    let ran = run(within, ["run", scenario.to_str().unwrap(), "--out", "out", "--json"]).json();
    let out = within.join("out");
    let faults = &ran["faults"];
    assert_eq!(
        (&faults["lost"], &faults["counted_twice"], &faults["partitions"]),
        (&0.into(), &0.into(), &1.into())
    );
    let (settled, online) = (sigma_m(&out, 3, "settled"), sigma_m(&out, 3, "online"));
    // Without reception the position of the whole team drifts: its variance grows without bound.
    assert!(settled[&149] > 2.0 * settled[&59], "{} {}", settled[&59], settled[&149]);
    assert!(settled[&180] < 1.2 * settled[&59], "{} {}", settled[&59], settled[&180]);
    // Cut off from it, the others know at the time as little; afterwards they know that they were well placed.
    assert!(online[&299] > 2.0 * settled[&299], "{} {}", online[&299], settled[&299]);
    assert!(settled[&299] < 1.2 * settled[&59], "{} {}", settled[&59], settled[&299]);
    assert!(online[&340] < 1.2 * settled[&340], "{} {}", online[&340], settled[&340]);
    // And they were right about it: 95 % of the innovations are within their bounds.
    assert!(ran["nis"]["within_95"].as_f64().unwrap() > 0.93, "{}", ran["nis"]);
}
