//! Reprojection residuals by length, in bins of equal ratio.

/// Number of bins of the lengths of residuals.
const BINS: usize = 40;
/// Shortest length with a bin of its own, in pixels.
const SHORTEST_PX: f64 = 0.01;
/// Bins per factor of two.
const BINS_PER_OCTAVE: f64 = 3.0;
/// Length of a residual in pixels at which an observation says nothing, as in a step without a window.
const LOST_PX: f64 = 8.0;

/// Numbers of reprojection residuals by length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::session) struct PixelHistogram([u32; BINS]);

impl Default for PixelHistogram {
    fn default() -> Self {
        Self([0; BINS])
    }
}

impl PixelHistogram {
    /// Counts a residual by its length in pixels; infinite for a point behind the camera.
    pub(in crate::session) fn add(&mut self, length_px: f64) {
        let octaves = (length_px / SHORTEST_PX).max(1.0).log2();
        self.0[((octaves * BINS_PER_OCTAVE) as usize).min(BINS - 1)] += 1;
    }

    /// Ratio of the residuals longer than a length in pixels, zero without residuals.
    pub(in crate::session) fn ratio_above(&self, length_px: f64) -> f64 {
        let above = self.0.iter().enumerate().filter(|(bin, _)| Self::length_px(*bin) > length_px);
        f64::from(above.map(|(_, count)| count).sum::<u32>()) / f64::from(self.count().max(1))
    }

    /// One residual at which an observation says nothing.
    pub(in crate::session) fn lost() -> Self {
        let mut histogram = Self::default();
        histogram.add(LOST_PX);
        histogram
    }

    pub(in crate::session) fn count(&self) -> u32 {
        self.0.iter().sum()
    }

    pub(in crate::session) fn merge(&mut self, other: &Self) {
        self.0.iter_mut().zip(other.0).for_each(|(count, more)| *count += more);
    }

    /// Length in the middle of a bin, in pixels.
    fn length_px(bin: usize) -> f64 {
        SHORTEST_PX * ((bin as f64 + 0.5) / BINS_PER_OCTAVE).exp2()
    }

    /// Median length in pixels, `None` without residuals.
    pub(in crate::session) fn median_px(&self) -> Option<f64> {
        let half = self.count().div_ceil(2);
        let mut below = 0;
        let bin = self.0.iter().position(|count| {
            below += count;
            below >= half && half > 0
        })?;
        Some(Self::length_px(bin))
    }

    /// Mean of −2·ln of Student's density in two dimensions with two degrees of freedom, without its constant, for a
    /// standard deviation of a coordinate in pixels; `None` without residuals.
    pub(in crate::session) fn mean_cost(&self, sigma_px: f64) -> Option<f64> {
        let cost = |bin: usize| 4.0 * (0.5 * (Self::length_px(bin) / sigma_px).powi(2)).ln_1p();
        let sum: f64 = self.0.iter().enumerate().map(|(bin, count)| f64::from(*count) * cost(bin)).sum();
        (self.count() > 0).then(|| sum / f64::from(self.count()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_histogram_has_the_median_and_a_cost_that_grows_with_the_residuals() {
        let mut near = PixelHistogram::default();
        let mut far = PixelHistogram::default();
        for number in 1..=101 {
            near.add(0.002 * f64::from(number));
            far.add(0.02 * f64::from(number));
        }
        far.add(f64::INFINITY);
        let median_px = near.median_px().unwrap();
        assert!((median_px / 0.102 - 1.0).abs() < 0.13, "{median_px}");
        let ratio = far.median_px().unwrap() / median_px;
        assert!((ratio / 10.0 - 1.0).abs() < 0.3, "{ratio}");
        assert!(far.mean_cost(0.1) > near.mean_cost(0.1));
        assert_eq!(PixelHistogram::default().mean_cost(0.1), None);
    }
}
