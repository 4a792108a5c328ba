//! What is judged together in one recording, one robot or a team: its residuals under a model, as one long vector.
//!
//! With truth every robot is judged by itself. Without, nobody knows where a robot was but by what the whole team
//! measured: then the team is one unit, whose [`Mesh`] says how its residuals hang together.

use std::borrow::Cow;
use std::ops::Range;

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::Target;
use pleiad_physics::{Dual, Floors, RobotModel, Scalar, Variable};

use crate::channel::Channel;
use crate::compare::{command_agitation, residuals_of, residuals_of_several};
use crate::diagnosis::mesh::Mesh;
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
    /// The position of the robot among the members of the unit.
    pub(crate) member: usize,
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

    fn or(&self, other: &Self) -> Self {
        Self {
            wheel_rad_s: self.wheel_rad_s.max(other.wheel_rad_s),
            speed_m_s: self.speed_m_s.max(other.speed_m_s),
            change_m_s: self.change_m_s.max(other.change_m_s),
        }
    }
}

/// A robot of a unit.
#[derive(Clone)]
pub(crate) struct Member {
    pub(crate) robot: RobotId,
    pub(crate) nominal: RobotModel<f64>,
    pub(crate) floors: Floors,
    /// One sigma of the time at which a command comes, seconds, as it is declared.
    pub(crate) jitter_sigma_s: f64,
}

impl Member {
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
}

/// What is judged together in one recording.
pub(crate) struct Unit<'a> {
    pub(crate) evidence: &'a Evidence<'a>,
    /// The position of the recording among those given.
    pub(crate) recording: usize,
    /// The robots, at least one.
    pub(crate) members: Vec<Member>,
    /// How residuals hang together where nothing but the team knows where its robots are.
    pub(crate) mesh: Option<Mesh>,
    pub(crate) stretches: Vec<Stretch>,
    /// One per element of the vector.
    pub(crate) rows: Vec<Row>,
    /// The position of each element's scale: one scale per component of a channel.
    pub(crate) scale_of: Vec<usize>,
    /// The name of each scale: channel and component. Every member has its own.
    pub(crate) scales: Vec<(Channel, usize)>,
    /// The number of each element's block in time.
    pub(crate) block_of: Vec<usize>,
    pub(crate) blocks: usize,
    /// First and last stamp, seconds.
    pub(crate) span_s: (f64, f64),
    /// The most that commands ask for.
    pub(crate) demand: Demand,
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

    /// Takes over what another has.
    pub(crate) fn take(&mut self, other: Self) {
        for (own, other) in self.parts.iter_mut().zip(other.parts) {
            if other.is_some() {
                *own = other;
            }
        }
    }
}

impl<'a> Unit<'a> {
    /// Computes the residuals under the nominal model once, which fixes the layout.
    pub(crate) fn new(evidence: &'a Evidence<'a>, recording: usize, members: Vec<Member>) -> Self {
        let mut demand = Demand::default();
        for member in &members {
            demand = demand.or(&Demand::of(evidence, member.robot, &member.nominal));
        }
        let mut unit = Self {
            evidence,
            recording,
            members,
            mesh: None,
            stretches: Vec::new(),
            rows: Vec::new(),
            scale_of: Vec::new(),
            scales: Vec::new(),
            block_of: Vec::new(),
            blocks: 0,
            span_s: (0.0, 0.0),
            demand,
            agitation: Vec::new(),
        };
        for member in 0..unit.members.len() {
            for channel in Channel::ALL {
                unit.lay_out(member, channel);
            }
        }
        unit.agitation = vec![0.0; unit.rows.len()];
        for member in 0..unit.members.len() {
            if let Some(range) = unit.actuator(member) {
                let mut own = vec![0.0; range.len()];
                unit.agitate(member, &mut own, &unit.members[member].nominal);
                unit.agitation[range].copy_from_slice(&own);
            }
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

    /// Appends the stretch of a channel of a member.
    fn lay_out(&mut self, member: usize, channel: Channel) {
        let Member { robot, nominal, .. } = &self.members[member];
        let mut found = residuals_of(self.evidence, *robot, nominal, channel);
        if let Some(correlation) = unrelated(self.evidence, *robot, nominal, &found) {
            found.rows.clear();
            #[allow(clippy::cast_possible_truncation, reason = "at most 100")]
            found.omissions.push(Omission::Unrelated((100.0 * correlation).round() as i32));
        }
        let components = channel.components().len();
        let first_scale = self.scales.len();
        if !found.rows.is_empty() {
            self.scales.extend((0..components).map(|component| (channel, component)));
        }
        self.stretches.push(Stretch {
            member,
            channel,
            offset: self.rows.len(),
            rows: found.rows.len(),
            components,
            omissions: found.omissions,
        });
        for row in &found.rows {
            for component in 0..components {
                self.rows.push(Row { time_s: row.time_s, regime: row.regime, target: row.target });
                self.scale_of.push(first_scale + component);
            }
        }
    }

    /// The first robot, of a unit that has no other.
    pub(crate) fn robot(&self) -> RobotId {
        self.members[0].robot
    }

    /// The nominal model of the first robot.
    pub(crate) fn nominal(&self) -> &RobotModel<f64> {
        &self.members[0].nominal
    }

    /// The nominal model of the first robot, with terms.
    pub(crate) fn model<'t>(&self, terms: impl IntoIterator<Item = &'t Term>) -> RobotModel<f64> {
        self.members[0].model(terms)
    }

    /// Whether a term acts on one of the robots.
    pub(crate) fn has(&self, term: &Term) -> bool {
        self.members.iter().any(|member| term.acts_on(member.robot))
    }

    /// The robots that a term acts on.
    pub(crate) fn acted_on<'u>(&'u self, term: &'u Term) -> impl Iterator<Item = &'u Member> {
        self.members.iter().filter(|member| term.acts_on(member.robot))
    }

    /// Lets every element be a block of its own: errors count as independent.
    pub(crate) fn make_rows_blocks(&mut self) {
        self.blocks = self.rows.len();
        self.block_of = (0..self.blocks).collect();
    }

    pub(crate) fn stretch(&self, channel: Channel) -> Option<&Stretch> {
        self.stretches.iter().find(|stretch| stretch.channel == channel && stretch.rows > 0)
    }

    /// Where the windows of a member's wheels are, if commands come at declared random times.
    fn actuator(&self, member: usize) -> Option<Range<usize>> {
        let is_own = |stretch: &&Stretch| {
            stretch.member == member && stretch.channel == Channel::Actuator && stretch.rows > 0
        };
        let stretch = self.stretches.iter().find(is_own)?;
        (self.members[member].jitter_sigma_s > 0.0).then(|| stretch.range())
    }

    /// Variance per element that the declared jitter of commands adds; zero for channels but the actuator's.
    /// Declared and not fitted, because a fitted one would swallow every lag: it shows in the same rows.
    pub(crate) fn agitation(&self, terms: &[Term]) -> Cow<'_, [f64]> {
        let mut all = Cow::Borrowed(&self.agitation[..]);
        for (index, member) in self.members.iter().enumerate() {
            let moves = |term: &Term| term.acts_on(member.robot) && touches(term.effect, Channel::Actuator);
            if let Some(range) = self.actuator(index)
                && terms.iter().any(moves)
            {
                self.agitate(index, &mut all.to_mut()[range], &member.model(terms));
            }
        }
        all
    }

    /// Writes the variances of the windows of a member's wheels under a model.
    fn agitate(&self, member: usize, into: &mut [f64], model: &RobotModel<f64>) {
        let Member { robot, jitter_sigma_s, .. } = &self.members[member];
        let changes = command_agitation(self.evidence, *robot, model);
        let variance = jitter_sigma_s * jitter_sigma_s;
        for (element, change) in into.iter_mut().zip(changes.into_iter().flatten()) {
            *element = change * variance;
        }
    }

    /// Positions of the stretches that hold something, those that are predicted together in one group.
    pub(crate) fn groups(&self) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for (which, stretch) in self.stretches.iter().enumerate().filter(|(_, stretch)| stretch.rows > 0) {
            let with = |group: &&mut Vec<usize>| {
                let first = &self.stretches[group[0]];
                let together =
                    |pair: &[Channel; 2]| pair.contains(&first.channel) && pair.contains(&stretch.channel);
                first.member == stretch.member && Channel::SIGHTINGS.iter().any(together)
            };
            match groups.last_mut().filter(with) {
                Some(group) => group.push(which),
                None => groups.push(vec![which]),
            }
        }
        groups
    }

    /// Residuals under terms; `None` for a channel in which a prediction is no finite number where the nominal one
    /// is.
    pub(crate) fn values(&self, terms: &[Term], channels: &dyn Fn(Channel) -> bool) -> Values {
        let models: Vec<RobotModel<f64>> = self.members.iter().map(|member| member.model(terms)).collect();
        let mut all = vec![None; self.stretches.len()];
        for mut group in self.groups() {
            group.retain(|&which| channels(self.stretches[which].channel));
            let Some(&first) = group.first() else { continue };
            let found = self.evaluated(&models[self.stretches[first].member], &group);
            for (which, values) in group.into_iter().zip(found) {
                all[which] = values;
            }
        }
        all
    }

    /// Values of the stretches of a group.
    fn evaluated<S: Scalar>(&self, model: &RobotModel<S>, group: &[usize]) -> Vec<Option<Vec<S>>> {
        let channels: Vec<Channel> = group.iter().map(|&which| self.stretches[which].channel).collect();
        let Some(&first) = group.first() else { return Vec::new() };
        let robot = self.members[self.stretches[first].member].robot;
        let found = residuals_of_several(self.evidence, robot, model, &channels);
        let values = |(found, &which): (ChannelResiduals<S>, &usize)| {
            let stretch = &self.stretches[which];
            let values: Vec<S> = found.rows.iter().flat_map(|row| row.values().iter().copied()).collect();
            (found.rows.len() == stretch.rows && values.len() == stretch.rows * stretch.components)
                .then_some(values)
        };
        found.into_iter().zip(group).map(values).collect()
    }

    /// Derivatives of a member's residuals with respect to variables of its model; those that `show` in no channel,
    /// by their positions, stay zero.
    pub(crate) fn columns(
        &self,
        member: usize,
        model: &RobotModel<f64>,
        variables: &[Variable],
        show: &dyn Fn(usize, Channel) -> bool,
    ) -> Vec<Column> {
        let mut columns = vec![Column::empty(self); variables.len()];
        let groups = self.groups();
        for group in groups.into_iter().filter(|group| self.stretches[group[0]].member == member) {
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
