//! `pleiad simulate`: a recording of a scenario ([`record`]), or what the nominal model predicts of a
//! recording, and what was measured instead.

mod record;

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, bail};
use pleiad_estimation::sample::Target;
use pleiad_mismatch::{ChannelComparison, ChannelResiduals, RobotComparison, compare};
use pleiad_recording::ReadOptions;
use serde::Serialize;

use crate::cli::SimulateArgs;
use crate::{folder, output, setup};

#[derive(Debug, Serialize)]
struct SimulateJson {
    recording: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    model: Option<String>,
    folder: String,
    robots: Vec<RobotJson>,
}

#[derive(Debug, Serialize)]
struct RobotJson {
    robot: u32,
    channels: Vec<ChannelJson>,
}

#[derive(Debug, Serialize)]
struct ChannelJson {
    channel: &'static str,
    /// The residuals, from the run folder; absent if there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<String>,
    components: Vec<ComponentJson>,
    not_compared: Vec<String>,
}

#[derive(Debug, Serialize)]
struct ComponentJson {
    component: &'static str,
    unit: &'static str,
    count: usize,
    mean: f64,
    rms: f64,
    spread: f64,
}

pub fn run(args: &SimulateArgs) -> anyhow::Result<()> {
    match (&args.scenario, &args.from) {
        (Some(scenario), _) => record::run(scenario, args),
        (None, Some(from)) => predict(from, args),
        // clap asks for one of them.
        (None, None) => bail!("name a scenario, or a recording with --from"),
    }
}

fn predict(from: &Path, args: &SimulateArgs) -> anyhow::Result<()> {
    let recording_folder = setup::recording_folder(from);
    let (mut recording, _) = pleiad_recording::open(&recording_folder, &ReadOptions::default())?;
    if let Some(path) = &args.model {
        let mut warnings = Vec::new();
        recording.nominal = Some(pleiad_recording::read_model(path, &mut warnings)?);
        for warning in warnings {
            tracing::warn!("{warning}");
        }
    }
    let robots = compare(&recording)?;
    let folder = folder::create(args.out.as_deref(), "simulate")?;
    let json = SimulateJson {
        recording: from.display().to_string(),
        model: args.model.as_ref().map(|path| path.display().to_string()),
        folder: folder.display().to_string(),
        robots: robots.iter().map(|robot| write_robot(&folder, robot)).collect::<Result<_, _>>()?,
    };
    write(&folder.join("summary.json"), &serde_json::to_string_pretty(&json)?)?;
    output::print(args.json, &json, &text(&json))
}

fn write_robot(folder: &Path, robot: &RobotComparison) -> anyhow::Result<RobotJson> {
    let within = format!("residuals/r{}", robot.robot);
    let path = folder.join(&within);
    std::fs::create_dir_all(&path).with_context(|| format!("cannot create {}", path.display()))?;
    let mut channels = Vec::with_capacity(robot.channels.len());
    for compared in &robot.channels {
        let residuals = &compared.residuals;
        let mut file = None;
        if !residuals.rows.is_empty() {
            let name = format!("{within}/{}.csv", residuals.channel);
            write(&folder.join(&name), &csv(residuals))?;
            file = Some(name);
        }
        channels.push(ChannelJson {
            channel: residuals.channel.name(),
            file,
            components: components(compared),
            not_compared: residuals.omissions.iter().map(ToString::to_string).collect(),
        });
    }
    Ok(RobotJson { robot: robot.robot.0, channels })
}

fn components(compared: &ChannelComparison) -> Vec<ComponentJson> {
    let named = compared.residuals.channel.components().iter();
    let summaries = compared.summary.iter().flatten();
    named
        .zip(summaries)
        .map(|(component, summary)| ComponentJson {
            component: component.name,
            unit: component.unit,
            count: summary.count,
            mean: summary.mean,
            rms: summary.rms,
            spread: summary.spread,
        })
        .collect()
}

/// Columns: time, the components, the regime, the target. Cells of what is not known are empty.
fn csv(residuals: &ChannelResiduals<f64>) -> String {
    let mut text = String::from("time_s");
    for component in residuals.channel.components() {
        let _ = write!(text, ",{}", component.name);
    }
    text.push_str(",speed_m_s,yaw_rate_rad_s,acceleration_m_s2,true_x_m,true_y_m,true_heading_rad,target\n");
    for row in &residuals.rows {
        let _ = write!(text, "{:?}", row.time_s);
        for value in row.values() {
            let _ = write!(text, ",{value:?}");
        }
        let regime = &row.regime;
        let _ = write!(
            text,
            ",{:?},{:?},{:?}",
            regime.speed_m_s, regime.yaw_rate_rad_s, regime.acceleration_m_s2
        );
        match regime.pose {
            Some(pose) => {
                let _ = write!(text, ",{:?},{:?},{:?}", pose.x_m, pose.y_m, pose.yaw_rad);
            }
            None => text.push_str(",,,"),
        }
        let _ = match row.target {
            Some(Target::Landmark(landmark)) => writeln!(text, ",landmark {landmark}"),
            Some(Target::Robot(robot)) => writeln!(text, ",robot {robot}"),
            None => writeln!(text, ","),
        };
    }
    text
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}

fn text(json: &SimulateJson) -> String {
    let mut text = format!("{}: measured minus predicted by the nominal model\n", json.recording);
    for robot in &json.robots {
        let _ = writeln!(
            text,
            "\nrobot {:<14} {:<14} {:>6} {:>11} {:>11} {:>11}",
            robot.robot, "", "count", "mean", "rms", "spread"
        );
        for channel in &robot.channels {
            for component in &channel.components {
                let _ = writeln!(
                    text,
                    "{:<20} {:<14} {:>6} {:>11.5} {:>11.5} {:>11.5}",
                    channel.channel,
                    component.component,
                    component.count,
                    component.mean,
                    component.rms,
                    component.spread
                );
            }
            for reason in &channel.not_compared {
                let _ = writeln!(text, "{:<20} not compared: {reason}", channel.channel);
            }
        }
    }
    let _ = writeln!(text, "\nresiduals: {}", json.folder);
    text
}
