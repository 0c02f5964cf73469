//! Joint angle at a stamp, estimated from encoder readings around it, and its variance.

use nalgebra::{Matrix3, Vector3};

/// Seconds relative to the stamp, and the angle in radians, not wrapped.
pub(crate) type Reading = (f64, f64);

/// Estimated angle at the stamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FittedAngle {
    pub(crate) angle_rad: f64,
    pub(crate) rate_rad_per_s: f64,
    /// Variance from white noise of the readings and the prior on the acceleration.
    pub(crate) variance_rad2: f64,
    /// Variance of the rate, in rad²/s².
    pub(crate) rate_variance: f64,
    pub(crate) acceleration_rad_per_s2: f64,
    /// Variance of the acceleration, in rad²/s⁴.
    pub(crate) acceleration_variance: f64,
}

/// Standard deviation of a joint's acceleration.
///
/// A stabilized joint compensates the vehicle's rotation: an agile multirotor reaches 20 rad/s² and usually has about half
/// of that. Over ±25 ms this curves the angle by 0.06° on average, so that readings noisier than about 1° are in effect
/// fitted with a line (least variance), those finer than about 0.1° with a parabola (least bias).
const ACCELERATION_RAD_PER_S2: f64 = 10.0;

/// Estimates the angle at the stamp by a parabola through the readings: least squares with white noise of the given
/// variance on every reading and a prior of [`ACCELERATION_RAD_PER_S2`] on the acceleration.
///
/// It is the linear estimate with minimum mean square error for such a motion, and exact for a constant rate. Returns
/// `None` for readings at fewer than two stamps.
pub(crate) fn fit(readings: &[Reading], white_variance_rad2: f64) -> Option<FittedAngle> {
    if readings.len() < 2 {
        return None;
    }
    let parabola = Parabola::fit(readings, white_variance_rad2, Some(0.5 * ACCELERATION_RAD_PER_S2))?;
    let span_s = parabola.span_s;
    Some(FittedAngle {
        angle_rad: parabola.coefficients[0],
        rate_rad_per_s: parabola.coefficients[1] / span_s,
        variance_rad2: parabola.variances[0],
        rate_variance: parabola.variances[1] / span_s.powi(2),
        acceleration_rad_per_s2: 2.0 * parabola.coefficients[2] / span_s.powi(2),
        acceleration_variance: 4.0 * parabola.variances[2] / span_s.powi(4),
    })
}

/// Sum of squared residuals of the unregularized parabola through the readings in rad², and its degrees of freedom.
pub(crate) fn scatter(readings: &[Reading]) -> Option<(f64, usize)> {
    let freedom = readings.len().checked_sub(3).filter(|freedom| *freedom > 0)?;
    let parabola = Parabola::fit(readings, 1.0, None)?;
    Some((readings.iter().map(|reading| parabola.distance(reading).powi(2)).sum(), freedom))
}

struct Parabola {
    /// Coefficients of 1, u and u² with `u` the time over `span_s`.
    coefficients: Vector3<f64>,
    span_s: f64,
    variances: Vector3<f64>,
}

impl Parabola {
    /// Fits the coefficients; `curvature_sigma` is the prior standard deviation of the second-order coefficient, in
    /// rad/s².
    fn fit(readings: &[Reading], variance: f64, curvature_sigma: Option<f64>) -> Option<Self> {
        let span_s = readings.iter().map(|(time_s, _)| time_s.abs()).fold(0.0, f64::max);
        if span_s <= 0.0 || variance <= 0.0 {
            return None;
        }
        let mut normal = Matrix3::zeros();
        let mut right = Vector3::zeros();
        for (time_s, angle_rad) in readings {
            let u = time_s / span_s;
            let row = Vector3::new(1.0, u, u * u);
            normal += row * row.transpose();
            right += row * *angle_rad;
        }
        if let Some(sigma) = curvature_sigma {
            normal[(2, 2)] += variance / (sigma * span_s * span_s).powi(2);
        }
        let inverse = normal.cholesky()?.inverse();
        Some(Self { coefficients: inverse * right, span_s, variances: inverse.diagonal() * variance })
    }

    fn distance(&self, (time_s, angle_rad): &Reading) -> f64 {
        let u = time_s / self.span_s;
        angle_rad - self.coefficients.dot(&Vector3::new(1.0, u, u * u))
    }
}
