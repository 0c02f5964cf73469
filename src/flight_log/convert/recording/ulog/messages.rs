//! Messages of a `ULog`, each after its length and type.

use std::ops::Range;

use super::super::damage::Damage;
use crate::flight_log::container::file::{FileWindow, LogFile};

/// First bytes of every log.
pub(in super::super) const MAGIC: [u8; 7] = [0x55, 0x4C, 0x6F, 0x67, 0x01, 0x12, 0x35];
/// Size of the file header: magic, version, time.
pub(super) const HEADER_BYTES: usize = 16;
/// Size of a message header: length and type.
const MESSAGE_HEADER_BYTES: usize = 3;
/// Number of consecutive messages that must be plausible after damage.
const CHAIN: usize = 4;

pub(super) struct Message<'a> {
    /// Letter of the message's type.
    pub(super) kind: u8,
    pub(super) content: &'a [u8],
    /// Position after the message.
    pub(super) end: usize,
}

/// Iterates over the messages of a log.
pub(super) struct Messages<'a> {
    file: &'a LogFile,
    window: FileWindow<'a>,
    /// Reads the messages after a position while damage is skipped.
    ahead: FileWindow<'a>,
    pub(super) damage: Damage,
}

/// True for the message types of a `ULog`.
fn is_known(kind: u8) -> bool {
    b"FIMPQARDLCSOB".contains(&kind)
}

impl<'a> Messages<'a> {
    pub(super) fn new(file: &'a LogFile) -> Self {
        Self { file, window: FileWindow::new(file), ahead: FileWindow::new(file), damage: Damage::default() }
    }

    /// Type of the message at a position, and the range of its content, if both are plausible.
    fn header(window: &mut FileWindow<'a>, at: usize, end: usize) -> Result<Option<(u8, Range<usize>)>, String> {
        let start = at.saturating_add(MESSAGE_HEADER_BYTES);
        if start > end {
            return Ok(None);
        }
        let bytes = window.read(at..start)?;
        let (length, kind) = (usize::from(u16::from_le_bytes([bytes[0], bytes[1]])), bytes[2]);
        Ok((is_known(kind) && length > 0 && start + length <= end).then(|| (kind, start..start + length)))
    }

    /// Next message at a position before `end`; `None` at the end.
    pub(super) fn next(&mut self, at: usize, end: usize) -> Result<Option<Message<'_>>, String> {
        let end = end.min(self.file.len());
        if at >= end {
            return Ok(None);
        }
        let mut found = Self::header(&mut self.window, at, end)?;
        if found.is_none() {
            let next = self.resume(at + 1, end)?;
            if next >= end {
                self.damage.cut(end - at);
                return Ok(None);
            }
            self.damage.skip(at, next - at);
            found = Self::header(&mut self.window, next, end)?;
        }
        let Some((kind, range)) = found else { return Ok(None) };
        let end = range.end;
        Ok(Some(Message { kind, content: self.window.read(range)?, end }))
    }

    /// First position followed by several plausible messages, up to the end of the log; `end` without one.
    fn resume(&mut self, from: usize, end: usize) -> Result<usize, String> {
        for start in from..end {
            let mut at = start;
            let mut count = 0;
            while count < CHAIN && at < end {
                let window = if count == 0 { &mut self.window } else { &mut self.ahead };
                let Some((_, range)) = Self::header(window, at, end)? else { break };
                at = range.end;
                count += 1;
            }
            if count == CHAIN || (count > 0 && at == end) {
                return Ok(start);
            }
        }
        Ok(end)
    }
}
