//! Results stored beside the logs, so that an interrupted bench resumes.

use std::fs;

use anyhow::{Context as _, Result};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::logs::{Archive, Log};

/// A result with what it depends on.
#[derive(Serialize, Deserialize)]
struct Kept<T> {
    /// Hash of the program that computed it.
    program: String,
    /// Size of the log that it was computed from, and how much of it was read.
    log_bytes: u64,
    duration_s: f64,
    result: T,
}

impl Archive {
    /// The result of this name that lies there, if this very program computed it from this log; otherwise a new one, which
    /// is written down.
    pub(crate) fn kept<T>(&self, name: &str, log: &Log, compute: impl FnOnce() -> Result<T>) -> Result<T>
    where
        T: Serialize + DeserializeOwned,
    {
        let path = self.folder.join(format!("{name}.json"));
        let log_bytes = fs::metadata(&log.path)?.len();
        let found = fs::read(&path).ok().and_then(|text| serde_json::from_slice::<Kept<T>>(&text).ok());
        if let Some(found) = found
            && (&found.program, found.log_bytes) == (&self.program, log_bytes)
            // JSON's numbers come back to within rounding.
            && (found.duration_s - log.duration_s).abs() < 1e-6
        {
            return Ok(found.result);
        }
        let result = compute()?;
        let kept = Kept { program: self.program.clone(), log_bytes, duration_s: log.duration_s, result };
        let text = serde_json::to_vec(&kept).with_context(|| format!("no JSON for {}", path.display()))?;
        fs::write(&path, text)?;
        Ok(kept.result)
    }
}

/// Hash of the program that runs.
pub(crate) fn program() -> Result<String> {
    let content = fs::read(std::env::current_exe()?)?;
    let bytes: Vec<String> = Sha256::digest(content).iter().map(|byte| format!("{byte:02x}")).collect();
    Ok(bytes.concat())
}
