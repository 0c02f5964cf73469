//! The list of recently opened logs, a file in the user's state folder. A list that cannot be read or written counts as
//! empty.

use std::fs;
use std::path::{Path, PathBuf};

use directories::ProjectDirs;

/// Maximum number of logs in the list.
const MAX_LOGS: usize = 12;

/// The list as a file: one path per line, the newest first.
#[derive(Clone, Debug)]
pub struct RecentFiles {
    file: Option<PathBuf>,
}

/// Folder of the program's state: `$XDG_STATE_HOME/dcvins` or `~/.local/state/dcvins` on Linux, the user's local
/// application data elsewhere; `None` for a user without a home folder.
pub(super) fn state_folder() -> Option<PathBuf> {
    let folders = ProjectDirs::from("", "", "dcvins")?;
    Some(folders.state_dir().unwrap_or_else(|| folders.data_local_dir()).to_path_buf())
}

impl RecentFiles {
    /// The user's list: the file `recent` in the program's state folder.
    pub fn of_user() -> Self {
        Self { file: state_folder().map(|folder| folder.join("recent")) }
    }

    /// A list in a file.
    pub fn in_file(file: PathBuf) -> Self {
        Self { file: Some(file) }
    }

    /// Logs that still exist, newest first.
    pub fn list(&self) -> Vec<PathBuf> {
        self.read().into_iter().filter(|path| path.is_file()).collect()
    }

    fn read(&self) -> Vec<PathBuf> {
        let text = self.file.as_ref().and_then(|file| fs::read_to_string(file).ok()).unwrap_or_default();
        text.lines().filter(|line| !line.trim().is_empty()).map(PathBuf::from).take(MAX_LOGS).collect()
    }

    /// Moves a log to the head of the list; a state folder that cannot be written leaves the list unchanged.
    pub fn remember(&self, path: &Path) {
        let Some(file) = &self.file else { return };
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
        let line = path.to_string_lossy().into_owned();
        if line.contains('\n') {
            return;
        }
        let mut lines = vec![line];
        for known in self.read() {
            let known = known.to_string_lossy().into_owned();
            if lines.len() < MAX_LOGS && !lines.contains(&known) {
                lines.push(known);
            }
        }
        if let Some(folder) = file.parent() {
            drop(fs::create_dir_all(folder));
        }
        let text: String = lines.iter().flat_map(|line| [line.as_str(), "\n"]).collect();
        drop(fs::write(file, text));
    }
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
