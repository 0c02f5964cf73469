//! Hash (SHA-256) of a file's content.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

use sha2::{Digest as _, Sha256};

/// Number of bytes that are hashed at a time.
const BLOCK_BYTES: usize = 1 << 20;

/// Adds the content of a file block by block; returns its number of bytes.
///
/// # Errors
/// When it cannot be read.
pub(crate) fn add_file(hash: &mut Sha256, path: &Path) -> io::Result<u64> {
    let mut file = File::open(path)?;
    let mut block = vec![0; BLOCK_BYTES];
    let mut bytes = 0;
    loop {
        match file.read(&mut block)? {
            0 => return Ok(bytes),
            count => {
                hash.update(&block[..count]);
                bytes += count as u64;
            }
        }
    }
}
