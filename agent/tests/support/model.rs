//! Model files for agents.

use std::path::{Path, PathBuf};

use pleiad_agent::AgentConfig;
use pleiad_estimation::RobotId;
use pleiad_physics::{ActiveEffect, Effect};
use pleiad_recording::{
    DeclaredEffect, Nominal, NominalNoise, NominalRangeSensor, NominalRobot, write_model,
};

/// A robot with wheels of 5 cm, 30 cm apart, and ideal sensors, on which these effects act.
pub fn robot(effects: &[(Effect, &[f64])]) -> NominalRobot {
    let declared = |(effect, values): &(Effect, &[f64])| {
        DeclaredEffect::new(ActiveEffect::new(*effect, values).expect("as many values as parameters"))
    };
    NominalRobot {
        wheel_radius: 0.05,
        track_width: 0.3,
        gyro_scale: 1.0,
        effects: effects.iter().map(declared).collect(),
        ..NominalRobot::default()
    }
}

/// A model of robots 1 to 3, all alike.
pub fn model(robot: &NominalRobot) -> Nominal {
    let range_sensor =
        NominalRangeSensor { max_range_m: 5.0, half_fov_rad: 1.0, range_scale: 1.0, ..Default::default() };
    let robots = (1..=3).map(|id| (RobotId(id), robot.clone())).collect();
    Nominal { noise: NominalNoise::default(), range_sensor, robots }
}

/// Writes a model as `model.toml` into a folder.
pub fn written(folder: &Path, model: &Nominal) -> PathBuf {
    let path = folder.join("model.toml");
    write_model(&path, model, "For a test.").expect("a sound model in a folder of its own");
    path
}

/// The configuration with a model of these effects, which lives as long as the folder.
pub fn told(mut config: AgentConfig, folder: &Path, effects: &[(Effect, &[f64])]) -> AgentConfig {
    config.model = Some(written(folder, &model(&robot(effects))));
    config
}
