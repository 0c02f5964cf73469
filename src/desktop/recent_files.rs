//! List of recently opened logs, a file in the user's state folder. An unreadable list counts as empty.

use std::fs;
use std::path::{Path, PathBuf};

use directories::ProjectDirs;

use crate::files::output;

/// Maximum number of entries.
const MAX_LOGS: usize = 12;

/// The list as a file: one path per line, the newest first.
#[derive(Clone, Debug)]
pub struct RecentFiles {
    file: Option<PathBuf>,
}

/// Folder of the program's state: `$XDG_STATE_HOME/dcvins` or `~/.local/state/dcvins` on Linux, the user's local
/// application data elsewhere; `None` for a user without a home folder.
pub(crate) fn state_folder() -> Option<PathBuf> {
    let folders = ProjectDirs::from("", "", "dcvins")?;
    Some(folders.state_dir().unwrap_or_else(|| folders.data_local_dir()).to_path_buf())
}

impl RecentFiles {
    /// The user's list: the file `recent` in the program's state folder.
    pub fn of_user() -> Self {
        Self { file: state_folder().map(|folder| folder.join("recent")) }
    }

    pub fn in_file(file: PathBuf) -> Self {
        Self { file: Some(file) }
    }

    /// Logs, sessions and studies that still exist, newest first.
    pub fn list(&self) -> Vec<PathBuf> {
        self.read().into_iter().filter(|path| path.exists()).collect()
    }

    fn read(&self) -> Vec<PathBuf> {
        let text = self.file.as_ref().and_then(|file| fs::read(file).ok()).unwrap_or_default();
        let lines = text.split(|byte| *byte == b'\n').filter(|line| !line.trim_ascii().is_empty());
        lines.map(path_of_line).take(MAX_LOGS).collect()
    }

    /// Moves a log to the head of the list; if the state folder cannot be written, the list remains unchanged.
    pub fn remember(&self, path: &Path) {
        let Some(file) = &self.file else { return };
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
        let line = line_of_path(&path);
        if line.contains(&b'\n') {
            return;
        }
        let mut lines = vec![line];
        for known in self.read() {
            let known = line_of_path(&known);
            if lines.len() < MAX_LOGS && !lines.contains(&known) {
                lines.push(known);
            }
        }
        if let Some(folder) = file.parent() {
            drop(fs::create_dir_all(folder));
        }
        let mut text = lines.join(&b'\n');
        text.push(b'\n');
        drop(output::write_file(file, &text));
    }
}

/// A path as a line of the list: on Unix its raw bytes, which may not be UTF-8.
#[cfg(unix)]
fn line_of_path(path: &Path) -> Vec<u8> {
    use std::os::unix::ffi::OsStrExt as _;
    path.as_os_str().as_bytes().to_vec()
}

#[cfg(unix)]
fn path_of_line(line: &[u8]) -> PathBuf {
    use std::os::unix::ffi::OsStrExt as _;
    PathBuf::from(std::ffi::OsStr::from_bytes(line))
}

#[cfg(not(unix))]
fn line_of_path(path: &Path) -> Vec<u8> {
    path.to_string_lossy().into_owned().into_bytes()
}

#[cfg(not(unix))]
fn path_of_line(line: &[u8]) -> PathBuf {
    PathBuf::from(String::from_utf8_lossy(line).trim_end().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_comes_first_and_each_once() {
        let folder = tempfile::tempdir().unwrap();
        let recent = RecentFiles::in_file(folder.path().join("state/dcvins/recent"));
        assert!(recent.list().is_empty());
        let logs: Vec<PathBuf> = (0..20).map(|number| folder.path().join(format!("{number}.mcap"))).collect();
        for log in &logs {
            fs::write(log, "").unwrap();
            recent.remember(log);
        }
        recent.remember(&logs[15]);
        let names: Vec<String> =
            recent.list().iter().map(|path| path.file_stem().unwrap().to_string_lossy().into_owned()).collect();
        assert_eq!(names.len(), MAX_LOGS);
        assert_eq!(names[..4], ["15", "19", "18", "17"]);
        assert_eq!(names.iter().filter(|name| *name == "15").count(), 1);
        fs::remove_file(&logs[15]).unwrap();
        assert_eq!(recent.list().len(), MAX_LOGS - 1, "what is gone is not offered");
    }

    #[cfg(unix)]
    #[test]
    fn names_need_not_be_utf_8() {
        use std::os::unix::ffi::OsStrExt as _;
        let folder = tempfile::tempdir().unwrap();
        let recent = RecentFiles::in_file(folder.path().join("recent"));
        let log = folder.path().canonicalize().unwrap().join(std::ffi::OsStr::from_bytes(b"\xff.mcap"));
        fs::write(&log, "").unwrap();
        recent.remember(&log);
        recent.remember(&log);
        assert_eq!(recent.list(), [log]);
    }

    #[test]
    fn a_place_that_cannot_be_written_is_no_error() {
        let folder = tempfile::tempdir().unwrap();
        let blocked = folder.path().join("file");
        fs::write(&blocked, "").unwrap();
        let recent = RecentFiles::in_file(blocked.join("recent"));
        recent.remember(Path::new("/a.mcap"));
        assert!(recent.list().is_empty());
        RecentFiles { file: None }.remember(Path::new("/a.mcap"));
    }
}
