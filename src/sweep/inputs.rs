//! Inputs of a study: the plan, its logs and the hashes of their content.

use crate::files::RigFile as _;
use crate::flight_log::RigOfLog as _;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::error::StudyFileError;
use crate::export::file_hash;
use crate::files::output;
use crate::flight_log::FlightLog;
use crate::geometry::seconds_from_ns;
use crate::sensors::Rig;
use crate::session::{TrajectorySource, TrajectorySpec};
use crate::study::{LOG_PLACE, LogSource, RecordedLog, StudyPlan, StudyTrajectory, hex};

/// Size limit of a plan in bytes.
const LARGEST_PLAN_BYTES: u64 = 16 << 20;

/// Reads a plan; a plan without a name gets the name of its file.
///
/// # Errors
/// If the file cannot be read, or the plan is invalid.
pub fn read_plan(path: &Path) -> Result<StudyPlan, StudyFileError> {
    let mut text = String::new();
    let file = File::open(path).map_err(StudyFileError::read(path))?;
    file.take(LARGEST_PLAN_BYTES).read_to_string(&mut text).map_err(StudyFileError::read(path))?;
    let mut plan = StudyPlan::from_toml(&text)
        .map_err(|source| StudyFileError::Plan { source: Box::new(source), path: path.to_owned() })?;
    if plan.name.is_empty() {
        plan.name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    }
    Ok(plan)
}

pub(super) fn file_sha256(path: &Path) -> Result<String, StudyFileError> {
    let mut hash = Sha256::new();
    file_hash::add_file(&mut hash, path).map_err(StudyFileError::read(path))?;
    Ok(hex(&hash.finalize()))
}

/// Version of the program and SHA-256 of its file; results depend on both.
///
/// # Errors
/// If the program cannot read its own file.
pub fn program_identity() -> Result<String, StudyFileError> {
    let path = std::env::current_exe().map_err(StudyFileError::read(Path::new("the program")))?;
    Ok(format!("{} {}", env!("CARGO_PKG_VERSION"), file_sha256(&path)?))
}

/// Hashes of files by path, valid while size and modification time are unchanged.
#[derive(Debug, Default, Serialize, Deserialize)]
struct HashCache(BTreeMap<String, CachedHash>);

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct CachedHash {
    bytes: u64,
    changed_ns: u128,
    sha256: String,
}

impl HashCache {
    fn read(path: &Path) -> Self {
        // Without a readable cache, files are hashed again.
        fs::read(path).ok().and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default()
    }

    fn sha256(&mut self, path: &Path) -> Result<String, StudyFileError> {
        let metadata = fs::metadata(path).map_err(StudyFileError::read(path))?;
        let changed = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        let (bytes, changed_ns) = (metadata.len(), changed.map_or(0, |time| time.as_nanos()));
        let name = path.display().to_string();
        if let Some(known) = self.0.get(&name).filter(|known| (known.bytes, known.changed_ns) == (bytes, changed_ns)) {
            return Ok(known.sha256.clone());
        }
        let sha256 = file_sha256(path)?;
        self.0.insert(name, CachedHash { bytes, changed_ns, sha256: sha256.clone() });
        Ok(sha256)
    }
}

/// Logs of a plan, in the order of its entries and of their paths, with the hashes of their content.
///
/// Hashes are kept in `cache`, so that a resumed study does not read logs only to hash them.
///
/// # Errors
/// For a pattern that matches nothing, and for files that cannot be read.
pub fn find_logs(plan: &StudyPlan, plan_path: &Path, cache: &Path) -> Result<Vec<RecordedLog>, StudyFileError> {
    let folder = output::folder_of(plan_path);
    let mut hashes = HashCache::read(cache);
    let mut logs = Vec::new();
    for source in &plan.logs {
        let paths = matching(source, &folder, plan_path)?;
        if source.name.is_some() && paths.len() > 1 {
            let problem = format!("has a name and matches {} files, expected one", paths.len());
            return Err(StudyFileError::Logs { pattern: source.pattern.clone(), problem, path: plan_path.to_owned() });
        }
        for path in paths {
            logs.push(recorded(source, &folder, &path, &mut hashes)?);
        }
    }
    distinct_names(&mut logs);
    let text = serde_json::to_vec(&hashes).unwrap_or_default();
    output::write_file(cache, &text).map_err(StudyFileError::write(cache))?;
    Ok(logs)
}

/// Files that match a pattern, in the order of their paths.
fn matching(source: &LogSource, folder: &Path, plan: &Path) -> Result<Vec<PathBuf>, StudyFileError> {
    let failed =
        |problem: String| StudyFileError::Logs { pattern: source.pattern.clone(), problem, path: plan.to_owned() };
    let plain = folder.join(&source.pattern);
    if plain.is_file() {
        return Ok(vec![plain]);
    }
    let pattern = format!("{}/{}", glob::Pattern::escape(&folder.display().to_string()), source.pattern);
    let pattern = if Path::new(&source.pattern).is_absolute() { source.pattern.clone() } else { pattern };
    let found = glob::glob(&pattern).map_err(|error| failed(format!("is not a valid pattern: {error}")))?;
    let mut paths: Vec<PathBuf> = found.filter_map(Result::ok).filter(|path| path.is_file()).collect();
    paths.sort();
    if paths.is_empty() {
        return Err(failed(format!("match no file in '{}'", folder.display())));
    }
    Ok(paths)
}

fn recorded(
    source: &LogSource,
    folder: &Path,
    path: &Path,
    hashes: &mut HashCache,
) -> Result<RecordedLog, StudyFileError> {
    let path = fs::canonicalize(path).map_err(StudyFileError::read(path))?;
    let given = |relative: &Option<String>| -> Result<Option<PathBuf>, StudyFileError> {
        let named = relative.as_ref().map(|name| folder.join(name));
        named.map(|named| fs::canonicalize(&named).map_err(StudyFileError::read(&named))).transpose()
    };
    let (rig, truth) = (given(&source.rig)?, given(&source.truth)?);
    let log = FlightLog::open(&path);
    let rig_sha256 = match &log {
        Ok(log) => Rig::for_log(log, rig.as_deref()).map(|rig| rig_sha256(&rig)).unwrap_or_default(),
        Err(_) => String::new(),
    };
    let truth_file = truth.clone().unwrap_or_else(|| path.with_extension("truth.yaml"));
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    Ok(RecordedLog {
        name: source.name.clone().unwrap_or(stem),
        sha256: hashes.sha256(&path)?,
        rig,
        rig_sha256,
        truth,
        truth_sha256: if truth_file.is_file() { hashes.sha256(&truth_file)? } else { String::new() },
        start_s: source.start_s,
        duration_s: source.duration_s,
        // A log that cannot be opened fails in its job, with the reason.
        length_s: log.map_or(0.0, |log| seconds_from_ns(log.duration_ns())),
        trajectories: trajectories(source, folder, &path, hashes)?,
        path,
    })
}

/// Trajectories of a log with the hashes of their files.
fn trajectories(
    source: &LogSource,
    folder: &Path,
    log: &Path,
    hashes: &mut HashCache,
) -> Result<Vec<StudyTrajectory>, StudyFileError> {
    let stem = log.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let found = |spec: &TrajectorySpec| {
        let TrajectorySource::File(path) = &spec.source else {
            return Ok(StudyTrajectory { spec: spec.clone(), sha256: String::new() });
        };
        let named = folder.join(path.to_string_lossy().replace(LOG_PLACE, &stem));
        let path = fs::canonicalize(&named).map_err(StudyFileError::read(&named))?;
        let sha256 = hashes.sha256(&path)?;
        let spec = TrajectorySpec { source: TrajectorySource::File(path), label: spec.label.clone() };
        Ok(StudyTrajectory { spec, sha256 })
    };
    source.trajectories.iter().map(found).collect()
}

/// SHA-256 of a rig as used by the estimator, with the pixels of its masks.
pub(super) fn rig_sha256(rig: &Rig) -> String {
    let mut hash = Sha256::new();
    hash.update(rig.to_yaml());
    for mask in rig.cameras.iter().filter_map(|camera| camera.mask.as_ref()) {
        hash.update(mask.image.to_image().pixels);
    }
    hex(&hash.finalize())
}

/// Makes equal names of logs distinct, with the names of their folders and then with a number.
fn distinct_names(logs: &mut [RecordedLog]) {
    let names: Vec<String> = logs.iter().map(|log| log.name.clone()).collect();
    let twice = |name: &String, names: &[String]| names.iter().filter(|other| *other == name).count() > 1;
    for (log, name) in logs.iter_mut().zip(&names).filter(|(_, name)| twice(name, &names)) {
        if let Some(folder) = log.path.parent().and_then(Path::file_name) {
            log.name = format!("{}/{name}", folder.to_string_lossy());
        }
    }
    for place in 1..logs.len() {
        let (wanted, mut number) = (logs[place].name.clone(), 2);
        while logs[..place].iter().any(|earlier| earlier.name == logs[place].name) {
            logs[place].name = format!("{wanted} ({number})");
            number += 1;
        }
    }
}
