use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::export::{ExportError, VideoAlignmentError};
use crate::flight_log::convert::ConvertError;
use crate::text::log_name;

/// Reason why files cannot be opened as a log; every message names the problem, its location and the remedy.
#[derive(Debug, Error)]
pub enum SourceError {
    #[error(transparent)]
    Convert(#[from] ConvertError),
    #[error(transparent)]
    Export(#[from] ExportError),
    #[error(transparent)]
    Alignment(Box<VideoAlignmentError>),
    #[error("{names}: a rig alone; open it together with its log", names = names.join(", "))]
    RigAlone { names: Vec<String> },
    #[error("several rigs ({}); open the log with one of them", names.join(", "))]
    SeveralRigs { names: Vec<String> },
    #[error(
        "{first} ({first_kind}) and {second} ({second_kind}) are not one log: opened together are a video and the log of its \
         autopilot, the parts of a split bag, and a log and its rig"
    )]
    SeveralLogs { first: String, first_kind: &'static str, second: String, second_kind: &'static str },
    #[error("nothing to open")]
    Nothing,
    #[error("there is no folder for converted logs ({reason}): convert it with 'dcvins convert {} -o LOG.mcap'", path.display())]
    NoCache { reason: &'static str, path: PathBuf },
    #[error("cannot {action}: {source}: {}", path.display())]
    Cache { action: &'static str, source: io::Error, path: PathBuf },
}

impl SourceError {
    pub(super) fn rig_alone(rigs: &[PathBuf], ground_truths: &[PathBuf]) -> Self {
        let names: Vec<String> = rigs.iter().chain(ground_truths).map(|path| log_name(path)).collect();
        if names.is_empty() { Self::Nothing } else { Self::RigAlone { names } }
    }

    /// For `map_err` of a system call on the cache.
    pub(super) fn cache(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Cache { action, source, path }
    }

    /// True if the caller stopped the conversion.
    pub fn is_interrupted(&self) -> bool {
        match self {
            Self::Convert(ConvertError::Interrupted { .. }) => true,
            Self::Alignment(error) => {
                matches!(**error, VideoAlignmentError::Convert(ConvertError::Interrupted { .. }))
            }
            _ => false,
        }
    }
}

impl From<VideoAlignmentError> for SourceError {
    fn from(error: VideoAlignmentError) -> Self {
        Self::Alignment(Box::new(error))
    }
}
