//! Statuses, requests and answers alone bring two robots to hold the same; contradictions are noticed, not
//! spread.

use pleiad_agent::config::ErrorName;
use pleiad_agent::{Event, Node, Notice};
use pleiad_estimation::RobotId;
use pleiad_estimation::fact::{Absolute, Body, Entry, Quantity};
use pleiad_estimation::ledger::Refusal;

use crate::support::{
    agent, drive, feed, folded, gps, handle, held, id, log, node, node_of, sees, standing_log, velocity,
};

/// One exchange: `to` hears the status of `from`, asks, and takes the answer. Returns the entries that went.
fn exchange(from: &mut Node, to: &mut Node, most: usize) -> usize {
    let asked = handle(to, Event::Status(from.status())).asked;
    let mut sent = 0;
    for (peer, request) in asked {
        assert_eq!(peer, from.robot());
        let answer = from.serve(&request, most);
        assert!(answer.len() <= most);
        sent += answer.len();
        handle(to, Event::Entries(answer));
    }
    sent
}

fn pair() -> (Node, Node) {
    let (mut one, mut two) = (node(1), node(2));
    drive(&mut one, 0.0, 3.0, 0.1);
    drive(&mut two, 0.0, 3.0, 0.1);
    for k in 0..20 {
        feed(&mut one, gps(0.1 * f64::from(k) + 0.03));
        feed(&mut one, sees(0.1 * f64::from(k) + 0.05, 2));
        feed(&mut two, sees(0.1 * f64::from(k) + 0.07, 1));
    }
    (one, two)
}

#[test]
fn statuses_and_answers_alone_make_two_robots_equal() {
    for most in [512, 7, 1] {
        let (mut one, mut two) = pair();
        assert_ne!(one.status().estimate, two.status().estimate);
        let mut went = 0;
        loop {
            let now = exchange(&mut one, &mut two, most) + exchange(&mut two, &mut one, most);
            if now == 0 {
                break;
            }
            went += now;
        }
        assert_eq!(one.status().estimate, two.status().estimate);
        assert_eq!(one.status().facts.pending, 0);
        // Each sends its own log once: boot, clock, seven profiles, prior, observations, and 20 halves.
        assert_eq!(went, (10 + 40 + 20) + (10 + 20 + 20), "answers of at most {most}");
        let mut ledger = folded(&held(&one), one.config().fold);
        assert_eq!(ledger.fingerprint(), two.status().estimate);
    }
}

#[test]
fn a_third_robots_log_comes_by_way_of_the_second() {
    let (mut one, mut two) = pair();
    let mut three = node(3);
    exchange(&mut one, &mut two, 512);
    exchange(&mut two, &mut three, 512);
    assert_eq!(three.ledger().entries(log(1, 0), 0), one.ledger().entries(log(1, 0), 0));
}

#[test]
fn equal_robots_ask_each_other_nothing() {
    let (mut one, mut two) = pair();
    while exchange(&mut one, &mut two, 512) + exchange(&mut two, &mut one, 512) > 0 {}
    let handled = handle(&mut one, Event::Status(two.status()));
    assert!(handled.asked.is_empty() && handled.notices.is_empty());
}

#[test]
fn an_entry_ahead_of_its_log_waits_and_the_gap_is_asked_for() {
    let mut node = node(1);
    let entries = standing_log(2, node.config().fold, &[(0.5, 3), (0.6, 3)]);
    let handled = handle(&mut node, Event::Entries(vec![entries[3].clone()]));
    let [(RobotId(2), ref request)] = handled.asked[..] else { panic!("{:?}", handled.asked) };
    let range = request.ranges[0];
    assert_eq!((range.log, range.from, range.to), (log(2, 0), 0, 3));
    handle(&mut node, Event::Entries(entries[..3].to_vec()));
    assert_eq!(held(&node), entries);
}

#[test]
fn what_is_asked_is_served_and_no_more() {
    let (one, _) = pair();
    let request = |from, to| pleiad_protocol::FactsRequest {
        ranges: vec![pleiad_protocol::LogRange { log: log(1, 0), from, to }],
    };
    let whole = held(&one);
    let size = whole.len() as u64;
    assert_eq!(one.serve(&request(3, 6), 512), whole[3..6]);
    assert_eq!(one.serve(&request(3, u64::MAX), 512), whole[3..]);
    assert_eq!(one.serve(&request(3, u64::MAX), 2), whole[3..5]);
    assert_eq!(one.serve(&request(size, u64::MAX), 512), []);
    assert_eq!(one.serve(&request(size + 5, size + 9), 512), []);
    let unknown = pleiad_protocol::LogRange { log: log(8, 3), from: 0, to: 9 };
    assert_eq!(one.serve(&pleiad_protocol::FactsRequest { ranges: vec![unknown] }, 512), []);
}

#[test]
fn a_peer_of_another_configuration_is_named_and_nothing_is_exchanged() {
    let mut config = agent(2);
    config.filter.error = ErrorName::Additive;
    let (mut one, mut two) = (node(1), node_of(&config, 2));
    drive(&mut one, 0.0, 1.0, 0.1);
    drive(&mut two, 0.0, 1.0, 0.1);
    let handled = handle(&mut one, Event::Status(two.status()));
    assert!(handled.asked.is_empty());
    let (ours, theirs) = (one.status().configuration, two.status().configuration);
    assert_eq!(handled.notices, [Notice::OtherConfiguration { robot: RobotId(2), theirs, ours }]);
    // Nor are its entries taken, and the reason is said once.
    let before = one.status().estimate;
    let handled = handle(&mut one, Event::Entries(held(&two)));
    let refused = Notice::EntryRefused { id: id(2, 0, 0), refusal: Refusal::Configuration };
    assert_eq!(handled.notices, [refused]);
    assert!(handled.journal.is_empty() && handled.asked.is_empty() && handled.published.is_empty());
    let handled = handle(&mut one, Event::Entries(held(&two)));
    assert!(handled.notices.is_empty() && handled.journal.is_empty() && handled.asked.is_empty());
    assert_eq!(one.status().estimate, before);
}

/// Two versions of one log, the last entry of which differs.
fn versions() -> [Vec<Entry>; 2] {
    let log = standing_log(2, node(1).config().fold, &[(0.5, 3), (0.6, 3)]);
    let mut other = log.clone();
    let Some(Entry { body: Body::Observation(fact), .. }) = other.last_mut() else {
        panic!("no observation")
    };
    fact.quantity = Quantity::Absolute(Absolute::Position([9.0, 9.0]));
    [log, other]
}

#[test]
fn a_fork_shows_in_the_status_of_a_peer() {
    let [log_one, log_other] = versions();
    let (mut one, mut two) = (node(1), node(4));
    handle(&mut one, Event::Entries(log_one.clone()));
    handle(&mut two, Event::Entries(log_other));
    let notices = handle(&mut one, Event::Status(two.status())).notices;
    assert_eq!(notices, [Notice::Fork { log: log(2, 0), peer: RobotId(4) }]);
    // And the same log is no fork.
    let mut three = node(3);
    handle(&mut three, Event::Entries(log_one));
    assert!(handle(&mut one, Event::Status(three.status())).notices.is_empty());
}

#[test]
fn two_contents_of_one_identity_quarantine_the_robot_and_everyone_keeps_the_same_one() {
    let [log_one, log_other] = versions();
    let mut estimates = Vec::new();
    for (first, second) in [(&log_one, &log_other), (&log_other, &log_one)] {
        let mut node = node(1);
        let mut records = handle(&mut node, Event::Entries(first.clone())).journal;
        let handled = handle(&mut node, Event::Entries(second.clone()));
        assert_eq!(handled.notices, [Notice::Equivocation { id: id(2, 0, 3) }]);
        records.extend(handled.journal);
        // Whatever else it says is refused, and its log is no longer asked for.
        let next = Entry { id: id(2, 0, 4), ..first[3].clone() };
        let notices = handle(&mut node, Event::Entries(vec![next.clone()])).notices;
        assert_eq!(notices, [Notice::EntryRefused { id: next.id, refusal: Refusal::Quarantined }]);
        let mut peer = crate::support::node(3);
        handle(&mut peer, Event::Entries(first.iter().cloned().chain([next]).collect()));
        assert!(handle(&mut node, Event::Status(peer.status())).asked.is_empty());
        // The journal leads to the same.
        let mut again = Node::recover(node.config().clone(), 3, records);
        assert_eq!(again.status().estimate, node.status().estimate);
        assert_eq!(again.ledger().quarantined(), node.ledger().quarantined());
        estimates.push(node.status().estimate);
    }
    assert_eq!(estimates[0], estimates[1]);
}

#[test]
fn a_contradiction_that_arrives_again_and_again_is_kept_once() {
    let [log_one, log_other] = versions();
    let mut node = node(1);
    handle(&mut node, Event::Entries(log_one));
    let kept = |node: &mut Node| handle(node, Event::Entries(log_other.clone())).journal.len();
    assert_eq!(kept(&mut node), 1);
    assert!((0..5).map(|_| kept(&mut node)).sum::<usize>() <= 1);
}

#[test]
fn entries_of_the_own_boot_that_were_never_said_here_are_noticed_and_not_taken() {
    let mut one = node(1);
    drive(&mut one, 0.0, 1.0, 0.1);
    let mine = held(&one);
    assert!(handle(&mut one, Event::Entries(mine.clone())).notices.is_empty(), "copies are no news");
    let size = mine.len() as u64;
    let foreign = Entry { id: id(1, 0, size), ..mine.last().unwrap().clone() };
    let handled = handle(&mut one, Event::Entries(vec![foreign]));
    assert_eq!(handled.notices, [Notice::OwnLogAhead { id: id(1, 0, size) }]);
    assert!(handled.journal.is_empty());
    assert_eq!(held(&one), mine);
}

#[test]
fn another_process_of_the_same_robot_shows_in_the_status_of_a_peer() {
    let (mut one, mut other, mut peer) = (node(1), node_of(&agent(1), 555), node(2));
    drive(&mut one, 0.0, 1.0, 0.1);
    // As long a log, but another one.
    drive(&mut other, 0.05, 1.0, 0.1);
    handle(&mut peer, Event::Entries(held(&other)));
    let notices = handle(&mut one, Event::Status(peer.status())).notices;
    assert_eq!(notices, [Notice::Fork { log: log(1, 0), peer: RobotId(2) }]);
    // A longer one.
    feed(&mut other, gps(0.5));
    handle(&mut peer, Event::Entries(held(&other)));
    let handled = handle(&mut one, Event::Status(peer.status()));
    assert_eq!(handled.notices, [Notice::OwnLogAhead { id: id(1, 0, 10) }]);
    assert!(handled.asked.is_empty(), "the own log is not learned from others");
}

#[test]
fn a_status_of_oneself_is_ignored() {
    let mut one = node(1);
    drive(&mut one, 0.0, 1.0, 0.1);
    let mut status = one.status();
    status.configuration ^= 1;
    assert!(one.handle(Event::Status(status)).is_empty());
    assert_eq!(feed(&mut one, velocity(1.1)).notices, []);
}
