//! Every fault of a plan: against its closed form where it has one, and where it does not apply.

use std::collections::BTreeSet;

use pleiad_protocol::{ControlRequest, FactsRequest};

use super::super::plan::Rule;
use super::super::{LinkFaults, VirtualNetwork};
use super::*;

const A: RobotId = RobotId(1);
const B: RobotId = RobotId(2);
const C: RobotId = RobotId(3);

fn at(seconds: f64) -> Timestamp {
    Timestamp::from_seconds(seconds)
}

fn robots(list: &[RobotId]) -> BTreeSet<RobotId> {
    list.iter().copied().collect()
}

fn injector(rules: Vec<Rule>) -> Injector {
    Injector::new(FaultPlan::new(rules).unwrap(), 5, Timestamp(0))
}

fn one(fault: Fault) -> Injector {
    injector(vec![Rule::always(fault)])
}

fn request() -> Vec<u8> {
    Message::FactsRequest(FactsRequest::default()).encode()
}

fn passes(injector: &mut Injector, t_s: f64, from: RobotId, to: RobotId) -> bool {
    matches!(injector.judge(at(t_s), from, to, &request()), Verdict::Delivered { .. })
}

/// Whether each of `count` messages from A to B is lost.
fn fates(fault: Fault, count: usize) -> Vec<bool> {
    let mut injector = one(fault);
    (0..count).map(|_| !passes(&mut injector, 0.0, A, B)).collect()
}

#[test]
fn bursts_have_the_stated_loss_and_length() {
    // Gilbert 1960: stationary loss p / (p + r), geometric bursts of mean 1 / r.
    for (loss, mean_length) in [(0.1, 10.0), (0.5, 1.0), (0.5, 10.0), (0.5, 100.0), (0.9, 10.0), (0.9, 100.0)]
    {
        let count = 1_000_000;
        let fates = fates(Fault::Burst { loss, mean_length }, count);
        let lost = fates.iter().filter(|lost| **lost).count() as f64;
        let bursts = fates.windows(2).filter(|pair| !pair[0] && pair[1]).count() as f64;
        // Variance of the share of a two-state chain: l (1 - l) (1 + c) / (1 - c) / n, with c = 1 - p - r.
        let (p, r) = gilbert(loss, mean_length);
        let correlation = 1.0 - p - r;
        let sigma = (loss * (1.0 - loss) * (1.0 + correlation) / (1.0 - correlation) / count as f64).sqrt();
        assert!((lost / count as f64 - loss).abs() <= 5.0 * sigma, "{loss} {mean_length}: {lost}");
        // Of a geometric length the standard deviation is below its mean.
        let length = lost / bursts;
        assert!((length / mean_length - 1.0).abs() < 5.0 / bursts.sqrt(), "{loss} {mean_length}: {length}");
    }
}

#[test]
fn independent_loss_has_geometric_bursts_of_their_own_mean() {
    let fates = fates(Fault::Loss { loss: 0.5 }, 100_000);
    let lost = fates.iter().filter(|lost| **lost).count() as f64;
    let bursts = fates.windows(2).filter(|pair| !pair[0] && pair[1]).count() as f64;
    assert!((lost / 100_000.0 - 0.5).abs() < 5.0 * 0.5 / 100_000f64.sqrt());
    assert!((lost / bursts - 2.0).abs() < 0.1);
}

#[test]
fn a_rule_is_on_in_its_window_and_for_its_links_and_messages_only() {
    let rule = Rule {
        from: robots(&[A]),
        to: robots(&[B]),
        messages: BTreeSet::from(["facts request"]),
        ..Rule::always(Fault::Cut).between(10.0, 20.0)
    };
    let mut injector = injector(vec![rule]);
    for (t_s, from, to, passing) in [
        (9.999, A, B, true),
        (10.0, A, B, false),
        (19.999, A, B, false),
        (20.0, A, B, true),
        (15.0, B, A, true),
        (15.0, A, C, true),
    ] {
        assert_eq!(passes(&mut injector, t_s, from, to), passing, "{t_s} s, {from} to {to}");
    }
    let other = Message::ControlRequest(ControlRequest::Status).encode();
    assert!(matches!(injector.judge(at(15.0), A, B, &other), Verdict::Delivered { .. }));
}

#[test]
fn partitions_heal_and_robots_come_back_into_range() {
    let partition = Fault::Partition { groups: vec![robots(&[A])] };
    let away = Fault::Away { robots: robots(&[C]) };
    let mut injector =
        injector(vec![Rule::always(partition).between(0.0, 10.0), Rule::always(away).between(10.0, 20.0)]);
    for (t_s, from, to, passing) in [
        (5.0, A, B, false),
        (5.0, B, A, false),
        (5.0, B, C, true),
        (15.0, A, B, true),
        (15.0, A, C, false),
        (15.0, C, B, false),
        (25.0, C, A, true),
    ] {
        assert_eq!(passes(&mut injector, t_s, from, to), passing, "{t_s} s, {from} to {to}");
    }
}

#[test]
fn a_slow_peer_takes_messages_at_its_rate_and_drops_what_does_not_fit() {
    let mut injector = one(Fault::Slow { messages_per_s: 10.0, queue: 5 });
    let verdicts: Vec<Verdict> = (0..10).map(|_| injector.judge(at(0.0), A, B, &request())).collect();
    for (index, verdict) in verdicts.iter().enumerate().take(6) {
        let Verdict::Delivered { after_s, .. } = verdict else { panic!("{index}: {verdict:?}") };
        assert!((after_s - 0.1 * (index as f64 + 1.0)).abs() < 1e-12);
    }
    assert!(verdicts[6..].iter().all(|verdict| *verdict == Verdict::Lost(Cause::Overflow)));
    // Another receiver is not concerned, and after a while this one is free again.
    assert!(passes(&mut injector, 0.0, A, C));
    assert!(passes(&mut injector, 1.0, C, B));
}

#[test]
fn delays_reorder_and_duplicate_as_stated() {
    let mut injector = injector(vec![
        Rule::always(Fault::Delay { delay_s: 0.2, jitter_s: 0.1 }),
        Rule::always(Fault::Reorder { probability: 0.25, by_s: 1.0 }),
        Rule::always(Fault::Duplicate { probability: 0.5, within_s: 0.3 }),
    ]);
    let (mut held, mut doubled) = (0_i32, 0_i32);
    for _ in 0..10_000 {
        let verdict = injector.judge(at(0.0), A, B, &request());
        let Verdict::Delivered { after_s, again_after_s, damage: None } = verdict else {
            panic!("{verdict:?}")
        };
        assert!((0.2..=0.3).contains(&after_s) || (1.2..=1.3).contains(&after_s), "{after_s}");
        held += i32::from(after_s > 1.0);
        if let Some(again_s) = again_after_s {
            doubled += 1;
            assert!((after_s..=after_s + 0.3).contains(&again_s));
        }
    }
    // Five standard deviations of binomial counts.
    assert!((held - 2500).abs() < 217 && (doubled - 5000).abs() < 250, "{held} {doubled}");
}

#[test]
fn a_damaged_message_is_refused_by_the_codec_and_counted_by_the_network() {
    let plan = FaultPlan::new(vec![Rule::always(Fault::Corrupt { probability: 0.5, bytes: 3 })]).unwrap();
    let mut network = VirtualNetwork::<Vec<u8>>::new(3, LinkFaults::default()).unwrap();
    network.set_plan(plan, Timestamp(0));
    let good = request();
    (0..10_000).for_each(|_| network.send(at(0.0), A, B, good.clone()));
    let arrived = network.poll(Timestamp::MAX);
    assert_eq!(arrived.len(), 10_000);
    let refused =
        arrived.iter().filter(|delivery| Message::decode(&delivery.payload).is_err()).count() as u64;
    assert_eq!(refused, network.traffic().damaged.messages);
    assert!((4750..5250).contains(&refused), "{refused}");
    assert!(arrived.iter().all(|d| (d.payload == good) == Message::decode(&d.payload).is_ok()));
}

#[test]
fn clocks_are_ahead_by_offset_and_drift_while_the_fault_lasts() {
    let rule = Rule { from: robots(&[B]), ..Rule::always(Fault::Clock { offset_s: 0.5, drift_ppm: 100.0 }) };
    let plan = FaultPlan::new(vec![rule.between(10.0, 110.0)]).unwrap();
    assert!((plan.clock_error_s(B, 60.0) - 0.505).abs() < 1e-12);
    for (robot, t_s) in [(A, 60.0), (B, 9.0), (B, 110.0)] {
        assert_eq!(plan.clock_error_s(robot, t_s).to_bits(), 0.0_f64.to_bits());
    }
}

#[test]
fn the_luck_of_a_link_depends_on_no_other_link_nor_on_other_rules() {
    let loss = || Rule::always(Fault::Loss { loss: 0.5 });
    let alone: Vec<bool> = {
        let mut injector = injector(vec![loss()]);
        (0..200).map(|_| passes(&mut injector, 0.0, A, B)).collect()
    };
    let mut busy = injector(vec![loss(), Rule::always(Fault::Delay { delay_s: 1.0, jitter_s: 1.0 })]);
    let among_others: Vec<bool> = (0..200)
        .map(|_| {
            passes(&mut busy, 0.0, A, C);
            passes(&mut busy, 0.0, A, B)
        })
        .collect();
    assert_eq!(alone, among_others);
}
