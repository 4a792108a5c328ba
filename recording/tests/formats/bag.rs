//! ROS 2 bags become recordings through a mapping.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::fs;
use std::path::PathBuf;

use mcap::records::MessageHeader;
use pleiad_estimation::sample::{Reading, Relative, Target};
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};
use pleiad_recording::{Form, IngestReport, ReadOptions, Recording, RobotRecording, open};
use pleiad_ros::messages::builtin_interfaces::Time;
use pleiad_ros::messages::geometry_msgs::{
    Point, Pose, PoseStamped, Quaternion, Transform, TransformStamped, Twist, Vector3,
};
use pleiad_ros::messages::nav_msgs::Odometry;
use pleiad_ros::messages::sensor_msgs::{Imu, JointState, NavSatFix, NavSatStatus};
use pleiad_ros::messages::std_msgs::Header;
use pleiad_ros::messages::tf2_msgs::TFMessage;
use pleiad_ros::{Message, to_cdr};

/// Seconds of Unix time that all stamps begin at.
const START: i32 = 1_700_000_000;

pub(super) fn header(seconds: i32, frame: &str) -> Header {
    Header { stamp: Time { sec: START + seconds, nanosec: 5 }, frame_id: frame.to_owned() }
}

fn at(seconds: i64) -> Timestamp {
    Timestamp((i64::from(START) + seconds) * 1_000_000_000 + 5)
}

fn turned(yaw: f64) -> Quaternion {
    Quaternion { x: 0.0, y: 0.0, z: (0.5 * yaw).sin(), w: (0.5 * yaw).cos() }
}

fn pose(x: f64, y: f64, yaw: f64) -> Pose {
    Pose { position: Point { x, y, z: 0.3 }, orientation: turned(yaw) }
}

/// A bag in a folder with its mapping.
pub(super) struct Bag {
    folder: tempfile::TempDir,
    pub(super) writer: mcap::Writer<fs::File>,
}

impl Bag {
    pub(super) fn new(compression: Option<mcap::Compression>) -> Self {
        Self::with(mcap::WriteOptions::new().compression(compression))
    }

    pub(super) fn with(options: mcap::WriteOptions) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = fs::File::create(folder.path().join("bag_0.mcap")).expect("created");
        Self { folder, writer: options.profile("ros2").create(file).expect("begun") }
    }

    pub(super) fn add<M: Message>(&mut self, topic: &str, message: &M, log_time: u64) {
        self.add_bytes(topic, M::NAME, &M::description().text(), &to_cdr(message).expect("CDR"), log_time);
    }

    pub(super) fn add_bytes(&mut self, topic: &str, name: &str, text: &str, data: &[u8], log_time: u64) {
        let schema = self.writer.add_schema(name, "ros2msg", text.as_bytes()).expect("added");
        let channel = self.writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).expect("added");
        let header = MessageHeader { channel_id: channel, sequence: 0, log_time, publish_time: 0 };
        self.writer.write_to_known_channel(&header, data).expect("written");
    }

    pub(super) fn done(mut self, mapping: &str) -> Done {
        self.writer.finish().expect("finished");
        let path = self.folder.path().join("bag_0.mcap");
        fs::write(self.folder.path().join("mapping.toml"), mapping).expect("written");
        Done { _folder: self.folder, path }
    }
}

pub(super) struct Done {
    _folder: tempfile::TempDir,
    pub(super) path: PathBuf,
}

impl Done {
    pub(super) fn read(&self) -> (Recording, IngestReport) {
        open(&self.path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
    }

    pub(super) fn refusal(&self) -> String {
        open(&self.path, &ReadOptions::default()).expect_err("refused").to_string()
    }
}

pub(super) fn robot(recording: &Recording) -> &RobotRecording {
    &recording.robots[&RobotId(1)]
}

fn odometry(seconds: i32, x: f64, speed: f64) -> Odometry {
    let mut message = Odometry { header: header(seconds, "odom"), ..Odometry::default() };
    message.child_frame_id = "base_link".into();
    message.pose.pose = pose(x, 0.0, 0.0);
    message.twist.twist.linear.x = speed;
    message.twist.twist.angular.z = -0.25;
    message
}

pub(super) const ODOMETRY: &str = "
[[topic]]
topic = \"/robot1/odom\"
robot = 1
channel = \"velocity\"
";

/// A bag of two odometry messages.
pub(super) fn small() -> Bag {
    small_with(mcap::WriteOptions::new().compression(None))
}

pub(super) fn small_with(options: mcap::WriteOptions) -> Bag {
    let mut bag = Bag::with(options);
    bag.add("/robot1/odom", &odometry(0, 0.0, 0.5), 7);
    bag.add("/robot1/odom", &odometry(1, 0.5, 0.75), 9);
    bag
}

#[test]
fn velocities_are_read_whatever_the_compression() {
    for compression in [None, Some(mcap::Compression::Lz4), Some(mcap::Compression::Zstd)] {
        let mut bag = Bag::new(compression);
        for seconds in 0..500 {
            bag.add("/robot1/odom", &odometry(seconds, 0.0, f64::from(seconds)), 7);
        }
        let (recording, report) = bag.done(ODOMETRY).read();
        assert_eq!(report.form, Form::Bag);
        let odometry = &robot(&recording).odometry;
        assert_eq!(odometry.len(), 500);
        assert_eq!(odometry[499].time, at(499), "exact to the nanosecond");
        let expected = Reading::Velocity { forward_m_s: 499.0, yaw_rate_rad_s: -0.25 };
        assert_eq!(odometry[499].reading, expected);
        assert_eq!(report.file("/robot1/odom").expect("read").kept, 500);
    }
}

#[test]
fn a_folder_of_split_files_is_one_bag_and_log_times_can_be_asked_for() {
    let done = small().done(&format!("name = \"hall\"\n{ODOMETRY}time = \"log\"\noffset_s = -0.5\n"));
    let folder = done.path.parent().expect("a folder");
    fs::copy(&done.path, folder.join("bag_1.mcap")).expect("copied");
    let (recording, report) = open(folder, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(recording.name, "hall");
    let times: Vec<i64> = robot(&recording).odometry.iter().map(|sample| sample.time.0).collect();
    assert_eq!(times, [-499_999_993, -499_999_991]);
    let file = report.file("/robot1/odom").expect("read");
    assert_eq!((file.rows, file.duplicates), (4, 2), "the second file repeats the first");
}

#[test]
fn every_channel_is_made_of_its_messages() {
    let mut bag = Bag::new(Some(mcap::Compression::Zstd));
    let moving = Twist { linear: Vector3 { x: 0.3, ..Vector3::default() }, ..Twist::default() };
    bag.add("/cmd_vel", &moving, 1_700_000_000_000_000_042);
    for seconds in 0..3 {
        let imu = Imu {
            header: header(seconds, "imu"),
            orientation: turned(0.5),
            angular_velocity: Vector3 { x: 9.0, y: 9.0, z: 0.125 },
            ..Imu::default()
        };
        bag.add("/imu", &imu, 0);
        let joints = JointState {
            header: header(seconds, ""),
            name: ["rl", "fl", "rr", "fr", "steer"].map(str::to_owned).to_vec(),
            position: vec![1.0, 2.0, 3.0, 5.0, 0.1],
            ..JointState::default()
        };
        bag.add("/joint_states", &joints, 0);
        let transform = |frame: &str, child: &str, x: f64| TransformStamped {
            header: header(seconds, frame),
            child_frame_id: child.to_owned(),
            transform: Transform { translation: Vector3 { x, y: 1.0, z: 0.0 }, rotation: turned(FRAC_PI_2) },
        };
        let transforms = vec![transform("odom", "base", 50.0), transform("world", "mocap", 4.0)];
        bag.add("/tf", &TFMessage { transforms }, 0);
        let mut seen = PoseStamped { header: header(seconds, "base"), pose: pose(2.0, -1.0, 0.25) };
        bag.add("/tag", &seen, 0);
        seen.header.frame_id = "map".into();
        bag.add("/amcl", &seen, 0);
    }
    let done = bag.done(
        r#"
        [[landmark]]
        id = 9
        x_m = 1.5
        y_m = -2.0
        [[topic]]
        topic = "/cmd_vel"
        robot = 1
        channel = "command"
        [[topic]]
        topic = "/imu"
        robot = 1
        channel = "gyro"
        scale = [-1.0]
        [[topic]]
        topic = "/imu"
        robot = 1
        channel = "heading"
        [[topic]]
        topic = "/joint_states"
        robot = 1
        channel = "wheel_odometry"
        left = ["rl", "fl"]
        right = ["rr", "fr"]
        [[topic]]
        topic = "/joint_states"
        robot = 1
        channel = "steer"
        joints = ["steer"]
        [[topic]]
        topic = "/tf"
        robot = 1
        channel = "truth"
        frame = "world"
        child_frame = "/mocap"
        [[topic]]
        topic = "/tag"
        robot = 1
        channel = "relative"
        target = { landmark = 9 }
        [[topic]]
        topic = "/amcl"
        robot = 1
        channel = "gps"
        frame = "map"
        "#,
    );
    let (recording, report) = done.read();
    assert!(report.is_clean(), "{report}");
    assert_eq!(recording.landmarks, BTreeMap::from([(LandmarkId(9), [1.5, -2.0])]));
    let own = robot(&recording);
    assert_eq!(
        (own.commands[0].time, own.commands[0].forward_m_s),
        (Timestamp(1_700_000_000_000_000_042), 0.3)
    );
    assert_eq!(own.gyro[2].reading, Reading::Gyro { yaw_rate_rad_s: -0.125 });
    let Reading::Heading { heading_rad } = own.heading[1].reading else { panic!("a heading") };
    assert!((heading_rad - 0.5).abs() < 1e-15);
    assert_eq!(own.odometry[0].reading, Reading::Wheels { left_rad: 1.5, right_rad: 4.0 });
    assert!((own.steer[0].angle_rad - 0.1).abs() < 1e-15);
    assert_eq!(own.truth.len(), 3);
    assert_eq!((own.truth[0].pose.x_m(), own.truth[0].pose.y_m()), (4.0, 1.0));
    assert!((own.truth[0].pose.yaw_rad() - FRAC_PI_2).abs() < 1e-15);
    let Reading::Sighting { target, relative: Relative::Pose(seen) } = own.sightings[0].reading else {
        panic!("a sighting")
    };
    assert_eq!((target, seen.x_m(), seen.y_m()), (Target::Landmark(LandmarkId(9)), 2.0, -1.0));
    assert_eq!(own.gps[0].reading, Reading::Gps { x_m: 2.0, y_m: -1.0 });
}

#[test]
fn poses_become_increments_in_the_frame_of_the_former() {
    let mut bag = Bag::new(None);
    let mut add = |seconds: i32, x: f64, y: f64, yaw: f64| {
        let mut message = odometry(seconds, 0.0, 0.0);
        message.pose.pose = pose(x, y, yaw);
        bag.add("/robot1/odom", &message, 0);
    };
    // Out of order: the last two are swapped.
    add(0, 10.0, 0.0, FRAC_PI_2);
    add(2, 9.0, 2.0, FRAC_PI_2 + 0.1);
    add(1, 10.0, 2.0, FRAC_PI_2);
    let (recording, _) = bag.done(&ODOMETRY.replace("velocity", "increment")).read();
    let steps: Vec<Pose2> = robot(&recording)
        .odometry
        .iter()
        .map(|sample| match sample.reading {
            Reading::Increment(pose) => pose,
            other => panic!("{other:?}"),
        })
        .collect();
    for (step, (x, y, yaw)) in steps.iter().zip([(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 1.0, 0.1)]) {
        let apart = [step.x_m() - x, step.y_m() - y, step.yaw_rad() - yaw];
        assert!(apart.iter().all(|value| value.abs() < 1e-12), "{step:?}");
    }
    assert_eq!(robot(&recording).odometry[2].time, at(2));
}

#[test]
fn speeds_of_wheels_become_angles() {
    let mut bag = Bag::new(None);
    for (seconds, left, right) in [(0, 1.0, 2.0), (1, 3.0, 4.0), (3, 0.0, 0.0), (4, 9.0, 9.0)] {
        let joints = JointState {
            header: header(seconds, ""),
            name: vec!["l".to_owned(), "r".to_owned()],
            velocity: vec![left, right],
            ..JointState::default()
        };
        bag.add("/wheels", &joints, 0);
    }
    let mapping = "[[topic]]\ntopic = \"/wheels\"\nrobot = 1\nchannel = \"wheel_odometry\"\nleft = [\"l\"]\n\
                   right = [\"r\"]\nscale = [0.5, 1.0]\n";
    let without = bag.done(mapping);
    assert!(without.refusal().contains("found no position of `l`"), "{}", without.refusal());
    fs::write(without.path.with_file_name("mapping.toml"), format!("{mapping}from = \"velocity\"\n"))
        .expect("written");
    let (recording, _) = without.read();
    let last = robot(&recording).odometry[3].reading;
    // Left: (1 * 1 + 3 * 2 + 0 * 1) / 2; right: 2 * 1 + 4 * 2.
    assert_eq!(last, Reading::Wheels { left_rad: 3.5, right_rad: 10.0 });
}

fn fix(seconds: i32, status: i8, latitude: f64, longitude: f64) -> NavSatFix {
    NavSatFix {
        header: header(seconds, "gps"),
        status: NavSatStatus { status, service: 1 },
        latitude,
        longitude,
        altitude: f64::NAN,
        ..NavSatFix::default()
    }
}

#[test]
fn fixes_are_metres_east_and_north_of_the_first_or_of_a_stated_origin() {
    let make = |head: &str| {
        let mut bag = small();
        bag.add("/fix", &fix(0, -1, f64::NAN, f64::NAN), 0);
        bag.add("/fix", &fix(1, 0, 45.0, 7.0), 0);
        bag.add("/fix", &fix(2, 0, 45.0 + 1.0 / 3600.0, 7.0), 0);
        bag.done(&format!("{head}{ODOMETRY}[[topic]]\ntopic = \"/fix\"\nrobot = 1\nchannel = \"gps\"\n"))
    };
    let (recording, report) = make("").read();
    let gps = &robot(&recording).gps;
    assert_eq!((gps.len(), gps[0].reading), (2, Reading::Gps { x_m: 0.0, y_m: 0.0 }));
    let Reading::Gps { x_m, y_m } = gps[1].reading else { panic!("a fix") };
    // A second of arc along the meridian at 45 degrees: 6367381.816 m * pi / 648000.
    assert!(x_m.abs() < 1e-6 && (y_m - 30.869_9).abs() < 1e-3, "{x_m} {y_m}");
    let warnings = report.warnings.join("\n");
    assert!(warnings.contains("/fix: 1 messages without a fix left out"), "{warnings}");
    assert!(warnings.contains("origin at the first fix: latitude 45.0, longitude 7.0"), "{warnings}");
    let (recording, report) =
        make("origin = { latitude_deg = 45.0002777777777778, longitude_deg = 7.0 }\n").read();
    let Reading::Gps { y_m, .. } = robot(&recording).gps[0].reading else { panic!("a fix") };
    assert!((y_m + 30.869_9).abs() < 1e-3, "{y_m}");
    assert!(!report.warnings.iter().any(|warning| warning.contains("origin")));
}

#[test]
fn a_robot_that_tilts_is_refused_by_message_or_left_out() {
    let mut bag = small();
    let mut tilted = odometry(2, 0.0, 0.0);
    tilted.pose.pose.orientation = Quaternion { x: 0.5_f64.sin(), y: 0.0, z: 0.0, w: 0.5_f64.cos() };
    bag.add("/robot1/odom", &tilted, 0);
    let truth = ODOMETRY.replace("velocity", "truth");
    let done = bag.done(&format!("{ODOMETRY}{truth}"));
    let error = done.refusal();
    assert!(
        error.contains("topic /robot1/odom, message 3: found a robot that tilts by 1.000 rad"),
        "{error}"
    );
    assert!(error.contains("(key `max_tilt_rad`)"), "{error}");
    let (recording, report) = open(&done.path, &ReadOptions { skip_bad_rows: true }).expect("skipped");
    assert_eq!(robot(&recording).truth.len(), 2);
    assert_eq!(report.skipped(), 1);
    fs::write(done.path.with_file_name("mapping.toml"), format!("{ODOMETRY}{truth}max_tilt_rad = 1.1\n"))
        .expect("written");
    assert_eq!(robot(&done.read().0).truth.len(), 3);
}

#[test]
fn a_damaged_message_is_named_with_its_field() {
    let mut bag = small();
    let bytes = to_cdr(&odometry(2, 0.0, 0.0)).expect("CDR");
    bag.add_bytes("/robot1/odom", Odometry::NAME, &Odometry::description().text(), &bytes[..100], 0);
    let error = bag.done(ODOMETRY).refusal();
    assert!(
        error.contains("message 3: found nav_msgs/msg/Odometry, field pose.covariance[0], byte 100"),
        "{error}"
    );
}
