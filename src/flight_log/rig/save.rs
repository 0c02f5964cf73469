use std::path::Path;

use crate::flight_log::LogError;
use crate::sensors::Rig;

impl Rig {
    /// Writes the rig as YAML, with `appended` (further top-level entries, or nothing) at its end.
    pub fn save(&self, path: &Path, appended: &str) -> Result<(), LogError> {
        std::fs::write(path, format!("{}{appended}", self.to_yaml())).map_err(|source| LogError::Io {
            action: "write the rig",
            source,
            path: path.to_owned(),
        })
    }
}
