//! `pleiad tune` for people.

use std::fmt::Write as _;

use super::result::{ALL, JudgedJson, TuneJson};

/// Three significant digits.
pub fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    #[allow(clippy::cast_possible_truncation, reason = "a power of ten of a number of moderate size")]
    let digits = (2 - value.abs().log10().floor() as i32).clamp(0, 9);
    #[allow(clippy::cast_sign_loss, reason = "clamped")]
    let digits = digits as usize;
    format!("{value:.digits$}")
}

/// What a row of the table says of a judgement.
type Row = (&'static str, fn(&JudgedJson) -> String);

pub fn text(json: &TuneJson) -> String {
    let mut text = format!(
        "{}: {} measurements, folded {} times in {:.0} s\n\n",
        json.recording, json.measurements, json.evaluations, json.seconds
    );
    let _ = writeln!(text, "{:<42} {:>9} {:>9}   95 % interval", "level", "start", "found");
    for level in &json.levels {
        let interval = match (level.interval_95, level.at_most) {
            (Some([low, high]), _) if level.smooth => format!("{} to {}", short(low), short(high)),
            (Some([low, high]), _) => format!("{} to {}, too narrow (see below)", short(low), short(high)),
            (None, Some(most)) => format!("at most {}", short(most)),
            (None, None) => "not determined".to_owned(),
        };
        let _ = writeln!(
            text,
            "{:<42} {:>9} {:>9}   {interval}",
            level.key,
            short(level.start),
            short(level.value)
        );
    }
    let interval = match json.outliers.interval_95 {
        Some([low, high]) => format!("{} to {}", short(low), short(high)),
        None => "none that could be told".to_owned(),
    };
    let _ = writeln!(
        text,
        "{:<42} {:>9} {:>9}   {interval}\n",
        "share of outliers",
        "",
        short(json.outliers.share)
    );
    let _ = writeln!(text, "{:<42} {:>9} {:>9}", "", "start", "found");
    let rows: [Row; 9] = [
        ("log-likelihood", |of| format!("{:.1}", of.log_likelihood)),
        ("NIS per degree of freedom, all", |of| format!("{:.2}", of.nis)),
        ("NIS per degree of freedom, used", |of| format!("{:.2}", of.nis_used)),
        ("NIS per degree of freedom, weighed", |of| format!("{:.2}", of.nis_weighed)),
        ("of nothing, by their probabilities", |of| format!("{:.1}", of.of_nothing)),
        ("share of the NIS that those have, %", |of| format!("{:.1}", 100.0 * of.nis_share_of_nothing)),
        ("median NIS over that of chi-square", |of| format!("{:.2}", of.nis_median)),
        ("within the 95 % bound, %", |of| format!("{:.1}", 100.0 * of.within_95)),
        ("refused by the gate", |of| of.rejected.to_string()),
    ];
    for (name, of) in rows {
        let _ = writeln!(text, "{name:<42} {:>9} {:>9}", of(&json.before), of(&json.after));
    }
    let [low, high] = json.after.nis_interval_95;
    let _ = writeln!(text, "95 % of consistent filters have a NIS of {low:.3} to {high:.3}\n");
    let reached = json.starts.iter().filter(|start| start.best).count();
    let _ = writeln!(
        text,
        "{reached} of {} starts ended in the maximum{}",
        json.starts.len(),
        if reached < json.starts.len() { "; others ended lower:" } else { "" }
    );
    for start in json.starts.iter().filter(|start| !start.best) {
        let _ = writeln!(
            text,
            "  motion x {:.2}, sensors x {:.2}: log-likelihood {:.1}{}",
            start.motion_factor,
            start.sensor_factor,
            start.log_likelihood,
            if start.converged { "" } else { ", not at its end" }
        );
    }
    for one in &json.tried {
        let verdict = if one.kept { "taken in" } else { "left out" };
        let _ =
            writeln!(text, "{}: raises the log-likelihood by {:.1}, {verdict}", one.key, one.gain.max(0.0));
    }
    for note in &json.notes {
        let _ = writeln!(text, "note: {note}");
    }
    for (robot, noise) in &json.noise {
        let whose = if robot == ALL { "noise" } else { &format!("noise of robot {robot}") };
        let _ = write!(text, "\n# {whose}\n{noise}");
    }
    text
}
