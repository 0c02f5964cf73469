//! Tracking of points from one image to the next: pyramidal Lucas–Kanade.
//!
//! Lucas and Kanade ("An iterative image registration technique with an application to stereo vision", IJCAI 1981) find
//! the shift `d` of a window `T` of the first image in the second image `J` by Gauss–Newton; from the coarsest level of
//! an image pyramid to the finest as in Bouguet ("Pyramidal implementation of the Lucas Kanade feature tracker", 2000).
//! The gradient is taken from the window and not from the second image, so that it is computed once for all iterations
//! (inverse compositional: Baker and Matthews, "Lucas–Kanade 20 years on", IJCV 2004).
//!
//! The brightness may change by a gain `a` and an offset `b`, which are eliminated:
//!
//! ```text
//! min over d, a, b   Σ (J(x + d) − a T(x) − b)²
//! g' = ∇T − (means of ∇T) − (regression of ∇T on T)        ∇T without its projection on 1 and T
//! r(d) = Σ g' J(x + d) = 0        H = Σ g' g'ᵀ        d ← d − H⁻¹ r(d)
//! ```
//!
//! A track is rejected if tracking back from its end misses its start (forward–backward error: Kalal, Mikolajczyk and
//! Matas, "Forward-backward error", ICPR 2010).

#![expect(clippy::inline_always, reason = "code not inlined is not compiled for the registers of its caller")]

use std::ops::Range;

use nalgebra::Vector2;
use pulp::{Arch, NullaryFnOnce};

use super::filters::{
    self, LANES, REGISTER, WINDOW, cubic_slopes, cubic_weights, larger, rounded_bits, scharr, smaller_eigenvalue,
};
use super::products::{STRIDE, Weights, sums_of_products};
use super::pyramid::{Pyramid, cut_out};
use crate::geometry::planar_length;
use crate::sensors::GrayImage;

const CENTRE: f32 = filters::CENTRE as f32;
/// Rows of the region of the second image, so that the window can move within it.
const SEARCH_HEIGHT: usize = 34;
/// Largest first column and row of a window for which the neighbouring windows at one and two pixels also fit.
const LAST_COLUMN: i32 = (STRIDE - WINDOW - 2) as i32;
const LAST_ROW: i32 = (SEARCH_HEIGHT - WINDOW - 3) as i32;
/// Largest weight; times 128 grey levels times the window's area it still fits into an `i32`.
const LARGEST_WEIGHT: f32 = 16383.0;

/// Region of the second image, row by row, grey levels less 128.
type Search = [[i16; STRIDE]; SEARCH_HEIGHT];

/// Options of the tracker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LucasKanadeOptions {
    /// Levels of the pyramid, the image itself included.
    pub levels: usize,
    /// Converged when a step is shorter than this, in pixels of the level.
    pub epsilon_px: f64,
    /// The search fails after this many moves to another pixel on one level.
    pub max_moves: usize,
    /// Smaller eigenvalue of the mean structure tensor below which a window has no texture, in (grey levels/px)².
    pub min_eigenvalue: f64,
    /// Minimum ratio of the window that is inside both images.
    pub min_visible: f64,
    /// Largest distance from the start after tracking back, in pixels; `None` for no check.
    pub forward_backward_px: Option<f64>,
}

impl Default for LucasKanadeOptions {
    fn default() -> Self {
        Self {
            levels: 4,
            epsilon_px: 0.01,
            max_moves: 12,
            min_eigenvalue: 0.05,
            min_visible: 0.25,
            forward_backward_px: Some(0.5),
        }
    }
}

/// Gradient `g'` of the window in the first image, with gain and offset of the brightness eliminated, so that
/// `Σ g' T = 0` and `Σ g' = 0`.
///
/// As `J(x + d)` is interpolated, `r(d)` is a polynomial in the fraction of `d` whose coefficients are sums over whole
/// pixels: iterations within one pixel cost nothing, and the sums are exact in integers.
#[derive(Clone, Debug)]
struct Template {
    x: Weights,
    y: Weights,
    /// `H = Σ g' g'ᵀ` as `xx, xy, yy`, in the unit of the weights times grey levels per pixel.
    hessian: [f32; 3],
}

/// Buffers of tracking one point, without state between points.
#[derive(Clone, Debug)]
pub(super) struct Buffers {
    template: Template,
    /// Pixels of the first image that the patch is interpolated from.
    pixels: [[f32; PATCH_WIDTH + 4]; PATCH_HEIGHT + 3],
    /// The first image around the window.
    patch: Patch,
    /// Gradient of the window; padding columns and rows are zero.
    gradient: Gradient,
    search: Search,
}

impl Buffers {
    pub(super) fn new() -> Box<Self> {
        Box::new(Self {
            template: Template { x: [0; STRIDE * WINDOW], y: [0; STRIDE * WINDOW], hessian: [0.0; 3] },
            pixels: [[0.0; PATCH_WIDTH + 4]; PATCH_HEIGHT + 3],
            patch: [[0.0; PATCH_WIDTH]; PATCH_HEIGHT],
            gradient: [[[0.0; LANES]; 2]; WINDOW],
            search: [[0; STRIDE]; SEARCH_HEIGHT],
        })
    }
}

fn linear_weights(t: f32) -> [f32; 2] {
    [1.0 - t, t]
}

/// First and last column (or row) of a window around `centre` whose pixels are `margin` inside an image of `count`.
fn visible(centre: f32, count: usize, margin: f32) -> (f32, f32) {
    let first = (CENTRE - centre + margin).max(0.0).ceil();
    let last = (CENTRE - centre + count as f32 - 1.0 - margin).min(WINDOW as f32 - 1.0).floor();
    (first, last)
}

const PATCH_WIDTH: usize = LANES + 2;
const PATCH_HEIGHT: usize = WINDOW + 2;
type Patch = [[f32; PATCH_WIDTH]; PATCH_HEIGHT];

impl Buffers {
    /// Computes the template of the window of `image` around `at`, without the pixels that are outside the image or
    /// outside when moved to `guess`. Returns true if enough of the window remains for tracking.
    fn set_template(&mut self, image: &GrayImage, at: [f32; 2], guess: [f32; 2], options: &LucasKanadeOptions) -> bool {
        Arch::new().dispatch(TemplatePreparation { buffers: self, image, at, guess, options })
    }
}

/// [`Buffers::set_template`], compiled for every width of vector registers.
struct TemplatePreparation<'a> {
    buffers: &'a mut Buffers,
    image: &'a GrayImage,
    at: [f32; 2],
    guess: [f32; 2],
    options: &'a LucasKanadeOptions,
}

impl NullaryFnOnce for TemplatePreparation<'_> {
    type Output = bool;

    #[inline(always)]
    fn call(self) -> bool {
        let Self { buffers, image, at, guess, options } = self;
        let Buffers { template, pixels, patch, gradient, .. } = buffers;
        let columns = [visible(at[0], image.width, 1.0), visible(guess[0], image.width, 0.0)];
        let rows = [visible(at[1], image.height, 1.0), visible(guess[1], image.height, 0.0)];
        let (first_column, last_column) = (columns[0].0.max(columns[1].0), columns[0].1.min(columns[1].1));
        let (first_row, last_row) = (rows[0].0.max(rows[1].0), rows[0].1.min(rows[1].1));
        let area = (last_column - first_column + 1.0).max(0.0) * (last_row - first_row + 1.0).max(0.0);
        if area < options.min_visible as f32 * (WINDOW * WINDOW) as f32 {
            return false;
        }
        interpolate(image, at, pixels, patch);
        let rows = first_row as usize..last_row as usize + 1;
        let mut mask = [0.0; LANES];
        mask[first_column as usize..=last_column as usize].fill(1.0);
        let [value, square, x, y, x_value, y_value] =
            differentiate(patch, rows.clone(), &mask, gradient).map(|sum| sum / area);
        let variance = square - value * value;
        // A flat window has hardly any contrast.
        let scale = if variance > 1e-3 { 1.0 / variance } else { 0.0 };
        let slopes = [(x_value - x * value) * scale, (y_value - y * value) * scale];
        let offsets = [x - slopes[0] * value, y - slopes[1] * value];
        let ([xx, xy, yy], largest) = project_out_brightness(patch, rows, &mask, offsets, slopes, gradient);
        let hessian = [xx, xy, yy];
        if smaller_eigenvalue(hessian) <= options.min_eigenvalue as f32 * area {
            return false;
        }
        let unit = LARGEST_WEIGHT / largest;
        template.hessian = hessian.map(|sum| unit * sum);
        for (weights, axis) in [(&mut template.x, 0), (&mut template.y, 1)] {
            for (line, gradient) in weights.as_chunks_mut::<STRIDE>().0.iter_mut().zip(gradient.iter()) {
                for c in 0..LANES {
                    line[c] = rounded_bits(unit * gradient[axis][c]) as i16;
                }
            }
        }
        true
    }
}

/// `[gx, gy]` of a window, row by row.
type Gradient = [[[f32; LANES]; 2]; WINDOW];

/// Writes the gradient of `rows` of a window, times `mask` along each row, into `gradient`; all other entries are zero.
///
/// Returns the sums over the window of `T, T², gx, gy, gx·T, gy·T`.
#[inline(always)]
fn differentiate(patch: &Patch, rows: Range<usize>, mask: &[f32; LANES], gradient: &mut Gradient) -> [f32; 6] {
    for row in (0..rows.start).chain(rows.end..WINDOW) {
        gradient[row] = [[0.0; LANES]; 2];
    }
    let mut all = [[0.0_f32; LANES]; 6];
    // The sums of all columns at once do not fit into the registers.
    for first in (0..LANES).step_by(REGISTER) {
        let mut sums = [[0.0_f32; REGISTER]; 6];
        for row in rows.clone() {
            let rows = [&patch[row], &patch[row + 1], &patch[row + 2]];
            for lane in 0..REGISTER {
                let c = first + lane;
                let [x, y] = scharr(rows, c);
                let (x, y) = (x * mask[c] * (1.0 / 32.0), y * mask[c] * (1.0 / 32.0));
                let value = rows[1][c + 1] * mask[c];
                sums[0][lane] += value;
                sums[1][lane] += value * value;
                sums[2][lane] += x;
                sums[3][lane] += y;
                sums[4][lane] += x * value;
                sums[5][lane] += y * value;
                gradient[row][0][c] = x;
                gradient[row][1][c] = y;
            }
        }
        for (all, sums) in all.iter_mut().zip(sums) {
            all[first..first + REGISTER].copy_from_slice(&sums);
        }
    }
    all.map(|lanes| lanes.iter().sum())
}

/// Subtracts `offsets + slopes·T` from the gradient `∇T`, which leaves `g'`; returns `H` as `xx, xy, yy` and the largest
/// entry of `g'`.
#[inline(always)]
fn project_out_brightness(
    patch: &Patch,
    rows: Range<usize>,
    mask: &[f32; LANES],
    offsets: [f32; 2],
    slopes: [f32; 2],
    gradient: &mut Gradient,
) -> ([f32; 3], f32) {
    let mut products = [[0.0_f32; LANES]; 3];
    let mut largest = [0.0_f32; LANES];
    for row in rows {
        let here = &patch[row + 1];
        let [mut along_x, mut along_y] = gradient[row];
        for c in 0..LANES {
            along_x[c] -= (offsets[0] + slopes[0] * here[c + 1]) * mask[c];
            along_y[c] -= (offsets[1] + slopes[1] * here[c + 1]) * mask[c];
        }
        for c in 0..LANES {
            products[0][c] += along_x[c] * along_x[c];
            products[1][c] += along_x[c] * along_y[c];
            products[2][c] += along_y[c] * along_y[c];
            largest[c] = larger(larger(along_x[c].abs(), along_y[c].abs()), largest[c]);
        }
        gradient[row] = [along_x, along_y];
    }
    (products.map(|lanes| lanes.iter().sum()), largest.into_iter().fold(0.0, f32::max))
}

impl Template {
    /// Returns `Σ g' J` for the window whose first pixel is `(column, row)` of `search` and its neighbours to the right,
    /// below and both; `[dy][dx]` are the sums with the x and the y component of `g'`.
    fn correlate(&self, search: &Search, column: usize, row: usize) -> [[[f32; 2]; 2]; 2] {
        let pixels = search.as_flattened()[row * STRIDE + column..].first_chunk();
        let pixels = pixels.expect("callers keep within the search");
        let [here, right, below, both] =
            sums_of_products([&self.x, &self.y], pixels).map(|sums| sums.map(|sum| sum as f32));
        [[here, right], [below, both]]
    }
}

/// Largest integer not above `value`, which must fit into an `i32`.
fn floor(value: f32) -> i32 {
    let towards_zero = value as i32;
    towards_zero - i32::from(towards_zero as f32 > value)
}

/// Pixels around `at` by cubic convolution, one more on every side than the window; `pixels` is a buffer.
#[inline(always)]
fn interpolate(
    image: &GrayImage,
    at: [f32; 2],
    pixels: &mut [[f32; PATCH_WIDTH + 4]; PATCH_HEIGHT + 3],
    patch: &mut Patch,
) {
    let corner = at.map(floor);
    let reach = (WINDOW / 2 + 2) as i32;
    if corner.map(|t| t as f32) == at {
        cut_out(image, [corner[0] - reach + 1, corner[1] - reach + 1], patch, f32::from);
        return;
    }
    cut_out(image, [corner[0] - reach, corner[1] - reach], pixels, f32::from);
    let (along, down) = (cubic_weights(at[0] - corner[0] as f32), cubic_weights(at[1] - corner[1] as f32));
    for (y, line) in patch.iter_mut().enumerate() {
        let mut column_sums = [0.0; PATCH_WIDTH + 4];
        for (x, sum) in column_sums.iter_mut().enumerate() {
            *sum = down[0] * pixels[y][x]
                + down[1] * pixels[y + 1][x]
                + down[2] * pixels[y + 2][x]
                + down[3] * pixels[y + 3][x];
        }
        for (x, value) in line.iter_mut().enumerate() {
            *value = along[0] * column_sums[x]
                + along[1] * column_sums[x + 1]
                + along[2] * column_sums[x + 2]
                + along[3] * column_sums[x + 3];
        }
    }
}

/// `r(d)` (2) and its derivative by `d` (2 × 2), from the coefficients and the weights of the fraction of `d`.
fn residual_and_jacobian<const N: usize>(
    sums: &[[[f32; 2]; N]; N],
    along: ([f32; N], [f32; N]),
    down: ([f32; N], [f32; N]),
) -> ([f32; 2], [[f32; 2]; 2]) {
    let (mut residual, mut jacobian) = ([0.0; 2], [[0.0; 2]; 2]);
    for (j, line) in sums.iter().enumerate() {
        for (i, point) in line.iter().enumerate() {
            for k in 0..2 {
                residual[k] += down.0[j] * along.0[i] * point[k];
                jacobian[k][0] += down.0[j] * along.1[i] * point[k];
                jacobian[k][1] += down.1[j] * along.0[i] * point[k];
            }
        }
    }
    (residual, jacobian)
}

/// Newton's step on `r(d) = 0`, or the Gauss–Newton step `−H⁻¹ r` if the Jacobian of `r` and `H` differ too much.
fn newton_step(r: [f32; 2], jacobian: [[f32; 2]; 2], [xx, xy, yy]: [f32; 3]) -> [f32; 2] {
    let hessian_determinant = xx * yy - xy * xy;
    let determinant = jacobian[0][0] * jacobian[1][1] - jacobian[0][1] * jacobian[1][0];
    let is_similar = jacobian[0][0] > 0.3 * xx && jacobian[1][1] > 0.3 * yy && determinant > 0.1 * hessian_determinant;
    let ([[a, b], [c, d]], determinant) =
        if is_similar { (jacobian, determinant) } else { ([[xx, xy], [xy, yy]], hessian_determinant) };
    [-(d * r[0] - b * r[1]) / determinant, -(a * r[1] - c * r[0]) / determinant]
}

/// Largest distance of a fraction outside its pixel before the sums are recomputed; prevents oscillation at a pixel
/// border.
const OVERHANG_PX: f32 = 0.02;
/// Maximum iterations within one pixel.
const MAX_ITERATIONS: usize = 8;
/// Longest single step, in pixels of the level.
const LONGEST_STEP_PX: f32 = 6.0;

/// Weights of `N` pixels at a fraction, and their derivatives by the fraction.
type Taps<const N: usize> = (fn(f32) -> [f32; N], fn(f32) -> [f32; N]);

/// Iterates within one pixel; returns the fraction of `d`, and true if the last step was shorter than `epsilon`.
fn iterate_within_pixel<const N: usize>(
    sums: &[[[f32; 2]; N]; N],
    kernel: Taps<N>,
    mut fraction: [f32; 2],
    hessian: [f32; 3],
    epsilon: f32,
) -> ([f32; 2], bool) {
    for _ in 0..MAX_ITERATIONS {
        let [along, down] = fraction.map(|t| (kernel.0(t), kernel.1(t)));
        let (residual, jacobian) = residual_and_jacobian(sums, along, down);
        let [x, y] = newton_step(residual, jacobian, hessian);
        let length = planar_length([x, y]);
        let shrink = if length > LONGEST_STEP_PX { LONGEST_STEP_PX / length } else { 1.0 };
        fraction = [fraction[0] + shrink * x, fraction[1] + shrink * y];
        if length < epsilon {
            return (fraction, true);
        }
        if fraction.iter().any(|t| !(-OVERHANG_PX..=1.0 + OVERHANG_PX).contains(t)) {
            return (fraction, false);
        }
    }
    (fraction, true)
}

/// Interpolation of the second image along each axis.
#[derive(Clone, Copy, PartialEq)]
enum Kernel {
    /// Between the two nearest pixels.
    Linear,
    /// Cubic convolution of four pixels, for the last stage.
    Cubic,
}

/// Copies a region of the second image, compiled for every width of vector registers.
struct Cutting<'a> {
    image: &'a GrayImage,
    corner: [i32; 2],
    search: &'a mut Search,
}

impl NullaryFnOnce for Cutting<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        cut_out(self.image, self.corner, self.search, |pixel| i16::from(pixel) - 128);
    }
}

/// True if a position is finite and small enough for integer pixels.
fn is_in_range(at: [f32; 2]) -> bool {
    at.iter().all(|t| t.abs() < 1e5)
}

/// Tracks one point from one image to the next by pyramidal Lucas–Kanade with compensation of gain and offset.
///
/// `from_px` is its position in `previous`, `guess_px` the initial one in `now`; both in pixels of the image.
/// Returns its position in pixels, or `None` if it left the image, has no texture, or fails the forward–backward check
/// ([`LucasKanadeOptions::forward_backward_px`]).
pub fn track(
    previous: &Pyramid,
    now: &Pyramid,
    from_px: &Vector2<f64>,
    guess_px: &Vector2<f64>,
    options: &LucasKanadeOptions,
) -> Option<Vector2<f64>> {
    let mut buffers = Buffers::new();
    let near_px = track_on_coarse_levels(previous, now, from_px, guess_px, options, &mut buffers)?;
    track_on_finest_level(previous, now, from_px, &near_px, options, &mut buffers)
}

/// First stage of [`track`]: on the half-size levels, to about half a pixel.
///
/// The window of a level is centred at the nearest whole pixel, which is assumed to move like the point.
/// A level without texture keeps the guess; `None` only for positions that are not finite or too large.
pub(super) fn track_on_coarse_levels(
    previous: &Pyramid,
    now: &Pyramid,
    from_px: &Vector2<f64>,
    guess_px: &Vector2<f64>,
    options: &LucasKanadeOptions,
    buffers: &mut Buffers,
) -> Option<Vector2<f64>> {
    let from = [from_px.x as f32, from_px.y as f32];
    let mut guess = [guess_px.x as f32, guess_px.y as f32];
    if !is_in_range(from) || !is_in_range(guess) {
        return None;
    }
    let levels = previous.levels().len().min(now.levels().len()).min(options.levels);
    for level in (1..levels).rev() {
        let scale = (0.5_f32).powi(level as i32);
        let at = from.map(|t| (t * scale).round());
        let start = [0, 1].map(|k| at[k] + (guess[k] - from[k]) * scale);
        if buffers.set_template(&previous.levels()[level], at, start, options)
            && let Some(found) = buffers.align(&now.levels()[level], start, Kernel::Linear, options)
        {
            guess = [0, 1].map(|k| from[k] + (found[k] - at[k]) / scale);
        }
    }
    Some(Vector2::new(f64::from(guess[0]), f64::from(guess[1])))
}

/// Second stage of [`track`]: on the full-size images, forwards and backwards.
pub(super) fn track_on_finest_level(
    previous: &Pyramid,
    now: &Pyramid,
    from_px: &Vector2<f64>,
    near_px: &Vector2<f64>,
    options: &LucasKanadeOptions,
    buffers: &mut Buffers,
) -> Option<Vector2<f64>> {
    let from = [from_px.x as f32, from_px.y as f32];
    let near = [near_px.x as f32, near_px.y as f32];
    let (previous, now) = (previous.levels().first()?, now.levels().first()?);
    let found = buffers.track_on_image(previous, now, from, near, options)?;
    if let Some(limit_px) = options.forward_backward_px {
        let back = buffers.track_on_image(now, previous, found, from, options)?;
        if planar_length([back[0] - from[0], back[1] - from[1]]) > limit_px as f32 {
            return None;
        }
    }
    Some(Vector2::new(f64::from(found[0]), f64::from(found[1])))
}

impl Buffers {
    /// Iterates the shift of the template from `at` until `r(d)` vanishes; returns the centre of the window in `image`, or
    /// `None` without convergence.
    fn align(
        &mut self,
        image: &GrayImage,
        mut at: [f32; 2],
        kernel: Kernel,
        options: &LucasKanadeOptions,
    ) -> Option<[f32; 2]> {
        let Self { template, search, .. } = self;
        // First pixel of the region.
        let mut origin: Option<[i32; 2]> = None;
        let epsilon = options.epsilon_px as f32;
        for _ in 0..options.max_moves {
            if !is_in_range(at) {
                return None;
            }
            let first = at.map(|t| floor(t - CENTRE));
            let cell = first.map(|t| t as f32);
            let fits = |[left, top]: [i32; 2]| {
                (1..=LAST_COLUMN).contains(&(first[0] - left)) && (1..=LAST_ROW).contains(&(first[1] - top))
            };
            let [left, top] = origin.filter(|corner| fits(*corner)).unwrap_or_else(|| {
                let corner = [first[0] - LAST_COLUMN / 2, first[1] - LAST_ROW / 2];
                Arch::new().dispatch(Cutting { image, corner, search });
                corner
            });
            origin = Some([left, top]);
            let (column, row) = ((first[0] - left) as usize, (first[1] - top) as usize);
            let fraction = [at[0] - CENTRE - cell[0], at[1] - CENTRE - cell[1]];
            let (fraction, has_converged) = match kernel {
                Kernel::Linear => {
                    let sums = template.correlate(search, column, row);
                    iterate_within_pixel(&sums, (linear_weights, |_| [-1.0, 1.0]), fraction, template.hessian, epsilon)
                }
                Kernel::Cubic => {
                    let mut sums = [[[0.0; 2]; 4]; 4];
                    for (j, i) in [(0, 0), (0, 2), (2, 0), (2, 2)] {
                        let block = template.correlate(search, column + i - 1, row + j - 1);
                        for (dj, line) in block.iter().enumerate() {
                            sums[j + dj][i..i + 2].copy_from_slice(line);
                        }
                    }
                    iterate_within_pixel(
                        &sums,
                        (cubic_weights, cubic_slopes),
                        fraction,
                        template.hessian,
                        0.1 * epsilon,
                    )
                }
            };
            at = [cell[0] + fraction[0] + CENTRE, cell[1] + fraction[1] + CENTRE];
            if has_converged {
                return Some(at);
            }
        }
        None
    }

    /// Last stage of [`track`], on the full-size image.
    fn track_on_image(
        &mut self,
        previous: &GrayImage,
        now: &GrayImage,
        from: [f32; 2],
        guess: [f32; 2],
        options: &LucasKanadeOptions,
    ) -> Option<[f32; 2]> {
        if !self.set_template(previous, from, guess, options) {
            return None;
        }
        let near = self.align(now, guess, Kernel::Linear, options)?;
        let [x, y] = self.align(now, near, Kernel::Cubic, options)?;
        let inside = x >= 0.0 && y >= 0.0 && x <= (now.width - 1) as f32 && y <= (now.height - 1) as f32;
        inside.then_some([x, y])
    }
}
