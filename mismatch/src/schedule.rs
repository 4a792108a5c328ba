//! Commands in the order in which they act, walked through window by window.

use pleiad_physics::chain::actuator::{Command, Scheduled, schedule};
use pleiad_physics::predict::CommandWindow;
use pleiad_physics::{Chance, RobotModel, Scalar};

/// The commands of a whole recording. Windows ask for their part, so that no step of a window searches
/// the whole.
pub(crate) struct Schedule<S> {
    scheduled: Vec<Scheduled<S>>,
    /// The last command that acts when the window asked for last begins.
    begun: usize,
}

impl<S: Scalar> Schedule<S> {
    pub(crate) fn new(model: &RobotModel<S>, commands: &[Command]) -> Self {
        Self { scheduled: schedule(model, commands, |_| Chance::EXPECTED), begun: 0 }
    }

    /// All of them.
    pub(crate) fn all(&self) -> &[Scheduled<S>] {
        &self.scheduled
    }

    /// The commands that act in a window. Ask for windows in the order of time.
    pub(crate) fn within(&mut self, window: &CommandWindow) -> &[Scheduled<S>] {
        let rest = &self.scheduled[self.begun..];
        let started = rest.iter().take_while(|command| command.from_s <= window.from_s).count();
        self.begun += started.saturating_sub(1);
        let rest = &self.scheduled[self.begun..];
        let past = rest.iter().take_while(|command| command.from_s < window.to_s).count();
        &rest[..past]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pleiad_physics::{Drive, Motion, Nominal, Pose, Surroundings};

    #[test]
    fn a_window_gets_the_command_that_holds_and_those_that_come() {
        let model: RobotModel<f64> = RobotModel::nominal(Drive::Differential, Nominal::ideal(1.0, 1.0));
        let commands =
            [1.0, 2.0, 3.0, 4.0].map(|time_s| Command { time_s, speed_m_s: time_s, yaw_rate_rad_s: 0.0 });
        let mut schedule = Schedule::new(&model, &commands);
        let mut speeds = |from_s, to_s| {
            let motion = Motion::at_rest(Pose::identity());
            let window = CommandWindow { from_s, to_s, motion, surroundings: Surroundings::default() };
            schedule.within(&window).iter().map(|own| own.command.speed_m_s).collect::<Vec<_>>()
        };
        assert!(speeds(0.0, 0.5).is_empty());
        assert_eq!(speeds(0.5, 1.5), [1.0]);
        assert_eq!(speeds(2.0, 2.5), [2.0]);
        assert_eq!(speeds(2.5, 4.5), [2.0, 3.0, 4.0]);
        assert_eq!(speeds(9.0, 9.5), [4.0]);
    }
}
