//! One robot in one recording: its residuals under a model, as one long vector.

use std::borrow::Cow;
use std::ops::Range;

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::Target;
use pleiad_physics::{Dual, Floors, RobotModel, Scalar, Variable};

use crate::channel::Channel;
use crate::compare::{command_agitation, residuals_of, residuals_of_several};
use crate::diagnosis::related::unrelated;
use crate::diagnosis::term::Term;
use crate::diagnosis::touch::touches;
use crate::evidence::Evidence;
use crate::residual::{ChannelResiduals, Omission, Regime};

/// Scores are summed over blocks of this length: longer than the correlation of what is not modelled,
/// short enough for many blocks. Seconds.
pub(crate) const BLOCK_S: f64 = 2.5;

/// A channel's stretch of the vector, rows by rows.
#[derive(Clone, Debug)]
pub(crate) struct Stretch {
    pub(crate) channel: Channel,
    pub(crate) offset: usize,
    pub(crate) rows: usize,
    pub(crate) components: usize,
    pub(crate) omissions: Vec<Omission>,
}

impl Stretch {
    pub(crate) fn range(&self) -> Range<usize> {
        self.offset..self.offset + self.rows * self.components
    }
}

/// What a row of residuals is about.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub(crate) time_s: f64,
    pub(crate) regime: Regime,
    pub(crate) target: Option<Target>,
}

/// The most that commands ask for.
#[derive(Clone, Copy, Debug, Default)]
#[allow(clippy::struct_field_names, reason = "every field is a rate and ends in its unit")]
pub(crate) struct Demand {
    /// Of a wheel, rad/s.
    pub(crate) wheel_rad_s: f64,
    /// Of the body, m/s.
    pub(crate) speed_m_s: f64,
    /// From one command to the next, m/s.
    pub(crate) change_m_s: f64,
}

impl Demand {
    fn of(evidence: &Evidence<'_>, robot: RobotId, nominal: &RobotModel<f64>) -> Self {
        let mut demand = Self::default();
        let Some((_, track)) = evidence.robot(robot) else { return demand };
        let mut before_m_s = 0.0;
        for command in &track.commands {
            let rim_m_s =
                command.speed_m_s.abs() + 0.5 * nominal.nominal.track_width * command.yaw_rate_rad_s.abs();
            demand.wheel_rad_s = demand.wheel_rad_s.max(rim_m_s / nominal.nominal.wheel_radius);
            demand.speed_m_s = demand.speed_m_s.max(rim_m_s);
            demand.change_m_s = demand.change_m_s.max((command.speed_m_s - before_m_s).abs());
            before_m_s = command.speed_m_s;
        }
        demand
    }
}

/// One robot in one recording.
pub(crate) struct Unit<'a> {
    pub(crate) evidence: &'a Evidence<'a>,
    /// The position of the recording among those given.
    pub(crate) recording: usize,
    pub(crate) robot: RobotId,
    pub(crate) nominal: RobotModel<f64>,
    pub(crate) floors: Floors,
    pub(crate) stretches: Vec<Stretch>,
    /// One per element of the vector.
    pub(crate) rows: Vec<Row>,
    /// The position of each element's scale: one scale per component of a channel.
    pub(crate) scale_of: Vec<usize>,
    /// The name of each scale: channel and component.
    pub(crate) scales: Vec<(Channel, usize)>,
    /// The number of each element's block in time.
    pub(crate) block_of: Vec<usize>,
    pub(crate) blocks: usize,
    /// First and last stamp, seconds.
    pub(crate) span_s: (f64, f64),
    /// The most that commands ask for.
    pub(crate) demand: Demand,
    /// One sigma of the time at which a command comes, seconds, as it is declared.
    jitter_sigma_s: f64,
    /// One per element, under the nominal model: see [`Unit::agitation`].
    agitation: Vec<f64>,
}

/// So many variables are differentiated by at once.
pub(crate) const MOST_AT_ONCE: usize = 8;
/// An effect that no model has.
const NO_VARIABLE: Variable = Variable::Effect { index: usize::MAX, parameter: 0 };

/// Residuals of the channels asked for; the others are `None`.
pub(crate) type Values = Vec<Option<Vec<f64>>>;

/// The derivatives of the residuals with respect to one variable, by stretch; `None` where all are zero.
#[derive(Clone, Debug)]
pub(crate) struct Column {
    pub(crate) parts: Vec<Option<Vec<f64>>>,
}

impl Column {
    pub(crate) fn empty(unit: &Unit<'_>) -> Self {
        Self { parts: vec![None; unit.stretches.len()] }
    }

    pub(crate) fn is_zero(&self) -> bool {
        self.parts.iter().all(Option::is_none)
    }
}

impl<'a> Unit<'a> {
    /// Computes the residuals under the nominal model once, which fixes the layout.
    pub(crate) fn new(
        evidence: &'a Evidence<'a>,
        recording: usize,
        robot: RobotId,
        nominal: RobotModel<f64>,
        floors: Floors,
        jitter_sigma_s: f64,
    ) -> Self {
        let demand = Demand::of(evidence, robot, &nominal);
        let mut unit = Self {
            evidence,
            recording,
            robot,
            nominal,
            floors,
            stretches: Vec::new(),
            rows: Vec::new(),
            scale_of: Vec::new(),
            scales: Vec::new(),
            block_of: Vec::new(),
            blocks: 0,
            span_s: (0.0, 0.0),
            demand,
            jitter_sigma_s,
            agitation: Vec::new(),
        };
        for channel in Channel::ALL {
            let mut found = residuals_of(evidence, robot, &unit.nominal, channel);
            if let Some(correlation) = unrelated(evidence, robot, &unit.nominal, &found) {
                found.rows.clear();
                #[allow(clippy::cast_possible_truncation, reason = "at most 100")]
                found.omissions.push(Omission::Unrelated((100.0 * correlation).round() as i32));
            }
            let components = channel.components().len();
            let first_scale = unit.scales.len();
            if !found.rows.is_empty() {
                unit.scales.extend((0..components).map(|component| (channel, component)));
            }
            unit.stretches.push(Stretch {
                channel,
                offset: unit.rows.len(),
                rows: found.rows.len(),
                components,
                omissions: found.omissions,
            });
            for row in &found.rows {
                for component in 0..components {
                    unit.rows.push(Row { time_s: row.time_s, regime: row.regime, target: row.target });
                    unit.scale_of.push(first_scale + component);
                }
            }
        }
        unit.agitation = vec![0.0; unit.rows.len()];
        if let Some(range) = unit.stretch(Channel::Actuator).map(Stretch::range)
            && jitter_sigma_s > 0.0
        {
            let mut own = vec![0.0; range.len()];
            unit.agitate(&mut own, &unit.nominal);
            unit.agitation[range].copy_from_slice(&own);
        }
        let stamps = || unit.rows.iter().map(|row| row.time_s);
        let first_s = stamps().fold(f64::INFINITY, f64::min);
        let last_s = stamps().fold(f64::NEG_INFINITY, f64::max);
        if first_s <= last_s {
            unit.span_s = (first_s, last_s);
            unit.block_of = stamps().map(|time_s| block(time_s - first_s)).collect();
            unit.blocks = block(last_s - first_s) + 1;
        }
        unit
    }

    /// Lets every element be a block of its own: errors count as independent.
    pub(crate) fn make_rows_blocks(&mut self) {
        self.blocks = self.rows.len();
        self.block_of = (0..self.blocks).collect();
    }

    pub(crate) fn stretch(&self, channel: Channel) -> Option<&Stretch> {
        self.stretches.iter().find(|stretch| stretch.channel == channel && stretch.rows > 0)
    }

    /// The nominal model with the terms that act on this robot.
    pub(crate) fn model<'t>(&self, terms: impl IntoIterator<Item = &'t Term>) -> RobotModel<f64> {
        let mut model = self.nominal.clone();
        for term in terms {
            if term.acts_on(self.robot) {
                model.effects.push(term.active());
            }
        }
        model
    }

    /// Variance per element that the declared jitter of commands adds; zero for channels but the actuator's.
    /// Declared and not fitted, because a fitted one would swallow every lag: it shows in the same rows.
    pub(crate) fn agitation(&self, terms: &[Term]) -> Cow<'_, [f64]> {
        let moves = |term: &Term| term.acts_on(self.robot) && touches(term.effect, Channel::Actuator);
        let stretch = self.stretch(Channel::Actuator);
        let (Some(stretch), true) = (stretch, self.jitter_sigma_s > 0.0 && terms.iter().any(moves)) else {
            return Cow::Borrowed(&self.agitation);
        };
        let mut all = self.agitation.clone();
        self.agitate(&mut all[stretch.range()], &self.model(terms));
        Cow::Owned(all)
    }

    /// Writes the variances of the windows of the wheels under a model.
    fn agitate(&self, into: &mut [f64], model: &RobotModel<f64>) {
        let changes = command_agitation(self.evidence, self.robot, model);
        let variance = self.jitter_sigma_s * self.jitter_sigma_s;
        for (element, change) in into.iter_mut().zip(changes.into_iter().flatten()) {
            *element = change * variance;
        }
    }

    /// Positions of the stretches that hold something, those that are predicted together in one group.
    pub(crate) fn groups(&self) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for (which, stretch) in self.stretches.iter().enumerate().filter(|(_, stretch)| stretch.rows > 0) {
            let with = |group: &&mut Vec<usize>| {
                let first = self.stretches[group[0]].channel;
                Channel::SIGHTINGS.iter().any(|pair| pair.contains(&first) && pair.contains(&stretch.channel))
            };
            match groups.last_mut().filter(with) {
                Some(group) => group.push(which),
                None => groups.push(vec![which]),
            }
        }
        groups
    }

    /// Residuals under a model; `None` for a channel in which a prediction is no finite number where the
    /// nominal one is.
    pub(crate) fn values(&self, model: &RobotModel<f64>, channels: &dyn Fn(Channel) -> bool) -> Values {
        let mut all = vec![None; self.stretches.len()];
        for mut group in self.groups() {
            group.retain(|&which| channels(self.stretches[which].channel));
            let found = self.evaluated(model, &group);
            for (which, values) in group.into_iter().zip(found) {
                all[which] = values;
            }
        }
        all
    }

    /// Values of the stretches of a group.
    fn evaluated<S: Scalar>(&self, model: &RobotModel<S>, group: &[usize]) -> Vec<Option<Vec<S>>> {
        let channels: Vec<Channel> = group.iter().map(|&which| self.stretches[which].channel).collect();
        let found = residuals_of_several(self.evidence, self.robot, model, &channels);
        let values = |(found, &which): (ChannelResiduals<S>, &usize)| {
            let stretch = &self.stretches[which];
            let values: Vec<S> = found.rows.iter().flat_map(|row| row.values().iter().copied()).collect();
            (found.rows.len() == stretch.rows && values.len() == stretch.rows * stretch.components)
                .then_some(values)
        };
        found.into_iter().zip(group).map(values).collect()
    }

    /// Derivatives of the residuals with respect to variables of a model; those that `show` in no channel, by
    /// their positions, stay zero.
    pub(crate) fn columns(
        &self,
        model: &RobotModel<f64>,
        variables: &[Variable],
        show: &dyn Fn(usize, Channel) -> bool,
    ) -> Vec<Column> {
        let mut columns = vec![Column::empty(self); variables.len()];
        for group in self.groups() {
            let shows = |position| group.iter().any(|&which| show(position, self.stretches[which].channel));
            let own: Vec<usize> = (0..variables.len()).filter(|&position| shows(position)).collect();
            // Many at once: what the model predicts is the same for all, and most of the work.
            for positions in own.chunks(MOST_AT_ONCE) {
                let now: Vec<Variable> = positions.iter().map(|&position| variables[position]).collect();
                for (&position, parts) in positions.iter().zip(self.slopes(model, &now, &group)) {
                    for (&which, part) in group.iter().zip(parts) {
                        columns[position].parts[which] = part;
                    }
                }
            }
        }
        columns
    }

    /// The derivatives of the stretches of a group with respect to at most [`MOST_AT_ONCE`] variables, by
    /// variable, then stretch; `None` for what is zero or not finite.
    pub(crate) fn slopes(
        &self,
        model: &RobotModel<f64>,
        variables: &[Variable],
        group: &[usize],
    ) -> Vec<Values> {
        match variables.len() {
            1 => self.batch::<1>(model, variables, group),
            2 => self.batch::<2>(model, variables, group),
            3 | 4 => self.batch::<4>(model, variables, group),
            _ => self.batch::<MOST_AT_ONCE>(model, variables, group),
        }
    }

    fn batch<const P: usize>(
        &self,
        model: &RobotModel<f64>,
        variables: &[Variable],
        group: &[usize],
    ) -> Vec<Values> {
        let mut padded = [NO_VARIABLE; P];
        padded[..variables.len()].copy_from_slice(variables);
        let model: RobotModel<Dual<P>> = model.differentiated(&padded);
        let values = self.evaluated(&model, group);
        let derivative = |values: &Option<Vec<Dual<P>>>, index: usize| {
            let part: Vec<f64> = values.as_ref()?.iter().map(|value| value.derivatives()[index]).collect();
            let shows = part.iter().all(|value| value.is_finite()) && part.iter().any(|value| *value != 0.0);
            shows.then_some(part)
        };
        let of_variable = |index| values.iter().map(|values| derivative(values, index)).collect();
        (0..variables.len()).map(of_variable).collect()
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "times since the first, at least 0"
)]
fn block(since_s: f64) -> usize {
    (since_s / BLOCK_S) as usize
}
