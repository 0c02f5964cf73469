use std::path::Path;

use crate::flight_log::LogError;
use crate::flight_log::output::StagedFile;
use crate::sensors::Rig;

impl Rig {
    /// Writes the rig as YAML, with `appended` (further top-level entries, or nothing) at its end.
    pub fn save(&self, path: &Path, appended: &str) -> Result<(), LogError> {
        let staged = self.stage(path, appended)?;
        staged.commit().map_err(|source| LogError::Io { action: "write the rig", source, path: path.to_owned() })
    }

    /// [`Self::save`] without the final rename, so that the file can appear together with others.
    pub(crate) fn stage(&self, path: &Path, appended: &str) -> Result<StagedFile, LogError> {
        let text = format!("{}{appended}", self.to_yaml());
        StagedFile::with_content(path, text.as_bytes()).map_err(|source| LogError::Io {
            action: "write the rig",
            source,
            path: path.to_owned(),
        })
    }
}
