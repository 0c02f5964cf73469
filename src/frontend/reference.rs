//! Reference patch of a feature: its window in one image, matched in later ones.
//!
//! Tracking from image to image accumulates the errors of all steps. The tracked position is therefore refined against
//! the reference patch under an affine warp `A` with a gain and an offset (Shi and Tomasi, "Good features to track", CVPR
//! 1994): the pixel at the offset `x` from the patch's centre is found at `m + A x`. A step `D x + d` of the patch (see
//! `appearance.rs`) is composed inversely (Baker and Matthews, "Lucas–Kanade 20 years on", IJCV 2004):
//! `A ← A (I + D)⁻¹`, `m ← m − A d` with the new `A`.
//! If the patch no longer matches, or leaves the image, the feature gets a new reference from the previous image: one
//! match adds much less error than a step from image to image by a translation alone.

use std::sync::Arc;

use nalgebra::{Matrix2, UnitQuaternion, Vector2, Vector3};

use super::appearance::{Appearance, Rows, SIDE};
use super::filters::{CENTRE, LANES, WINDOW};
use super::perspective::Surface;
use super::pyramid::cut_out;
use super::resample::{BORDER, Patch};
use crate::camera::CameraModel;
use crate::sensors::GrayImage;

/// Distance from the image's first column or row to the centre of the first window that can be resampled, in pixels.
const NEAR_BORDER: f64 = (CENTRE + BORDER[0]) as f64;
/// Distance from the centre of the last window that can be resampled to the image's last column or row, in pixels.
const FAR_BORDER: f64 = (CENTRE + BORDER[1]) as f64;

/// Options of the refinement against reference patches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceOptions {
    /// Minimum normalized correlation of the window with the reference.
    pub min_correlation: f64,
    /// Largest distance from the tracked position, in pixels.
    pub max_correction_px: f64,
    pub max_steps: usize,
    /// Largest change of the window's area, as a factor; beyond, the reference is replaced.
    pub max_area_change: f64,
}

impl Default for ReferenceOptions {
    fn default() -> Self {
        Self { min_correlation: 0.85, max_correction_px: 2.0, max_steps: 6, max_area_change: 2.0 }
    }
}

/// Additional distance by which the window of a feature near the border is moved inwards, in pixels, so that it can be
/// used for more than one image.
const RESERVE_PX: f64 = 3.0;

/// Window of a feature, at its first observation or a later one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ReferencePatch {
    appearance: Arc<Appearance>,
    /// Offset of the feature from the window's centre, a whole pixel.
    offset_px: Vector2<f64>,
    /// `A`, the map from offsets in the reference to offsets in the newest image.
    warp: Matrix2<f64>,
    /// `None` far from the optical axis.
    surface: Option<Surface>,
}

impl ReferencePatch {
    /// Window around a feature that moves by about `motion_px` to the image in which it is matched.
    ///
    /// Near the border the feature is not in the centre: the window is moved until it is inside both images. `None` if
    /// the feature is then outside the window, or the window has no texture.
    pub(super) fn cut(
        image: &GrayImage,
        camera: &CameraModel,
        uv_px: &Vector2<f64>,
        motion_px: &Vector2<f64>,
    ) -> Option<Self> {
        let mut middle = uv_px.map(f64::round);
        for (axis, count) in [image.width, image.height].into_iter().enumerate() {
            let first = NEAR_BORDER + RESERVE_PX - motion_px[axis].min(0.0);
            let last = count as f64 - 1.0 - FAR_BORDER - RESERVE_PX - motion_px[axis].max(0.0);
            if first > last {
                return None;
            }
            middle[axis] = middle[axis].max(first.ceil()).min(last.floor());
        }
        let within = (uv_px - middle).iter().all(|offset| offset.abs() <= CENTRE as f64);
        if !within {
            return None;
        }
        let first = [middle.x as i32 - (SIDE / 2) as i32, middle.y as i32 - (SIDE / 2) as i32];
        let mut grey = [[0.0; SIDE]; SIDE];
        cut_out(image, first, &mut grey, f32::from);
        let appearance = Appearance::new(&grey)?;
        Some(Self {
            appearance: Arc::new(appearance),
            offset_px: uv_px - middle,
            warp: Matrix2::identity(),
            surface: Surface::new(camera, &middle),
        })
    }

    /// Error of the newest match that is caused by perspective, in pixels of the image, after the camera rotated by
    /// `rotation` since the previous image. To be called once for each match.
    pub(super) fn perspective_error_px(
        &mut self,
        camera: &CameraModel,
        rotation: &UnitQuaternion<f64>,
        bearing: &Vector3<f64>,
    ) -> Vector2<f64> {
        let Self { appearance, offset_px, warp, surface } = self;
        let perspective = surface.as_mut().and_then(|surface| surface.perspective(camera, rotation, bearing, warp));
        perspective
            .map_or_else(Vector2::zeros, |perspective| *warp * appearance.perspective_shift(&perspective, offset_px))
    }

    /// Matches the reference around a tracked position and returns the position of the feature in pixels; `None` if the
    /// image does not match, or part of the window is outside it. A match keeps the warp for the next image.
    pub(super) fn find(
        &mut self,
        image: &GrayImage,
        rough_px: &Vector2<f64>,
        options: &ReferenceOptions,
        finder: &mut ReferenceSearch,
    ) -> Option<Vector2<f64>> {
        let appearance = &*self.appearance;
        let mut warp = self.warp;
        let mut middle = rough_px - warp * self.offset_px;
        finder.patch.clear();
        for _ in 0..options.max_steps {
            if !finder.patch.read(image, &warp, &middle, appearance.level(), &mut finder.window) {
                return None;
            }
            let (correlation, p) = appearance.compare(&finder.window)?;
            let identity_plus_d = Matrix2::new(1.0 + p[2], p[3], p[4], 1.0 + p[5]);
            warp *= identity_plus_d.try_inverse()?;
            let shift = warp * Vector2::new(p[0], p[1]);
            middle -= shift;
            let area = warp.determinant();
            let place = middle + warp * self.offset_px;
            let plausible = (place - rough_px).norm() <= options.max_correction_px
                && area < options.max_area_change
                && area > 1.0 / options.max_area_change;
            if !plausible {
                return None;
            }
            if shift.norm() < SHORT_STEP_PX {
                if correlation < options.min_correlation {
                    return None;
                }
                self.warp = warp;
                return Some(place);
            }
        }
        None
    }
}

/// Buffers for matching references.
#[derive(Clone, Debug)]
pub(super) struct ReferenceSearch {
    patch: Patch,
    /// Padding columns are zero.
    window: Rows,
}

impl ReferenceSearch {
    pub(super) fn new() -> Self {
        Self { patch: Patch::new(), window: [[0.0; LANES]; WINDOW] }
    }
}

/// Length of a step that ends the refinement, in pixels. Further steps would be shorter than the error of a match,
/// which is 0.04 px in the median.
const SHORT_STEP_PX: f64 = 0.03;
