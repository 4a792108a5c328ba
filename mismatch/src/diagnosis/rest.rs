//! Names where much is left unexplained.
//!
//! What the catalogue lacks is taken for what it has: a delay that it does not know for a lag, of which a part fits. The
//! part is significant and generalizes. What gives it away is how much is left: the same sensors on the other robots
//! leave a fraction of it.

use std::collections::BTreeMap;

use pleiad_estimation::RobotId;

use crate::channel::Channel;
use crate::diagnosis::fit::Fit;
use crate::diagnosis::run::Judgement;
use crate::diagnosis::unit::Unit;

/// So many times what is left of the others, in root mean square, is no noise. Sensors of one kind differ by less.
const TIMES: f64 = 4.0;

/// Residuals of a robot that are far larger than those of the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rest {
    pub(crate) robot: RobotId,
    pub(crate) channel: Channel,
    /// Over the median of the other robots.
    pub(crate) times: f64,
}

/// Makes of names what cannot be told, on robots of which much is left in some channel that nothing else accounts for
/// (`told`: an effect of spread, or a form).
pub(crate) fn doubt(
    units: &[&Unit<'_>],
    fit: &Fit,
    told: &dyn Fn(RobotId, Channel) -> bool,
    judgements: &mut [Judgement],
    notes: &mut Vec<String>,
) {
    // Innovations of a mesh are not a robot's alone.
    if units.iter().any(|unit| unit.mesh.is_some()) {
        return;
    }
    for rest in rests(&squares(units, fit)) {
        if told(rest.robot, rest.channel) {
            continue;
        }
        let doubted = judgements.iter_mut().filter(|own| {
            let robots = || own.support.units.iter().map(|&unit| units[unit].robot());
            own.claims() && robots().all(|robot| robot == rest.robot)
        });
        let mut any = false;
        for own in doubted {
            own.doubt([format!("something else in {}", rest.channel.name())]);
            any = true;
        }
        if any {
            notes.push(format!(
                "robot {}, {}: what is left is {:.0} times what is left of the other robots: something is missing that \
                 neither the catalogue nor a form describes, and names of this robot may stand in for it",
                rest.robot,
                rest.channel.name(),
                rest.times
            ));
        }
    }
}

/// Mean square of what is left by channel and component, of every robot.
type Squares = BTreeMap<(Channel, usize), BTreeMap<RobotId, f64>>;

fn squares(units: &[&Unit<'_>], fit: &Fit) -> Squares {
    let mut sums: BTreeMap<(Channel, usize), BTreeMap<RobotId, (f64, f64)>> = BTreeMap::new();
    for (unit, state) in units.iter().zip(&fit.states) {
        for (&scale, residual) in unit.scale_of.iter().zip(&state.residuals) {
            let own = sums.entry(unit.scales[scale]).or_default().entry(unit.robot()).or_default();
            own.0 += residual * residual;
            own.1 += 1.0;
        }
    }
    let mean = |robots: BTreeMap<RobotId, (f64, f64)>| {
        robots.into_iter().map(|(robot, (sum, count))| (robot, sum / count)).collect()
    };
    sums.into_iter().map(|(scale, robots)| (scale, mean(robots))).collect()
}

/// The robots with far more left than the others, each channel once.
fn rests(squares: &Squares) -> Vec<Rest> {
    let mut all: Vec<Rest> = Vec::new();
    for ((channel, _), robots) in squares {
        for (&robot, own) in robots {
            let mut others: Vec<f64> =
                robots.iter().filter(|(other, _)| **other != robot).map(|(_, square)| *square).collect();
            others.sort_by(f64::total_cmp);
            let Some(&median) = others.get(others.len() / 2) else { continue };
            let times = (own / median).sqrt();
            let known = all.iter().any(|rest| rest.robot == robot && rest.channel == *channel);
            if times > TIMES && times.is_finite() && !known {
                all.push(Rest { robot, channel: *channel, times });
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(squares: &[f64]) -> Squares {
        let robots = (1..).map(RobotId).zip(squares.iter().copied()).collect();
        BTreeMap::from([((Channel::Gyro, 0), robots)])
    }

    #[test]
    fn a_robot_with_five_times_the_residuals_of_two_others_stands_out_and_no_other_does() {
        let found = rests(&of(&[1.0, 25.0, 1.2]));
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].robot, found[0].channel), (RobotId(2), Channel::Gyro));
        // The larger of two others is their median: a robot is not held against the best of them.
        assert!((found[0].times - (25.0_f64 / 1.2).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn alike_robots_and_a_robot_alone_have_nothing_left() {
        assert_eq!(rests(&of(&[1.0, 9.0, 2.0])), []);
        assert_eq!(rests(&of(&[100.0])), []);
        assert_eq!(rests(&of(&[])), []);
    }
}
