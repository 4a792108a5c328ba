//! What the approximate strategies say to one another, in bytes (`docs/strategies.md` states how many).

use pleiad_estimation::fact::Noise;
use pleiad_estimation::geometry::{Matrix3, Vector3};
use pleiad_estimation::sample::Relative;
use pleiad_estimation::strategy::{
    Answer, Change, Gain, MeetingId, Message as Said, Question, RowAnswer, Sighting, TeamUpdate, Verdict,
};
use pleiad_estimation::{RobotId, Timestamp};
use serde::{Deserialize, Serialize};

use crate::codec::{self, Reader};
use crate::error::ProtocolError;
use crate::limits;
use crate::wire::check::{self, WirePose, WireSymmetric};
use crate::wire::sample::WireRelative;

/// A full 3x3 matrix on the wire, by rows.
type WireMatrix = [f64; 9];

#[derive(Clone, Copy, Serialize, Deserialize)]
struct WireMeeting {
    observer: u32,
    number: u64,
}

/// Everything but the rows and gains, which follow as lists.
#[derive(Serialize, Deserialize)]
enum WireSaid {
    Sighting {
        id: WireMeeting,
        time_ns: i64,
        relative: WireRelative,
        noise: (u8, [f64; 6]),
        pose: WirePose,
        correlated: WireSymmetric,
        independent: Option<WireSymmetric>,
    },
    Question {
        id: WireMeeting,
        time_ns: i64,
    },
    Answer {
        id: WireMeeting,
        pose: WirePose,
        covariance: WireSymmetric,
        factor: Option<(WireMeeting, WireMatrix)>,
    },
    Verdict {
        id: WireMeeting,
        change: Option<([f64; 3], WireSymmetric, bool)>,
    },
    RowAnswer {
        id: WireMeeting,
        pose: WirePose,
        covariance: WireSymmetric,
        motion: WireMatrix,
    },
    TeamUpdate {
        id: WireMeeting,
        dimension: u8,
        innovation: [f64; 3],
        innovation_covariance: WireSymmetric,
    },
}

/// One item of a row, or one gain.
#[derive(Serialize, Deserialize)]
struct WireItem {
    robot: u32,
    matrix: WireMatrix,
}

impl From<MeetingId> for WireMeeting {
    fn from(id: MeetingId) -> Self {
        Self { observer: id.observer.0, number: id.number }
    }
}

impl From<WireMeeting> for MeetingId {
    fn from(wire: WireMeeting) -> Self {
        Self { observer: RobotId(wire.observer), number: wire.number }
    }
}

fn wire_matrix(matrix: &Matrix3) -> WireMatrix {
    std::array::from_fn(|index| matrix[(index / 3, index % 3)])
}

fn matrix(field: &str, found: WireMatrix) -> Result<Matrix3, ProtocolError> {
    found.iter().try_for_each(|entry| check::number(field, *entry).map(drop))?;
    Ok(Matrix3::from_row_slice(&found))
}

fn vector(field: &str, found: [f64; 3]) -> Result<Vector3, ProtocolError> {
    found.iter().try_for_each(|entry| check::number(field, *entry).map(drop))?;
    Ok(Vector3::from(found))
}

fn item(robot: RobotId, matrix: &Matrix3) -> WireItem {
    WireItem { robot: robot.0, matrix: wire_matrix(matrix) }
}

/// A row's item before it is given its meaning.
struct Item(RobotId, Matrix3);

impl TryFrom<WireItem> for Item {
    type Error = ProtocolError;

    fn try_from(wire: WireItem) -> Result<Self, ProtocolError> {
        Ok(Self(RobotId(wire.robot), matrix("matrix", wire.matrix)?))
    }
}

/// How many numbers a relative measurement has.
fn dimension(relative: &Relative) -> (u8, &'static str) {
    match relative {
        Relative::Range { .. } => (1, "1 for a range"),
        Relative::Bearing { .. } => (1, "1 for a bearing"),
        Relative::RangeBearing { .. } => (2, "2 for range and bearing"),
        Relative::Position { .. } => (2, "2 for a relative position"),
        Relative::Pose(_) => (3, "3 for a relative pose"),
    }
}

fn noise_of(relative: &Relative, (found, lower): (u8, [f64; 6])) -> Result<Noise, ProtocolError> {
    let (fitting, expected) = dimension(relative);
    if found != fitting {
        return Err(ProtocolError::Dimension { field: "noise".into(), found, expected });
    }
    check::noise("noise", found, lower)
}

/// Appends what a strategy says.
pub fn put(bytes: &mut Vec<u8>, said: &Said) {
    let mut items = Vec::new();
    let wire = match said {
        Said::Sighting(sighting) => WireSaid::Sighting {
            id: sighting.id.into(),
            time_ns: sighting.time.0,
            relative: (&sighting.relative).into(),
            noise: (sighting.noise.dimension, sighting.noise.lower),
            pose: check::wire_pose(&sighting.pose),
            correlated: sighting.correlated.0,
            // Bits decide, so that every covariance comes back as it was.
            independent: (sighting.independent.0.iter().any(|entry| entry.to_bits() != 0))
                .then_some(sighting.independent.0),
        },
        Said::Question(question) => WireSaid::Question { id: question.id.into(), time_ns: question.time.0 },
        Said::Answer(answer) => WireSaid::Answer {
            id: answer.id.into(),
            pose: check::wire_pose(&answer.pose),
            covariance: answer.covariance.0,
            factor: answer.factor.map(|(version, factor)| (version.into(), wire_matrix(&factor))),
        },
        Said::Verdict(verdict) => WireSaid::Verdict {
            id: verdict.id.into(),
            change: verdict
                .change
                .map(|change| (change.correction.into(), change.covariance.0, change.agreed)),
        },
        Said::RowAnswer(answer) => {
            items.extend(answer.row.iter().map(|(robot, base)| item(*robot, base)));
            WireSaid::RowAnswer {
                id: answer.id.into(),
                pose: check::wire_pose(&answer.pose),
                covariance: answer.covariance.0,
                motion: wire_matrix(&answer.motion),
            }
        }
        Said::TeamUpdate(update) => {
            items.extend(update.gains.iter().map(|gain| item(gain.robot, &gain.without_motion)));
            WireSaid::TeamUpdate {
                id: update.id.into(),
                dimension: update.dimension,
                innovation: update.innovation.into(),
                innovation_covariance: update.innovation_covariance.0,
            }
        }
    };
    codec::put(bytes, &wire);
    if matches!(said, Said::RowAnswer(_) | Said::TeamUpdate(_)) {
        codec::put_list(bytes, items.into_iter());
    }
}

/// What a strategy says next, checked.
pub fn take(reader: &mut Reader<'_>) -> Result<Said, ProtocolError> {
    Ok(match reader.take::<WireSaid>("strategy message")? {
        WireSaid::Sighting { id, time_ns, relative, noise, pose, correlated, independent } => {
            let relative = relative.try_into()?;
            Said::Sighting(Sighting {
                id: id.into(),
                time: Timestamp(time_ns),
                relative,
                noise: noise_of(&relative, noise)?,
                pose: check::pose("pose", pose)?,
                correlated: check::covariance("correlated", correlated)?,
                independent: check::covariance("independent", independent.unwrap_or_default())?,
            })
        }
        WireSaid::Question { id, time_ns } => {
            Said::Question(Question { id: id.into(), time: Timestamp(time_ns) })
        }
        WireSaid::Answer { id, pose, covariance, factor } => Said::Answer(Answer {
            id: id.into(),
            pose: check::pose("pose", pose)?,
            covariance: check::covariance("covariance", covariance)?,
            factor: match factor {
                Some((version, found)) => Some((version.into(), matrix("factor", found)?)),
                None => None,
            },
        }),
        WireSaid::Verdict { id, change } => Said::Verdict(Verdict {
            id: id.into(),
            change: match change {
                Some((correction, covariance, agreed)) => Some(Change {
                    correction: vector("correction", correction)?,
                    covariance: check::covariance("covariance", covariance)?,
                    agreed,
                }),
                None => None,
            },
        }),
        WireSaid::RowAnswer { id, pose, covariance, motion } => Said::RowAnswer(RowAnswer {
            id: id.into(),
            pose: check::pose("pose", pose)?,
            covariance: check::covariance("covariance", covariance)?,
            motion: matrix("motion", motion)?,
            row: items(reader, "row")?.into_iter().map(|Item(robot, base)| (robot, base)).collect(),
        }),
        WireSaid::TeamUpdate { id, dimension, innovation, innovation_covariance } => {
            if !(1..=3).contains(&dimension) {
                let expected = "1, 2 or 3";
                return Err(ProtocolError::Dimension {
                    field: "dimension".into(),
                    found: dimension,
                    expected,
                });
            }
            let gain = |Item(robot, without_motion): Item| Gain { robot, without_motion };
            Said::TeamUpdate(TeamUpdate {
                id: id.into(),
                dimension,
                innovation: vector("innovation", innovation)?,
                innovation_covariance: check::covariance("innovation_covariance", innovation_covariance)?,
                gains: items(reader, "gains")?.into_iter().map(gain).collect(),
            })
        }
    })
}

fn items(reader: &mut Reader<'_>, list: &'static str) -> Result<Vec<Item>, ProtocolError> {
    reader.list::<WireItem, _>(list, limits::ROW)
}
