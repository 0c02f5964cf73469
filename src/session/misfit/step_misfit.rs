//! Residuals of a trial by sensor, and their comparison on one scale.
//!
//! The trials of a diagnosis use the same measurements, so their likelihoods can be compared. A step contributes the
//! χ² of the factors of its window and a cost of its reprojection residuals by Student's distribution, whose scale is that
//! of the best trial: pixel noise is unknown, and a change that leaves larger residuals must not widen its own scale.
//! Windows overlap; sums over the steps are divided by the number of steps in a window.

use super::pixel_histogram::PixelHistogram;
use crate::estimator::{FactorKind, StepReport};
use crate::faults::ImageHalf;
use crate::geometry::{MEDIAN_PLANAR_LENGTH, seconds_from_ns};
use crate::text::Named as _;

/// χ² of the factors of one kind, and the number of their rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::session) struct FactorMisfit {
    pub(in crate::session) chi2: f64,
    pub(in crate::session) rows: f64,
}

impl FactorMisfit {
    /// χ² per row, zero without rows.
    pub(in crate::session) fn mean_square(self) -> f64 {
        if self.rows > 0.0 { self.chi2 / self.rows } else { 0.0 }
    }

    fn add(&mut self, other: Self) {
        self.chi2 += other.chi2;
        self.rows += other.rows;
    }
}

/// Kinds of factors in the order of [`StepMisfit::factors`].
pub(in crate::session) const FACTORS: [FactorKind; 3] =
    [FactorKind::Imu, FactorKind::Encoder, FactorKind::MarginalizationPrior];

/// Residuals of one step.
#[derive(Clone, Debug, Default)]
pub(in crate::session) struct StepMisfit {
    pub(in crate::session) stamp_ns: i64,
    /// True if there is a window.
    pub(in crate::session) tracking: bool,
    pub(in crate::session) pixels: PixelHistogram,
    /// In the order of [`FACTORS`].
    pub(in crate::session) factors: [FactorMisfit; 3],
    /// χ² of the rig's prior on the calibration.
    pub(in crate::session) calibration: f64,
    /// Residuals outside each half of the image, in the order of [`ImageHalf::NAMES`]; `None` unless they were asked for.
    pub(in crate::session) outside: Option<Box<[PixelHistogram; 4]>>,
    /// Features tracked from the previous image, and those that the solve accepted.
    pub(in crate::session) features: usize,
    pub(in crate::session) inliers: usize,
    /// Length of the window in seconds.
    pub(in crate::session) window_s: f64,
    /// Number of frames in the window.
    pub(in crate::session) frames: usize,
}

impl StepMisfit {
    /// Residuals of a step whose pixels are `pixel_scale` times the pixels of the image; `features` is the number of features
    /// that the main camera tracked from the previous image. With the image size of that camera the residuals outside each
    /// half of the image are counted, too.
    pub(in crate::session) fn of(
        report: &StepReport,
        features: usize,
        pixel_scale: f64,
        resolution_px: Option<[usize; 2]>,
    ) -> Self {
        let mut pixels = PixelHistogram::default();
        let mut outside = resolution_px.map(|_| Box::new([PixelHistogram::default(); 4]));
        for feature in &report.features {
            // A landmark takes three of the dimensions of its observations, more of a short track's.
            let count = feature.observations.len().max(2) as f64;
            let left = (1.0 - 1.5 / count).sqrt() * pixel_scale;
            for observation in feature.observations.iter() {
                let length_px = observation.residual_after_px.map_or(f64::INFINITY, |it| it.norm() / left);
                pixels.add(length_px);
                if let (Some(resolution_px), Some(outside)) = (resolution_px, &mut outside) {
                    for (half, histogram) in ImageHalf::all().zip(outside.iter_mut()) {
                        if !half.contains(&observation.measured_px, resolution_px) {
                            histogram.add(length_px);
                        }
                    }
                }
            }
        }
        let calibration = report.residuals.iter().find(|summary| summary.factor == FactorKind::CalibrationPrior);
        let calibration = calibration.map_or(0.0, |summary| summary.chi2_after);
        let factors = FACTORS.map(|kind| {
            let summary = report.residuals.iter().find(|summary| summary.factor == kind);
            summary.map_or_else(FactorMisfit::default, |it| FactorMisfit { chi2: it.chi2_after, rows: it.count as f64 })
        });
        let window_s = match (report.window.first(), report.window.last()) {
            (Some(first), Some(last)) => seconds_from_ns(last.stamp_ns - first.stamp_ns),
            _ => 0.0,
        };
        let frames = report.window.len();
        Self {
            stamp_ns: report.stamp_ns,
            tracking: frames > 0,
            pixels,
            factors,
            calibration,
            outside,
            features,
            inliers: report.counts.inliers(),
            window_s,
            frames,
        }
    }
}

/// Scale on which trials are compared, from the best one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::session) struct Scale {
    /// Standard deviation of a coordinate of an observation.
    pub(in crate::session) sigma_px: f64,
    /// Observations and frames in a window.
    pub(in crate::session) observations: f64,
    pub(in crate::session) frames: f64,
    /// Rows of the factors of a window, in the order of [`FACTORS`].
    pub(in crate::session) rows: [f64; 3],
    /// Number of windows without common frames in the scored steps.
    pub(in crate::session) windows: f64,
}

impl Scale {
    /// Observations and rows of a reference, for steps over a time in nanoseconds.
    pub(in crate::session) fn of(reference: &Misfit, sigma_px: f64, length_ns: i64) -> Self {
        let tracked = reference.tracked.max(1) as f64;
        Self {
            sigma_px,
            observations: reference.observations(),
            frames: reference.frames as f64 / tracked,
            rows: reference.factors.map(|factor| factor.rows / tracked),
            windows: (seconds_from_ns(length_ns) / reference.window_s.max(0.5)).max(1.0),
        }
    }
}

/// Averages over the scored steps of a trial.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::session) struct Misfit {
    pub(in crate::session) pixels: PixelHistogram,
    /// In the order of [`FACTORS`].
    pub(in crate::session) factors: [FactorMisfit; 3],
    /// Mean χ² of the rig's prior on the calibration.
    pub(in crate::session) calibration: f64,
    /// Residuals outside each half of the image, in the order of [`ImageHalf::NAMES`].
    pub(in crate::session) outside: [PixelHistogram; 4],
    /// Sums of features and inliers over the steps with a window.
    pub(in crate::session) features: usize,
    pub(in crate::session) inliers: usize,
    /// Frames of all windows.
    pub(in crate::session) frames: usize,
    /// Steps with a window and all scored steps.
    pub(in crate::session) tracked: usize,
    pub(in crate::session) steps: usize,
    /// Mean length of the window in seconds.
    pub(in crate::session) window_s: f64,
}

/// Time after an initialization that is not scored: the values of the first window are inaccurate.
const SETTLING_NS: i64 = 1_000_000_000;
/// Upper bound of the mean squared residual of a kind of factor: a larger one says no more.
const LARGEST_MEAN_SQUARE: f64 = 25.0;
/// Lowest standard deviation of an observation, in pixels.
const LEAST_SIGMA_PX: f64 = 0.03;

impl Misfit {
    /// Averages over all of some steps.
    pub(in crate::session) fn of_all(steps: &[StepMisfit]) -> Self {
        let mut found = Self { steps: steps.len(), ..Self::default() };
        steps.iter().filter(|step| step.tracking).for_each(|step| found.add(step));
        found.average();
        found
    }

    /// Averages over the steps from `from_ns` on, without those soon after an initialization.
    pub(in crate::session) fn of(steps: &[StepMisfit], from_ns: i64) -> Self {
        let mut found = Self::default();
        let mut began_ns = None;
        for step in steps {
            if !step.tracking {
                began_ns = None;
                // A trial that begins a little later than others has lost nothing.
                found.steps += usize::from(step.stamp_ns >= from_ns + SETTLING_NS);
                continue;
            }
            let began_ns = *began_ns.get_or_insert(step.stamp_ns);
            if step.stamp_ns < from_ns + SETTLING_NS || step.stamp_ns < began_ns + SETTLING_NS {
                continue;
            }
            found.steps += 1;
            found.add(step);
        }
        found.average();
        found
    }

    fn average(&mut self) {
        let count = self.tracked.max(1) as f64;
        self.window_s /= count;
        self.calibration /= count;
    }

    fn add(&mut self, step: &StepMisfit) {
        self.tracked += 1;
        self.pixels.merge(&step.pixels);
        self.factors.iter_mut().zip(step.factors).for_each(|(sum, more)| sum.add(more));
        if let Some(outside) = &step.outside {
            self.outside.iter_mut().zip(outside.iter()).for_each(|(sum, more)| sum.merge(more));
        }
        self.window_s += step.window_s;
        self.features += step.features;
        // Features that are new in this image may be more than those that are lost.
        self.inliers += step.inliers.min(step.features);
        self.calibration += step.calibration;
        self.frames += step.frames;
    }

    /// Ratio of the scored steps with a window.
    pub(in crate::session) fn tracked_ratio(&self) -> f64 {
        self.tracked as f64 / self.steps.max(1) as f64
    }

    /// Median length of the reprojection residuals in pixels, `None` without a window.
    pub(in crate::session) fn median_px(&self) -> Option<f64> {
        self.pixels.median_px()
    }

    /// Standard deviation of a coordinate of an observation by the median residual, in pixels.
    pub(in crate::session) fn sigma_px(&self) -> Option<f64> {
        self.median_px().map(|median_px| (median_px / MEDIAN_PLANAR_LENGTH).max(LEAST_SIGMA_PX))
    }

    /// Observations in a window, on average.
    pub(in crate::session) fn observations(&self) -> f64 {
        f64::from(self.pixels.count()) / self.tracked.max(1) as f64
    }

    /// −2·ln of the likelihood of the measurements of all windows, up to a constant that is common to the trials.
    pub(in crate::session) fn cost(&self, scale: &Scale) -> f64 {
        // All windows have the same calibration, and its prior once.
        self.calibration + scale.windows * self.parts(scale).iter().sum::<f64>()
    }

    /// The same by sensor and for one window: images, then [`FACTORS`].
    pub(in crate::session) fn parts(&self, scale: &Scale) -> [f64; 4] {
        let tracked = self.tracked_ratio();
        let blind = 1.0 - tracked;
        let visual = visual_cost(&self.pixels, scale);
        // Rows of IMU and encoders grow with the number of frames, rows of the prior do not.
        let of_steps = 1.0 / self.tracked.max(1) as f64;
        let of_frames = scale.frames / self.frames.max(1) as f64;
        let part = |index: usize, share: f64| {
            let factor = self.factors[index];
            let chi2 = share * factor.chi2.min(LARGEST_MEAN_SQUARE * factor.rows);
            tracked * chi2 + blind * LARGEST_MEAN_SQUARE * scale.rows[index]
        };
        let blind_visual = visual_cost(&PixelHistogram::lost(), scale);
        [
            scale.observations * (tracked * visual + blind * blind_visual),
            part(0, of_frames),
            part(1, of_frames),
            part(2, of_steps),
        ]
    }

    /// Decrease of the mean cost of an observation outside a half of the image from `given` to this trial, which does not
    /// use that half, times the observations there.
    pub(in crate::session) fn gain_outside(&self, given: &Self, half: ImageHalf, scale: &Scale) -> f64 {
        let place = ImageHalf::all().position(|known| known == half).unwrap_or_default();
        let (before, after) = (&given.outside[place], &self.outside[place]);
        let ratio = f64::from(before.count()) / f64::from(given.pixels.count().max(1));
        scale.observations * ratio * (visual_cost(before, scale) - visual_cost(after, scale))
    }
}

/// Mean cost of an observation; the cost of a lost observation without any.
fn visual_cost(pixels: &PixelHistogram, scale: &Scale) -> f64 {
    let lost = PixelHistogram::lost().mean_cost(scale.sigma_px).unwrap_or_default();
    pixels.mean_cost(scale.sigma_px).map_or(lost, |cost| cost.min(lost))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(stamp_s: f64, tracking: bool, length_px: f64) -> StepMisfit {
        let mut step = StepMisfit {
            stamp_ns: (stamp_s * 1e9) as i64,
            tracking,
            window_s: 2.0,
            frames: 11,
            ..StepMisfit::default()
        };
        if tracking {
            (0..100).for_each(|_| step.pixels.add(length_px));
            step.factors[0] = FactorMisfit { chi2: 80.0, rows: 150.0 };
        }
        step
    }

    #[test]
    fn a_trial_without_a_window_costs_more_than_any_other() {
        let scale = Scale { sigma_px: 0.1, observations: 100.0, frames: 11.0, rows: [150.0, 0.0, 0.0], windows: 3.0 };
        let steps = |length_px: f64, until_s: f64| -> Vec<StepMisfit> {
            (0..120).map(|number| 0.05 * f64::from(number)).map(|at_s| step(at_s, at_s < until_s, length_px)).collect()
        };
        let costs: Vec<f64> = [steps(0.1, 9.0), steps(0.3, 9.0), steps(0.3, 3.0), steps(0.3, 0.0)]
            .iter()
            .map(|steps| Misfit::of(steps, 0).cost(&scale))
            .collect();
        assert!(costs.windows(2).all(|pair| pair[0] < pair[1]), "{costs:?}");
        let misfit = Misfit::of(&steps(0.1, 9.0), 0);
        assert_eq!((misfit.tracked, misfit.steps, misfit.observations()), (100, 100, 100.0));
        assert_eq!(misfit.window_s, 2.0);
        assert!((misfit.factors[0].mean_square() - 80.0 / 150.0).abs() < 1e-12);
    }
}
