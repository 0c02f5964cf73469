//! Windows of the trackers and filters on their pixels, in single precision.

#![expect(clippy::inline_always, reason = "code not inlined is not compiled for the registers of its caller")]

use crate::geometry::planar_length;

/// Side of the tracked square in pixels, on every level.
pub(super) const WINDOW: usize = 21;
/// Distance of the centre from the first column or row of the window, in pixels.
pub(super) const CENTRE: usize = WINDOW / 2;
/// Columns of the window, padded to whole vector registers; the padding has zero weight.
pub(super) const LANES: usize = 24;
/// Columns in a vector register.
pub(super) const REGISTER: usize = 8;

/// The larger value, by the comparison of vector units.
#[inline(always)]
pub(super) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Smaller eigenvalue of the symmetric 2 × 2 matrix `[xx, xy, yy]`: `(xx + yy)/2 − √(((xx − yy)/2)² + xy²)`.
#[inline(always)]
pub(super) fn smaller_eigenvalue([xx, xy, yy]: [f32; 3]) -> f32 {
    0.5 * (xx + yy) - planar_length([0.5 * (xx - yy), xy])
}

/// Weights of the four pixels around a point at `t` after the second one (Keys, "Cubic convolution interpolation for
/// digital image processing", 1981).
#[inline(always)]
pub(super) const fn cubic_weights(t: f32) -> [f32; 4] {
    [
        ((2.0 - t) * t - 1.0) * t * 0.5,
        ((3.0 * t - 5.0) * t * t + 2.0) * 0.5,
        ((4.0 - 3.0 * t) * t + 1.0) * t * 0.5,
        (t - 1.0) * t * t * 0.5,
    ]
}

/// Derivative of [`cubic_weights`] by `t`.
pub(super) fn cubic_slopes(t: f32) -> [f32; 4] {
    [
        ((4.0 - 3.0 * t) * t - 1.0) * 0.5,
        (9.0 * t - 10.0) * t * 0.5,
        ((8.0 - 9.0 * t) * t + 1.0) * 0.5,
        (3.0 * t - 2.0) * t * 0.5,
    ]
}

/// Scharr's derivatives along x and y at column `c + 1` of the middle one of three rows, times 32, in grey levels/px.
#[inline(always)]
pub(super) fn scharr<const N: usize>([above, here, below]: [&[f32; N]; 3], c: usize) -> [f32; 2] {
    [
        3.0 * (above[c + 2] - above[c] + below[c + 2] - below[c]) + 10.0 * (here[c + 2] - here[c]),
        3.0 * (below[c] - above[c] + below[c + 2] - above[c + 2]) + 10.0 * (below[c + 1] - above[c + 1]),
    ]
}

/// Bits of the nearest integer of a value of magnitude below 2²²: adding 1.5·2²³ leaves it in the low 22 bits, where
/// vector units read it faster than through a checked conversion.
#[inline(always)]
pub(super) fn rounded_bits(value: f32) -> u32 {
    (value + 12_582_912.0).to_bits()
}
