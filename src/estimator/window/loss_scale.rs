//! Scale of the robust loss, which follows the residuals of the window.

use crate::estimator::config::VisualLoss;
use crate::optimization::RobustLoss;

/// Scale of Cauchy's loss at which it is 95 % as accurate as least squares under normal noise, in standard deviations.
const EFFICIENT_SCALE: f64 = 2.385;
/// Median length of a normal error in two dimensions, in standard deviations of a coordinate.
const MEDIAN_LENGTH: f64 = 1.177_410_022_515_474_7;
/// Bounds of the scale, in standard deviations of a pixel: the largest is that of a recording whose clocks, lens or
/// shutter are wrong, so that correct observations keep their weight.
const BOUNDS: [f64; 2] = [0.2, 1.0];
/// Time constant with which the scale follows, in seconds.
const TIME_CONSTANT_S: f64 = 2.0;

/// Scale of the loss of one camera, in standard deviations of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LossScale(f64);

impl Default for LossScale {
    /// The upper bound: the first window has inaccurate values.
    fn default() -> Self {
        Self(BOUNDS[1])
    }
}

impl LossScale {
    /// Loss of the camera's observations and tracks.
    pub(crate) fn loss(self, option: VisualLoss) -> RobustLoss {
        match option {
            VisualLoss::Adaptive => RobustLoss::Cauchy(self.0),
            VisualLoss::Fixed(loss) => loss,
        }
    }

    /// Follows the median length of the residuals of a solved window, in standard deviations of a pixel, for an interval
    /// in seconds; ignores a value that is not finite (a window without observations).
    pub(crate) fn follow(&mut self, median_residual: f64, interval_s: f64) {
        if !median_residual.is_finite() {
            return;
        }
        let [lowest, highest] = BOUNDS;
        let wanted = (EFFICIENT_SCALE / MEDIAN_LENGTH * median_residual).clamp(lowest, highest);
        self.0 += (wanted - self.0) * (interval_s / TIME_CONSTANT_S).clamp(0.0, 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scale after some seconds of images at 20 Hz with this median residual.
    fn scale_after(seconds: usize, median_residual: f64) -> f64 {
        let mut scale = LossScale::default();
        (0..20 * seconds).for_each(|_| scale.follow(median_residual, 0.05));
        let RobustLoss::Cauchy(scale) = scale.loss(VisualLoss::Adaptive) else { panic!("it is Cauchy's loss") };
        scale
    }

    #[test]
    fn the_scale_follows_the_residuals_slowly_and_within_its_bounds() {
        assert!((scale_after(20, 0.2) - 0.405).abs() < 1e-3, "{}", scale_after(20, 0.2));
        assert!(scale_after(1, 0.2) > 0.7, "{}", scale_after(1, 0.2));
        assert!((scale_after(20, 0.01) - BOUNDS[0]).abs() < 1e-3 && scale_after(20, 3.0) <= BOUNDS[1]);
    }

    #[test]
    fn a_window_without_observations_and_a_fixed_loss_change_nothing() {
        assert!((scale_after(3, f64::NAN) - BOUNDS[1]).abs() < f64::EPSILON);
        let fixed = RobustLoss::Huber(1.5);
        assert_eq!(LossScale::default().loss(VisualLoss::Fixed(fixed)), fixed);
    }
}
