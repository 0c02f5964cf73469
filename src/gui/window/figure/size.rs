//! Heights of figures that show a panel completely.

use super::text::FigureContent;
use crate::gui::comparison::ComparisonView;
use crate::gui::theme::PANEL_MARGIN;
use crate::gui::{PanelName, Presentation};
use crate::session::Recording;

/// Width and height of a plot in the convergence figure, in points.
const PLOT: [f32; 2] = [180.0, 91.0];
/// Height of the convergence figure without its plots: its legend.
const CONVERGENCE: f32 = 56.0;
/// Heights of the rank figure without its rows, and of a row.
const RANK: [f32; 2] = [350.0, 20.0];
/// Height of the sentences above its heat map.
const RANK_SENTENCES: f32 = 215.0;
/// Heights of the timeline without the lanes of the runs, and of such a lane.
const TIMELINE: [f32; 2] = [250.0, 24.0];
/// Height of the errors over time.
const ERRORS: f32 = 325.0;
/// Height of the residuals.
const RESIDUALS: f32 = 340.0;
/// Title, legend and caption lines around an image.
const AROUND_IMAGE: f32 = 92.0;
/// Heights of the calibration table without its rows, and of a row.
const CALIBRATION: [f32; 2] = [90.0, 18.0];
/// Height of other panels relative to their width, and their least height.
const ASPECT: f32 = 0.75;
/// Mean width of a letter and height of a line of a caption, in points.
const LETTER: [f32; 2] = [6.2, 16.0];
const MIN_HEIGHT: f32 = 240.0;

/// Height in points of a figure that is `width` points wide.
pub fn figure_height(content: &FigureContent<'_>, presentation: Presentation, width: f32) -> f32 {
    let FigureContent { recording, run, .. } = *content;
    let record = recording.runs.get(run);
    let parameters =
        record.and_then(|record| record.steps.last()).map_or(0, |step| step.report.calibration.parameters.len());
    match content.panel {
        PanelName::Convergence => {
            let columns = ((width / PLOT[0]).round() as usize).max(1);
            CONVERGENCE + PLOT[1] * (parameters.div_ceil(columns) as f32).max(2.0)
        }
        PanelName::Rank => {
            let sentences = if presentation == Presentation::FigureOfReport { RANK_SENTENCES } else { 0.0 };
            RANK[0] - sentences + RANK[1] * parameters as f32
        }
        PanelName::Calibration => CALIBRATION[0] + CALIBRATION[1] * parameters as f32,
        PanelName::Timeline => TIMELINE[0] + TIMELINE[1] * recording.runs.len() as f32,
        PanelName::Residuals => RESIDUALS,
        PanelName::Comparison if content.view == Some(ComparisonView::Errors) => ERRORS,
        PanelName::Image => image_height(recording, record.map_or("", |record| record.camera_key.as_str()), width),
        _ => (ASPECT * width).max(MIN_HEIGHT),
    }
}

/// Height in points that a caption takes in a figure of a width.
pub(super) fn caption_height(caption: &str, width: f32) -> f32 {
    let margin = 2.0 * f32::from(PANEL_MARGIN);
    let letters_per_line = ((width - margin) / LETTER[0]).max(1.0);
    (caption.chars().count() as f32 / letters_per_line).ceil() * LETTER[1] + margin
}

/// Height of the image of a camera over the full width, with its legend.
fn image_height(recording: &Recording, camera_key: &str, width: f32) -> f32 {
    let camera = recording.rig.cameras.iter().find(|camera| camera.key == camera_key);
    let [columns, rows] = camera.map_or([640, 480], |camera| camera.model.resolution_px);
    (width * rows as f32 / columns.max(1) as f32).clamp(0.4 * width, 1.4 * width) + AROUND_IMAGE
}
