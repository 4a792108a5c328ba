//! Which manoeuvre tells apart what a recording cannot: every one of the library is driven in simulation under the best
//! explanation, and the rivals are fitted to what the sensors of this robot would record.

use std::collections::BTreeMap;

use pleiad_estimation::RobotId;
use pleiad_mismatch::{DiagnoseOptions, Finding, Verdict, log_likelihood};
use pleiad_physics::{ActiveEffect, Drive, Effect};
use pleiad_recording::{Nominal, NominalRobot, Recording};
use pleiad_sim_peers::scenario::{
    Arena, DriveKind, DriveSettings, Gps, Gyro, Heading, ManoeuvreKind, Motion, MotionNoise, Odometry,
    OdometryKind, Policy, PriorSettings, RelativeSensor, RobotSettings, See,
};
use pleiad_sim_peers::{Scenario, simulate};

/// How long a manoeuvre is driven, seconds.
pub const SECONDS: f64 = 60.0;
/// Twenty to one, in log-likelihood: less tells nothing apart.
pub const LEAST_RATIO: f64 = 2.995_732_273_553_991;
/// Any seed will do; the same one for all.
const SEED: u64 = 1;
/// Beyond where anything was, metres.
const MARGIN_M: f64 = 2.0;

/// What a manoeuvre tells.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// What is driven.
    pub manoeuvre: ManoeuvreKind,
    /// The least log-likelihood ratio, per minute of driving, of the best explanation over a rival, if the best
    /// explanation is true.
    pub ratio_per_minute: f64,
}

/// The manoeuvres that a robot can drive, the one that tells the rivals of a finding apart best first. `None` if the
/// recording does not declare what the robot is, or the finding has no rivals.
pub fn proposals(
    recording: &Recording,
    finding: &Finding,
    options: &DiagnoseOptions,
) -> Option<Vec<Proposal>> {
    let best = finding.effect.as_deref().and_then(Effect::from_name)?;
    let rivals: Vec<Effect> = finding
        .support_set
        .iter()
        .filter_map(|name| Effect::from_name(name))
        .filter(|own| *own != best)
        .collect();
    let robot = RobotId(*finding.robots.first()?);
    if finding.verdict != Verdict::CannotTell || rivals.is_empty() {
        return None;
    }
    tell_apart(recording, robot, active(best, finding)?, &rivals, options)
}

/// The same of an effect of a robot and others that may be in its place.
pub fn tell_apart(
    recording: &Recording,
    robot: RobotId,
    best: ActiveEffect<f64>,
    rivals: &[Effect],
    options: &DiagnoseOptions,
) -> Option<Vec<Proposal>> {
    let effect = best.effect();
    let base = scenario(recording, robot, best)?;
    let is_car = base.robots.get(&robot)?.drive.kind == DriveKind::CarLike;
    let kinds = ManoeuvreKind::ALL.into_iter().filter(|kind| !(kind.on_the_spot() && is_car));
    let alone = DiagnoseOptions { fit_on: Vec::new(), test_on: Vec::new(), ..options.clone() };
    let one = |manoeuvre: ManoeuvreKind| {
        let mut scenario = base.clone();
        for settings in scenario.robots.values_mut() {
            settings.motion.manoeuvres = vec![manoeuvre];
        }
        let run = simulate(&scenario, SEED).ok()?;
        let of = |effect: Effect| log_likelihood(&run.recording, robot, &[effect], &alone).ok();
        let explained = of(effect)?;
        let ratios = rivals.iter().filter_map(|&rival| Some(explained - of(rival)?));
        let least = ratios.fold(f64::INFINITY, f64::min);
        let ratio_per_minute = least.max(0.0) * 60.0 / SECONDS;
        least.is_finite().then_some(Proposal { manoeuvre, ratio_per_minute })
    };
    let mut all: Vec<Proposal> = kinds.filter_map(one).collect();
    all.sort_by(|a, b| b.ratio_per_minute.total_cmp(&a.ratio_per_minute));
    Some(all)
}

/// What to tell people: the best manoeuvre with what it is worth and how it is simulated, or that none helps.
pub fn advice(proposals: &[Proposal], broken_by: &str) -> String {
    match proposals.first() {
        Some(best) if best.ratio_per_minute > LEAST_RATIO => format!(
            "drive `{}` for a minute: it tells them apart by {:.0} in log-likelihood (`pleiad simulate SCENARIO \
             --manoeuvre {} --seconds 60` shows it)",
            best.manoeuvre, best.ratio_per_minute, best.manoeuvre
        ),
        _ => format!(
            "no manoeuvre of the library tells them apart with these sensors; another measurement does: {broken_by}"
        ),
    }
}

fn active(effect: Effect, finding: &Finding) -> Option<ActiveEffect<f64>> {
    let mut values: Vec<f64> = effect.info().parameters.iter().map(|parameter| parameter.off).collect();
    for (label, estimate) in &finding.parameters {
        if let Some((position, _)) = effect.info().parameter(label) {
            values[position] = estimate.value;
        }
    }
    ActiveEffect::new(effect, &values).ok()
}

/// The robot as it is declared, with an effect, and one more robot of the recording for it to meet.
fn scenario(recording: &Recording, robot: RobotId, effect: ActiveEffect<f64>) -> Option<Scenario> {
    let nominal = recording.nominal.as_ref()?;
    let mut robots = BTreeMap::new();
    for (&id, declared) in &nominal.robots {
        if id != robot && robots.len() > usize::from(robots.contains_key(&robot)) {
            continue;
        }
        let mut own = settings(recording, nominal, id, declared)?;
        if id == robot {
            own.effects.push(effect);
        }
        robots.insert(id, own);
    }
    let landmarks = recording.landmarks.clone();
    let truth =
        recording.robots.values().flat_map(|own| &own.truth).map(|own| [own.pose.x_m(), own.pose.y_m()]);
    let reach = |axis: usize| {
        let places = landmarks.values().copied().chain(truth.clone()).map(|place| place[axis].abs());
        2.0 * (places.fold(3.0, f64::max) + MARGIN_M)
    };
    Some(Scenario {
        name: "manoeuvre".to_owned(),
        seed: SEED,
        duration_s: SECONDS,
        arena: Arena { width_m: reach(0), height_m: reach(1) },
        truth_rate_hz: 50.0,
        truth_sigma_m: nominal.noise.truth_sigma_m,
        truth_sigma_rad: nominal.noise.truth_sigma_rad,
        landmarks,
        random_landmarks: 0,
        robots,
        ..Scenario::from_toml("name = \"manoeuvre\"\nduration_s = 60.0\nteam_size = 1\n", "manoeuvre").ok()?
    })
}

/// A robot as its nominal model declares it, with the sensors that recorded something.
fn settings(
    recording: &Recording,
    nominal: &Nominal,
    robot: RobotId,
    declared: &NominalRobot,
) -> Option<RobotSettings> {
    let recorded = recording.robots.get(&robot)?;
    let rate = |samples: usize| samples as f64 / duration_s(recording).max(1.0);
    let noise = &nominal.noise;
    let sensor = &nominal.range_sensor;
    // What is declared of a sensor that is not there is zero; the scenario wants something.
    let or = |declared: f64, usual: f64| if declared > 0.0 { declared } else { usual };
    let usual = RobotSettings::default();
    let fastest = |of: fn(&pleiad_recording::Command) -> f64, least: f64| {
        recorded.commands.iter().map(of).fold(least, |most, value| most.max(value.abs()))
    };
    let sees = !recorded.sightings.is_empty();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of ticks")]
    let ticks = declared.encoder_ticks_per_rev as u32;
    Some(RobotSettings {
        wheel_radius_m: declared.wheel_radius,
        track_width_m: declared.track_width,
        encoder_ticks_per_rev: ticks,
        command_rate_hz: rate(recorded.commands.len()).clamp(5.0, 50.0),
        servo_time_constant_s: declared.servo_time_constant_s,
        servo_time_constant_turn_s: declared.servo_time_constant_turn_s,
        command_jitter_s: noise.command_jitter_s,
        drive: drive(&declared.drive),
        prior: PriorSettings::default(),
        motion: Motion {
            policy: Policy::Manoeuvres,
            speed_m_s: fastest(|own| own.forward_m_s, 0.2),
            min_speed_m_s: 0.1,
            max_yaw_rate_rad_s: fastest(|own| own.yaw_rate_rad_s, 0.3),
            ..Motion::default()
        },
        odometry: Odometry {
            kind: OdometryKind::Wheels,
            rate_hz: rate(recorded.odometry.len()).clamp(10.0, 100.0).round(),
            noise: MotionNoise {
                speed_m_per_sqrt_s: noise.odometry_floor_pos_sigma_m_per_1s,
                lateral_m_per_sqrt_s: noise.odometry_floor_pos_sigma_m_per_1s,
                yaw_rad_per_sqrt_s: noise.odometry_floor_heading_sigma_rad_per_1s,
                ..MotionNoise::default()
            },
            ..Odometry::default()
        },
        gyro: Gyro {
            rate_hz: rate(recorded.gyro.len()).round(),
            sigma_rad_s: or(noise.gyro_sigma_rad_s, usual.gyro.sigma_rad_s),
            bias_rad_s: 0.0,
        },
        gps: Gps {
            rate_hz: rate(recorded.gps.len()).round(),
            sigma_m: or(noise.gps_sigma_m, usual.gps.sigma_m),
            windows_s: Vec::new(),
        },
        heading: Heading {
            rate_hz: rate(recorded.heading.len()).round(),
            sigma_rad: or(noise.heading_sigma_rad, usual.heading.sigma_rad),
        },
        relative: RelativeSensor {
            rate_hz: if sees { 5.0 } else { 0.0 },
            see: See::Both,
            min_range_m: sensor.min_range_m,
            max_range_m: sensor.max_range_m,
            half_fov_rad: sensor.half_fov_rad,
            sigma_range_m: or(noise.range_sigma_m, usual.relative.sigma_range_m),
            sigma_bearing_rad: or(noise.bearing_sigma_rad, usual.relative.sigma_bearing_rad),
            ..RelativeSensor::default()
        },
        ..RobotSettings::default()
    })
}

fn drive(declared: &Drive) -> DriveSettings {
    let default = DriveSettings::default();
    match *declared {
        Drive::Differential => DriveSettings { kind: DriveKind::Differential, ..default },
        Drive::SkidSteer { track_ratio } => {
            DriveSettings { kind: DriveKind::SkidSteer, track_ratio, ..default }
        }
        Drive::CarLike { .. } => DriveSettings { kind: DriveKind::CarLike, ..default },
    }
}

fn duration_s(recording: &Recording) -> f64 {
    let spans = recording.robots.values().filter_map(|own| {
        let (first, last) = own.odometry.first().zip(own.odometry.last())?;
        Some(last.time.seconds_since(first.time))
    });
    spans.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A robot with a gyro among landmarks.
    fn recording() -> Recording {
        let text = "name = \"small\"\nduration_s = 10.0\nteam_size = 1\nrandom_landmarks = 6\n\
                    [defaults.odometry]\nkind = \"wheels\"\nrate_hz = 50.0\n\
                    [defaults.gyro]\nrate_hz = 50.0\n[defaults.relative]\nrate_hz = 5.0\nsee = \"both\"\n";
        simulate(&Scenario::from_toml(text, "small.toml").unwrap(), 3).unwrap().recording
    }

    #[test]
    fn what_scales_with_turning_is_told_from_a_bias_by_turning_both_ways() {
        let best = ActiveEffect::new(Effect::GyroScale, &[0.03]).unwrap();
        let rivals = [Effect::GyroBias];
        let found = tell_apart(&recording(), RobotId(1), best, &rivals, &DiagnoseOptions::default()).unwrap();
        let of =
            |kind: ManoeuvreKind| found.iter().find(|own| own.manoeuvre == kind).unwrap().ratio_per_minute;
        // A scale changes its sign with the turn, a bias does not.
        assert!(of(ManoeuvreKind::Turn) > 30.0, "{found:?}");
        assert!(advice(&found, "").contains(found[0].manoeuvre.name()));
    }

    #[test]
    fn what_is_the_same_is_told_apart_by_nothing() {
        let best = ActiveEffect::new(Effect::GyroScale, &[0.03]).unwrap();
        let rivals = [Effect::GyroScale];
        let found = tell_apart(&recording(), RobotId(1), best, &rivals, &DiagnoseOptions::default()).unwrap();
        assert_eq!(found.len(), ManoeuvreKind::ALL.len());
        assert!(found.iter().all(|own| own.ratio_per_minute < 1e-9), "{found:?}");
        assert!(advice(&found, "a compass").starts_with("no manoeuvre"));
    }

    #[test]
    fn where_nothing_helps_the_catalogue_says_what_would() {
        let proposals = [Proposal { manoeuvre: ManoeuvreKind::Turn, ratio_per_minute: 1.0 }];
        assert!(advice(&proposals, "a second gyro").ends_with("a second gyro"));
    }
}
