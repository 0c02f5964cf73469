use nalgebra::{Matrix2, Vector2};

/// Largest squared radius on the normalized plane at which the turning point of a lens is searched (89.4° off the
/// axis).
const LARGEST_SQUARE: f64 = 1e4;
/// Bisection steps per root: more than the digits of a double.
const BISECTIONS: usize = 100;

/// Radial–tangential lens with a quotient of polynomials as radial part (`OpenCV`, `rational_polynomial` in ROS):
///
/// `x_d = x·(1 + k1·s + k2·s² + k3·s³) / (1 + k4·s + k5·s² + k6·s³) + 2·p1·x·y + p2·(s + 2·x²)`, `s = x² + y²`, and the
/// same for `y` with `p1` and `p2` exchanged. With `k4 = k5 = k6 = 0` it is `plumb_bob` with a third radial
/// coefficient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RationalLens {
    /// `k1 k2 p1 p2 k3 k4 k5 k6`, the order of `OpenCV`.
    coefficients: [f64; 8],
    /// Squared radius at which the distorted radius stops growing, or the denominator is zero.
    turning_square: f64,
}

impl RationalLens {
    /// Creates a lens from `k1 k2 p1 p2 k3 k4 k5 k6`, the order of `OpenCV`.
    pub fn new(coefficients: [f64; 8]) -> Self {
        let [k1, k2, _, _, k3, k4, k5, k6] = coefficients;
        let (numerator, denominator) = ([1.0, k1, k2, k3], [1.0, k4, k5, k6]);
        // r·N/D grows while N·D + 2·s·(N'·D − N·D') > 0.
        let mut growth = [0.0; 7];
        for (i, n) in numerator.into_iter().enumerate() {
            for (j, d) in denominator.into_iter().enumerate() {
                growth[i + j] += n * d * (1.0 + 2.0 * (i as f64 - j as f64));
            }
        }
        let roots = [smallest_positive_root(&growth), smallest_positive_root(&denominator)];
        let turning_square = roots.into_iter().flatten().fold(f64::INFINITY, f64::min);
        Self { coefficients, turning_square }
    }

    /// `k1 k2 p1 p2 k3 k4 k5 k6`.
    pub fn coefficients(&self) -> &[f64; 8] {
        &self.coefficients
    }

    /// True if the radial part is a polynomial: `k4`, `k5` and `k6` are zero.
    pub fn is_polynomial(&self) -> bool {
        self.coefficients[5..].iter().all(|value| *value == 0.0)
    }

    /// True if a squared radius lies before the turning point, beyond which two points would project to the same pixel.
    pub(super) fn is_invertible(&self, square: f64) -> bool {
        square < self.turning_square
    }

    /// `1 + k4·s + k5·s² + k6·s³` at a squared radius.
    pub(super) fn denominator(&self, square: f64) -> f64 {
        let [_, _, _, _, _, k4, k5, k6] = self.coefficients;
        1.0 + square * (k4 + square * (k5 + square * k6))
    }

    /// Distorted point of a point with squared radius `square`, and its derivative (2 × 2).
    pub(super) fn distort(&self, plane: &Vector2<f64>, square: f64) -> (Vector2<f64>, Matrix2<f64>) {
        let [k1, k2, p1, p2, k3, k4, k5, k6] = self.coefficients;
        let (x, y, s) = (plane.x, plane.y, square);
        let numerator = 1.0 + s * (k1 + s * (k2 + s * k3));
        let denominator = self.denominator(s);
        let radial = numerator / denominator;
        let by_square =
            (k1 + s * (2.0 * k2 + s * 3.0 * k3) - radial * (k4 + s * (2.0 * k5 + s * 3.0 * k6))) / denominator;
        let slope = 2.0 * by_square;
        let mixed = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
        let distorted = Vector2::new(
            x * radial + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
            y * radial + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
        );
        let jacobian = Matrix2::new(
            radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
            mixed,
            mixed,
            radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
        );
        (distorted, jacobian)
    }
}

/// Smallest positive root of a polynomial up to [`LARGEST_SQUARE`], coefficients in ascending order.
fn smallest_positive_root(coefficients: &[f64]) -> Option<f64> {
    positive_roots(coefficients).first().copied()
}

/// Positive roots with a change of sign, in ascending order: between two roots of its derivative a polynomial has at most one.
fn positive_roots(coefficients: &[f64]) -> Vec<f64> {
    let Some((_, rest)) = coefficients.split_first().filter(|(_, rest)| !rest.is_empty()) else { return Vec::new() };
    let derivative: Vec<f64> = rest.iter().zip(1_u32..).map(|(value, power)| value * f64::from(power)).collect();
    let value = |s: f64| coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * s + coefficient);
    let mut roots = Vec::new();
    let mut low = 0.0;
    for high in positive_roots(&derivative).into_iter().chain([LARGEST_SQUARE]) {
        if value(low) * value(high) < 0.0 {
            let rising = value(low) < 0.0;
            let (mut from, mut to) = (low, high);
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (from + to);
                if (value(middle) < 0.0) == rising {
                    from = middle;
                } else {
                    to = middle;
                }
            }
            roots.push(from);
        }
        low = high;
    }
    roots
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_found_between_the_turning_points() {
        // (s − 1)(s − 2)(s − 30)
        let roots = positive_roots(&[-60.0, 92.0, -33.0, 1.0]);
        assert_eq!(roots.len(), 3);
        for (root, expected) in roots.into_iter().zip([1.0, 2.0, 30.0]) {
            assert!((root - expected).abs() < 1e-9, "{root}");
        }
        assert!(positive_roots(&[1.0, 0.0, 1.0]).is_empty());
        assert!(positive_roots(&[1.0, 1.0, 0.0, 0.0]).is_empty());
        assert!(positive_roots(&[1.0]).is_empty());
    }

    #[test]
    fn a_lens_ends_where_its_radius_stops_growing() {
        // r·(1 + k1·s) has its largest value at s = −1 / (3·k1).
        let barrel = RationalLens::new([-0.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(barrel.is_polynomial() && barrel.is_invertible(1.333) && !barrel.is_invertible(1.334));
        // The denominator is zero at s = 0.5.
        let pole = RationalLens::new([0.0, 0.0, 0.0, 0.0, 0.0, -2.0, 0.0, 0.0]);
        assert!(!pole.is_polynomial() && pole.is_invertible(0.4999) && !pole.is_invertible(0.5));
        assert!(RationalLens::new([0.0; 8]).is_invertible(1e12));
    }
}
