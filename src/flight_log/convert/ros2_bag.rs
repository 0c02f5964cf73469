//! ROS 2 bags: a folder with `metadata.yaml` and one or more SQLite or MCAP files, plain or under zstd.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::NamedTempFile;

use super::sink::Sink;
use super::sqlite::BlobCompression;
use super::{ConvertError, mcap_segment, sqlite};

/// Whether a folder is a ROS 2 bag, also without its `metadata.yaml`.
pub(super) fn is_bag(folder: &Path) -> bool {
    folder.join("metadata.yaml").is_file() || segments(folder).is_ok_and(|segments| !segments.is_empty())
}

/// The path without `.zstd`, if it has that extension.
fn plain_name(path: &Path) -> Option<PathBuf> {
    path.extension().filter(|extension| *extension == "zstd" || *extension == "zst").map(|_| path.with_extension(""))
}

fn is_segment(path: &Path) -> bool {
    let plain = plain_name(path).unwrap_or_else(|| path.to_owned());
    plain.extension().is_some_and(|extension| extension == "db3" || extension == "mcap")
}

/// The files of a folder that may belong to a bag, in the order of the numbers in their names.
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

/// Content of `metadata.yaml`.
struct BagMetadata {
    segments: Vec<PathBuf>,
    blob_compression: BlobCompression,
}

fn read_metadata(folder: &Path) -> Result<BagMetadata, ConvertError> {
    let path = folder.join("metadata.yaml");
    if !path.is_file() {
        return Ok(BagMetadata { segments: segments(folder)?, blob_compression: BlobCompression::None });
    }
    let text = fs::read_to_string(&path).map_err(ConvertError::io("read the bag's metadata", &path))?;
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
        let problem = format!("compression_format holds '{format}', expected zstd; record or convert it without");
        return Err(ConvertError::unreadable(problem, &path));
    }
    let blob_compression = if mode == "message" { BlobCompression::Zstd } else { BlobCompression::None };
    Ok(BagMetadata { segments, blob_compression })
}

/// Path of a file of the bag: old recorders wrote the folder's name before it, and some omit `.zstd`.
fn find(folder: &Path, name: &str) -> PathBuf {
    let in_folder = folder.join(name);
    let beside = folder.join(Path::new(name).file_name().unwrap_or_default());
    let mut candidates = [&in_folder, &beside].into_iter().flat_map(|path| {
        [path.clone(), super::with_suffix(path, ".zstd"), plain_name(path).unwrap_or_else(|| path.clone())]
    });
    candidates.find(|path| path.is_file()).unwrap_or_else(|| beside.clone())
}

/// Converts a bag into a log.
pub(super) fn convert(folder: &Path, sink: &mut Sink<'_>) -> Result<(), ConvertError> {
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
        let unpacked = if plain_name(path).is_some() { Some(unpack(path)?) } else { None };
        let plain = unpacked.as_ref().map_or(path.as_path(), NamedTempFile::path);
        let name = plain_name(path).unwrap_or_else(|| path.clone());
        if name.extension().is_some_and(|extension| extension == "mcap") {
            mcap_segment::convert(plain, sink)?;
        } else {
            sqlite::convert(plain, metadata.blob_compression, sink)?;
        }
    }
    Ok(())
}

/// A compressed file, decompressed into a temporary one.
fn unpack(path: &Path) -> Result<NamedTempFile, ConvertError> {
    let packed = BufReader::new(File::open(path).map_err(ConvertError::io("open the bag", path))?);
    let mut plain = NamedTempFile::new().map_err(ConvertError::io("make a temporary file for", path))?;
    zstd::stream::copy_decode(packed, &mut plain).map_err(ConvertError::io("decompress", path))?;
    Ok(plain)
}
