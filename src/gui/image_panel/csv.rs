//! Observations in the image at the cursor; one feature per row.

use super::ImagePanel;
use crate::estimator::{FeatureReport, ObservationReport};
use crate::frontend::TrackedFeature;
use crate::gui::{CsvTable, PanelContext};
use crate::table::{Column, csv};

/// A tracked feature, in the solve, and its observation in the image.
type FeatureRow<'a> = (&'a TrackedFeature, Option<&'a FeatureReport>, Option<ObservationReport>);
type FeatureColumn<'a> = Column<'a, FeatureRow<'a>>;

impl CsvTable for ImagePanel {
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let Some(run) = ctx.selected_run() else { return String::new() };
        let columns = [
            FeatureColumn::new("id", |(tracked, ..)| tracked.id.0),
            FeatureColumn::new("age_frames", |(tracked, ..)| tracked.age),
            FeatureColumn::new("u_px", |(tracked, ..)| tracked.uv_px.x),
            FeatureColumn::new("v_px", |(tracked, ..)| tracked.uv_px.y),
            FeatureColumn::new("residual_before_u_px", |(.., seen)| Some(seen.as_ref()?.residual_before_px?.x)),
            FeatureColumn::new("residual_before_v_px", |(.., seen)| Some(seen.as_ref()?.residual_before_px?.y)),
            FeatureColumn::new("residual_after_u_px", |(.., seen)| Some(seen.as_ref()?.residual_after_px?.x)),
            FeatureColumn::new("residual_after_v_px", |(.., seen)| Some(seen.as_ref()?.residual_after_px?.y)),
            FeatureColumn::new("chi2", |(.., seen)| Some(seen.as_ref()?.chi2)),
            FeatureColumn::new("weight", |(.., seen)| Some(seen.as_ref()?.robust_weight)),
            FeatureColumn::new("depth_m", |(_, solved, _)| Some(1.0 / (*solved)?.inverse_depth_per_m)),
            FeatureColumn::new("rejected", |(_, solved, _)| Some((*solved)?.rejected)),
            FeatureColumn::new("track_weight", |(_, solved, _)| solved.map(FeatureReport::track_weight)),
        ];
        let rows = run.step_at(ctx.cursor_ns).into_iter().flat_map(|step| {
            let frame = step.report.frame_index;
            step.tracks.features.iter().map(move |tracked| {
                let solved = step.report.features.iter().find(|solved| solved.id == tracked.id);
                let seen = solved.and_then(|solved| solved.observations.iter().find(|seen| seen.frame_index == frame));
                (tracked, solved, seen)
            })
        });
        csv(&columns, rows)
    }
}
