//! Files of a source that are read as a whole, and names next to them.

use std::fs;
use std::path::{Path, PathBuf};

use super::error::ConvertError;
use crate::files::limits::DESCRIPTION_BYTES;

/// Reads a small text file; a larger one is no description of a source.
pub(super) fn read_description(path: &Path, action: &'static str) -> Result<String, ConvertError> {
    let metadata = fs::metadata(path).map_err(ConvertError::io(action, path))?;
    if !metadata.is_file() || metadata.len() > DESCRIPTION_BYTES {
        let problem = format!("{} bytes in place of a text file of at most {DESCRIPTION_BYTES}", metadata.len());
        return Err(ConvertError::unreadable(problem, path));
    }
    fs::read_to_string(path).map_err(ConvertError::io(action, path))
}

/// `a/log.mcap` and `.zstd` make `a/log.mcap.zstd`.
pub(super) fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    PathBuf::from(name)
}
