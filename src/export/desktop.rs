//! The files and figures of the machine that the window asks for.

use std::fs;
use std::path::{Path, PathBuf};

use super::recent_files::RecentFiles;
use crate::gui::desktop::{Desktop, PathEntry};

/// How many entries of a folder are looked at.
const MOST_READ: usize = 5000;
/// How far above the program sample logs are looked for: `target/release/dcvins` lies three folders deep.
const LEVELS_ABOVE: usize = 4;

/// The machine as it is.
#[derive(Clone, Debug)]
pub struct Machine {
    recent: RecentFiles,
}

impl Machine {
    /// The machine with the user's list of recent logs.
    pub fn new() -> Self {
        Self { recent: RecentFiles::of_user() }
    }
}

impl Default for Machine {
    fn default() -> Self {
        Self::new()
    }
}

impl Desktop for Machine {
    fn complete(&self, typed: &str) -> Vec<PathEntry> {
        let home = std::env::var("HOME").ok();
        let typed = match (typed.strip_prefix("~/"), home) {
            (Some(rest), Some(home)) => format!("{home}/{rest}"),
            _ => typed.to_owned(),
        };
        let (folder, begin) = typed.rsplit_once('/').map_or(("", typed.as_str()), |(folder, begin)| (folder, begin));
        let read = if typed.starts_with('/') && folder.is_empty() { "/" } else { folder };
        let Ok(entries) = fs::read_dir(if read.is_empty() { "." } else { read }) else { return Vec::new() };
        let prefix = if typed.contains('/') { format!("{folder}/") } else { String::new() };
        let mut found: Vec<PathEntry> = entries
            .filter_map(Result::ok)
            .take(MOST_READ)
            .filter_map(|entry| {
                let name = entry.file_name().into_string().ok()?;
                let hidden = name.starts_with('.') && !begin.starts_with('.');
                if hidden || !name.starts_with(begin) {
                    return None;
                }
                let folder = entry.path().is_dir();
                let end = if folder { "/" } else { "" };
                (folder || is_log(&entry.path())).then(|| PathEntry { path: format!("{prefix}{name}{end}"), folder })
            })
            .collect();
        found.sort_by(|a, b| (!a.folder, &a.path).cmp(&(!b.folder, &b.path)));
        found
    }

    fn recent_logs(&self) -> Vec<PathBuf> {
        self.recent.list()
    }

    fn remember_log(&self, path: &Path) {
        self.recent.remember(path);
    }

    fn sample_logs(&self) -> Vec<PathBuf> {
        let program = std::env::current_exe().ok();
        let above =
            program.iter().flat_map(|program| program.ancestors().skip(1).take(LEVELS_ABOVE)).map(Path::to_path_buf);
        let folders = std::env::current_dir().into_iter().chain(above).map(|folder| folder.join("sample_logs"));
        folders.map(|folder| logs_in(&folder)).find(|logs| !logs.is_empty()).unwrap_or_default()
    }

    fn resident_bytes(&self) -> Option<u64> {
        let status = fs::read_to_string("/proc/self/status").ok()?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
        let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
        Some(kibibytes * 1024)
    }
}

fn is_log(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mcap"))
}

fn logs_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    let mut logs: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| is_log(path)).collect();
    logs.sort();
    logs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_come_first_and_only_logs_are_offered() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.mcap", "a.MCAP", "b.rig.yaml", ".hidden.mcap"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        fs::create_dir(folder.path().join("bags")).unwrap();
        let machine = Machine { recent: RecentFiles::in_file(folder.path().join("recent")) };
        let root = folder.path().to_string_lossy().into_owned();
        let names = |typed: String| -> Vec<String> {
            machine.complete(&typed).into_iter().map(|entry| entry.path.replacen(&root, "", 1)).collect()
        };
        assert_eq!(names(format!("{root}/")), ["/bags/", "/a.MCAP", "/b.mcap"]);
        assert_eq!(names(format!("{root}/b")), ["/bags/", "/b.mcap"]);
        assert_eq!(names(format!("{root}/.h")), ["/.hidden.mcap"]);
        assert!(names(format!("{root}/nowhere/x")).is_empty());
        assert!(machine.complete("/").iter().all(|entry| entry.path.starts_with('/')));
    }

    #[test]
    fn memory_is_read_where_the_system_tells_it() {
        let bytes = Machine::new().resident_bytes();
        assert!(!cfg!(target_os = "linux") || bytes.is_some_and(|bytes| bytes > 1 << 20));
    }
}
