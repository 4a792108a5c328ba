//! An effect of spread that is known to act, fitted.

use pleiad_estimation::RobotId;
use pleiad_physics::Effect;

use crate::diagnosis::fit::Fit;
use crate::diagnosis::naming::Estimated;
use crate::diagnosis::spread::judge::estimated;
use crate::diagnosis::spread::{EFFECTS, executed, missed, of_robot, sighted, swaps, ticks, walk};
use crate::diagnosis::unit::Unit;

/// Whether an effect is one of spread or chance, which shows in no mean.
pub(crate) fn is_of_spread(effect: Effect) -> bool {
    EFFECTS.contains(&effect)
}

/// The parameters of an effect that acts on a robot, beside a fit of the mean. `None` if nothing shows it.
pub(crate) fn known(units: &[&Unit<'_>], fit: &Fit, effect: Effect, robot: RobotId) -> Option<Estimated> {
    let own = of_robot(units, robot);
    if effect == Effect::EncoderCoarse {
        return ticks::coarse(&own, robot, 1)?.judged.estimated.into_iter().next();
    }
    let family = match effect {
        Effect::MissedDetections => missed::family(&own, fit, sighted::displaced(&own, 0.0)),
        Effect::GyroRandomWalk => walk::family(&own, fit),
        Effect::CommandJitter | Effect::CommandLoss => executed::family(&own, fit),
        _ => sighted::family(&own, fit),
    }?;
    let member = family.members.iter().position(|member| member.effect == effect)?;
    let with = family.fit(&[member], &family.base(), &|_| true);
    let known = family.known(&[member], &with)?;
    Some(estimated(&family.members[member], robot, &with, &known))
}

/// The names of landmarks that are exchanged, if any are. The sightings of the units bear the right names
/// afterwards.
pub(crate) fn known_swap(units: &mut [Unit<'_>]) -> Option<Estimated> {
    swaps(units).terms(1).into_iter().next()?.judged.estimated.into_iter().next()
}
