//! Studies that the window can open.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::playing_log::PlayingLog;
use crate::gui::study::StudyState;
use crate::study::view::Study;

/// A study on disk: its tables, and its runs as sessions.
pub trait StudySource: Send + Sync {
    fn study(&self) -> Arc<Study>;
    /// Opens a session on the log of the first row with the runs of all rows. Its cursor goes to the worst frame of the
    /// first row as soon as that is computed. An error message states cause and remedy.
    fn open_runs(&self, rows: &[usize]) -> Result<Box<dyn PlayingLog>, String>;
}

/// Opens a study; `None` for a path that is no study.
pub type OpenStudy = Arc<dyn Fn(&Path) -> Option<Result<Arc<dyn StudySource>, String>> + Send + Sync>;

pub(super) struct ShownStudy {
    pub(super) source: Arc<dyn StudySource>,
    pub(super) state: StudyState,
    pub(super) path: PathBuf,
}

impl ShownStudy {
    /// Name of the study's folder.
    pub(super) fn name(&self) -> String {
        let name = self.path.file_name().unwrap_or(self.path.as_os_str());
        name.to_string_lossy().into_owned()
    }
}
