//! Recordings that lack something or are damaged: the diagnosis says what it cannot test and why, claims
//! nothing of it, tests the rest, and never panics.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests fail by panicking"
)]

mod common;

use common::recorded;
use pleiad_estimation::sample::{Reading, Sample};
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_mismatch::{DiagnoseOptions, Findings, MismatchError, Verdict, diagnose};
use pleiad_physics::Effect;
use pleiad_recording::{Recording, RobotRecording};

/// An antenna that is not where it is declared: forward and left, metres.
const LEVER: (Effect, &[f64]) = (Effect::GpsLeverArm, &[0.2, -0.1]);

/// A damage of a recording on which nothing acts, and what is to be said of it.
struct Damaged {
    name: &'static str,
    damage: fn(&mut Recording),
    verdict: Verdict,
    /// Effects that cannot be tested, with a word of the reason.
    untestable: &'static [(&'static str, &'static str)],
    /// Effects that still are.
    tested: &'static [&'static str],
    /// Words of the notes.
    notes: &'static [&'static str],
}

const TABLE: &[Damaged] = &[
    Damaged {
        name: "whole, of one robot alone",
        damage: |_| {},
        verdict: Verdict::NothingMissing,
        untestable: &[("steer_trim", "steering angle was not recorded")],
        tested: &["track_width_error", "command_delay", "gyro_scale", "gps_lever_arm", "range_bias"],
        notes: &["robot 1, range_to_robot: ranges to robots not recorded"],
    },
    Damaged {
        name: "no gyro",
        damage: |recording| own(recording).gyro.clear(),
        verdict: Verdict::NothingMissing,
        untestable: &[("gyro_bias", "gyro not recorded"), ("gyro_scale", "gyro not recorded")],
        tested: &["track_width_error", "command_delay", "gps_lever_arm"],
        notes: &["robot 1, gyro: gyro not recorded"],
    },
    Damaged {
        name: "no commands",
        damage: |recording| own(recording).commands.clear(),
        verdict: Verdict::NothingMissing,
        untestable: &[
            ("actuator_lag", "commands not recorded"),
            ("command_delay", "commands not recorded"),
            ("floor_tilt", "commands not recorded"),
        ],
        tested: &["track_width_error", "gyro_scale", "gps_lever_arm"],
        notes: &["robot 1, actuator: commands not recorded"],
    },
    Damaged {
        name: "no encoders",
        damage: |recording| own(recording).odometry.clear(),
        verdict: Verdict::NothingMissing,
        untestable: &[("gyro_bias", "wheel angles not recorded")],
        tested: &["command_delay", "gps_lever_arm"],
        notes: &["robot 1, body: wheel angles not recorded"],
    },
    Damaged {
        name: "no truth",
        damage: |recording| own(recording).truth.clear(),
        verdict: Verdict::Untestable,
        untestable: &[
            ("gps_lever_arm", "truth not recorded"),
            ("lateral_skid", "truth not recorded"),
            ("range_bias", "truth not recorded"),
        ],
        tested: &["command_delay", "gyro_scale"],
        notes: &["robot 1, body: truth not recorded"],
    },
    Damaged {
        name: "truth in every second ten seconds",
        damage: |recording| own(recording).truth.retain(|sample| sample.time.seconds() % 20.0 < 10.0),
        verdict: Verdict::NothingMissing,
        untestable: &[],
        tested: &["track_width_error", "gps_lever_arm", "range_bias"],
        notes: &["robot 1, gps: 234 left out, no truth of robot 1 near"],
    },
    Damaged {
        name: "truth by a clock that is a thousand seconds ahead",
        damage: |recording| {
            own(recording).truth.iter_mut().for_each(|sample| sample.time.0 += 1_000_000_000_000);
        },
        verdict: Verdict::Untestable,
        untestable: &[("gps_lever_arm", "480 left out, no truth of robot 1 near")],
        tested: &["command_delay"],
        notes: &["robot 1, gps: 480 left out, no truth of robot 1 near"],
    },
    Damaged {
        name: "no landmarks in the map",
        damage: |recording| recording.landmarks.clear(),
        verdict: Verdict::NothingMissing,
        untestable: &[
            ("range_bias", "1200 left out, of landmarks that are not in the map"),
            ("sensor_lever_arm", "1200 left out, of landmarks that are not in the map"),
        ],
        tested: &["track_width_error", "gps_lever_arm"],
        notes: &["robot 1, bearing_to_landmark: 1200 left out, of landmarks that are not in the map"],
    },
    Damaged {
        name: "three seconds",
        damage: |recording| cut(recording, 3.0),
        verdict: Verdict::Untestable,
        untestable: &[("track_width_error", "s can be compared, 20 s are needed")],
        tested: &[],
        notes: &["robot 1: 2.8 s can be compared; below 20 s nothing is"],
    },
    Damaged {
        name: "a third of a second",
        damage: |recording| cut(recording, 0.3),
        verdict: Verdict::Untestable,
        untestable: &[("track_width_error", ""), ("range_bias", "20 s are needed")],
        tested: &[],
        notes: &["robot 1: 0.2 s can be compared; below 20 s nothing is"],
    },
    Damaged {
        name: "a gyro that is stuck",
        damage: |recording| stick(&mut own(recording).gyro),
        verdict: Verdict::NothingMissing,
        untestable: &[("gyro_bias", "readings of the gyro never change (6000 equal readings)")],
        tested: &["track_width_error"],
        notes: &["gyro: readings of the gyro never change"],
    },
    Damaged {
        name: "positions that are stuck",
        damage: |recording| stick(&mut own(recording).gps),
        verdict: Verdict::NothingMissing,
        untestable: &[("gps_lever_arm", "GPS positions never change")],
        tested: &["track_width_error"],
        notes: &["gps: GPS positions never change (480 equal readings)"],
    },
    Damaged {
        name: "truth that is stuck",
        damage: |recording| {
            let truth = &mut own(recording).truth;
            let first = truth[0].pose;
            for sample in truth {
                sample.pose = first;
            }
        },
        verdict: Verdict::Untestable,
        untestable: &[("lateral_skid", "true poses never change (6000 equal readings)")],
        tested: &["command_delay"],
        notes: &["body: true poses never change"],
    },
    Damaged {
        name: "a robot that never moves",
        damage: |recording| {
            let own = own(recording);
            stick(&mut own.odometry);
            own.commands.iter_mut().for_each(|command| {
                (command.forward_m_s, command.yaw_rate_rad_s) = (0.0, 0.0);
            });
            // The reference system sees it stand, to a tenth of a millimetre.
            for (index, sample) in own.truth.iter_mut().enumerate() {
                sample.pose = Pose2::new(1.0 + 1e-4 * (index as f64).sin(), 2.0, 0.3);
            }
        },
        verdict: Verdict::Untestable,
        untestable: &[
            ("track_width_error", "wheel angles never change (6000 equal readings)"),
            ("command_delay", "wheel angles never change"),
        ],
        tested: &[],
        notes: &["actuator: wheel angles never change"],
    },
    Damaged {
        name: "readings that are no numbers, handed over in memory",
        damage: |recording| {
            for sample in own(recording).gyro.iter_mut().step_by(7) {
                sample.reading = Reading::Gyro { yaw_rate_rad_s: f64::NAN };
            }
        },
        verdict: Verdict::NothingMissing,
        untestable: &[("gyro_bias", "that are no finite numbers")],
        tested: &["track_width_error", "gps_lever_arm"],
        notes: &["gyro: 238 left out that are no finite numbers"],
    },
    Damaged {
        name: "commands that are not finite, handed over in memory",
        damage: |recording| own(recording).commands[40].forward_m_s = f64::INFINITY,
        verdict: Verdict::NothingMissing,
        untestable: &[],
        tested: &["track_width_error", "gps_lever_arm"],
        notes: &["actuator: ", "that are no finite numbers"],
    },
    Damaged {
        name: "a robot that recorded nothing",
        damage: |recording| *own(recording) = RobotRecording::default(),
        verdict: Verdict::Untestable,
        untestable: &[("track_width_error", "wheel angles not recorded"), ("gps_lever_arm", "not recorded")],
        tested: &[],
        notes: &["robot 1: 0.0 s can be compared"],
    },
    Damaged {
        name: "no robots",
        damage: |recording| recording.robots.clear(),
        verdict: Verdict::Untestable,
        untestable: &[],
        tested: &[],
        notes: &["made: no robot recorded anything"],
    },
];

fn own(recording: &mut Recording) -> &mut RobotRecording {
    recording.robots.get_mut(&RobotId(1)).unwrap()
}

/// Repeats the first reading at every stamp.
fn stick(samples: &mut [Sample]) {
    let first = samples[0].reading;
    for sample in samples {
        sample.reading = first;
    }
}

/// Takes away what was recorded from an instant on.
fn cut(recording: &mut Recording, until_s: f64) {
    let kept = |time: Timestamp| time.seconds() < until_s;
    let own = own(recording);
    own.truth.retain(|sample| kept(sample.time));
    own.commands.retain(|command| kept(command.time));
    for samples in [&mut own.odometry, &mut own.gyro, &mut own.gps, &mut own.heading, &mut own.sightings] {
        samples.retain(|sample| kept(sample.time));
    }
}

fn found(recording: Recording) -> Findings {
    diagnose(&[recording], &DiagnoseOptions::default()).unwrap_or_else(|error| panic!("{error}")).findings
}

/// What is wrong with what is said of a damaged recording.
fn complaints(case: &Damaged, recording: &Recording) -> Vec<String> {
    let mut recording = recording.clone();
    (case.damage)(&mut recording);
    let findings = found(recording);
    let mut wrong = Vec::new();
    if findings.verdict != case.verdict {
        wrong.push(format!("the verdict is {:?}", findings.verdict));
    }
    wrong.extend(findings.findings.iter().map(|own| format!("{:?} is claimed", own.effect)));
    for (effect, word) in case.untestable {
        let reasons = || findings.untestable.iter().filter(|own| own.effect == *effect);
        if !reasons().any(|own| own.why.contains(word)) {
            let reasons: Vec<_> = reasons().collect();
            wrong.push(format!("{effect} is not said to be untestable for `{word}`: {reasons:?}"));
        }
    }
    let tested = |effect: &str| findings.undetected.iter().any(|own| own.effect == effect);
    wrong.extend(
        case.tested.iter().filter(|effect| !tested(effect)).map(|effect| format!("{effect} is not tested")),
    );
    wrong.extend(
        findings
            .untestable
            .iter()
            .filter(|own| tested(&own.effect))
            .map(|own| format!("both tested and not: {own:?}")),
    );
    let notes = findings.notes.join("\n");
    wrong.extend(
        case.notes
            .iter()
            .filter(|words| !notes.contains(**words))
            .map(|words| format!("no note `{words}`:\n{notes}")),
    );
    wrong.into_iter().map(|what| format!("{}: {what}", case.name)).collect()
}

#[test]
fn what_cannot_be_tested_is_said_and_nothing_claimed() {
    let recording = recorded(None);
    let wrong: Vec<String> = TABLE.iter().flat_map(|case| complaints(case, &recording)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn what_the_rest_of_a_damaged_recording_shows_is_named() {
    let recording = recorded(Some(LEVER));
    for name in ["whole, of one robot alone", "no gyro", "no commands", "truth in every second ten seconds"] {
        let case = TABLE.iter().find(|case| case.name == name).unwrap();
        let mut recording = recording.clone();
        (case.damage)(&mut recording);
        let findings = found(recording);
        let [finding] = &findings.findings[..] else { panic!("{name}: {:?}", findings.findings) };
        assert_eq!(finding.effect.as_deref(), Some("gps_lever_arm"), "{name}");
        assert_eq!(findings.verdict, Verdict::Named, "{name}");
    }
}

#[test]
fn commands_of_another_time_are_said_to_be_and_nothing_is_found_in_them() {
    let mut recording = recorded(Some(LEVER));
    let commands = &mut own(&mut recording).commands;
    let opposite: Vec<[f64; 2]> =
        commands.iter().rev().map(|own| [own.forward_m_s, own.yaw_rate_rad_s]).collect();
    for (command, [forward_m_s, yaw_rate_rad_s]) in commands.iter_mut().zip(opposite) {
        (command.forward_m_s, command.yaw_rate_rad_s) = (forward_m_s, yaw_rate_rad_s);
    }
    let findings = found(recording);
    let names: Vec<_> = findings.findings.iter().filter_map(|own| own.effect.as_deref()).collect();
    assert_eq!(names, ["gps_lever_arm"], "what has nothing to do with commands");
    for effect in ["command_delay", "actuator_gain", "speed_saturation"] {
        let told = findings.untestable.iter().find(|own| own.effect == effect).unwrap();
        assert!(told.why.contains("commands and motion do not go together"), "{effect}: {}", told.why);
    }
}

#[test]
fn nothing_is_claimed_of_a_moment_however_much_acts_in_it() {
    let mut recording = recorded(Some(LEVER));
    for until_s in [15.0, 3.0, 0.3] {
        cut(&mut recording, until_s);
        let findings = found(recording.clone());
        assert_eq!((findings.verdict, findings.findings.len()), (Verdict::Untestable, 0), "{until_s} s");
        assert!(findings.undetected.is_empty(), "{until_s} s");
    }
}

#[test]
fn several_short_recordings_of_a_robot_together_are_enough() {
    let whole = recorded(Some(LEVER));
    let short: Vec<Recording> = ["a", "b", "c"]
        .iter()
        .zip([15.0, 35.0, 55.0])
        .map(|(name, until_s)| {
            let mut part = Recording { name: (*name).to_owned(), ..whole.clone() };
            cut(&mut part, until_s);
            let kept = |time: Timestamp| time.seconds() >= until_s - 15.0;
            let own = own(&mut part);
            own.truth.retain(|sample| kept(sample.time));
            own.commands.retain(|command| kept(command.time));
            for samples in
                [&mut own.odometry, &mut own.gyro, &mut own.gps, &mut own.heading, &mut own.sightings]
            {
                samples.retain(|sample| kept(sample.time));
            }
            part
        })
        .collect();
    let findings = diagnose(&short, &DiagnoseOptions::default()).unwrap().findings;
    let names: Vec<_> = findings.findings.iter().filter_map(|own| own.effect.as_deref()).collect();
    assert_eq!(names, ["gps_lever_arm"]);
}

#[test]
fn a_nominal_model_that_lacks_the_robot_or_is_not_there_is_an_error() {
    let mut recording = recorded(None);
    recording.nominal.as_mut().unwrap().robots.clear();
    let error = diagnose(&[recording.clone()], &DiagnoseOptions::default()).unwrap_err();
    assert_eq!(error, MismatchError::NoNominalRobot { recording: "made".to_owned(), robot: RobotId(1) });
    assert!(error.to_string().contains("[robots.r1]"), "{error}");
    recording.nominal = None;
    let error = diagnose(&[recording], &DiagnoseOptions::default()).unwrap_err();
    assert!(error.to_string().contains("put a nominal.toml into its folder"), "{error}");
}
