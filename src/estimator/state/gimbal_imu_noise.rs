//! Noise of the IMU on the gimbal relative to the noise of the rig, measured by its residuals.
//!
//! A gimbal's servos shake the IMU at frequencies that may be beyond half its sample rate; without a filter they are
//! aliased to slow errors that no model of white noise contains. A residual after the solve has a variance of
//! `K² s² / (s² + c)`: K² is the true variance relative to the rig's, s the factor in use, and `s² / (s² + c)` the part
//! that the solve does not fit; c is the ratio of the information of a consistent IMU to the information of all else.

use nalgebra::Vector3;

use super::navigation::Matrix15;

/// Factor before the first residuals: they are then nearly the errors of the IMU, and an IMU that is shaken does no harm
/// in the first window.
const FIRST: f64 = 30.0;
/// Ratio c of gyroscope and accelerometer, measured on simulated flights.
const FITTED: [f64; 2] = [0.7, 3.0];
/// Time constant with which the factors follow, in seconds.
const TIME_CONSTANT_S: f64 = 2.0;

/// Squared residuals by axis of the IMU, in variances of the rig: of gyroscope and accelerometer.
pub(crate) type AxisSquares = [Vector3<f64>; 2];

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct GimbalImuNoise {
    /// Mean variances relative to the rig's, and the time over which they are averaged in seconds.
    variances: AxisSquares,
    averaged_s: f64,
}

impl GimbalImuNoise {
    /// The rig's noise, for predictions.
    pub(crate) const OF_RIG: Self = Self { variances: [Vector3::new(1.0, 1.0, 1.0); 2], averaged_s: TIME_CONSTANT_S };

    /// Square-root information of `[φ, p, v, b_g, b_a]` with this noise from the one with the rig's.
    pub(crate) fn scaled(&self, information: &Matrix15) -> Matrix15 {
        let mut scaled = *information;
        let [gyroscope, accelerometer] = self.factors();
        for (rows, factors) in [gyroscope, accelerometer, accelerometer].into_iter().enumerate() {
            for axis in 0..3 {
                scaled.column_mut(3 * rows + axis).scale_mut(factors[axis].recip());
            }
        }
        scaled
    }

    /// Follows the mean squared residuals of a solved window for an interval in seconds.
    pub(crate) fn follow(&mut self, squares: &AxisSquares, interval_s: f64) {
        let factors = self.factors();
        self.averaged_s = (self.averaged_s + interval_s).min(TIME_CONSTANT_S.max(interval_s));
        let ratio = interval_s / self.averaged_s;
        for (((variances, factors), squares), fitted) in self.variances.iter_mut().zip(factors).zip(squares).zip(FITTED)
        {
            for axis in 0..3 {
                let variance = squares[axis] * (1.0 + fitted / factors[axis].powi(2));
                if variance.is_finite() {
                    variances[axis] += (variance - variances[axis]) * ratio;
                }
            }
        }
    }

    /// Largest variance of an axis relative to the rig's; `None` before the first residuals.
    pub(crate) fn largest_variance(&self) -> Option<f64> {
        let largest = self.variances.iter().map(Vector3::max).fold(0.0, f64::max);
        (self.averaged_s > 0.0).then_some(largest)
    }

    /// Factors of the standard deviations of gyroscope and accelerometer by axis of the IMU, at least 1.
    pub(crate) fn factors(&self) -> [Vector3<f64>; 2] {
        if self.averaged_s == 0.0 {
            return [Vector3::repeat(FIRST); 2];
        }
        self.variances.map(|variances| variances.map(|variance| variance.max(1.0).sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Factor of the first axis of the gyroscope after some seconds in which the errors are `ratio` times the rig's noise,
    /// and a solve fits the part of them that the model assumes.
    fn factor_after(seconds: usize, ratio: f64) -> f64 {
        let mut noise = GimbalImuNoise::default();
        for _ in 0..20 * seconds {
            let fitted = |sensor: usize| {
                noise.factors()[sensor].map(|factor| ratio.powi(2) / (1.0 + FITTED[sensor] / factor.powi(2)))
            };
            noise.follow(&[fitted(0), fitted(1)], 0.05);
        }
        noise.factors()[0].x
    }

    #[test]
    fn the_factor_is_the_ratio_of_the_errors_and_never_below_one() {
        assert!((factor_after(10, 20.0) - 20.0).abs() < 0.1, "{}", factor_after(10, 20.0));
        assert!((factor_after(10, 2.0) - 2.0).abs() < 0.1, "{}", factor_after(10, 2.0));
        assert!((factor_after(10, 0.1) - 1.0).abs() < f64::EPSILON);
        assert!(GimbalImuNoise::default().factors()[0].x > 10.0, "nothing is known before the first residuals");
    }

    #[test]
    fn the_rigs_noise_leaves_the_information_as_it_is() {
        let information = Matrix15::from_fn(|row, column| (row + 2 * column) as f64);
        assert_eq!(GimbalImuNoise::OF_RIG.scaled(&information), information);
        let scaled = GimbalImuNoise::default().scaled(&information);
        assert_eq!(scaled[(4, 8)], information[(4, 8)] * FIRST.recip());
        assert_eq!(scaled[(4, 9)], information[(4, 9)], "the walk of the biases stays");
    }
}
