//! `pleiad survey`: the systems that the joint filter grew from, each as a study.

use std::fmt::Write as _;

use anyhow::{Context, bail};
use pleiad_survey::{STUDIES, StudyOptions};

use super::study;
use crate::cli::SurveyArgs;
use crate::{folder, output};

pub fn run(args: &SurveyArgs) -> anyhow::Result<()> {
    let Some(name) = &args.study else {
        return output::raw(&list());
    };
    let Some(known) = STUDIES.iter().find(|known| known.name == name) else {
        bail!("there is no study {name:?}; there are:\n{}", list());
    };
    let out = folder::create(args.out.as_deref(), &format!("survey-{name}"))?;
    let spinner = output::spinner(&format!("{name}: {}", known.about));
    let study = (known.run)(&StudyOptions { seeds: args.seeds, first_seed: args.first_seed })?;
    spinner.finish_and_clear();
    let finished = study::finish(&study, &out, args.json, &command(name, args));
    match args.seeds {
        Some(seeds) if finished.is_err() => finished.with_context(|| {
            format!("with {seeds} seeds intervals may be too wide to bear a claim out; without --seeds there are enough")
        }),
        _ => finished,
    }
}

fn list() -> String {
    let mut text = String::new();
    for known in STUDIES {
        let _ = writeln!(text, "{:16} {}", known.name, known.about);
    }
    text
}

fn command(name: &str, args: &SurveyArgs) -> String {
    let mut command = format!("pleiad survey {name}");
    if let Some(seeds) = args.seeds {
        let _ = write!(command, " --seeds {seeds}");
    }
    if args.first_seed != 1 {
        let _ = write!(command, " --first-seed {}", args.first_seed);
    }
    command
}
