//! Reprojection residuals by place in the image.

use std::collections::BTreeMap;

use nalgebra::Vector2;

use super::step::StepRecord;
use crate::estimator::{FeatureReport, ObservationReport, StepReport};

/// Smallest weight of a residual, so that no mean is one of zeros.
const MIN_WEIGHT: f64 = 1e-3;
/// Side of a block in pixels.
const BLOCK_PX: f64 = 16.0;

/// Weighted sums over residual vectors, each the prediction minus the measurement after the solve.
///
/// The weights are the robust ones of the solve: a few mistracked features do not determine a mean, and the mean of an
/// object whose residuals are all large is theirs, because their weights are alike.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ResidualSum {
    /// Number of residual vectors.
    pub count: usize,
    weight: f64,
    /// Sum of the vectors in pixels.
    sum_px: Vector2<f64>,
    /// Sum of their squared weighted lengths in square pixels.
    squares_px2: f64,
    along: AlongMotion,
}

/// Components of residuals along the motion of their features in the image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct AlongMotion {
    count: usize,
    weight: f64,
    sum_px: f64,
    squares_px2: f64,
}

/// Mean of a component of residuals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanResidual {
    pub mean_px: f64,
    /// Standard error of the mean in pixels, for independent residuals.
    pub error_px: f64,
    pub count: usize,
}

impl ResidualSum {
    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.weight += other.weight;
        self.sum_px += other.sum_px;
        self.squares_px2 += other.squares_px2;
        self.along.count += other.along.count;
        self.along.weight += other.along.weight;
        self.along.sum_px += other.along.sum_px;
        self.along.squares_px2 += other.along.squares_px2;
    }

    /// Mean vector in pixels; `None` without residuals.
    pub fn mean_px(&self) -> Option<Vector2<f64>> {
        (self.weight > 0.0).then(|| self.sum_px / self.weight)
    }

    /// Standard error in pixels of a component of the mean, for independent residuals.
    pub fn error_px(&self) -> f64 {
        if self.weight > 0.0 { (0.5 * self.squares_px2).sqrt() / self.weight } else { 0.0 }
    }
}

/// Sums of reprojection residuals by blocks of 16 × 16 pixels of the main camera's image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImageResiduals {
    /// By row and column of the block.
    blocks: BTreeMap<(u16, u16), ResidualSum>,
}

impl ImageResiduals {
    /// Residuals of all observations in the window of a step; empty if only the summary of the step is kept.
    pub fn of_window(report: &StepReport) -> Self {
        let mut residuals = Self::default();
        residuals.add_observations(report, |_| true);
        residuals
    }

    /// Residuals of a flight: for every image, the residuals in the step of this image.
    pub(super) fn of_steps<'a>(steps: impl Iterator<Item = &'a StepRecord>) -> Self {
        let mut residuals = Self::default();
        for step in steps {
            residuals.add_step(&step.report);
        }
        residuals
    }

    /// Adds the residuals of the newest image of a step.
    pub(super) fn add_step(&mut self, report: &StepReport) {
        self.add_observations(report, |observation| observation.frame_index == report.frame_index);
    }

    /// Adds the chosen observations of a window, each with the motion from the one before.
    fn add_observations(&mut self, report: &StepReport, is_chosen: impl Fn(&ObservationReport) -> bool) {
        for feature in used(report) {
            let mut before: Option<ObservationReport> = None;
            for observation in feature.observations.iter() {
                if is_chosen(&observation) {
                    self.add(&observation, before.as_ref());
                }
                before = Some(observation);
            }
        }
    }

    fn add(&mut self, observation: &ObservationReport, before: Option<&ObservationReport>) {
        let Some(residual_px) = observation.residual_after_px.filter(|it| it.norm().is_finite()) else { return };
        let motion_px = before.map(|before| observation.measured_px - before.measured_px);
        // A shorter motion has a random direction.
        let direction = motion_px.filter(|motion_px| motion_px.norm() > 1.0).map(|motion_px| motion_px.normalize());
        let weight = observation.robust_weight.clamp(MIN_WEIGHT, 1.0);
        let along = direction.map_or_else(AlongMotion::default, |direction| {
            let weighted_px = weight * direction.dot(&residual_px);
            AlongMotion { count: 1, weight, sum_px: weighted_px, squares_px2: weighted_px.powi(2) }
        });
        let sum_px = weight * residual_px;
        let one = ResidualSum { count: 1, weight, sum_px, squares_px2: sum_px.norm_squared(), along };
        let block = |uv_px: f64| (uv_px / BLOCK_PX).floor().clamp(0.0, f64::from(u16::MAX)) as u16;
        let place = (block(observation.measured_px.y), block(observation.measured_px.x));
        self.blocks.entry(place).or_default().add(&one);
    }

    /// Sum over all blocks.
    pub fn total(&self) -> ResidualSum {
        let mut total = ResidualSum::default();
        self.blocks.values().for_each(|sum| total.add(sum));
        total
    }

    /// Sums by cell of a grid over an image of `size_px`, row by row.
    pub fn grid(&self, size_px: [usize; 2], columns: usize, rows: usize) -> Vec<ResidualSum> {
        let mut cells = vec![ResidualSum::default(); columns * rows];
        for (center_px, sum) in self.centers() {
            let cell = |at: f64, size: usize, count: usize| ((at / size as f64 * count as f64) as usize).min(count - 1);
            let index = cell(center_px.y, size_px[1], rows) * columns + cell(center_px.x, size_px[0], columns);
            cells[index].add(sum);
        }
        cells
    }

    /// Mean radial component, positive away from `center_px`, by `bins` of the distance from it up to `reach_px`;
    /// `None` in bins without residuals.
    pub fn by_radius(&self, center_px: Vector2<f64>, reach_px: f64, bins: usize) -> Vec<Option<MeanResidual>> {
        let mut sums = vec![(ResidualSum::default(), 0.0); bins];
        for (block_px, sum) in self.centers() {
            let from_center = block_px - center_px;
            let radius_px = from_center.norm();
            if radius_px < BLOCK_PX || radius_px >= reach_px {
                // Within a block of the center the direction is undefined.
                continue;
            }
            let (total, radial) = &mut sums[(radius_px / reach_px * bins as f64) as usize];
            total.add(sum);
            *radial += from_center.dot(&sum.sum_px) / radius_px;
        }
        sums.iter()
            .map(|(sum, radial)| {
                let mean_px = radial / sum.weight.max(MIN_WEIGHT);
                (sum.count > 0).then(|| MeanResidual { mean_px, error_px: sum.error_px(), count: sum.count })
            })
            .collect()
    }

    /// Mean component along the motion of the features in the image, by `bins` of the image row; `None` in bins
    /// without moving features.
    pub fn by_row(&self, height_px: usize, bins: usize) -> Vec<Option<MeanResidual>> {
        let mut sums = vec![ResidualSum::default(); bins];
        for (center_px, sum) in self.centers() {
            let bin = (center_px.y / height_px as f64 * bins as f64) as usize;
            sums[bin.min(bins - 1)].add(sum);
        }
        let mean = |sum: &ResidualSum| {
            let AlongMotion { count, weight, sum_px, squares_px2 } = sum.along;
            (count > 0).then(|| MeanResidual { mean_px: sum_px / weight, error_px: squares_px2.sqrt() / weight, count })
        };
        sums.iter().map(mean).collect()
    }

    /// Blocks with their centers in pixels.
    fn centers(&self) -> impl Iterator<Item = (Vector2<f64>, &ResidualSum)> {
        let center = |block: u16| (f64::from(block) + 0.5) * BLOCK_PX;
        self.blocks.iter().map(move |((row, column), sum)| (Vector2::new(center(*column), center(*row)), sum))
    }
}

/// The features of the main camera that are not rejected.
fn used(report: &StepReport) -> impl Iterator<Item = &FeatureReport> {
    report.features.iter().filter(|feature| !feature.rejected && feature.id.camera() == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Residuals of a function of the position, on a lattice of features that move to the right.
    fn residuals_of(residual: impl Fn(Vector2<f64>) -> Vector2<f64>) -> ImageResiduals {
        let mut residuals = ImageResiduals::default();
        for row in 0..48 {
            for column in 0..64 {
                let measured_px = Vector2::new(10.0 * f64::from(column) + 5.0, 10.0 * f64::from(row) + 5.0);
                let observation = ObservationReport {
                    frame_index: 1,
                    measured_px,
                    residual_before_px: None,
                    residual_after_px: Some(residual(measured_px)),
                    chi2: 1.0,
                    robust_weight: 1.0,
                };
                let before = ObservationReport {
                    frame_index: 0,
                    measured_px: measured_px - Vector2::new(8.0, 0.0),
                    ..observation
                };
                residuals.add(&observation, Some(&before));
            }
        }
        residuals
    }

    #[test]
    fn a_wrong_focal_length_is_a_radial_slope() {
        let center_px = Vector2::new(320.0, 240.0);
        let residuals = residuals_of(|at| 0.002 * (at - center_px));
        let radial = residuals.by_radius(center_px, 400.0, 10);
        for (bin, mean) in radial.iter().enumerate().skip(1).take(7) {
            let expected = 0.002 * (bin as f64 + 0.5) * 40.0;
            let found = mean.unwrap().mean_px;
            assert!((found - expected).abs() < 0.2 * expected + 0.01, "bin {bin}: {found} for {expected}");
        }
        let cells = residuals.grid([640, 480], 4, 3);
        let [left, right] = [cells[4], cells[7]].map(|cell| cell.mean_px().unwrap().x);
        assert!(left < -0.2 && right > 0.2 && (left + right).abs() < 0.05, "{left} {right}");
        assert_eq!(residuals.total().count, 64 * 48);
        assert_eq!(cells.iter().map(|cell| cell.count).sum::<usize>(), 64 * 48);
    }

    #[test]
    fn a_wrong_readout_time_is_a_slope_over_the_rows() {
        let residuals = residuals_of(|at| Vector2::new(0.001 * (at.y - 240.0), 0.3));
        let rows = residuals.by_row(480, 6);
        let means: Vec<f64> = rows.iter().map(|mean| mean.unwrap().mean_px).collect();
        assert!(means.is_sorted() && means[0] < -0.15 && means[5] > 0.15, "{means:?}");
    }

    #[test]
    fn a_few_mistracked_features_do_not_determine_a_mean() {
        let mut residuals = ImageResiduals::default();
        for number in 0..20 {
            let (length_px, robust_weight) = if number < 2 { (5.0, 0.01) } else { (0.1, 1.0) };
            let observation = ObservationReport {
                frame_index: 1,
                measured_px: Vector2::new(100.0, 100.0),
                residual_before_px: None,
                residual_after_px: Some(Vector2::new(length_px, 0.0)),
                chi2: 1.0,
                robust_weight,
            };
            residuals.add(&observation, None);
        }
        let total = residuals.total();
        assert!((total.mean_px().unwrap().x - 0.1).abs() < 0.01, "{total:?}");
        assert!(total.error_px() < 0.03, "{total:?}");
    }

    #[test]
    fn residuals_without_a_direction_or_a_value_are_left_out() {
        let still = |residual_after_px| ObservationReport {
            frame_index: 1,
            measured_px: Vector2::new(100.0, 100.0),
            residual_before_px: None,
            residual_after_px,
            chi2: 0.0,
            robust_weight: 1.0,
        };
        let mut residuals = ImageResiduals::default();
        residuals.add(&still(None), None);
        residuals.add(&still(Some(Vector2::new(f64::NAN, 0.0))), None);
        assert_eq!(residuals.total().mean_px(), None);
        let observation = still(Some(Vector2::new(0.5, 0.0)));
        residuals.add(&observation, Some(&observation));
        assert_eq!(residuals.total().mean_px(), Some(Vector2::new(0.5, 0.0)));
        assert!(residuals.by_row(480, 4).iter().all(Option::is_none), "the feature does not move");
        assert!(
            residuals.grid([64, 48], 4, 3).iter().map(|cell| cell.count).sum::<usize>() == 1,
            "outside: at the edge"
        );
    }
}
