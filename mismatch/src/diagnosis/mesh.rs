//! How the residuals of a team hang together where nobody knows where a robot was but by what the team measured.
//!
//! The reference poses are then those of a filter, and are wrong. Robot `i` was at `exp(xi_i) x_i`, with `xi_i` in the
//! map frame (right-invariant, docs/notation.md): a residual of its motion over a window moves `xi_i`, and a residual of a
//! reading is what `xi` makes of it, plus noise. So a Kalman filter of `xi`, linear and with everything about it known
//! but the noise, turns residuals into innovations, and derivatives of residuals into derivatives of innovations: the
//! likelihood of the readings with the unknown trajectories integrated out (`schweppe1965`).

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::Target;
use pleiad_physics::{Pose, Scalar};

use crate::channel::Channel;
use crate::diagnosis::unit::{Stretch, Unit};
use crate::sensors::At;

/// How unsure the reference is of where a robot began, metres and radians: much more than it is.
const PRIOR: [f64; 2] = [0.5, 0.3];
/// What may have happened while no odometry was recorded, metres and radians.
pub(crate) const LOST: [f64; 2] = [10.0, 10.0];

/// Three numbers per robot: `rho_x`, `rho_y` in metres, `theta` in radians.
pub(crate) const STATES: usize = 3;

/// Over a window a robot moved otherwise than predicted.
#[derive(Clone, Debug)]
pub(crate) struct Move {
    /// The first state of the robot.
    pub(crate) at: usize,
    /// The first of the three elements: forward, left, yaw in the mid-window frame.
    pub(crate) element: usize,
    /// What the three make of the states, row by row.
    pub(crate) into: [[f64; STATES]; STATES],
    /// The reference pose at the beginning, and that at the end seen from it.
    pub(crate) start: Pose<f64>,
    pub(crate) measured: Pose<f64>,
    pub(crate) span_s: f64,
    /// The first of the three scales: one sigma per root of a second.
    pub(crate) scale: usize,
    /// The stamp of the reference pose at the end, seconds.
    pub(crate) until_s: f64,
}

/// What a reading is of, where the references have it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Of {
    /// A place along a direction.
    Place([f64; 2], [f64; 2]),
    Heading,
    /// The range of a place from a pose.
    Range(Pose<f64>, [f64; 2]),
    /// The bearing of a place from a pose.
    Bearing(Pose<f64>, [f64; 2]),
}

/// A reading: its residual is `own . xi_own + other . xi_other` plus noise.
#[derive(Clone, Debug)]
pub(crate) struct Read {
    pub(crate) element: usize,
    pub(crate) of: Of,
    /// Whether a robot is seen.
    pub(crate) is_robot: bool,
    pub(crate) scale: usize,
    pub(crate) own: (usize, [f64; STATES]),
    /// The robot that is seen; weights of zero if none is.
    pub(crate) other: (usize, [f64; STATES]),
}

#[derive(Clone, Debug)]
pub(crate) enum Event {
    /// Nothing of a robot's motion is known any more: its first state.
    Lost(usize),
    Move(Move),
    Read(Read),
}

/// Everything in the order of time.
#[derive(Clone, Debug)]
pub(crate) struct Mesh {
    /// The number of states.
    pub(crate) size: usize,
    /// Covariance of each robot's first states.
    pub(crate) prior: Vec<[[f64; STATES]; STATES]>,
    pub(crate) events: Vec<Event>,
    pub(crate) reads: usize,
}

impl Mesh {
    /// Of a unit whose evidence has references for truth. `None` if a residual is missing that it needs: a prediction
    /// that is no finite number.
    pub(crate) fn new(unit: &Unit<'_>) -> Option<Self> {
        let mut timed: Vec<(f64, u8, Event)> = Vec::new();
        let mut prior = Vec::with_capacity(unit.members.len());
        for (member, own) in unit.members.iter().enumerate() {
            let track = unit.evidence.tracks.get(&own.robot)?;
            let start = track.truth.first().map_or_else(Pose::identity, |(_, pose)| *pose);
            prior.push(about(&start, PRIOR));
            moves(unit, member, &mut timed)?;
            readings(unit, member, &mut timed)?;
        }
        timed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let reads = timed.iter().filter(|(_, _, event)| matches!(event, Event::Read(_))).count();
        let events = timed.into_iter().map(|(_, _, event)| event).collect();
        Some(Self { size: STATES * unit.members.len(), prior, events, reads })
    }

    /// What is added to the covariance of a robot that was lost.
    pub(crate) fn lost() -> [f64; STATES] {
        [LOST[0] * LOST[0], LOST[0] * LOST[0], LOST[1] * LOST[1]]
    }
}

impl Move {
    /// The correction of the robot after the window, where the model is off by this residual.
    pub(crate) fn corrected(&self, before: &Pose<f64>, [forward, left, yaw]: [f64; STATES]) -> Pose<f64> {
        let half = Pose::new(0.0, 0.0, 0.5 * (self.measured.yaw_rad - yaw));
        let [x, y] = half.rotate([forward, left]);
        let Pose { x_m, y_m, yaw_rad } = self.measured;
        let predicted = Pose::new(x_m - x, y_m - y, yaw_rad - yaw);
        let end = self.start.compose(&self.measured);
        before.compose(&self.start).compose(&predicted).compose(&end.between(&Pose::identity()))
    }
}

impl Read {
    /// By how much a reading changes if the references are corrected.
    pub(crate) fn change(&self, own: &Pose<f64>, other: &Pose<f64>) -> f64 {
        let place = |pose: &Pose<f64>, [x, y]: [f64; 2]| pose.compose(&Pose::new(x, y, 0.0)).position();
        let seen = |pose: &Pose<f64>, target: [f64; 2]| {
            let [x, y] =
                own.compose(pose).point_seen(if self.is_robot { place(other, target) } else { target });
            (x, y)
        };
        match &self.of {
            Of::Place(direction, at) => {
                let moved = place(own, *at);
                direction[0] * (moved[0] - at[0]) + direction[1] * (moved[1] - at[1])
            }
            Of::Heading => own.yaw_rad,
            Of::Range(pose, target) => {
                let ((x, y), [x_then, y_then]) = (seen(pose, *target), pose.point_seen(*target));
                libm::hypot(x, y) - libm::hypot(x_then, y_then)
            }
            Of::Bearing(pose, target) => {
                let ((x, y), [x_then, y_then]) = (seen(pose, *target), pose.point_seen(*target));
                (libm::atan2(y, x) - libm::atan2(y_then, x_then)).wrapped()
            }
        }
    }
}

/// Whether residuals of a channel are moves or readings of the mesh; those of the others stand alone.
pub(crate) fn is_meshed(channel: Channel) -> bool {
    !matches!(channel, Channel::Actuator | Channel::Gyro)
}

/// Whether residuals of a channel are how a robot moved.
pub(crate) fn is_move(channel: Channel) -> bool {
    matches!(channel, Channel::Body | Channel::CommandedBody)
}

/// The covariance of the states of a robot at a pose, whose position and yaw are as unsure as this.
pub(crate) fn about(pose: &Pose<f64>, [metres, radians]: [f64; 2]) -> [[f64; STATES]; STATES] {
    // rho is the error of the position less what theta makes of it: a = (p_y, -p_x).
    let a = [pose.y_m, -pose.x_m, 1.0];
    let mut covariance = [[0.0; STATES]; STATES];
    for (row, line) in covariance.iter_mut().enumerate() {
        for (column, value) in line.iter_mut().enumerate() {
            *value = a[row] * a[column] * radians * radians;
        }
        if row < 2 {
            line[row] += metres * metres;
        }
    }
    covariance
}

fn stretch_of<'u>(unit: &'u Unit<'_>, member: usize, channel: Channel) -> Option<(&'u Stretch, usize)> {
    let stretch = unit.stretches.iter().find(|own| own.member == member && own.channel == channel)?;
    let scale = unit.scale_of.get(stretch.offset).copied().unwrap_or(0);
    Some((stretch, scale))
}

fn moves(unit: &Unit<'_>, member: usize, timed: &mut Vec<(f64, u8, Event)>) -> Option<()> {
    let (track, plans) = unit.evidence.prepared(unit.members[member].robot)?;
    let of_body = plans.body.items.iter().map(|own| (own.stamps_s(), own.start, own.measured));
    let commanded = plans.commanded.items.iter();
    let of_commands =
        commanded.map(|own| ([own.window.from_s, own.window.to_s], own.window.motion.pose, own.measured));
    let windows: Vec<([f64; 2], Pose<f64>, Pose<f64>)> =
        if track.encoders.is_empty() { of_commands.collect() } else { of_body.collect() };
    let channel = if track.encoders.is_empty() { Channel::CommandedBody } else { Channel::Body };
    let (stretch, scale) = stretch_of(unit, member, channel)?;
    if stretch.rows != windows.len() {
        return None;
    }
    let mut ended_s = None;
    for (row, ([from_s, to_s], start, measured)) in windows.into_iter().enumerate() {
        if ended_s.is_some_and(|ended_s| from_s > ended_s) {
            timed.push((from_s, 0, Event::Lost(STATES * member)));
        }
        ended_s = Some(to_s);
        // Recorded headings are wrapped, and so may not be the turn between two of them.
        let measured = Pose { yaw_rad: measured.yaw_rad.wrapped(), ..measured };
        let end = start.compose(&measured);
        let middle = start.yaw_rad + 0.5 * measured.yaw_rad;
        let (sin, cos) = (libm::sin(middle), libm::cos(middle));
        let into = [[-cos, sin, -end.y_m], [-sin, -cos, end.x_m], [0.0, 0.0, -1.0]];
        timed.push((
            to_s,
            1,
            Event::Move(Move {
                at: STATES * member,
                element: stretch.offset + STATES * row,
                into,
                start,
                measured,
                span_s: to_s - from_s,
                scale,
                until_s: to_s,
            }),
        ));
    }
    Some(())
}

fn readings(unit: &Unit<'_>, member: usize, timed: &mut Vec<(f64, u8, Event)>) -> Option<()> {
    let (_, plans) = unit.evidence.prepared(unit.members[member].robot)?;
    let own_at = STATES * member;
    let mut push = |stamp_s: f64,
                    (element, scale): (usize, usize),
                    of: Of,
                    own: [f64; STATES],
                    other: Option<(usize, [f64; STATES])>| {
        let is_robot = other.is_some();
        let other = other.unwrap_or((own_at, [0.0; STATES]));
        let read = Read { element, of, is_robot, scale, own: (own_at, own), other };
        timed.push((stamp_s, 2, Event::Read(read)));
    };
    for channel in [Channel::Gps, Channel::Heading] {
        let (stretch, scale) = stretch_of(unit, member, channel)?;
        let ats: Vec<&At> = match channel {
            Channel::Gps => plans.gps.items.iter().map(|own| &own.at).collect(),
            _ => plans.heading.items.iter().map(|own| &own.at).collect(),
        };
        if stretch.rows != ats.len() {
            return None;
        }
        for (row, at) in ats.into_iter().enumerate() {
            let first = stretch.offset + row * stretch.components;
            if channel == Channel::Heading {
                push(at.stamp_s(), (first, scale), Of::Heading, [0.0, 0.0, 1.0], None);
                continue;
            }
            let (sin, cos) = (libm::sin(at.pose.yaw_rad), libm::cos(at.pose.yaw_rad));
            for (component, direction) in [[cos, sin], [-sin, cos]].into_iter().enumerate() {
                let of = Of::Place(direction, at.pose.position());
                let own = carried(direction, 0.0, &at.pose);
                push(at.stamp_s(), (first + component, scale + component), of, own, None);
            }
        }
    }
    for pair in Channel::SIGHTINGS {
        for (is_bearing, channel) in pair.into_iter().enumerate() {
            let (stretch, scale) = stretch_of(unit, member, channel)?;
            let items = &plans.of_sightings(channel).items;
            if stretch.rows != items.len() {
                return None;
            }
            for (row, own) in items.iter().enumerate() {
                let seen = own.seen.position_m;
                let (to_target, turning) = gradient(is_bearing == 1, &own.at.pose, seen);
                let away = to_target.map(|value| -value);
                let mut stamp_s = own.at.stamp_s();
                let other = match own.target {
                    Target::Landmark(_) => None,
                    Target::Robot(robot) => {
                        let position = position(unit, robot)?;
                        let track = unit.evidence.tracks.get(&robot)?;
                        stamp_s = stamp_s.max(track.truth_near(own.at.time_s)?.0);
                        let place = Pose::new(seen[0], seen[1], 0.0);
                        Some((STATES * position, carried(to_target, 0.0, &place)))
                    }
                };
                let of = if is_bearing == 1 { Of::Bearing } else { Of::Range }(own.at.pose, seen);
                let own = carried(away, turning, &own.at.pose);
                push(stamp_s, (stretch.offset + row, scale), of, own, other);
            }
        }
    }
    Some(())
}

fn position(unit: &Unit<'_>, robot: RobotId) -> Option<usize> {
    unit.members.iter().position(|member| member.robot == robot)
}

/// How a range or a bearing changes with the place of the target, and with the yaw of the observer.
pub(crate) fn gradient(is_bearing: bool, pose: &Pose<f64>, target: [f64; 2]) -> ([f64; 2], f64) {
    let (dx, dy) = (target[0] - pose.x_m, target[1] - pose.y_m);
    let square = (dx * dx + dy * dy).max(1e-6);
    if is_bearing {
        ([-dy / square, dx / square], -1.0)
    } else {
        let range = square.sqrt();
        ([dx / range, dy / range], 0.0)
    }
}

/// What changes with a place by a direction, and with the yaw so much, changes with the states of the robot there.
pub(crate) fn carried(direction: [f64; 2], turning: f64, pose: &Pose<f64>) -> [f64; STATES] {
    [direction[0], direction[1], turning + direction[1] * pose.x_m - direction[0] * pose.y_m]
}
