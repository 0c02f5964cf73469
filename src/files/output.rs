//! Atomic writing of files: each is written to a temporary file in the same folder, flushed to the disk, then renamed.
//!
//! If anything fails before the rename (an error, a full disk, an interrupt, a killed process), the final name has the
//! old file, or none; afterwards it has the new one. If several processes write one file, each writes a complete one,
//! and the last rename wins.
//!
//! A temporary file is named `.NAME.dcvins-XXXXXX.tmp` and is locked as long as its process lives. A leftover of a
//! killed process has a free lock, and the next process that writes the same file removes it.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File, TryLockError};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile};

/// Part of the temporary name between the name of the file and six random characters.
const MARK: &str = ".dcvins-";
/// End of a temporary file's name.
const ENDING: &str = ".tmp";
/// Number of attempts to create a temporary file, since another process can remove it as a leftover.
const ATTEMPTS: usize = 8;

/// File that is being written under a temporary name; dropping it removes it.
#[derive(Debug)]
pub struct OutputFile {
    temporary: NamedTempFile,
    target: PathBuf,
}

/// Complete file under a temporary name; dropping it removes it.
#[derive(Debug)]
pub struct StagedFile {
    temporary: NamedTempFile,
    target: PathBuf,
}

impl OutputFile {
    /// Creates a file for a path; an existing file stays until [`StagedFile::commit`].
    ///
    /// # Errors
    /// When the path is a folder or no regular file, or its folder cannot be written.
    pub fn create(path: &Path) -> io::Result<Self> {
        let target = target_of(path)?;
        let (folder, name) = (folder_of(&target), file_name(&target)?);
        remove_leftovers(&folder, name);
        let temporary = temporary_file(&folder, name)?;
        Ok(Self { temporary, target })
    }

    /// Completes the content and flushes it to the disk.
    pub fn stage(self) -> io::Result<StagedFile> {
        let Self { mut temporary, target } = self;
        let written = temporary.flush().and_then(|()| temporary.as_file().sync_all());
        written.map_err(|error| described(error, None))?;
        Ok(StagedFile { temporary, target })
    }
}

impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.temporary.write(bytes).map_err(|error| described(error, None))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.temporary.flush()
    }
}

impl Seek for OutputFile {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.temporary.seek(position)
    }
}

impl StagedFile {
    /// Creates a complete file with this content.
    pub fn with_content(path: &Path, content: &[u8]) -> io::Result<Self> {
        let OutputFile { mut temporary, target } = OutputFile::create(path)?;
        let written = temporary.write_all(content).and_then(|()| temporary.as_file().sync_all());
        written.map_err(|error| described(error, Some(content.len())))?;
        Ok(Self { temporary, target })
    }

    /// Path of the complete file.
    pub fn path(&self) -> &Path {
        &self.target
    }

    /// Renames the file to its final path, replacing an older file.
    pub fn commit(self) -> io::Result<()> {
        self.temporary.persist(&self.target).map(drop).map_err(|error| error.error)
    }
}

/// Files that belong together: all are complete before the first one is renamed.
#[derive(Debug, Default)]
pub struct OutputSet(Vec<StagedFile>);

impl OutputSet {
    pub fn write(&mut self, path: &Path, content: &[u8]) -> io::Result<()> {
        self.0.push(StagedFile::with_content(path, content)?);
        Ok(())
    }

    pub fn add(&mut self, staged: StagedFile) {
        self.0.push(staged);
    }

    /// Final paths in the order in which the files were added.
    pub fn paths(&self) -> Vec<PathBuf> {
        self.0.iter().map(|staged| staged.path().to_owned()).collect()
    }

    /// Renames all files to their final paths, in the order in which they were added.
    ///
    /// # Errors
    /// The first file that could not be renamed, with the error; the files before it have their final names.
    pub fn commit(self) -> Result<(), (PathBuf, io::Error)> {
        for staged in self.0 {
            let path = staged.path().to_owned();
            staged.commit().map_err(|error| (path, error))?;
        }
        Ok(())
    }
}

/// True for the name of a temporary file, of a running process or a leftover.
pub fn is_temporary(name: &OsStr) -> bool {
    let name = name.to_string_lossy();
    name.starts_with('.') && name.contains(MARK) && name.ends_with(ENDING)
}

/// Writes a complete file, replacing an older one.
pub fn write_file(path: &Path, content: &[u8]) -> io::Result<()> {
    StagedFile::with_content(path, content)?.commit()
}

/// Checks that a file can be written under this name, before any work is done for it.
///
/// # Errors
/// When it is a folder or no regular file, or its folder is missing or cannot be written.
pub fn check_file(path: &Path) -> io::Result<()> {
    let target = target_of(path)?;
    let folder = folder_of(&target);
    if !folder.is_dir() {
        let problem = if folder.exists() { "is a file, not a folder" } else { "does not exist" };
        return Err(io::Error::new(io::ErrorKind::NotFound, format!("its folder '{}' {problem}", folder.display())));
    }
    temporary_file(&folder, file_name(&target)?).map(drop)
}

/// Checks that files can be written into this folder, which need not exist yet, before any work is done for them.
///
/// # Errors
/// When it is a file, or the nearest existing folder above it cannot be written.
pub fn check_folder(folder: &Path) -> io::Result<()> {
    let mut nearest = folder;
    while fs::symlink_metadata(nearest).is_err() {
        match nearest.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => nearest = parent,
            _ => {
                nearest = Path::new(".");
                break;
            }
        }
    }
    if !fs::metadata(nearest)?.is_dir() {
        let problem = if nearest == folder {
            "it is a file, expected a folder".to_owned()
        } else {
            format!("'{}' is a file, not a folder", nearest.display())
        };
        return Err(io::Error::new(io::ErrorKind::NotADirectory, problem));
    }
    temporary_file(nearest, OsStr::new("output")).map(drop)
}

/// Resolves a link to the actual file. Folders, devices and pipes are errors, since they cannot be replaced.
fn target_of(path: &Path) -> io::Result<PathBuf> {
    let Ok(metadata) = fs::metadata(path) else { return Ok(path.to_owned()) };
    if metadata.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder, expected the name of a file"));
    }
    if !metadata.is_file() {
        let problem = "it is a device, a pipe or a socket, expected a regular file";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
    }
    if fs::symlink_metadata(path)?.is_symlink() { fs::canonicalize(path) } else { Ok(path.to_owned()) }
}

/// Folder of a file, `.` for a name alone.
pub fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

fn file_name(path: &Path) -> io::Result<&OsStr> {
    let missing = || io::Error::new(io::ErrorKind::InvalidInput, "it has no name, expected the name of a file");
    path.file_name().ok_or_else(missing)
}

/// Prefix of the names of a file's temporary files: `.NAME.dcvins-`, with a long name cut.
fn prefix_of(name: &OsStr) -> OsString {
    /// In characters: names end at 255 bytes on most file systems, and a character takes up to four.
    const LONGEST: usize = 48;
    let name: String = name.to_string_lossy().chars().take(LONGEST).collect();
    OsString::from(format!(".{name}{MARK}"))
}

/// Creates a locked temporary file in the folder of a file.
fn temporary_file(folder: &Path, name: &OsStr) -> io::Result<NamedTempFile> {
    let prefix = prefix_of(name);
    let mut builder = Builder::new();
    builder.prefix(&prefix).suffix(ENDING);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // As for any new file, the process's umask is applied.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    for _ in 0..ATTEMPTS {
        let temporary = builder.tempfile_in(folder)?;
        match temporary.as_file().try_lock() {
            // Another process removed it as a leftover before it was locked.
            Err(TryLockError::WouldBlock) => {}
            Ok(()) if !temporary.path().exists() => {}
            // On a file system without locks, leftovers remain.
            Ok(()) | Err(TryLockError::Error(_)) => return Ok(temporary),
        }
    }
    Err(io::Error::new(io::ErrorKind::ResourceBusy, "its temporary file is removed by another process"))
}

/// Removes a file's temporary files whose processes have ended; ignores those that cannot be removed.
fn remove_leftovers(folder: &Path, name: &OsStr) {
    let prefix = prefix_of(name);
    let prefix = prefix.to_string_lossy();
    for entry in fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok) {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let is_ours = name.strip_prefix(&*prefix).and_then(|rest| rest.strip_suffix(ENDING));
        let is_ours = is_ours.is_some_and(|random| random.len() == 6 && !random.contains('.'));
        if !is_ours || !entry.file_type().is_ok_and(|kind| kind.is_file()) {
            continue;
        }
        let Ok(file) = File::options().write(true).open(entry.path()) else { continue };
        if file.try_lock().is_ok() {
            drop(fs::remove_file(entry.path()));
        }
    }
}

/// Adds the required size to an error about missing space.
fn described(error: io::Error, bytes: Option<usize>) -> io::Error {
    let what = match error.kind() {
        io::ErrorKind::StorageFull => "the disk is full",
        io::ErrorKind::QuotaExceeded => "the disk quota is used up",
        io::ErrorKind::FileTooLarge => "the file is larger than the system allows",
        _ => return error,
    };
    let needed = bytes.map(|bytes| format!(", the file takes {bytes} bytes")).unwrap_or_default();
    io::Error::new(error.kind(), format!("{what}{needed}; free some space or write elsewhere"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = entries.collect();
        names.sort();
        names
    }

    #[test]
    fn the_old_file_stays_until_the_new_one_is_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        write_file(&path, b"old").unwrap();
        let mut file = OutputFile::create(&path).unwrap();
        file.write_all(b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"old");
        drop(file);
        assert_eq!((fs::read(&path).unwrap(), names(folder.path())), (b"old".to_vec(), vec!["log.mcap".to_owned()]));
        let mut file = OutputFile::create(&path).unwrap();
        file.write_all(b"new").unwrap();
        let staged = file.stage().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"old");
        staged.commit().unwrap();
        assert_eq!((fs::read(&path).unwrap(), names(folder.path())), (b"new".to_vec(), vec!["log.mcap".to_owned()]));
    }

    #[test]
    fn leftovers_of_killed_processes_are_removed_and_living_ones_stay() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        let living = OutputFile::create(&path).unwrap();
        for name in [".log.mcap.dcvins-abc123.tmp", ".other.mcap.dcvins-abc123.tmp", ".log.mcap.dcvins-a.tmp"] {
            fs::write(folder.path().join(name), "left").unwrap();
        }
        write_file(&path, b"new").unwrap();
        let names = names(folder.path());
        assert!(!names.contains(&".log.mcap.dcvins-abc123.tmp".to_owned()), "{names:?}");
        assert_eq!(names.len(), 4, "{names:?}");
        living.stage().unwrap().commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"");
    }

    #[test]
    fn what_cannot_be_written_is_noticed_before_the_work() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let problem = |result: io::Result<()>| result.unwrap_err().to_string();
        assert!(problem(check_file(folder.path())).starts_with("it is a folder"));
        assert!(problem(check_file(&folder.path().join("none/log.mcap"))).contains("none' does not exist"));
        assert!(problem(check_file(&file.join("log.mcap"))).contains("file' is a file, not a folder"));
        assert!(problem(check_folder(&file)).starts_with("it is a file, expected a folder"));
        assert!(problem(check_folder(&file.join("out"))).contains("file' is a file, not a folder"));
        check_file(&file).unwrap();
        check_folder(&folder.path().join("a/b/c")).unwrap();
        check_folder(Path::new("a-new-folder")).unwrap();
        assert_eq!(names(folder.path()), ["file"], "a check leaves nothing behind");
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_devices_refused() {
        let folder = tempfile::tempdir().unwrap();
        let (target, link) = (folder.path().join("target"), folder.path().join("link"));
        fs::write(&target, "old").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        write_file(&link, b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&target).unwrap(), b"new");
        assert!(check_file(Path::new("/dev/null")).unwrap_err().to_string().contains("a device"));
        assert!(write_file(Path::new("/dev/null"), b"x").is_err());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_named_with_the_bytes() {
        let error = described(io::Error::from_raw_os_error(28), Some(1234)).to_string();
        assert_eq!(error, "the disk is full, the file takes 1234 bytes; free some space or write elsewhere");
    }
}
