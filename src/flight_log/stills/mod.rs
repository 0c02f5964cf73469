//! Files of still images: known points with their pixels, joint readings and an initial chain (docs/formats.md).

mod chain;
mod content;
mod document;
mod json_file;

use std::path::Path;

pub use chain::read_stills_chain;

use super::LogError;
use crate::sensors::Stills;
use document::StillsDocument;
use json_file::parsed;

/// Reads a file of stills and checks every value.
///
/// # Errors
/// The first problem of the file, with its place and what is expected there.
pub fn read_stills(path: &Path) -> Result<Stills, LogError> {
    let document: StillsDocument = parsed(path)?;
    content::stills_of(document).map_err(|problem| LogError::Stills { problem, path: path.to_owned() })
}
