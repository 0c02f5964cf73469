//! Cache of the results of earlier commands, such as screenshots, reports and checks, so that the same command on the same
//! files returns immediately.
//!
//! The name of an entry is the SHA-256 of everything on which its content depends: the program itself, the content of
//! the input files and the options. An entry contains the files written by the command; its own SHA-256 is checked when
//! it is read.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use directories::ProjectDirs;
use sha2::{Digest as _, Sha256};
use tempfile::NamedTempFile;

use super::file_hash;
use crate::files::output;
use crate::study::hex;

/// Size limit of all entries together, in bytes; the least recently used entries are removed first.
const MAX_BYTES: u64 = 256 << 20;
/// File extension of an entry.
const ENDING: &str = "result";
const HASH_BYTES: usize = 32;

/// Folder of the entries.
#[derive(Clone, Debug)]
pub struct ResultCache {
    folder: PathBuf,
    max_bytes: u64,
}

/// A file of an entry: its path relative to the command's output, and its content.
pub type CachedFile = (String, Vec<u8>);

/// Builder of the key of a result from its inputs.
#[derive(Clone, Debug)]
pub struct ResultKeyBuilder {
    hash: Sha256,
    inputs: Vec<InputState>,
}

#[derive(Clone, Debug)]
pub struct ResultKey {
    name: String,
    inputs: Vec<InputState>,
}

/// State of an input file when its content was hashed: size and modification time.
type InputState = (PathBuf, Option<(u64, SystemTime)>);

fn state_of(path: &Path) -> Option<(u64, SystemTime)> {
    let metadata = fs::metadata(path).ok()?;
    Some((metadata.len(), metadata.modified().ok()?))
}

impl ResultKeyBuilder {
    /// A key that includes the program itself, so that each build has separate entries.
    ///
    /// # Errors
    /// If the program cannot be read.
    pub fn new() -> io::Result<Self> {
        let mut builder = Self { hash: Sha256::new(), inputs: Vec::new() };
        builder.add_file(&std::env::current_exe()?)?;
        Ok(builder)
    }

    /// Adds an option to the key.
    pub fn add_text(&mut self, text: &str) {
        self.add_bytes(text.as_bytes());
    }

    pub(super) fn add_bytes(&mut self, bytes: &[u8]) {
        self.hash.update((bytes.len() as u64).to_le_bytes());
        self.hash.update(bytes);
    }

    /// Adds a file whose content is in the key already, or is added later: its result is not stored if it changes from now
    /// on.
    pub(super) fn watch(&mut self, path: &Path) {
        self.inputs.push((path.to_owned(), state_of(path)));
    }

    /// Adds the content of a file.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn add_file(&mut self, path: &Path) -> io::Result<()> {
        self.watch(path);
        let bytes = file_hash::add_file(&mut self.hash, path)?;
        // The length separates the contents of consecutive files.
        self.hash.update(bytes.to_le_bytes());
        Ok(())
    }

    pub fn finish(self) -> ResultKey {
        ResultKey { name: hex(&self.hash.finalize()), inputs: self.inputs }
    }
}

impl ResultCache {
    /// The user's cache: `$XDG_CACHE_HOME/dcvins` or `~/.cache/dcvins` on Linux; `None` for a user without a home
    /// folder.
    pub fn of_user() -> Option<Self> {
        let folders = ProjectDirs::from("", "", "dcvins")?;
        Some(Self::in_folder(folders.cache_dir().join("results")))
    }

    /// A cache in a folder, which does not have to exist yet.
    pub fn in_folder(folder: PathBuf) -> Self {
        Self { folder, max_bytes: MAX_BYTES }
    }

    fn path_of(&self, key: &ResultKey) -> PathBuf {
        self.folder.join(format!("{}.{ENDING}", key.name))
    }

    /// Files of an entry; `None` if there is no entry.
    ///
    /// # Errors
    /// A message if the entry is damaged; it is removed.
    pub fn load(&self, key: &ResultKey) -> Result<Option<Vec<CachedFile>>, String> {
        let path = self.path_of(key);
        let Ok(bytes) = fs::read(&path) else { return Ok(None) };
        let Some(files) = files_of(&bytes) else {
            drop(fs::remove_file(&path));
            return Err(format!("a damaged entry of the cache was removed: {}", path.display()));
        };
        // Marks the entry as the most recently used; a failure only makes its removal earlier.
        drop(self.touch(&path));
        Ok(Some(files))
    }

    /// Sets the modification time of a file to the present time of its file system.
    fn touch(&self, path: &Path) -> io::Result<()> {
        let now = NamedTempFile::new_in(&self.folder)?.as_file().metadata()?.modified()?;
        File::options().append(true).open(path)?.set_modified(now)
    }

    /// Stores the files of a result, unless one of its inputs has changed since it was hashed.
    ///
    /// # Errors
    /// If the entry cannot be written.
    pub fn store(&self, key: &ResultKey, files: &[CachedFile]) -> io::Result<()> {
        if key.inputs.iter().any(|(path, state)| state.is_none() || state_of(path) != *state) {
            return Ok(());
        }
        let bytes = bytes_of(files);
        if bytes.len() as u64 > self.max_bytes {
            return Ok(());
        }
        fs::create_dir_all(&self.folder)?;
        self.make_room(bytes.len() as u64)?;
        output::write_file(&self.path_of(key), &bytes)
    }

    /// Removes the least recently used entries until `bytes` fit.
    fn make_room(&self, bytes: u64) -> io::Result<()> {
        let mut entries = Vec::new();
        for entry in fs::read_dir(&self.folder)? {
            let path = entry?.path();
            if path.extension().is_some_and(|ending| ending == ENDING)
                && let Some((bytes, used)) = state_of(&path)
            {
                entries.push((used, path, bytes));
            }
        }
        entries.sort();
        let mut total: u64 = entries.iter().map(|(.., bytes)| bytes).sum();
        for (_, path, of_entry) in entries {
            if total + bytes <= self.max_bytes {
                break;
            }
            // Another process may have removed it.
            drop(fs::remove_file(&path));
            total -= of_entry;
        }
        Ok(())
    }
}

/// SHA-256 of the remaining bytes, then for each file the lengths of name and content, name and content.
fn bytes_of(files: &[CachedFile]) -> Vec<u8> {
    let mut body = Vec::new();
    for (name, content) in files {
        for part in [name.as_bytes(), content] {
            body.extend_from_slice(&(part.len() as u64).to_le_bytes());
            body.extend_from_slice(part);
        }
    }
    let mut bytes = Sha256::digest(&body).to_vec();
    bytes.extend_from_slice(&body);
    bytes
}

/// Files of an entry, `None` if it is damaged.
fn files_of(bytes: &[u8]) -> Option<Vec<CachedFile>> {
    let (hash, mut rest) = bytes.split_at_checked(HASH_BYTES)?;
    if Sha256::digest(rest).as_slice() != hash {
        return None;
    }
    let mut part = || -> Option<&[u8]> {
        let (len, behind) = rest.split_first_chunk::<8>()?;
        let (part, behind) = behind.split_at_checked(usize::try_from(u64::from_le_bytes(*len)).ok()?)?;
        rest = behind;
        Some(part)
    };
    let mut files = Vec::new();
    while let Some(name) = part() {
        files.push((String::from_utf8(name.to_vec()).ok()?, part()?.to_vec()));
    }
    Some(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(input: &Path, option: &str) -> ResultKey {
        let mut builder = ResultKeyBuilder::new().unwrap();
        builder.add_file(input).unwrap();
        builder.add_text(option);
        builder.finish()
    }

    #[test]
    fn an_entry_belongs_to_its_input_and_options_alone() {
        let folder = tempfile::tempdir().unwrap();
        let cache = ResultCache::in_folder(folder.path().join("cache"));
        let input = folder.path().join("log");
        fs::write(&input, "one").unwrap();
        let files = vec![("a.png".to_owned(), vec![1, 2, 3]), ("b/c.csv".to_owned(), Vec::new())];
        let first = key(&input, "--at 1");
        assert_eq!(cache.load(&first), Ok(None));
        cache.store(&first, &files).unwrap();
        assert_eq!(cache.load(&key(&input, "--at 1")), Ok(Some(files.clone())));
        assert_eq!(cache.load(&key(&input, "--at 2")), Ok(None));
        fs::write(&input, "two").unwrap();
        assert_eq!(cache.load(&key(&input, "--at 1")), Ok(None));
        // A file that changed while the result was computed.
        let before = key(&input, "--at 1");
        fs::write(&input, "three").unwrap();
        cache.store(&before, &files).unwrap();
        assert_eq!(cache.load(&before), Ok(None));
    }

    #[test]
    fn a_damaged_entry_is_told_and_made_anew() {
        let folder = tempfile::tempdir().unwrap();
        let cache = ResultCache::in_folder(folder.path().join("cache"));
        let input = folder.path().join("log");
        fs::write(&input, "one").unwrap();
        let key = key(&input, "");
        let files = vec![("a.png".to_owned(), vec![1, 2, 3])];
        cache.store(&key, &files).unwrap();
        let whole = fs::read(cache.path_of(&key)).unwrap();
        let mut turned = whole.clone();
        *turned.last_mut().unwrap() ^= 1;
        for damaged in [&turned[..], &whole[..whole.len() - 1], &whole[..5], &[]] {
            fs::write(cache.path_of(&key), damaged).unwrap();
            assert!(cache.load(&key).unwrap_err().contains("damaged entry"));
            assert_eq!(cache.load(&key), Ok(None));
        }
        cache.store(&key, &files).unwrap();
        assert_eq!(cache.load(&key), Ok(Some(files)));
    }

    #[test]
    fn the_entries_unused_for_longest_go_first() {
        let folder = tempfile::tempdir().unwrap();
        let cache = ResultCache { folder: folder.path().join("cache"), max_bytes: 3000 };
        let input = folder.path().join("log");
        fs::write(&input, "one").unwrap();
        let files = vec![("a.png".to_owned(), vec![7; 1000])];
        let keys = ["1", "2", "3"].map(|option| key(&input, option));
        let at = |seconds: u64| SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(seconds);
        for (key, seconds) in keys.iter().zip([10, 20]) {
            cache.store(key, &files).unwrap();
            File::options().append(true).open(cache.path_of(key)).unwrap().set_modified(at(seconds)).unwrap();
        }
        assert!(cache.load(&keys[0]).unwrap().is_some());
        cache.store(&keys[2], &files).unwrap();
        let kept = keys.each_ref().map(|key| cache.load(key).unwrap().is_some());
        assert_eq!(kept, [true, false, true]);
        let too_large = vec![("a.png".to_owned(), vec![7; 4000])];
        cache.store(&keys[1], &too_large).unwrap();
        assert_eq!(keys.each_ref().map(|key| cache.load(key).unwrap().is_some()), kept);
    }
}
