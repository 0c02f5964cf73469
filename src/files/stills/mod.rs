//! Files of still images: known points with their pixels, joint readings and an initial chain (docs/formats.md).

mod chain;
mod content;
mod document;

use std::path::Path;

pub use self::chain::read_stills_chain;
use self::document::{StillsDocument, parsed};
use crate::files::FileError;
use crate::sensors::Stills;

/// Reads a file of stills and checks every value.
///
/// # Errors
/// The first problem of the file, with its place and what is expected there.
pub fn read_stills(path: &Path) -> Result<Stills, FileError> {
    let document: StillsDocument = parsed(path)?;
    content::stills_of(document).map_err(|problem| FileError::Stills { problem, path: path.to_owned() })
}
