//! The programme of manoeuvres, and scripts.

use std::path::Path;

use pleiad_estimation::{RobotId, Timestamp};
use pleiad_recording::Command;
use pleiad_sim_peers::{Scenario, simulate};

use crate::run;

fn shipped(name: &str) -> Scenario {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios");
    Scenario::load(&folder.join(format!("{name}.toml"))).unwrap()
}

const DRIVES: [&str; 3] = ["manoeuvres", "manoeuvres_skid_steer", "manoeuvres_car_like"];

#[test]
fn robots_keep_to_their_own_areas_whatever_their_drive() {
    for name in DRIVES {
        let scenario = shipped(name);
        for seed in 1..=5 {
            let run = simulate(&scenario, seed).unwrap();
            // Three robots share the arena out from left to right.
            let [left, right, bottom, top] = scenario.arena.bounds_m();
            let width = (right - left) / 3.0;
            for (rank, track) in (0..3).map(f64::from).zip(run.tracks.values()) {
                for tenth in 0..3000 {
                    let place = track.pose_at(Timestamp::from_seconds(0.1 * f64::from(tenth))).position();
                    let inside = (left + rank * width..=left + (rank + 1.0) * width).contains(&place.x)
                        && (bottom..=top).contains(&place.y);
                    assert!(inside, "{name}, seed {seed}, robot {rank} from the left: {place:?}");
                }
            }
        }
    }
}

/// Seconds of a robot's commands that are so.
fn seconds(commands: &[Command], so: impl Fn(f64, f64) -> bool) -> f64 {
    commands.iter().filter(|own| so(own.forward_m_s, own.yaw_rate_rad_s)).count() as f64 / 25.0
}

#[test]
fn five_minutes_hold_every_kind_of_motion_for_seconds() {
    for name in DRIVES {
        let scenario = shipped(name);
        let run = simulate(&scenario, scenario.seed).unwrap();
        let car = name.ends_with("car_like");
        for (robot, recorded) in &run.recording.robots {
            let commands = &recorded.commands;
            let held = |kind: &str, so: &dyn Fn(f64, f64) -> bool| {
                let lasted_s = seconds(commands, so);
                assert!(lasted_s > 3.0, "{name}, robot {robot}, {kind}: {lasted_s} s");
            };
            held("standing", &|v, w| v == 0.0 && w == 0.0);
            held("fast ahead", &|v, w| v > 0.65 && w.abs() < 1e-9);
            held("fast back", &|v, w| v < -0.65 && w.abs() < 1e-9);
            held("slow ahead", &|v, w| (0.1..0.3).contains(&v) && w.abs() < 1e-9);
            held("crawl", &|v, _| v != 0.0 && v.abs() < 0.07);
            for sense in [1.0, -1.0] {
                held("ahead in a bend", &|v, w| v > 0.2 && sense * w > 0.2);
                held("back in a bend", &|v, w| v < -0.2 && sense * w > 0.2);
                if !car {
                    held("spin", &|v, w| v == 0.0 && sense * w > 1.0);
                    held("slow spin", &|v, w| v == 0.0 && sense * w > 0.05 && sense * w < 0.7);
                }
            }
            let reversals = commands.windows(2).filter(|pair| {
                let signs = [pair[0].forward_m_s, pair[1].forward_m_s].map(|v| v > 0.0);
                signs[0] != signs[1]
            });
            assert!(reversals.count() > 30, "{name}, robot {robot}");
        }
    }
}

#[test]
fn another_seed_is_another_order() {
    let scenario = shipped("manoeuvres");
    let commands =
        |seed| simulate(&scenario, seed).unwrap().recording.robots.remove(&RobotId(1)).unwrap().commands;
    assert_ne!(commands(1), commands(2));
}

#[test]
fn a_script_is_commanded_row_by_row_and_then_nothing() {
    let text = "name = \"script\"\nduration_s = 10.0\nteam_size = 1\n\
        [defaults.motion]\npolicy = \"script\"\nscript = [[0.5, 0.1, 2.0], [-0.2, 0.0, 1.0], [0.0, -0.7, 3.0]]\n";
    let run = run(text, 1);
    let commands = &run.recording.robots[&RobotId(1)].commands;
    for command in commands {
        let since_s = command.time.seconds_since(commands[0].time) + 1e-6;
        let expected = match since_s {
            s if s < 2.0 => (0.5, 0.1),
            s if s < 3.0 => (-0.2, 0.0),
            s if s < 6.0 => (0.0, -0.7),
            _ => (0.0, 0.0),
        };
        assert_eq!((command.forward_m_s, command.yaw_rate_rad_s), expected, "{since_s}");
    }
    assert!(commands.len() >= 248);
}

#[test]
fn only_what_was_asked_for_is_driven_between_the_ways_there() {
    use pleiad_sim_peers::scenario::ManoeuvreKind as Kind;
    let driven = |kinds: &[Kind]| {
        let mut scenario = shipped("manoeuvres");
        scenario.duration_s = 60.0;
        for settings in scenario.robots.values_mut() {
            settings.motion.manoeuvres = kinds.to_vec();
        }
        let run = simulate(&scenario, 3).unwrap();
        let commands = run.recording.robots.values().flat_map(|own| own.commands.clone());
        commands.collect::<Vec<Command>>()
    };
    // On the way to a start a robot goes at most at 0.8 of its speed.
    let fast = |own: &&Command| own.forward_m_s.abs() > 0.65;
    let bent = |own: &&Command| own.yaw_rate_rad_s.abs() > 1e-9;
    let still = |own: &&Command| own.forward_m_s == 0.0 && own.yaw_rate_rad_s == 0.0;
    let straight = driven(&[Kind::Straight]);
    assert!(straight.iter().filter(fast).count() > 100);
    assert_eq!(straight.iter().filter(fast).filter(bent).count(), 0);
    let curved = driven(&[Kind::FigureEight, Kind::Circle]);
    assert!(curved.iter().filter(fast).filter(bent).count() > 100);
    assert_eq!(driven(&[Kind::Turn]).iter().filter(fast).count(), 0);
    let standing = driven(&[Kind::Standstill]);
    assert!(4 * standing.iter().filter(still).count() > standing.len());
}

#[test]
fn every_manoeuvre_has_the_name_it_is_read_by() {
    use pleiad_sim_peers::scenario::ManoeuvreKind;
    let page = include_str!("../../../docs/scenario.md");
    let row = page.lines().find(|line| line.starts_with("| `motion.manoeuvres`")).unwrap();
    for kind in ManoeuvreKind::ALL {
        assert_eq!(kind.name().parse(), Ok(kind));
        assert!(row.contains(&format!("`{kind}`")), "{kind}");
    }
    let error = "looping".parse::<ManoeuvreKind>().unwrap_err().to_string();
    assert!(error.contains("looping") && error.contains("figure_eight"), "{error}");
}

#[test]
fn a_car_that_is_to_turn_on_the_spot_alone_is_refused() {
    use pleiad_sim_peers::scenario::ManoeuvreKind as Kind;
    let mut scenario = shipped("manoeuvres_car_like");
    for settings in scenario.robots.values_mut() {
        settings.motion.manoeuvres = vec![Kind::Turn, Kind::TurnSteps];
    }
    let error = scenario.validate().unwrap_err().to_string();
    assert!(error.contains("motion.manoeuvres") && error.contains("turn_steps"), "{error}");
    for settings in scenario.robots.values_mut() {
        settings.motion.manoeuvres.push(Kind::Arc);
    }
    assert!(scenario.validate().is_ok());
}
