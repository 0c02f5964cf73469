//! Tracks and residuals of a step as annotations of its images.

use std::collections::BTreeMap;

use nalgebra::Vector2;

use crate::flight_log::{CircleAnnotation, LinesAnnotation, LogError, LogWriter, MessageTimes, Rgba};
use crate::frontend::FeatureId;
use crate::session::StepRecord;

/// Magnification of the drawn residuals.
const RESIDUAL_MAGNIFICATION: f64 = 20.0;
/// Diameter of the keypoint markers in pixels: larger for features in the window, so that colour is not the only cue.
const SOLVED_PX: f64 = 9.0;
const TRACKED_PX: f64 = 5.0;
/// Bluish green, orange, sky blue, vermilion of Okabe and Ito.
const SOLVED: Rgba = [0.0, 0.62, 0.45, 1.0];
const REJECTED: Rgba = [0.90, 0.62, 0.0, 1.0];
const TRACKED: Rgba = [0.34, 0.71, 0.91, 1.0];
const RESIDUAL: Rgba = [0.84, 0.37, 0.0, 1.0];

/// Result of the solve for a feature of the image.
struct Solved {
    rejected: bool,
    /// Line from the measurement along the magnified residual.
    residual_line_px: Option<[Vector2<f64>; 2]>,
}

/// Writes a keypoint marker for every track of a camera (large for features in the window), its track trail, and its
/// residual after the solve, predicted minus measured, magnified 20 times; nothing where the camera has no image.
pub(super) fn write(
    log: &mut LogWriter,
    topic: &str,
    times: MessageTimes,
    step: &StepRecord,
    camera: usize,
) -> Result<(), LogError> {
    let Some((_, tracks)) = step.image(camera) else { return Ok(()) };
    let frame_index = step.report.frame_index;
    let mut solved: BTreeMap<FeatureId, Solved> = BTreeMap::new();
    for feature in step.report.features.iter().filter(|feature| feature.id.camera() == camera) {
        let observed = feature.observations.iter().find(|seen| seen.frame_index == frame_index);
        let Some(observed) = observed else { continue };
        let line = observed
            .residual_after_px
            .map(|residual| [observed.measured_px, observed.measured_px + RESIDUAL_MAGNIFICATION * residual]);
        solved.insert(feature.id, Solved { rejected: feature.rejected, residual_line_px: line });
    }
    let mut circles = Vec::new();
    let mut motions = Vec::new();
    let mut residuals = Vec::new();
    for track in &tracks.frame().features {
        let solved = solved.get(&track.id.of_camera(camera));
        let (diameter_px, color) = match solved {
            Some(feature) if feature.rejected => (SOLVED_PX, REJECTED),
            Some(_) => (SOLVED_PX, SOLVED),
            None => (TRACKED_PX, TRACKED),
        };
        circles.push(CircleAnnotation { center_px: track.uv_px, diameter_px, color });
        motions.extend(track.previous_uv_px.map(|previous| [previous, track.uv_px]));
        residuals.extend(solved.and_then(|feature| feature.residual_line_px));
    }
    let lines = [
        LinesAnnotation { lines_px: motions, color: TRACKED },
        LinesAnnotation { lines_px: residuals, color: RESIDUAL },
    ];
    log.write_annotations(topic, times, &circles, &lines)
}
