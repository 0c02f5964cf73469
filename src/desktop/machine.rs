//! Access of the window to files and memory of the machine.

use crate::files::RigFile as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, channel};

use directories::UserDirs;

use super::recent_files::{RecentFiles, state_folder};
use super::{report, sample_flight};
use crate::export::{
    ExportError, is_session, read_motion, write_csv, write_motion, write_new_rig, write_png, write_screenshot,
    write_svg,
};
use crate::files::output;
use crate::gui::desktop::{Desktop, DrawnFigure, FigureExport, PanelExport, PathEntry, SampleProgress};
use crate::sensors::Rig;
use crate::simulation::{MotionSplines, PrescribedMotion};

/// Maximum number of entries read from a folder.
const MAX_ENTRIES: usize = 5000;
/// Number of parent folders of the program that are searched for sample logs: `target/release/dcvins` is three folders
/// deep.
const LEVELS_ABOVE: usize = 4;
/// Folders of sample logs below these: in the repository, and below the prefix of an installed package.
const SAMPLE_FOLDERS: [&str; 2] = ["sample_logs", "share/dcvins/sample_logs"];

/// Endings of recordings that are converted when they are opened.
const RECORDINGS: [&str; 8] = ["bag", "db3", "mp4", "mov", "m4v", "ulg", "bin", "tlog"];
/// Endings of rigs, which are opened together with a log.
const RIGS: [&str; 2] = ["yaml", "yml"];

/// File of the saved layouts in the user's state folder.
const LAYOUTS: &str = "layouts.json";
/// File of the settings in the user's state folder.
const SETTINGS: &str = "settings.json";

/// File of the window's size, position and layout in the user's state folder.
const WINDOW: &str = "window.json";

/// The desktop implementation for the real machine.
#[derive(Clone, Debug)]
pub struct Machine {
    recent: RecentFiles,
    /// Folder of layouts and settings, `None` if the user has no home folder.
    state: Option<PathBuf>,
    /// Folder of exported panels.
    output: PathBuf,
    /// Folder of the sample flight simulated by this program.
    samples: PathBuf,
}

impl Machine {
    /// The machine with the user's list of recent logs.
    pub fn new() -> Self {
        Self {
            recent: RecentFiles::of_user(),
            state: state_folder(),
            output: PathBuf::from("dcvins-output"),
            samples: sample_flight::folder(),
        }
    }

    /// A machine whose lists, settings and exported files are in one folder.
    pub fn in_folder(folder: &Path) -> Self {
        Self {
            recent: RecentFiles::in_file(folder.join("recent")),
            state: Some(folder.join("state")),
            output: folder.join("output"),
            samples: folder.join("samples"),
        }
    }

    fn kept(&self, name: &str) -> Option<String> {
        fs::read_to_string(self.state.as_ref()?.join(name)).ok()
    }

    fn keep(&self, name: &str, text: &str) -> Result<(), String> {
        let folder =
            self.state.as_ref().ok_or_else(|| format!("there is no home folder to keep {name} in: set HOME"))?;
        let file = folder.join(name);
        let written = fs::create_dir_all(folder).and_then(|()| output::write_file(&file, text.as_bytes()));
        written.map_err(|error| ExportError::write(&file)(error).to_string())
    }
}

impl Default for Machine {
    fn default() -> Self {
        Self::new()
    }
}

impl Desktop for Machine {
    fn complete(&self, typed: &str) -> Vec<PathEntry> {
        let typed = match (typed.strip_prefix("~/"), UserDirs::new()) {
            (Some(rest), Some(user)) => format!("{}/{rest}", user.home_dir().display()),
            _ => typed.to_owned(),
        };
        let (folder, begin) = typed.rsplit_once('/').map_or(("", typed.as_str()), |(folder, begin)| (folder, begin));
        let read = if typed.starts_with('/') && folder.is_empty() { "/" } else { folder };
        let Ok(entries) = fs::read_dir(if read.is_empty() { "." } else { read }) else { return Vec::new() };
        let prefix = if typed.contains('/') { format!("{folder}/") } else { String::new() };
        let mut found: Vec<PathEntry> = entries
            .filter_map(Result::ok)
            .take(MAX_ENTRIES)
            .filter_map(|entry| {
                let name = entry.file_name().into_string().ok()?;
                let hidden = name.starts_with('.') && !begin.starts_with('.');
                if hidden || !name.starts_with(begin) {
                    return None;
                }
                let folder = entry.path().is_dir();
                let end = if folder { "/" } else { "" };
                (folder || can_be_opened(&entry.path()))
                    .then(|| PathEntry { path: format!("{prefix}{name}{end}"), folder })
            })
            .collect();
        found.sort_by(|a, b| (!a.folder, &a.path).cmp(&(!b.folder, &b.path)));
        found
    }

    fn pick_log(&self) -> Option<Receiver<Vec<PathBuf>>> {
        let mut endings: Vec<String> = vec!["mcap".to_owned(), "zstd".to_owned(), "zst".to_owned(), "json".to_owned()];
        endings.extend(RECORDINGS.iter().chain(&RIGS).map(|ending| (*ending).to_owned()));
        endings.extend(endings.clone().iter().map(|ending| ending.to_ascii_uppercase()));
        let mut dialog = rfd::AsyncFileDialog::new()
            .set_title("Open flight log, recording or session")
            .add_filter("Flight logs, recordings, rigs and sessions", &endings)
            .add_filter("All files", &["*"]);
        if let Ok(folder) = std::env::current_dir() {
            dialog = dialog.set_directory(folder);
        }
        // On macOS the dialog must be created on the window's thread; any thread may wait for its result.
        let answer = dialog.pick_files();
        let (sender, receiver) = channel();
        let wait = move || {
            let files = pollster::block_on(answer).unwrap_or_default();
            // The receiver is dropped if the window was closed in the meantime.
            drop(sender.send(files.iter().map(|file| file.path().to_path_buf()).collect()));
        };
        std::thread::Builder::new().name("file-dialog".to_owned()).spawn(wait).ok().map(|_| receiver)
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
        let here = std::env::current_dir().into_iter().map(|folder| folder.join("sample_logs"));
        let folders = here.chain(above.flat_map(|folder| SAMPLE_FOLDERS.map(|name| folder.join(name))));
        let folders = folders.chain([self.samples.clone()]);
        folders.map(|folder| logs_in(&folder)).find(|logs| !logs.is_empty()).unwrap_or_default()
    }

    fn sample_folder(&self) -> &Path {
        &self.samples
    }

    fn make_sample(&self) -> Result<Receiver<SampleProgress>, String> {
        sample_flight::start(&self.samples)
    }

    fn kept_layouts(&self) -> Option<String> {
        self.kept(LAYOUTS)
    }

    fn keep_layouts(&self, text: &str) -> Result<(), String> {
        self.keep(LAYOUTS, text)
    }

    fn kept_settings(&self) -> Option<String> {
        self.kept(SETTINGS)
    }

    fn keep_settings(&self, text: &str) -> Result<(), String> {
        self.keep(SETTINGS, text)
    }

    fn kept_window(&self) -> Option<String> {
        self.kept(WINDOW)
    }

    fn keep_window(&self, text: &str) -> Result<(), String> {
        self.keep(WINDOW, text)
    }

    fn write_panel(&self, export: &PanelExport) -> Result<Vec<PathBuf>, String> {
        let paths = ["png", "svg", "csv"].map(|kind| self.output.join(format!("{}.{kind}", export.name)));
        let [screenshot, drawing, table] = &paths;
        let written = write_png(&export.screenshot, screenshot)
            .and_then(|()| write_svg(&export.drawing, drawing))
            .and_then(|()| write_csv(&export.table, table));
        written.map_err(|error| error.to_string())?;
        Ok(paths.map(|path| fs::canonicalize(&path).unwrap_or(path)).to_vec())
    }

    fn write_figure(&self, export: &FigureExport) -> Result<PathBuf, String> {
        let path = PathBuf::from(&export.path);
        let written = match &export.figure {
            DrawnFigure::Pixels(pixels) => write_png(pixels, &path),
            DrawnFigure::File(bytes) => write_screenshot(bytes, &path),
        };
        written.map_err(|error| error.to_string())?;
        Ok(fs::canonicalize(&path).unwrap_or(path))
    }

    fn start_report(&self, name: &str, arguments: &[String]) -> Result<Receiver<Result<PathBuf, String>>, String> {
        report::start(&self.output.join(name).join("report"), arguments)
    }

    fn write_session(&self, name: &str, text: &str) -> Result<PathBuf, String> {
        let folder = self.output.join(name);
        fs::create_dir_all(&folder).map_err(|error| ExportError::write(&folder)(error).to_string())?;
        let path = folder.join(format!("{name}.session.json"));
        output::write_file(&path, text.as_bytes()).map_err(|error| ExportError::write(&path)(error).to_string())?;
        Ok(fs::canonicalize(&path).unwrap_or(path))
    }

    fn write_rig(&self, path: &Path, text: &str) -> Result<PathBuf, String> {
        Rig::from_yaml(text, path).map_err(|error| error.to_string())?;
        write_new_rig(path, text, false).map_err(|error| match error {
            ExportError::Existing { .. } => format!("the rig exists; give another file name: {}", path.display()),
            error => error.to_string(),
        })?;
        Ok(fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf()))
    }

    fn write_motion(&self, path: &Path, motion: &MotionSplines, joint_names: &[String]) -> Result<PathBuf, String> {
        write_motion(motion, joint_names, path).map_err(|error| match error {
            ExportError::Existing { .. } => format!("the file exists; give another name: {}", path.display()),
            error => error.to_string(),
        })?;
        Ok(fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf()))
    }

    fn read_motion(&self, path: &Path) -> Result<PrescribedMotion, String> {
        read_motion(path).map_err(|error| error.to_string())
    }

    fn resident_bytes(&self) -> Option<u64> {
        let status = fs::read_to_string("/proc/self/status").ok()?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
        let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
        Some(kibibytes * 1024)
    }
}

/// True if the window can open the file: a log, a saved session, or a recording that is converted.
fn can_be_opened(path: &Path) -> bool {
    let plain = unpacked(path);
    let is_recording =
        plain.extension().is_some_and(|found| RECORDINGS.iter().any(|ending| found.eq_ignore_ascii_case(ending)));
    is_log(path) || is_recording
}

/// Path without the extension of a Zstandard file.
fn unpacked(path: &Path) -> PathBuf {
    let packed = path.extension().is_some_and(|found| ["zstd", "zst"].iter().any(|it| found.eq_ignore_ascii_case(it)));
    if packed { path.with_extension("") } else { path.to_path_buf() }
}

/// True for a log, also compressed by Zstandard, or a saved session.
fn is_log(path: &Path) -> bool {
    unpacked(path).extension().is_some_and(|found| found.eq_ignore_ascii_case("mcap")) || is_session(path)
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
    fn panels_and_layouts_are_written_where_they_are_found_again() {
        let folder = tempfile::tempdir().unwrap();
        let machine = Machine::in_folder(folder.path());
        assert_eq!(machine.kept_layouts(), None);
        machine.keep_layouts("{}").unwrap();
        assert_eq!((machine.kept_layouts().as_deref(), machine.kept_settings()), (Some("{}"), None));
        machine.keep_settings("{\"scale\": 2}").unwrap();
        assert_eq!(machine.kept_settings().as_deref(), Some("{\"scale\": 2}"));
        let screenshot = image::RgbaImage::from_pixel(20, 10, image::Rgba([9, 8, 7, 255]));
        let (drawing, table) = ("<svg/>\n".to_owned(), "a,b\n1,2\n".to_owned());
        let export = PanelExport { name: "yard/rank-1.500s".to_owned(), screenshot, drawing, table };
        let written = machine.write_panel(&export).unwrap();
        assert!(written[0].ends_with("output/yard/rank-1.500s.png"), "{written:?}");
        assert_eq!(image::open(&written[0]).unwrap().to_rgba8(), export.screenshot);
        assert_eq!(fs::read_to_string(&written[1]).unwrap(), export.drawing);
        assert_eq!(fs::read_to_string(&written[2]).unwrap(), export.table);
        fs::write(folder.path().join("blocked"), "").unwrap();
        let blocked = Machine { output: folder.path().join("blocked"), ..machine };
        assert!(blocked.write_panel(&export).unwrap_err().starts_with("cannot write"));
    }

    #[test]
    fn folders_come_first_and_only_logs_and_recordings_are_offered() {
        let folder = tempfile::tempdir().unwrap();
        for name in
            ["b.mcap", "a.MCAP", "b.rig.yaml", ".hidden.mcap", "c.mcap.zstd", "c.bag.zstd", "d.MP4", "notes.txt"]
        {
            fs::write(folder.path().join(name), "").unwrap();
        }
        fs::create_dir(folder.path().join("bags")).unwrap();
        let machine = Machine::in_folder(folder.path());
        let root = folder.path().to_string_lossy().into_owned();
        let names = |typed: String| -> Vec<String> {
            machine.complete(&typed).into_iter().map(|entry| entry.path.replacen(&root, "", 1)).collect()
        };
        assert_eq!(
            names(format!("{root}/")),
            ["/bags/", "/a.MCAP", "/b.mcap", "/c.bag.zstd", "/c.mcap.zstd", "/d.MP4"]
        );
        assert_eq!(names(format!("{root}/b")), ["/bags/", "/b.mcap"]);
        assert_eq!(names(format!("{root}/.h")), ["/.hidden.mcap"]);
        assert!(names(format!("{root}/nowhere/x")).is_empty());
        assert!(machine.complete("/").iter().all(|entry| entry.path.starts_with('/')));
    }

    #[test]
    fn a_rig_is_written_if_it_can_be_read_and_never_over_another_file() {
        let folder = tempfile::tempdir().unwrap();
        let (machine, path) = (Machine::in_folder(folder.path()), folder.path().join("yard.rig.yaml"));
        let sample = include_str!("../../sample_logs/garden.rig.yaml");
        let problem = machine.write_rig(&path, &sample.replace("gravity", "gravitation")).unwrap_err();
        assert!(problem.contains("gravit") && !path.exists(), "{problem}");
        let written = machine.write_rig(&path, sample).unwrap();
        assert_eq!(fs::read_to_string(&written).unwrap(), sample);
        let problem = machine.write_rig(&path, sample).unwrap_err();
        assert!(problem.starts_with("the rig exists; give another file name"), "{problem}");
    }

    #[test]
    fn a_motion_is_written_once_and_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let machine = Machine::in_folder(folder.path());
        let path = folder.path().join("plans/motion.csv");
        let mut motion = MotionSplines::at_rest(&[0.1], 8.0, 16);
        motion.set_point(0, 9, 0.4);
        machine.write_motion(&path, &motion, &["pan".to_owned()]).unwrap();
        let read = machine.read_motion(&path).unwrap();
        let again = MotionSplines::with_knots(&read.with_joints(&["pan".to_owned()]).unwrap(), 0.5);
        for index in 0..motion.point_count() {
            assert!((again.point(0, index) - motion.point(0, index)).abs() < 1e-9, "{index}");
        }
        let problem = machine.write_motion(&path, &motion, &["pan".to_owned()]).unwrap_err();
        assert!(problem.starts_with("the file exists; give another name"), "{problem}");
        let problem = machine.read_motion(&folder.path().join("other.csv")).unwrap_err();
        assert!(problem.contains("other.csv"), "{problem}");
    }

    #[test]
    fn memory_is_read_where_the_system_reports_it() {
        let bytes = Machine::new().resident_bytes();
        assert!(!cfg!(target_os = "linux") || bytes.is_some_and(|bytes| bytes > 1 << 20));
    }
}
