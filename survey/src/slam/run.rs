//! One run of the filter and how it is judged.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use pleiad_estimation::geometry::{Matrix3, Vector2, wrap_angle};
use pleiad_estimation::joint::ErrorForm;
use pleiad_estimation::slam::{
    Association, JointRules, JointSlam, MapEntry, MapId, Slam, SlamRun, SlamSettings, SlamState,
};
use pleiad_estimation::statistics::{Alignment, PosePair, absolute_trajectory_error, nees};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{LandmarkId, Pose2, Timestamp};

use super::input::SlamInput;
use super::judge::{Associated, Judge};
use crate::error::SurveyError;

/// How the filter is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunOptions {
    /// In which coordinates errors are Gaussian.
    pub form: ErrorForm,
    /// How sightings find their landmarks.
    pub association: Association,
    /// Ranges are taken away.
    pub without_ranges: bool,
    /// The landmarks are known beforehand: localization alone, the reference.
    pub known: bool,
    /// The gate of association and that of new landmarks times this; 1 but where a mistake is planted.
    pub gate_factor: f64,
}

impl Default for RunOptions {
    fn default() -> Self {
        Self {
            form: ErrorForm::Invariant,
            association: Association::Identity,
            without_ranges: false,
            known: false,
            gate_factor: 1.0,
        }
    }
}

/// The filter after one scan, against the truth.
#[derive(Clone, Debug)]
pub struct Moment {
    /// When.
    pub time: Timestamp,
    /// Where the vehicle is estimated.
    pub pose: Pose2,
    /// Where it was.
    pub truth: Option<Pose2>,
    /// Covariance of position and yaw (additive).
    pub covariance: Symmetric3,
    /// Standard deviation of every landmark in the map, root of the mean over both axes, m.
    pub sigma_m: Vec<(MapId, f64)>,
}

/// A landmark at the end of a run.
#[derive(Clone, Debug)]
pub struct Mapped {
    /// Which.
    pub id: MapId,
    /// The landmark whose sighting founded it.
    pub of: LandmarkId,
    /// Where it is estimated.
    pub position: Vector2,
    /// Where it is, if the truth knows it.
    pub truth: Option<Vector2>,
    /// Covariance of its position.
    pub covariance: Symmetric3,
}

/// A run.
#[derive(Clone, Debug)]
pub struct Ran {
    /// After every scan.
    pub moments: Vec<Moment>,
    /// Confirmed landmarks at the end.
    pub map: Vec<Mapped>,
    /// Covariance of their positions, two rows each.
    pub map_covariance: DMatrix<f64>,
    /// What was associated.
    pub associated: Associated,
    /// NIS of the used and rejected sightings over their degrees of freedom.
    pub nis: Vec<f64>,
    /// Most past poses that were in the state at once.
    pub most_waiting_poses: usize,
    /// Sightings and odometry that were refused.
    pub refused: usize,
    /// The filter at the end.
    pub slam: Slam,
    /// Which landmark every one of the map is.
    pub births: BTreeMap<MapId, LandmarkId>,
}

/// Runs the filter; `watch` sees it after every scan, with the landmarks that its map's are.
///
/// # Errors
/// [`SurveyError::Diverged`] if an estimate is not finite.
pub fn run(
    input: &SlamInput,
    options: &RunOptions,
    mut watch: impl FnMut(&Slam, Timestamp, &BTreeMap<MapId, LandmarkId>),
) -> Result<Ran, SurveyError> {
    let noises = if options.without_ranges { input.noises_with_bearing() } else { input.noises };
    let mut settings = SlamSettings::new(options.form, noises);
    settings.association = options.association;
    for (gate, apart) in settings.gate.iter_mut().zip(&mut settings.apart) {
        *gate *= options.gate_factor;
        *apart *= options.gate_factor;
    }
    let mut slam = Slam::new(settings, input.start, input.start_noise);
    let joint = options.association == Association::Joint && !options.known;
    let mut births = BTreeMap::new();
    if options.known {
        let first = input.samples.first().map_or(Timestamp(0), |sample| sample.time);
        for (name, [x, y]) in &input.landmarks {
            births.insert(slam.know(*name, Vector2::new(*x, *y), first), *name);
        }
    }
    let mut judge = Judge { births, ..Judge::default() };
    let mut running = if joint {
        let rules = JointRules::default();
        SlamRun::joint(JointSlam::new(settings, rules, input.start, input.start_noise), input.motion)
    } else {
        SlamRun::new(slam, input.motion)
    };
    for sample in input.fed(options.without_ranges) {
        let taken = running.sample(&sample, |slam, scan| {
            if joint {
                judge.names.extend(scan.sightings.iter().map(|(name, _)| *name));
            } else {
                judge.scan(slam, scan);
            }
            judge.moment(slam, scan.time, &input.recorded);
            watch(slam, scan.time, &judge.births);
        });
        judge.refused += usize::from(taken.is_err());
    }
    if let Some(outcomes) = running.settled_outcomes() {
        judge.settled(&outcomes, settings.confirm_sightings);
    }
    let slam = running.slam().clone();
    if !slam.state().vehicle().is_finite() {
        let what = "the estimate is not finite".to_owned();
        return Err(SurveyError::Diverged { study: super::NAME, seed: 0, what });
    }
    let confirmed: Vec<MapEntry> = slam.map().iter().filter(|entry| entry.confirmed).copied().collect();
    let blocks: Vec<_> = confirmed.iter().map(|entry| entry.block).collect();
    let map = confirmed.iter().filter_map(|entry| {
        let of = *judge.births.get(&entry.id)?;
        let p = slam.state().position_covariance(entry.block, entry.block);
        Some(Mapped {
            id: entry.id,
            of,
            position: slam.position(entry),
            truth: input.landmarks.get(&of).map(|[x, y]| Vector2::new(*x, *y)),
            covariance: Symmetric3([p[(0, 0)], p[(1, 0)], p[(1, 1)], 0.0, 0.0, 0.0]),
        })
    });
    Ok(Ran {
        map: map.collect(),
        map_covariance: slam.state().map_covariance(&blocks),
        moments: judge.moments,
        associated: judge.associated,
        nis: judge.nis,
        most_waiting_poses: judge.most_waiting_poses,
        refused: judge.refused,
        births: judge.births,
        slam,
    })
}

impl Ran {
    /// Root of the mean square distance of the landmarks from where they are, m: as it is, or after the motion of
    /// the whole map that fits best.
    pub fn map_error_m(&self, alignment: Alignment) -> Option<f64> {
        let pair = |mapped: &Mapped| {
            let pose = |point: Vector2| Pose2::new(point.x, point.y, 0.0);
            Some(PosePair { time: Timestamp(0), estimate: pose(mapped.position), truth: pose(mapped.truth?) })
        };
        let pairs: Vec<PosePair> = self.map.iter().filter_map(pair).collect();
        absolute_trajectory_error(&pairs, alignment).map(|error| error.rmse)
    }

    /// Root of the mean square error of the vehicle's position, m.
    pub fn trajectory_error_m(&self, alignment: Alignment) -> Option<f64> {
        let pairs: Vec<PosePair> = self
            .moments
            .iter()
            .filter_map(|moment| {
                Some(PosePair { time: moment.time, estimate: moment.pose, truth: moment.truth? })
            })
            .collect();
        absolute_trajectory_error(&pairs, alignment).map(|error| error.rmse)
    }

    /// Mean NIS per degree of freedom, rejected sightings included.
    pub fn mean_nis(&self) -> Option<f64> {
        (!self.nis.is_empty()).then(|| self.nis.iter().sum::<f64>() / self.nis.len() as f64)
    }
}

/// Error and covariance of the vehicle's pose in the coordinates of the form: `log(X Xhat^-1)`, or the differences.
pub fn pose_error(slam: &Slam, truth: &Pose2) -> (DVector<f64>, DMatrix<f64>) {
    let (state, estimate) = (slam.state(), slam.state().vehicle());
    let error = match state.form() {
        ErrorForm::Invariant => truth.compose(&estimate.inverse()).log(),
        ErrorForm::Additive => nalgebra::Vector3::new(
            truth.x_m() - estimate.x_m(),
            truth.y_m() - estimate.y_m(),
            wrap_angle(truth.yaw_rad() - estimate.yaw_rad()),
        ),
    };
    let covariance = state.error_covariance(SlamState::VEHICLE, SlamState::VEHICLE);
    (DVector::from_column_slice(error.as_slice()), DMatrix::from_column_slice(3, 3, covariance.as_slice()))
}

/// Error and covariance of the confirmed landmarks as the vehicle sees them, `R^T (l - p)`: what sightings measure, so
/// that an error common to vehicle and map is not in it. `None` if there is no landmark.
pub fn seen_map_error(
    slam: &Slam,
    truth: &Pose2,
    births: &BTreeMap<MapId, LandmarkId>,
    landmarks: &BTreeMap<LandmarkId, [f64; 2]>,
) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let (state, estimate) = (slam.state(), slam.state().vehicle());
    let known: Vec<(MapEntry, Vector2)> = slam
        .map()
        .iter()
        .filter(|entry| entry.confirmed)
        .filter_map(|entry| {
            let [x, y] = landmarks.get(births.get(&entry.id)?)?;
            Some((*entry, Vector2::new(*x, *y)))
        })
        .collect();
    if known.is_empty() {
        return None;
    }
    // d (R^T (l - p)) = R^T [I, J l] (xi_l - xi_v); of the additive errors R^T (e_l - e_p - J (l - p) e_yaw).
    let turn_back = |m: nalgebra::Matrix2x3<f64>| {
        let mut turned = m;
        for column in 0..3 {
            let v = estimate.rotate_back(Vector2::new(m[(0, column)], m[(1, column)]));
            turned.set_column(column, &v);
        }
        turned
    };
    let lever = |p: Vector2| nalgebra::Matrix2x3::new(1.0, 0.0, -p.y, 0.0, 1.0, p.x);
    let rows: Vec<_> = known
        .iter()
        .map(|(entry, _)| {
            let l = slam.position(entry);
            match state.form() {
                ErrorForm::Invariant => (turn_back(lever(l)), turn_back(-lever(l))),
                ErrorForm::Additive => {
                    (turn_back(lever(Vector2::zeros())), turn_back(-lever(l - estimate.position())))
                }
            }
        })
        .collect();
    let (size, vehicle) = (2 * known.len(), SlamState::VEHICLE);
    let (mut error, mut covariance) = (DVector::zeros(size), DMatrix::zeros(size, size));
    let own: Matrix3 = state.error_covariance(vehicle, vehicle);
    for (i, (entry, place)) in known.iter().enumerate() {
        let seen = truth.rotate_back(place - truth.position());
        let predicted = estimate.rotate_back(slam.position(entry) - estimate.position());
        error.fixed_rows_mut::<2>(2 * i).copy_from(&(seen - predicted));
        for (j, (other, _)) in known.iter().enumerate() {
            let ((a, va), (b, vb)) = (&rows[i], &rows[j]);
            let block = a * state.error_covariance(entry.block, other.block) * b.transpose()
                + a * state.error_covariance(entry.block, vehicle) * vb.transpose()
                + va * state.error_covariance(vehicle, other.block) * b.transpose()
                + va * own * vb.transpose();
            covariance.view_mut((2 * i, 2 * j), (2, 2)).copy_from(&block);
        }
    }
    Some((error, covariance))
}

/// `e^T P^-1 e` over its dimension.
pub fn per_dimension((error, covariance): &(DVector<f64>, DMatrix<f64>)) -> Option<f64> {
    nees(error, covariance).map(|nees| nees / error.len() as f64)
}
