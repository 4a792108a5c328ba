//! A boot begins with the first odometry, says what everyone needs to know of it, and says it to the
//! journal first.

use pleiad_agent::{Event, Notice, Record};
use pleiad_estimation::fact::{Absolute, Body, NoiseRef, Quantity};
use pleiad_estimation::fold::FoldConfig;
use pleiad_estimation::{BootIndex, Pose2};

use crate::support::{agent, assert_pose, feed, gps, handle, id, node, node_of, seconds, start, velocity};

#[test]
fn the_first_odometry_says_boot_clock_profiles_and_prior_in_this_order() {
    let mut node = node(1);
    let handled = feed(&mut node, velocity(10.0));
    let names: Vec<&str> = handled
        .published
        .iter()
        .map(|entry| match entry.body {
            Body::Boot(_) => "boot",
            Body::ClockMap(_) => "clock",
            Body::Profile(_) => "profile",
            Body::Observation(_) => "observation",
            Body::Half(_) => "half",
            Body::Seal(_) => "seal",
            Body::Vote(_) => "vote",
        })
        .collect();
    let profiles = ["profile"; 7];
    assert_eq!(names, [&["boot", "clock"][..], &profiles, &["observation"]].concat());
    for (sequence, entry) in (0..).zip(&handled.published) {
        assert_eq!(entry.id, id(1, 0, sequence));
    }
    // All of it and the sample in one frame, the sample last.
    let (last, entries) = handled.journal.split_last().unwrap();
    assert_eq!(*last, Record::Sample(velocity(10.0)));
    assert!(entries.iter().zip(&handled.published).all(|(kept, said)| *kept == Record::Entry(said.clone())));
    assert_eq!(entries.len(), handled.published.len());
}

#[test]
fn a_boot_states_its_beginning_and_its_prior_as_configured() {
    let mut node = node(1);
    let said = feed(&mut node, velocity(10.0)).published;
    let Body::Boot(boot) = said[0].body else { panic!("{:?}", said[0]) };
    assert_eq!(boot.time, seconds(10.0));
    assert_eq!(boot.nominal, start());
    assert_eq!(boot.configuration, FoldConfig::default().hash());
    assert_eq!(boot.continuation, None);
    let Body::Observation(prior) = said.last().unwrap().body else { panic!("no prior") };
    assert_eq!(prior.time, seconds(10.0));
    assert_eq!(prior.quantity, Quantity::Absolute(Absolute::Pose(start())));
    assert_eq!(prior.observer.nominal, start());
    let NoiseRef::Explicit(noise) = prior.noise else { panic!("{:?}", prior.noise) };
    assert_eq!(noise.dimension, 3);
    let expected = [0.01, 0.0, 0.01, 0.0, 0.0, 0.0025];
    assert!(noise.lower.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-15));
}

#[test]
fn profiles_are_those_of_the_configured_sensors_and_keep_their_index() {
    let mut config = agent(1);
    config.sensors.range = None;
    config.sensors.gps = None;
    let said = feed(&mut node_of(&config, 1), velocity(0.0)).published;
    let profiles: Vec<(u16, u8, f64)> = said
        .iter()
        .filter_map(|entry| match entry.body {
            Body::Profile(profile) => Some((profile.index, profile.noise.dimension, profile.noise.lower[0])),
            _ => None,
        })
        .collect();
    // Squares of the sigmas configured, by kind: pose 0, position 1, bearing 3, range and bearing 4, heading 6.
    let expected = [(0, 3, 0.0025), (1, 2, 0.0036), (3, 1, 0.0009), (4, 2, 0.0064), (6, 1, 0.0036)];
    assert_eq!(profiles.len(), expected.len());
    for (found, expected) in profiles.iter().zip(expected) {
        assert_eq!((found.0, found.1), (expected.0, expected.1));
        assert!((found.2 - expected.2).abs() < 1e-15, "{found:?}");
    }
}

#[test]
fn the_estimate_begins_at_the_prior_with_its_sigmas() {
    let handled = feed(&mut node(1), velocity(10.0));
    let [estimate] = handled.estimates[..] else { panic!("{:?}", handled.estimates) };
    assert_eq!((estimate.time, estimate.boot), (seconds(10.0), BootIndex(0)));
    assert_pose(&estimate.map_from_robot, &start(), 1e-15);
    for (found, expected) in estimate.sigma.into_iter().zip([0.1, 0.1, 0.05]) {
        assert!((found - expected).abs() < 1e-14, "{:?}", estimate.sigma);
    }
    assert!(handled.notices.is_empty(), "{:?}", handled.notices);
}

#[test]
fn without_a_prior_a_boot_begins_at_the_origin_and_says_that_it_has_no_place() {
    let mut config = agent(1);
    config.prior = None;
    let mut node = node_of(&config, 1);
    let handled = feed(&mut node, velocity(10.0));
    assert_eq!(handled.notices, [Notice::NoPrior { boot: BootIndex(0) }]);
    let Body::Boot(boot) = handled.published[0].body else { panic!("no boot") };
    assert_eq!(boot.nominal, Pose2::identity());
    assert!(!handled.published.iter().any(|entry| matches!(entry.body, Body::Observation(_))));
    assert!(handled.estimates.is_empty());
    assert_eq!(node.estimate(), None);
}

#[test]
fn a_prior_for_another_boot_places_nothing() {
    let mut config = agent(1);
    config.prior.as_mut().unwrap().for_boot = 3;
    let handled = feed(&mut node_of(&config, 1), velocity(10.0));
    assert_eq!(handled.notices, [Notice::NoPrior { boot: BootIndex(0) }]);
    assert!(handled.estimates.is_empty());
}

#[test]
fn nothing_but_odometry_begins_a_boot() {
    let mut node = node(1);
    let before = feed(&mut node, gps(1.0));
    assert!(before.published.is_empty());
    assert!(handle(&mut node, Event::InputEnded).published.is_empty());
    assert_eq!(node.status().logs, []);
}

#[test]
fn a_later_odometry_says_nothing() {
    let mut node = node(1);
    feed(&mut node, velocity(10.0));
    let handled = feed(&mut node, velocity(10.1));
    assert!(handled.published.is_empty());
    assert_eq!(handled.journal, [Record::Sample(velocity(10.1))]);
}
