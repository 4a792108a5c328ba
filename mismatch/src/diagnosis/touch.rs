//! Which channels of residuals an effect can show in.

use pleiad_physics::{Channel as Needed, Effect, EffectInfo, Stage};

use crate::channel::Channel;

/// Whether an effect can show in a channel, by its stage and the channels it needs. Cheap, and never too
/// narrow: what does not show has derivatives of zero.
pub(crate) fn touches(effect: Effect, channel: Channel) -> bool {
    let info = effect.info();
    let needs = |needed: Needed| info.channels.contains(&needed);
    match channel {
        Channel::Actuator => needs(Needed::Command),
        Channel::CommandedBody => needs(Needed::Command) || moves_body(info) || sees_truth(info),
        Channel::Body => moves_body(info) || sees_truth(info),
        Channel::Gyro => needs(Needed::Gyro) || moves_body(info),
        Channel::Gps => needs(Needed::Gps) || sees_truth(info),
        Channel::Heading => needs(Needed::Heading) || sees_truth(info),
        Channel::RangeToLandmark
        | Channel::BearingToLandmark
        | Channel::RangeToRobot
        | Channel::BearingToRobot => needs(Needed::Relative) || sees_truth(info),
    }
}

/// Acts between the turning of the wheels and the motion of the body.
fn moves_body(info: &EffectInfo) -> bool {
    info.channels.contains(&Needed::Encoders) && info.channels.contains(&Needed::Truth)
}

/// Acts on the reference system or on clocks: on all that is compared with truth.
fn sees_truth(info: &EffectInfo) -> bool {
    info.channels == [Needed::Truth] || info.stage == Stage::Clock
}
