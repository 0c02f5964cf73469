//! Trajectories of the scene; one row per step of a run or pose of a trajectory.

use nalgebra::Vector3;

use super::ScenePanel;
use crate::geometry::seconds_from_ns;
use crate::gui::{CsvTable, PanelContext};
use crate::table::{Column, Stamp, csv};

/// Stamp, label of run or trajectory, its position and the position of the ground truth.
type PlaceRow<'a> = (i64, &'a str, [Option<Vector3<f64>>; 2]);
type PlaceColumn<'a> = Column<'a, PlaceRow<'a>>;

impl CsvTable for ScenePanel {
    /// Positions of all runs and trajectories up to the cursor, aligned with the ground truth as in the scene, and the
    /// ground truth.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let mut columns = vec![
            PlaceColumn::new("t_s", |(stamp_ns, ..)| Stamp(*stamp_ns)),
            PlaceColumn::new("run", |(_, run, _)| *run),
        ];
        columns.extend(PlaceColumn::each(
            ["", "truth_"].into_iter().enumerate().flat_map(|place| (0..3).map(move |axis| (place, axis))),
            |((_, of), axis)| format!("{of}{}_m", ["x", "y", "z"][*axis]),
            |(.., places), ((place, _), axis)| Some(places[*place]?[*axis]),
        ));
        let runs = ctx.recording.runs.iter().flat_map(|run| {
            let aligned = run.alignment.unwrap_or_default();
            let steps = run.steps.iter().take_while(|step| step.report.stamp_ns <= ctx.cursor_ns);
            steps.map(move |step| {
                let estimate = step.report.newest().map(|frame| aligned.transform(&frame.world_from_imu.translation_m));
                let ground_truth = step.ground_truth.map(|pose| pose.translation_m);
                (step.report.stamp_ns, run.spec.label.as_str(), [estimate, ground_truth])
            })
        });
        let lanes = ctx.recording.trajectories.iter().flat_map(|lane| {
            let aligned = lane.world_from_own(ctx.recording.runs.first());
            let mut pairs = lane.evaluation.pairs.iter().peekable();
            let samples = lane.track.samples().iter().take_while(|sample| sample.stamp_ns <= ctx.cursor_ns);
            samples.map(move |sample| {
                let at_s = seconds_from_ns(sample.stamp_ns);
                while pairs.next_if(|(estimate, _)| estimate.stamp_s < at_s).is_some() {}
                let actual = pairs.peek().filter(|(estimate, _)| estimate.stamp_s == at_s);
                let ground_truth = actual.map(|(_, actual)| actual.pose.translation_m);
                let estimate = aligned.transform(&sample.world_from_imu.translation_m);
                (sample.stamp_ns, lane.label.as_str(), [Some(estimate), ground_truth])
            })
        });
        csv(&columns, runs.chain(lanes))
    }
}
