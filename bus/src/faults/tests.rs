use super::*;

const A: RobotId = RobotId(1);
const B: RobotId = RobotId(2);
const C: RobotId = RobotId(3);

fn network(seed: u64, faults: LinkFaults) -> VirtualNetwork<Vec<u8>> {
    VirtualNetwork::new(seed, faults).unwrap()
}

fn at(seconds: f64) -> Timestamp {
    Timestamp::from_seconds(seconds)
}

/// A number as a payload of 4 bytes.
fn payload(number: u32) -> Vec<u8> {
    number.to_le_bytes().to_vec()
}

fn numbers(deliveries: &[Delivery<Vec<u8>>]) -> Vec<u32> {
    deliveries.iter().map(|d| u32::from_le_bytes(d.payload.clone().try_into().unwrap())).collect()
}

/// The numbers out of 0..count that arrive from A at B.
fn survivors(network: &mut VirtualNetwork<Vec<u8>>, count: u32) -> Vec<u32> {
    (0..count).for_each(|number| network.send(at(0.0), A, B, payload(number)));
    let mut arrived = numbers(&network.poll(Timestamp::MAX));
    arrived.sort_unstable();
    arrived
}

/// Five standard deviations of a binomial count, the chance of which is below 1e-6.
fn within_five_sigma(found: usize, trials: u32, probability: f64) -> bool {
    let mean = f64::from(trials) * probability;
    (found as f64 - mean).abs() <= 5.0 * (mean * (1.0 - probability)).sqrt()
}

#[test]
fn a_network_without_faults_delivers_at_once_and_in_order() {
    let mut network = network(1, LinkFaults::default());
    (0..100).for_each(|number| network.send(at(1.0), A, B, payload(number)));
    assert!(network.poll(at(0.999)).is_empty());
    assert_eq!(numbers(&network.poll(at(1.0))), (0..100).collect::<Vec<_>>());
    assert!(network.poll(Timestamp::MAX).is_empty());
}

#[test]
fn a_delay_is_kept_to_the_nanosecond() {
    let mut network = network(1, LinkFaults { delay_s: 0.25, ..LinkFaults::default() });
    network.send(Timestamp(7), A, B, payload(0));
    assert_eq!(network.next_due(), Some(Timestamp(250_000_007)));
    assert!(network.poll(Timestamp(250_000_006)).is_empty());
    assert_eq!(network.under_way(), 1);
    let expected = Delivery { from: A, to: B, payload: payload(0) };
    assert_eq!(network.poll(Timestamp(250_000_007)), [expected]);
    assert_eq!(network.next_due(), None);
}

#[test]
fn loss_has_the_stated_rate() {
    for loss in [0.0, 0.01, 0.2, 0.5, 1.0] {
        let mut network = network(3, LinkFaults { loss, ..LinkFaults::default() });
        let arrived = survivors(&mut network, 10_000).len();
        assert!(within_five_sigma(arrived, 10_000, 1.0 - loss), "{loss}: {arrived} of 10000 arrived");
        assert_eq!(network.traffic().lost.messages, 10_000 - arrived as u64);
    }
}

#[test]
fn jitter_spreads_evenly_over_its_interval_and_lets_messages_overtake() {
    let faults = LinkFaults { delay_s: 0.1, jitter_s: 0.4, ..LinkFaults::default() };
    let mut network = network(4, faults);
    (0..10_000).for_each(|number| network.send(at(0.0), A, B, payload(number)));
    assert!(network.poll(at(0.0999)).is_empty());
    // Uniform over [0.1, 0.5]: a quarter is due in each quarter of the interval.
    let mut order = Vec::new();
    for end in [0.2, 0.3, 0.4, 0.5] {
        let quarter = network.poll(at(end));
        assert!(within_five_sigma(quarter.len(), 10_000, 0.25), "{} by {end} s", quarter.len());
        order.extend(numbers(&quarter));
    }
    assert_eq!(network.under_way(), 0);
    assert!(!order.is_sorted());
}

#[test]
fn duplicates_have_the_stated_rate_and_every_original_arrives() {
    let faults = LinkFaults { duplicate: 0.3, jitter_s: 0.1, ..LinkFaults::default() };
    let mut network = network(5, faults);
    let mut arrived = survivors(&mut network, 10_000);
    let copies = arrived.len() - 10_000;
    assert!(within_five_sigma(copies, 10_000, 0.3), "{copies}");
    assert_eq!(network.traffic().duplicated.messages, copies as u64);
    arrived.dedup();
    assert_eq!(arrived.len(), 10_000);
}

const ROUGH: LinkFaults = LinkFaults { loss: 0.3, delay_s: 0.01, jitter_s: 0.5, duplicate: 0.2 };

/// A run with traffic in all directions and a partition, as a transcript.
fn transcript(seed: u64) -> Vec<(u32, u32, Vec<u8>)> {
    let mut network = network(seed, ROUGH);
    let mut transcript = Vec::new();
    for step in 0..200 {
        let now = at(f64::from(step) * 0.05);
        match step {
            80 => network.partition(&[vec![A]]),
            120 => network.heal(),
            _ => {}
        }
        for (from, to) in [(A, B), (B, A), (B, C), (C, A)] {
            network.send(now, from, to, payload(step));
        }
        transcript.extend(network.poll(now).into_iter().map(|d| (d.from.0, d.to.0, d.payload)));
    }
    transcript
}

#[test]
fn one_seed_gives_one_run_and_another_seed_another() {
    assert_eq!(transcript(6), transcript(6));
    assert_ne!(transcript(6), transcript(7));
}

#[test]
fn traffic_on_one_link_does_not_change_the_luck_of_another() {
    let alone = survivors(&mut network(8, ROUGH), 500);
    let mut busy = network(8, ROUGH);
    (0..300).for_each(|number| busy.send(at(0.0), B, A, payload(number)));
    (0..300).for_each(|number| busy.send(at(0.0), A, C, payload(number)));
    busy.poll(Timestamp::MAX);
    assert_eq!(survivors(&mut busy, 500), alone);
    // The two directions of a link differ in their luck.
    let mut back = network(8, ROUGH);
    (0..500).for_each(|number| back.send(at(0.0), B, A, payload(number)));
    let mut back = numbers(&back.poll(Timestamp::MAX));
    back.sort_unstable();
    assert_ne!(back, alone);
}

#[test]
fn a_greater_loss_loses_the_same_messages_and_more() {
    let few = survivors(&mut network(9, LinkFaults { loss: 0.1, ..LinkFaults::default() }), 1000);
    let many = survivors(&mut network(9, LinkFaults { loss: 0.4, ..LinkFaults::default() }), 1000);
    assert!(many.len() < few.len());
    assert!(many.iter().all(|number| few.contains(number)));
}

#[test]
fn a_partition_cuts_between_groups_until_healed() {
    let mut network = network(10, LinkFaults { delay_s: 1.0, ..LinkFaults::default() });
    network.send(at(0.0), A, B, payload(0));
    network.partition(&[vec![A], vec![B, C]]);
    network.send(at(0.0), A, B, payload(1));
    network.send(at(0.0), B, A, payload(2));
    network.send(at(0.0), B, C, payload(3));
    // Robots in no group are together.
    network.send(at(0.0), RobotId(8), RobotId(9), payload(4));
    network.send(at(0.0), RobotId(8), A, payload(5));
    network.heal();
    network.send(at(0.0), A, B, payload(6));
    assert_eq!(numbers(&network.poll(at(1.0))), [0, 3, 4, 6]);
    assert_eq!(network.traffic().cut, Tally { messages: 3, bytes: 12 });
}

#[test]
fn faults_of_one_link_hold_in_its_direction_only() {
    let mut network = network(11, LinkFaults::default());
    network.set_link(A, B, LinkFaults { loss: 1.0, ..LinkFaults::default() }).unwrap();
    network.send(at(0.0), A, B, payload(0));
    network.send(at(0.0), B, A, payload(1));
    assert_eq!(numbers(&network.poll(at(0.0))), [1]);
    network.set_faults(LinkFaults::default()).unwrap();
    network.send(at(0.0), A, B, payload(2));
    assert_eq!(numbers(&network.poll(at(0.0))), [2]);
}

#[test]
fn every_message_is_accounted_for() {
    let mut network = network(12, ROUGH);
    network.partition(&[vec![C]]);
    for number in 0..1000 {
        network.send(at(0.0), A, B, payload(number));
        network.send(at(0.0), A, C, payload(number));
    }
    let delivered = network.poll(at(0.2)).len() as u64;
    let Traffic { sent, duplicated, delivered: out, lost, cut, .. } = network.traffic();
    assert_eq!((sent.messages, sent.bytes, cut.messages), (2000, 8000, 1000));
    assert_eq!(out.messages, delivered);
    let under_way = network.under_way() as u64;
    assert!(under_way > 0 && lost.messages > 0 && duplicated.messages > 0);
    assert_eq!(sent.messages + duplicated.messages, delivered + lost.messages + cut.messages + under_way);
    assert_eq!(sent.bytes + duplicated.bytes, out.bytes + lost.bytes + cut.bytes + 4 * under_way);
}

#[test]
fn faults_that_make_no_sense_are_refused_by_name() {
    let good = LinkFaults::default();
    for (faults, field) in [
        (LinkFaults { loss: -0.1, ..good }, "loss"),
        (LinkFaults { loss: 1.1, ..good }, "loss"),
        (LinkFaults { loss: f64::NAN, ..good }, "loss"),
        (LinkFaults { duplicate: 2.0, ..good }, "duplicate"),
        (LinkFaults { delay_s: -1.0, ..good }, "delay_s"),
        (LinkFaults { jitter_s: f64::INFINITY, ..good }, "jitter_s"),
    ] {
        assert_eq!(faults.check().unwrap_err().field, field);
        assert!(VirtualNetwork::<Vec<u8>>::new(0, faults).is_err());
    }
}
