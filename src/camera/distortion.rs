use nalgebra::{Matrix2, Vector2};

use super::{CameraError, RationalLens};

/// Newton steps before an inversion fails; convergence is quadratic, in practice five steps suffice.
const MAXIMUM_STEPS: usize = 30;
/// An inversion has converged when a step is below this, relative to `1 + radius`.
const STEP_TOLERANCE: f64 = 1e-15;
/// Largest remaining error of an inversion on the normalized plane, relative to `1 + radius`.
const MISMATCH_TOLERANCE: f64 = 1e-11;
/// Below this radius on the normalized plane the radial models are the identity to double precision.
const SMALL_RADIUS: f64 = 1e-9;

/// Lens distortion: Kalibr's `distortion_model` and its coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    None,
    /// Radial–tangential `k1 k2 p1 p2` (Brown, "Close-range camera calibration", 1971): with `s = x² + y²`
    /// `x_d = x·(1 + k1·s + k2·s²) + 2·p1·x·y + p2·(s + 2·x²)`, and the same for `y` with `p1` and `p2` exchanged.
    Radtan([f64; 4]),
    /// Radial–tangential with up to six radial coefficients.
    Rational(RationalLens),
    /// Equidistant fisheye `k1 k2 k3 k4`, `r_d = θ·(1 + k1·θ² + k2·θ⁴ + k3·θ⁶ + k4·θ⁸)` with `θ = atan r` (Kannala and
    /// Brandt, "A generic camera model and calibration method for conventional, wide-angle, and fish-eye lenses", PAMI
    /// 2006).
    Equidistant([f64; 4]),
    /// Field of view `w` in radians, `r_d = atan(2 r tan(w/2))/w` (Devernay and Faugeras, "Straight lines have to be
    /// straight", 2001).
    Fov(f64),
}

impl Distortion {
    /// Kalibr's name of the model.
    pub fn name(&self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Radtan(_) => "radtan",
            Self::Rational(lens) if lens.is_polynomial() => "plumb_bob",
            Self::Rational(_) => "rational_polynomial",
            Self::Equidistant(_) => "equidistant",
            Self::Fov(_) => "fov",
        }
    }

    pub(super) fn check(&self) -> Result<(), CameraError> {
        match self {
            Self::Radtan(coefficients) | Self::Equidistant(coefficients) => check_finite(coefficients),
            Self::Rational(lens) => check_finite(lens.coefficients()),
            Self::Fov(w) if !(*w > 0.0 && *w < std::f64::consts::PI) => Err(CameraError::Value {
                field: "distortion_coeffs of 'fov'",
                value: *w,
                expected: "0 to π, both excluded",
            }),
            Self::None | Self::Fov(_) => Ok(()),
        }
    }

    /// Distorted point of a point of the normalized plane, `None` beyond the fold of the polynomial.
    #[inline]
    pub fn distort(&self, plane: &Vector2<f64>) -> Option<Vector2<f64>> {
        match self {
            Self::None => Some(*plane),
            Self::Radtan(coefficients) => {
                let square = plane.norm_squared();
                radtan_invertible(coefficients, square).then(|| radtan(coefficients, plane, square))
            }
            Self::Rational(lens) => {
                let square = plane.norm_squared();
                lens.is_invertible(square).then(|| lens.distort(plane, square).0)
            }
            Self::Equidistant(_) | Self::Fov(_) => {
                let radius = plane.norm();
                if radius < SMALL_RADIUS {
                    return Some(plane * self.slope_at_centre());
                }
                let (distorted_radius, _) = self.radial(radius)?;
                Some(plane * (distorted_radius / radius))
            }
        }
    }

    /// [`Distortion::distort`] and its derivative (2 × 2).
    #[inline]
    pub fn distort_with_jacobian(&self, plane: &Vector2<f64>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        match self {
            Self::None => Some((*plane, Matrix2::identity())),
            Self::Radtan(coefficients) => {
                let square = plane.norm_squared();
                radtan_invertible(coefficients, square)
                    .then(|| (radtan(coefficients, plane, square), radtan_jacobian(coefficients, plane, square)))
            }
            Self::Rational(lens) => {
                let square = plane.norm_squared();
                lens.is_invertible(square).then(|| lens.distort(plane, square))
            }
            Self::Equidistant(_) | Self::Fov(_) => {
                let radius = plane.norm();
                if radius < SMALL_RADIUS {
                    let slope = self.slope_at_centre();
                    return Some((plane * slope, Matrix2::identity() * slope));
                }
                let (distorted_radius, slope) = self.radial(radius)?;
                let scale = distorted_radius / radius;
                let outward = plane / radius;
                let jacobian = Matrix2::identity() * scale + outward * outward.transpose() * (slope - scale);
                Some((plane * scale, jacobian))
            }
        }
    }

    /// Undistorted point on the normalized plane, `None` if no point is distorted to `distorted`.
    #[inline]
    pub fn undistort(&self, distorted: &Vector2<f64>) -> Option<Vector2<f64>> {
        match self {
            Self::None => Some(*distorted),
            Self::Radtan(coefficients) => invert(
                distorted,
                |plane, square| (radtan(coefficients, plane, square), radtan_jacobian(coefficients, plane, square)),
                |square| radtan_invertible(coefficients, square),
            ),
            Self::Rational(lens) => {
                invert(distorted, |plane, square| lens.distort(plane, square), |square| lens.is_invertible(square))
            }
            Self::Equidistant(coefficients) => {
                let radius = distorted.norm();
                if radius < SMALL_RADIUS {
                    return Some(*distorted);
                }
                let theta = undistort_angle(coefficients, radius)?;
                Some(distorted * (theta.tan() / radius))
            }
            Self::Fov(w) => {
                let radius = distorted.norm();
                if radius < SMALL_RADIUS {
                    return Some(distorted / self.slope_at_centre());
                }
                let angle = radius * w;
                (angle < std::f64::consts::FRAC_PI_2)
                    .then(|| distorted * (angle.tan() / (2.0 * (0.5 * w).tan() * radius)))
            }
        }
    }

    /// Slope `d r_d / d r` on the optical axis.
    fn slope_at_centre(&self) -> f64 {
        match self {
            Self::Fov(w) => 2.0 * (0.5 * w).tan() / w,
            _ => 1.0,
        }
    }

    /// Distorted radius and its slope, for the purely radial models.
    fn radial(&self, radius: f64) -> Option<(f64, f64)> {
        match self {
            Self::Equidistant(coefficients) => {
                let theta = radius.atan();
                let (distorted, slope) = equidistant(coefficients, theta);
                (slope > 0.0).then(|| (distorted, slope / (1.0 + radius * radius)))
            }
            Self::Fov(w) => {
                let factor = 2.0 * (0.5 * w).tan();
                let stretched = factor * radius;
                Some((stretched.atan() / w, factor / (w * (1.0 + stretched * stretched))))
            }
            _ => Some((radius, 1.0)),
        }
    }
}

/// True if a squared radius lies inside the first fold of the radial polynomial `r·(1 + k1·r² + k2·r⁴)`, beyond which
/// two points would project to the same pixel.
fn radtan_invertible(&[k1, k2, _, _]: &[f64; 4], square: f64) -> bool {
    if k1 >= 0.0 && k2 >= 0.0 {
        return true;
    }
    // Smallest positive root of 5·k2·s² + 3·k1·s + 1, the slope of the polynomial.
    let (a, b) = (5.0 * k2, 3.0 * k1);
    let discriminant = b * b - 4.0 * a;
    if discriminant < 0.0 {
        return true;
    }
    // 2c / (−b ± √…) stays exact for a → 0.
    let root = discriminant.sqrt();
    let fold = [2.0 / (-b + root), 2.0 / (-b - root)].into_iter().filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
    square < fold
}

fn radtan(&[k1, k2, p1, p2]: &[f64; 4], plane: &Vector2<f64>, square: f64) -> Vector2<f64> {
    let (x, y) = (plane.x, plane.y);
    let radial = 1.0 + square * (k1 + k2 * square);
    Vector2::new(
        x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
        y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y,
    )
}

fn radtan_jacobian(&[k1, k2, p1, p2]: &[f64; 4], plane: &Vector2<f64>, square: f64) -> Matrix2<f64> {
    let (x, y) = (plane.x, plane.y);
    let radial = 1.0 + square * (k1 + k2 * square);
    let slope = 2.0 * k1 + 4.0 * k2 * square;
    let mixed = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
    Matrix2::new(
        radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
        mixed,
        mixed,
        radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
    )
}

fn check_finite(coefficients: &[f64]) -> Result<(), CameraError> {
    match coefficients.iter().find(|value| !value.is_finite()) {
        Some(&value) => {
            Err(CameraError::Value { field: "an entry of distortion_coeffs", value, expected: "a finite number" })
        }
        None => Ok(()),
    }
}

/// Returns the point that `distort` maps to `distorted`; `distort` takes a point and its squared radius and returns the
/// distorted point with its derivative.
///
/// Newton's method from the distorted point, which lies on the near side of the solution for a barrel and on the convex
/// side for a pincushion, so that it approaches from one side.
#[inline]
fn invert(
    distorted: &Vector2<f64>,
    distort: impl Fn(&Vector2<f64>, f64) -> (Vector2<f64>, Matrix2<f64>),
    is_invertible: impl Fn(f64) -> bool,
) -> Option<Vector2<f64>> {
    let mut plane = *distorted;
    for _ in 0..MAXIMUM_STEPS {
        let square = plane.norm_squared();
        let (value, jacobian) = distort(&plane, square);
        let step = jacobian.try_inverse()? * (value - distorted);
        plane -= step;
        let size = step.norm();
        if !size.is_finite() {
            return None;
        }
        if size <= STEP_TOLERANCE * (1.0 + plane.norm()) {
            break;
        }
    }
    let square = plane.norm_squared();
    let mismatch = (distort(&plane, square).0 - distorted).norm();
    (mismatch <= MISMATCH_TOLERANCE * (1.0 + distorted.norm()) && is_invertible(square)).then_some(plane)
}

/// Distorted radius `r_d` and `d r_d / d θ`.
fn equidistant(&[k1, k2, k3, k4]: &[f64; 4], theta: f64) -> (f64, f64) {
    let s = theta * theta;
    let value = theta * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4))));
    let slope = 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * (7.0 * k3 + s * 9.0 * k4)));
    (value, slope)
}

/// Angle below a right angle with the given distorted value: Newton's method, kept inside a shrinking bracket.
fn undistort_angle(coefficients: &[f64; 4], distorted: f64) -> Option<f64> {
    let (mut low, mut high) = (0.0, std::f64::consts::FRAC_PI_2);
    let mut theta = distorted.min(0.9 * high);
    for _ in 0..2 * MAXIMUM_STEPS {
        let (value, slope) = equidistant(coefficients, theta);
        let mismatch = value - distorted;
        // Beyond the fold the polynomial falls again; the valid solution lies before it.
        if mismatch > 0.0 || slope <= 0.0 {
            high = theta;
        } else {
            low = theta;
        }
        let newton = theta - mismatch / slope;
        let next = if slope > 0.0 && newton > low && newton < high { newton } else { 0.5 * (low + high) };
        let step = (next - theta).abs();
        theta = next;
        if step <= STEP_TOLERANCE * (1.0 + theta) {
            break;
        }
    }
    let (value, slope) = equidistant(coefficients, theta);
    let converged = (value - distorted).abs() <= MISMATCH_TOLERANCE * (1.0 + distorted);
    (converged && slope > 0.0 && theta < std::f64::consts::FRAC_PI_2).then_some(theta)
}
