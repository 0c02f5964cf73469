//! ROS 2 bags: a folder with `metadata.yaml` and one or more SQLite or MCAP files, plain or compressed with zstd.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write as _;
use std::path::{Component, Path, PathBuf};

use serde_json::Value;
use tempfile::NamedTempFile;

use super::sink::LogSink;
use super::source_file::{read_description, with_suffix};
use super::sqlite::BagDatabase;
use super::{ConvertError, mcap_segment, sqlite};
use crate::files::LogLimits;
use crate::flight_log::container::file::{LogFile, unpacked_name};

/// Number of bytes that are copied at a time.
const COPIED_BYTES: usize = 1 << 20;

/// True if a folder is a ROS 2 bag, also without its `metadata.yaml`.
pub(super) fn is_bag(folder: &Path) -> bool {
    folder.join("metadata.yaml").is_file() || segments(folder).is_ok_and(|segments| !segments.is_empty())
}

fn is_segment(path: &Path) -> bool {
    unpacked_name(path).extension().is_some_and(|extension| extension == "db3" || extension == "mcap")
}

/// Files of a folder that may belong to a bag, in the order of the numbers in their names.
fn segments(folder: &Path) -> Result<Vec<PathBuf>, ConvertError> {
    let entries = fs::read_dir(folder).map_err(ConvertError::io("open the bag", folder))?;
    let mut paths = Vec::new();
    for entry in entries {
        let path = entry.map_err(ConvertError::io("open the bag", folder))?.path();
        if path.is_file() && is_segment(&path) {
            paths.push(path);
        }
    }
    // `bag_10.db3` comes after `bag_9.db3`.
    paths.sort_by_key(|path| (path.as_os_str().len(), path.clone()));
    Ok(paths)
}

/// Content of the file `metadata.yaml`.
#[derive(Default)]
struct BagMetadata {
    segments: Vec<PathBuf>,
    /// Number of messages of the whole bag.
    messages: Option<u64>,
    /// Number of messages by file name, written by recorders since ROS 2 Galactic.
    messages_by_file: BTreeMap<String, u64>,
}

fn read_metadata(folder: &Path) -> Result<BagMetadata, ConvertError> {
    let path = folder.join("metadata.yaml");
    if !path.is_file() {
        return Ok(BagMetadata { segments: segments(folder)?, ..BagMetadata::default() });
    }
    let text = read_description(&path, "read the bag's metadata")?;
    let document: Value = serde_saphyr::from_str(&text).map_err(|error| {
        let problem = error.to_string();
        ConvertError::unreadable(format!("no valid YAML: {}", problem.lines().next().unwrap_or_default()), &path)
    })?;
    let information = document.get("rosbag2_bagfile_information").unwrap_or(&document);
    let text = |key: &str| information.get(key).and_then(Value::as_str).unwrap_or_default();
    let names = information.get("relative_file_paths").and_then(Value::as_array);
    let names = names.ok_or_else(|| {
        ConvertError::unreadable("relative_file_paths is missing, expected the names of the bag's files", &path)
    })?;
    let segments: Vec<PathBuf> = names.iter().filter_map(Value::as_str).map(|name| find(folder, name)).collect();
    let (mode, format) = (text("compression_mode").to_ascii_lowercase(), text("compression_format"));
    let compressed = !mode.is_empty() && mode != "none";
    if compressed && format != "zstd" {
        let problem = format!("compression_format holds {format:?}, expected zstd; record or convert it without");
        return Err(ConvertError::unreadable(problem, &path));
    }
    let files = information.get("files").and_then(Value::as_array).into_iter().flatten();
    let messages_by_file = files.filter_map(|file| {
        let name = Path::new(file.get("path")?.as_str()?).file_name()?.to_str()?;
        Some((name.to_owned(), file.get("message_count")?.as_u64()?))
    });
    Ok(BagMetadata {
        segments,
        messages: information.get("message_count").and_then(Value::as_u64),
        messages_by_file: messages_by_file.collect(),
    })
}

/// Path of a file of the bag: old recorders prepended the folder's name, and some omit `.zstd`. The path always lies in
/// the bag's folder.
fn find(folder: &Path, name: &str) -> PathBuf {
    let inside = Path::new(name).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    let beside = folder.join(Path::new(name).file_name().unwrap_or_default());
    let in_folder = if inside { folder.join(name) } else { beside.clone() };
    let mut candidates = [&in_folder, &beside]
        .into_iter()
        .flat_map(|path| [path.clone(), with_suffix(path, ".zstd"), unpacked_name(path)]);
    candidates.find(|path| path.is_file()).unwrap_or_else(|| beside.clone())
}

/// Open file of a bag.
enum Segment {
    Mcap(LogFile),
    Sqlite(BagDatabase, Option<NamedTempFile>),
}

fn open_segment(path: &Path, sink: &LogSink<'_>) -> Result<Segment, ConvertError> {
    if unpacked_name(path).extension().is_some_and(|extension| extension == "mcap") {
        return Ok(Segment::Mcap(mcap_segment::open(path, sink)?));
    }
    let unpacked = if unpacked_name(path) == path { None } else { Some(unpack_to_path(path, sink.limits())?) };
    let plain = unpacked.as_ref().map_or(path, NamedTempFile::path);
    let database = sqlite::open(plain, sink.limits())?;
    Ok(Segment::Sqlite(database, unpacked))
}

/// Converts a bag into a log. Missing and unreadable files are left out.
pub(super) fn convert(folder: &Path, sink: &mut LogSink<'_>) -> Result<(), ConvertError> {
    let metadata = read_metadata(folder)?;
    if !folder.join("metadata.yaml").is_file() {
        sink.note("the bag has no metadata.yaml; its files were read in the order of their names");
    }
    if let (Ok(present), false) = (segments(folder), metadata.segments.is_empty()) {
        for path in present.iter().filter(|path| !metadata.segments.contains(path)) {
            sink.note(format!("{} is not in metadata.yaml and is left out", path.display()));
        }
    }
    for path in &metadata.segments {
        match open_segment(path, sink) {
            Ok(Segment::Mcap(file)) => mcap_segment::convert(&file, path, sink)?,
            // The temporary file, if any, must exist as long as the database is open.
            Ok(Segment::Sqlite(database, _unpacked)) => sqlite::convert(&database, sink)?,
            Err(problem) => {
                let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
                let lost = match metadata.messages_by_file.get(&name) {
                    Some(count) => format!("its {count} messages are lost"),
                    None => "its messages are lost".to_owned(),
                };
                sink.note(format!("a file of the bag is left out, and {lost}: {problem}"));
            }
        }
    }
    if let Some(promised) = metadata.messages
        && promised != sink.seen()
    {
        sink.note(format!("metadata.yaml counts {promised} messages, {} were found", sink.seen()));
    }
    Ok(())
}

/// Decompresses a database into a temporary file, since SQLite opens a path.
pub(super) fn unpack_to_path(path: &Path, limits: &LogLimits) -> Result<NamedTempFile, ConvertError> {
    let file = LogFile::open(path, limits)?;
    let mut plain = NamedTempFile::new().map_err(ConvertError::io("make a temporary file for", path))?;
    let mut at = 0;
    while at < file.len() {
        let end = file.len().min(at + COPIED_BYTES);
        let bytes = file.read(at..end).map_err(|problem| ConvertError::unreadable(problem, path))?;
        plain.write_all(&bytes).map_err(ConvertError::io("decompress", path))?;
        at = end;
    }
    Ok(plain)
}
