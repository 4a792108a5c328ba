//! Which cases there are.

use pleiad_physics::Effect;

use super::inject::has_size;
use super::{Plan, What};
use crate::class::{Asked, Class, Noise};

/// Sizes of single effects over the typical ones.
const SIZES: [f64; 3] = [0.3, 1.0, 3.0];

/// Effects that a value of the nominal model is tuned to hide.
pub(super) const ABSORBED: [Effect; 4] =
    [Effect::PayloadAdded, Effect::SpeedDependentScale, Effect::ReverseAsymmetry, Effect::GyroThermalDrift];
/// The first of two that cancel.
const CANCELLING: [Effect; 3] = [Effect::RangeBias, Effect::WheelRadiusError, Effect::SensorYawMisalignment];
/// A small effect and a large one of the same robot, in the same channel.
const BURIED: [(Effect, Effect); 5] = [
    (Effect::UnequalWheelRadii, Effect::TrackWidthError),
    (Effect::ReverseAsymmetry, Effect::WheelRadiusError),
    (Effect::IcrOffset, Effect::LateralSkid),
    (Effect::RangeScale, Effect::RangeBias),
    (Effect::GyroScale, Effect::GyroBias),
];
/// Effects of a place, an instant, or a few seconds.
const RARE: [Effect; 5] = [
    Effect::LowFrictionPatch,
    Effect::LocalMagneticField,
    Effect::GpsMultipathPatch,
    Effect::Push,
    Effect::LongitudinalSlip,
];
/// Effects that circling at one speed cannot tell from others.
const CIRCLING: [Effect; 4] =
    [Effect::TrackWidthError, Effect::UnequalWheelRadii, Effect::WheelRadiusError, Effect::GyroScale];

/// The cases of classes, seed by seed: of each as many seeds as it asks for, or so many.
pub fn plans(asked: &[Asked], first_seed: u64, seeds: u64) -> Vec<Plan> {
    let most = asked.iter().map(|own| own.seeds.unwrap_or(seeds)).max().unwrap_or(0);
    let mut all = Vec::new();
    for index in 0..most {
        let seed = first_seed.saturating_add(index);
        for own in asked.iter().filter(|own| index < own.seeds.unwrap_or(seeds)) {
            let class = own.class;
            for (name, noise, what) in of(class) {
                let id = format!("{class}/{name}/{noise}/{seed}");
                all.push(Plan { id, class, noise, what });
            }
        }
    }
    all
}

fn of(class: Class) -> Vec<(String, Noise, What)> {
    let named = |noise: Noise, make: fn(Effect) -> What| {
        move |&effect: &Effect| (effect.name().to_owned(), noise, make(effect))
    };
    match class {
        Class::Clean => [Noise::White, Noise::Coloured, Noise::HeavyTailed]
            .map(|noise| ("nothing".to_owned(), noise, What::Nothing))
            .to_vec(),
        Class::Single => {
            let mut all = Vec::new();
            for noise in [Noise::White, Noise::Coloured] {
                for size in SIZES {
                    for &effect in Effect::ALL {
                        #[allow(clippy::float_cmp, reason = "one of the constants above")]
                        if has_size(effect) || size == 1.0 {
                            let name = format!("{}/x{size}", effect.name());
                            all.push((name, noise, What::Effect { effect, size }));
                        }
                    }
                }
            }
            all
        }
        Class::Masked => vec![("square".to_owned(), Noise::Quiet, What::Masked)],
        Class::Absorbed => ABSORBED.iter().map(named(Noise::White, What::Absorbed)).collect(),
        Class::Cancelling => CANCELLING.iter().map(named(Noise::White, What::Cancelling)).collect(),
        Class::Buried => BURIED
            .iter()
            .map(|&(small, large)| {
                let name = format!("{}_under_{}", small.name(), large.name());
                (name, Noise::Coloured, What::Buried { small, large })
            })
            .collect(),
        Class::Rare => RARE.iter().map(named(Noise::White, What::Rare)).collect(),
        Class::OutOfCatalogue => Effect::ALL.iter().map(named(Noise::White, What::LeftOut)).collect(),
        Class::Unidentifiable => CIRCLING.iter().map(named(Noise::White, What::Circling)).collect(),
        Class::Decoy => {
            let decoys = Effect::ALL.iter().filter(|effect| effect.info().bad_data);
            decoys.map(named(Noise::White, |effect| What::Effect { effect, size: 1.0 })).collect()
        }
    }
}
