use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use serde::Serialize;
use sha2::{Digest as _, Sha256};

use crate::export::error::ExportError;

/// Bytes that are hashed at a time.
const BLOCK_BYTES: usize = 1 << 20;

/// A file that went into a report, recognizable again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct InputFile {
    /// Its name without the folder.
    pub(super) name: String,
    /// Its size.
    pub(super) bytes: u64,
    /// SHA-256 of its content, in hexadecimal.
    pub(super) sha256: String,
}

impl InputFile {
    /// Reads a file block by block.
    ///
    /// # Errors
    /// When it cannot be read.
    pub(super) fn read(path: &Path) -> Result<Self, ExportError> {
        let failed = |source| ExportError::Read { source, path: path.to_owned() };
        let mut file = File::open(path).map_err(failed)?;
        let mut hash = Sha256::new();
        let mut block = vec![0; BLOCK_BYTES];
        let mut bytes = 0;
        loop {
            let count = file.read(&mut block).map_err(failed)?;
            if count == 0 {
                break;
            }
            hash.update(&block[..count]);
            bytes += count as u64;
        }
        let sha256: Vec<String> = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        Ok(Self { name, bytes, sha256: sha256.concat() })
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
