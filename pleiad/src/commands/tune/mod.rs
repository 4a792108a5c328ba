//! `pleiad tune`: the noise levels under which a recording is likeliest, without its ground truth.

mod gather;
mod result;
mod search;
mod words;

use std::time::Instant;

use anyhow::bail;
use pleiad_estimation::likelihood::{Level, largest_reading_m};

use crate::cli::{AlsoArg, ErrorArg, FilterArgs, TuneArgs};
use crate::setup::{self, Input, ReplayOptions};
use crate::{levels, output};

/// What a level begins with that is asked for and zero.
const BEGINNING: f64 = 0.03;

pub fn run(args: &TuneArgs) -> anyhow::Result<()> {
    let began = Instant::now();
    let input = setup::open(&args.recording, args.reading.mapping.as_deref(), args.reading.skip_bad_rows)?;
    let Input { recording, ingest, folder, .. } = &input;
    let options = ReplayOptions {
        filter: FilterArgs::exact(ErrorArg::Invariant),
        landmarks: &args.landmarks,
        absolute: &[],
        start_s: args.start,
        seconds: args.seconds,
        seed: 0,
        noise: args.noise.as_deref(),
        model: args.model.as_deref(),
        folder,
        mrclam: ingest.form == pleiad_recording::Form::Mrclam,
    };
    let team = setup::recorded(recording, &options)?;
    let spinner = output::spinner(&format!("{}: facts", recording.name));
    let gathered = gather::gather(&team)?;
    let there = search::in_facts(&gathered.facts);
    if !there.iter().any(|level| !level.is_motion()) {
        bail!(
            "{} holds no observation that could be used: noise shows in what robots see of each other, of \
             landmarks and of the map; look at the notices of `pleiad replay`, or leave --landmarks as it is",
            recording.name
        );
    }
    let mut start = gathered.start;
    let asked = match &args.also {
        AlsoArg::Auto => &[][..],
        AlsoArg::Only(asked) => asked,
    };
    for level in asked {
        if !there.contains(level) || !gathered.stated.contains(level) {
            bail!("--also {}: the recording has no observation with such a noise", levels::key(*level));
        }
        if start[*level] == 0.0 {
            start[*level] = BEGINNING;
        }
    }
    let (free, zero): (Vec<Level>, Vec<Level>) = there
        .into_iter()
        .filter(|level| gathered.stated.contains(level))
        .partition(|level| start[*level] > 0.0);
    let candidates = if args.also == AlsoArg::Auto { zero } else { Vec::new() };
    let reach_m = largest_reading_m(&gathered.facts).unwrap_or(1.0);
    let said = |what: String| spinner.set_message(format!("{}: {what}", recording.name));
    let found = search::search(&gathered.facts, start, (free, candidates), reach_m, &said);
    spinner.finish_and_clear();
    let json = result::judged(&recording.name, &team, &gathered, found, reach_m, began)?;
    if let Some(out) = &args.out {
        result::write(out, &json)?;
    }
    output::print(args.json, &json, &words::text(&json))
}
