//! `pleiad effects`: the catalogue of physics that a simulation can leave out.

use std::fmt::Write as _;

use anyhow::bail;
use pleiad_physics::{Effect, Floors};
use serde::Serialize;

use crate::cli::EffectsArgs;
use crate::output;

#[derive(Debug, Serialize)]
struct EffectsJson {
    effects: Vec<EffectJson>,
}

#[derive(Debug, Serialize)]
struct EffectJson {
    number: u8,
    name: &'static str,
    summary: &'static str,
    stage: &'static str,
    bad_data: bool,
    parameters: Vec<ParameterJson>,
    channels: Vec<&'static str>,
    equation: &'static str,
    confounded_with: &'static str,
    broken_by: &'static str,
}

#[derive(Debug, Serialize)]
struct ParameterJson {
    name: String,
    unit: &'static str,
    off: f64,
    typical: f64,
    plausible: (f64, f64),
    /// Without declared floors; a recording that declares some raises it.
    relevance_threshold: f64,
}

pub fn run(args: &EffectsArgs) -> anyhow::Result<()> {
    let chosen: Vec<Effect> = match &args.name {
        None => Effect::ALL.to_vec(),
        Some(name) => vec![find(name)?],
    };
    let effects: Vec<EffectJson> = chosen.into_iter().map(describe).collect();
    let text = text(&effects, args.name.is_some());
    output::print(args.json, &EffectsJson { effects }, &text)
}

fn find(name: &str) -> anyhow::Result<Effect> {
    if let Some(effect) = Effect::from_name(name) {
        return Ok(effect);
    }
    let near: Vec<_> =
        Effect::ALL.iter().map(|effect| effect.name()).filter(|known| shares_word(known, name)).collect();
    if near.is_empty() {
        bail!("there is no effect {name:?}; `pleiad effects` lists them all");
    }
    bail!("there is no effect {name:?}; did you mean {}?", near.join(" or "))
}

fn shares_word(known: &str, name: &str) -> bool {
    name.split(['_', '-', ' ']).any(|word| word.len() > 3 && known.contains(word))
}

fn describe(effect: Effect) -> EffectJson {
    let info = effect.info();
    let parameters =
        info.parameters.iter().zip(effect.typical_values()).map(|(parameter, typical)| ParameterJson {
            name: parameter.label(),
            unit: parameter.unit,
            off: parameter.off,
            typical,
            plausible: parameter.plausible,
            relevance_threshold: parameter.relevance.threshold(&Floors::default()),
        });
    EffectJson {
        number: info.number,
        name: info.name,
        summary: info.summary,
        stage: info.stage.name(),
        bad_data: info.bad_data,
        parameters: parameters.collect(),
        channels: info.channels.iter().map(|channel| channel.name()).collect(),
        equation: info.equation,
        confounded_with: info.confounded_with,
        broken_by: info.broken_by,
    }
}

fn text(effects: &[EffectJson], whole: bool) -> String {
    let mut text = String::new();
    for effect in effects {
        let _ = writeln!(
            text,
            "{:>2}  {:<30} {:<9} {}",
            effect.number, effect.name, effect.stage, effect.equation
        );
        if whole {
            let _ = writeln!(text, "\n    {}", effect.summary);
            for parameter in &effect.parameters {
                let _ = writeln!(
                    text,
                    "    {} [{}]: typical {}, plausible {} to {}",
                    parameter.name,
                    parameter.unit,
                    parameter.typical,
                    parameter.plausible.0,
                    parameter.plausible.1
                );
            }
            let _ = writeln!(text, "    needs: {}", effect.channels.join(", "));
            let _ = writeln!(text, "    confounded with: {}", effect.confounded_with);
            let _ = writeln!(text, "    broken by: {}", effect.broken_by);
            if effect.bad_data {
                let _ = writeln!(text, "    says that data are bad rather than that physics was left out");
            }
        }
    }
    text
}
