//! JSON files of limited size.

use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::Path;

use serde::de::DeserializeOwned;

use crate::flight_log::LogError;

/// Largest file that is read: a million points.
const MAX_BYTES: u64 = 256 << 20;

/// Reads a JSON file; the message of an error has line and column.
pub(super) fn parsed<T: DeserializeOwned>(path: &Path) -> Result<T, LogError> {
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
