//! Effects that act in at most 3 % of the time or place.

use pleiad_estimation::Timestamp;
use pleiad_physics::{Effect, Region};
use pleiad_sim_peers::world::Track;
use pleiad_sim_peers::{Scenario, simulate};

use super::draw::Draw;
use super::inject::{inject, robot_for, values};
use crate::error::BenchmarkError;
use crate::seal::Injected;

/// The share of the time that a robot spends in a rare place.
const SHARES: [f64; 2] = [0.015, 0.03];
/// Half of the side of a place, metres.
const HALF_SIDES_M: [f64; 2] = [0.15, 0.6];
/// Places tried.
const ATTEMPTS: usize = 2000;
/// The path is looked at this often, seconds.
const STEP_S: f64 = 0.1;
/// How long an effect lasts that comes and goes, as a share of the run: 5 s.
const LASTS: f64 = 5.0 / 180.0;
/// The size of one that comes and goes.
const PASSING: f64 = 3.0;

pub(super) fn rare(
    scenario: &mut Scenario,
    effect: Effect,
    seed: u64,
    draw: &mut Draw,
) -> Result<Injected, BenchmarkError> {
    let robot = robot_for(effect, draw);
    let duration_s = scenario.duration_s;
    let mut values = values(effect, 1.0, duration_s, draw);
    if effect == Effect::LongitudinalSlip {
        let from_s = duration_s * draw.between(0.25, 0.7);
        values[0] *= PASSING;
        return inject(scenario, effect, &values, robot, Some([from_s, from_s + LASTS * duration_s]));
    }
    if let Some((first, _)) = effect.info().parameter("region_m.x_min") {
        let source =
            |error| BenchmarkError::Simulation { id: scenario.name.clone(), source: Box::new(error) };
        // The path with the effect is another, but little: it acts for seconds.
        let run = simulate(scenario, seed).map_err(source)?;
        let region = run.tracks.get(&robot).and_then(|track| place(track, duration_s, draw));
        let Some(region) = region else {
            let why = format!("robot {robot} stays nowhere for a share of {SHARES:?} of the run");
            return Err(BenchmarkError::Case { id: scenario.name.clone(), why });
        };
        values[first..first + 4].copy_from_slice(&region);
    }
    inject(scenario, effect, &values, robot, None)
}

/// A square about a point of the path, in which the robot is for the share of time wanted.
fn place(track: &Track, duration_s: f64, draw: &mut Draw) -> Option<[f64; 4]> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few thousand")]
    let count = (duration_s / STEP_S) as usize;
    let at = |time_s: f64| {
        let pose = track.pose_at(Timestamp::from_seconds(time_s));
        [pose.x_m(), pose.y_m()]
    };
    let path: Vec<[f64; 2]> = (0..count).map(|index| at(index as f64 * STEP_S)).collect();
    (0..ATTEMPTS).find_map(|_| {
        let [x, y] = at(draw.between(0.0, duration_s));
        let half_m = draw.between(HALF_SIDES_M[0], HALF_SIDES_M[1]);
        let bounds = [x - half_m, x + half_m, y - half_m, y + half_m];
        let region = Region::from_bounds(bounds);
        let share = path.iter().filter(|point| region.contains(**point)).count() as f64 / count as f64;
        (SHARES[0]..=SHARES[1]).contains(&share).then_some(bounds)
    })
}
