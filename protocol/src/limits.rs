//! The bounds of every message. They keep a faulty or hostile peer from making a receiver allocate; a
//! message beyond them is encoded all the same, but every receiver refuses it, so senders split before.

/// Version of the wire format, the first byte of every message.
pub const VERSION: u8 = 2;
/// The checksum at the end of every message, bytes.
pub const CHECKSUM_BYTES: usize = 4;
/// Longest message, bytes.
pub const MESSAGE_BYTES: usize = 1 << 20;
/// Most entries in one message; longer lists are sent in chunks.
pub const ENTRIES: usize = 512;
/// Longest extension of an entry, bytes.
pub const EXTENSION_BYTES: usize = 256;
/// Most logs in a status.
pub const LOGS: usize = 4096;
/// Most robots in a row or a list of gains.
pub const ROW: usize = 1024;
/// Most ranges in one request for facts.
pub const RANGES: usize = 4096;
/// Most samples in a batch.
pub const SAMPLES: usize = 8192;
/// Longest part of a snapshot, bytes.
pub const SNAPSHOT_PART_BYTES: usize = 1 << 19;
/// Longest snapshot, bytes.
pub const SNAPSHOT_BYTES: usize = 1 << 28;
/// Most items in one list of a snapshot.
pub const SNAPSHOT_ITEMS: usize = 1 << 20;
/// Longest text, bytes of UTF-8; senders cut it there.
pub const TEXT_BYTES: usize = 512;
/// Largest magnitude of a number. No planar robot comes near it, and products of a few such numbers
/// (a covariance times a lever arm squared) stay far from overflow.
pub const MAGNITUDE: f64 = 1e15;
