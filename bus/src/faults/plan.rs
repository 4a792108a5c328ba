//! Faults as rules: what goes wrong, on which directed links and kinds of messages, from when to when. A plan
//! is data; [`super::Injector`] applies it.

use std::collections::BTreeSet;

use pleiad_protocol::RobotId;

/// What goes wrong.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// Each message is lost with this probability, whatever became of those before it.
    Loss {
        /// 0 to 1.
        loss: f64,
    },
    /// Messages are lost in bursts (Gilbert 1960, Elliott 1963): a link is good or bad, a bad one loses
    /// everything, and either state lasts a geometrically distributed number of messages.
    Burst {
        /// Share of messages lost in the long run, 0 to below 1.
        loss: f64,
        /// Mean number of messages lost in a row, from 1.
        mean_length: f64,
    },
    /// Messages take this long, the jitter uniformly distributed; they overtake one another by it.
    Delay {
        /// Least, s.
        delay_s: f64,
        /// Further, s.
        jitter_s: f64,
    },
    /// A message is held back with this probability, so that later ones overtake it.
    Reorder {
        /// 0 to 1.
        probability: f64,
        /// For how long, s.
        by_s: f64,
    },
    /// A message arrives twice with this probability.
    Duplicate {
        /// 0 to 1.
        probability: f64,
        /// The second copy comes up to this much later, s.
        within_s: f64,
    },
    /// Bytes of a message are flipped with this probability.
    Corrupt {
        /// 0 to 1.
        probability: f64,
        /// How many bytes, from 1.
        bytes: u8,
    },
    /// Nothing passes: a one-way link, if `from` and `to` say so.
    Cut,
    /// The team falls into groups that do not reach one another; robots in no group are one more.
    Partition {
        /// The groups.
        groups: Vec<BTreeSet<RobotId>>,
    },
    /// These robots are out of everybody's range.
    Away {
        /// Who.
        robots: BTreeSet<RobotId>,
    },
    /// The receivers take so many messages a second; what does not fit into their queue is lost.
    Slow {
        /// Messages per second.
        messages_per_s: f64,
        /// How many may wait.
        queue: u32,
    },
    /// The clocks of the robots in `from` are ahead. It does not concern messages but the stamps of samples:
    /// [`FaultPlan::clock_error_s`].
    Clock {
        /// At the start of the fault, s.
        offset_s: f64,
        /// Growth, 1e-6.
        drift_ppm: f64,
    },
    /// The robots' processes are killed (SIGKILL), and started again at the end of the fault.
    Kill {
        /// Whose.
        robots: BTreeSet<RobotId>,
    },
    /// The robots' processes stand still (SIGSTOP), and go on at the end of the fault (SIGCONT).
    Stop {
        /// Whose.
        robots: BTreeSet<RobotId>,
    },
    /// The robots' journals cannot grow; a process that ends of it is started again at the end of the fault.
    DiskFull {
        /// Whose.
        robots: BTreeSet<RobotId>,
    },
    /// The coordinator's process is killed, for good.
    CoordinatorDies,
}

impl Fault {
    /// Whether it befalls processes rather than messages or clocks.
    pub fn is_of_processes(&self) -> bool {
        matches!(self, Self::Kill { .. } | Self::Stop { .. } | Self::DiskFull { .. } | Self::CoordinatorDies)
    }

    /// How it is written.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Loss { .. } => "loss",
            Self::Burst { .. } => "burst",
            Self::Delay { .. } => "delay",
            Self::Reorder { .. } => "reorder",
            Self::Duplicate { .. } => "duplicate",
            Self::Corrupt { .. } => "corrupt",
            Self::Cut => "cut",
            Self::Partition { .. } => "partition",
            Self::Away { .. } => "away",
            Self::Slow { .. } => "slow",
            Self::Clock { .. } => "clock",
            Self::Kill { .. } => "kill",
            Self::Stop { .. } => "stop",
            Self::DiskFull { .. } => "disk_full",
            Self::CoordinatorDies => "coordinator_dies",
        }
    }

    /// The robots that are named as its own, if it has such.
    pub fn robots(&self) -> Option<&BTreeSet<RobotId>> {
        match self {
            Self::Away { robots }
            | Self::Kill { robots }
            | Self::Stop { robots }
            | Self::DiskFull { robots } => Some(robots),
            _ => None,
        }
    }

    pub(super) fn robots_mut(&mut self) -> Option<&mut BTreeSet<RobotId>> {
        match self {
            Self::Away { robots }
            | Self::Kill { robots }
            | Self::Stop { robots }
            | Self::DiskFull { robots } => Some(robots),
            _ => None,
        }
    }
}

/// A fault that happens again and again, at random times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Again {
    /// Mean time from the end of one to the start of the next, s; uniform from half of it to one and a half.
    pub every_s: f64,
    /// Mean length, s; uniform from half of it to one and a half.
    pub for_s: f64,
}

/// A fault, and what it concerns.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// What goes wrong.
    pub fault: Fault,
    /// Senders it concerns; all if empty.
    pub from: BTreeSet<RobotId>,
    /// Receivers it concerns; all if empty.
    pub to: BTreeSet<RobotId>,
    /// Kinds of messages it concerns, as [`pleiad_protocol::Message::kind`] names them; all if empty.
    pub messages: BTreeSet<&'static str>,
    /// From this many seconds into the run.
    pub start_s: f64,
    /// Until this many.
    pub end_s: f64,
    /// Not all the time in between, but now and then: [`FaultPlan::scripted`] says when. Until then it is
    /// never on.
    pub again: Option<Again>,
}

impl Rule {
    /// A fault of all links and messages from the beginning to the end.
    pub fn always(fault: Fault) -> Self {
        Self {
            fault,
            from: BTreeSet::new(),
            to: BTreeSet::new(),
            messages: BTreeSet::new(),
            start_s: 0.0,
            end_s: f64::INFINITY,
            again: None,
        }
    }

    /// The same between two instants, seconds into the run.
    pub fn between(self, start_s: f64, end_s: f64) -> Self {
        Self { start_s, end_s, ..self }
    }

    pub(super) fn is_on(&self, t_s: f64) -> bool {
        self.again.is_none() && (self.start_s..self.end_s).contains(&t_s)
    }

    pub(super) fn concerns(&self, from: RobotId, to: RobotId, kind: Option<&str>) -> bool {
        let among = |robots: &BTreeSet<RobotId>, robot| robots.is_empty() || robots.contains(&robot);
        let of_kind = self.messages.is_empty() || kind.is_some_and(|kind| self.messages.contains(kind));
        among(&self.from, from) && among(&self.to, to) && of_kind
    }

    /// Which value makes no sense, what it is and what it may be.
    ///
    /// # Errors
    /// The first such value.
    pub fn check(&self) -> Result<(), InvalidRule> {
        let probability = |key, found| within(key, found, 0.0..=1.0, "a probability from 0 to 1");
        let seconds = |key, found| within(key, found, 0.0..=MAX_TIME_S, "seconds from 0 to 1e6");
        seconds("start_s", self.start_s)?;
        if self.end_s.is_nan() || self.end_s <= self.start_s {
            return Err(invalid("end_s", self.end_s, "a time after start_s"));
        }
        if let Some(again) = self.again {
            within("every_s", again.every_s, SHORTEST_S..=MAX_TIME_S, "seconds from 0.1")?;
            within("for_s", again.for_s, SHORTEST_S..=MAX_TIME_S, "seconds from 0.1")?;
        }
        match &self.fault {
            Fault::Loss { loss } => probability("loss", *loss),
            Fault::Burst { loss, mean_length } => {
                within("loss", *loss, 0.0..=1.0 - 1e-9, "a probability from 0 to below 1")?;
                within("mean_length", *mean_length, 1.0..=1e9, "a number of messages from 1")?;
                if *loss > mean_length / (mean_length + 1.0) {
                    // Even a link that turns bad after every good message cannot lose more.
                    let expected = "at least loss / (1 - loss): shorter bursts cannot lose as much";
                    return Err(invalid("mean_length", *mean_length, expected));
                }
                Ok(())
            }
            Fault::Delay { delay_s, jitter_s } => {
                seconds("delay_s", *delay_s)?;
                seconds("jitter_s", *jitter_s)
            }
            Fault::Reorder { probability: found, by_s } => {
                probability("probability", *found)?;
                seconds("by_s", *by_s)
            }
            Fault::Duplicate { probability: found, within_s } => {
                probability("probability", *found)?;
                seconds("within_s", *within_s)
            }
            Fault::Corrupt { probability: found, bytes } => {
                probability("probability", *found)?;
                within("bytes", f64::from(*bytes), 1.0..=255.0, "a number of bytes from 1 to 255")
            }
            Fault::Cut | Fault::CoordinatorDies => Ok(()),
            Fault::Partition { groups } => {
                let mut seen = BTreeSet::new();
                for robot in groups.iter().flatten() {
                    if !seen.insert(*robot) {
                        let expected = "every robot in one group only";
                        return Err(invalid("groups", f64::from(robot.0), expected));
                    }
                }
                // At random times, the groups are random too where none are given.
                if groups.is_empty() && self.again.is_none() {
                    return Err(invalid("groups", 0.0, "at least one group of robots"));
                }
                Ok(())
            }
            Fault::Away { robots }
            | Fault::Kill { robots }
            | Fault::Stop { robots }
            | Fault::DiskFull { robots } => {
                // At random times, it is one of all where none are given.
                if robots.is_empty() && self.again.is_none() {
                    return Err(invalid("robots", 0.0, "at least one robot"));
                }
                Ok(())
            }
            Fault::Slow { messages_per_s, .. } => {
                within("messages_per_s", *messages_per_s, 1e-6..=1e9, "messages per second from 1e-6")
            }
            Fault::Clock { offset_s, drift_ppm } => {
                within("offset_s", *offset_s, -MAX_TIME_S..=MAX_TIME_S, "seconds within 1e6")?;
                within("drift_ppm", *drift_ppm, -1e5..=1e5, "parts per million within 1e5")
            }
        }
    }
}

/// Longest delay; within it, times keep their nanoseconds.
const MAX_TIME_S: f64 = 1e6;
/// Shortest time between random faults.
const SHORTEST_S: f64 = 0.1;

/// A value of a rule that makes no sense.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key} is {found}; expected {expected}")]
pub struct InvalidRule {
    /// Which value.
    pub key: &'static str,
    /// What it is.
    pub found: String,
    /// What it may be.
    pub expected: &'static str,
}

fn invalid(key: &'static str, found: f64, expected: &'static str) -> InvalidRule {
    InvalidRule { key, found: found.to_string(), expected }
}

fn within(
    key: &'static str,
    found: f64,
    range: std::ops::RangeInclusive<f64>,
    expected: &'static str,
) -> Result<(), InvalidRule> {
    if range.contains(&found) { Ok(()) } else { Err(invalid(key, found, expected)) }
}

/// All rules of a run, in the order in which they apply.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaultPlan {
    /// The rules.
    pub rules: Vec<Rule>,
}

impl FaultPlan {
    /// Checked.
    ///
    /// # Errors
    /// The first rule that makes no sense.
    pub fn new(rules: Vec<Rule>) -> Result<Self, InvalidRule> {
        rules.iter().try_for_each(Rule::check)?;
        Ok(Self { rules })
    }

    /// How far a robot's clock is ahead, `t_s` seconds into the run.
    pub fn clock_error_s(&self, robot: RobotId, t_s: f64) -> f64 {
        let of = |rule: &Rule| match rule.fault {
            Fault::Clock { offset_s, drift_ppm }
                if rule.is_on(t_s) && (rule.from.is_empty() || rule.from.contains(&robot)) =>
            {
                offset_s + drift_ppm * 1e-6 * (t_s - rule.start_s)
            }
            _ => 0.0,
        };
        self.rules.iter().map(of).sum()
    }

    /// From the start of the first fault to the end of the last that ends, seconds into the run; `None`
    /// without a fault.
    pub fn window_s(&self) -> Option<(f64, f64)> {
        let start = self.rules.iter().map(|rule| rule.start_s).min_by(f64::total_cmp)?;
        let end = self.rules.iter().map(|rule| rule.end_s).max_by(f64::total_cmp)?;
        Some((start, end))
    }
}
