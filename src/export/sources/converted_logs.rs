//! Folder of converted logs of the user, one entry per recording.
//!
//! The name of an entry is the SHA-256 of the version of this program, of path, size and modification time of every
//! source file, and of the options. An entry appears under its name only when it is complete; it holds the log, the rig
//! and the report of the conversion, and the list of its sources.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use directories::ProjectDirs;
use sha2::{Digest as _, Sha256};

use super::{LogSources, SourceError};
use crate::study::hex;

/// Size limit of all entries together, in bytes; the least recently opened are removed first, the newest always stays.
const MAX_BYTES: u64 = 20 << 30;
/// Bytes of the hash in the name of an entry.
const NAME_BYTES: usize = 12;
/// File of an entry with the paths of its sources, one per line; its modification time is the time of the entry's last
/// use.
const SOURCES: &str = "sources.txt";
/// Start of the name of an entry that is being written.
const UNFINISHED: &str = ".unfinished-";
/// Age after which an unfinished entry counts as left behind by a killed process.
const LEFTOVER_AGE: Duration = Duration::from_hours(24);

#[derive(Clone, Debug)]
pub struct ConvertedLogs {
    folder: PathBuf,
    max_bytes: u64,
}

impl ConvertedLogs {
    /// The user's folder: `converted` in `$XDG_CACHE_HOME/dcvins` or `~/.cache/dcvins` on Linux; `None` for a user without
    /// a home folder.
    pub fn of_user() -> Option<Self> {
        let folders = ProjectDirs::from("", "", "dcvins")?;
        Some(Self::in_folder(folders.cache_dir()))
    }

    /// Sub-folder `converted` of a folder, which does not have to exist yet.
    pub fn in_folder(folder: &Path) -> Self {
        Self { folder: folder.join("converted"), max_bytes: MAX_BYTES }
    }

    #[cfg(test)]
    pub(super) fn with_max_bytes(self, max_bytes: u64) -> Self {
        Self { max_bytes, ..self }
    }

    /// Folder of the entry of a recording.
    ///
    /// # Errors
    /// When a source cannot be examined.
    pub(super) fn entry_of(&self, sources: &LogSources, options: &str) -> Result<PathBuf, SourceError> {
        let mut hash = Sha256::new();
        hash.update(env!("CARGO_PKG_VERSION"));
        let mut add = |bytes: &[u8]| {
            hash.update((bytes.len() as u64).to_le_bytes());
            hash.update(bytes);
        };
        add(options.as_bytes());
        let rig = sources.rig.as_deref().filter(|_| sources.autopilot.is_some());
        for path in sources.recordings().chain(rig) {
            let state = state_of(path).map_err(SourceError::cache("examine the source", path))?;
            add(&state);
        }
        Ok(self.folder.join(hex(&hash.finalize()[..NAME_BYTES])))
    }

    /// True if an entry is complete; it then counts as used now.
    pub(super) fn take(&self, entry: &Path) -> bool {
        let list = entry.join(SOURCES);
        if !list.is_file() {
            return false;
        }
        let touched = self.now().and_then(|now| File::options().append(true).open(&list)?.set_modified(now));
        // A failure only makes its removal earlier.
        drop(touched);
        true
    }

    /// Present time of the file system of the folder.
    fn now(&self) -> io::Result<SystemTime> {
        tempfile::NamedTempFile::new_in(&self.folder)?.as_file().metadata()?.modified()
    }

    /// Empty folder in which an entry is written; dropping it removes it.
    pub(super) fn unfinished(&self) -> Result<tempfile::TempDir, SourceError> {
        fs::create_dir_all(&self.folder)
            .map_err(SourceError::cache("make the folder of converted logs", &self.folder))?;
        self.remove_leftovers();
        let made = tempfile::Builder::new().prefix(UNFINISHED).tempdir_in(&self.folder);
        made.map_err(SourceError::cache("write into the folder of converted logs", &self.folder))
    }

    /// Gives a complete entry its name and removes the least recently opened ones beyond the size limit.
    pub(super) fn finish(
        &self,
        unfinished: tempfile::TempDir,
        entry: &Path,
        sources: &LogSources,
    ) -> Result<(), SourceError> {
        let failed = SourceError::cache("keep the converted log", entry);
        let lines: Vec<String> = sources.recordings().map(|path| format!("{}\n", path.display())).collect();
        let written = fs::write(unfinished.path().join(SOURCES), lines.concat());
        let renamed = written.and_then(|()| fs::rename(unfinished.path(), entry));
        if let Err(error) = renamed {
            // Another process may have converted the same recording.
            return if self.take(entry) { Ok(()) } else { Err(failed(error)) };
        }
        // The folder has got its name, and is not removed.
        let _renamed = unfinished.keep();
        self.make_room(entry);
        Ok(())
    }

    /// Paths of the sources of a log in this folder; empty for any other log.
    pub fn sources_of(&self, log: &Path) -> Vec<PathBuf> {
        let entry = log.parent().filter(|entry| entry.parent() == Some(self.folder.as_path()));
        let text = entry.and_then(|entry| fs::read_to_string(entry.join(SOURCES)).ok()).unwrap_or_default();
        text.lines().map(PathBuf::from).collect()
    }

    /// Path next to a source with another ending: `a.rig.yaml` for `a.bag`, `a.b.rig.yaml` for the folder `a.b`.
    pub fn path_beside(source: &Path, ending: &str) -> PathBuf {
        if source.is_dir() {
            let name = source.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            source.with_file_name(format!("{name}.{ending}"))
        } else {
            source.with_extension(ending)
        }
    }

    fn make_room(&self, kept: &Path) {
        let mut entries: Vec<(SystemTime, PathBuf, u64)> = Vec::new();
        for entry in fs::read_dir(&self.folder).into_iter().flatten().filter_map(Result::ok) {
            let path = entry.path();
            let used = fs::metadata(path.join(SOURCES)).and_then(|metadata| metadata.modified());
            if let Ok(used) = used {
                entries.push((used, path.clone(), bytes_in(&path)));
            }
        }
        entries.sort();
        let mut total: u64 = entries.iter().map(|(.., bytes)| bytes).sum();
        for (_, path, bytes) in entries.into_iter().filter(|(_, path, _)| path != kept) {
            if total <= self.max_bytes {
                break;
            }
            // A log that is open in another process stays readable there.
            if fs::remove_dir_all(&path).is_ok() {
                total -= bytes;
            }
        }
    }

    /// Removes unfinished entries of processes that were killed.
    fn remove_leftovers(&self) {
        let Ok(now) = self.now() else { return };
        for entry in fs::read_dir(&self.folder).into_iter().flatten().filter_map(Result::ok) {
            let written = entry.metadata().and_then(|metadata| metadata.modified());
            let old = written.is_ok_and(|at| now.duration_since(at).is_ok_and(|age| age > LEFTOVER_AGE));
            if old && entry.file_name().to_string_lossy().starts_with(UNFINISHED) {
                // Another process may remove it at the same time.
                drop(fs::remove_dir_all(entry.path()));
            }
        }
    }
}

/// Sum of the sizes of the files in a folder.
fn bytes_in(folder: &Path) -> u64 {
    let entries = fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    entries.filter_map(|entry| entry.metadata().ok()).map(|metadata| metadata.len()).sum()
}

/// Path, size and modification time of a file, or of all files below a folder in the order of their paths.
fn state_of(path: &Path) -> io::Result<Vec<u8>> {
    let mut state = Vec::new();
    let mut waiting = vec![fs::canonicalize(path)?];
    while let Some(path) = waiting.pop() {
        let metadata = fs::metadata(&path)?;
        if metadata.is_dir() {
            let mut inside = fs::read_dir(&path)?.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<_>>>()?;
            inside.sort();
            waiting.extend(inside);
            continue;
        }
        let modified = metadata.modified()?.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        state.extend_from_slice(path.as_os_str().as_encoded_bytes());
        state.push(0);
        state.extend_from_slice(&metadata.len().to_le_bytes());
        state.extend_from_slice(&modified.as_nanos().to_le_bytes());
    }
    Ok(state)
}
