//! A robot's clock is mapped to team time once, where its samples come in; the map is in its log.

use pleiad_agent::{AgentConfig, Record};
use pleiad_estimation::fact::Body;

use crate::support::{agent, feed, gps, node_of, observations, seconds, velocity};

fn config() -> AgentConfig {
    let mut config = agent(1);
    config.clock.reference_s = 100.0;
    config.clock.offset_s = -7.5;
    config.clock.rate_ppb = 2_000;
    config
}

#[test]
fn team_time_is_local_time_plus_offset_plus_drift() {
    let mut node = node_of(&config(), 1);
    let said = feed(&mut node, velocity(150.0)).published;
    let Body::Boot(boot) = said[0].body else { panic!("no boot") };
    // 150 - 7.5 + 2e-6 * 50
    assert_eq!(boot.time, seconds(142.5001));
    let Body::ClockMap(map) = said[1].body else { panic!("no clock map") };
    assert_eq!((map.reference, map.offset_ns, map.rate_ppb), (seconds(100.0), -7_500_000_000, 2_000));
}

#[test]
fn facts_and_journal_are_in_team_time() {
    let mut node = node_of(&config(), 1);
    feed(&mut node, velocity(150.0));
    feed(&mut node, velocity(151.0));
    let handled = feed(&mut node, gps(150.5));
    assert_eq!(observations(&handled.published)[0].time, seconds(143.000_101));
    let Some(Record::Sample(kept)) = handled.journal.last() else { panic!("no sample") };
    assert_eq!(kept.time, seconds(143.000_101));
}

#[test]
fn times_at_the_ends_of_the_range_saturate() {
    for (time_s, offset_s) in [(9.2e9, 9.2e9), (-9.2e9, -9.2e9)] {
        let mut config = agent(1);
        config.clock.offset_s = offset_s;
        let said = feed(&mut node_of(&config, 1), velocity(time_s)).published;
        let Body::Boot(boot) = said[0].body else { panic!("no boot") };
        assert_eq!(boot.time.0, if time_s > 0.0 { i64::MAX } else { i64::MIN });
    }
}
