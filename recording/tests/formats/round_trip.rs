//! What is written reads back the same, to the nanosecond and to the bit.

use std::collections::BTreeMap;
use std::fs;

use crate::common::{Folder, read_with};
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};
use pleiad_recording::{
    BeamSample, Command, Nominal, NominalRobot, Overwrite, ReadOptions, Recording, RobotRecording,
    SteerSample, TruthSample, open, write_folder,
};
use proptest::collection::{btree_map, btree_set};
use proptest::prelude::*;

fn number() -> impl Strategy<Value = f64> {
    use proptest::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    POSITIVE | NEGATIVE | NORMAL | SUBNORMAL | ZERO
}

fn pose() -> impl Strategy<Value = Pose2> {
    (number(), number(), -3.2..3.2).prop_map(|(x, y, yaw)| Pose2::new(x, y, yaw))
}

fn times() -> impl Strategy<Value = Vec<Timestamp>> {
    btree_set(any::<i64>().prop_map(Timestamp), 1..8).prop_map(|times| times.into_iter().collect())
}

/// A channel of distinct stamps.
fn channel<T: std::fmt::Debug>(
    value: impl Strategy<Value = T> + Clone,
) -> impl Strategy<Value = Vec<(Timestamp, T)>> {
    times().prop_flat_map(move |times| {
        let values = proptest::collection::vec(value.clone(), times.len());
        (Just(times), values).prop_map(|(times, values)| times.into_iter().zip(values).collect())
    })
}

fn samples(reading: impl Strategy<Value = Reading> + Clone) -> impl Strategy<Value = Vec<Sample>> {
    channel(reading)
        .prop_map(|rows| rows.into_iter().map(|(time, reading)| Sample { time, reading }).collect())
}

fn two(make: fn(f64, f64) -> Reading) -> impl Strategy<Value = Reading> + Clone {
    (number(), number()).prop_map(move |(a, b)| make(a, b)).boxed()
}

fn relative() -> impl Strategy<Value = Relative> {
    prop_oneof![
        pose().prop_map(Relative::Pose),
        (number(), number()).prop_map(|(x_m, y_m)| Relative::Position { x_m, y_m }),
        number().prop_map(|range| Relative::Range { range_m: range.abs() }),
        number().prop_map(|bearing_rad| Relative::Bearing { bearing_rad }),
        (number(), number())
            .prop_map(|(range, bearing_rad)| Relative::RangeBearing { range_m: range.abs(), bearing_rad }),
    ]
}

fn sighting() -> impl Strategy<Value = Reading> + Clone {
    let target = prop_oneof![
        any::<u32>().prop_map(|id| Target::Landmark(LandmarkId(id))),
        // Never the observer itself, whose numbers are small here.
        (100..=u32::MAX).prop_map(|id| Target::Robot(RobotId(id))),
    ];
    (target, relative()).prop_map(|(target, relative)| Reading::Sighting { target, relative }).boxed()
}

fn robot() -> impl Strategy<Value = RobotRecording> {
    let odometry = prop_oneof![
        samples(two(|forward_m_s, yaw_rate_rad_s| Reading::Velocity { forward_m_s, yaw_rate_rad_s })),
        samples(two(|left_rad, right_rad| Reading::Wheels { left_rad, right_rad })),
        samples(pose().prop_map(Reading::Increment).boxed()),
    ];
    let commands = channel((number(), number()).boxed()).prop_map(|rows| {
        let command = |(time, (forward_m_s, yaw_rate_rad_s))| Command { time, forward_m_s, yaw_rate_rad_s };
        rows.into_iter().map(command).collect::<Vec<_>>()
    });
    let truth = channel(pose().boxed())
        .prop_map(|rows| rows.into_iter().map(|(time, pose)| TruthSample { time, pose }).collect::<Vec<_>>());
    let steer = channel(number().boxed()).prop_map(|rows| {
        rows.into_iter().map(|(time, angle_rad)| SteerSample { time, angle_rad }).collect::<Vec<_>>()
    });
    let scans = channel((number(), 1e-3..1e3).boxed()).prop_map(|rows| {
        let beam = |(time, (bearing_rad, range_m))| BeamSample { time, bearing_rad, range_m };
        rows.into_iter().map(beam).collect::<Vec<_>>()
    });
    let gyro = samples(number().prop_map(|yaw_rate_rad_s| Reading::Gyro { yaw_rate_rad_s }).boxed());
    let heading = samples(number().prop_map(|heading_rad| Reading::Heading { heading_rad }).boxed());
    let gps = samples(two(|x_m, y_m| Reading::Gps { x_m, y_m }));
    (odometry, commands, truth, gyro, heading, gps, samples(sighting()), steer, scans).prop_map(
        |(odometry, commands, truth, gyro, heading, gps, sightings, steer, scans)| RobotRecording {
            odometry,
            commands,
            truth,
            gyro,
            heading,
            gps,
            sightings,
            steer,
            scans,
        },
    )
}

pub fn recording() -> impl Strategy<Value = Recording> {
    let landmarks = btree_map(any::<u32>().prop_map(LandmarkId), [number(), number()], 0..5);
    let robots = btree_map((0..9_u32).prop_map(RobotId), robot(), 1..4);
    let walls = proptest::collection::vec([number(), number(), number(), number()], 0..4);
    (".{0,12}", landmarks, walls, robots).prop_map(|(name, landmarks, walls, robots)| Recording {
        name,
        landmarks,
        walls,
        nominal: None,
        robots,
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_recording_reads_back_to_the_same_bits(recording in recording()) {
        let parent = tempfile::tempdir().expect("a temporary folder");
        let path = parent.path().join("not/yet/there");
        write_folder(&recording, &path, Overwrite::Refuse).unwrap_or_else(|error| panic!("{error}"));
        let (read, _) = open(&path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        // The debug form tells zeros of either sign apart, and no two numbers share one.
        prop_assert_eq!(format!("{read:?}"), format!("{recording:?}"));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn of_arbitrary_bytes_every_row_is_accounted_for(
        cells in proptest::collection::vec("[0-9.,\n\r#eE+\\-naif \u{0}\u{e9}]{0,12}", 0..20),
        tail in proptest::collection::vec(any::<u8>(), 0..40),
    ) {
        let folder = Folder::new(&[("r1/velocity.csv", "")]);
        let mut bytes = format!("t,v,w\n1,2,3\n{}", cells.join(",")).into_bytes();
        bytes.extend(tail);
        fs::write(folder.path().join("r1/velocity.csv"), bytes).expect("written");
        let report = read_with(&folder, ReadOptions { skip_bad_rows: true }).1;
        let file = report.file("r1/velocity.csv").expect("read");
        prop_assert_eq!(file.rows, file.kept + file.skipped + file.duplicates + file.conflicts);
    }
}

#[test]
fn an_interrupted_write_is_refused_when_read() {
    let folder = Folder::new(&[]);
    let mut recording = small();
    recording.robots.insert(RobotId(2), recording.robots[&RobotId(1)].clone());
    write_folder(&recording, folder.path(), Overwrite::Refuse).expect("writable");
    fs::remove_dir_all(folder.path().join("r2")).expect("the last robot was not yet written");
    let error = open(folder.path(), &ReadOptions::default()).expect_err("incomplete");
    assert!(error.to_string().contains("recording.toml lists robot 2"), "{error}");
}

pub fn small() -> Recording {
    let reading = Reading::Velocity { forward_m_s: 0.1, yaw_rate_rad_s: 0.2 };
    let robot = RobotRecording {
        odometry: vec![Sample { time: Timestamp(1_248_444_175_103_000_001), reading }],
        ..RobotRecording::default()
    };
    Recording { name: "small".to_owned(), robots: [(RobotId(1), robot)].into(), ..Recording::default() }
}

#[test]
fn the_written_files_are_those_of_the_format() {
    let mut recording = small();
    recording.landmarks.insert(LandmarkId(7), [1.0, -0.25]);
    let folder = Folder::new(&[]);
    write_folder(&recording, folder.path(), Overwrite::Refuse).expect("an empty folder is no recording");
    let text = |file: &str| fs::read_to_string(folder.path().join(file)).expect("written");
    assert_eq!(text("landmarks.csv"), "id,x,y\nL07,1.0,-0.25\n");
    assert_eq!(text("r1/velocity.csv"), "t,v,w\n1248444175.103000001,0.1,0.2\n");
    assert_eq!(
        fs::read_dir(folder.path().join("r1")).expect("a folder").count(),
        1,
        "no empty channel, no rest"
    );
    assert!(text("recording.toml").contains("robots = [1]\n"));
}

#[test]
fn a_recording_with_nominal_values_reads_back_equal_and_cleanly() {
    let mut recording = small();
    let mut nominal = Nominal::default();
    (nominal.range_sensor.max_range_m, nominal.range_sensor.half_fov_rad) = (5.0, 1.0);
    nominal.range_sensor.range_scale = 1.0;
    let robot = NominalRobot {
        wheel_radius: 0.08,
        track_width: 0.4,
        encoder_ticks_per_rev: 1024.0,
        gyro_scale: 1.0,
        rates_hz: BTreeMap::from([("gps_rate_hz".to_owned(), 0.0)]),
        ..NominalRobot::default()
    };
    nominal.robots.insert(RobotId(1), robot);
    recording.nominal = Some(nominal);
    let folder = Folder::new(&[]);
    write_folder(&recording, folder.path(), Overwrite::Refuse).expect("writable");
    let (read, report) = read_with(&folder, ReadOptions::default());
    assert_eq!(read, recording);
    assert!(report.is_clean(), "{report}");
}

#[test]
fn a_recording_is_not_overwritten_unless_told() {
    let mut first = small();
    first.robots.insert(RobotId(2), first.robots[&RobotId(1)].clone());
    let folder = Folder::new(&[("report.html", "mine")]);
    write_folder(&first, folder.path(), Overwrite::Refuse).expect("other files are no recording");
    let error = write_folder(&small(), folder.path(), Overwrite::Refuse).expect_err("one is there");
    assert!(error.to_string().contains("already holds a recording"), "{error}");
    assert_eq!(read_with(&folder, ReadOptions::default()).0, first);
    write_folder(&small(), folder.path(), Overwrite::Replace).expect("told to");
    assert_eq!(read_with(&folder, ReadOptions::default()).0, small(), "robot 2 is gone");
    assert_eq!(fs::read_to_string(folder.path().join("report.html")).expect("kept"), "mine");
}

#[test]
fn what_could_not_be_read_back_is_not_written_at_all() {
    let refused = |change: fn(&mut RobotRecording)| {
        let mut recording = small();
        change(recording.robots.get_mut(&RobotId(1)).expect("robot 1"));
        let folder = Folder::new(&[]);
        let error = write_folder(&recording, folder.path(), Overwrite::Refuse).expect_err("unwritable");
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 0, "nothing was touched");
        error.to_string()
    };
    assert!(refused(|robot| robot.odometry.clear()).contains("robot 1, odometry: none"));
    assert!(refused(|robot| robot.gps = robot.odometry.clone()).contains("robot 1, gps at"));
    let error = refused(|robot| {
        robot.gyro = vec![Sample { time: Timestamp(0), reading: Reading::Gyro { yaw_rate_rad_s: f64::NAN } }];
    });
    assert!(error.contains("gyro at 0.000000000 s: the number NaN is not finite"), "{error}");
    let error = refused(|robot| {
        robot.commands = [2, 1]
            .map(|nanos| Command { time: Timestamp(nanos), forward_m_s: 0.0, yaw_rate_rad_s: 0.0 })
            .to_vec();
    });
    assert!(error.contains("stamped before the row in front of it"), "{error}");
}
