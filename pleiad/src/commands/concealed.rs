//! `pleiad benchmark concealed`: the diagnosis where the answers are known.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Context;
use pleiad_benchmark::{
    ABLATIONS, Asked, Class, Options, Outcome, Summary, chosen, page, run as run_cases, summary,
};
use pleiad_report::write_summary;

use crate::cli::ConcealedArgs;
use crate::{folder, output};

pub fn run(args: &ConcealedArgs) -> anyhow::Result<()> {
    let mut options = Options {
        classes: if args.class.is_empty() {
            Class::ALL.map(Asked::from).to_vec()
        } else {
            args.class.clone()
        },
        first_seed: args.first_seed,
        seeds: args.seeds,
        only: args.only.clone(),
        resume: args.resume,
        ablations: match args.ablations.as_deref() {
            None => Vec::new(),
            Some([]) => ABLATIONS.map(str::to_owned).to_vec(),
            Some(names) => names.to_vec(),
        },
        baselines: !args.no_baselines,
        folder: Path::new("").to_owned(),
    };
    // What cannot be run is told before a folder is made.
    chosen(&options)?;
    options.folder = match (&args.out, args.resume) {
        (Some(out), true) => out.clone(),
        (out, _) => folder::create(out.as_deref(), "concealed")?,
    };
    let spinner = output::spinner("sealing the answers");
    let outcome = run_cases(&options, &mut |line| {
        tracing::info!("{line}");
        spinner.set_message(line.to_owned());
    })?;
    spinner.finish_and_clear();
    let summary = summary(&outcome.sealed, &outcome.results);
    write_summary(&options.folder.join("summary.json"), &summary)?;
    let file = options.folder.join("concealed.md");
    std::fs::write(&file, page(&summary, &command(args)))
        .with_context(|| format!("cannot write {}", file.display()))?;
    output::print(args.json, &summary, &text(&outcome, &summary, &options.folder))
}

/// The command as it is given again.
fn command(args: &ConcealedArgs) -> String {
    let mut text = format!("pleiad benchmark concealed --seeds {}", args.seeds);
    // Writing to a string cannot fail.
    if args.first_seed != 1 {
        let _ = write!(text, " --first-seed {}", args.first_seed);
    }
    if !args.class.is_empty() {
        let names: Vec<String> = args.class.iter().map(ToString::to_string).collect();
        let _ = write!(text, " --class {}", names.join(" "));
    }
    if !args.only.is_empty() {
        let _ = write!(text, " --only {}", args.only.join(" "));
    }
    if let Some(names) = &args.ablations {
        text += " --ablations ";
        text += &names.join(",");
    }
    if args.no_baselines {
        text += " --no-baselines";
    }
    text
}

fn text(outcome: &Outcome, summary: &Summary, folder: &Path) -> String {
    let mut text = format!("{} recordings", summary.recordings);
    if outcome.resumed > 0 {
        let _ = write!(text, ", {} of them diagnosed before", outcome.resumed);
    }
    text += "\n";
    for row in summary.rows.iter().filter(|row| row.method == "tool") {
        let size = row.size.map_or_else(String::new, |size| format!(" x{size}"));
        let _ = write!(text, "{:16} {:12} {:5} {:52} ", row.class, row.noise, size, row.quantity);
        let _ = match (&row.share, &row.mean) {
            (Some(own), _) => writeln!(
                text,
                "{} of {} ({:.1} to {:.1} %)",
                own.count,
                own.of,
                100.0 * own.interval[0],
                100.0 * own.interval[1]
            ),
            (None, Some(own)) => writeln!(text, "{:.3} (median {:.3} of {})", own.mean, own.median, own.of),
            (None, None) => writeln!(text),
        };
    }
    let _ = writeln!(text, "losses: {}", summary.losses.len());
    let _ = writeln!(text, "answers {}, sealed before the first diagnosis", outcome.sealed);
    let _ = writeln!(text, "{}", folder.display());
    text
}
