//! Observations in the shown images; one feature per row.

use super::ImagePanel;
use super::model::{FeatureMark, ImageModel, SolveSide, SolvedMark};
use crate::gui::{CsvTable, PanelContext};
use crate::table::{Column, csv};

/// A mark with the key of its camera.
type MarkRow<'a> = (&'a str, &'a FeatureMark);
type MarkColumn<'a> = Column<'a, MarkRow<'a>>;

impl CsvTable for ImagePanel {
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let Some(run) = ctx.selected_run() else { return String::new() };
        let keys = run.last_camera_keys();
        let cameras = ctx.selection.cameras.indices(&keys);
        let models: Vec<ImageModel> =
            cameras.filter_map(|camera| ImageModel::at(&ctx.recording.rig, run, camera, ctx.cursor_ns)).collect();
        let residual = |mark: &FeatureMark, side, axis: usize| Some(mark.solved?.residual_px(side)?[axis]);
        let observed = |mark: &FeatureMark| mark.solved?.observation;
        let mut columns = vec![
            MarkColumn::new("id", |(_, mark)| mark.id.0),
            MarkColumn::new("age_frames", |(_, mark)| mark.age),
            MarkColumn::new("u_px", |(_, mark)| mark.measured_px.x),
            MarkColumn::new("v_px", |(_, mark)| mark.measured_px.y),
            MarkColumn::new("residual_before_u_px", move |(_, mark)| residual(mark, SolveSide::Before, 0)),
            MarkColumn::new("residual_before_v_px", move |(_, mark)| residual(mark, SolveSide::Before, 1)),
            MarkColumn::new("residual_after_u_px", move |(_, mark)| residual(mark, SolveSide::After, 0)),
            MarkColumn::new("residual_after_v_px", move |(_, mark)| residual(mark, SolveSide::After, 1)),
            MarkColumn::new("chi2", move |(_, mark)| Some(observed(mark)?.chi2)),
            MarkColumn::new("weight", move |(_, mark)| Some(observed(mark)?.robust_weight)),
            MarkColumn::new("depth_m", |(_, mark)| Some(mark.solved?.depth_m)),
            MarkColumn::new("rejected", |(_, mark)| Some(mark.solved?.rejected)),
            MarkColumn::new("track_weight", |(_, mark)| {
                mark.solved.map(|SolvedMark { track_weight, .. }| track_weight)
            }),
        ];
        if keys.len() > 1 {
            columns.insert(0, MarkColumn::new("camera", |(key, _)| *key));
        }
        let rows = models.iter().flat_map(|model| model.marks.iter().map(|mark| (model.camera_key.as_str(), mark)));
        csv(&columns, rows)
    }
}
