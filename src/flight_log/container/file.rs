use std::fs::File;
use std::io::{self, BufReader, Read as _, Seek as _, SeekFrom, Write as _};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use parking_lot::RwLock;

use crate::files::{LimitExceeded, LimitKind, LogLimits};
use crate::flight_log::LogError;

/// First bytes of Zstandard data.
pub(crate) const ZSTD_MAGIC: [u8; 4] = [0x28, 0xB5, 0x2F, 0xFD];
/// Bytes that a [`FileWindow`] reads ahead.
const WINDOW_BYTES: usize = 16 << 10;
/// Bytes that are decompressed at a time.
const UNPACK_BYTES: usize = 1 << 20;

/// Bytes of a log, read from the file on demand: a file that another process shortens gives an error.
#[derive(Debug)]
pub struct LogFile {
    /// The file, and those in which its recording goes on, as if they were one.
    parts: RwLock<Vec<Part>>,
    /// In bytes, when the file was opened, or when a log that is being written was looked at last.
    length: AtomicUsize,
    limits: LogLimits,
}

#[derive(Debug)]
struct Part {
    /// Number of bytes before it.
    start: usize,
    file: File,
}

impl Part {
    /// Length in bytes, 0 if it cannot be read.
    fn length(&self) -> usize {
        self.file.metadata().map_or(0, |metadata| usize::try_from(metadata.len()).unwrap_or(0))
    }
}

impl LogFile {
    /// Opens a regular file; a Zstandard file is decompressed into a temporary file.
    pub(crate) fn open(path: &Path, limits: &LogLimits) -> Result<Self, LogError> {
        let failed = |source| LogError::Io { action: "open the log", source, path: path.to_owned() };
        let metadata = std::fs::metadata(path).map_err(failed)?;
        let not_a_log = |found: &str, remedy| LogError::NotALog { found: found.into(), remedy, path: path.to_owned() };
        if metadata.is_dir() {
            return Err(not_a_log(
                "a folder",
                "name the .mcap file in it, or convert a EuRoC folder with `dcvins convert`",
            ));
        }
        // Opening a pipe would wait for its writer, and a device has no length.
        if !metadata.is_file() {
            return Err(not_a_log(kind_of(&metadata), "a log is read in any order: write it to a file first"));
        }
        if metadata.len() == 0 {
            return Err(not_a_log("the file is empty (0 bytes)", "copy or record it again"));
        }
        let mut file = File::open(path).map_err(failed)?;
        let mut start = [0; ZSTD_MAGIC.len()];
        let packed = file.read_exact(&mut start).is_ok() && start == ZSTD_MAGIC;
        if packed {
            file.seek(SeekFrom::Start(0)).map_err(failed)?;
            file = unpack(file, metadata.len(), path, limits)?;
        }
        let length = file.metadata().map_err(failed)?.len();
        let length = usize::try_from(length).map_err(|error| failed(io::Error::other(error)))?;
        let parts = RwLock::new(vec![Part { start: 0, file }]);
        Ok(Self { parts, length: AtomicUsize::new(length), limits: limits.clone() })
    }

    /// Length in bytes when the file was opened, or looked at last.
    pub fn len(&self) -> usize {
        self.length.load(Ordering::Acquire)
    }

    /// Looks at the length of a file that is being written.
    pub(crate) fn grow(&self) {
        let now = self.parts.read().last().map_or(0, |last| last.start + last.length());
        self.length.fetch_max(now, Ordering::AcqRel);
    }

    /// Adds the file in which the recording goes on after the last part, which is complete; returns its start.
    pub(crate) fn append(&self, next: Self) -> usize {
        let start = self.len();
        let added = next.parts.into_inner().into_iter().map(|part| Part { start: start + part.start, ..part });
        self.parts.write().extend(added);
        self.length.fetch_max(start + next.length.into_inner(), Ordering::AcqRel);
        start
    }

    /// The same file, for another reader.
    pub(crate) fn reopened(&self) -> io::Result<Self> {
        let parts = self.parts.read();
        let parts = parts.iter().map(|part| Ok(Part { start: part.start, file: part.file.try_clone()? }));
        let parts = RwLock::new(parts.collect::<io::Result<_>>()?);
        Ok(Self { parts, length: AtomicUsize::new(self.len()), limits: self.limits.clone() })
    }

    /// Limits that apply to reading the file.
    pub fn limits(&self) -> &LogLimits {
        &self.limits
    }

    /// Reads a range of bytes, at most the size of a record; the error is a description of the problem.
    pub fn read(&self, range: Range<usize>) -> Result<Vec<u8>, String> {
        let length = range.end.saturating_sub(range.start);
        if range.end > self.len() {
            return Err(format!("bytes {} to {} of a file of {}", range.start, range.end, self.len()));
        }
        self.limits.check_record("a record", length as u64, length as u64).map_err(|error| error.to_string())?;
        let mut bytes = Vec::new();
        bytes.try_reserve_exact(length).map_err(|error| format!("{length} bytes do not fit into memory ({error})"))?;
        bytes.resize(length, 0);
        self.read_into(range.start, &mut bytes)?;
        Ok(bytes)
    }

    /// Fills a buffer with the bytes from `start` on.
    fn read_into(&self, start: usize, buffer: &mut [u8]) -> Result<(), String> {
        let parts = self.parts.read();
        let mut done = 0;
        while done < buffer.len() {
            let at = start + done;
            let number = parts.partition_point(|part| part.start <= at).saturating_sub(1);
            let Part { start: begin, file } = &parts[number];
            let end = parts.get(number + 1).map_or(usize::MAX, |next| next.start);
            let wanted = (buffer.len() - done).min(end - at);
            match read_at(file, &mut buffer[done..done + wanted], (at - begin) as u64) {
                Ok(0) => return Err(self.shrunk(begin + parts[number].length())),
                Ok(count) => done += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(format!("byte {} cannot be read ({error})", start + done)),
            }
        }
        Ok(())
    }

    fn shrunk(&self, end: usize) -> String {
        format!(
            "the file was shortened while it was open: it ends at byte {end} and had {} bytes when it was opened",
            self.len()
        )
    }

    /// Returns an error if the file is shorter than when it was opened.
    pub(crate) fn require_unshortened(&self, path: &Path) -> Result<(), LogError> {
        let failed = |source| LogError::Io { action: "read the log", source, path: path.to_owned() };
        let parts = self.parts.read();
        let ends = parts.iter().skip(1).map(|next| next.start).chain([self.len()]);
        for (part, end) in parts.iter().zip(ends) {
            let now = part.start + part.file.metadata().map_err(failed)?.len() as usize;
            if now < end {
                return Err(LogError::Shortened { problem: self.shrunk(now), path: path.to_owned() });
            }
        }
        Ok(())
    }
}

#[cfg(unix)]
fn read_at(file: &File, buffer: &mut [u8], start: u64) -> io::Result<usize> {
    std::os::unix::fs::FileExt::read_at(file, buffer, start)
}

#[cfg(windows)]
fn read_at(file: &File, buffer: &mut [u8], start: u64) -> io::Result<usize> {
    std::os::windows::fs::FileExt::seek_read(file, buffer, start)
}

/// Description of a path that is neither a file nor a folder.
pub(crate) fn kind_of(metadata: &std::fs::Metadata) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        let file_type = metadata.file_type();
        if file_type.is_fifo() {
            return "a named pipe";
        }
        if file_type.is_socket() {
            return "a socket";
        }
    }
    if metadata.is_dir() { "a folder" } else { "a device" }
}

/// Decompresses a Zstandard file into a temporary one, which is removed when it is closed.
fn unpack(packed: File, packed_bytes: u64, path: &Path, limits: &LogLimits) -> Result<File, LogError> {
    let failed = |source| LogError::Io { action: "unpack the log", source, path: path.to_owned() };
    let mut decoder = zstd::Decoder::new(BufReader::new(packed)).map_err(failed)?;
    let mut plain = tempfile::tempfile().map_err(|source| LogError::Io {
        action: "create a temporary file to unpack the log",
        source,
        path: path.to_owned(),
    })?;
    let allowed = limits.unpacked_bytes(packed_bytes);
    let mut buffer = vec![0; UNPACK_BYTES];
    let mut found = 0;
    loop {
        let count = match decoder.read(&mut buffer) {
            Ok(0) => break,
            Ok(count) => count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            // The data before the damage form a truncated log.
            Err(_) if found > 0 => break,
            Err(error) => return Err(failed(error)),
        };
        found += count as u64;
        if found > allowed {
            let exceeded = LimitExceeded {
                kind: LimitKind::UnpackedBytes,
                subject: "the file is unpacked to the size",
                found: found.max(allowed.saturating_mul(2)),
                allowed,
            };
            return Err(LogError::Limit { exceeded, path: path.to_owned() });
        }
        plain.write_all(&buffer[..count]).map_err(|source| LogError::Io {
            action: "write the temporary file of the unpacked log",
            source,
            path: path.to_owned(),
        })?;
    }
    Ok(plain)
}

/// Path without the extension of a compressed file: `a.mcap` for `a.mcap.zstd`.
pub(crate) fn unpacked_name(path: &Path) -> PathBuf {
    let packed = path.extension().is_some_and(|extension| extension == "zstd" || extension == "zst");
    if packed { path.with_extension("") } else { path.to_owned() }
}

/// Buffered sequential reader, so that small records do not need a system call each.
pub(crate) struct FileWindow<'a> {
    file: &'a LogFile,
    start: usize,
    bytes: Vec<u8>,
}

impl<'a> FileWindow<'a> {
    pub(crate) fn new(file: &'a LogFile) -> Self {
        Self { file, start: 0, bytes: Vec::new() }
    }

    /// Reads a range of bytes that lies in the file.
    pub(crate) fn read(&mut self, range: Range<usize>) -> Result<&[u8], String> {
        let held = self.start..self.start + self.bytes.len();
        if range.start < held.start || range.end > held.end {
            let wanted = range.end.saturating_sub(range.start).max(WINDOW_BYTES);
            let end = range.start.saturating_add(wanted).min(self.file.len()).max(range.end);
            self.bytes = self.file.read(range.start..end)?;
            self.start = range.start;
        }
        Ok(&self.bytes[range.start - self.start..range.end - self.start])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        std::fs::write(&path, bytes).unwrap();
        (folder, path)
    }

    fn noise(count: u32) -> Vec<u8> {
        (0..count).map(|index| (index.wrapping_mul(2_654_435_761) >> 24) as u8).collect()
    }

    #[test]
    fn a_window_gives_the_bytes_of_the_file() {
        let bytes = noise(300_000);
        let (_folder, path) = written(&bytes);
        let file = LogFile::open(&path, &LogLimits::default()).unwrap();
        let mut window = FileWindow::new(&file);
        for range in [0..9, 9..31, 5..9, 16_380..16_390, 100_000..299_999, 299_990..300_000, 0..1, 300_000..300_000] {
            assert_eq!(window.read(range.clone()).unwrap(), &bytes[range]);
        }
        assert!(window.read(299_999..300_001).is_err());
    }

    #[test]
    fn a_file_shortened_while_it_is_open_is_an_error() {
        let (_folder, path) = written(&noise(10_000));
        let file = LogFile::open(&path, &LogLimits::default()).unwrap();
        file.require_unshortened(&path).unwrap();
        std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(4000).unwrap();
        assert_eq!(file.read(0..4000).unwrap().len(), 4000);
        let problem = file.read(3000..5000).unwrap_err();
        assert!(problem.contains("it ends at byte 4000 and had 10000 bytes"), "{problem}");
        let error = file.require_unshortened(&path).unwrap_err().to_string();
        assert!(error.contains("shortened while it was open"), "{error}");
    }

    #[test]
    fn a_file_under_zstandard_is_unpacked_within_its_limit() {
        let bytes = noise(100_000);
        let (_folder, path) = written(&zstd::encode_all(&bytes[..], 1).unwrap());
        let file = LogFile::open(&path, &LogLimits::default()).unwrap();
        assert_eq!(file.read(0..file.len()).unwrap(), bytes);
        let limits = LogLimits { settings: vec!["unpacked-bytes=99999".parse().unwrap()] };
        let error = LogFile::open(&path, &limits).unwrap_err().to_string();
        assert!(error.contains("--limit unpacked-bytes=") && error.ends_with("log.mcap"), "{error}");
    }

    #[test]
    fn the_ending_of_a_compressed_log_is_taken_off() {
        assert_eq!(unpacked_name(Path::new("a/b.mcap.zstd")), Path::new("a/b.mcap"));
        assert_eq!(unpacked_name(Path::new("a/b.mcap.zst")), Path::new("a/b.mcap"));
        assert_eq!(unpacked_name(Path::new("a/b.mcap")), Path::new("a/b.mcap"));
    }

    #[cfg(unix)]
    #[test]
    fn devices_and_sockets_are_refused() {
        let error = LogFile::open(Path::new("/dev/null"), &LogLimits::default()).unwrap_err().to_string();
        assert!(error.contains("a device"), "{error}");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        let _listener = std::os::unix::net::UnixListener::bind(&path).unwrap();
        let error = LogFile::open(&path, &LogLimits::default()).unwrap_err().to_string();
        assert!(error.contains("a socket"), "{error}");
    }
}
