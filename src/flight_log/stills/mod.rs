//! Files of still images: known points with their pixels, joint readings and an initial chain (docs/formats.md).

mod chain;
mod content;
mod document;

use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::Path;

use serde::de::DeserializeOwned;

pub use chain::read_stills_chain;

use super::LogError;
use crate::sensors::Stills;
use document::StillsDocument;

/// Value of `format`.
const FORMAT: &str = "acdcc-stills 1";
/// Largest file that is read: a million points.
const MAX_BYTES: u64 = 256 << 20;

/// Reads a file of stills and checks every value.
///
/// # Errors
/// The first problem of the file, with its place and what is expected there.
pub fn read_stills(path: &Path) -> Result<Stills, LogError> {
    let document: StillsDocument = parsed(path)?;
    content::stills_of(document).map_err(|problem| LogError::Stills { problem, path: path.to_owned() })
}

/// Reads a JSON file; the message of an error has line and column.
fn parsed<T: DeserializeOwned>(path: &Path) -> Result<T, LogError> {
    let io = |source| LogError::Io { action: "open the stills", source, path: path.to_owned() };
    let file = File::open(path).map_err(io)?;
    let bytes = file.metadata().map_err(io)?.len();
    if bytes > MAX_BYTES {
        let problem = format!("it has {} MiB, expected at most {} MiB; split its sets", bytes >> 20, MAX_BYTES >> 20);
        return Err(LogError::Stills { problem, path: path.to_owned() });
    }
    serde_json::from_reader(BufReader::new(file.take(MAX_BYTES))).map_err(|error| LogError::Stills {
        problem: format!("{error}; expected the JSON of docs/formats.md, section 'Stills'"),
        path: path.to_owned(),
    })
}
