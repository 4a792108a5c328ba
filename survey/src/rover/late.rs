//! Sun readings that arrive late: to their own instant, or, as a fault, applied when they arrive.

use pleiad_estimation::Timestamp;
use pleiad_estimation::geometry::wrap_angle;
use pleiad_estimation::single::{Measurement, Replay, Unicycle};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardUniform};

use super::NAME;
use super::run::{JUDGED_S, Method, begun, channels, recorded};
use crate::error::SurveyError;
use crate::solo::{ROBOT, in_order, root_mean_square};

/// A sun reading is on its way for as long, seconds.
const LATE_S: [f64; 2] = [0.5, 3.0];
/// What the filter keeps.
const WINDOW_S: f64 = 5.0;

/// One run with late sun readings.
#[derive(Clone, Debug)]
pub struct Late {
    /// Whether the filter that puts them to their instants ends with the bits of the one that had them in order.
    pub equal: bool,
    /// How many sun readings came after something that was taken later.
    pub overtaken: usize,
    /// Of how many.
    pub readings: usize,
    /// Root mean square heading error over the run: in place, and applied at arrival.
    pub heading_rms_rad: [f64; 2],
}

/// The run of a seed with its sun readings late.
///
/// # Errors
/// [`SurveyError`] for a scenario that cannot be simulated or a measurement that cannot be used.
pub fn late(seed: u64) -> Result<Late, SurveyError> {
    let (scenario, run) = recorded(seed)?;
    let failed = |what: String| SurveyError::Diverged { study: NAME, seed, what };
    let filter = begun(&scenario.robots[&ROBOT], &run)
        .ok_or_else(|| failed("the rover is not told its start".to_owned()))?;
    let channels = channels(&scenario, &run, Method::SlowSun);
    let mut in_time = filter.clone();
    for own in in_order(channels.clone(), filter.time()) {
        in_time.take(&own).map_err(|error| failed(error.to_string()))?;
    }

    let mut random = ChaCha12Rng::seed_from_u64(seed);
    let arrivals = arrivals(channels, filter.time(), &mut random);
    let (mut replay, mut naive) = (Replay::new(filter.clone(), WINDOW_S), filter);
    let mut squares = [Vec::new(), Vec::new()];
    let (mut overtaken, mut readings) = (0, 0);
    let track = &run.tracks[&ROBOT];
    for Arrival { at, rank, measurement } in arrivals {
        while let Some(judged_s) = JUDGED_S.get(squares[0].len()) {
            let time = Timestamp::from_seconds(*judged_s);
            if at <= time {
                break;
            }
            let truth = track.pose_at(time).yaw_rad();
            for (filter, errors) in [replay.filter(), &naive].into_iter().zip(&mut squares) {
                errors.push(wrap_angle(filter.at(time).mean[Unicycle::HEADING] - truth));
            }
        }
        if rank == SUN {
            readings += 1;
            overtaken += usize::from(measurement.time < replay.filter().time());
        }
        replay.take(measurement, rank).map_err(|error| failed(error.to_string()))?;
        let moved = Measurement { time: at.max(naive.time()), ..measurement };
        naive.take(&moved).map_err(|error| failed(error.to_string()))?;
    }
    let heading_rms_rad = squares.map(root_mean_square);
    Ok(Late { equal: replay.filter() == &in_time, overtaken, readings, heading_rms_rad })
}

/// Place of the sun sensor among the channels.
const SUN: u32 = 3;

struct Arrival {
    at: Timestamp,
    rank: u32,
    measurement: Measurement<5>,
}

/// Everything in the order in which it arrives: the sun readings late, the rest at once.
fn arrivals(channels: Vec<Vec<Measurement<5>>>, from: Timestamp, random: &mut ChaCha12Rng) -> Vec<Arrival> {
    let mut all = Vec::new();
    for (rank, channel) in (0_u32..).zip(channels) {
        for measurement in channel.into_iter().filter(|own| own.time >= from) {
            let share: f64 = StandardUniform.sample(random);
            let delay_s = if rank == SUN { LATE_S[0] + (LATE_S[1] - LATE_S[0]) * share } else { 0.0 };
            all.push(Arrival { at: measurement.time.plus_seconds(delay_s), rank, measurement });
        }
    }
    all.sort_by_key(|own| (own.at, own.rank));
    all
}
