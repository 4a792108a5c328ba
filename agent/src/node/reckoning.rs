//! Dead reckoning as the node does it, live and from its journal alike: with the model of the robot, if
//! there is one.

use pleiad_estimation::motion::{DeadReckoning, OdometryRefusal};
use pleiad_estimation::sample::{Sample, SampleRefusal};
use pleiad_estimation::{BootIndex, Pose2, Timestamp};

use super::Node;

impl Node {
    /// The sample at the instant it is of, as far as the model knows.
    pub(super) fn on_time(&mut self, sample: Sample) -> Sample {
        match &mut self.corrector {
            Some(corrector) => corrector.on_time(&sample, self.segments.last()),
            None => sample,
        }
    }

    /// A gyro reading, for dead reckoning.
    pub(super) fn gyro(&mut self, time: Timestamp, yaw_rate_rad_s: f64) {
        let rate_rad_s = match &mut self.corrector {
            Some(corrector) => corrector.gyro(time, yaw_rate_rad_s, self.segments.last()),
            None => yaw_rate_rad_s,
        };
        self.dead_reckoning.gyro(time, rate_rad_s);
    }

    /// Dead reckoning starts anew at an odometry sample: the first one, or the first after a gap.
    pub(super) fn restart(&mut self, sample: Sample) -> Result<(), OdometryRefusal> {
        let sample = match &mut self.corrector {
            Some(corrector) => corrector.begin(&sample)?,
            None => sample,
        };
        // A reading without geometry or of no number is refused before anything begins.
        DeadReckoning::new(self.config.motion).odometry(sample)?;
        self.dead_reckoning.restart(sample);
        Ok(())
    }

    /// The nominal trajectory goes on to an odometry sample.
    pub(super) fn reckon(&mut self, sample: Sample) -> Result<(), OdometryRefusal> {
        let sample = match &mut self.corrector {
            Some(corrector) => corrector.next(&sample, self.segments.last())?,
            None => sample,
        };
        if let Some(step) = self.dead_reckoning.odometry(sample)? {
            self.segments.extend(&step);
            self.keep_tick();
        }
        Ok(())
    }

    /// Odometry of a former life, of which only the corrector has something to learn.
    pub(super) fn correct_again(&mut self, sample: Sample) {
        if let Some(corrector) = &mut self.corrector
            && corrector.next(&sample, self.segments.last()).is_err()
        {
            // The first one after a gap; what is refused twice was refused then.
            let _ = corrector.begin(&sample);
        }
    }

    /// An observation as a nominal sensor would have made it. `nominal` is dead reckoning at its time.
    pub(super) fn as_nominal(
        &mut self,
        sample: &Sample,
        nominal: (BootIndex, &Pose2),
    ) -> Result<Sample, SampleRefusal> {
        let Some(corrector) = &mut self.corrector else { return Ok(*sample) };
        let landmarks = &self.config.landmarks;
        let sample = corrector.observation(sample, nominal, |landmark| landmarks.get(&landmark).copied());
        // A model far from the truth can make nonsense of a sound reading.
        sample.check()?;
        Ok(sample)
    }
}
