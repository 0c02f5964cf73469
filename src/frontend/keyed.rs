//! A feature's appearance at its first sighting, found again in later images.
//!
//! Following a feature from image to image adds up the errors of all the steps.
//! So its window is kept as it was first seen, the key, and once the feature is roughly found its place is refined against
//! that, under an affine warp with a gain and an offset (Shi and Tomasi, "Good features to track"; inverse compositional as
//! Baker and Matthews put it).
//! When the key does not fit any more, the feature goes on from image to image and gets a new key.

use std::sync::Arc;

use nalgebra::{Matrix2, Vector2};

use super::appearance::Appearance;
use super::pyramid::cut_out;
use super::resample::Patch;
use crate::sensors::GrayImage;

/// Side of the window in pixels.
pub(super) const WINDOW: usize = 21;
pub(super) const CENTRE: usize = WINDOW / 2;
/// Side of the window with the pixels around it that its gradient needs.
pub(super) const SIDE: usize = WINDOW + 2;
/// Columns rounded up to whole vector registers; the surplus ones weigh nothing.
pub(super) const LANES: usize = 24;

/// How keys are used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeyOptions {
    /// Least correlation of the window with the key.
    pub min_correlation: f64,
    /// Farthest place from where the feature was roughly found, in pixels.
    pub max_correction_px: f64,
    /// Steps of the refinement.
    pub max_steps: usize,
    /// A key is worn out when the window has grown or shrunk by this factor in area.
    pub max_area_change: f64,
}

impl Default for KeyOptions {
    fn default() -> Self {
        Self { min_correlation: 0.85, max_correction_px: 2.0, max_steps: 6, max_area_change: 2.0 }
    }
}

/// A feature's window as it was first seen.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Key {
    appearance: Arc<Appearance>,
    /// From the window's middle, a whole pixel, to the feature.
    offset_px: Vector2<f64>,
    /// Maps steps in the key to steps in the newest image.
    warp: Matrix2<f64>,
}

/// What came of looking for a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sighting {
    /// The feature is here.
    Found(Vector2<f64>),
    /// It does not look like its key any more.
    Changed,
    /// Part of the window lies outside the image: nothing can be said.
    OutOfView,
}

/// A window, row by row.
pub(super) type Rows = [[f32; LANES]; WINDOW];

impl Key {
    /// The window about a feature, `None` when part of it lies outside the image or it has no texture.
    pub(super) fn cut(image: &GrayImage, uv_px: &Vector2<f64>) -> Option<Self> {
        let middle = uv_px.map(f64::round);
        let reach = (SIDE / 2) as f64;
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

    /// Looks for the key about a rough place; when it is found, the warp is kept for the next image.
    pub(super) fn find(
        &mut self,
        image: &GrayImage,
        rough_px: &Vector2<f64>,
        options: &KeyOptions,
        finder: &mut KeyFinder,
    ) -> Sighting {
        let appearance = &*self.appearance;
        let mut warp = self.warp;
        let mut middle = rough_px - warp * self.offset_px;
        finder.patch.clear();
        for _ in 0..options.max_steps {
            if !finder.patch.read(image, &warp, &middle, appearance.level(), &mut finder.window) {
                return Sighting::OutOfView;
            }
            let Some((correlation, step)) = appearance.compare(&finder.window) else { return Sighting::Changed };
            let growth = Matrix2::new(1.0 + step[2], step[3], step[4], 1.0 + step[5]);
            let Some(back) = growth.try_inverse() else { return Sighting::Changed };
            warp *= back;
            let shift = warp * Vector2::new(step[0], step[1]);
            middle -= shift;
            let area = warp.determinant();
            let place = middle + warp * self.offset_px;
            let sound = (place - rough_px).norm() <= options.max_correction_px
                && area < options.max_area_change
                && area > 1.0 / options.max_area_change;
            if !sound {
                return Sighting::Changed;
            }
            if shift.norm() < SHORT_STEP_PX {
                if correlation < options.min_correlation {
                    return Sighting::Changed;
                }
                self.warp = warp;
                return Sighting::Found(place);
            }
        }
        Sighting::Changed
    }
}

/// Buffers to look for keys with.
#[derive(Clone, Debug)]
pub(super) struct KeyFinder {
    patch: Patch,
    /// Surplus columns are zero.
    window: Rows,
}

impl KeyFinder {
    pub(super) fn new() -> Self {
        Self { patch: Patch::new(), window: [[0.0; LANES]; WINDOW] }
    }
}

/// A step shorter than this ends the refinement, in pixels.
const SHORT_STEP_PX: f64 = 0.01;
