//! What a form adds something to: a rate of the body or of the servo, or a reading.

use crate::channel::Channel;
use crate::diagnosis::open::monomial::{Base, Factor, Form, Instant, Monomial};
use crate::diagnosis::open::motion::{Driven, Motions, Span};
use crate::diagnosis::unit::{Column, Unit};

/// What is wrong by a form.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Target {
    SetSpeed,
    SetYawRate,
    Forward,
    Left,
    YawRate,
    Gyro,
    GpsForward,
    GpsLeft,
    Heading,
    Range,
    Bearing,
}

const VELOCITY: [i8; 3] = [1, -1, 0];
const RATE: [i8; 3] = [0, -1, 1];
const LENGTH: [i8; 3] = [1, 0, 0];
const ANGLE: [i8; 3] = [0, 0, 1];

/// A function of what the robot does.
pub(crate) type Function<'f> = dyn Fn(&Instant) -> f64 + Sync + 'f;

impl Target {
    pub(crate) const ALL: [Self; 11] = [
        Self::SetSpeed,
        Self::SetYawRate,
        Self::Forward,
        Self::Left,
        Self::YawRate,
        Self::Gyro,
        Self::GpsForward,
        Self::GpsLeft,
        Self::Heading,
        Self::Range,
        Self::Bearing,
    ];

    /// In words, with the powers of metre, second and radian of its unit.
    pub(crate) const fn words(self) -> (&'static str, [i8; 3]) {
        match self {
            Self::SetSpeed => ("driven speed", VELOCITY),
            Self::SetYawRate => ("driven yaw rate", RATE),
            Self::Forward => ("forward velocity", VELOCITY),
            Self::Left => ("left velocity", VELOCITY),
            Self::YawRate => ("yaw rate", RATE),
            Self::Gyro => ("gyro reading", RATE),
            Self::GpsForward => ("GPS position forward", LENGTH),
            Self::GpsLeft => ("GPS position left", LENGTH),
            Self::Heading => ("heading reading", ANGLE),
            Self::Range => ("range reading", LENGTH),
            Self::Bearing => ("bearing reading", ANGLE),
        }
    }

    pub(crate) const fn stage(self) -> &'static str {
        match self {
            Self::SetSpeed | Self::SetYawRate => "actuator",
            Self::Forward | Self::Left | Self::YawRate => "body",
            _ => "sensor",
        }
    }

    /// Channels that show it, each with the component that shows it most; the first that is recorded counts.
    pub(crate) const fn channels(self) -> &'static [(Channel, usize)] {
        match self {
            Self::SetSpeed => &[(Channel::Actuator, 0)],
            Self::SetYawRate => &[(Channel::Actuator, 1)],
            Self::Forward => &[(Channel::Body, 0), (Channel::CommandedBody, 0)],
            Self::Left => &[(Channel::Body, 1), (Channel::CommandedBody, 1)],
            Self::YawRate => &[(Channel::Body, 2), (Channel::CommandedBody, 2), (Channel::Gyro, 0)],
            Self::Gyro => &[(Channel::Gyro, 0)],
            Self::GpsForward => &[(Channel::Gps, 0)],
            Self::GpsLeft => &[(Channel::Gps, 1)],
            Self::Heading => &[(Channel::Heading, 0)],
            Self::Range => &[(Channel::RangeToLandmark, 0), (Channel::RangeToRobot, 0)],
            Self::Bearing => &[(Channel::BearingToLandmark, 0), (Channel::BearingToRobot, 0)],
        }
    }

    /// Regressors that a curve may be drawn over.
    pub(crate) const fn regressors(self) -> &'static [Base] {
        match self {
            Self::SetSpeed | Self::SetYawRate | Self::Forward | Self::Left | Self::YawRate | Self::Gyro => &[
                Base::Speed,
                Base::YawRate,
                Base::Acceleration,
                Base::YawAcceleration,
                Base::Heading,
                Base::Time,
                Base::X,
                Base::Y,
            ],
            Self::GpsForward | Self::GpsLeft | Self::Heading => {
                &[Base::Speed, Base::YawRate, Base::Acceleration, Base::Heading, Base::Time, Base::X, Base::Y]
            }
            Self::Range | Self::Bearing => &[
                Base::Range,
                Base::Bearing,
                Base::Speed,
                Base::YawRate,
                Base::Heading,
                Base::Time,
                Base::X,
                Base::Y,
            ],
        }
    }

    /// What does not matter: each, as a form with this coefficient, is at the threshold of relevance of an effect
    /// of the catalogue, or a floor that is declared. The largest of them on these data is the bound.
    pub(crate) fn harmless(self, unit: &Unit<'_>) -> Vec<(f64, Monomial)> {
        let plain = |bases: &[Base]| Monomial(bases.iter().map(|&base| Factor(base, Form::Plain)).collect());
        let floors = &unit.members[0].floors;
        let lag_s = floors.command_lag_s.max(0.15 * floors.servo_time_constant_s) + 0.001;
        let track_m = unit.nominal().nominal.track_width.max(0.01);
        match self {
            Self::SetSpeed => vec![
                (0.003, plain(&[Base::Speed])),
                (lag_s, plain(&[Base::Acceleration])),
                (0.0008, plain(&[])),
            ],
            Self::SetYawRate => {
                vec![(0.008, plain(&[Base::YawRate])), (lag_s, plain(&[Base::YawAcceleration]))]
            }
            Self::Forward => vec![
                (0.001, plain(&[Base::Speed])),
                (0.004, plain(&[Base::Acceleration])),
                (0.002, plain(&[Base::Speed, Base::YawRate])),
            ],
            Self::Left => vec![
                (floors.lateral_slip_s.max(0.005), plain(&[Base::Speed, Base::YawRate])),
                (0.004, plain(&[Base::YawRate])),
            ],
            Self::YawRate => {
                vec![(0.0015 / track_m, plain(&[Base::Speed])), (0.003, plain(&[Base::YawRate]))]
            }
            Self::Gyro => vec![
                (0.0006, plain(&[])),
                (0.002, plain(&[Base::YawRate])),
                (floors.sensor_lag_s + 0.002, plain(&[Base::YawAcceleration])),
            ],
            Self::GpsForward | Self::GpsLeft => {
                vec![(0.02, plain(&[])), (0.02, plain(&[Base::Speed]))]
            }
            Self::Heading => {
                vec![(0.004, plain(&[])), (floors.sensor_lag_s + 0.002, plain(&[Base::YawRate]))]
            }
            Self::Range => vec![
                (0.006, plain(&[])),
                (0.003, plain(&[Base::Range])),
                (floors.sensor_lag_s + 0.005, plain(&[Base::Speed])),
            ],
            Self::Bearing => {
                vec![(0.003, plain(&[])), (floors.sensor_lag_s + 0.005, plain(&[Base::YawRate]))]
            }
        }
    }

    /// Whether a unit has rows that show it.
    pub(crate) fn is_recorded(self, unit: &Unit<'_>) -> bool {
        self.main(unit).is_some()
    }

    /// The stretch and the component that show it most.
    pub(crate) fn main(self, unit: &Unit<'_>) -> Option<(usize, usize)> {
        let stretch = |channel: Channel| {
            unit.stretches.iter().position(|stretch| stretch.channel == channel && stretch.rows > 0)
        };
        self.channels().iter().find_map(|&(channel, component)| Some((stretch(channel)?, component)))
    }

    /// The stretches of a unit that show it.
    pub(crate) fn shown(self, unit: &Unit<'_>) -> Vec<usize> {
        let shows = |which: &usize| {
            let stretch = &unit.stretches[*which];
            stretch.rows > 0 && self.shows_in(stretch.channel)
        };
        (0..unit.stretches.len()).filter(shows).collect()
    }

    /// What the residuals of a unit gain for every unit of a function that is added.
    pub(crate) fn column(self, unit: &Unit<'_>, motions: &Motions, function: &Function<'_>) -> Column {
        let value = |which: usize| motions.samples(unit, which).iter().map(function).collect();
        self.gathered(unit, motions, &|which| value(which))
    }

    /// The same, from what the function is at the samples of each stretch that shows it.
    pub(crate) fn gathered(
        self,
        unit: &Unit<'_>,
        motions: &Motions,
        values_of: &dyn Fn(usize) -> Vec<f64>,
    ) -> Column {
        let mut column = Column::empty(unit);
        for which in self.shown(unit) {
            let stretch = &unit.stretches[which];
            let mut part = vec![0.0; stretch.rows * stretch.components];
            let values = values_of(which);
            match stretch.channel {
                Channel::Body | Channel::CommandedBody => self.roll(motions, &values, &mut part),
                Channel::Gyro => {
                    for (mean, span) in part.iter_mut().zip(&motions.gyro.rows) {
                        let own = &values[span.first..span.first + span.count];
                        *mean = own.iter().sum::<f64>() / span.count as f64;
                    }
                }
                Channel::Actuator => self.drive(unit, &motions.driven, &values, &mut part),
                _ => {
                    let rows = part.chunks_exact_mut(stretch.components);
                    let component = self.component(stretch.channel);
                    rows.zip(values).for_each(|(row, value)| row[component] = value);
                }
            }
            // A column is the derivative of measured minus predicted by a coefficient of the prediction.
            for value in &mut part {
                *value = -*value;
            }
            if part.iter().any(|value| *value != 0.0) {
                column.parts[which] = Some(part);
            }
        }
        column
    }

    fn shows_in(self, channel: Channel) -> bool {
        self.channels().iter().any(|(own, _)| *own == channel)
    }

    fn component(self, channel: Channel) -> usize {
        self.channels().iter().find(|(own, _)| *own == channel).map_or(0, |(_, component)| *component)
    }

    /// Sums a rate of the body over windows, in the frame that the robot has in the middle of each.
    fn roll(self, motions: &Motions, rates: &[f64], part: &mut [f64]) {
        let body = &motions.body;
        for (values, &Span { first, count, step_s }) in part.chunks_exact_mut(3).zip(&body.rows) {
            let samples = first..first + count;
            let turned = body.turned[samples.clone()].iter();
            let rates = rates[samples.clone()].iter().zip(turned);
            let (mut ahead, mut left) = (0.0, 0.0);
            match self {
                Self::Forward => {
                    for (rate, [cos, sin]) in rates {
                        let added = rate * step_s;
                        ahead += added * cos;
                        left += added * sin;
                    }
                }
                Self::Left => {
                    for (rate, [cos, sin]) in rates {
                        let added = rate * step_s;
                        ahead -= added * sin;
                        left += added * cos;
                    }
                }
                _ => {
                    // By how much the heading is off so far.
                    let mut off_rad = 0.0;
                    for ((rate, [cos, sin]), driven_m) in rates.zip(&body.driven_m[samples]) {
                        let added = rate * step_s;
                        off_rad += added;
                        let along = driven_m * (off_rad - 0.5 * added);
                        ahead -= along * sin;
                        left += along * cos;
                    }
                    values[2] = off_rad;
                }
            }
            (values[0], values[1]) = (ahead, left);
        }
    }

    /// Passes a set-point through the servo and sums it over the windows of the wheels.
    fn drive(self, unit: &Unit<'_>, driven: &Driven, set_points: &[f64], part: &mut [f64]) {
        let axis = usize::from(self == Self::SetYawRate);
        let step_s = driven.step_s;
        let keep = libm::exp(-step_s / driven.time_constants_s[axis].max(1e-3));
        let (mut reached, mut sum) = (0.0, 0.0);
        let mut sums = Vec::with_capacity(driven.samples.len() + 1);
        sums.push(0.0);
        for &asked in set_points {
            let next = asked + (reached - asked) * keep;
            sum += step_s * asked + driven.time_constants_s[axis] * (reached - next);
            reached = next;
            sums.push(sum);
        }
        let until = |time_s: f64| {
            let position = ((time_s - driven.from_s) / step_s).max(0.0);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "not negative")]
            let before = (position as usize).min(sums.len() - 1);
            let after = (before + 1).min(sums.len() - 1);
            sums[before] + (position - before as f64).min(1.0) * (sums[after] - sums[before])
        };
        let nominal = &unit.nominal().nominal;
        let ratio = match unit.nominal().drive {
            pleiad_physics::Drive::SkidSteer { track_ratio } => track_ratio,
            _ => 1.0,
        };
        let scale = if axis == 0 { 1.0 } else { nominal.track_width * ratio } / nominal.wheel_radius;
        for (values, &(from_s, to_s)) in part.chunks_exact_mut(2).zip(&driven.ends_s) {
            values[axis] = (until(to_s) - until(from_s)) * scale;
        }
    }

    /// What the robot did at every row of the component that shows it most.
    pub(crate) fn instants(self, unit: &Unit<'_>, motions: &Motions) -> Vec<Instant> {
        let Some((which, _)) = self.main(unit) else { return Vec::new() };
        let middle = |samples: &[Instant], span: &Span| samples[span.first + span.count / 2];
        match unit.stretches[which].channel {
            Channel::Body | Channel::CommandedBody => {
                motions.body.rows.iter().map(|span| middle(&motions.body.samples, span)).collect()
            }
            Channel::Gyro => {
                motions.gyro.rows.iter().map(|span| middle(&motions.gyro.samples, span)).collect()
            }
            Channel::Actuator => {
                let driven = &motions.driven;
                let at = |&(from_s, to_s): &(f64, f64)| {
                    let middle_s = f64::midpoint(from_s, to_s);
                    let position = ((middle_s - driven.from_s) / driven.step_s).max(0.0);
                    #[allow(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "not negative"
                    )]
                    let index = (position as usize).min(driven.samples.len() - 1);
                    driven.samples[index]
                };
                driven.ends_s.iter().map(at).collect()
            }
            _ => motions.readings[which].clone(),
        }
    }
}
