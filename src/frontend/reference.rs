//! The reference patch of a feature: its window at the first observation, matched in later images.
//!
//! Tracking from image to image accumulates the errors of all steps. The tracked position is therefore refined against the
//! reference patch under an affine warp with a gain and an offset (Shi and Tomasi, "Good features to track"; inverse
//! compositional as in Baker and Matthews).
//! When the patch does not match any more, the feature is tracked from image to image and gets a new reference.

use std::sync::Arc;

use nalgebra::{Matrix2, Vector2};

use super::appearance::Appearance;
use super::pyramid::cut_out;
use super::resample::Patch;
use crate::sensors::GrayImage;

/// Side of the window in pixels.
pub(super) const WINDOW: usize = 21;
pub(super) const CENTRE: usize = WINDOW / 2;
/// Pixels around the window that its gradient needs.
pub(super) const MARGIN: usize = 2;
/// Side of the window with these.
pub(super) const SIDE: usize = WINDOW + 2 * MARGIN;
/// Columns rounded up to whole vector registers; the surplus ones weigh nothing.
pub(super) const LANES: usize = 24;

/// Options of the refinement against reference patches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceOptions {
    /// Minimum normalized correlation of the window with the reference.
    pub min_correlation: f64,
    /// Largest distance from the tracked position, in pixels.
    pub max_correction_px: f64,
    /// Maximum number of steps.
    pub max_steps: usize,
    /// Largest change of the window's area, as a factor; beyond, the reference is replaced.
    pub max_area_change: f64,
}

impl Default for ReferenceOptions {
    fn default() -> Self {
        Self { min_correlation: 0.85, max_correction_px: 2.0, max_steps: 6, max_area_change: 2.0 }
    }
}

/// Window of a feature at its first observation.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ReferencePatch {
    appearance: Arc<Appearance>,
    /// From the window's centre, a whole pixel, to the feature.
    offset_px: Vector2<f64>,
    /// Maps offsets in the reference to offsets in the newest image.
    warp: Matrix2<f64>,
}

/// Result of matching a reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ReferenceMatch {
    /// Position of the feature, in pixels.
    Found(Vector2<f64>),
    /// The image does not match the reference.
    Changed,
    /// Part of the window is outside the image.
    OutOfView,
}

/// Grey levels of a window, row by row.
pub(super) type Rows = [[f32; LANES]; WINDOW];

impl ReferencePatch {
    /// The window about a feature, `None` when part of it is outside the image or it has no texture.
    pub(super) fn cut(image: &GrayImage, uv_px: &Vector2<f64>) -> Option<Self> {
        let middle = uv_px.map(f64::round);
        // Beyond this the gradient at the window's edge takes mirrored pixels.
        let reach = (CENTRE + 1) as f64;
        let (right, bottom) = (image.width as f64 - 1.0 - reach, image.height as f64 - 1.0 - reach);
        let inside = middle.x >= reach && middle.y >= reach && middle.x <= right && middle.y <= bottom;
        if !inside {
            return None;
        }
        let first = [middle.x as i32 - (SIDE / 2) as i32, middle.y as i32 - (SIDE / 2) as i32];
        let mut grey = [[0.0; SIDE]; SIDE];
        cut_out(image, first, &mut grey, f32::from);
        let appearance = Appearance::new(&grey)?;
        Some(Self { appearance: Arc::new(appearance), offset_px: uv_px - middle, warp: Matrix2::identity() })
    }

    /// Matches the reference around a tracked position; a match keeps the warp for the next image.
    pub(super) fn find(
        &mut self,
        image: &GrayImage,
        rough_px: &Vector2<f64>,
        options: &ReferenceOptions,
        finder: &mut ReferenceSearch,
    ) -> ReferenceMatch {
        let appearance = &*self.appearance;
        let mut warp = self.warp;
        let mut middle = rough_px - warp * self.offset_px;
        finder.patch.clear();
        for _ in 0..options.max_steps {
            if !finder.patch.read(image, &warp, &middle, appearance.level(), &mut finder.window) {
                return ReferenceMatch::OutOfView;
            }
            let Some((correlation, step)) = appearance.compare(&finder.window) else { return ReferenceMatch::Changed };
            let growth = Matrix2::new(1.0 + step[2], step[3], step[4], 1.0 + step[5]);
            let Some(back) = growth.try_inverse() else { return ReferenceMatch::Changed };
            warp *= back;
            let shift = warp * Vector2::new(step[0], step[1]);
            middle -= shift;
            let area = warp.determinant();
            let place = middle + warp * self.offset_px;
            let plausible = (place - rough_px).norm() <= options.max_correction_px
                && area < options.max_area_change
                && area > 1.0 / options.max_area_change;
            if !plausible {
                return ReferenceMatch::Changed;
            }
            if shift.norm() < SHORT_STEP_PX {
                if correlation < options.min_correlation {
                    return ReferenceMatch::Changed;
                }
                self.warp = warp;
                return ReferenceMatch::Found(place);
            }
        }
        ReferenceMatch::Changed
    }
}

/// Buffers for matching references.
#[derive(Clone, Debug)]
pub(super) struct ReferenceSearch {
    patch: Patch,
    /// Surplus columns are zero.
    window: Rows,
}

impl ReferenceSearch {
    pub(super) fn new() -> Self {
        Self { patch: Patch::new(), window: [[0.0; LANES]; WINDOW] }
    }
}

/// A step shorter than this ends the refinement, in pixels. The next ones would be a fraction of it, below the error of
/// a match, which is 0.04 px in the median.
const SHORT_STEP_PX: f64 = 0.03;
