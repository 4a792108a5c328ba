//! Control of an agent's process.

use pleiad_estimation::RobotId;
use serde::{Deserialize, Serialize};

use super::check;
use super::status::{put_status, take_status};
use crate::codec::{self, Reader};
use crate::error::ProtocolError;
use crate::messages::{ControlReply, ControlRequest};

#[derive(Serialize, Deserialize)]
enum WireRequest {
    Status,
    Finish,
    Shutdown,
    Evict(u32),
}

/// A status follows its variant.
#[derive(Serialize, Deserialize)]
enum WireReply {
    Status,
    Accepted,
    Refused(String),
}

/// Appends a request.
pub fn put_request(bytes: &mut Vec<u8>, request: ControlRequest) {
    let wire = match request {
        ControlRequest::Status => WireRequest::Status,
        ControlRequest::Finish => WireRequest::Finish,
        ControlRequest::Shutdown => WireRequest::Shutdown,
        ControlRequest::Evict(robot) => WireRequest::Evict(robot.0),
    };
    codec::put(bytes, &wire);
}

/// The next request.
pub fn take_request(reader: &mut Reader<'_>) -> Result<ControlRequest, ProtocolError> {
    Ok(match reader.take("control request")? {
        WireRequest::Status => ControlRequest::Status,
        WireRequest::Finish => ControlRequest::Finish,
        WireRequest::Shutdown => ControlRequest::Shutdown,
        WireRequest::Evict(robot) => ControlRequest::Evict(RobotId(robot)),
    })
}

/// Appends a reply.
pub fn put_reply(bytes: &mut Vec<u8>, reply: &ControlReply) {
    match reply {
        ControlReply::Status(status) => {
            codec::put(bytes, &WireReply::Status);
            put_status(bytes, status);
        }
        ControlReply::Accepted => codec::put(bytes, &WireReply::Accepted),
        ControlReply::Refused(why) => codec::put(bytes, &WireReply::Refused(check::cut(why).to_owned())),
    }
}

/// The next reply.
pub fn take_reply(reader: &mut Reader<'_>) -> Result<ControlReply, ProtocolError> {
    Ok(match reader.take("control reply")? {
        WireReply::Status => ControlReply::Status(take_status(reader)?),
        WireReply::Accepted => ControlReply::Accepted,
        WireReply::Refused(why) => ControlReply::Refused(check::text("refused", why)?),
    })
}
