//! Names and attachments of `rmw_zenoh_cpp`, the ROS 2 middleware over zenoh (its `docs/design.md`,
//! `liveliness_utils.cpp` and `attachment_helpers.cpp`).
//!
//! A topic is the key `<domain>/<topic>/<type>/<hash>`; what is published there is CDR with an attachment of 33
//! bytes. Nodes, publishers and subscriptions are announced by liveliness tokens.

use crate::description::Description;

/// First segment of liveliness tokens.
const ADMIN_SPACE: &str = "@ros2_lv";
/// What stands for a slash within a segment, and for an empty segment.
const MANGLED: &str = "%";
/// A gid in bytes.
pub const GID_BYTES: usize = 16;
/// An attachment in bytes.
pub const ATTACHMENT_BYTES: usize = 8 + 8 + 1 + GID_BYTES;
/// The length of the gid as zenoh's serializer writes it: LEB128, one byte.
const GID_LENGTH: u8 = 16;

/// Why there is no such name, or no such attachment.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RmwError {
    /// A name that ROS does not allow.
    #[error("{what} `{found}`: expected {expected}")]
    Name {
        /// Which name.
        what: &'static str,
        /// The name.
        found: String,
        /// The rule.
        expected: &'static str,
    },
    /// Bytes that are no attachment of a publication.
    #[error(
        "an attachment of {found} bytes: expected {ATTACHMENT_BYTES}, a sequence number, a time and a gid of 16 bytes"
    )]
    Attachment {
        /// How many.
        found: usize,
    },
    /// A gid of another length.
    #[error("byte 16 of an attachment: found {found}, expected 16, the length of a gid")]
    Gid {
        /// The length.
        found: u8,
    },
}

/// What goes with a publication.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// Counts the publisher's messages, from 1.
    pub sequence: i64,
    /// When the message was published, nanoseconds since 1970.
    pub source_time_ns: i64,
    /// Who published it: the same in every message of a publisher.
    pub gid: [u8; GID_BYTES],
}

impl Attachment {
    /// As zenoh's serializer writes two `int64` and an array: little endian, the array behind its length.
    pub fn to_bytes(self) -> [u8; ATTACHMENT_BYTES] {
        let mut bytes = [0; ATTACHMENT_BYTES];
        bytes[..8].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.source_time_ns.to_le_bytes());
        bytes[16] = GID_LENGTH;
        bytes[17..].copy_from_slice(&self.gid);
        bytes
    }

    /// Reads an attachment.
    ///
    /// # Errors
    /// Another number of bytes, a gid of another length. Older releases wrote the fields with their names; they are
    /// refused here.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, RmwError> {
        let Ok(bytes) = <&[u8; ATTACHMENT_BYTES]>::try_from(bytes) else {
            return Err(RmwError::Attachment { found: bytes.len() });
        };
        let part = |from: usize| {
            let mut part = [0; 8];
            part.copy_from_slice(&bytes[from..from + 8]);
            i64::from_le_bytes(part)
        };
        if bytes[16] != GID_LENGTH {
            return Err(RmwError::Gid { found: bytes[16] });
        }
        let mut gid = [0; GID_BYTES];
        gid.copy_from_slice(&bytes[17..]);
        Ok(Self { sequence: part(0), source_time_ns: part(8), gid })
    }
}

/// The key that messages of a topic are published under, of this version of the type.
///
/// # Errors
/// `topic` is no absolute topic name.
pub fn topic_key(domain: u32, topic: &str, description: &Description) -> Result<String, RmwError> {
    Ok(format!("{domain}/{}/{}/{}", bare(topic)?, description.dds_name(), description.hash()))
}

/// The key expression that a topic is subscribed with whatever the version of its type: Humble publishes without a
/// hash (`TypeHashNotSupported`).
///
/// # Errors
/// `topic` is no absolute topic name.
pub fn topic_key_of_any_version(
    domain: u32,
    topic: &str,
    description: &Description,
) -> Result<String, RmwError> {
    Ok(format!("{domain}/{}/{}/*", bare(topic)?, description.dds_name()))
}

/// A node as its tokens name it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Node {
    /// The ROS domain.
    pub domain: u32,
    /// The zenoh session's id in hexadecimal, as zenoh prints it.
    pub session: String,
    /// Number of the node in its session.
    pub id: u64,
    /// Namespace, as in `/robot1`; `/` for none.
    pub namespace: String,
    /// Name, as in `pleiad_agent`.
    pub name: String,
}

/// Whether an end of a topic writes or reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// A publisher.
    Publisher,
    /// A subscription.
    Subscription,
}

impl Node {
    /// The token of the node itself.
    ///
    /// # Errors
    /// The namespace or the name is not allowed, or the session is no hexadecimal number.
    pub fn token(&self) -> Result<String, RmwError> {
        self.token_of(self.id, "NN")
    }

    /// The token of one end of a topic, number `id` in the session: reliable, volatile, keeping the last `depth`.
    ///
    /// # Errors
    /// As [`Node::token`]; the topic is no absolute topic name.
    pub fn end_token(
        &self,
        id: u64,
        end: End,
        topic: &str,
        description: &Description,
        depth: u32,
    ) -> Result<String, RmwError> {
        bare(topic)?;
        let kind = match end {
            End::Publisher => "MP",
            End::Subscription => "MS",
        };
        // What is as in rmw_qos_profile_default stays empty.
        Ok(format!(
            "{}/{}/{}/{}/::,{depth}:,:,:,,",
            self.token_of(id, kind)?,
            topic.replace('/', MANGLED),
            description.dds_name(),
            description.hash()
        ))
    }

    fn token_of(&self, id: u64, kind: &str) -> Result<String, RmwError> {
        let refused =
            |what, found: &str, expected| Err(RmwError::Name { what, found: found.to_owned(), expected });
        if self.session.is_empty() || !self.session.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return refused("session", &self.session, "a zenoh id in hexadecimal");
        }
        if !is_token(&self.name) {
            return refused("node name", &self.name, TOKEN);
        }
        if self.namespace != "/" {
            bare(&self.namespace)?;
        }
        let namespace = self.namespace.replace('/', MANGLED);
        let Self { domain, session, id: node, name, .. } = self;
        // The enclave, in front of the namespace, is always the default one.
        Ok(format!("{ADMIN_SPACE}/{domain}/{session}/{node}/{id}/{kind}/{MANGLED}/{namespace}/{name}"))
    }
}

const TOKEN: &str = "letters, digits and underscores, not beginning with a digit";
const ABSOLUTE: &str = "an absolute name such as /robot1/odom: a slash and a word of letters, digits and underscores, once or more";

/// A topic name without its first slash.
fn bare(topic: &str) -> Result<&str, RmwError> {
    match topic.strip_prefix('/') {
        Some(rest) if rest.split('/').all(is_token) => Ok(rest),
        _ => Err(RmwError::Name { what: "topic or namespace", found: topic.to_owned(), expected: ABSOLUTE }),
    }
}

fn is_token(word: &str) -> bool {
    let allowed = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_';
    !word.is_empty() && word.bytes().all(allowed) && !word.starts_with(|c: char| c.is_ascii_digit())
}
