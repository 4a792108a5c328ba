//! With landmarks that are told apart for certain and a start that is told, there is one hypothesis: the plain
//! filter. It is compared with the reference filter, which shares no code with it.

use pleiad_estimation::fact::{Absolute, Boot, EntryId, Noise, NominalState, Quantity};
use pleiad_estimation::geometry::{Matrix3, Vector3, wrap_angle};
use pleiad_estimation::hypotheses::{Belief, KindOfLandmark, Localizer, Settings, Sighting};
use pleiad_estimation::reference::{ErrorForm, FactContent, JointEkf, Measurement, ReferenceFact, State};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, Pose2, Sequence, Timestamp};
use pleiad_sim_peers::Scenario;

use super::NAME;
use super::drive::{ROBOT, World, map_of};
use crate::SurveyError;

const BOOT: BootIndex = BootIndex(0);

/// The largest difference of any number of pose and covariance at the end of a run.
pub(super) fn difference(scenario: &Scenario, seed: u64) -> Result<f64, SurveyError> {
    let mut scenario = scenario.clone();
    scenario.robots.values_mut().for_each(|own| own.prior.known = true);
    let world = World::new(&scenario, seed)?;
    let diverged = |what: &str| SurveyError::Diverged { study: NAME, seed, what: what.to_owned() };
    let prior = world.run.priors.get(&ROBOT).ok_or_else(|| diverged("the robot was told no start"))?;
    let (sigma_m, sigma_rad) = (prior.sigma_position_m, prior.sigma_heading_rad);
    let start = NominalState::new(Pose2::identity(), Symmetric3::zero());

    // Every landmark is of a kind of its own.
    let mut map = map_of(&scenario);
    map.landmarks.iter_mut().enumerate().for_each(|(index, landmark)| landmark.kind = KindOfLandmark(index));
    let told =
        Matrix3::from_diagonal(&Vector3::new(sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad));
    let settings = Settings { gate: f64::INFINITY, carried_off_hz: 0.0, ..Settings::default() };
    let mut localizer = Localizer::told(map.clone(), settings, &prior.pose, &told, &start);

    let begun = world.nominal.start();
    let mut facts = Facts::begin(begun);
    let told = Quantity::Absolute(Absolute::Pose(prior.pose));
    facts.add(begun, told, Noise::from_sigmas(&[sigma_m, sigma_m, sigma_rad]), start);
    for (time, observer, seen, relative) in world.sightings() {
        let Some(index) = map.landmarks.iter().position(|landmark| landmark.id == seen) else { continue };
        let mut recognition = vec![0.0; map.landmarks.len()];
        recognition[index] = 1.0;
        let sighting = Sighting { time, observer, relative, noise: world.noise, recognition: &recognition };
        localizer.sighted(&sighting).map_err(|error| diverged(&error.to_string()))?;
        let position_m = map.landmarks[index].position_m;
        let landmark =
            Quantity::Landmark { landmark: seen, position_m: [position_m.x, position_m.y], relative };
        facts.add(time, landmark, world.noise, observer);
    }
    let oracle = JointEkf { form: ErrorForm::Invariant, gate: [f64::INFINITY; 3] }.fold(&facts.all);
    let (_, end) = world.nominal.end();
    let (pose, invariant) =
        oracle.predict(ROBOT, &end).ok_or_else(|| diverged("the oracle lost the robot"))?;
    let published = pose.additive_from_invariant();
    let covariance = published * invariant * published.transpose();
    let Belief::One(own) = localizer.belief(&end) else {
        return Err(diverged("there is not one hypothesis"));
    };
    let offset = own.pose.position() - pose.position();
    let parts = [offset.x, offset.y, wrap_angle(own.pose.yaw_rad() - pose.yaw_rad()), own.weight - 1.0];
    let apart = (own.covariance.to_matrix() - covariance).amax();
    Ok(parts.into_iter().map(f64::abs).fold(apart, f64::max))
}

struct Facts {
    all: Vec<ReferenceFact>,
}

impl Facts {
    fn begin(time: Timestamp) -> Self {
        let nominal = Pose2::identity();
        let boot = Boot { time, nonce: 0, configuration: 0, nominal, continuation: None, calibration: None };
        Self { all: vec![ReferenceFact { id: id(0), time, content: FactContent::Boot(boot) }] }
    }

    fn add(&mut self, time: Timestamp, quantity: Quantity, noise: Noise, nominal: NominalState) {
        let observer = State { robot: ROBOT, boot: BOOT, nominal };
        let measurement = Measurement { quantity, noise, observer, observed: None };
        let content = FactContent::Measurement(measurement);
        self.all.push(ReferenceFact { id: id(self.all.len() as u64), time, content });
    }
}

fn id(sequence: u64) -> EntryId {
    EntryId { robot: ROBOT, boot: BOOT, sequence: Sequence(sequence) }
}
