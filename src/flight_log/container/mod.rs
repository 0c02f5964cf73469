//! MCAP container: positions of the messages of each channel, and the bytes of one block at a time.

mod block;
pub(crate) mod file;
mod index;
mod topic;
mod unpack;

use std::ops::Range;

pub(crate) use block::{BlockCache, DecodedBlock, MessageSpan};
pub(super) use index::{ChannelRecord, ContainerIndex, MessagePosition, ScanEnd, ScanState};
pub(super) use topic::TopicIndex;
pub(super) use unpack::unpack_message;

use self::file::{FileWindow, LogFile};

/// Every record starts with its opcode (1 byte) and the length of its body (8 bytes).
const RECORD_HEADER: usize = 9;

#[derive(Clone, Copy, Debug)]
struct RawRecord<'a> {
    opcode: u8,
    body: &'a [u8],
    /// Offset of the first byte after the record.
    end: usize,
}

/// Opcode of a record header and range of the body after it; an error unless the body ends before `end`.
fn record_header(header: &[u8], start: usize, end: usize) -> Result<(u8, Range<usize>), String> {
    let &[opcode, l0, l1, l2, l3, l4, l5, l6, l7] = header else {
        return Err("the file ends inside a record's header".into());
    };
    let length = u64::from_le_bytes([l0, l1, l2, l3, l4, l5, l6, l7]);
    let body_start = start + RECORD_HEADER;
    let body_end = usize::try_from(length).ok().and_then(|length| body_start.checked_add(length));
    match body_end.filter(|body_end| *body_end <= end) {
        Some(body_end) => Ok((opcode, body_start..body_end)),
        None => {
            Err(format!("a record of {length} bytes (opcode {opcode:#04x}) where {} bytes are left", end - body_start))
        }
    }
}

/// Returns the record that starts at a byte, or a description of the problem.
fn record_at(bytes: &[u8], start: usize) -> Result<RawRecord<'_>, String> {
    let header = start.checked_add(RECORD_HEADER).and_then(|end| bytes.get(start..end)).unwrap_or_default();
    let (opcode, body) = record_header(header, start, bytes.len())?;
    Ok(RawRecord { opcode, body: &bytes[body.clone()], end: body.end })
}

/// Returns opcode and body of the record that starts at a byte of the file, or a description of the problem.
fn record_in_file(window: &mut FileWindow<'_>, file: &LogFile, start: usize) -> Result<(u8, Range<usize>), String> {
    let end = start.saturating_add(RECORD_HEADER).min(file.len());
    let header = window.read(start.min(end)..end)?;
    record_header(header, start, file.len())
}
