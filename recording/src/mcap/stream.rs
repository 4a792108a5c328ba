//! An MCAP file from its beginning to its end, record by record, in bounded memory.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::ops::ControlFlow;
use std::path::Path;

use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use crate::error::RecordingError;

/// Longest record that is read, and longest chunk before and after it is unpacked: a message of that size is none of ours.
const RECORD_LIMIT: usize = 128 << 20;
/// What is asked of the file at once, whatever length it claims for a record.
const READ_AT_ONCE: usize = 1 << 20;

/// A topic with the type of its messages.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Channel {
    /// The topic.
    pub(crate) topic: String,
    /// How its messages are written: `cdr`, `json`, ...
    pub(crate) encoding: String,
    /// The name of its schema; empty if it has none.
    pub(crate) schema: String,
    /// How its schema is written: `ros2msg`, `jsonschema`, ...
    pub(crate) schema_encoding: String,
}

/// What a file holds.
pub(crate) enum Item<'a> {
    /// A channel that was not told before.
    Channel(&'a Channel),
    /// A message.
    Message {
        channel: &'a Channel,
        /// Which of its topic's messages, from 1.
        number: usize,
        /// When it was recorded, nanoseconds.
        log_time: u64,
        data: &'a [u8],
    },
    /// Named texts.
    Metadata { name: String, values: BTreeMap<String, String> },
    /// A file within the file.
    Attachment { name: String, data: &'a [u8] },
}

/// Shows everything in `path` to `visit`, in the order of the file, until it breaks off; checksums are compared.
pub(crate) fn scan(
    path: &Path,
    mut visit: impl FnMut(Item<'_>) -> Result<ControlFlow<()>, RecordingError>,
) -> Result<(), RecordingError> {
    let mut file = File::open(path).map_err(RecordingError::io("read", path))?;
    let options = LinearReaderOptions::default()
        // Before anything in a chunk is believed: lengths in it are followed without a look at where it ends.
        .with_prevalidate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_record_length_limit(RECORD_LIMIT);
    let mut reader = LinearReader::new_with_options(options);
    let damaged = |error: mcap::McapError| RecordingError::Mcap {
        file: path.to_path_buf(),
        message: error.to_string(),
    };
    let mut schemas: BTreeMap<u16, (String, String)> = BTreeMap::new();
    let mut channels: BTreeMap<u16, (Channel, usize)> = BTreeMap::new();
    while let Some(event) = reader.next_event() {
        let (opcode, data) = match event.map_err(damaged)? {
            LinearReadEvent::ReadRequest(need) => {
                let read = file
                    .read(reader.insert(need.clamp(1, READ_AT_ONCE)))
                    .map_err(RecordingError::io("read", path))?;
                reader.notify_read(read);
                continue;
            }
            LinearReadEvent::Record { opcode, data } => (opcode, data),
        };
        let next = match mcap::parse_record(opcode, data).map_err(damaged)? {
            Record::Schema { header, .. } => {
                schemas.insert(header.id, (header.name, header.encoding));
                ControlFlow::Continue(())
            }
            Record::Channel(channel) => {
                let (schema, schema_encoding) = schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                let told = Channel {
                    topic: channel.topic,
                    encoding: channel.message_encoding,
                    schema,
                    schema_encoding,
                };
                // The summary tells all of them again.
                if channels.get(&channel.id).is_some_and(|(known, _)| *known == told) {
                    continue;
                }
                let next = visit(Item::Channel(&told))?;
                channels.insert(channel.id, (told, 0));
                next
            }
            Record::Message { header, data } => {
                let Some((channel, count)) = channels.get_mut(&header.channel_id) else {
                    return Err(RecordingError::Mcap {
                        file: path.to_path_buf(),
                        message: format!(
                            "a message of channel {}, which it does not declare",
                            header.channel_id
                        ),
                    });
                };
                *count += 1;
                visit(Item::Message { channel, number: *count, log_time: header.log_time, data: &data })?
            }
            Record::Metadata(metadata) => {
                visit(Item::Metadata { name: metadata.name, values: metadata.metadata })?
            }
            Record::Attachment { header, data, .. } => {
                visit(Item::Attachment { name: header.name, data: &data })?
            }
            _ => ControlFlow::Continue(()),
        };
        if next.is_break() {
            break;
        }
    }
    Ok(())
}

/// The channels that a file declares.
pub(crate) fn channels(path: &Path) -> Result<Vec<Channel>, RecordingError> {
    let mut all = Vec::new();
    scan(path, |item| {
        if let Item::Channel(channel) = item {
            all.push(channel.clone());
        }
        Ok(ControlFlow::Continue(()))
    })?;
    Ok(all)
}
