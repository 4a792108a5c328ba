//! Manoeuvres that tell effects apart: each as commands one after the other.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use pleiad_physics::Pose;

use crate::scenario::ManoeuvreKind;

/// A manoeuvre: rows of `[forward m/s, yaw rate rad/s, seconds]`.
pub(super) type Manoeuvre = Vec<[f64; 3]>;

/// What a robot can do, and how much room it has.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// The fastest speed, m/s.
    pub(super) speed_m_s: f64,
    /// The fastest yaw rate, rad/s.
    pub(super) yaw_rate_rad_s: f64,
    /// The tightest turn of a car, metres; `None` for a robot that turns on the spot.
    pub(super) tightest_m: Option<f64>,
    /// No manoeuvre leads farther from its middle, metres.
    pub(super) reach_m: f64,
}

/// Between two motions, seconds: long enough for a servo to come to rest.
const PAUSE_S: f64 = 0.8;
const PAUSE: [f64; 3] = [0.0, 0.0, PAUSE_S];
/// Speed of a crawl, m/s, and yaw rate of a slow turn, rad/s: about a dead band.
const CRAWL_M_S: f64 = 0.06;
const CRAWL_RAD_S: f64 = 0.1;

/// Every manoeuvre of these kinds once (of all, if there are none): first those that every kind of motion is
/// in, then the rest.
pub(super) fn programme(limits: &Limits, kinds: &[ManoeuvreKind]) -> [Vec<Manoeuvre>; 2] {
    whole(limits).map(|part| {
        let wanted = |(kind, manoeuvre)| (kinds.is_empty() || kinds.contains(&kind)).then_some(manoeuvre);
        part.into_iter().filter_map(wanted).collect()
    })
}

fn whole(limits: &Limits) -> [Vec<(ManoeuvreKind, Manoeuvre)>; 2] {
    use ManoeuvreKind as Kind;
    let Limits { speed_m_s: fast, yaw_rate_rad_s: turn, reach_m, .. } = *limits;
    let (slow, middle) = (0.3 * fast, 0.6 * fast);
    let mut first = vec![
        (Kind::Standstill, vec![[0.0, 0.0, 5.0]]),
        (Kind::Straight, there_and_back(slow, 0.0, 0.6 * reach_m / slow)),
        (Kind::Straight, there_and_back(middle, 0.0, 1.6 * reach_m / middle)),
        (Kind::Straight, there_and_back(fast, 0.0, 1.6 * reach_m / fast)),
        (Kind::Steps, stop_and_go(fast, reach_m)),
        (Kind::Crawl, crawl(limits)),
        (Kind::FigureEight, eight(limits, fast)),
        (Kind::Square, square(limits, middle, 1.0)),
    ];
    let mut rest = vec![
        (Kind::Steps, stop_and_go(-middle, reach_m)),
        (Kind::Ramp, ramp(fast, reach_m)),
        (Kind::Weave, weave(middle, turn, reach_m)),
        (Kind::FigureEight, eight(limits, middle)),
        (Kind::FigureEight, eight(limits, -middle)),
        (Kind::Square, square(limits, middle, -1.0)),
    ];
    for sense in [1.0, -1.0] {
        first.push((Kind::Arc, arc(limits, middle, sense, 0.5 * reach_m)));
        rest.push((Kind::Arc, arc(limits, fast, sense, 0.9 * reach_m)));
        if limits.tightest_m.is_none() {
            first.push((Kind::Turn, vec![[0.0, sense * turn, TAU / turn], PAUSE]));
            first.push((Kind::Turn, vec![[0.0, sense * 0.4 * turn, PI / (0.4 * turn)], PAUSE]));
            rest.push((Kind::TurnSteps, turn_steps(sense * turn)));
            rest.push((Kind::Circle, vec![[fast, sense * turn, TAU / turn], PAUSE]));
        } else {
            let tight = there_and_back(slow, sense * slow / limits.radius(0.0), 0.7 * reach_m / slow);
            rest.push((Kind::Circle, tight));
        }
    }
    [first, rest]
}

impl Limits {
    /// The radius nearest to `wanted_m` that can be driven.
    fn radius(&self, wanted_m: f64) -> f64 {
        wanted_m.max(1.05 * self.tightest_m.unwrap_or(0.0)).max(0.1)
    }
}

fn there_and_back(speed: f64, yaw_rate: f64, lasts_s: f64) -> Manoeuvre {
    vec![[speed, yaw_rate, lasts_s], PAUSE, [-speed, -yaw_rate, lasts_s], PAUSE]
}

fn arc(limits: &Limits, speed: f64, sense: f64, radius_m: f64) -> Manoeuvre {
    let radius_m = limits.radius(radius_m);
    // At most half a turn, and no longer than there is room.
    let length_m = (PI * radius_m).min(1.8 * limits.reach_m);
    there_and_back(speed, sense * speed / radius_m, length_m / speed)
}

/// Starts and stops in short turn, then all the way back.
fn stop_and_go(speed: f64, reach_m: f64) -> Manoeuvre {
    let each_s = (1.5 * reach_m / (5.0 * speed.abs())).clamp(0.2, 0.8);
    let go = |speed| [[speed, 0.0, each_s], [0.0, 0.0, 0.6]];
    let mut rows: Manoeuvre = (0..5).flat_map(|_| go(speed)).collect();
    rows.extend((0..5).flat_map(|_| go(-speed)));
    rows
}

fn turn_steps(yaw_rate: f64) -> Manoeuvre {
    let step = |yaw_rate| [[0.0, yaw_rate, 0.5], [0.0, 0.0, 0.5]];
    (0..4).flat_map(|_| step(yaw_rate)).chain((0..4).flat_map(|_| step(-yaw_rate))).collect()
}

/// Slowly up to a speed and down again, forth and back: every speed is met.
fn ramp(speed: f64, reach_m: f64) -> Manoeuvre {
    let steps = 12_u32;
    // The mean speed of the triangle is half of the greatest.
    let each_s = (1.6 * reach_m / (0.5 * speed * f64::from(2 * steps))).min(0.4);
    let up = (1..=steps).map(|step| f64::from(step) / f64::from(steps));
    let shares: Vec<f64> = up.clone().chain(up.rev()).collect();
    let one_way = |sense: f64| shares.iter().map(move |share| [sense * share * speed, 0.0, each_s]);
    let mut rows: Manoeuvre = one_way(1.0).collect();
    rows.push(PAUSE);
    rows.extend(one_way(-1.0));
    rows.push(PAUSE);
    rows
}

fn crawl(limits: &Limits) -> Manoeuvre {
    let mut rows = there_and_back(CRAWL_M_S, 0.0, 3.0);
    rows.extend(there_and_back(0.3 * CRAWL_M_S, 0.0, 2.0));
    if limits.tightest_m.is_none() {
        rows.extend(there_and_back(0.0, CRAWL_RAD_S, 3.0));
    }
    rows
}

/// A wavy line ahead, and back along it.
fn weave(speed: f64, turn: f64, reach_m: f64) -> Manoeuvre {
    let half_s = 0.7;
    let most = 1.5 * reach_m / speed / (2.0 * half_s);
    let waves = (1..20).filter(|wave| f64::from(*wave) <= most).count().max(1);
    let wave = |speed: f64, turn: f64| {
        [[speed, turn, 0.5 * half_s], [speed, -turn, half_s], [speed, turn, 0.5 * half_s]]
    };
    let mut rows: Manoeuvre = (0..waves).flat_map(|_| wave(speed, 0.8 * turn)).collect();
    rows.push(PAUSE);
    rows.extend((0..waves).flat_map(|_| wave(-speed, -0.8 * turn)));
    rows.push(PAUSE);
    rows
}

/// Two circles in opposite senses.
fn eight(limits: &Limits, speed: f64) -> Manoeuvre {
    let radius_m = limits.radius(0.45 * limits.reach_m);
    let (yaw_rate, lasts_s) = (speed.abs() / radius_m, TAU * radius_m / speed.abs());
    vec![[speed, yaw_rate, lasts_s], [speed, -yaw_rate, lasts_s], PAUSE]
}

/// A square; a car rounds its corners.
fn square(limits: &Limits, speed: f64, sense: f64) -> Manoeuvre {
    let corner = if limits.tightest_m.is_none() {
        let turn = 0.7 * limits.yaw_rate_rad_s;
        vec![[0.0, 0.0, 0.5], [0.0, sense * turn, FRAC_PI_2 / turn], [0.0, 0.0, 0.5]]
    } else {
        let yaw_rate = speed / limits.radius(0.0);
        vec![[speed, sense * yaw_rate, FRAC_PI_2 / yaw_rate]]
    };
    let rounded_m = limits.tightest_m.map_or(0.0, |_| 2.0 * limits.radius(0.0));
    let side_m = (1.2 * limits.reach_m - rounded_m).max(0.1);
    let side = std::iter::once([speed, 0.0, side_m / speed]).chain(corner);
    (0..4).flat_map(|_| side.clone()).chain([PAUSE]).collect()
}

/// Where a manoeuvre leads from `start`, without lag and slip: `[x_min, x_max, y_min, y_max]`.
pub(super) fn extent(rows: &[[f64; 3]], start: Pose<f64>) -> [f64; 4] {
    let mut pose = start;
    let mut bounds = [pose.x_m, pose.x_m, pose.y_m, pose.y_m];
    for &[speed, yaw_rate, lasts_s] in rows {
        // Bends are followed in steps of a tenth of a radian.
        let steps = (10.0 * yaw_rate.abs() * lasts_s).ceil().max(1.0);
        let step_s = lasts_s / steps;
        let mut done = 0.0;
        while done < steps {
            pose = pose.compose(&Pose::exp(speed * step_s, 0.0, yaw_rate * step_s));
            bounds = [
                bounds[0].min(pose.x_m),
                bounds[1].max(pose.x_m),
                bounds[2].min(pose.y_m),
                bounds[3].max(pose.y_m),
            ];
            done += 1.0;
        }
    }
    bounds
}
