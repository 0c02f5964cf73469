//! Scale of the robust loss and the noise of observations, which follow the residuals of the window.

use crate::estimator::config::VisualLoss;
use crate::geometry::MEDIAN_PLANAR_LENGTH;
use crate::optimization::RobustLoss;

/// Scale of Cauchy's loss in standard deviations of the residuals: an error of one standard deviation keeps a weight of
/// 0.92. Narrower ones, such as 2.4 (an efficiency of 95 % under normal noise), lose more of the correct observations
/// than of the sliding ones.
const SCALE_IN_SIGMAS: f64 = 3.3;
/// Bounds of the scale, in standard deviations of a pixel: the largest is for a recording whose clocks, lens or shutter
/// are wrong, so that correct observations keep their weight.
const BOUNDS: [f64; 2] = [0.3, 1.0];
/// Smallest standard deviation of an observation relative to the standard deviation of the options. It is the scale of
/// the loss down to there: the errors of a track last as long as the track, so that several times its residuals count
/// as noise, as much on clean images as on others.
const LEAST_NOISE: f64 = 0.5;
/// Time constant with which the scale follows, in seconds.
const TIME_CONSTANT_S: f64 = 2.0;

/// Scale of the loss of one camera, in standard deviations of a pixel by the options.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LossScale(f64);

impl Default for LossScale {
    /// The upper bound: the first window has inaccurate values.
    fn default() -> Self {
        Self(BOUNDS[1])
    }
}

impl LossScale {
    /// Ratio of the standard deviation of the camera's observations to the standard deviation of the options.
    pub(crate) fn noise(self, option: VisualLoss) -> f64 {
        match option {
            VisualLoss::Adaptive => self.0.max(LEAST_NOISE),
            VisualLoss::Fixed(_) => 1.0,
        }
    }

    /// Losses of the camera's observations and of whole tracks, in standard deviations by [`Self::noise`].
    ///
    /// The loss of the tracks is nearly as narrow on clean images and fades out as the scale opens: with wrong clocks,
    /// lenses or shutters every track has residuals that do not average out.
    pub(crate) fn losses(self, option: VisualLoss) -> [RobustLoss; 2] {
        match option {
            VisualLoss::Adaptive => {
                let noise = self.noise(option);
                [RobustLoss::Cauchy(self.0 / noise), self.track_loss(noise)]
            }
            VisualLoss::Fixed(loss) => [loss, RobustLoss::None],
        }
    }

    fn track_loss(self, noise: f64) -> RobustLoss {
        let closed = 1.0 - (self.0 / BOUNDS[1]).powi(2);
        if closed > 0.0 { RobustLoss::Cauchy(self.0 / closed / noise) } else { RobustLoss::None }
    }

    /// Follows the median length of the residuals of a solved window, in standard deviations of a pixel, for an interval
    /// in seconds; ignores a value that is not finite (a window without observations).
    pub(crate) fn follow(&mut self, median_residual: f64, interval_s: f64) {
        if !median_residual.is_finite() {
            return;
        }
        let [lowest, highest] = BOUNDS;
        let wanted = (SCALE_IN_SIGMAS / MEDIAN_PLANAR_LENGTH * median_residual).clamp(lowest, highest);
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
        let [RobustLoss::Cauchy(in_sigmas), _] = scale.losses(VisualLoss::Adaptive) else {
            panic!("it is Cauchy's loss")
        };
        in_sigmas * scale.noise(VisualLoss::Adaptive)
    }

    #[test]
    fn the_scale_follows_the_residuals_slowly_and_within_its_bounds() {
        assert!((scale_after(20, 0.2) - 0.561).abs() < 1e-3, "{}", scale_after(20, 0.2));
        assert!(scale_after(1, 0.2) > 0.7, "{}", scale_after(1, 0.2));
        assert!((scale_after(20, 0.01) - BOUNDS[0]).abs() < 1e-3 && scale_after(20, 3.0) <= BOUNDS[1]);
    }

    #[test]
    fn whole_tracks_lose_weight_on_clean_images_only() {
        assert_eq!(LossScale::default().losses(VisualLoss::Adaptive), [RobustLoss::Cauchy(1.0), RobustLoss::None]);
        let [RobustLoss::Cauchy(narrow), RobustLoss::Cauchy(of_tracks)] = LossScale(0.4).losses(VisualLoss::Adaptive)
        else {
            panic!("both are Cauchy's loss")
        };
        assert!(of_tracks > narrow && of_tracks < 1.3 * narrow, "{narrow} and {of_tracks}");
    }

    #[test]
    fn observations_weigh_up_to_four_times_as_much_on_clean_images() {
        let noise = |scale: f64| LossScale(scale).noise(VisualLoss::Adaptive);
        assert_eq!([0.3, 0.5, 0.8, 1.0].map(noise), [0.5, 0.5, 0.8, 1.0]);
        assert_eq!(LossScale(0.3).noise(VisualLoss::Fixed(RobustLoss::None)), 1.0);
    }

    #[test]
    fn a_window_without_observations_and_a_fixed_loss_change_nothing() {
        assert!((scale_after(3, f64::NAN) - BOUNDS[1]).abs() < f64::EPSILON);
        let fixed = RobustLoss::Huber(1.5);
        assert_eq!(LossScale::default().losses(VisualLoss::Fixed(fixed)), [fixed, RobustLoss::None]);
    }
}
