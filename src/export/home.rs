//! What the window asks of the machine: paths to complete, recent logs, sample logs, the memory in use.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::gui::desktop::{Desktop, PathEntry};

/// Logs kept in the list of recent ones.
const RECENT_LOGS: usize = 10;
/// Entries offered for a path that was typed.
const COMPLETIONS: usize = 50;
/// Folders above the program in which `sample_logs` is looked for: `target/release` lies two below a checkout.
const ANCESTORS: usize = 4;

/// The person's home and the file system.
///
/// The recent logs lie in `$XDG_STATE_HOME/dcvins/recent_logs` (`~/.local/state` when that is not set), one path a line;
/// where they cannot be kept, the list is empty.
#[derive(Clone, Debug, Default)]
pub struct Home {
    recent_file: Option<PathBuf>,
}

impl Home {
    /// The home of whoever started the program.
    pub fn of_user() -> Self {
        let folder = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
        let state = folder("XDG_STATE_HOME")
            .filter(|path| path.is_absolute())
            .or_else(|| folder("HOME").map(|home| home.join(".local/state")))
            .or_else(|| folder("LOCALAPPDATA"));
        Self { recent_file: state.map(|state| state.join("dcvins/recent_logs")) }
    }

    /// A home that keeps its list in the given file.
    pub fn with_recent_file(path: PathBuf) -> Self {
        Self { recent_file: Some(path) }
    }

    fn listed_logs(&self) -> Vec<PathBuf> {
        let text = self.recent_file.as_ref().and_then(|path| fs::read_to_string(path).ok()).unwrap_or_default();
        text.lines().filter(|line| !line.is_empty()).map(PathBuf::from).collect()
    }
}

impl Desktop for Home {
    fn complete(&self, typed: &str) -> Vec<PathEntry> {
        let (folder, begin) =
            typed.rfind(['/', std::path::MAIN_SEPARATOR]).map_or(("", typed), |at| typed.split_at(at + 1));
        let read = fs::read_dir(if folder.is_empty() { "." } else { folder });
        let mut entries: Vec<PathEntry> = read
            .into_iter()
            .flatten()
            .flatten()
            .filter_map(|entry| {
                let name = entry.file_name().into_string().ok()?;
                let is_folder = fs::metadata(entry.path()).is_ok_and(|data| data.is_dir());
                let hidden = name.starts_with('.') && !begin.starts_with('.');
                let wanted = name.starts_with(begin) && !hidden && (is_folder || is_log(&entry.path()));
                wanted.then(|| PathEntry { path: format!("{folder}{name}"), folder: is_folder })
            })
            .collect();
        entries.sort_by(|a, b| b.folder.cmp(&a.folder).then_with(|| a.path.cmp(&b.path)));
        entries.truncate(COMPLETIONS);
        entries
    }

    fn recent_logs(&self) -> Vec<PathBuf> {
        self.listed_logs().into_iter().filter(|path| path.is_file()).collect()
    }

    fn remember_log(&self, path: &Path) {
        let Some(file) = &self.recent_file else { return };
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let mut logs = self.listed_logs();
        logs.retain(|known| *known != path);
        logs.insert(0, path);
        logs.truncate(RECENT_LOGS);
        let text: String = logs.iter().map(|log| format!("{}\n", log.display())).collect();
        // A list that cannot be kept costs the person a convenience, not their work.
        let _ = write_list(file, &text);
    }

    fn sample_logs(&self) -> Vec<PathBuf> {
        let program = std::env::current_exe().ok();
        let above = program.iter().flat_map(|program| program.ancestors().skip(1).take(ANCESTORS).map(Path::to_owned));
        let folder = std::iter::once(PathBuf::from("."))
            .chain(above)
            .map(|folder| folder.join("sample_logs"))
            .find(|folder| folder.is_dir());
        let mut logs: Vec<PathBuf> = folder
            .and_then(|folder| fs::read_dir(folder).ok())
            .into_iter()
            .flatten()
            .flatten()
            .map(|entry| entry.path())
            .filter(|path| is_log(path))
            .collect();
        logs.sort();
        logs
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

fn write_list(file: &Path, text: &str) -> std::io::Result<()> {
    if let Some(folder) = file.parent() {
        fs::create_dir_all(folder)?;
    }
    fs::File::create(file)?.write_all(text.as_bytes())
}
