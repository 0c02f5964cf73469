//! Records of a telemetry log: a time of the ground station, then a `MAVLink` frame of version 1 or 2.

use super::super::damage::Damage;
use crate::flight_log::container::file::{FileWindow, LogFile};

/// Size of the time before a frame: microseconds since the epoch, big-endian.
const TIME_BYTES: usize = 8;
/// Size of the longest frame: header (10), payload (255), checksum (2), signature (13).
const MAX_FRAME_BYTES: usize = 280;
/// First bytes of frames of both versions.
const VERSION_1: u8 = 0xFE;
const VERSION_2: u8 = 0xFD;
/// Flag of a frame with a signature.
const SIGNED: u8 = 1;
/// Valid times of a record: the years 2001 to 2100 in microseconds since the epoch.
const TIMES_US: std::ops::Range<u64> = 1_000_000_000_000_000..4_102_444_800_000_000;
/// Longest payload; shorter ones are padded with zeros.
pub(super) const MAX_PAYLOAD_BYTES: usize = 255;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Frame {
    /// Reception by the ground station, in nanoseconds since the epoch.
    pub(super) received_ns: i64,
    pub(super) system: u8,
    pub(super) component: u8,
    pub(super) message: u32,
    /// Padded with zeros, since version 2 omits them at the end.
    pub(super) payload: [u8; MAX_PAYLOAD_BYTES],
    /// Position after the frame.
    pub(super) end: usize,
}

/// True if bytes begin like a record.
pub(in super::super) fn is_telemetry(start: &[u8]) -> bool {
    let Some((time, behind)) = start.split_first_chunk::<TIME_BYTES>() else { return false };
    TIMES_US.contains(&u64::from_be_bytes(*time))
        && behind.first().is_some_and(|byte| [VERSION_1, VERSION_2].contains(byte))
}

/// Iterates over the frames of a log.
pub(super) struct Frames<'a> {
    file: &'a LogFile,
    window: FileWindow<'a>,
    /// `CRC_EXTRA` byte of a message by its number; `None` for messages that are not read.
    checksum_byte: fn(u32) -> Option<u8>,
    pub(super) damage: Damage,
}

impl<'a> Frames<'a> {
    pub(super) fn new(file: &'a LogFile, checksum_byte: fn(u32) -> Option<u8>) -> Self {
        Self { file, window: FileWindow::new(file), checksum_byte, damage: Damage::default() }
    }

    /// First frame from a position on; other bytes are skipped. `None` at the end.
    pub(super) fn next(&mut self, from: usize) -> Result<Option<Frame>, String> {
        let mut at = from;
        while at < self.file.len() {
            let end = at.saturating_add(TIME_BYTES + MAX_FRAME_BYTES).min(self.file.len());
            let bytes = self.window.read(at..end)?;
            if let Some(frame) = frame(bytes, at, self.checksum_byte)
                && self.continues(frame.end)?
            {
                if at > from {
                    self.damage.skip(from, at - from);
                }
                return Ok(Some(frame));
            }
            at += 1;
        }
        self.damage.cut(self.file.len().saturating_sub(from));
        Ok(None)
    }

    /// True if a record begins at a position, possibly truncated by the end of the file, or the file ends there.
    fn continues(&mut self, at: usize) -> Result<bool, String> {
        let end = at.saturating_add(TIME_BYTES + 1);
        if end > self.file.len() {
            return Ok(true);
        }
        Ok(is_telemetry(self.window.read(at..end)?))
    }
}

/// Frame at the start of `bytes`; `at` is their position in the file.
fn frame(bytes: &[u8], at: usize, checksum_byte: fn(u32) -> Option<u8>) -> Option<Frame> {
    if !is_telemetry(bytes) {
        return None;
    }
    let (time, frame) = bytes.split_first_chunk::<TIME_BYTES>()?;
    let length = usize::from(*frame.get(1)?);
    let (header, message, signature) = if frame[0] == VERSION_1 {
        (6, u32::from(*frame.get(5)?), 0)
    } else {
        let number = frame.get(7..10)?;
        let message = u32::from_le_bytes([number[0], number[1], number[2], 0]);
        (10, message, if frame.get(2)? & SIGNED != 0 { 13 } else { 0 })
    };
    let checksum_at = header + length;
    let checksum = u16::from_le_bytes(frame.get(checksum_at..checksum_at + 2)?.try_into().ok()?);
    let whole = checksum_at + 2 + signature;
    if frame.len() < whole {
        return None;
    }
    if let Some(last) = checksum_byte(message)
        && checksum != checksum_of(frame[1..checksum_at].iter().chain([&last]))
    {
        return None;
    }
    let mut payload = [0; MAX_PAYLOAD_BYTES];
    payload[..length].copy_from_slice(&frame[header..checksum_at]);
    let (system, component) = if frame[0] == VERSION_1 { (frame[3], frame[4]) } else { (frame[5], frame[6]) };
    let received_ns = i64::try_from(u64::from_be_bytes(*time)).ok()?.checked_mul(1000)?;
    Some(Frame { received_ns, system, component, message, payload, end: at + TIME_BYTES + whole })
}

/// CRC-16/MCRF4XX, as in `MAVLink`.
fn checksum_of<'a>(bytes: impl Iterator<Item = &'a u8>) -> u16 {
    bytes.fold(0xFFFF, |checksum, byte| {
        let low = *byte ^ (checksum & 0xFF) as u8;
        let mixed = u16::from(low ^ (low << 4));
        (checksum >> 8) ^ (mixed << 8) ^ (mixed << 3) ^ (mixed >> 4)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_are_those_of_the_catalogue() {
        // CRC-16/MCRF4XX of "123456789", by the catalogue of parametrised CRC algorithms.
        assert_eq!(checksum_of(b"123456789".iter()), 0x6F91);
    }
}
