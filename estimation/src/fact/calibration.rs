//! What is uncertain about a robot besides its pose: how its odometry errs, where its sensor sits, how its clock is wrong.
//!
//! Each is a number that stays what it is, so that the error of a pose depends on it linearly and the measurement too. A robot
//! says once how uncertain each is, in the extension of the entry that begins its boot, and how its nominal state
//! depends on them in the extension of each entry with such a state. So facts stay raw, and whoever does not know the
//! extension keeps and passes it on.

use super::entry::{Answer, Body, Entry, Half};
use crate::geometry::{Matrix3, Vector3};

/// Standard deviations of what a robot is not sure of. What is zero is known; a group that is all zero is not estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Calibration {
    /// Odometry: true over reported distance minus 1, true over reported angle minus 1, and the rate that the yaw
    /// shows at standstill, rad/s.
    pub motion: [f64; 3],
    /// Pose of the frame in which the robot sees others, in its body frame: forward m, left m, yaw rad.
    pub mount: [f64; 3],
    /// Clock: what it shows minus team time when the boot begins, s, and how much of a second it gains in one.
    pub clock: [f64; 2],
}

impl Calibration {
    /// Whether nothing is uncertain.
    pub fn is_none(&self) -> bool {
        self.motion.iter().chain(&self.mount).chain(&self.clock).all(|sigma| *sigma == 0.0)
    }

    fn numbers(&self) -> [f64; 8] {
        let ([a, b, c], [d, e, f], [g, h]) = (self.motion, self.mount, self.clock);
        [a, b, c, d, e, f, g, h]
    }
}

/// How a nominal state depends on what is calibrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensitivity {
    /// Derivative of the nominal pose by the parameters of the odometry, in the frame of the nominal trajectory: a pose with
    /// parameters `p` is `exp(motion p) N`. Columns in the order of [`Calibration::motion`].
    pub motion: Matrix3,
    /// Velocity in the body frame: m/s, m/s, rad/s.
    pub twist: Vector3,
}

impl Sensitivity {
    fn numbers(&self) -> [f64; 12] {
        let mut numbers = [0.0; 12];
        for row in 0..3 {
            for column in 0..3 {
                numbers[3 * row + column] = self.motion[(row, column)];
            }
            numbers[9 + row] = self.twist[row];
        }
        numbers
    }

    fn of(numbers: &[f64; 12]) -> Self {
        Self {
            motion: Matrix3::from_fn(|row, column| numbers[3 * row + column]),
            twist: Vector3::new(numbers[9], numbers[10], numbers[11]),
        }
    }
}

const CALIBRATION: u8 = 1;
const SENSITIVITY: u8 = 2;
const CARRIED_ON: u8 = 3;
const TWIST: u8 = 4;

/// The extension of an entry that begins a boot of a robot with these uncertainties; `last` is that of the nominal state
/// with which the boot carried on from ended.
pub fn extension_of_boot(calibration: &Calibration, last: Option<&Sensitivity>) -> Vec<u8> {
    let tag = if last.is_some() { CARRIED_ON } else { CALIBRATION };
    let last = last.map_or_else(Vec::new, |last| last.numbers().to_vec());
    bytes(tag, &[calibration.numbers().as_slice(), &last].concat())
}

/// The extension of an entry with a nominal state. A state that does not depend on the odometry's parameters says its velocity alone.
pub fn extension_of_state(sensitivity: &Sensitivity) -> Vec<u8> {
    if sensitivity.motion == Matrix3::zeros() {
        return bytes(TWIST, sensitivity.twist.as_slice());
    }
    bytes(SENSITIVITY, &sensitivity.numbers())
}

fn bytes(tag: u8, numbers: &[f64]) -> Vec<u8> {
    std::iter::once(tag).chain(numbers.iter().flat_map(|number| number.to_le_bytes())).collect()
}

/// The numbers of an extension with this tag; `None` if it is another, or not finite.
fn numbers<const N: usize>(tag: u8, extension: &[u8]) -> Option<[f64; N]> {
    let (first, rest) = extension.split_first()?;
    if *first != tag || rest.len() != 8 * N {
        return None;
    }
    let mut found = [0.0; N];
    for (number, eight) in found.iter_mut().zip(rest.chunks_exact(8)) {
        *number = f64::from_le_bytes(eight.try_into().ok()?);
    }
    found.iter().all(|number| number.is_finite()).then_some(found)
}

/// What the extension of an entry that begins a boot says.
fn of_boot(extension: &[u8]) -> Option<(Calibration, Option<Sensitivity>)> {
    let (said, last) = if let Some(said) = numbers::<8>(CALIBRATION, extension) {
        (said, None)
    } else {
        let all = numbers::<20>(CARRIED_ON, extension)?;
        let (said, last) = (all.first_chunk::<8>()?, all.last_chunk::<12>()?);
        (*said, Some(Sensitivity::of(last)))
    };
    let [a, b, c, d, e, f, g, h] = said;
    let calibration = Calibration { motion: [a, b, c], mount: [d, e, f], clock: [g, h] };
    let sound = said.iter().all(|sigma| *sigma >= 0.0) && !calibration.is_none();
    sound.then_some((calibration, last))
}

/// Fills in what the extension of an entry says of the state or the boot in it.
pub fn read_extension(entry: &mut Entry) {
    if entry.extension.is_empty() {
        return;
    }
    let sensitivity = match numbers::<3>(TWIST, &entry.extension) {
        Some(twist) => Some(Sensitivity { motion: Matrix3::zeros(), twist: twist.into() }),
        None => numbers::<12>(SENSITIVITY, &entry.extension).map(|of| Sensitivity::of(&of)),
    };
    match &mut entry.body {
        Body::Observation(observation) => observation.observer.sensitivity = sensitivity,
        Body::Half(Half { answer: Answer::State { state, .. }, .. }) => state.sensitivity = sensitivity,
        Body::Boot(boot) => {
            if let Some((calibration, last)) = of_boot(&entry.extension) {
                boot.calibration = Some(calibration);
                if let Some(continuation) = &mut boot.continuation {
                    continuation.last.sensitivity = last;
                }
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::super::entry::{Absolute, EntryId, Noise, NoiseRef, NominalState, Observation, Quantity};
    use super::*;
    use crate::symmetric::Symmetric3;
    use crate::{BootIndex, Pose2, RobotId, Sequence, Timestamp};

    fn observation(extension: Vec<u8>) -> Entry {
        let observer = NominalState::new(Pose2::identity(), Symmetric3::zero());
        let body = Body::Observation(Observation {
            time: Timestamp(1),
            quantity: Quantity::Absolute(Absolute::Heading(0.0)),
            noise: NoiseRef::Explicit(Noise::from_sigmas(&[0.1])),
            observer,
        });
        Entry {
            id: EntryId { robot: RobotId(1), boot: BootIndex(0), sequence: Sequence(3) },
            body,
            extension,
        }
    }

    fn read(extension: Vec<u8>) -> Option<Sensitivity> {
        let mut entry = observation(extension);
        read_extension(&mut entry);
        let Body::Observation(observation) = entry.body else { unreachable!() };
        observation.observer.sensitivity
    }

    #[test]
    fn a_sensitivity_is_read_as_it_was_written() {
        let said = Sensitivity {
            motion: Matrix3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0),
            twist: Vector3::new(-1.0, 0.5, 0.25),
        };
        assert_eq!(read(extension_of_state(&said)), Some(said));
        let velocity = Sensitivity { motion: Matrix3::zeros(), ..said };
        assert_eq!(extension_of_state(&velocity).len(), 25);
        assert_eq!(read(extension_of_state(&velocity)), Some(velocity));
    }

    #[test]
    fn what_is_not_a_sensitivity_is_left_alone() {
        let zero = Sensitivity { motion: Matrix3::identity(), twist: Vector3::zeros() };
        let mut short = extension_of_state(&zero);
        short.pop();
        let mut other = extension_of_state(&zero);
        other[0] = 9;
        let infinite = extension_of_state(&Sensitivity { twist: Vector3::repeat(f64::INFINITY), ..zero });
        for extension in [Vec::new(), short, other, infinite, vec![1, 2, 3]] {
            assert_eq!(read(extension), None);
        }
    }
}
