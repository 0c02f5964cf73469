//! Window around a feature, prepared for comparison with other windows: affine tracking with gain and offset.
//!
//! The window `T` with the offsets `x = (x, y)` from its centre moves by `D x + d` (Shi and Tomasi, "Good features to
//! track", CVPR 1994). With `p = (d_x, d_y, D_xx, D_xy, D_yx, D_yy)` its derivative by `p` is the row
//! `s = (g_x, g_y, g_x x, g_x y, g_y x, g_y y)` of the gradient `g = ∇T`, the same in every iteration (inverse
//! compositional: Baker and Matthews, "Lucas–Kanade 20 years on", IJCV 2004). Gain `a` and offset of the brightness are
//! eliminated by `s'`, which is `s` without its projection on `1` and `T`:
//!
//! ```text
//! H = Σ s'ᵀ s'        p = H⁻¹ Σ s'ᵀ W / a        a = Σ (T − mean) W / Σ (T − mean)²
//! ```
//!
//! for another window `W`. Both windows agree if their zero-mean normalized cross-correlation is close to 1.

#![expect(clippy::inline_always, reason = "code not inlined is not compiled for the registers of its caller")]

use nalgebra::{Matrix6, Matrix6x2, Vector2, Vector6};
use pulp::{Arch, NullaryFnOnce};

use super::filters::{CENTRE, LANES, REGISTER, WINDOW};

/// Pixels around the window for its gradient.
pub(super) const MARGIN: usize = 2;
/// Side of the window with this margin.
pub(super) const SIDE: usize = WINDOW + 2 * MARGIN;
/// Grey levels of a window, row by row.
pub(super) type Rows = [[f32; LANES]; WINDOW];

/// Minimum variance of a window, in squared grey levels.
const MIN_VARIANCE: f32 = 4.0;

/// Window with its gradient and the normal matrix of the comparison; padding columns are zero.
#[derive(Debug, PartialEq)]
pub(super) struct Appearance {
    level: f32,
    /// Grey levels minus their mean.
    value: Rows,
    along_x: Rows,
    along_y: Rows,
    /// Means of the six entries of `s` over the window.
    means: [f32; 6],
    /// Regressions of the entries of `s` on the grey levels.
    regressions: [f32; 6],
    /// `H⁻¹` (6 × 6).
    inverse: Matrix6<f64>,
    /// Sum of the squares of `value`.
    square: f32,
    /// Affine displacement `[dx, dy]` and its derivatives (6 × 2, in px² and px) that a comparison finds per unit of
    /// perspective.
    by_perspective: Matrix6x2<f64>,
}

impl Appearance {
    /// Prepares a window with [`MARGIN`] more pixels on every side, row by row; `None` without texture.
    pub(super) fn new(pixels: &[[f32; SIDE]; SIDE]) -> Option<Self> {
        Arch::new().dispatch(Preparation { pixels })
    }

    #[inline(always)]
    fn prepare(pixels: &[[f32; SIDE]; SIDE]) -> Option<Self> {
        let mut grey = [[0.0_f32; LANES + 2 * MARGIN]; SIDE];
        for (row, source) in grey.iter_mut().zip(pixels) {
            row[..SIDE].copy_from_slice(source);
        }
        let area = (WINDOW * WINDOW) as f32;
        let within = MARGIN..MARGIN + WINDOW;
        let level = grey[within.clone()].iter().flat_map(|row| &row[within.clone()]).sum::<f32>() / area;
        let mut mask = [0.0_f32; LANES];
        mask[..WINDOW].fill(1.0);
        let across: [f32; LANES] = std::array::from_fn(|c| c as f32 - CENTRE as f32);

        let [mut value, mut along_x, mut along_y] = [[[0.0; LANES]; WINDOW]; 3];
        let mut slopes = [[[0.0; LANES]; WINDOW]; 6];
        let mut perspective = [[[0.0; LANES]; WINDOW]; 2];
        let mut squares = [0.0_f32; LANES];
        let mut sums = [[[0.0_f32; LANES]; 2]; 6];
        for row in 0..WINDOW {
            let [above_two, above, here, below, below_two] = [0, 1, 2, 3, 4].map(|k: usize| &grey[row + k]);
            let down = row as f32 - CENTRE as f32;
            for c in 0..LANES {
                let place = c + MARGIN;
                let x = slope([here[place - 2], here[place - 1], here[place + 1], here[place + 2]]) * mask[c];
                let y = slope([above_two[place], above[place], below[place], below_two[place]]) * mask[c];
                let grey = (here[place] - level) * mask[c];
                value[row][c] = grey;
                along_x[row][c] = x;
                along_y[row][c] = y;
                squares[c] += grey * grey;
                let parts = [x, y, x * across[c], x * down, y * across[c], y * down];
                let outward = x * across[c] + y * down;
                perspective[0][row][c] = outward * across[c];
                perspective[1][row][c] = outward * down;
                for k in 0..6 {
                    slopes[k][row][c] = parts[k];
                    sums[k][0][c] += parts[k];
                    sums[k][1][c] += parts[k] * grey;
                }
            }
        }
        let square: f32 = squares.iter().sum();
        if square < MIN_VARIANCE * area {
            return None;
        }
        let means = [0, 1, 2, 3, 4, 5].map(|k: usize| sums[k][0].iter().sum::<f32>() / area);
        let regressions = [0, 1, 2, 3, 4, 5].map(|k: usize| sums[k][1].iter().sum::<f32>() / square);
        for (k, slope) in slopes.iter_mut().enumerate() {
            for (row, value) in slope.iter_mut().zip(&value) {
                for c in 0..LANES {
                    row[c] -= (means[k] + regressions[k] * value[c]) * mask[c];
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
        let by_perspective = inverse * Matrix6x2::from_fn(|k, j| f64::from(dot(&slopes[k], &perspective[j])));
        Some(Self { level, value, along_x, along_y, means, regressions, inverse, square, by_perspective })
    }

    /// Grey level to subtract from a window before the comparison.
    pub(super) fn level(&self) -> f32 {
        self.level
    }

    /// Displacement of an affine match at an offset from the window's centre that perspective `w` (1/px) causes, in pixels
    /// of this window: matched minus true.
    pub(super) fn perspective_shift(&self, perspective: &Vector2<f64>, offset_px: &Vector2<f64>) -> Vector2<f64> {
        let found = self.by_perspective * perspective;
        let matched = Vector2::new(
            found[0] + found[2] * offset_px.x + found[3] * offset_px.y,
            found[1] + found[4] * offset_px.x + found[5] * offset_px.y,
        );
        offset_px * perspective.dot(offset_px) - matched
    }

    /// Zero-mean normalized cross-correlation of `window` with this one, and the Gauss–Newton step `p` of this one towards
    /// it (6 × 1): `[d_x, d_y]` in pixels, then `D` row by row. `window` has [`Self::level`] subtracted and padding columns
    /// of zero. `None` without positive correlation.
    pub(super) fn compare(&self, window: &Rows) -> Option<(f64, Vector6<f64>)> {
        let moments = Arch::new().dispatch(AppearanceChange { appearance: self, window });
        let area = (WINDOW * WINDOW) as f32;
        let square = moments.square - moments.sum * moments.sum / area;
        let correlation = f64::from(moments.common) / (f64::from(self.square) * f64::from(square)).sqrt();
        if correlation.is_nan() || correlation <= 0.0 {
            return None;
        }
        let gain = f64::from(moments.common / self.square);
        let right = Vector6::from_fn(|k, _| {
            let projection = self.means[k] * moments.sum + self.regressions[k] * moments.common;
            f64::from(moments.slopes[k] - projection)
        });
        Some((correlation, self.inverse * right / gain))
    }
}

/// [`Appearance::new`], compiled for every width of vector registers.
struct Preparation<'a> {
    pixels: &'a [[f32; SIDE]; SIDE],
}

impl NullaryFnOnce for Preparation<'_> {
    type Output = Option<Appearance>;

    #[inline(always)]
    fn call(self) -> Option<Appearance> {
        Appearance::prepare(self.pixels)
    }
}

/// Sums for the comparison with a window, compiled for every width of vector registers.
struct AppearanceChange<'a> {
    appearance: &'a Appearance,
    window: &'a Rows,
}

impl NullaryFnOnce for AppearanceChange<'_> {
    type Output = Moments;

    #[inline(always)]
    fn call(self) -> Moments {
        let Self { appearance, window } = self;
        let [mut sum, mut square, mut common] = [[0.0_f32; LANES]; 3];
        let [mut x, mut x_down, mut y, mut y_down] = [[0.0_f32; LANES]; 4];
        // The sums of all columns at once do not fit into the registers.
        for first in (0..LANES).step_by(REGISTER) {
            let mut sums = [[0.0_f32; REGISTER]; 7];
            for row in 0..WINDOW {
                let lanes = |rows: &Rows| -> [f32; REGISTER] { std::array::from_fn(|c| rows[row][first + c]) };
                let (value, along_x, along_y) =
                    (lanes(&appearance.value), lanes(&appearance.along_x), lanes(&appearance.along_y));
                let grey = lanes(window);
                let down = row as f32 - CENTRE as f32;
                for c in 0..REGISTER {
                    sums[0][c] += grey[c];
                    sums[1][c] += grey[c] * grey[c];
                    sums[2][c] += value[c] * grey[c];
                    sums[3][c] += along_x[c] * grey[c];
                    sums[4][c] += down * along_x[c] * grey[c];
                    sums[5][c] += along_y[c] * grey[c];
                    sums[6][c] += down * along_y[c] * grey[c];
                }
            }
            let all = [&mut sum, &mut square, &mut common, &mut x, &mut x_down, &mut y, &mut y_down];
            for (all, sums) in all.into_iter().zip(sums) {
                all[first..first + REGISTER].copy_from_slice(&sums);
            }
        }
        let across = |lanes: &[f32; LANES]| -> f32 {
            lanes.iter().enumerate().map(|(c, lane)| (c as f32 - CENTRE as f32) * lane).sum()
        };
        let total = |lanes: &[f32; LANES]| -> f32 { lanes.iter().sum() };
        Moments {
            sum: total(&sum),
            square: total(&square),
            common: total(&common),
            slopes: [total(&x), total(&y), across(&x), total(&x_down), across(&y), total(&y_down)],
        }
    }
}

/// Sums over a window `W`.
struct Moments {
    /// Sum of the grey levels, `Σ W`.
    sum: f32,
    /// Sum of their squares, `Σ W²`.
    square: f32,
    /// Correlation with the prepared window, `Σ (T − mean) W`.
    common: f32,
    /// Correlation with the derivatives, `Σ sᵀ W`.
    slopes: [f32; 6],
}

/// Central difference of fourth order, from the values two and one before and one and two after.
///
/// It is accurate for fine texture; with a smoother difference, such as Scharr's, Gauss–Newton steps are 1.4 times too
/// long.
#[inline(always)]
fn slope([two_before, before, after, two_after]: [f32; 4]) -> f32 {
    (2.0 / 3.0) * (after - before) - (1.0 / 12.0) * (two_after - two_before)
}

#[inline(always)]
fn dot(a: &Rows, b: &Rows) -> f32 {
    let mut sums = [0.0_f32; LANES];
    for (a, b) in a.iter().zip(b) {
        for c in 0..LANES {
            sums[c] += a[c] * b[c];
        }
    }
    sums.iter().sum()
}
