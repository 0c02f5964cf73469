//! Limits on the memory and disk space that reading an external file may take.
//!
//! Sizes and counts in a file are not trusted: they are compared with the size of the file, with the machine's memory
//! and with the limits below before anything is allocated. Each limit can be set by name (`--limit record-bytes=2G`).

use std::fs;
use std::str::FromStr;
use std::sync::OnceLock;

use thiserror::Error;

use crate::text::{Entry, Named};

/// Decompressed size that is allowed for every record: larger chunks are rare, smaller ones compress at any ratio.
const RECORD_FLOOR_BYTES: u64 = 32 << 20;
/// Largest compression ratio of a record above that size. Sensor data compress to a tenth; a record that
/// compresses to a hundredth holds no measurements.
const RECORD_RATIO: u64 = 256;
/// Divisor of the machine's memory that gives the limit of one record.
const RECORD_MEMORY_RATIO: u64 = 32;
/// Size of cached blocks that is always allowed.
const CACHE_FLOOR_BYTES: u64 = 96 << 20;
/// Largest ratio of cached blocks to the size of the file.
const CACHE_RATIO: u64 = 64;
/// Divisor of the machine's memory that gives the limit of all cached blocks.
const CACHE_MEMORY_RATIO: u64 = 16;
/// Decompressed size that is allowed for every compressed file.
const UNPACKED_FLOOR_BYTES: u64 = 256 << 20;
/// Largest compression ratio of a compressed file above that size.
const UNPACKED_RATIO: u64 = 64;
/// Number of messages that is allowed for every file.
const MESSAGES_FLOOR: u64 = 1 << 20;
/// Bytes of the file for each further message: the smallest useful message takes more, even compressed.
const BYTES_PER_MESSAGE: u64 = 8;
/// Topics of a log; logs of whole robots have hundreds.
const TOPICS: u64 = 4096;
/// Length of a topic's or a type's name; ROS 2 allows 255 bytes.
const NAME_BYTES: u64 = 1024;
/// Pixels of an image, such as 7000 × 4700.
const IMAGE_PIXELS: u64 = 1 << 25;
/// Pixels per byte of a compressed image: PNG's compression reaches 1032 bytes per byte, with 8 pixels each.
const PIXELS_PER_BYTE: u64 = 1032 * 8;
/// Memory that is assumed if the system does not report it.
const UNKNOWN_MEMORY_BYTES: u64 = 8 << 30;

/// Size of all message definitions of a log together; definitions of one type take some kilobytes.
pub(crate) const DEFINITION_BYTES: usize = 64 << 20;
/// Size of text files that describe a source, such as a bag's `metadata.yaml`.
pub(crate) const DESCRIPTION_BYTES: u64 = 16 << 20;
/// Length of a line of a table, such as EuRoC's `data.csv`.
pub(crate) const LINE_BYTES: u64 = 64 << 10;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LimitKind {
    /// Bytes of one record in memory: a decompressed chunk, a message, an attachment, a row of a database.
    RecordBytes,
    /// Bytes of a decompressed file, in the folder for temporary files.
    UnpackedBytes,
    Messages,
    Topics,
    /// Bytes of a topic's or a type's name.
    NameBytes,
    ImagePixels,
}

impl Named for LimitKind {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::RecordBytes, "record-bytes"),
        (Self::UnpackedBytes, "unpacked-bytes"),
        (Self::Messages, "messages"),
        (Self::Topics, "topics"),
        (Self::NameBytes, "name-bytes"),
        (Self::ImagePixels, "image-pixels"),
    ];
}

impl LimitKind {
    fn unit(self) -> &'static str {
        match self {
            Self::RecordBytes | Self::UnpackedBytes | Self::NameBytes => "bytes",
            Self::Messages => "messages",
            Self::Topics => "topics",
            Self::ImagePixels => "pixels",
        }
    }
}

/// Error: a file contains or declares more than a limit allows.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{subject} of {found} {}, more than the limit of {allowed}; raise it with --limit {}={found}", kind.unit(), kind.name())]
pub struct LimitExceeded {
    pub kind: LimitKind,
    /// Subject that exceeds the limit, such as `a chunk`.
    pub subject: &'static str,
    pub found: u64,
    pub allowed: u64,
}

/// Limit set by the user, `image-pixels=100M`; K, M and G multiply by powers of 1024.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LimitSetting {
    pub kind: LimitKind,
    pub value: u64,
}

impl FromStr for LimitSetting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let names = LimitKind::names;
        let entry = Entry::parse(text).ok_or_else(|| format!("expected NAME=NUMBER, NAME one of {}", names()))?;
        let Entry { key: name, value: number } = entry;
        let kind = LimitKind::from_name(name);
        let kind = kind.ok_or_else(|| format!("unknown limit '{name}', expected one of {}", names()))?;
        let (digits, factor) = match number.char_indices().next_back() {
            Some((at, 'k' | 'K')) => (&number[..at], 1 << 10),
            Some((at, 'm' | 'M')) => (&number[..at], 1 << 20),
            Some((at, 'g' | 'G')) => (&number[..at], 1 << 30),
            _ => (number, 1),
        };
        let value = digits.parse::<u64>().ok().and_then(|value| value.checked_mul(factor)).filter(|value| *value > 0);
        let value = value.ok_or_else(|| format!("'{number}' is no number above 0, such as 500000 or 2G"))?;
        Ok(Self { kind, value })
    }
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogLimits {
    /// Limits set by the user; the last one of a kind is used.
    pub settings: Vec<LimitSetting>,
}

impl LogLimits {
    fn set(&self, kind: LimitKind) -> Option<u64> {
        self.settings.iter().rev().find(|setting| setting.kind == kind).map(|setting| setting.value)
    }

    fn check(kind: LimitKind, subject: &'static str, found: u64, allowed: u64) -> Result<(), LimitExceeded> {
        if found > allowed { Err(LimitExceeded { kind, subject, found, allowed }) } else { Ok(()) }
    }

    /// Largest size in memory of a record that is stored in `stored` bytes.
    pub(crate) fn record_bytes(&self, stored: u64) -> u64 {
        self.set(LimitKind::RecordBytes).unwrap_or_else(|| {
            let budget = (memory_bytes() / RECORD_MEMORY_RATIO).max(RECORD_FLOOR_BYTES);
            stored.saturating_mul(RECORD_RATIO).clamp(RECORD_FLOOR_BYTES, budget)
        })
    }

    /// Checks the declared size of a record that is stored in `stored` bytes.
    pub(crate) fn check_record(&self, subject: &'static str, claimed: u64, stored: u64) -> Result<(), LimitExceeded> {
        Self::check(LimitKind::RecordBytes, subject, claimed, self.record_bytes(stored))
    }

    /// Largest decompressed size of a compressed file of `stored` bytes.
    pub(crate) fn unpacked_bytes(&self, stored: u64) -> u64 {
        let by_ratio = || stored.saturating_mul(UNPACKED_RATIO).max(UNPACKED_FLOOR_BYTES);
        self.set(LimitKind::UnpackedBytes).unwrap_or_else(by_ratio)
    }

    /// Largest size of the cached blocks of a file.
    pub(crate) fn cache_bytes(file_bytes: u64) -> u64 {
        let budget = (memory_bytes() / CACHE_MEMORY_RATIO).max(CACHE_FLOOR_BYTES);
        file_bytes.saturating_mul(CACHE_RATIO).clamp(CACHE_FLOOR_BYTES, budget)
    }

    /// Largest number of messages of a file.
    pub(crate) fn messages(&self, file_bytes: u64) -> u64 {
        self.set(LimitKind::Messages).unwrap_or_else(|| MESSAGES_FLOOR.saturating_add(file_bytes / BYTES_PER_MESSAGE))
    }

    pub(crate) fn topics(&self) -> u64 {
        self.set(LimitKind::Topics).unwrap_or(TOPICS)
    }

    /// Checks the length of a topic's or a type's name.
    pub(crate) fn check_name(&self, subject: &'static str, name: &str) -> Result<(), LimitExceeded> {
        let allowed = self.set(LimitKind::NameBytes).unwrap_or(NAME_BYTES);
        Self::check(LimitKind::NameBytes, subject, name.len() as u64, allowed)
    }

    pub(crate) fn image_pixels(&self) -> u64 {
        self.set(LimitKind::ImagePixels).unwrap_or(IMAGE_PIXELS)
    }

    pub(crate) fn check_image(&self, [width, height]: [usize; 2]) -> Result<(), LimitExceeded> {
        let pixels = (width as u64).saturating_mul(height as u64);
        Self::check(LimitKind::ImagePixels, "an image", pixels, self.image_pixels())
    }
}

/// True if `stored` bytes of a compressed image can hold an image of this size.
pub(crate) fn can_hold_image(stored: usize, [width, height]: [usize; 2]) -> bool {
    (width as u64).saturating_mul(height as u64) <= (stored as u64).saturating_mul(PIXELS_PER_BYTE)
}

/// Memory in bytes of the machine, or of the container in which the program runs.
fn memory_bytes() -> u64 {
    static MEMORY_BYTES: OnceLock<u64> = OnceLock::new();
    *MEMORY_BYTES.get_or_init(|| {
        let machine = fs::read_to_string("/proc/meminfo").ok().and_then(|text| total_of(&text));
        let container = fs::read_to_string("/sys/fs/cgroup/memory.max").ok().and_then(|text| text.trim().parse().ok());
        machine.unwrap_or(UNKNOWN_MEMORY_BYTES).min(container.unwrap_or(u64::MAX))
    })
}

/// `MemTotal` of `/proc/meminfo`, in bytes.
fn total_of(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_parsed_with_their_unit() {
        let parse = |text: &str| text.parse::<LimitSetting>();
        let setting = |kind, value| Ok(LimitSetting { kind, value });
        assert_eq!(parse("record-bytes=2G"), setting(LimitKind::RecordBytes, 2 << 30));
        assert_eq!(parse("image-pixels=500000"), setting(LimitKind::ImagePixels, 500_000));
        for kind in LimitKind::all() {
            assert_eq!(parse(&format!("{}=3k", kind.name())), setting(kind, 3072));
        }
        assert!(parse("pixels=3").unwrap_err().contains("unknown limit 'pixels', expected one of record-bytes"));
        for text in ["topics", "topics=", "topics=0", "topics=-1", "topics=1T", "topics=99999999999G", "topics=µ"] {
            assert!(parse(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_record_is_limited_by_its_stored_size_and_by_the_flag() {
        let limits = LogLimits::default();
        assert_eq!(limits.check_record("a chunk", 32 << 20, 100), Ok(()));
        let exceeded = limits.check_record("a chunk", (32 << 20) + 1, 100).unwrap_err().to_string();
        assert_eq!(
            exceeded,
            "a chunk of 33554433 bytes, more than the limit of 33554432; raise it with --limit record-bytes=33554433"
        );
        assert!(limits.record_bytes(1 << 20) >= limits.record_bytes(1 << 10));
        assert!(limits.record_bytes(u64::MAX) <= memory_bytes().max(RECORD_FLOOR_BYTES));
        let raised =
            LogLimits { settings: vec!["record-bytes=3".parse().unwrap(), "record-bytes=1G".parse().unwrap()] };
        assert_eq!(raised.check_record("a chunk", 1 << 30, 100), Ok(()));
    }

    #[test]
    fn images_are_limited_by_what_their_bytes_can_hold() {
        assert!(can_hold_image(2000, [640, 480]) && !can_hold_image(2000, [16_000, 4000]));
        let limits = LogLimits::default();
        assert_eq!(limits.check_image([8192, 4096]), Ok(()));
        assert!(limits.check_image([8192, 4097]).unwrap_err().to_string().contains("--limit image-pixels="));
    }

    #[test]
    fn memory_is_read_as_the_system_writes_it() {
        assert_eq!(total_of("MemTotal:       24576 kB\nMemFree: 1 kB\n"), Some(24 << 20));
        assert_eq!(total_of("MemFree: 1 kB\n"), None);
    }
}
