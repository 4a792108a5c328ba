//! Known changes of a real recording, as the fit finds them: real data hold what no simulation does, and
//! nobody knows how much of it; by how much it was changed is known exactly.

use pleiad_estimation::RobotId;
use pleiad_mismatch::{KnownParameter, fit_known};
use pleiad_physics::Effect;
use pleiad_recording::Recording;

use crate::changed;

/// An effect, the label of a parameter, and what becomes of its value.
pub type Move = (Effect, &'static str, fn(f64) -> f64);

/// A change of a recording with the structure in which it shows.
pub struct Change {
    /// In words.
    pub name: &'static str,
    /// The effects that are fitted.
    pub effects: &'static [Effect],
    /// The parameters that it moves: effect, label, and from what it was without the change to what it becomes.
    pub moves: &'static [Move],
    apply: fn(Recording) -> Recording,
}

/// What commands show without encoders, in the order in which it is fitted.
const DRIVEN: &[Effect] = &[Effect::TurnLoss, Effect::ActuatorGain, Effect::CommandDelay];

/// What shows when commands are late. A delay alone stands in for the robots' lag, and where it settles then
/// hangs on where the windows lie; the sum of both does not.
const LATE: &[Effect] = &[Effect::ActuatorLag, Effect::CommandDelay, Effect::TurnLoss, Effect::ActuatorGain];

/// The changes that are tried.
///
/// Commands that are a share `s` too large need a gain `g` for the same motion: `1 + g' = (1 + g) / (1 + s)`.
pub const CHANGES: &[Change] = &[
    Change {
        name: "forward commands x 1.03",
        effects: DRIVEN,
        moves: &[
            (Effect::ActuatorGain, "v_relative", |gain| (1.0 + gain) / 1.03 - 1.0),
            (Effect::ActuatorGain, "w_relative", |gain| gain),
        ],
        apply: |recording| changed::commands_scaled(recording, [1.03, 1.0]),
    },
    Change {
        name: "turn commands x 1.03",
        effects: DRIVEN,
        moves: &[
            (Effect::ActuatorGain, "v_relative", |gain| gain),
            (Effect::ActuatorGain, "w_relative", |gain| (1.0 + gain) / 1.03 - 1.0),
        ],
        apply: |recording| changed::commands_scaled(recording, [1.0, 1.03]),
    },
    Change {
        name: "commands stamped 0.08 s later",
        effects: LATE,
        moves: &[(Effect::CommandDelay, "total_s", |total_s| total_s - 0.08)],
        apply: |recording| changed::commands_later(recording, 0.08),
    },
    Change {
        name: "commands stamped 0.08 s earlier",
        effects: LATE,
        moves: &[(Effect::CommandDelay, "total_s", |total_s| total_s + 0.08)],
        apply: |recording| changed::commands_later(recording, -0.08),
    },
    Change {
        name: "bearings bent by 0.05 b^3",
        effects: &[Effect::SensorYawMisalignment, Effect::BearingDistortion],
        moves: &[
            (Effect::BearingDistortion, "c1", |c1| c1),
            (Effect::BearingDistortion, "c3", |c3| c3 + 0.05),
        ],
        apply: |recording| changed::bearings_bent(recording, 0.0, 0.05),
    },
    Change {
        name: "ranges 0.05 m longer",
        effects: &[Effect::RangeScale, Effect::RangeBias],
        moves: &[
            (Effect::RangeBias, "bias_m", |bias_m| bias_m + 0.05),
            (Effect::RangeScale, "relative", |scale| scale),
        ],
        apply: |recording| changed::ranges_biased(recording, 0.05),
    },
];

/// A parameter of a robot without and with a change.
pub struct Difference {
    /// Which change.
    pub change: &'static str,
    /// Which robot.
    pub robot: RobotId,
    /// Which parameter.
    pub parameter: &'static str,
    /// The estimate without the change.
    pub unchanged: f64,
    /// The estimate with it.
    pub changed: f64,
    /// By how much the change moves the parameter.
    pub injected: f64,
    /// Half of the wider of the two 95 % intervals.
    pub half_width: f64,
}

impl Difference {
    /// By how much the estimate was moved.
    pub fn found(&self) -> f64 {
        self.changed - self.unchanged
    }
}

/// Applies a change and fits its structure to every robot, without and with it.
///
/// # Panics
/// The recording cannot be compared, or shows nothing of the structure.
pub fn differences(recording: &Recording, change: &Change) -> Vec<Difference> {
    let with = (change.apply)(recording.clone());
    let one = |&robot: &RobotId| {
        let fits = [recording, &with]
            .map(|recording| fit_known(recording, robot, change.effects).expect("models of a recording"));
        let of = |which: usize, effect: Effect, label: &str| -> &KnownParameter {
            let fit = fits[which].iter().find(|fit| fit.effect == effect);
            let parameter = fit.and_then(|fit| {
                let total = fit.total.as_ref().filter(|total| total.label == label);
                fit.parameter(label).or(total)
            });
            parameter.unwrap_or_else(|| panic!("{effect:?} does not show on robot {robot}"))
        };
        let one = |&(effect, label, moved): &(Effect, &'static str, fn(f64) -> f64)| {
            let [unchanged, changed] = [0, 1].map(|which| of(which, effect, label));
            let half = |own: &KnownParameter| own.ci95.map_or(f64::NAN, |[low, high]| 0.5 * (high - low));
            Difference {
                change: change.name,
                robot,
                parameter: label,
                unchanged: unchanged.value,
                changed: changed.value,
                injected: moved(unchanged.value) - unchanged.value,
                half_width: half(unchanged).max(half(changed)),
            }
        };
        change.moves.iter().map(one).collect::<Vec<_>>()
    };
    recording.robots.keys().flat_map(one).collect()
}
