//! A feature's appearance at its first sighting, found again in later images.
//!
//! Following a feature from image to image adds up the errors of all the steps.
//! So its window is kept as it was first seen, the key, and once the feature is roughly found its place is refined against
//! that, under an affine warp with a gain and an offset (Shi and Tomasi, "Good features to track"; inverse compositional as
//! Baker and Matthews put it).
//! When the key does not fit any more, the feature goes on from image to image and gets a new key.

use std::sync::Arc;

use nalgebra::{Matrix2, Matrix6, Vector2, Vector6};

use super::pyramid::cut_out;
use crate::flight_log::GrayImage;

/// Side of the window in pixels.
const WINDOW: usize = 21;
const CENTRE: usize = WINDOW / 2;
/// Side of the window with the pixels around it that its gradient needs.
const SIDE: usize = WINDOW + 2;
/// Columns rounded up to whole vector registers; the surplus ones weigh nothing.
const LANES: usize = 24;

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
#[derive(Clone, Debug)]
pub(super) struct Key {
    template: Arc<Template>,
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

type Rows = [[f32; LANES]; WINDOW];

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
        let template = Template::new(&grey)?;
        Some(Self { template: Arc::new(template), offset_px: uv_px - middle, warp: Matrix2::identity() })
    }

    /// Looks for the key about a rough place; when it is found, the warp is kept for the next image.
    pub(super) fn find(&mut self, image: &GrayImage, rough_px: &Vector2<f64>, options: &KeyOptions) -> Sighting {
        let template = &*self.template;
        let mut warp = self.warp;
        let mut middle = rough_px - warp * self.offset_px;
        let mut window = [[0.0; LANES]; WINDOW];
        for _ in 0..options.max_steps {
            if !sample(image, &warp, &middle, &mut window) {
                return Sighting::OutOfView;
            }
            let Some((correlation, step)) = template.compare(&window) else { return Sighting::Changed };
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

/// A step shorter than this ends the refinement, in pixels.
const SHORT_STEP_PX: f64 = 0.01;

/// The key's window with what is needed to compare another window with it.
#[derive(Debug)]
struct Template {
    /// Grey values less their mean; the surplus columns are zero.
    value: Rows,
    /// Gradient and its first moments `[gx, gy, gx·x, gx·y, gy·x, gy·y]`, freed of what brightness and contrast can do.
    slopes: [Rows; 6],
    inverse: Matrix6<f64>,
    /// `Σ value²`.
    square: f32,
}

impl Template {
    /// That of a window with one more pixel all around, row by row; `None` when it has no texture.
    fn new(pixels: &[[f32; SIDE]; SIDE]) -> Option<Self> {
        let mut grey = [[0.0_f32; LANES + 2]; SIDE];
        for (row, source) in grey.iter_mut().zip(pixels) {
            row[..SIDE].copy_from_slice(source);
        }
        let area = (WINDOW * WINDOW) as f32;
        let mean = grey[1..=WINDOW].iter().flat_map(|row| &row[1..=WINDOW]).sum::<f32>() / area;
        let mut mask = [0.0_f32; LANES];
        mask[..WINDOW].fill(1.0);
        let across: [f32; LANES] = std::array::from_fn(|c| c as f32 - CENTRE as f32);

        let mut value = [[0.0; LANES]; WINDOW];
        let mut slopes = [[[0.0; LANES]; WINDOW]; 6];
        let mut squares = [0.0_f32; LANES];
        let mut sums = [[[0.0_f32; LANES]; 2]; 6];
        for row in 0..WINDOW {
            let (above, here, below) = (&grey[row], &grey[row + 1], &grey[row + 2]);
            let down = row as f32 - CENTRE as f32;
            for c in 0..LANES {
                // Scharr's derivative.
                let x = 3.0 * (above[c + 2] - above[c] + below[c + 2] - below[c]) + 10.0 * (here[c + 2] - here[c]);
                let y =
                    3.0 * (below[c] - above[c] + below[c + 2] - above[c + 2]) + 10.0 * (below[c + 1] - above[c + 1]);
                let (x, y) = (x * mask[c] * (1.0 / 32.0), y * mask[c] * (1.0 / 32.0));
                let grey = (here[c + 1] - mean) * mask[c];
                value[row][c] = grey;
                squares[c] += grey * grey;
                let parts = [x, y, x * across[c], x * down, y * across[c], y * down];
                for k in 0..6 {
                    slopes[k][row][c] = parts[k];
                    sums[k][0][c] += parts[k];
                    sums[k][1][c] += parts[k] * grey;
                }
            }
        }
        let square: f32 = squares.iter().sum();
        if square < LEAST_VARIANCE * area {
            return None;
        }
        for (slope, sums) in slopes.iter_mut().zip(&sums) {
            let mean = sums[0].iter().sum::<f32>() / area;
            let along = sums[1].iter().sum::<f32>() / square;
            for (row, value) in slope.iter_mut().zip(&value) {
                for c in 0..LANES {
                    row[c] -= (mean + along * value[c]) * mask[c];
                }
            }
        }
        let mut normal = Matrix6::zeros();
        for a in 0..6 {
            for b in a..6 {
                let product = f64::from(dot(&slopes[a], &slopes[b]));
                normal[(a, b)] = product;
                normal[(b, a)] = product;
            }
        }
        let inverse = normal.cholesky()?.inverse();
        Some(Self { value, slopes, inverse, square })
    }

    /// How well the window correlates with the template, and the shift and change of shape of the template that would make
    /// it more alike; `None` when nothing in them is alike.
    fn compare(&self, window: &Rows) -> Option<(f64, Vector6<f64>)> {
        let mean = window.iter().flat_map(|row| &row[..WINDOW]).sum::<f32>() / (WINDOW * WINDOW) as f32;
        let square = window.iter().flat_map(|row| &row[..WINDOW]).map(|value| (value - mean).powi(2)).sum::<f32>();
        let common = dot(&self.value, window);
        let correlation = f64::from(common) / (f64::from(self.square) * f64::from(square)).sqrt();
        if correlation.is_nan() || correlation <= 0.0 {
            return None;
        }
        let gain = f64::from(common / self.square);
        let right = Vector6::from_fn(|k, _| f64::from(dot(&self.slopes[k], window)));
        Some((correlation, self.inverse * right / gain))
    }
}

/// A window with less variance than this has no appearance, in squared grey levels.
const LEAST_VARIANCE: f32 = 4.0;

fn dot(a: &Rows, b: &Rows) -> f32 {
    let mut sums = [0.0_f32; LANES];
    for (a, b) in a.iter().zip(b) {
        for c in 0..LANES {
            sums[c] += a[c] * b[c];
        }
    }
    sums.iter().sum()
}

/// Weights of the four pixels about a point, by Keys' cubic convolution, at fractions of a pixel.
const FRACTIONS: usize = 128;
static CUBIC: [[f32; 4]; FRACTIONS + 1] = cubic_table();

const fn cubic_table() -> [[f32; 4]; FRACTIONS + 1] {
    let mut table = [[0.0; 4]; FRACTIONS + 1];
    let mut index = 0;
    while index <= FRACTIONS {
        let t = index as f32 / FRACTIONS as f32;
        table[index] = [
            ((2.0 - t) * t - 1.0) * t * 0.5,
            ((3.0 * t - 5.0) * t * t + 2.0) * 0.5,
            ((4.0 - 3.0 * t) * t + 1.0) * t * 0.5,
            (t - 1.0) * t * t * 0.5,
        ];
        index += 1;
    }
    table
}

/// Reads the image at `middle + warp·step` for every step of the window; returns whether all of that lies inside.
fn sample(image: &GrayImage, warp: &Matrix2<f64>, middle: &Vector2<f64>, window: &mut Rows) -> bool {
    let reach = CENTRE as f64;
    let extent = Vector2::new(
        (warp[(0, 0)].abs() + warp[(0, 1)].abs()) * reach,
        (warp[(1, 0)].abs() + warp[(1, 1)].abs()) * reach,
    );
    // The four pixels about a point reach from one before it to two after it.
    let (low, high) = (middle - extent, middle + extent);
    let inside =
        low.x >= 1.0 && low.y >= 1.0 && high.x < image.width as f64 - 3.0 && high.y < image.height as f64 - 3.0;
    if !inside {
        return false;
    }
    let step = [warp[(0, 0)] as f32, warp[(1, 0)] as f32];
    for (row, line) in window.iter_mut().enumerate() {
        let start = middle + warp * Vector2::new(-reach, row as f64 - reach);
        let start = [start.x as f32, start.y as f32];
        for (c, value) in line[..WINDOW].iter_mut().enumerate() {
            let at = [start[0] + c as f32 * step[0], start[1] + c as f32 * step[1]];
            let (x, y) = (at[0] as usize, at[1] as usize);
            let along = &CUBIC[((at[0] - x as f32) * FRACTIONS as f32 + 0.5) as usize];
            let down = &CUBIC[((at[1] - y as f32) * FRACTIONS as f32 + 0.5) as usize];
            let mut sums = [0.0_f32; 4];
            for (j, weight) in down.iter().enumerate() {
                let first = (y + j - 1) * image.width + x - 1;
                let Some(taps) = image.pixels[first..].first_chunk::<4>() else { return false };
                for i in 0..4 {
                    sums[i] += weight * f32::from(taps[i]);
                }
            }
            *value = along[0] * sums[0] + along[1] * sums[1] + along[2] * sums[2] + along[3] * sums[3];
        }
    }
    true
}
