//! A simulated team, run by real nodes in this process under virtual time, and what is asked of such a
//! run: errors and covariances of the whole team at an instant, on the facts up to it.

#![allow(clippy::expect_used, reason = "helpers of tests fail by panicking")]

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use pleiad_agent::NodeConfig;
use pleiad_agent::config::{
    AgentConfig, BusSection, ClockSection, FilterSection, LandmarkRow, LedgerSection, OutputSection,
};
use pleiad_estimation::fact::Entry;
use pleiad_estimation::fold::{FoldConfig, fold};
use pleiad_estimation::geometry::{Matrix3, Vector3, wrap_angle};
use pleiad_estimation::joint::Joint;
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::sample::Sample;
use pleiad_estimation::strategy::StrategyKind;
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_sim_peers::agents;
use pleiad_sim_peers::reckoning::Reckoned;
use pleiad_sim_peers::scenario::RobotSettings;
use pleiad_sim_peers::{Fleet, FleetOptions, MemberOutcome, Scenario, SimulatedRun, simulate};

/// Digest rounds granted after the last sample; without faults one is enough.
const SETTLING_ROUNDS: u32 = 200;

/// What the agents of a simulated team are told.
#[derive(Clone, Copy, Debug)]
pub struct Told {
    /// Standard deviations told, of motion and sensors, over the true ones: 1 for an honest
    /// configuration.
    pub noise: f64,
    /// Estimates per second of team time.
    pub estimate_rate_hz: f64,
}

impl Default for Told {
    fn default() -> Self {
        Self { noise: 1.0, estimate_rate_hz: 0.5 }
    }
}

/// A team before its run: the world, the nodes' configurations and what the sensors deliver.
#[derive(Clone, Debug)]
pub struct Team {
    /// True motion and recording.
    pub world: SimulatedRun,
    /// Per robot.
    pub configs: BTreeMap<RobotId, NodeConfig>,
    /// Per robot, in the order of time.
    pub samples: BTreeMap<RobotId, Vec<Sample>>,
}

/// A team after its run.
pub struct TeamRun {
    /// The team.
    pub team: Team,
    /// What each robot ended with.
    pub outcomes: BTreeMap<RobotId, MemberOutcome>,
    /// Whether all held the same facts and nothing was left to be done.
    pub agreed: bool,
    /// Dead reckoning of every robot, made from its samples once more.
    reckoned: BTreeMap<RobotId, Reckoned>,
}

/// One robot's published estimate against the truth.
#[derive(Clone, Copy, Debug)]
pub struct PoseError {
    /// True minus estimated: position in the map, yaw.
    pub error: Vector3,
    /// The covariance published with it.
    pub published: Matrix3,
    /// The covariance of the invariant error, which is not that of the position.
    pub invariant: Matrix3,
}

impl Team {
    /// Simulates a scenario and configures its agents as `pleiad run` would, but for what is `told`.
    ///
    /// # Panics
    /// If the scenario or the configuration that follows from it is not valid.
    pub fn new(scenario: &Scenario, seed: u64, told: Told) -> Self {
        let world = simulate(scenario, seed).expect("a valid scenario");
        let landmarks: Vec<LandmarkRow> = world
            .recording
            .landmarks
            .iter()
            .map(|(id, [x_m, y_m])| LandmarkRow { id: id.0, x_m: *x_m, y_m: *y_m })
            .collect();
        let configs = scenario.robots.iter().map(|(robot, settings)| {
            let config = AgentConfig {
                team: "simulated".to_owned(),
                robot: robot.0,
                strategy: StrategyKind::Exact,
                filter: FilterSection::default(),
                model: None,
                prior: world.priors.get(robot).map(agents::prior),
                motion: agents::motion(&told_as(settings, told.noise)),
                sensors: agents::sensors(&told_as(settings, told.noise)),
                calibration: None,
                clock: ClockSection::default(),
                landmarks: landmarks.clone(),
                bus: BusSection::default(),
                ledger: LedgerSection::default(),
                output: OutputSection { estimate_rate_hz: told.estimate_rate_hz, ..OutputSection::default() },
                faults: None,
            };
            (*robot, config.node().expect("a valid configuration"))
        });
        let configs = configs.collect();
        let samples =
            world.recording.robots.iter().map(|(robot, channels)| (*robot, channels.samples())).collect();
        Self { world, configs, samples }
    }

    /// A fleet of this team's nodes that has not begun.
    ///
    /// # Panics
    /// If the faults make no sense.
    pub fn fleet(&self, options: &FleetOptions) -> Fleet {
        Fleet::new(self.configs.values().cloned().collect(), options).expect("faults that make sense")
    }

    /// The samples stamped from `from_s` on and before `to_s`, seconds.
    pub fn samples_within(&self, from_s: f64, to_s: f64) -> BTreeMap<RobotId, Vec<Sample>> {
        let within = |sample: &&Sample| (from_s..to_s).contains(&sample.time.seconds());
        let part = |samples: &Vec<Sample>| samples.iter().filter(within).copied().collect();
        self.samples.iter().map(|(robot, samples)| (*robot, part(samples))).collect()
    }

    /// The last sample.
    pub fn end(&self) -> Timestamp {
        let last = self.samples.values().flatten().map(|sample| sample.time).max();
        last.unwrap_or(Timestamp(0))
    }

    /// Runs the team from beginning to end.
    pub fn run(self, options: &FleetOptions) -> TeamRun {
        let mut fleet = self.fleet(options);
        fleet.feed(&self.samples, |_| {});
        self.finish(fleet)
    }

    /// Ends the run of a fleet that was fed by hand.
    ///
    /// # Panics
    /// If a robot's odometry is not usable.
    pub fn finish(self, mut fleet: Fleet) -> TeamRun {
        let agreed = fleet.settle(self.end(), SETTLING_ROUNDS);
        let reckoned = self.configs.iter().map(|(robot, config)| {
            let reckoned = Reckoned::of(config, &self.samples[robot]);
            (*robot, reckoned.expect("usable odometry"))
        });
        TeamRun { reckoned: reckoned.collect(), outcomes: fleet.into_outcomes(), agreed, team: self }
    }
}

impl TeamRun {
    /// Robot 1's, or that of the robot with the smallest number.
    ///
    /// # Panics
    /// If the team has no robot.
    pub fn ledger(&self) -> &Ledger {
        self.outcomes.values().next().expect("a robot").node.ledger()
    }

    /// All entries of [`TeamRun::ledger`].
    pub fn entries(&self) -> Vec<Entry> {
        let ledger = self.ledger();
        ledger.digests().flat_map(|digest| ledger.entries(digest.log, 0)).cloned().collect()
    }

    /// Dead reckoning of a robot.
    pub fn reckoned(&self, robot: RobotId) -> &Reckoned {
        &self.reckoned[&robot]
    }

    /// The joint on the facts up to `time`, in the team's own error form.
    pub fn joint_at(&self, time: Timestamp) -> Joint {
        self.joint_in(self.fold_config(), time)
    }

    /// The joint that another configuration makes of the facts up to `time`.
    pub fn joint_in(&self, config: FoldConfig, time: Timestamp) -> Joint {
        let mut joint = Joint::new(config.form);
        for (key, record) in self.ledger().facts().take_while(|(key, _)| key.time <= time) {
            fold(&mut joint, &config, key, &record.fact);
        }
        joint
    }

    /// What decides the bits of the team's estimate.
    pub fn fold_config(&self) -> FoldConfig {
        self.team.configs.values().next().map(|config| config.fold).unwrap_or_default()
    }

    /// The error of the whole team at `time`, `log(X_true X_hat^-1)` of each robot stacked, and its
    /// covariance: the joint's, carried forward from each robot's last event to `time`
    /// (`docs/theory.md`, propagation). For teams in the invariant form.
    ///
    /// # Panics
    /// If a robot has no place in the map or no odometry at `time`.
    pub fn joint_error_at(&self, time: Timestamp) -> (DVector<f64>, DMatrix<f64>) {
        let joint = self.joint_at(time);
        let size = 3 * self.outcomes.len();
        let (mut errors, mut covariance) = (DVector::zeros(size), DMatrix::zeros(size, size));
        let robots: Vec<RobotId> = self.outcomes.keys().copied().collect();
        let index = |robot: &RobotId| joint.index(*robot).expect("a place in the map");
        for (i, robot) in robots.iter().enumerate() {
            for (j, other) in robots.iter().enumerate() {
                let block = joint.covariance().block(index(robot), index(other));
                covariance.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&block);
            }
            let member = joint.member(*robot).expect("a place in the map");
            let state = self.reckoned[robot].trajectory.at(time).expect("odometry");
            let grown = state.noise_sum.minus(member.folded_noise).to_matrix();
            let adjoint = member.correction.adjoint();
            let mut own = covariance.fixed_view_mut::<3, 3>(3 * i, 3 * i);
            own += adjoint * grown * adjoint.transpose();
            let (truth, estimate) =
                (self.team.world.tracks[robot].pose_at(time), member.correction.compose(&state.nominal));
            errors.fixed_rows_mut::<3>(3 * i).copy_from(&truth.compose(&estimate.inverse()).log());
        }
        (errors, covariance)
    }

    /// What a robot would have published at `time` on the facts up to it, against the truth.
    ///
    /// # Panics
    /// As [`TeamRun::joint_error_at`].
    pub fn pose_error_at(&self, joint: &Joint, robot: RobotId, time: Timestamp) -> PoseError {
        let state = self.reckoned[&robot].trajectory.at(time).expect("odometry");
        let (estimate, published) = joint.estimate(robot, time, &state).expect("a place in the map");
        let truth = self.team.world.tracks[&robot].pose_at(time);
        let back = estimate.invariant_from_additive();
        let published = published.to_matrix();
        PoseError {
            error: additive(&truth, &estimate),
            published,
            invariant: back * published * back.transpose(),
        }
    }

    /// Root mean square, over robots and settled estimates within `[from_s, to_s]`, of the root of the
    /// trace of the position covariance, metres.
    pub fn team_sigma_m(&self, from_s: f64, to_s: f64) -> f64 {
        let settled = self.outcomes.values().flat_map(|outcome| outcome.node.settled());
        let squares: Vec<f64> = settled
            .filter(|estimate| (from_s..=to_s).contains(&estimate.time.seconds()))
            .map(|estimate| estimate.covariance.0[0] + estimate.covariance.0[2])
            .collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }
}

fn additive(truth: &Pose2, estimate: &Pose2) -> Vector3 {
    let offset = truth.position() - estimate.position();
    Vector3::new(offset.x, offset.y, wrap_angle(truth.yaw_rad() - estimate.yaw_rad()))
}

/// The settings as if all noises were `told` times what they are.
fn told_as(settings: &RobotSettings, told: f64) -> RobotSettings {
    let mut scaled = settings.clone();
    let noise = &mut scaled.odometry.noise;
    let relative = &mut scaled.relative;
    for sigma in [
        &mut noise.speed_m_per_sqrt_s,
        &mut noise.lateral_m_per_sqrt_s,
        &mut noise.yaw_rad_per_sqrt_s,
        &mut noise.speed_m_per_sqrt_m,
        &mut noise.yaw_rad_per_sqrt_rad,
        &mut relative.sigma_range_m,
        &mut relative.sigma_bearing_rad,
        &mut relative.sigma_position_m,
        &mut relative.sigma_yaw_rad,
        &mut scaled.gps.sigma_m,
        &mut scaled.heading.sigma_rad,
    ] {
        *sigma *= told;
    }
    scaled
}
