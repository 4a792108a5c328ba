//! A robot that was seen answers exactly once, with its state at that time or with the reason why it has none.

use pleiad_agent::config::AgentConfig;
use pleiad_agent::{Event, Node, Record};
use pleiad_estimation::BootIndex;
use pleiad_estimation::fact::{Answer, Half, NominalState, VoidReason};

use crate::support::{
    Handled, agent, assert_pose, drive, feed, halves, handle, id, node, node_of, on_circle, standing_log,
    start, velocity,
};

/// Hands the log of a robot 2 that saw robot 1 at these times.
fn seen(node: &mut Node, times: &[f64]) -> Handled {
    let saw: Vec<_> = times.iter().map(|time| (*time, 1)).collect();
    let entries = standing_log(2, node.config().fold, &saw);
    handle(node, Event::Entries(entries))
}

fn answers(handled: &Handled) -> Vec<(u64, Answer)> {
    let half = |half: Half| (half.observation.sequence.0, half.answer);
    halves(&handled.published).into_iter().map(half).collect()
}

fn state(answer: Answer) -> (BootIndex, NominalState) {
    match answer {
        Answer::State { boot, state } => (boot, state),
        Answer::Void(reason) => panic!("{reason:?}"),
    }
}

/// The answer to being seen at `seen_s` by a robot whose odometry covers these stretches, and then ends.
fn answer_after(config: &AgentConfig, stretches: &[(f64, f64)], seen_s: f64) -> Answer {
    let mut node = node_of(config, 1);
    for (from, to) in stretches {
        drive(&mut node, *from, *to, 0.1);
    }
    let mut found = answers(&seen(&mut node, &[seen_s]));
    found.extend(answers(&handle(&mut node, Event::InputEnded)));
    let [(2, answer)] = found[..] else { panic!("{found:?}") };
    answer
}

#[test]
fn the_answer_is_the_nominal_state_at_the_time_of_the_observation() {
    let mut node = node(1);
    drive(&mut node, 10.0, 11.0, 0.1);
    let found = answers(&seen(&mut node, &[10.0, 10.537, 11.0]));
    let sequences: Vec<u64> = found.iter().map(|(sequence, _)| *sequence).collect();
    assert_eq!(sequences, [2, 3, 4]);
    for ((_, answer), after_s) in found.into_iter().zip([0.0, 0.537, 1.0]) {
        let (boot, state) = state(answer);
        assert_eq!(boot, BootIndex(0));
        assert_pose(&state.nominal, &on_circle(start(), after_s), 1e-12);
        // Yaw noise of a random walk: sigma^2 t, whatever the frame.
        assert!((state.noise_sum.0[5] - 1e-4 * after_s).abs() < 1e-15);
    }
}

#[test]
fn an_observation_is_answered_once_however_often_it_arrives() {
    let mut node = node(1);
    drive(&mut node, 10.0, 11.0, 0.1);
    assert_eq!(answers(&seen(&mut node, &[10.5])).len(), 1);
    for _ in 0..3 {
        let again = seen(&mut node, &[10.5]);
        assert!(again.published.is_empty() && again.journal.is_empty());
    }
    assert_eq!(answers(&seen(&mut node, &[10.5, 10.6])).len(), 1);
    assert!(drive(&mut node, 11.1, 12.0, 0.1).iter().all(|handled| answers(handled).is_empty()));
}

#[test]
fn observations_of_others_are_left_to_them() {
    let mut node = node(1);
    drive(&mut node, 10.0, 11.0, 0.1);
    let entries = standing_log(2, node.config().fold, &[(10.5, 3)]);
    assert!(handle(&mut node, Event::Entries(entries)).published.is_empty());
    assert_eq!(node.status().facts.pending, 1);
}

#[test]
fn what_was_seen_ahead_of_the_odometry_is_answered_when_that_arrives() {
    let mut node = node(1);
    drive(&mut node, 10.0, 11.0, 0.1);
    assert_eq!(answers(&seen(&mut node, &[11.25])), []);
    assert_eq!(answers(&feed(&mut node, velocity(11.2))), []);
    let found = answers(&feed(&mut node, velocity(11.3)));
    let (_, state) = state(found[0].1);
    assert_pose(&state.nominal, &on_circle(start(), 1.25), 1e-12);
}

#[test]
fn what_was_seen_before_anything_is_known_of_oneself_is_answered_at_the_first_odometry() {
    let mut node = node(1);
    assert_eq!(answers(&seen(&mut node, &[9.0, 10.0])), []);
    let found = answers(&feed(&mut node, velocity(10.0)));
    assert_eq!(found[0], (2, Answer::Void(VoidReason::BeforeBoot)));
    assert_eq!(state(found[1].1).1.nominal, start());
}

/// Configuration, stretches of odometry, when the robot was seen, and what is expected.
type Case<'a, T> = (&'a AgentConfig, &'a [(f64, f64)], f64, T);

#[test]
fn voids_have_their_reason() {
    let mut short = agent(1);
    short.motion.history_samples = 4;
    let whole = agent(1);
    let drive = [(10.0, 11.0)];
    let two_boots = [(10.0, 11.0), (15.0, 16.0)];
    let table: [Case<VoidReason>; 7] = [
        (&whole, &drive, 9.999, VoidReason::BeforeBoot),
        (&whole, &two_boots, 9.999, VoidReason::BeforeBoot),
        (&whole, &two_boots, 13.0, VoidReason::OdometryGap),
        (&whole, &two_boots, 11.000_000_001, VoidReason::OdometryGap),
        // The odometry ended just before, and will never reach it.
        (&whole, &drive, 11.5, VoidReason::OdometryGap),
        (&whole, &drive, 13.000_000_001, VoidReason::Clock),
        (&short, &drive, 10.65, VoidReason::TrajectoryLost),
    ];
    for (config, stretches, seen_s, reason) in table {
        assert_eq!(answer_after(config, stretches, seen_s), Answer::Void(reason), "seen at {seen_s} s");
    }
    // The neighbours that have an answer.
    let neighbours: [Case<u32>; 5] = [
        (&whole, &drive, 10.0, 0),
        (&whole, &two_boots, 11.0, 0),
        (&whole, &two_boots, 10.5, 0),
        (&whole, &two_boots, 15.0, 1),
        (&short, &drive, 10.75, 0),
    ];
    for (config, stretches, seen_s, boot) in neighbours {
        let (found, _) = state(answer_after(config, stretches, seen_s));
        assert_eq!(found, BootIndex(boot), "seen at {seen_s} s");
    }
}

#[test]
fn exactly_two_seconds_ahead_is_not_yet_a_wrong_clock() {
    let mut node = node(1);
    drive(&mut node, 10.0, 11.0, 0.1);
    assert_eq!(answers(&seen(&mut node, &[13.0])), []);
    assert_eq!(answers(&seen(&mut node, &[13.0, 13.1])), [(3, Answer::Void(VoidReason::Clock))]);
    let found = answers(&feed(&mut node, velocity(13.0)));
    assert_pose(&state(found[0].1).1.nominal, &on_circle(start(), 3.0), 1e-12);
}

#[test]
fn an_old_boots_trajectory_still_answers_after_a_restart() {
    let mut node = node(1);
    let records: Vec<Record> =
        drive(&mut node, 10.0, 11.0, 0.1).into_iter().flat_map(|handled| handled.journal).collect();
    let mut node = Node::recover(agent(1).node().unwrap(), 77, records);
    assert_eq!(answers(&seen(&mut node, &[10.537, 11.5])), [], "nothing is said before the boot");
    let handled = feed(&mut node, velocity(12.0));
    let found = answers(&handled);
    let (boot, state) = state(found[0].1);
    assert_eq!(boot, BootIndex(0));
    assert_pose(&state.nominal, &on_circle(start(), 0.537), 1e-12);
    assert_eq!(found[1], (3, Answer::Void(VoidReason::OdometryGap)));
    // The answers stand in the new log.
    assert!(handled.published.iter().all(|entry| entry.id.boot == BootIndex(1)));
}

#[test]
fn a_robot_restarted_after_its_last_odometry_answers_also_what_it_hears_of_later() {
    let mut node = node(1);
    let records: Vec<Record> =
        drive(&mut node, 10.0, 11.0, 0.1).into_iter().flat_map(|handled| handled.journal).collect();
    let mut node = Node::recover(agent(1).node().unwrap(), 77, records);
    // Nothing is asked of it yet, so that there is no reason to begin a boot.
    assert!(handle(&mut node, Event::InputEnded).published.is_empty());
    let handled = seen(&mut node, &[10.537]);
    let (boot, state) = state(answers(&handled)[0].1);
    assert_eq!(boot, BootIndex(0));
    assert_pose(&state.nominal, &on_circle(start(), 0.537), 1e-12);
    assert!(node.drained());
    assert!(handled.published.iter().all(|entry| entry.id.boot == BootIndex(1)));
}

#[test]
fn an_answer_completes_the_fact_on_both_sides() {
    let mut seen_one = node(1);
    drive(&mut seen_one, 0.0, 1.0, 0.1);
    let handled = seen(&mut seen_one, &[0.5]);
    let facts = seen_one.status().facts;
    assert_eq!((facts.relative, facts.pending, facts.void), (1, 0, 0));
    let [half] = &halves(&handled.published)[..] else { panic!("no half") };
    assert_eq!(half.observation, id(2, 0, 2));
}
