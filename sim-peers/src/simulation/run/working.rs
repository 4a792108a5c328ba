//! A team at work for hours, to see what it keeps.

use pleiad_agent::{Node, Record};
use pleiad_estimation::{RobotId, Timestamp};

use super::super::Options;
use super::super::check::{Checks, Violation};
use super::super::network::Weather;
use super::super::plan::{Blow, Plan};
use super::Run;

/// What a team keeps after so long: each number of the robot that keeps most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hour {
    /// Virtual time, h.
    pub hour: f64,
    /// Most entries, facts and answers in memory at a time since the last report.
    pub kept: usize,
    /// Entries in memory now.
    pub entries: usize,
    /// Facts in memory now.
    pub facts_kept: usize,
    /// Odometry states in memory now.
    pub ticks: usize,
    /// Most records in the journal since the last report.
    pub records: usize,
    /// Bytes of the journal now.
    pub journal_bytes: usize,
    /// Observations of the last robot that wait for its answer.
    pub pending: usize,
    /// Facts used so far.
    pub facts: usize,
    /// Cuts closed so far, by all robots together.
    pub cuts: u64,
}

/// A team that simply works for hours, on links that lose a tenth; `report` is told what it keeps. The last
/// robot is out of reach of the others while it is `away`, from one hour to another.
///
/// # Errors
/// As [`super::run`].
pub fn operate(
    robots: u32,
    hours: f64,
    away: Option<(f64, f64)>,
    mut report: impl FnMut(Hour),
) -> Result<(), Violation> {
    let weather = Weather { loss: 0.1, burst: 5.0, delay_s: 0.01, jitter_s: 0.05, repeated: 0.05 };
    let options = Options::default();
    let blows = away.map_or_else(Vec::new, |(from, to)| {
        let sides = (1..=robots).map(|number| u32::from(number == robots)).collect();
        vec![(from * 3600.0, Blow::Partition(sides)), (to * 3600.0, Blow::Heal)]
    });
    let plan = Plan {
        robots,
        seconds: hours * 3600.0,
        cell_s: Some(5.0),
        evict_after_s: None,
        most_items: None,
        relinearize: false,
        calibrate: false,
        rebase_m: 300.0,
        weather,
        blows,
    };
    let mut run = Run::new(1, plan, &options);
    run.checks = Checks::new(robots).for_long();
    run.set_up()?;
    let steps = (hours * 4.0).ceil();
    let mut step = 0.0;
    while step < steps {
        step += 1.0;
        run.until(Timestamp::from_seconds(hours * 3600.0 * step / steps))?;
        let most = |count: fn(&Node) -> usize| {
            run.robots.values().filter_map(|robot| robot.node.as_ref()).map(count).max().unwrap_or(0)
        };
        let nodes = run.robots.values().filter_map(|robot| robot.node.as_ref());
        let pending = nodes.map(|node| node.ledger().pending_of(RobotId(robots))).max().unwrap_or(0);
        let journal_bytes = run.robots.values().map(|robot| robot.disk.bytes()).max().unwrap_or(0);
        report(Hour {
            hour: hours * step / steps,
            kept: run.checks.most_kept,
            entries: most(entries),
            facts_kept: most(|node| node.ledger().facts().count()),
            ticks: most(ticks),
            records: run.outcome.most_records,
            journal_bytes,
            pending,
            facts: most(|node| node.ledger().counts().used),
            cuts: run.checks.cuts,
        });
        run.checks.most_kept = 0;
        run.outcome.most_records = 0;
    }
    Ok(())
}

fn entries(node: &Node) -> usize {
    let ledger = node.ledger();
    ledger.digests().map(|digest| ledger.entries(digest.log, digest.first).len()).sum()
}

fn ticks(node: &Node) -> usize {
    node.compacted().iter().filter(|record| matches!(record, Record::Tick { .. })).count()
}
