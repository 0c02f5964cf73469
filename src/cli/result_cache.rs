//! `--no-cache`: pictures and reports of earlier commands, for the same command on the same files.

use std::path::{Path, PathBuf};

use clap::Args;
use dcvins::export::{CachedFile, ResultCache, ResultKey, ResultKeyBuilder};
use dcvins::session::{SessionPlan, TrajectorySource};

use crate::cli::estimation_arguments::EstimationArguments;
use crate::cli::terminal::notify;

/// Environment variable that names another folder for the cache; empty, there is none.
const FOLDER_VARIABLE: &str = "DCVINS_CACHE_DIR";
/// Results of more bytes are not kept.
const MAX_RESULT_BYTES: usize = 64 << 20;

/// Whether results are kept and found again.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct CacheArguments {
    /// Compute anew what an earlier command has written from the same files with the same options, and keep nothing of it.
    #[arg(long)]
    pub no_cache: bool,
}

/// The place of a command's result in the cache.
pub(crate) struct CachedResult {
    cache: ResultCache,
    key: ResultKey,
    /// What was written so far; `None` when it is too much to be kept.
    written: Option<Vec<CachedFile>>,
    bytes: usize,
}

impl CacheArguments {
    /// The place of a result that depends on the files of a plan and on these options; `None` where nothing is kept: with
    /// `--no-cache`, with an empty name of the folder, without a home folder, or when an input is no regular file.
    pub(crate) fn result_of(
        &self,
        options: &str,
        log: &Path,
        estimation: &EstimationArguments,
        plan: &SessionPlan,
    ) -> Option<CachedResult> {
        if self.no_cache {
            return None;
        }
        let cache = match std::env::var_os(FOLDER_VARIABLE) {
            Some(folder) if folder.is_empty() => return None,
            Some(folder) => ResultCache::in_folder(PathBuf::from(folder)),
            None => ResultCache::of_user()?,
        };
        let key = key(options, log, estimation, plan)?;
        Some(CachedResult { cache, key, written: Some(Vec::new()), bytes: 0 })
    }
}

/// `None` when a file cannot be read; the command itself then says why.
fn key(options: &str, log: &Path, estimation: &EstimationArguments, plan: &SessionPlan) -> Option<ResultKey> {
    let mut key = ResultKeyBuilder::new().ok()?;
    key.add_text(options);
    // The rigs as they were read, wherever they come from.
    key.add_text(&format!("{:?} {:?} {}", plan.rig, plan.ground_truth_rig, plan.truth_is_batch));
    let mut files = estimation.input_files(log);
    if let Some(TrajectorySource::File(path)) = &estimation.truth_trajectory {
        files.push(path.clone());
    }
    let rig = estimation.rig.clone().unwrap_or_else(|| log.to_owned());
    let masks = plan.rig.cameras.iter().filter_map(|camera| camera.mask.as_ref());
    // A mask that is no file beside the rig is attached to the log.
    files.extend(masks.map(|mask| rig.with_file_name(&mask.file)).filter(|path| path.exists()));
    for path in files {
        if !path.is_file() {
            return None;
        }
        key.add_text(&path.to_string_lossy());
        key.add_file(&path).ok()?;
    }
    Some(key.finish())
}

impl CachedResult {
    /// The files of the same command on the same files, if it was kept. A damaged entry is told.
    pub(crate) fn load(&self) -> Option<Vec<CachedFile>> {
        self.cache.load(&self.key).unwrap_or_else(|problem| {
            notify(&format!("dcvins: {problem}"));
            None
        })
    }

    /// Notes a file of the result.
    pub(crate) fn add(&mut self, name: String, content: Vec<u8>) {
        self.bytes += content.len();
        if self.bytes > MAX_RESULT_BYTES {
            self.written = None;
        }
        if let Some(written) = &mut self.written {
            written.push((name, content));
        }
    }

    /// Keeps the complete result. A cache that cannot be written is told, and the command has succeeded all the same.
    pub(crate) fn store(self) {
        let Some(written) = self.written else { return };
        if let Err(error) = self.cache.store(&self.key, &written) {
            notify(&format!(
                "dcvins: cannot keep the result in the cache ({error}); give --no-cache, or name another folder in \
                 {FOLDER_VARIABLE}"
            ));
        }
    }
}
