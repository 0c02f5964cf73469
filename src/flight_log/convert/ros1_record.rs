//! Records of a ROS 1 bag, format 2.0: a header of named fields, and data.

use crate::flight_log::container::file::LogFile;

#[derive(Clone, Copy, Debug)]
pub(super) struct BagRecord<'a> {
    header: &'a [u8],
    pub(super) data: &'a [u8],
    /// Offset of the first byte after the record.
    pub(super) end: usize,
}

/// Bytes that follow a 4-byte length at `start`, and the first byte after them.
fn sized(bytes: &[u8], start: usize) -> Option<(&[u8], usize)> {
    let length = bytes.get(start..start.checked_add(4)?)?;
    let length = u32::from_le_bytes([length[0], length[1], length[2], length[3]]) as usize;
    let end = (start + 4).checked_add(length)?;
    Some((bytes.get(start + 4..end)?, end))
}

/// Returns the record that starts at a byte offset, or a description of the problem.
pub(super) fn record_at(bytes: &[u8], start: usize) -> Result<BagRecord<'_>, String> {
    let ends = || format!("a record ends after the last of {} bytes", bytes.len());
    let (header, after_header) = sized(bytes, start).ok_or_else(ends)?;
    let (data, end) = sized(bytes, after_header).ok_or_else(ends)?;
    let record = BagRecord { header, data, end };
    // Every record has an opcode; bytes without one are not a record.
    record.opcode().map(|_| record).ok_or_else(|| "no record starts here".to_owned())
}

/// Largest header of a record: headers of connections contain the name of a topic.
const LARGEST_HEADER_BYTES: usize = 1 << 20;

/// Record of a file, read into memory.
#[derive(Clone, Debug)]
pub(super) struct OwnedRecord {
    /// Header and data, each after its length.
    bytes: Vec<u8>,
    /// First byte after the record in the file.
    pub(super) end: usize,
}

impl OwnedRecord {
    pub(super) fn record(&self) -> Result<BagRecord<'_>, String> {
        record_at(&self.bytes, 0)
    }
}

/// Reads the record that starts at a byte of a file, or returns a description of the problem.
pub(super) fn record_in_file(file: &LogFile, start: usize) -> Result<OwnedRecord, String> {
    let length_at = |at: usize| -> Result<usize, String> {
        let end = at.checked_add(4).filter(|end| *end <= file.len());
        let end = end.ok_or_else(|| format!("a record ends after the last of {} bytes", file.len()))?;
        let bytes = file.read(at..end)?;
        Ok(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as usize)
    };
    let header_bytes = length_at(start)?;
    if header_bytes > LARGEST_HEADER_BYTES {
        return Err(format!("no record starts here: its header would have {header_bytes} bytes"));
    }
    let data_bytes = length_at((start + 4).saturating_add(header_bytes))?;
    let end = start.saturating_add(8).saturating_add(header_bytes).saturating_add(data_bytes);
    if end > file.len() {
        return Err(format!("a record of {} bytes where {} bytes are left", end - start, file.len() - start));
    }
    let owned = OwnedRecord { bytes: file.read(start..end)?, end };
    owned.record().map(|_| ())?;
    Ok(owned)
}

/// Value of a named field among `name=value` fields.
pub(super) fn field<'a>(fields: &'a [u8], name: &str) -> Option<&'a [u8]> {
    let mut at = 0;
    while let Some((entry, end)) = sized(fields, at) {
        let value = entry.strip_prefix(name.as_bytes()).and_then(|rest| rest.strip_prefix(b"="));
        if value.is_some() {
            return value;
        }
        at = end;
    }
    None
}

pub(super) fn text_field<'a>(fields: &'a [u8], name: &str) -> Option<&'a str> {
    field(fields, name).and_then(|value| std::str::from_utf8(value).ok())
}

impl<'a> BagRecord<'a> {
    pub(super) fn opcode(&self) -> Option<u8> {
        field(self.header, "op").and_then(|value| value.first().copied())
    }

    /// 32-bit field of the header.
    pub(super) fn number(&self, name: &str) -> Option<u32> {
        let value = field(self.header, name)?;
        Some(u32::from_le_bytes(value.try_into().ok()?))
    }

    /// 64-bit field of the header.
    pub(super) fn large_number(&self, name: &str) -> Option<u64> {
        let value = field(self.header, name)?;
        Some(u64::from_le_bytes(value.try_into().ok()?))
    }

    pub(super) fn text(&self, name: &str) -> Option<&'a str> {
        text_field(self.header, name)
    }

    /// Time field of the header in nanoseconds since the epoch.
    pub(super) fn time_ns(&self, name: &str) -> Option<i64> {
        let [s0, s1, s2, s3, n0, n1, n2, n3] = field(self.header, name)?.try_into().ok()?;
        let (seconds, nanoseconds) = (u32::from_le_bytes([s0, s1, s2, s3]), u32::from_le_bytes([n0, n1, n2, n3]));
        Some(i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds))
    }
}
