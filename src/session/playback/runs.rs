//! Adding and removing runs and forks during playback.

use std::sync::Arc;

use super::session::Session;
use crate::geometry::seconds_from_ns;
use crate::session::engine::{Computation, History, apply_fork};
use crate::session::plan::{
    ForkChanges, ForkError, MAX_RUNS, RunSpec, SessionError, cameras_of_run, distinct_label, name_usable_cameras,
};
use crate::session::record::RunRecord;

impl Session {
    pub(super) fn add_run(&mut self, spec: RunSpec) {
        if let Err(error) = self.try_add_run(spec) {
            self.notices.push(error.to_string());
        }
    }

    fn try_add_run(&mut self, spec: RunSpec) -> Result<(), SessionError> {
        self.check_run_count()?;
        let mut spec = self.distinct(spec);
        let warnings = name_usable_cameras(&self.plan.log, &self.plan.rig, &mut spec);
        let camera_key = cameras_of_run(&self.plan.rig, &spec)?.main.key.clone();
        self.plan.runs.push((spec.clone(), camera_key.clone()));
        let history = Arc::new(History::new(self.plan.memory_budget_bytes));
        let truth = self.recording().position_truth.clone();
        let run = RunRecord::new(spec, camera_key).with_position_truth(truth);
        self.shared.change(|computation| {
            computation.add_run(run, history);
            computation.recording_mut().add_warnings(warnings);
        });
        self.engine.start_runs(&self.plan, &self.computation(), &[self.plan.runs.len() - 1])
    }

    /// Forks a run at a stamp; the step there is the first step of the fork.
    pub(super) fn fork_at(
        &mut self,
        run: usize,
        stamp_ns: i64,
        changes: &ForkChanges,
        label: Option<String>,
    ) -> Result<(), String> {
        self.check_run_count().map_err(|error| error.to_string())?;
        let computation = self.computation();
        let none = |run: usize| ForkError::NoStep { run: run.to_string() }.to_string();
        let parent = computation.recording().runs.get(run).ok_or_else(|| none(run))?;
        let no_step = || ForkError::NoStep { run: parent.spec.label.clone() }.to_string();
        let step = parent.index_at(stamp_ns).ok_or_else(no_step)?;
        let history = computation.history(run).ok_or_else(no_step)?;
        let mut engine = history.engine_before(step).ok_or_else(no_step)?;
        apply_fork(changes, &mut engine, &self.plan.rig, &parent.camera_key).map_err(|error| error.to_string())?;
        let mut spec = changes.spec(&parent.spec, seconds_from_ns(parent.steps[step].report.stamp_ns));
        spec.label = label.unwrap_or(spec.label);
        let spec = self.distinct(spec);
        let fork = RunRecord::fork(parent, spec.clone(), step, changes.clone());
        let history = Arc::new(History::fork(history, step, self.plan.memory_budget_bytes));
        self.plan.runs.push((spec, fork.camera_key.clone()));
        // Released before the record changes; otherwise the record would be copied.
        drop(computation);
        self.shared.change(|computation| computation.add_run(fork, Arc::clone(&history)));
        let number = self.plan.runs.len() - 1;
        self.engine.start_fork(number, engine, history).map_err(|error| error.to_string())
    }

    fn check_run_count(&self) -> Result<(), SessionError> {
        let count = self.plan.runs.len() + 1;
        if count > MAX_RUNS { Err(SessionError::TooManyRuns { count }) } else { Ok(()) }
    }

    /// The specification with a label that no other run or trajectory has.
    fn distinct(&self, spec: RunSpec) -> RunSpec {
        let recording = self.recording();
        let is_taken = |label: &str| {
            self.plan.runs.iter().any(|(run, _)| run.label == label)
                || recording.trajectories.iter().any(|lane| lane.label == label)
        };
        RunSpec { label: distinct_label(&spec.label, is_taken), ..spec }
    }

    /// Removes the last run. An earlier run cannot be removed, because the indices of the others would change.
    pub(super) fn remove_run(&mut self, run: usize) {
        let last = self.plan.runs.len().saturating_sub(1);
        let finished = self.recording().runs.get(run).is_some_and(|run| run.finished);
        if run == last && run > 0 && finished {
            self.plan.runs.pop();
            self.shared.change(Computation::remove_last_run);
        } else {
            self.notices.push("Only the last run can be removed, after it has finished".to_owned());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::sensors::CameraRig;
    use crate::session::plan::{SessionPlan, SessionRequest};

    #[test]
    fn a_cluster_that_is_added_leaves_out_a_camera_that_it_cannot_use() {
        let log_path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../sample_logs/garden.mcap");
        let request = SessionRequest { log_path, duration_s: Some(0.3), ..SessionRequest::default() };
        let mut plan = SessionPlan::open(&request).unwrap();
        let rig = Arc::make_mut(&mut plan.rig);
        let again = CameraRig { key: "cam2".to_owned(), ..rig.cameras[1].clone() };
        rig.cameras.push(again);
        let mut session = Session::start(plan).unwrap();
        session.add_run("cluster".parse().unwrap());
        let recording = session.recording();
        assert_eq!(recording.runs[1].spec.cluster_keys, ["cam0", "cam1"]);
        assert!(recording.warnings.iter().any(|warning| warning.message.contains("cam2 is not used by 'cluster'")));
    }
}
