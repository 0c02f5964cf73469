//! The MCAP container: positions of the messages of each channel, and the bytes of one block of them at a time.

mod block;
mod index;
mod topic;

pub(crate) use block::{BlockCache, DecodedBlock, MessageSpan};
pub(super) use index::{ContainerIndex, MessagePosition};
pub(super) use topic::TopicIndex;

/// Every record starts with its opcode (1 byte) and the length of its body (8 bytes).
const RECORD_HEADER: usize = 9;

/// One record of the file.
#[derive(Clone, Copy, Debug)]
struct RawRecord<'a> {
    opcode: u8,
    body: &'a [u8],
    /// Offset of the first byte after it.
    end: usize,
}

/// The record that starts at a byte offset, or the problem with it.
fn record_at(bytes: &[u8], start: usize) -> Result<RawRecord<'_>, String> {
    let header = start.checked_add(RECORD_HEADER).and_then(|end| bytes.get(start..end));
    let Some(header) = header else {
        return Err("the file ends inside a record's header".into());
    };
    let length =
        u64::from_le_bytes([header[1], header[2], header[3], header[4], header[5], header[6], header[7], header[8]]);
    let body_start = start + RECORD_HEADER;
    let end = usize::try_from(length).ok().and_then(|length| body_start.checked_add(length));
    match end.and_then(|end| bytes.get(body_start..end).map(|body| (body, end))) {
        Some((body, end)) => Ok(RawRecord { opcode: header[0], body, end }),
        None => Err(format!(
            "a record of {length} bytes (opcode {:#04x}) where {} bytes are left",
            header[0],
            bytes.len() - body_start
        )),
    }
}
