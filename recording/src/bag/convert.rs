//! What a ROS message says to one channel.

use pleiad_estimation::Pose2;
use pleiad_estimation::sample::{Reading, Relative};
use pleiad_ros::messages::builtin_interfaces::Time;
use pleiad_ros::messages::geometry_msgs::{
    Point, Pose, PoseStamped, PoseWithCovarianceStamped, TransformStamped, Twist, TwistStamped,
    TwistWithCovarianceStamped,
};
use pleiad_ros::messages::nav_msgs::Odometry;
use pleiad_ros::messages::sensor_msgs::{Imu, JointState, NavSatFix, NavSatStatus};
use pleiad_ros::messages::std_msgs::Header;
use pleiad_ros::messages::tf2_msgs::TFMessage;
use pleiad_ros::{CdrError, Message, from_cdr};

use super::geodesy::TangentPlane;
use super::mapping::{JointValue, Origin, RelativeAs, Topic};
use super::turn::yaw;

/// A covariance that begins with this says that its quantity was not measured.
const UNKNOWN: f64 = -1.0;

/// What a message holds, of whichever type it is.
#[derive(Clone, Debug, Default)]
pub(super) struct Part {
    pub(super) stamp: Option<Time>,
    pub(super) frame: Option<String>,
    pub(super) child: Option<String>,
    pose: Option<Pose>,
    twist: Option<Twist>,
    imu: Option<Imu>,
    fix: Option<NavSatFix>,
    joints: Option<JointState>,
}

/// Found and expected.
pub(super) type Refusal = (String, String);

/// What becomes of a part.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Outcome {
    /// The numbers of a row.
    Row(Vec<f64>),
    /// A pose, to be made an increment once all are there.
    Pose(Pose2),
    /// Speeds of wheels, to be made angles once all are there.
    Speeds([f64; 2]),
    /// A sighting.
    Seen(Reading),
    /// A receiver without a fix.
    NoFix,
}

type Decode = fn(&[u8]) -> Result<Vec<Part>, CdrError>;

/// A type of message and the channels that can be made of it.
pub(super) struct Kind {
    pub(super) name: &'static str,
    pub(super) channels: &'static [&'static str],
    /// Whether it knows when it was measured.
    pub(super) stamped: bool,
    /// Whether a message holds parts of several frames.
    pub(super) many: bool,
    pub(super) decode: Decode,
}

const OF_POSES: &[&str] = &["increment", "truth", "gps", "heading", "relative"];
const OF_TWISTS: &[&str] = &["velocity", "command"];

/// All types that are read.
pub(super) const KINDS: [Kind; 11] = [
    Kind {
        name: Odometry::NAME,
        channels: &["velocity", "increment", "truth", "gps", "heading", "command"],
        stamped: true,
        many: false,
        decode: |data| {
            let Odometry { header, child_frame_id, pose, twist } = from_cdr(data)?;
            let child = Some(child_frame_id);
            let (pose, twist) = (Some(pose.pose), Some(twist.twist));
            Ok(vec![Part { child, pose, twist, ..stamped(header) }])
        },
    },
    Kind {
        name: PoseStamped::NAME,
        channels: OF_POSES,
        stamped: true,
        many: false,
        decode: |data| {
            let PoseStamped { header, pose } = from_cdr(data)?;
            Ok(vec![Part { pose: Some(pose), ..stamped(header) }])
        },
    },
    Kind {
        name: PoseWithCovarianceStamped::NAME,
        channels: OF_POSES,
        stamped: true,
        many: false,
        decode: |data| {
            let PoseWithCovarianceStamped { header, pose } = from_cdr(data)?;
            Ok(vec![Part { pose: Some(pose.pose), ..stamped(header) }])
        },
    },
    Kind {
        name: TransformStamped::NAME,
        channels: OF_POSES,
        stamped: true,
        many: false,
        decode: |data| Ok(vec![transform(from_cdr(data)?)]),
    },
    Kind {
        name: TFMessage::NAME,
        channels: OF_POSES,
        stamped: true,
        many: true,
        decode: |data| Ok(from_cdr::<TFMessage>(data)?.transforms.into_iter().map(transform).collect()),
    },
    Kind {
        name: Twist::NAME,
        channels: OF_TWISTS,
        stamped: false,
        many: false,
        decode: |data| Ok(vec![Part { twist: Some(from_cdr(data)?), ..Part::default() }]),
    },
    Kind {
        name: TwistStamped::NAME,
        channels: OF_TWISTS,
        stamped: true,
        many: false,
        decode: |data| {
            let TwistStamped { header, twist } = from_cdr(data)?;
            Ok(vec![Part { twist: Some(twist), ..stamped(header) }])
        },
    },
    Kind {
        name: TwistWithCovarianceStamped::NAME,
        channels: OF_TWISTS,
        stamped: true,
        many: false,
        decode: |data| {
            let TwistWithCovarianceStamped { header, twist } = from_cdr(data)?;
            Ok(vec![Part { twist: Some(twist.twist), ..stamped(header) }])
        },
    },
    Kind {
        name: Imu::NAME,
        channels: &["gyro", "heading"],
        stamped: true,
        many: false,
        decode: |data| {
            let imu: Imu = from_cdr(data)?;
            Ok(vec![Part { imu: Some(imu.clone()), ..stamped(imu.header) }])
        },
    },
    Kind {
        name: NavSatFix::NAME,
        channels: &["gps"],
        stamped: true,
        many: false,
        decode: |data| {
            let fix: NavSatFix = from_cdr(data)?;
            Ok(vec![Part { fix: Some(fix.clone()), ..stamped(fix.header) }])
        },
    },
    Kind {
        name: JointState::NAME,
        channels: &["wheel_odometry", "steer"],
        stamped: true,
        many: false,
        decode: |data| {
            let joints: JointState = from_cdr(data)?;
            Ok(vec![Part { joints: Some(joints.clone()), ..stamped(joints.header) }])
        },
    },
];

fn stamped(header: Header) -> Part {
    Part { stamp: Some(header.stamp), frame: Some(header.frame_id), ..Part::default() }
}

fn transform(of: TransformStamped) -> Part {
    let TransformStamped { header, child_frame_id, transform } = of;
    let at = transform.translation;
    let pose = Pose { position: Point { x: at.x, y: at.y, z: at.z }, orientation: transform.rotation };
    Part { child: Some(child_frame_id), pose: Some(pose), ..stamped(header) }
}

/// Whether a part is of the frames that were asked for.
///
/// # Errors
/// It is not, and a message holds no other.
pub(super) fn is_meant(topic: &Topic, kind: &Kind, part: &Part) -> Result<bool, Refusal> {
    let pairs = [("frame", &topic.frame, &part.frame), ("child_frame", &topic.child_frame, &part.child)];
    for (key, asked, found) in pairs {
        let Some(asked) = asked else { continue };
        // tf2 took names with a slash in front in its time; they are the same frames.
        let found = found.as_deref().unwrap_or_default();
        if found.trim_start_matches('/') == asked.trim_start_matches('/') {
            continue;
        }
        if kind.many {
            return Ok(false);
        }
        return Err((format!("the frame `{found}`"), format!("`{asked}`, as the key `{key}` says")));
    }
    Ok(true)
}

/// What `part` says to the channel of `topic`. The first fix becomes the origin of `plane` where none is stated.
pub(super) fn outcome(
    topic: &Topic,
    part: &Part,
    plane: &mut Option<(TangentPlane, Origin)>,
) -> Result<Outcome, Refusal> {
    let missing = || (topic.name.clone(), format!("what channel {} is made of", topic.channel.name));
    let pose = || planar(part.pose.as_ref().ok_or_else(missing)?, topic.max_tilt_rad);
    Ok(match topic.channel.name {
        "velocity" | "command" => {
            let twist = part.twist.ok_or_else(missing)?;
            Outcome::Row(vec![twist.linear.x, twist.angular.z])
        }
        "truth" => {
            let pose = pose()?;
            Outcome::Row(vec![pose.x_m(), pose.y_m(), pose.yaw_rad()])
        }
        "increment" => Outcome::Pose(pose()?),
        "relative" => seen(topic, pose()?)?,
        "gps" => match (&part.fix, part.pose) {
            (Some(fix), _) => return located(fix, plane),
            (None, pose) => {
                let at = pose.ok_or_else(missing)?.position;
                Outcome::Row(vec![at.x, at.y])
            }
        },
        "heading" => match &part.imu {
            Some(imu) if imu.orientation_covariance[0].to_bits() == UNKNOWN.to_bits() => {
                return Err((
                    "an orientation_covariance that begins with -1: the orientation was not measured"
                        .to_owned(),
                    "an orientation; leave out the channel `heading`".to_owned(),
                ));
            }
            Some(imu) => Outcome::Row(vec![yaw(&imu.orientation, topic.max_tilt_rad)?]),
            None => Outcome::Row(vec![pose()?.yaw_rad()]),
        },
        "gyro" => {
            let imu = part.imu.as_ref().ok_or_else(missing)?;
            if imu.angular_velocity_covariance[0].to_bits() == UNKNOWN.to_bits() {
                return Err((
                    "an angular_velocity_covariance that begins with -1: nothing was measured".to_owned(),
                    "an angular velocity; leave out the channel `gyro`".to_owned(),
                ));
            }
            Outcome::Row(vec![imu.angular_velocity.z])
        }
        "wheel_odometry" => {
            let joints = part.joints.as_ref().ok_or_else(missing)?;
            let sides = [mean(joints, &topic.left, topic.from)?, mean(joints, &topic.right, topic.from)?];
            match topic.from {
                JointValue::Position => Outcome::Row(sides.to_vec()),
                JointValue::Velocity => Outcome::Speeds(sides),
            }
        }
        "steer" => {
            let joints = part.joints.as_ref().ok_or_else(missing)?;
            Outcome::Row(vec![mean(joints, &topic.joints, JointValue::Position)?])
        }
        _ => return Err(missing()),
    })
}

fn planar(pose: &Pose, max_tilt_rad: f64) -> Result<Pose2, Refusal> {
    let Point { x, y, .. } = pose.position;
    if !(x.is_finite() && y.is_finite()) {
        return Err((format!("the position ({x}, {y})"), "finite numbers".to_owned()));
    }
    Ok(Pose2::new(x, y, yaw(&pose.orientation, max_tilt_rad)?))
}

fn seen(topic: &Topic, pose: Pose2) -> Result<Outcome, Refusal> {
    let target = topic.target.ok_or_else(|| (String::new(), "the key `target`".to_owned()))?;
    let relative = match topic.relative {
        RelativeAs::Pose => Relative::Pose(pose),
        RelativeAs::Position => Relative::Position { x_m: pose.x_m(), y_m: pose.y_m() },
    };
    Ok(Outcome::Seen(Reading::Sighting { target, relative }))
}

fn located(fix: &NavSatFix, plane: &mut Option<(TangentPlane, Origin)>) -> Result<Outcome, Refusal> {
    if fix.status.status < NavSatStatus::STATUS_FIX {
        return Ok(Outcome::NoFix);
    }
    let (latitude_deg, longitude_deg) = (fix.latitude, fix.longitude);
    if !(latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 360.0) {
        return Err((
            format!("latitude {latitude_deg} and longitude {longitude_deg}"),
            "degrees on the ellipsoid, as the status says that there is a fix".to_owned(),
        ));
    }
    let (plane, origin) = *plane.get_or_insert_with(|| {
        let altitude_m = if fix.altitude.is_finite() { fix.altitude } else { 0.0 };
        let origin = Origin { latitude_deg, longitude_deg, altitude_m };
        (TangentPlane::at(origin), origin)
    });
    // A receiver that does not tell its height is taken to be at that of the origin.
    let altitude_m = if fix.altitude.is_finite() { fix.altitude } else { origin.altitude_m };
    Ok(Outcome::Row(plane.place(latitude_deg, longitude_deg, altitude_m).to_vec()))
}

/// The mean over joints `names`, for vehicles with several wheels on a side.
fn mean(joints: &JointState, names: &[String], from: JointValue) -> Result<f64, Refusal> {
    let (values, what) = match from {
        JointValue::Position => (&joints.position, "position"),
        JointValue::Velocity => (&joints.velocity, "velocity"),
    };
    let mut sum = 0.0;
    for name in names {
        let Some(index) = joints.name.iter().position(|known| known == name) else {
            let known = joints.name.join(", ");
            return Err((format!("the joints {known}"), format!("`{name}` among them, as the mapping says")));
        };
        let Some(value) = values.get(index).filter(|value| value.is_finite()) else {
            let other = if from == JointValue::Position { "velocity" } else { "position" };
            return Err((
                format!("no {what} of `{name}`"),
                format!("one for every joint; where there is only a {other}, write from = \"{other}\""),
            ));
        };
        sum += value;
    }
    Ok(sum / names.len() as f64)
}
