//! Trajectories of the scene; one row per step of a run or pose of a trajectory.

use super::ScenePanel;
use crate::files::csv_writer::{CsvWriter, number_cell, seconds_cell};
use crate::geometry::seconds_from_ns;
use crate::gui::{CsvTable, PanelContext};

impl CsvTable for ScenePanel {
    /// Positions of all runs and trajectories up to the cursor, aligned with the ground truth as in the scene, and the
    /// ground truth.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let mut table = CsvWriter::new(["t_s", "run", "x_m", "y_m", "z_m", "truth_x_m", "truth_y_m", "truth_z_m"]);
        for run in &ctx.recording.runs {
            let aligned = run.alignment.unwrap_or_default();
            for step in run.steps.iter().take_while(|step| step.report.stamp_ns <= ctx.cursor_ns) {
                let estimate = step.report.newest().map(|frame| aligned.transform(&frame.world_from_imu.translation_m));
                let ground_truth = step.ground_truth.map(|pose| pose.translation_m);
                let places = [estimate, ground_truth];
                let coordinates =
                    places.iter().flat_map(|at| at.map_or([f64::NAN; 3], |at| [at.x, at.y, at.z]).map(number_cell));
                table.row([seconds_cell(step.report.stamp_ns), run.spec.label.clone()].into_iter().chain(coordinates));
            }
        }
        for lane in &ctx.recording.trajectories {
            let aligned = lane.world_from_own(ctx.recording.runs.first());
            let mut pairs = lane.evaluation.pairs.iter().peekable();
            for sample in lane.track.samples().iter().take_while(|sample| sample.stamp_ns <= ctx.cursor_ns) {
                let at_s = seconds_from_ns(sample.stamp_ns);
                while pairs.next_if(|(estimate, _)| estimate.stamp_s < at_s).is_some() {}
                let actual = pairs.peek().filter(|(estimate, _)| estimate.stamp_s == at_s);
                let places = [
                    Some(aligned.transform(&sample.world_from_imu.translation_m)),
                    actual.map(|(_, actual)| actual.pose.translation_m),
                ];
                let coordinates =
                    places.iter().flat_map(|at| at.map_or([f64::NAN; 3], |at| [at.x, at.y, at.z]).map(number_cell));
                table.row([seconds_cell(sample.stamp_ns), lane.label.clone()].into_iter().chain(coordinates));
            }
        }
        table.into_text()
    }
}
