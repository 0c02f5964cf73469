//! The check of a log beside other work.

use anyhow::Result;
use dcvins::export::check_log;
use dcvins::log_check::CheckReport;
use dcvins::session::SessionPlan;

use crate::cli::result_cache::CacheArguments;
use crate::cli::terminal::Progress;

/// Runs `work` while another thread checks the log and its rig.
pub(crate) fn beside_check<T>(
    plan: &SessionPlan,
    cache: &CacheArguments,
    work: impl FnOnce() -> Result<T>,
) -> (Result<T>, CheckReport) {
    let cache = cache.cache();
    std::thread::scope(|scope| {
        let checking = scope.spawn(|| check_log(cache.as_ref(), &plan.log, &plan.rig));
        let done = work();
        let _progress = Progress::spinner("checking the log");
        (done, checking.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    })
}
