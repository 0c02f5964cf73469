//! Boxes of an MP4 file (ISO/IEC 14496-12): a size, a type of four letters, the content.

use crate::flight_log::container::file::{FileWindow, LogFile};

/// Size of the header: size and type.
const HEADER_BYTES: usize = 8;
/// Largest number of boxes of the first level: fragments of one frame each for nine hours.
const MAX_BOXES: usize = 2_097_152;

/// Box of the file's first level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FileBox {
    pub(super) kind: [u8; 4],
    /// Start of the header.
    pub(super) at: usize,
    /// Start of the content, which may end beyond the file.
    pub(super) start: usize,
    pub(super) end: usize,
}

/// Boxes of the first level, up to invalid bytes.
pub(super) fn file_boxes(file: &LogFile) -> Result<Vec<FileBox>, String> {
    let mut window = FileWindow::new(file);
    let mut boxes = Vec::new();
    let mut at = 0_usize;
    while at.saturating_add(HEADER_BYTES) <= file.len() && boxes.len() < MAX_BOXES {
        let header = window.read(at..at + HEADER_BYTES)?;
        let (Some(size), Some(kind)) = (u32_at(header, 0), kind_at(header, 4)) else { break };
        let (start, end) = match size {
            0 => (at + HEADER_BYTES, file.len()),
            1 => {
                let end = at.saturating_add(2 * HEADER_BYTES);
                if end > file.len() {
                    break;
                }
                let size = u64_at(window.read(at + HEADER_BYTES..end)?, 0).unwrap_or(0);
                (end, at.saturating_add(usize::try_from(size).unwrap_or(usize::MAX)))
            }
            _ => (at + HEADER_BYTES, at.saturating_add(size as usize)),
        };
        if end < start || !kind.iter().all(|byte| (0x20..0x7F).contains(byte) || *byte == 0xA9) {
            break;
        }
        boxes.push(FileBox { kind, at, start, end });
        at = end;
    }
    Ok(boxes)
}

/// Boxes in the content of another, up to invalid bytes.
pub(super) fn children(content: &[u8]) -> impl Iterator<Item = ([u8; 4], &[u8])> {
    let mut rest = content;
    std::iter::from_fn(move || {
        let (size, kind) = (u32_at(rest, 0)? as usize, kind_at(rest, 4)?);
        let size = if size == 0 { rest.len() } else { size };
        let child = rest.get(HEADER_BYTES..size)?;
        rest = &rest[size..];
        Some((kind, child))
    })
}

/// Content of the first box of a type.
pub(super) fn child<'a>(content: &'a [u8], kind: &[u8; 4]) -> Option<&'a [u8]> {
    children(content).find(|(other, _)| other == kind).map(|(_, child)| child)
}

/// Content of a box within boxes.
pub(super) fn descendant<'a>(content: &'a [u8], kinds: &[&[u8; 4]]) -> Option<&'a [u8]> {
    kinds.iter().try_fold(content, |content, kind| child(content, kind))
}

pub(super) fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_be_bytes(bytes.get(at..at.checked_add(2)?)?.try_into().ok()?))
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_be_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?))
}

pub(super) fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_be_bytes(bytes.get(at..at.checked_add(8)?)?.try_into().ok()?))
}

fn kind_at(bytes: &[u8], at: usize) -> Option<[u8; 4]> {
    bytes.get(at..at.checked_add(4)?)?.try_into().ok()
}
