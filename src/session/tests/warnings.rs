//! The warnings of a run, over all its steps.

use crate::estimator::StepWarning;
use crate::session::plan::ForkChanges;
use crate::session::record::{RunRecord, warnings_of};
use crate::session::tests::memory::estimated;
use crate::simulation::{SyntheticOptions, synthetic_tracks};

/// A camera time offset of 15 ms is reported from some step on, and only by records that contain that step.
#[test]
fn a_warning_is_kept_once_with_its_first_time_and_its_count() {
    let clock_offsets_s = [0.015, 0.0];
    let flight =
        synthetic_tracks(&SyntheticOptions { clock_offsets_s, duration_s: 10.0, ..SyntheticOptions::default() });
    let mut run = estimated(&flight, "auto");
    let warns = |step: &&std::sync::Arc<crate::session::StepRecord>, warning: &StepWarning| {
        step.report.warnings.contains(warning)
    };
    assert!(!run.warnings.is_empty());
    for warning in &run.warnings {
        let steps: Vec<_> = run.steps.iter().filter(|step| warns(step, &warning.warning)).collect();
        assert_eq!((warning.first_ns, warning.steps), (steps[0].report.stamp_ns, steps.len()), "{}", warning.warning);
        assert_eq!(Some(warning.last_ns), steps.last().map(|step| step.report.stamp_ns), "{}", warning.warning);
    }
    let first_ns = run.warnings.iter().map(|warning| warning.first_ns).min().unwrap();
    let first = run.steps.iter().position(|step| step.report.stamp_ns == first_ns).unwrap();
    let fork = |step| RunRecord::fork(&run, run.spec.clone(), step, ForkChanges::default());
    assert!(fork(first).warnings.is_empty() && !fork(first + 1).warnings.is_empty());
    run.end_at(first_ns);
    assert_eq!(run.warnings, warnings_of(&run.steps));
    assert!(run.warnings.iter().all(|warning| warning.first_ns == first_ns && warning.steps == 1));
    run.end_at(first_ns - 1);
    assert!(run.warnings.is_empty());
}
