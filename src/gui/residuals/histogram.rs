use crate::estimator::StepReport;

/// Histogram of one step's reprojection residuals, both image axes together.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ResidualHistogram {
    /// Half the range in pixels: bins run from −`reach_px` to +`reach_px`.
    pub(crate) reach_px: f64,
    /// Counts before the solve.
    pub(crate) before: Vec<usize>,
    /// Counts after the solve.
    pub(crate) after: Vec<usize>,
    /// Number of residuals after the solve outside the range.
    pub(crate) outside: usize,
    /// Mean of the residuals after the solve, by image axis, in pixels.
    pub(crate) mean_px: [f64; 2],
    /// Median length of the residual vectors after the solve, in pixels.
    pub(crate) median_px: f64,
    /// 95th percentile of the lengths of the residual vectors after the solve, in pixels.
    pub(crate) p95_px: f64,
    /// Number of residual vectors after the solve.
    pub(crate) observations: usize,
    /// Number of observations whose robust weight is below one half.
    pub(crate) downweighted: usize,
    /// Number of features rejected as outliers.
    pub(crate) rejected: usize,
}

/// Number of bins; odd, so that one is centred at zero.
const BINS: usize = 41;

impl ResidualHistogram {
    pub(crate) fn of(report: &StepReport) -> Self {
        let observations = || report.features.iter().flat_map(|feature| feature.observations.iter());
        let after: Vec<_> =
            observations().filter_map(|one| one.residual_after_px).filter(|r| r.norm().is_finite()).collect();
        let before: Vec<_> =
            observations().filter_map(|one| one.residual_before_px).filter(|r| r.norm().is_finite()).collect();
        let mut lengths: Vec<f64> = after.iter().map(|residual| residual.norm()).collect();
        lengths.sort_by(f64::total_cmp);
        let quantile = |fraction: f64| {
            let last = lengths.len().checked_sub(1)?;
            lengths.get((fraction * last as f64).round() as usize).copied()
        };
        let p95_px = quantile(0.95).unwrap_or(f64::NAN);
        let reach_px = round_up(4.0 * quantile(0.5).unwrap_or(1.0));
        let bin = |value: f64| {
            let place = ((value / reach_px + 1.0) * 0.5 * BINS as f64).floor();
            (place >= 0.0 && place < BINS as f64).then_some(place as usize)
        };
        let mut histogram = Self {
            reach_px,
            before: vec![0; BINS],
            after: vec![0; BINS],
            median_px: quantile(0.5).unwrap_or(f64::NAN),
            p95_px,
            observations: after.len(),
            downweighted: observations()
                .filter(|one| one.residual_after_px.is_some() && one.robust_weight < 0.5)
                .count(),
            rejected: report.features.iter().filter(|feature| feature.rejected).count(),
            ..Self::default()
        };
        for value in before.iter().flat_map(|residual| [residual.x, residual.y]) {
            if let Some(bin) = bin(value) {
                histogram.before[bin] += 1;
            }
        }
        for value in after.iter().flat_map(|residual| [residual.x, residual.y]) {
            match bin(value) {
                Some(bin) => histogram.after[bin] += 1,
                None => histogram.outside += 1,
            }
        }
        let count = after.len().max(1) as f64;
        histogram.mean_px =
            [after.iter().map(|r| r.x).sum::<f64>() / count, after.iter().map(|r| r.y).sum::<f64>() / count];
        histogram
    }
}

/// The next of 1, 2, 3, 5, 10, … at or above a length, so that the axis does not change with every frame.
pub(super) fn round_up(length: f64) -> f64 {
    let length = if length.is_finite() { length.clamp(1e-3, 1e6) } else { 1.0 };
    let power = 10_f64.powf(length.log10().floor());
    [1.0, 2.0, 3.0, 5.0].into_iter().map(|digit| digit * power).find(|reach| *reach >= length).unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::ObservationReport;
    use crate::gui::samples::sample_recording_of;

    #[test]
    fn every_residual_is_counted_once() {
        let recording = sample_recording_of(80, &["auto"]);
        let report = &recording.runs[0].steps[79].report;
        let histogram = ResidualHistogram::of(report);
        let counted = histogram.after.iter().sum::<usize>() + histogram.outside;
        assert!(histogram.observations > 100);
        assert_eq!(counted, 2 * histogram.observations);
        assert!(histogram.median_px < histogram.p95_px && histogram.median_px < histogram.reach_px);
        assert_eq!(histogram.rejected, report.features.iter().filter(|feature| feature.rejected).count());
    }

    #[test]
    fn empty_and_invalid_reports_are_accepted() {
        let recording = sample_recording_of(60, &["auto"]);
        let mut report = recording.runs[0].steps[59].report.clone();
        for feature in &mut report.features {
            let spoilt = Some(nalgebra::Vector2::new(f64::NAN, 1.0));
            feature.observations = feature
                .observations
                .iter()
                .map(|observation| ObservationReport { residual_after_px: spoilt, ..observation })
                .collect();
        }
        assert_eq!(ResidualHistogram::of(&report).observations, 0);
        report.features.clear();
        assert_eq!(ResidualHistogram::of(&report).after.iter().sum::<usize>(), 0);
        assert_eq!(round_up(0.31), 0.5);
        assert_eq!(round_up(7.0), 10.0);
        assert_eq!(round_up(f64::NAN), 1.0);
    }
}
