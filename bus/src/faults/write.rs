//! Faults written as they are read.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use pleiad_protocol::RobotId;

use super::plan::{Fault, FaultPlan, Rule};

impl FaultPlan {
    /// The `[[fault]]` tables from which [`FaultPlan::from_toml`] reads this plan.
    pub fn to_toml(&self) -> String {
        let tables: Vec<String> = self.rules.iter().map(table).collect();
        tables.join("\n")
    }
}

fn table(rule: &Rule) -> String {
    let mut text = format!("[[fault]]\nwhat = \"{}\"\n", rule.fault.word());
    // Writing to a text cannot fail.
    let mut line = |key: &str, value: String| {
        let _ = writeln!(text, "{key} = {value}");
    };
    match &rule.fault {
        Fault::Loss { loss } => line("loss", number(*loss)),
        Fault::Burst { loss, mean_length } => {
            line("loss", number(*loss));
            line("mean_length", number(*mean_length));
        }
        Fault::Delay { delay_s, jitter_s } => {
            line("delay_s", number(*delay_s));
            line("jitter_s", number(*jitter_s));
        }
        Fault::Reorder { probability, by_s } => {
            line("probability", number(*probability));
            line("by_s", number(*by_s));
        }
        Fault::Duplicate { probability, within_s } => {
            line("probability", number(*probability));
            line("within_s", number(*within_s));
        }
        Fault::Corrupt { probability, bytes } => {
            line("probability", number(*probability));
            line("bytes", bytes.to_string());
        }
        Fault::Partition { groups } => {
            if !groups.is_empty() {
                let groups: Vec<String> = groups.iter().map(robots).collect();
                line("groups", format!("[{}]", groups.join(", ")));
            }
        }
        Fault::Slow { messages_per_s, queue } => {
            line("messages_per_s", number(*messages_per_s));
            line("queue", queue.to_string());
        }
        Fault::Clock { offset_s, drift_ppm } => {
            line("offset_s", number(*offset_s));
            line("drift_ppm", number(*drift_ppm));
        }
        Fault::Away { robots: named }
        | Fault::Kill { robots: named }
        | Fault::Stop { robots: named }
        | Fault::DiskFull { robots: named } => {
            if !named.is_empty() {
                line("robots", robots(named));
            }
        }
        Fault::Cut | Fault::CoordinatorDies => {}
    }
    for (key, among) in [("from", &rule.from), ("to", &rule.to)] {
        if !among.is_empty() {
            line(key, robots(among));
        }
    }
    if !rule.messages.is_empty() {
        let kinds: Vec<String> = rule.messages.iter().map(|kind| format!("{kind:?}")).collect();
        line("messages", format!("[{}]", kinds.join(", ")));
    }
    line("start_s", number(rule.start_s));
    if rule.end_s.is_finite() {
        line("end_s", number(rule.end_s));
    }
    if let Some(again) = rule.again {
        line("every_s", number(again.every_s));
        line("for_s", number(again.for_s));
    }
    text
}

/// The shortest decimal number that is read as the same one; with a point, as TOML asks of such a number.
fn number(value: f64) -> String {
    format!("{value:?}")
}

fn robots(robots: &BTreeSet<RobotId>) -> String {
    let numbers: Vec<String> = robots.iter().map(ToString::to_string).collect();
    format!("[{}]", numbers.join(", "))
}
