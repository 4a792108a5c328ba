//! Chance: repeatable, and untouched by what is added.

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::{Reading, Sample, Target};

use crate::run;

fn text(team_size: u32, more: &str) -> String {
    format!(
        "name = \"streams\"\nduration_s = 60.0\nteam_size = {team_size}\nrandom_landmarks = 4\n\
         [defaults]\nmotion.keep_away_m = 0.0\ngyro.rate_hz = 25.0\nheading.rate_hz = 2.0\n\
         [defaults.relative]\nrate_hz = 2.0\nsee = \"both\"\n{more}\n"
    )
}

#[test]
fn one_seed_gives_one_run_bit_for_bit() {
    let (first, second) = (run(&text(4, ""), 5), run(&text(4, ""), 5));
    assert_eq!(first.recording, second.recording);
    assert_eq!(first.priors, second.priors);
    assert_eq!(first.tracks, second.tracks);
}

#[test]
fn another_seed_changes_every_channel() {
    let (first, second) = (run(&text(4, ""), 5), run(&text(4, ""), 6));
    assert_ne!(first.recording.landmarks, second.recording.landmarks);
    for (robot, one) in &first.recording.robots {
        let other = &second.recording.robots[robot];
        assert_ne!(one.truth, other.truth);
        assert_ne!(one.odometry, other.odometry);
        assert_ne!(one.gyro, other.gyro);
        assert_ne!(one.heading, other.heading);
        assert_ne!(one.sightings, other.sightings);
        assert_ne!(first.priors[robot], second.priors[robot]);
    }
}

#[test]
fn another_robot_changes_nothing_but_the_sightings_of_itself() {
    let (four, five) = (run(&text(4, ""), 7), run(&text(5, ""), 7));
    let of_newcomer = |sample: &Sample| {
        matches!(sample.reading, Reading::Sighting { target: Target::Robot(RobotId(5)), .. })
    };
    assert_eq!(four.recording.landmarks, five.recording.landmarks);
    for (robot, before) in &four.recording.robots {
        let mut after = five.recording.robots[robot].clone();
        assert!(after.sightings.iter().any(of_newcomer));
        after.sightings.retain(|sample| !of_newcomer(sample));
        assert_eq!(before, &after, "robot {robot}");
        assert_eq!(four.priors[robot], five.priors[robot]);
    }
}

#[test]
fn another_sensor_changes_nothing_but_its_own_channel() {
    let without = run(&text(3, ""), 8);
    let mut with = run(&text(3, "[[robots]]\nid = 1\ngps = { rate_hz = 2.0 }"), 8);
    let gps = std::mem::take(&mut with.recording.robots.get_mut(&RobotId(1)).unwrap().gps);
    assert!(gps.len() > 100);
    assert_eq!(without.recording.robots, with.recording.robots);
    assert_eq!(without.priors, with.priors);
}

#[test]
fn more_landmarks_leave_the_first_ones_and_their_sightings_as_they_were() {
    let few = run(&text(2, ""), 9);
    let many = run(&text(2, "").replace("random_landmarks = 4", "random_landmarks = 9"), 9);
    let new = |sample: &Sample| {
        matches!(sample.reading, Reading::Sighting { target: Target::Landmark(landmark), .. }
            if !few.recording.landmarks.contains_key(&landmark))
    };
    let mut kept = many.recording.landmarks.clone();
    kept.retain(|landmark, _| few.recording.landmarks.contains_key(landmark));
    assert_eq!(few.recording.landmarks, kept);
    for (robot, before) in &few.recording.robots {
        let mut after = many.recording.robots[robot].sightings.clone();
        after.retain(|sample| !new(sample));
        assert_eq!(before.sightings, after);
    }
}
