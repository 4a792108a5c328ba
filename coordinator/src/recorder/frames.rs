//! Messages in a file. The magic `PLEIADR1`, then frames of `length u32 | elapsed_ns u64 | robot u32 |
//! message`, little-endian: the length is the message's, the time that since the recording began, the robot
//! the one whose key it came by.

use std::io::{self, Write};
use std::path::Path;
use std::time::Duration;

use pleiad_protocol::{RobotId, limits};

use super::RecorderError;

pub(super) const MAGIC: &[u8; 8] = b"PLEIADR1";
const HEADER_BYTES: usize = 16;

/// A recorded message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Since the recording began.
    pub elapsed: Duration,
    /// Whose key it came by; what it says of itself is in the message.
    pub robot: RobotId,
    /// The message as it came, valid or not.
    pub message: Vec<u8>,
}

/// The content of a file of messages.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Frames {
    /// In the order of their arrival.
    pub frames: Vec<Frame>,
    /// Bytes of a last frame that was cut off when the recorder was killed.
    pub torn_bytes: usize,
}

/// Appends a frame. A message too long for anyone is refused by [`Writer`](super::Writer) before.
pub(super) fn put(
    file: &mut impl Write,
    elapsed: Duration,
    robot: RobotId,
    message: &[u8],
) -> io::Result<()> {
    let length = u32::try_from(message.len()).map_err(io::Error::other)?;
    let nanos = u64::try_from(elapsed.as_nanos()).unwrap_or(u64::MAX);
    file.write_all(&length.to_le_bytes())?;
    file.write_all(&nanos.to_le_bytes())?;
    file.write_all(&robot.0.to_le_bytes())?;
    file.write_all(message)
}

/// Reads a file of messages.
///
/// # Errors
/// If it cannot be read, is something else, or is damaged in a way that being cut off does not explain.
pub fn read_frames(path: &Path) -> Result<Frames, RecorderError> {
    let bytes = std::fs::read(path).map_err(|cause| RecorderError::Io { path: path.to_owned(), cause })?;
    let Some(mut rest) = bytes.strip_prefix(MAGIC) else {
        return Err(RecorderError::NotARecording { path: path.to_owned() });
    };
    let mut found = Frames::default();
    while let Some((length, elapsed, robot, body)) = header(rest) {
        if length > limits::MESSAGE_BYTES {
            let (offset, limit) = (bytes.len() - rest.len(), limits::MESSAGE_BYTES);
            return Err(RecorderError::Damaged { path: path.to_owned(), offset, found: length, limit });
        }
        let Some((message, after)) = body.split_at_checked(length) else { break };
        found.frames.push(Frame { elapsed, robot, message: message.to_vec() });
        rest = after;
    }
    found.torn_bytes = rest.len();
    Ok(found)
}

/// Length, time, robot and what follows, if there is a whole header.
fn header(bytes: &[u8]) -> Option<(usize, Duration, RobotId, &[u8])> {
    let (header, body) = bytes.split_first_chunk::<HEADER_BYTES>()?;
    let (length, rest) = header.split_first_chunk()?;
    let (nanos, robot) = rest.split_first_chunk()?;
    let length = usize::try_from(u32::from_le_bytes(*length)).ok()?;
    let elapsed = Duration::from_nanos(u64::from_le_bytes(*nanos));
    Some((length, elapsed, RobotId(u32::from_le_bytes(robot.try_into().ok()?)), body))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(robot: u32, nanos: u64, message: &[u8]) -> Frame {
        Frame { elapsed: Duration::from_nanos(nanos), robot: RobotId(robot), message: message.to_vec() }
    }

    fn read(bytes: &[u8]) -> Result<Frames, RecorderError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("facts.bin");
        std::fs::write(&path, bytes).unwrap();
        read_frames(&path)
    }

    fn written(frames: &[Frame]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        for frame in frames {
            put(&mut bytes, frame.elapsed, frame.robot, &frame.message).unwrap();
        }
        bytes
    }

    #[test]
    fn the_layout_is_the_documented_one() {
        let mut expected = b"PLEIADR1".to_vec();
        expected.extend([3, 0, 0, 0, 2, 1, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0]);
        expected.extend(b"abc");
        assert_eq!(written(&[frame(7, 258, b"abc")]), expected);
    }

    #[test]
    fn frames_read_back_and_every_cut_gives_whole_frames_only() {
        let frames = [frame(1, 0, b""), frame(u32::MAX, u64::MAX, b"message"), frame(2, 5, &[0; 300])];
        let bytes = written(&frames);
        assert_eq!(read(&bytes).unwrap(), Frames { frames: frames.to_vec(), torn_bytes: 0 });
        let ends: Vec<_> = (0..=3).map(|count| written(&frames[..count]).len()).collect();
        for cut in MAGIC.len()..bytes.len() {
            let whole = ends.iter().filter(|end| **end <= cut).count() - 1;
            let expected = Frames { frames: frames[..whole].to_vec(), torn_bytes: cut - ends[whole] };
            assert_eq!(read(&bytes[..cut]).unwrap(), expected, "cut at {cut}");
        }
    }

    #[test]
    fn another_file_and_an_impossible_length_are_refused() {
        assert!(matches!(read(b"PLEIADJ1").unwrap_err(), RecorderError::NotARecording { .. }));
        let mut bytes = written(&[frame(1, 0, b"abc")]);
        bytes.extend([0xff; 40]);
        let damaged = read(&bytes).unwrap_err();
        assert!(matches!(damaged, RecorderError::Damaged { offset: 27, .. }), "{damaged}");
    }
}
