//! A small world for schedules: robots in an arena, their true motion, and what they sense of it.

use std::collections::BTreeMap;

use pleiad_agent::{AgentConfig, NodeConfig};
use pleiad_estimation::geometry::Vector3;
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};

use super::chance::Chance;
use super::plan::Plan;

/// Between two odometry samples, s.
pub const TICK_S: f64 = 0.25;

/// Truth, and the next sample.
#[derive(Debug)]
pub struct World {
    truth: BTreeMap<RobotId, Pose2>,
    chance: Chance,
}

/// The configuration of a robot of the team, or what is wrong with the plan's numbers.
pub fn config(plan: &Plan, robot: u32, start: &Pose2) -> Result<NodeConfig, String> {
    let members: Vec<String> = (1..=plan.robots).map(|robot| robot.to_string()).collect();
    let most = plan.most_items.map_or_else(String::new, |items| format!("most_items = {items}\n"));
    let ledger = plan.cell_s.map_or_else(String::new, |cell_s| {
        let evict = plan.evict_after_s.map_or_else(String::new, |s| format!("evict_after_s = {s:?}\n"));
        format!("members = [{}]\ncell_s = {cell_s:?}\n{evict}", members.join(","))
    });
    let mut filter = String::from("[filter]\n");
    if plan.relinearize {
        filter.push_str("relinearize = { block_s = 0.5, ahead_s = 1.0, passes = 3 }\n");
    }
    let mut landmarks = "landmarks = [{ id = 7, x_m = 3.0, y_m = -4.0 }]\n";
    let mut unknown = "";
    if plan.calibrate {
        filter.push_str("join = true\n");
        // Where facts are linearized together, names are taken for right.
        filter.push_str(if plan.relinearize {
            "clutter = { share = 0.05, reach_m = 30.0 }\n"
        } else {
            "clutter = { share = 0.05, reach_m = 30.0, misnamed = 0.05 }\n"
        });
        // Low enough that robots are found to contradict each other every now and then.
        filter.push_str("inflation = {}\nquarantine = { level = 1.0 }\n");
        filter.push_str("[calibration]\nsigma_forward_scale = 0.05\nsigma_yaw_scale = 0.05\n");
        filter.push_str("sigma_mount_m = 0.05\nsigma_mount_rad = 0.02\nsigma_clock_offset_s = 0.02\n");
        (landmarks, unknown) = ("", "unknown_landmarks = 'map'\n");
    }
    // Where robots are to find out where they are, the first alone is told.
    let prior = if plan.calibrate && robot > 1 {
        String::new()
    } else {
        format!(
            "prior = {{ x_m = {:?}, y_m = {:?}, heading_rad = {:?}, sigma_position_m = 0.1, sigma_heading_rad = 0.05 }}\n",
            start.x_m(),
            start.y_m(),
            start.yaw_rad()
        )
    };
    let text = format!(
        "team = 'simulation'\nrobot = {robot}\n\
         {prior}{landmarks}{filter}[ledger]\n{ledger}{most}late_s = 0.5\nrebase_m = {:?}\n\
         [motion]\nlongest_gap_s = 1.0\n\
         [sensors]\n{unknown}\
         relative_pose = {{ sigma_position_m = 0.05, sigma_yaw_rad = 0.02 }}\n\
         relative_position = {{ sigma_m = 0.06 }}\n\
         range_bearing = {{ sigma_range_m = 0.08, sigma_bearing_rad = 0.04 }}\n\
         gps = {{ sigma_m = 0.5 }}\n\
         [output]\nestimate_rate_hz = 1.0\n",
        plan.rebase_m,
    );
    let config: AgentConfig = toml::from_str(&text).map_err(|error| error.to_string())?;
    config.node().map_err(|error| error.to_string())
}

impl World {
    pub fn new(seed: u64, robots: u32) -> Self {
        let mut chance = Chance::new(seed, 2);
        let start = |robot: u32, chance: &mut Chance| {
            Pose2::new(f64::from(robot) * 6.0, chance.between(-6.0, 6.0), chance.between(-3.0, 3.0))
        };
        let truth = (1..=robots).map(|robot| (RobotId(robot), start(robot, &mut chance))).collect();
        Self { truth, chance }
    }

    pub fn place(&self, robot: RobotId) -> Pose2 {
        self.truth.get(&robot).copied().unwrap_or_else(Pose2::identity)
    }

    /// What a robot senses at `now`, observations of now before the odometry that reaches them, and a step
    /// of its true motion.
    pub fn tick(&mut self, robot: RobotId, now: Timestamp) -> Vec<Sample> {
        let sample = |reading| Sample { time: now, reading };
        let mut samples = Vec::new();
        let here = self.place(robot);
        if self.chance.happens(0.3) {
            let others: Vec<RobotId> = self.truth.keys().copied().filter(|other| *other != robot).collect();
            #[allow(clippy::cast_possible_truncation, reason = "a few robots")]
            let target = others[self.chance.below(others.len() as u32) as usize];
            let relative = self.sighting(&here, &self.place(target));
            samples.push(sample(Reading::Sighting { target: Target::Robot(target), relative }));
        }
        if self.chance.happens(0.05) {
            let relative = match self.sighting(&here, &Pose2::new(3.0, -4.0, 0.0)) {
                Relative::Pose(pose) => Relative::Position { x_m: pose.x_m(), y_m: pose.y_m() },
                relative => relative,
            };
            samples.push(sample(Reading::Sighting { target: Target::Landmark(LandmarkId(7)), relative }));
        }
        if self.chance.happens(0.04) {
            let [x_m, y_m] = [here.x_m(), here.y_m()].map(|axis| axis + 0.5 * self.chance.normal());
            samples.push(sample(Reading::Gps { x_m, y_m }));
        }
        let (forward, rate) = (self.chance.between(0.2, 1.0), self.chance.between(-0.6, 0.6));
        samples.push(sample(Reading::Velocity { forward_m_s: forward, yaw_rate_rad_s: rate }));
        let root = TICK_S.sqrt();
        let noise = [0.02, 0.01].map(|sigma| sigma * root * self.chance.normal());
        let motion = Vector3::new(forward * TICK_S, 0.0, rate * TICK_S);
        let moved =
            here.compose(&Pose2::exp(motion)).compose(&Pose2::exp(Vector3::new(noise[0], 0.0, noise[1])));
        self.truth.insert(robot, moved);
        samples
    }

    fn sighting(&mut self, here: &Pose2, there: &Pose2) -> Relative {
        let seen = here.between(there);
        let chance = &mut self.chance;
        match chance.below(3) {
            0 => {
                let error =
                    Vector3::new(0.05 * chance.normal(), 0.05 * chance.normal(), 0.02 * chance.normal());
                Relative::Pose(seen.compose(&Pose2::exp(error)))
            }
            1 => Relative::Position {
                x_m: seen.x_m() + 0.06 * chance.normal(),
                y_m: seen.y_m() + 0.06 * chance.normal(),
            },
            _ => Relative::RangeBearing {
                range_m: (seen.x_m().hypot(seen.y_m()) + 0.08 * chance.normal()).max(0.01),
                bearing_rad: seen.y_m().atan2(seen.x_m()) + 0.04 * chance.normal(),
            },
        }
    }
}
