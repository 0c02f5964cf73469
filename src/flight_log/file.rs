use std::fs::File;
use std::ops::{Deref, Range};
use std::path::Path;

use memmap2::Mmap;

use super::LogError;

/// The bytes of a log through a memory map.
#[derive(Debug)]
pub(crate) struct LogFile {
    map: Mmap,
}

impl LogFile {
    pub(super) fn open(path: &Path) -> Result<Self, LogError> {
        let failed = |source| LogError::Io { action: "open the log", source, path: path.to_owned() };
        let file = File::open(path).map_err(failed)?;
        let metadata = file.metadata().map_err(failed)?;
        let not_a_log = |found: &str, remedy| LogError::NotALog { found: found.into(), remedy, path: path.to_owned() };
        if metadata.is_dir() {
            return Err(not_a_log(
                "a folder",
                "name the .mcap file in it, or convert a EuRoC folder with `dcvins convert`",
            ));
        }
        if metadata.len() == 0 {
            return Err(not_a_log("the file is empty (0 bytes)", "copy or record it again"));
        }
        #[expect(unsafe_code, reason = "a memory map is the only way to open a log of gigabytes at once")]
        // SAFETY: the map is only read. Another process that shortens or rewrites the file while it is mapped could break the
        // map's promise of immutable bytes; a flight log is finished when it is opened, and every length read from it is
        // checked before use.
        let map = unsafe { Mmap::map(&file) };
        Ok(Self { map: map.map_err(failed)? })
    }

    /// Advises the system that a range of bytes is not needed for now. Pages that were read count as resident memory of
    /// the process otherwise; they can be read again at any time.
    #[cfg(unix)]
    pub(super) fn release(&self, bytes: &Range<usize>) {
        let (start, end) = (bytes.start.min(self.map.len()), bytes.end.min(self.map.len()));
        if start >= end {
            return;
        }
        #[expect(unsafe_code, reason = "there is no other way to release mapped pages")]
        // SAFETY: the map is shared with the file and never written to, so a page that is dropped comes back from the file
        // with the same bytes when it is touched again, also while somebody else is reading it.
        let advised =
            unsafe { self.map.unchecked_advise_range(memmap2::UncheckedAdvice::DontNeed, start, end - start) };
        // Advice that the system ignores costs memory, nothing else.
        drop(advised);
    }

    /// Other systems have no such advice.
    #[cfg(not(unix))]
    #[expect(clippy::unused_self, reason = "it has a use on other systems")]
    pub(super) fn release(&self, _bytes: &Range<usize>) {}
}

impl Deref for LogFile {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.map
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_released_can_be_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        let bytes: Vec<u8> = (0..300_000_u32).map(|index| (index.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        std::fs::write(&path, &bytes).unwrap();
        let file = LogFile::open(&path).unwrap();
        for released in [0..300_000, 5000..123_457, 0..0, 299_999..usize::MAX, 400_000..500_000] {
            assert!(*file == *bytes, "before {released:?}");
            file.release(&released);
        }
        assert!(*file == *bytes);
    }
}
