//! What the filter found out besides poses.

use pleiad_estimation::Timestamp;
use pleiad_estimation::geometry::Matrix3;
use pleiad_estimation::joint::{Block, Joint, Member, ParameterKind, Reputation};
use serde::{Deserialize, Serialize};

/// Parameters and landmarks, as the whole team knows them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Parameters of robots, in the order in which they were told to be uncertain.
    pub parameters: Vec<FoundParameter>,
    /// Landmarks whose places nobody knew, in the order of their numbers.
    pub landmarks: Vec<FoundLandmark>,
    /// Robots of which more is known than where they are: those whose noise is more than stated, or that contradicted others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub robots: Vec<FoundRobot>,
}

/// How far a robot is believed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FoundRobot {
    /// Which.
    pub robot: u32,
    /// How many times its variances are what it states.
    pub noise_level: f64,
    /// When it was last taken out of the frame that it contradicted, s; it was lost, or lied.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detached_s: Option<f64>,
    /// Since when it is not believed, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distrusted_s: Option<f64>,
    /// It is not believed only on where it is in the map: fixes and known landmarks.
    #[serde(default)]
    pub on_the_map_only: bool,
}

impl FoundRobot {
    /// What is known of a member, if there is anything.
    pub fn of(member: &Member) -> Option<Self> {
        let Member { robot, reputation, .. } = *member;
        let Reputation { noise_level, detached, distrust, .. } = reputation;
        // Doubts that led to nothing say nothing.
        let plain = reputation == Reputation { doubt: reputation.doubt, ..Reputation::default() };
        (!plain).then(|| Self {
            robot: robot.0,
            noise_level,
            detached_s: detached.map(Timestamp::seconds),
            distrusted_s: distrust.map(|distrust| distrust.since.seconds()),
            on_the_map_only: distrust.is_some_and(|distrust| !distrust.whole),
        })
    }
}

/// One parameter of a robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FoundParameter {
    /// Whose.
    pub robot: u32,
    /// Which: the key of `[calibration]` without `sigma_`, and the axis of a mount.
    pub name: String,
    /// The estimate.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// A landmark of the team's map.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FoundLandmark {
    /// Which.
    pub id: u32,
    /// Its place in the map, m.
    pub x_m: f64,
    /// Its place in the map, m.
    pub y_m: f64,
    /// Standard deviation, m.
    pub sigma_x_m: f64,
    /// Standard deviation, m.
    pub sigma_y_m: f64,
}

impl Found {
    /// What a joint holds besides robots.
    pub fn of(joint: &Joint) -> Self {
        let mut found = Self::default();
        for (index, block) in joint.blocks().iter().enumerate() {
            let covariance = joint.covariance().block(index, index);
            match block {
                Block::Parameters(of) => {
                    let names: [(&str, f64); 3] = match of.kind {
                        ParameterKind::Motion => {
                            [("forward_scale", 1.0), ("yaw_scale", 1.0), ("yaw_rate_bias_rad_s", 1.0)]
                        }
                        ParameterKind::Mount => {
                            [("mount_x_m", 1.0), ("mount_y_m", 1.0), ("mount_yaw_rad", 1.0)]
                        }
                        ParameterKind::Clock => {
                            [("clock_offset_s", 1.0), ("clock_drift_ppm", 1e6), ("", 0.0)]
                        }
                    };
                    for (axis, (name, unit)) in names.into_iter().enumerate() {
                        let variance = covariance[(axis, axis)];
                        // What is sure is not estimated.
                        if variance > 0.0 && unit > 0.0 {
                            found.parameters.push(FoundParameter {
                                robot: of.robot.0,
                                name: name.to_owned(),
                                value: unit * of.value[axis],
                                sigma: unit * variance.sqrt(),
                            });
                        }
                    }
                }
                Block::Landmark(mapped) => {
                    let place = mapped.pose.position();
                    // A point moved by exp(xi) goes by [I, J p] xi.
                    let by = Matrix3::new(1.0, 0.0, -place.y, 0.0, 1.0, place.x, 0.0, 0.0, 0.0);
                    let spread = by * covariance * by.transpose();
                    found.landmarks.push(FoundLandmark {
                        id: mapped.landmark.0,
                        x_m: place.x,
                        y_m: place.y,
                        sigma_x_m: spread[(0, 0)].max(0.0).sqrt(),
                        sigma_y_m: spread[(1, 1)].max(0.0).sqrt(),
                    });
                }
                Block::Robot(member) => found.robots.extend(FoundRobot::of(member)),
                Block::Anchor(_) | Block::Free => {}
            }
        }
        found.parameters.sort_by_key(|parameter| parameter.robot);
        found.landmarks.sort_by_key(|landmark| landmark.id);
        found.robots.sort_by_key(|robot| robot.robot);
        found
    }
}
