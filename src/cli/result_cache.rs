//! `--no-cache`: cached screenshots, reports and checks, reused for the same command on the same files.

use std::path::{Path, PathBuf};

use clap::Args;
use dcvins::export::{CachedFile, ResultCache, ResultKey, ResultKeyBuilder};
use dcvins::session::{SessionPlan, TrajectorySource};

use crate::cli::estimation_arguments::EstimationArguments;
use crate::cli::terminal::notify;

/// Environment variable with another folder for the cache; an empty value disables the cache.
pub(crate) const FOLDER_VARIABLE: &str = "DCVINS_CACHE_DIR";
/// Size limit in bytes of a cached result.
const MAX_RESULT_BYTES: usize = 64 << 20;

/// Use of the cache.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct CacheArguments {
    /// Compute the result again even if it is in the cache, and do not cache it.
    #[arg(long)]
    pub no_cache: bool,
}

/// Cache entry of a command's result.
pub(crate) struct CachedResult {
    cache: ResultCache,
    key: ResultKey,
    /// Files written so far; `None` once they exceed the size limit.
    written: Option<Vec<CachedFile>>,
    bytes: usize,
}

impl CacheArguments {
    /// Cache entry of a result that depends on the files of a plan and on `options`. `None` if nothing is cached: with
    /// `--no-cache`, with an empty folder name, without a home folder, or if an input is not a regular file.
    pub(crate) fn result_of(
        &self,
        options: &str,
        log: &Path,
        estimation: &EstimationArguments,
        plan: &SessionPlan,
    ) -> Option<CachedResult> {
        let cache = self.cache()?;
        let key = key(options, log, estimation, plan)?;
        Some(CachedResult { cache, key, written: Some(Vec::new()), bytes: 0 })
    }

    /// The cache; `None` with `--no-cache`, with an empty folder name, or without a home folder.
    pub(crate) fn cache(&self) -> Option<ResultCache> {
        match std::env::var_os(FOLDER_VARIABLE) {
            _ if self.no_cache => None,
            Some(folder) if folder.is_empty() => None,
            Some(folder) => Some(ResultCache::in_folder(PathBuf::from(folder))),
            None => ResultCache::of_user(),
        }
    }
}

/// `None` if a file cannot be read; the command itself then reports the reason.
fn key(options: &str, log: &Path, estimation: &EstimationArguments, plan: &SessionPlan) -> Option<ResultKey> {
    let mut key = ResultKeyBuilder::new().ok()?;
    key.add_text(options);
    // The parsed rigs, whatever their source.
    key.add_text(&format!("{:?} {:?} {}", plan.rig, plan.ground_truth_rig, plan.truth_is_batch));
    // The calibration of earlier flights, read from its folder.
    key.add_text(&format!("{:?}", plan.prior));
    let mut files = estimation.input_files(log);
    if let Some(TrajectorySource::File(path)) = &estimation.truth_trajectory {
        files.push(path.clone());
    }
    let rig = estimation.rig.clone().unwrap_or_else(|| log.to_owned());
    let masks = plan.rig.cameras.iter().filter_map(|camera| camera.mask.as_ref());
    // A mask that is not a file next to the rig is attached to the log.
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
    /// Cached files of an earlier call with equal command and inputs; `None` without one. A damaged entry is reported on the
    /// terminal.
    pub(crate) fn load(&self) -> Option<Vec<CachedFile>> {
        self.cache.load(&self.key).unwrap_or_else(|problem| {
            notify(&format!("dcvins: {problem}"));
            None
        })
    }

    /// Adds a file to the result.
    pub(crate) fn add(&mut self, name: String, content: Vec<u8>) {
        self.bytes += content.len();
        if self.bytes > MAX_RESULT_BYTES {
            self.written = None;
        }
        if let Some(written) = &mut self.written {
            written.push((name, content));
        }
    }

    /// Stores the complete result. A failure is reported on the terminal, but the command still succeeds.
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
