use std::collections::BTreeMap;

use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};
use pleiad_physics::{Drive, Effect, Nominal, Pose, RobotModel};
use pleiad_recording::{Command, Recording, TruthSample};

use super::*;
use crate::diagnosis::entries::entries;
use crate::diagnosis::fit::states;
use crate::diagnosis::run::member;
use crate::diagnosis::starts::{Placing, starts};
use crate::diagnosis::term::Whose;
use crate::evidence::Evidence;

const STEP_S: f64 = 0.02;

/// Two robots that drive curves for half a minute, with every sensor.
fn recording() -> Recording {
    let landmark = [2.0, 1.0];
    let mut recording = Recording { landmarks: [(LandmarkId(7), landmark)].into(), ..Recording::default() };
    for number in 1..=2 {
        let own = recording.robots.entry(RobotId(number)).or_default();
        let mut pose = Pose::new(0.3 * f64::from(number), -0.2, 0.4);
        let mut wheels = [0.0; 2];
        for index in 0..1500 {
            let time_s = STEP_S * f64::from(index);
            let time = Timestamp::from_seconds(time_s);
            let speed = 0.4 + 0.3 * (0.9 * time_s + f64::from(number)).sin();
            let rate = 0.6 * (0.31 * time_s).cos();
            let [x_m, y_m] = landmark;
            let [ahead, left] = pose.point_seen([x_m, y_m]);
            own.commands.push(Command { time, forward_m_s: speed, yaw_rate_rad_s: rate });
            own.truth.push(TruthSample { time, pose: Pose2::new(pose.x_m, pose.y_m, pose.yaw_rad) });
            let sighting = |target, range_m, bearing_rad| Reading::Sighting {
                target,
                relative: Relative::RangeBearing { range_m, bearing_rad },
            };
            let readings = [
                Reading::Wheels { left_rad: wheels[0], right_rad: wheels[1] },
                Reading::Gyro { yaw_rate_rad_s: rate + 1e-3 * (7.0 * time_s).sin() },
                Reading::Gps { x_m: pose.x_m, y_m: pose.y_m },
                Reading::Heading { heading_rad: pose.yaw_rad },
                sighting(Target::Landmark(LandmarkId(7)), ahead.hypot(left), left.atan2(ahead)),
                sighting(Target::Robot(RobotId(3 - number)), 1.0 + 0.01 * time_s, 0.2),
            ];
            for reading in readings {
                own.push(Sample { time, reading });
            }
            pose = pose.compose(&Pose::exp(speed * STEP_S, 0.0, rate * STEP_S));
            wheels[0] += (speed - 0.2 * rate) / 0.05 * STEP_S;
            wheels[1] += (speed + 0.2 * rate) / 0.05 * STEP_S;
        }
    }
    recording
}

/// Every start of every effect that has directions, and two pushes.
fn requests(units: &[&Unit<'_>]) -> Vec<Request> {
    let mut requests = Vec::new();
    for (effect, whose) in entries(units).entries {
        for start in starts(effect, units).into_iter().filter(|start| !start.along.is_empty()) {
            let mut values = start.values;
            Placing::of(effect.info()).widen(&mut values);
            requests.push(Request { term: Term::new(effect, whose, values), along: start.along });
        }
    }
    // Where windows meet a push is split between them.
    for onset_s in [10.0, 21.0] {
        let term = Term::new(Effect::Push, Whose::Robot(RobotId(1)), vec![onset_s, 0.0, 0.0, 0.0]);
        requests.push(Request { term, along: vec![1, 2, 3] });
    }
    requests
}

#[test]
fn what_is_linearized_together_is_what_each_has_alone() {
    let recording = recording();
    let model: RobotModel<f64> = RobotModel::nominal(Drive::Differential, Nominal::ideal(0.05, 0.4));
    let models: BTreeMap<_, _> = recording.robots.keys().map(|robot| (*robot, model.clone())).collect();
    let evidence = Evidence::new(&recording, &models);
    let units = [1, 2].map(|robot| Unit::new(&evidence, 0, vec![member(&recording, RobotId(robot), &model)]));
    let units: Vec<&Unit<'_>> = units.iter().collect();
    let terms = [Term::new(Effect::WheelRadiusError, Whose::Robot(RobotId(1)), vec![0.01])];
    let states = states(&units, &terms).expect("finite");
    let requests = requests(&units);
    assert!(requests.len() > 80, "{}", requests.len());
    let together = linearized(&units, &terms, &states, &requests);
    let mut shown = 0;
    for (request, together) in requests.iter().zip(together) {
        let alone = linearized(&units, &terms, &states, std::slice::from_ref(request)).remove(0);
        let name = request.term.effect.name();
        assert_eq!(together.len(), alone.len(), "{name}");
        for ((unit, together), (same, alone)) in together.iter().zip(&alone) {
            assert_eq!((unit, together.len()), (same, alone.len()), "{name}");
            for (together, alone) in together.iter().zip(alone) {
                for (together, alone) in together.parts.iter().zip(&alone.parts) {
                    assert_eq!(together.is_some(), alone.is_some(), "{name}");
                    let (Some(together), Some(alone)) = (together, alone) else { continue };
                    shown += 1;
                    let largest = alone.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
                    let apart = together.iter().zip(alone).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    assert!(apart <= 1e-12 * largest, "{name}: {apart} of {largest}");
                }
            }
        }
    }
    assert!(shown > 150, "{shown}");
}
