//! Closing the past, rebasing, and a robot that runs twice; the rules are in `docs/ledger.md`.

use pleiad_agent::{AgentConfig, Event, Node, Notice, Record};
use pleiad_estimation::fact::Entry;
use pleiad_estimation::ledger::Log;
use pleiad_estimation::{BootIndex, RobotId};

use crate::support::{Handled, agent, drive, feed, gps, handle, log, node_of, sees, velocity};

fn closing(robot: u32) -> AgentConfig {
    let mut config = agent(robot);
    config.ledger.members = vec![1, 2];
    config.ledger.cell_s = 1.0;
    config.ledger.late_s = 0.5;
    config
}

/// Passes on what was published until nothing follows any more.
fn exchange(one: &mut Node, two: &mut Node, said: Vec<Entry>) {
    let mut for_two = said;
    while !for_two.is_empty() {
        let for_one = handle(two, Event::Entries(for_two)).published;
        for_two = handle(one, Event::Entries(for_one)).published;
    }
}

fn published(handled: Vec<Handled>) -> Vec<Entry> {
    handled.into_iter().flat_map(|handled| handled.published).collect()
}

/// Two robots that drive and see each other for `seconds`.
fn pair(seconds: u32) -> (Node, Node) {
    let (mut one, mut two) = (node_of(&closing(1), 1), node_of(&closing(2), 2));
    for second in 0..seconds {
        let (from, to) = (f64::from(second), f64::from(second) + 0.95);
        let mut said = published(drive(&mut one, from, to, 0.1));
        said.extend(feed(&mut one, sees(from + 0.9, 2)).published);
        exchange(&mut one, &mut two, said);
        let said = published(drive(&mut two, from, to, 0.1));
        exchange(&mut two, &mut one, said);
    }
    (one, two)
}

#[test]
fn a_team_that_talks_closes_its_past_with_one_hash_and_keeps_little() {
    let (one, two) = pair(30);
    let cuts = [&one, &two].map(|node| node.ledger().cut().expect("a cut").seconds());
    assert!(cuts.iter().all(|cut| *cut >= 27.0), "{cuts:?}");
    let (mut one, mut two) = (one, two);
    let closed = |node: &mut Node| node.status().closure.expect("a team that closes").cut.expect("a cut");
    let (first, second) = (closed(&mut one), closed(&mut two));
    if first.0 == second.0 {
        assert_eq!(first.1, second.1);
    }
    assert!(one.ledger().kept() < 60, "{}", one.ledger().kept());
    assert_eq!(one.ledger().counts().relative, 30);
}

#[test]
fn one_absent_member_blocks_every_cut() {
    let mut one = node_of(&closing(1), 1);
    drive(&mut one, 0.0, 30.0, 0.1);
    assert_eq!(one.ledger().cut(), None);
}

#[test]
fn an_operator_evicts_the_other_of_two_and_the_past_is_closed_without_it() {
    let (mut one, _) = pair(10);
    let before = one.ledger().cut().expect("a cut");
    drive(&mut one, 10.0, 20.0, 0.1);
    assert!(one.ledger().cut().expect("a cut").seconds_since(before) < 3.0);
    handle(&mut one, Event::Evict(RobotId(2)));
    drive(&mut one, 20.0, 25.0, 0.1);
    assert!(one.ledger().cut().expect("a cut").seconds() >= 23.0);
}

#[test]
fn who_is_evicted_keeps_what_is_accepted_of_it_and_after_a_restart_too() {
    let (mut one, mut two) = (node_of(&closing(1), 1), node_of(&closing(2), 2));
    let mut journal = Vec::new();
    let mut heard = Vec::new();
    for handled in drive(&mut two, 0.0, 4.0, 0.1) {
        journal.extend(handled.journal);
        heard.extend(handled.published);
    }
    let unheard: Vec<Handled> = drive(&mut two, 4.0, 8.0, 0.1);
    journal.extend(unheard.into_iter().flat_map(|handled| handled.journal));
    let mut said = published(drive(&mut one, 0.0, 8.0, 0.1));
    said.extend(handle(&mut one, Event::Entries(heard)).published);
    said.extend(handle(&mut one, Event::Evict(RobotId(2))).published);
    let accepted = one.ledger().log(log(2, 0)).expect("a log").held();

    let handled = handle(&mut two, Event::Entries(said));
    let evicted = |notice: &Notice| matches!(notice, Notice::Evicted { .. });
    assert!(handled.notices.iter().any(evicted), "{:?}", handled.notices);
    journal.extend(handled.journal);
    let again = Node::recover(closing(2).node().expect("a configuration"), 9, journal);
    for node in [&two, &again] {
        assert_eq!(node.ledger().log(log(2, 0)).map_or(0, Log::held), accepted);
        assert_eq!(node.ledger().entries(log(2, 0), 0), one.ledger().entries(log(2, 0), 0));
    }
}

#[test]
fn with_the_other_away_memory_is_bounded_and_with_it_back_it_observes_again() {
    let small = |robot| {
        let mut config = closing(robot);
        config.ledger.most_items = 60;
        config
    };
    let (mut one, mut two) = (node_of(&small(1), 1), node_of(&small(2), 2));
    let mut said = Vec::new();
    let mut refusals = Vec::new();
    for tenth in 0..2000 {
        let (from, to) = (f64::from(tenth) * 0.1, f64::from(tenth) * 0.1 + 0.05);
        let mut all = drive(&mut one, from, to, 0.1);
        all.push(feed(&mut one, gps(to - 0.01)));
        for handled in all {
            let full = |notice: &Notice| notice.to_string().contains("ledger.most_items");
            refusals.extend(handled.notices.into_iter().filter(full));
            said.extend(handled.published);
        }
    }
    // Every fix up to the limit was taken, with a fact each; nothing more came after, no seals either.
    assert_eq!(one.ledger().kept(), 60);
    let [Notice::SampleRefused(refusal)] = &refusals[..] else { panic!("{refusals:?}") };
    let text = refusal.to_string();
    assert!(text.contains("60 items") && text.contains("robot 2: bring it back or evict it"), "{text}");

    let back = published(drive(&mut two, 0.0, 199.0, 0.1));
    exchange(&mut one, &mut two, said);
    exchange(&mut two, &mut one, back);
    assert!(one.ledger().cut().expect("a cut").seconds() > 190.0, "{:?}", one.ledger().cut());
    // Its next seal tells each that the other has closed too, so that no entries have to be kept for it.
    let (from_one, from_two) = (drive(&mut one, 200.0, 204.5, 0.1), drive(&mut two, 199.1, 204.5, 0.1));
    exchange(&mut one, &mut two, published(from_one));
    exchange(&mut two, &mut one, published(from_two));
    assert!(one.ledger().kept() < 60, "{}", one.ledger().kept());
    assert_eq!(feed(&mut one, gps(204.35)).published.len(), 1);
}

#[test]
fn an_observation_in_a_sealed_time_is_refused() {
    let mut one = node_of(&closing(1), 1);
    drive(&mut one, 0.0, 10.0, 0.1);
    let handled = feed(&mut one, gps(5.0));
    assert!(handled.published.is_empty());
    assert!(matches!(handled.notices[..], [Notice::SampleRefused(_)]), "{:?}", handled.notices);
}

#[test]
fn a_journal_replaced_at_a_cut_gives_the_same_node() {
    let (one, _) = pair(20);
    let records = one.compacted();
    assert!(matches!(records.first(), Some(Record::Checkpoint(_))));
    let mut again = Node::recover(closing(1).node().expect("a configuration"), 9, records);
    let mut one = one;
    assert_eq!(again.status().estimate, one.status().estimate);
    assert_eq!(again.status().odometry_until, one.status().odometry_until);
    let boot = feed(&mut again, velocity(20.5)).published[0].id.boot;
    assert_eq!(boot, BootIndex(1));
}

#[test]
fn a_late_joiner_takes_over_the_snapshot_and_holds_the_same() {
    let (mut one, _) = pair(20);
    let mut late = node_of(&closing(2), 7);
    let mut asked = late.handle(Event::Status(one.status()));
    let mut rounds = 0;
    while let Some(pleiad_agent::Command::AskSnapshot { peer, request }) =
        asked.into_iter().find(|command| matches!(command, pleiad_agent::Command::AskSnapshot { .. }))
    {
        let part = one.serve_snapshot(&request).expect("a snapshot");
        asked = late.handle(Event::SnapshotPart(peer, part));
        rounds += 1;
        assert!(rounds < 10);
    }
    assert_eq!(late.ledger().cut(), one.ledger().cut());
    let kept = |digest: pleiad_estimation::ledger::LogDigest| one.ledger().entries(digest.log, digest.first);
    let entries: Vec<Entry> = one.ledger().digests().flat_map(kept).cloned().collect();
    handle(&mut late, Event::Entries(entries));
    assert_eq!(late.status().estimate, one.status().estimate);
}

#[test]
fn a_rebase_moves_the_estimate_by_nothing_and_the_published_frame_not_at_all() {
    let mut plain = node_of(&agent(1), 1);
    let mut config = agent(1);
    config.ledger.rebase_m = 2.5;
    let mut rebased = node_of(&config, 1);
    for tick in 0..400 {
        let time = f64::from(tick) * 0.1;
        for node in [&mut plain, &mut rebased] {
            feed(node, velocity(time));
            if tick % 7 == 3 {
                feed(node, gps(time));
            }
        }
        let (a, b) = (plain.estimate().expect("placed"), rebased.estimate().expect("placed"));
        // Within a nanosecond of motion, and rounding.
        assert!(a.odom_from_robot.between(&b.odom_from_robot).log().amax() < 1e-8, "{tick}");
        assert!(a.map_from_robot.between(&b.map_from_robot).log().amax() < 1e-8, "{tick}");
        for (x, y) in a.covariance.0.into_iter().zip(b.covariance.0) {
            assert!((x - y).abs() < 1e-9, "{tick}: {x} {y}");
        }
    }
    assert!(rebased.status().boot > BootIndex(2), "{}", rebased.status().boot);
}

#[test]
fn a_second_agent_of_the_same_robot_silences_the_first() {
    let mut first = node_of(&agent(1), 1);
    let records: Vec<Record> =
        drive(&mut first, 0.0, 1.0, 0.1).into_iter().flat_map(|handled| handled.journal).collect();
    let mut second = Node::recover(agent(1).node().expect("a configuration"), 2, records);
    let said = feed(&mut second, velocity(1.1)).published;
    let notices = handle(&mut first, Event::Entries(said)).notices;
    let expected = Notice::Superseded { robot: RobotId(1), boot: BootIndex(1) };
    assert_eq!(notices.first(), Some(&expected));
    let before = first.ledger().log(log(1, 0)).map(pleiad_estimation::ledger::Log::held);
    assert!(feed(&mut first, gps(0.9)).published.is_empty());
    assert_eq!(first.ledger().log(log(1, 0)).map(pleiad_estimation::ledger::Log::held), before);
}
