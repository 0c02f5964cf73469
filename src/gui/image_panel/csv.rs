//! Observations in the image at the cursor; one feature per row.

use super::ImagePanel;
use crate::estimator::FeatureReport;
use crate::files::csv_writer::{CsvWriter, number_cell};
use crate::gui::{CsvTable, PanelContext};

impl CsvTable for ImagePanel {
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let Some(run) = ctx.selected_run() else { return String::new() };
        let mut table = CsvWriter::new([
            "id",
            "age_frames",
            "u_px",
            "v_px",
            "residual_before_u_px",
            "residual_before_v_px",
            "residual_after_u_px",
            "residual_after_v_px",
            "chi2",
            "weight",
            "depth_m",
            "rejected",
            "track_weight",
        ]);
        let Some(step) = run.step_at(ctx.cursor_ns) else { return table.into_text() };
        for feature in &step.tracks.features {
            let solved = step.report.features.iter().find(|solved| solved.id == feature.id);
            let here = solved
                .and_then(|solved| solved.observations.iter().find(|seen| seen.frame_index == step.report.frame_index));
            let vector = |residual: Option<nalgebra::Vector2<f64>>| {
                let [u, v] = residual.map_or([f64::NAN; 2], |residual| [residual.x, residual.y]);
                [number_cell(u), number_cell(v)]
            };
            let [before_u, before_v] = vector(here.and_then(|seen| seen.residual_before_px));
            let [after_u, after_v] = vector(here.and_then(|seen| seen.residual_after_px));
            table.row([
                feature.id.0.to_string(),
                feature.age.to_string(),
                number_cell(feature.uv_px.x),
                number_cell(feature.uv_px.y),
                before_u,
                before_v,
                after_u,
                after_v,
                number_cell(here.map_or(f64::NAN, |seen| seen.chi2)),
                number_cell(here.map_or(f64::NAN, |seen| seen.robust_weight)),
                number_cell(solved.map_or(f64::NAN, |solved| 1.0 / solved.inverse_depth_per_m)),
                solved.map_or_else(String::new, |solved| solved.rejected.to_string()),
                number_cell(solved.map_or(f64::NAN, FeatureReport::track_weight)),
            ]);
        }
        table.into_text()
    }
}
