//! How a boot begins.

use pleiad_estimation::fact::{
    Absolute, Body, Boot, Continuation, NoiseRef, Observation, Profile, Quantity, extension_of_boot,
};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, Pose2, Timestamp};

use super::{Node, Notice};

impl Node {
    /// A boot begins at `time`: at the first odometry of this start, and after every gap of the odometry.
    pub(super) fn begin_boot(&mut self, time: Timestamp) {
        self.begin_boot_at(time, None);
    }

    /// A boot begins; `rebased` is where its trajectory begins if it goes on without a gap.
    pub(super) fn begin_boot_at(&mut self, time: Timestamp, rebased: Option<Pose2>) {
        let joined = self.membership.joining.take();
        let index = self.next_boot().max(joined.unwrap_or_default()).max(self.first_of_stay());
        if joined.is_some_and(|boot| self.first_of_stay() < boot) {
            // Its eviction was lost with the others' disks; what it has said is asked for as after that of its own.
            self.forget_past();
        }
        let place = self.ledger.settle().member(self.config.robot).map(|member| member.boot);
        let continuation = self.segments.last().map(|(previous, trajectory)| {
            let (end, last) = trajectory.end();
            let gap_s = if rebased.is_some() { 0.0 } else { time.seconds_since(end) };
            let [x, y, yaw] = self.config.motion_limits.map(|limit| (limit * gap_s).powi(2));
            Continuation { previous, time: end, last, gap: Symmetric3::diagonal(x, y, yaw) }
        });
        // Evicted in a boot that the team never heard of: nothing there to carry on from.
        let continuation = continuation.filter(|from| joined.is_none() || place == Some(from.previous));
        let prior = self.config.prior.filter(|prior| continuation.is_none() && prior.for_boot == index.0);
        // The nominal trajectory begins where the last one ended, so that `odom` has no jump; the first
        // one at the prior, so that it reads as dead reckoning in the map.
        let nominal = match (&continuation, &self.config.prior) {
            (Some(continuation), _) => rebased.unwrap_or(continuation.last.nominal),
            (None, Some(prior)) => prior.pose,
            (None, None) => Pose2::identity(),
        };
        let odom = self.odom_of(&Boot {
            time,
            nonce: 0,
            configuration: 0,
            nominal,
            continuation,
            calibration: None,
        });
        self.membership.lost_disk |= self.segments.last().is_none() && index > BootIndex(0);
        self.lived = true;
        self.lived_boots.insert(index);
        self.rebased = None;
        self.first_odometry = self.first_odometry.or(Some(time));
        self.boot = Some(index);
        self.known_boot = Some(index);
        self.segments.begin(index, time, nominal, odom, self.config.history_samples);
        self.keep_tick();
        let nonce = self.nonce.wrapping_add(u64::from(index.0));
        let configuration = self.ledger.configuration();
        let uncertain = self.config.calibration.filter(|calibration| !calibration.is_none());
        let last = continuation.and_then(|from| from.last.sensitivity);
        let extension =
            uncertain.map_or_else(Vec::new, |calibration| extension_of_boot(&calibration, last.as_ref()));
        let boot = Boot { time, nonce, configuration, nominal, continuation, calibration: None };
        self.say_more(index, Body::Boot(boot), extension);
        self.say(index, Body::ClockMap(self.config.clock));
        for (profile, noise) in (0u16..).zip(self.config.sensors.profiles()) {
            if let Some(noise) = noise {
                self.say(index, Body::Profile(Profile { index: profile, noise }));
            }
        }
        if let Some(prior) = prior
            && let Ok(observer) = self.segments.current(time)
        {
            let quantity = Quantity::Absolute(Absolute::Pose(prior.pose));
            let noise = NoiseRef::Explicit(prior.noise);
            self.say(index, Body::Observation(Observation { time, quantity, noise, observer }));
        } else if continuation.is_none() && self.config.fold.join {
            self.notice(Notice::Searching { boot: index });
        } else if continuation.is_none() {
            self.notice(Notice::NoPrior { boot: index });
        }
    }

    /// Restarted or admitted after the last odometry there will be: the last boot is carried on from its end, to
    /// be of the team and to answer what is still asked, whenever it comes to be known.
    pub(super) fn carry_on_at_the_end(&mut self) {
        if !self.input_ended || self.boot.is_some() {
            return;
        }
        let lived = self.lived || self.membership.joining.is_some();
        let asked = self.ledger.unanswered(self.config.robot).next().is_some();
        let Some((_, trajectory)) = self.segments.last() else { return };
        let begin = Timestamp(trajectory.end().0.max(self.stay_from()).0 + 1);
        if (lived || asked) && self.may_begin(begin) {
            self.begin_boot(begin);
            self.answer();
        }
    }

    /// `odom_from_nominal` of a boot: the published frame goes on from the boot it carries on.
    pub(super) fn odom_of(&self, boot: &Boot) -> Pose2 {
        boot.continuation.as_ref().map_or_else(Pose2::identity, |from| {
            let odom = self.segments.odom();
            // Exactly as it was where the trajectory goes on as it was.
            if from.last.nominal == boot.nominal {
                odom
            } else {
                odom.compose(&from.last.nominal).compose(&boot.nominal.inverse())
            }
        })
    }
}
