use std::path::Path;

use serde::Serialize;
use sha2::{Digest as _, Sha256};

use crate::export::ExportError;
use crate::export::file_hash;
use crate::study::hex;

/// An input file of a report, identified by its hash.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct InputFile {
    /// File name without the folder.
    pub(super) name: String,
    pub(super) bytes: u64,
    /// SHA-256 of its content, in hexadecimal.
    pub(super) sha256: String,
}

impl InputFile {
    /// Reads a file block by block.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub(super) fn read(path: &Path) -> Result<Self, ExportError> {
        let failed = |source| ExportError::Read { source, path: path.to_owned() };
        let mut hash = Sha256::new();
        let bytes = file_hash::add_file(&mut hash, path).map_err(failed)?;
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        Ok(Self { name, bytes, sha256: hex(&hash.finalize()) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_those_of_the_standard() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("input.txt");
        let check = |content: &[u8], expected: &str| {
            std::fs::write(&path, content).unwrap();
            let input = InputFile::read(&path).unwrap();
            assert_eq!((input.bytes, input.sha256.as_str()), (content.len() as u64, expected));
            assert_eq!(input.name, "input.txt");
        };
        // FIPS 180-4, the examples of its annex.
        check(b"abc", "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
        check("a".repeat(1_000_000).as_bytes(), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
        let missing = InputFile::read(&folder.path().join("none")).unwrap_err().to_string();
        assert!(missing.contains("none"), "{missing}");
    }
}
