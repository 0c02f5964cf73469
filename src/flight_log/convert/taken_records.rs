//! Records that a caller wants to take in place of those that a conversion chooses.

use std::collections::BTreeSet;
use std::path::Path;

use super::ConvertError;

/// Names of wanted records, and the records that a source has.
#[derive(Debug, Default)]
pub(super) struct TakenRecords {
    wanted: Vec<String>,
    available: BTreeSet<String>,
}

impl TakenRecords {
    pub(super) fn new(wanted: Vec<String>) -> Self {
        Self { wanted, available: BTreeSet::new() }
    }

    /// True if a record is wanted.
    pub(super) fn wants(&self, record: &str) -> bool {
        self.wanted.iter().any(|wanted| wanted == record)
    }

    /// Adds a record of the source that can be taken.
    pub(super) fn offer(&mut self, record: &str) {
        self.available.insert(record.to_owned());
    }

    /// Returns an error if the source lacks a wanted record.
    pub(super) fn require_all(&self, source: &Path) -> Result<(), ConvertError> {
        let Some(missing) = self.wanted.iter().find(|wanted| !self.available.contains(*wanted)) else { return Ok(()) };
        Err(ConvertError::NoSuchRecord {
            record: missing.clone(),
            available: self.available.iter().cloned().collect::<Vec<_>>().join(", "),
            path: source.to_owned(),
        })
    }
}
