//! Teams of two and three peers, message by message, against centralized filters.

use std::collections::BTreeMap;

use super::*;
use crate::fact::{Noise, Quantity};
use crate::geometry::{Matrix3, Vector3};
use crate::joint::ErrorForm;
use crate::motion::{MotionModel, MotionNoise, YawSource};
use crate::reference::{PerTickEkf, Tick, TimedMeasurement};
use crate::sample::{Reading, Relative, Target};
use crate::symmetric::Symmetric3;
use crate::{Pose2, Timestamp};

const A: RobotId = RobotId(1);
const B: RobotId = RobotId(2);
const C: RobotId = RobotId(3);
const PRIOR: [f64; 3] = [0.3, 0.2, 0.1];
const TICK_S: f64 = 0.04;

fn noise() -> MotionNoise {
    MotionNoise {
        forward_m_per_sqrt_s: 0.05,
        lateral_m_per_sqrt_s: 0.02,
        yaw_rad_per_sqrt_s: 0.03,
        ..MotionNoise::default()
    }
}

fn prior(robot: RobotId) -> Pose2 {
    let n = f64::from(robot.0);
    Pose2::new(2.0 * n, -1.0 + 0.7 * n * n, 0.6 * n)
}

fn velocity(robot: RobotId) -> (f64, f64) {
    (0.4 + 0.1 * f64::from(robot.0), 0.3 - 0.2 * f64::from(robot.0))
}

fn sigmas(relative: &Relative) -> Vec<f64> {
    match relative {
        Relative::Pose(_) => vec![0.1, 0.1, 0.05],
        Relative::Position { .. } => vec![0.1, 0.1],
        Relative::Range { .. } => vec![0.1],
        Relative::Bearing { .. } => vec![0.05],
        Relative::RangeBearing { .. } => vec![0.1, 0.05],
    }
}

fn setup(robot: RobotId) -> Setup {
    let motion = MotionModel { drive: None, noise: noise(), yaw: YawSource::Odometry, gyro_bias_rad_s: 0.0 };
    let of = |relative: Relative| Some(Noise::from_sigmas(&sigmas(&relative)));
    Setup {
        robot,
        motion,
        prior: Some((prior(robot), Noise::from_sigmas(&PRIOR))),
        noises: Noises {
            relative_pose: of(Relative::Pose(Pose2::identity())),
            relative_position: of(Relative::Position { x_m: 0.0, y_m: 0.0 }),
            range: of(Relative::Range { range_m: 1.0 }),
            bearing: of(Relative::Bearing { bearing_rad: 0.0 }),
            range_bearing: of(Relative::RangeBearing { range_m: 1.0, bearing_rad: 0.0 }),
            position: Some(Noise::from_sigmas(&[0.3, 0.3])),
            heading: Some(Noise::from_sigmas(&[0.05])),
        },
        range_bias_m: 0.0,
        landmarks: BTreeMap::new(),
        gate: [f64::INFINITY; 3],
        history_samples: 10_000,
        longest_gap_s: 2.0,
        motion_limits: [1.0, 1.0, 1.0],
    }
}

/// Peers that hear one another at once, unless a test comes between.
struct Team {
    peers: BTreeMap<RobotId, Peer>,
    ticks: u32,
    under_way: Vec<(RobotId, RobotId, Message)>,
}

impl Team {
    fn new(kind: StrategyKind, robots: &[RobotId]) -> Self {
        let peers = robots.iter().map(|robot| (*robot, Peer::new(kind, setup(*robot)).unwrap())).collect();
        let mut team = Self { peers, ticks: 0, under_way: Vec::new() };
        team.drive(1);
        team
    }

    fn now(&self) -> Timestamp {
        Timestamp::from_seconds(f64::from(self.ticks) * TICK_S)
    }

    fn handle(&mut self, robot: RobotId, event: Event<Message>) {
        for command in self.peers.get_mut(&robot).unwrap().handle(event) {
            match command {
                Command::Send { to, message } => self.under_way.push((robot, to, message)),
                Command::Broadcast(message) => {
                    let others = self.peers.keys().filter(|other| **other != robot);
                    self.under_way.extend(others.map(|other| (robot, *other, message.clone())));
                }
            }
        }
    }

    /// All odometry advances, without messages being delivered.
    fn drive(&mut self, ticks: u32) {
        for _ in 0..ticks {
            let time = self.now();
            for robot in self.peers.keys().copied().collect::<Vec<_>>() {
                let (forward_m_s, yaw_rate_rad_s) = velocity(robot);
                let reading = Reading::Velocity { forward_m_s, yaw_rate_rad_s };
                self.handle(robot, Event::Sample(Sample { time, reading }));
            }
            self.ticks += 1;
        }
    }

    /// The last odometry.
    fn last(&self) -> Timestamp {
        Timestamp::from_seconds(f64::from(self.ticks - 1) * TICK_S)
    }

    fn see(&mut self, observer: RobotId, robot: RobotId, relative: Relative) {
        let reading = Reading::Sighting { target: Target::Robot(robot), relative };
        let sample = Sample { time: self.last(), reading };
        self.handle(observer, Event::Sample(sample));
    }

    /// Delivers what is under way and what it causes, but for what `lost` says.
    fn deliver(&mut self, lost: impl Fn(&Message) -> bool) {
        while !self.under_way.is_empty() {
            let (from, to, message) = self.under_way.remove(0);
            if !lost(&message) {
                self.handle(to, Event::Received { from, message });
            }
        }
    }

    /// A meeting from beginning to end; a robot asks when its odometry next advances.
    fn meet(&mut self, observer: RobotId, robot: RobotId, relative: Relative) {
        self.see(observer, robot, relative);
        self.drive(1);
        self.deliver(|_| false);
    }

    fn views(&mut self) -> BTreeMap<RobotId, View> {
        self.peers.iter_mut().map(|(robot, peer)| (*robot, peer.view().unwrap())).collect()
    }

    fn joint(&mut self) -> JointView {
        joint_view(&self.views()).unwrap()
    }

    fn counts(&mut self, robot: RobotId) -> Counts {
        self.peers.get_mut(&robot).unwrap().counts()
    }

    /// The textbook filter that steps every tick, over the same measurements.
    fn oracle(&self, form: ErrorForm, measurements: &[TimedMeasurement]) -> PerTickEkf {
        let mut ekf = PerTickEkf::new(form, [f64::INFINITY; 3]);
        for robot in self.peers.keys() {
            let (forward, rate) = velocity(*robot);
            let tick = |k: u32| Tick {
                time: Timestamp::from_seconds(f64::from(k) * TICK_S),
                increment: Pose2::exp(Vector3::new(forward * TICK_S, 0.0, rate * TICK_S)),
                covariance: noise().covariance(&Vector3::zeros(), TICK_S).to_matrix(),
            };
            let covariance = Symmetric3(Noise::from_sigmas(&PRIOR).lower).to_matrix();
            let ticks: Vec<_> = (1..self.ticks).map(tick).collect();
            ekf.add_robot(*robot, Timestamp(0), prior(*robot), &covariance, ticks);
        }
        ekf.run(measurements);
        ekf.advance_to(self.last());
        ekf
    }
}

/// What a sensor would read that is off by a little.
fn reading(observer: &Pose2, robot: &Pose2, template: &Relative) -> Relative {
    let between = observer.between(robot);
    let p = between.position();
    let (range_m, bearing_rad) = (p.norm() + 0.05, p.y.atan2(p.x) - 0.03);
    match template {
        Relative::Pose(_) => Relative::Pose(between.compose(&Pose2::new(0.05, -0.04, 0.03))),
        Relative::Position { .. } => Relative::Position { x_m: p.x + 0.06, y_m: p.y - 0.05 },
        Relative::Range { .. } => Relative::Range { range_m },
        Relative::Bearing { .. } => Relative::Bearing { bearing_rad },
        Relative::RangeBearing { .. } => Relative::RangeBearing { range_m, bearing_rad },
    }
}

fn templates() -> [Relative; 5] {
    [
        Relative::Pose(Pose2::identity()),
        Relative::Position { x_m: 0.0, y_m: 0.0 },
        Relative::Range { range_m: 0.0 },
        Relative::Bearing { bearing_rad: 0.0 },
        Relative::RangeBearing { range_m: 0.0, bearing_rad: 0.0 },
    ]
}

fn measurement(time: Timestamp, observer: RobotId, robot: RobotId, relative: Relative) -> TimedMeasurement {
    let noise = Noise::from_sigmas(&sigmas(&relative));
    TimedMeasurement { time, observer, quantity: Quantity::Robot { robot, relative }, noise }
}

/// Runs one meeting of A and B of each kind and compares the team with the centralized filter.
fn one_observation_is_exact(kind: StrategyKind, form: ErrorForm, robots: &[RobotId]) {
    for template in templates() {
        let mut team = Team::new(kind, robots);
        team.drive(50);
        let views = team.views();
        let relative = reading(&views[&A].pose, &views[&B].pose, &template);
        let time = team.last();
        team.meet(A, B, relative);
        team.drive(25);
        let ekf = team.oracle(form, &[measurement(time, A, B, relative)]);
        let joint = team.joint();
        assert_eq!((joint.form, joint.disagreeing), (form, 0));
        for (index, (robot, pose)) in joint.robots.iter().enumerate() {
            let expected = ekf.pose(*robot).unwrap();
            let apart = expected.between(pose).log().amax();
            assert!(apart < 1e-9, "{kind} {template:?} robot {robot}: {apart}");
            for (column, (other, _)) in joint.robots.iter().enumerate() {
                let block: Matrix3 = joint.covariance.fixed_view::<3, 3>(3 * index, 3 * column).into_owned();
                let expected = ekf.covariance().block(*robot, *other).unwrap();
                let apart = (block - expected).amax();
                assert!(apart < 1e-9, "{kind} {template:?} P_{robot}{other}: {apart}");
            }
        }
    }
}

#[test]
fn after_one_observation_of_any_kind_pairwise_is_the_centralized_filter() {
    one_observation_is_exact(StrategyKind::Pairwise, ErrorForm::Invariant, &[A, B]);
    // A third robot that met nobody has nothing to lose.
    one_observation_is_exact(StrategyKind::Pairwise, ErrorForm::Invariant, &[A, B, C]);
}

/// Two robots alone have no third whose correlation could be approximated: their filter is the centralized
/// one however often they meet, but for the points of linearization.
#[test]
fn pairwise_stays_exact_for_two_robots_however_often_they_meet() {
    let mut team = Team::new(StrategyKind::Pairwise, &[A, B]);
    let mut measurements = Vec::new();
    for round in 0..20 {
        team.drive(10);
        let views = team.views();
        let (observer, robot) = if round % 2 == 0 { (A, B) } else { (B, A) };
        let relative = reading(&views[&observer].pose, &views[&robot].pose, &templates()[round % 5]);
        measurements.push(measurement(team.last(), observer, robot, relative));
        team.meet(observer, robot, relative);
    }
    let ekf = team.oracle(ErrorForm::Invariant, &measurements);
    for (robot, view) in team.views() {
        let apart = ekf.pose(robot).unwrap().between(&view.pose).log().amax();
        assert!(apart < 1e-3, "robot {robot}: {apart}");
        let expected = ekf.covariance().block(robot, robot).unwrap();
        let apart = (view.covariance - expected).amax() / expected.amax();
        assert!(apart < 1e-2, "robot {robot}: {apart}");
    }
    assert_eq!(team.counts(A).disagreed + team.counts(B).disagreed, 0);
}

#[test]
fn with_a_third_robot_pairwise_scales_its_factors_by_the_published_rule() {
    let mut team = Team::new(StrategyKind::Pairwise, &[A, B, C]);
    team.drive(20);
    let views = team.views();
    team.meet(A, B, reading(&views[&A].pose, &views[&B].pose, &templates()[4]));
    team.drive(20);
    let before = team.views();
    team.meet(A, C, reading(&before[&A].pose, &before[&C].pose, &templates()[4]));
    let after = team.views();
    // The block of A at the meeting: before, it had been driven to that very instant; after, one tick more.
    let tick = noise().covariance(&Vector3::zeros(), TICK_S);
    let grown = tick.congruence(&after[&A].pose.adjoint()).to_matrix();
    let scale = (after[&A].covariance - grown) * before[&A].covariance.cholesky().unwrap().inverse();
    let expected = scale * before[&A].row[&B].matrix;
    let apart = (after[&A].row[&B].matrix - expected).amax();
    assert!(apart < 1e-3 * expected.amax(), "{apart}");
    assert_eq!(after[&A].row[&B].version, before[&A].row[&B].version);
    assert_eq!(after[&B].row[&A], before[&B].row[&A]);
}

#[test]
fn after_a_lost_verdict_factors_are_not_multiplied_until_a_whole_meeting_agrees_again() {
    let mut team = Team::new(StrategyKind::Pairwise, &[A, B]);
    team.drive(10);
    let meet = |team: &mut Team, lossy: bool| {
        let views = team.views();
        let relative = reading(&views[&A].pose, &views[&B].pose, &templates()[0]);
        team.see(A, B, relative);
        team.drive(1);
        team.deliver(|message| lossy && matches!(message, Message::Verdict(_)));
        // Whoever waits for what was lost gives up.
        team.drive(20);
        team.deliver(|_| false);
    };
    meet(&mut team, false);
    assert_eq!(team.joint().disagreeing, 0);
    meet(&mut team, true);
    assert_eq!(team.joint().disagreeing, 1);
    let (own, other) = (team.views(), team.counts(A).disagreed);
    assert_eq!(other, 0);
    assert_ne!(own[&A].row[&B].version, own[&B].row[&A].version);
    // Nothing is gained by an update whose inflation costs more than it brings, so let them drift first.
    team.drive(2000);
    meet(&mut team, false);
    assert_eq!(team.counts(A).disagreed, 1);
    assert_eq!(team.joint().disagreeing, 0);
    assert!(team.joint().definiteness() > 0.0);
}

#[test]
fn a_verdict_on_a_block_that_has_changed_is_refused() {
    let mut team = Team::new(StrategyKind::Pairwise, &[A, B]);
    team.drive(10);
    let views = team.views();
    team.see(A, B, reading(&views[&A].pose, &views[&B].pose, &templates()[0]));
    team.drive(1);
    // Question and answer pass; the verdict is held back until B has given up waiting and used a fix.
    let mut verdicts = Vec::new();
    while !team.under_way.is_empty() {
        let (from, to, message) = team.under_way.remove(0);
        if matches!(message, Message::Verdict(_)) {
            verdicts.push((from, to, message));
        } else {
            team.handle(to, Event::Received { from, message });
        }
    }
    assert_eq!(verdicts.len(), 1);
    team.drive(20);
    let time = team.last();
    let at = team.views()[&B].pose;
    let gps = Reading::Gps { x_m: at.x_m(), y_m: at.y_m() };
    team.handle(B, Event::Sample(Sample { time, reading: gps }));
    let before = team.views()[&B].clone();
    let (from, to, message) = verdicts.remove(0);
    team.handle(to, Event::Received { from, message });
    assert_eq!(team.views()[&B], before);
    assert_eq!(team.counts(B).refused, 1);
}

#[test]
fn a_repeated_message_changes_nothing() {
    for kind in [
        StrategyKind::Pairwise,
        StrategyKind::Intersection,
        StrategyKind::SplitIntersection,
        StrategyKind::Naive,
    ] {
        let mut team = Team::new(kind, &[A, B]);
        team.drive(100);
        let views = team.views();
        team.see(A, B, reading(&views[&A].pose, &views[&B].pose, &templates()[4]));
        team.drive(1);
        while !team.under_way.is_empty() {
            let (from, to, message) = team.under_way.remove(0);
            team.handle(to, Event::Received { from, message: message.clone() });
            let once = team.views();
            let sent = team.under_way.len();
            team.handle(to, Event::Received { from, message: message.clone() });
            assert_eq!(team.views(), once, "{kind}: {message:?}");
            assert_eq!(team.under_way.len(), sent, "{kind}: {message:?}");
        }
    }
}

#[test]
fn after_one_observation_factored_is_the_centralized_additive_filter() {
    one_observation_is_exact(StrategyKind::Factored, ErrorForm::Additive, &[A, B, C]);
}

#[test]
fn a_lost_broadcast_leaves_factored_wrong_without_anyone_noticing() {
    let mut team = Team::new(StrategyKind::Factored, &[A, B, C]);
    let meet = |team: &mut Team, a: RobotId, b: RobotId, lost: bool| {
        team.drive(20);
        let views = team.views();
        team.see(a, b, reading(&views[&a].pose, &views[&b].pose, &templates()[4]));
        team.deliver(|message| lost && matches!(message, Message::TeamUpdate(_)));
        measurement(team.last(), a, b, reading(&views[&a].pose, &views[&b].pose, &templates()[4]))
    };
    let measurements = [
        meet(&mut team, A, B, false),
        meet(&mut team, B, C, false),
        meet(&mut team, A, B, true),
        meet(&mut team, C, A, false),
    ];
    let ekf = team.oracle(ErrorForm::Additive, &measurements);
    let far = team.views().iter().any(|(robot, view)| {
        (view.covariance - ekf.covariance().block(*robot, *robot).unwrap()).amax() > 1e-4
    });
    assert!(far);
    assert_eq!([A, B, C].map(|robot| team.counts(robot).refused), [0; 3]);
}

/// Two robots that only ever see one another cannot come to know where they are.
#[test]
fn seeing_one_another_again_and_again_makes_naive_sure_of_itself_and_intersection_not() {
    let sigma = |kind: StrategyKind| {
        let mut team = Team::new(kind, &[A, B]);
        for _ in 0..100 {
            let views = team.views();
            team.meet(A, B, reading(&views[&A].pose, &views[&B].pose, &templates()[0]));
            team.drive(1);
            let views = team.views();
            team.meet(B, A, reading(&views[&B].pose, &views[&A].pose, &templates()[0]));
        }
        let covariance = team.views()[&A].published();
        (covariance[(0, 0)] + covariance[(1, 1)]).sqrt()
    };
    // Two priors of the same quality: at best their mean, 1 / sqrt(2) of the sigma of one, and motion on top.
    let bound = (PRIOR[0].powi(2) + PRIOR[1].powi(2)).sqrt() / 2.0_f64.sqrt();
    assert!(sigma(StrategyKind::Naive) < 0.75 * bound, "{}", sigma(StrategyKind::Naive));
    for kind in [StrategyKind::Intersection, StrategyKind::SplitIntersection] {
        assert!(sigma(kind) > bound, "{kind}: {}", sigma(kind));
    }
}

#[test]
fn independent_says_nothing_and_hears_nothing() {
    let mut team = Team::new(StrategyKind::Independent, &[A, B]);
    team.drive(10);
    let views = team.views();
    team.see(A, B, reading(&views[&A].pose, &views[&B].pose, &templates()[0]));
    assert!(team.under_way.is_empty());
    let mut other = Team::new(StrategyKind::Naive, &[A, B]);
    other.drive(10);
    other.see(A, B, reading(&views[&A].pose, &views[&B].pose, &templates()[0]));
    let (from, to, message) = other.under_way.remove(0);
    team.handle(to, Event::Received { from, message });
    assert_eq!(team.views(), views);
    assert_eq!(team.counts(B).refused, 1);
}

#[test]
fn names_read_back_and_unknown_ones_are_refused_with_the_list() {
    for kind in StrategyKind::ALL {
        assert_eq!(kind.name().parse(), Ok(kind));
        assert_eq!(Peer::new(kind, setup(A)).is_none(), kind == StrategyKind::Exact);
    }
    let error = "exakt".parse::<StrategyKind>().unwrap_err().to_string();
    assert!(error.contains("\"exakt\"") && StrategyKind::ALL.iter().all(|kind| error.contains(kind.name())));
}
