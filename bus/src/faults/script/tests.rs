//! What is drawn, for whom and when.

use super::*;
use crate::faults::Again;

fn robots(numbers: &[u32]) -> BTreeSet<RobotId> {
    numbers.iter().map(|number| RobotId(*number)).collect()
}

fn now_and_then(fault: Fault, every_s: f64, for_s: f64) -> Rule {
    Rule { again: Some(Again { every_s, for_s }), ..Rule::always(fault) }
}

fn chaos() -> FaultPlan {
    let kill = now_and_then(Fault::Kill { robots: BTreeSet::new() }, 10.0, 4.0);
    let stop = now_and_then(Fault::Stop { robots: robots(&[2, 3]) }, 10.0, 4.0);
    let split = now_and_then(Fault::Partition { groups: Vec::new() }, 20.0, 5.0);
    FaultPlan::new(vec![kill, stop, split, Rule::always(Fault::Loss { loss: 0.1 })]).unwrap()
}

#[test]
fn a_script_is_decided_by_its_seed_alone() {
    let team = robots(&[1, 2, 3, 4]);
    let script = chaos().scripted(5, &team, 600.0);
    assert!(!script.is_random());
    assert_eq!(script, chaos().scripted(5, &team, 600.0));
    assert_ne!(script, chaos().scripted(6, &team, 600.0));
    // What is not left to chance stays as it is, and a plan without chance is its own script.
    assert!(script.rules.contains(&Rule::always(Fault::Loss { loss: 0.1 })));
    assert_eq!(script.scripted(7, &team, 600.0), script);
}

#[test]
fn random_faults_keep_their_distances_lengths_and_window() {
    let rule = now_and_then(Fault::Cut, 10.0, 4.0).between(100.0, 500.0);
    let script = FaultPlan { rules: vec![rule] }.scripted(1, &robots(&[1, 2]), 450.0);
    // On average 14 s from one to the next over 350 s.
    assert!((18..=35).contains(&script.rules.len()), "{}", script.rules.len());
    let mut last_s = 100.0;
    for rule in &script.rules {
        let wait_s = rule.start_s - last_s;
        assert!((5.0..=15.0).contains(&wait_s), "{wait_s}");
        let long_s = rule.end_s - rule.start_s;
        assert!(long_s <= 6.0 && (long_s >= 2.0 || rule.end_s >= 450.0), "{long_s}");
        last_s = rule.end_s;
    }
    assert!(last_s <= 450.0);
}

#[test]
fn one_process_has_one_trouble_at_a_time_and_everyone_has_some() {
    let team = robots(&[1, 2, 3]);
    let mut plan = chaos();
    plan.rules.push(Rule::always(Fault::Kill { robots: robots(&[1]) }).between(50.0, 300.0));
    let script = plan.scripted(3, &team, 900.0);
    let mut spans: BTreeMap<RobotId, Vec<(f64, f64)>> = BTreeMap::new();
    for rule in script.rules.iter().filter(|rule| rule.fault.is_of_processes()) {
        let befallen = rule.fault.robots().unwrap();
        assert_eq!(befallen.len(), 1);
        assert!(!matches!(rule.fault, Fault::Stop { .. }) || !befallen.contains(&RobotId(1)));
        spans.entry(*befallen.first().unwrap()).or_default().push((rule.start_s, rule.end_s));
    }
    assert_eq!(spans.keys().copied().collect::<BTreeSet<_>>(), team);
    for spans in spans.values_mut() {
        spans.sort_by(|a, b| a.0.total_cmp(&b.0));
        assert!(
            spans.len() > 5 && spans.windows(2).all(|pair| pair[0].1 + PAUSE_S <= pair[1].0),
            "{spans:?}"
        );
    }
}

#[test]
fn random_groups_part_the_team() {
    let team = robots(&[1, 2, 3, 4]);
    let script = chaos().scripted(11, &team, 2000.0);
    let groups = script.rules.iter().filter_map(|rule| match &rule.fault {
        Fault::Partition { groups } => Some(groups[0].clone()),
        _ => None,
    });
    let groups: BTreeSet<BTreeSet<RobotId>> = groups.collect();
    assert!(groups.iter().all(|group| !group.is_empty() && group.len() < 4 && group.is_subset(&team)));
    assert!(groups.len() > 8, "{groups:?}");
    // Nobody to part from.
    let alone = chaos().scripted(11, &robots(&[1]), 2000.0);
    assert!(!alone.rules.iter().any(|rule| matches!(rule.fault, Fault::Partition { .. })));
}
