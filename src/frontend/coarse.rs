//! Camera rotation between two images from the coarsest levels of the pyramid.
//!
//! The tracker starts from a predicted rotation, whose error may be tens of pixels where encoders are poor.
//! It is used when its covariance is small and the images fit better under it than under no rotation.
//! Otherwise the rotation is measured: the coarse images are aligned by robust Gauss–Newton on the rotation, a gain and an
//! offset, starting from the prediction and from no rotation.
//! The method follows the small blurry image of PTAM (Klein and Murray, "Improving the agility of keyframe-based SLAM",
//! ECCV 2008).
//!
//! With the grey levels `I` and `I'` of the previous and of the current image, the projection `π` and the bearing `f` of a
//! pixel `x` the cost is `Σ ρ(r/s)`, `r = I'(π(R f)) − a I(x) − b`, with the Geman–McClure loss
//! `ρ(u) = u²/(1 + u²)`. The step is inverse compositional (Baker and Matthews, "Lucas–Kanade 20 years on", IJCV 2004): the derivative
//! `∇I ∂π/∂f (−[f]×)` of the previous image by `φ` does not depend on `R`, and `R ← R Exp(−φ)`.

use nalgebra::{Matrix2x3, Matrix3, Matrix5, RowVector2, UnitQuaternion, Vector2, Vector3, Vector5};

use super::epipolar::geman_mcclure;
use super::prediction::PredictedRotation;
use super::pyramid::Pyramid;
use crate::camera::CameraModel;
use crate::geometry::so3;
use crate::optimization::damp;
use crate::sensors::GrayImage;

/// Pyramid levels in addition to the levels of the tracker: an image of 640 pixels is then 40 pixels wide.
pub(super) const EXTRA_LEVELS: usize = 1;
/// A prediction with a smaller standard deviation is used unchanged, in pixels: the tracker converges from that distance.
const ACCURATE_SIGMA_PX: f64 = 6.0;
/// Maximum number of samples on a level; more do not improve the result.
const MAX_SAMPLES: usize = 1200;
/// Number of independent grey-level measurements assumed for all samples together: neighbouring samples are correlated,
/// and near objects move differently.
const INDEPENDENT_SAMPLES: f64 = 100.0;
/// Scale of the robust loss: this ratio of the image's contrast (its standard deviation), at least this many grey levels.
const SCALE_RATIO: f64 = 0.5;
const MIN_SCALE: f64 = 4.0;
/// Minimum contrast of an image, in grey levels.
const MIN_CONTRAST: f64 = 2.0;
/// Cost of a sample outside the other image; an exact match costs 0, an outlier nearly 1.
const OUTSIDE_COST: f64 = 0.5;
/// A prediction is rejected if its cost exceeds the cost without a rotation by this.
const WORSE_BY: f64 = 0.02;
/// Gauss–Newton steps on each level, coarsest first.
const STEPS: [usize; 2] = [10, 5];
/// Length of a step that ends the search, in pixels of the level.
const SHORT_STEP_PX: f64 = 0.03;

#[derive(Clone, Copy, Debug)]
struct Sample {
    x: usize,
    y: usize,
    /// Unit direction in the camera frame.
    bearing: Vector3<f64>,
    /// Derivative of the pixel by a rotation of the bearing (2 × 3), in pixels of the level per radian.
    by_rotation: Matrix2x3<f64>,
}

#[derive(Clone, Debug)]
struct SampledLevel {
    level: usize,
    samples: Vec<Sample>,
}

/// Aligns two images on their coarsest levels by a rotation.
#[derive(Clone, Debug)]
pub(super) struct CoarseAligner {
    camera: CameraModel,
    /// Coarsest first; empty before the first image.
    levels: Vec<SampledLevel>,
}

/// Rotation with gain and offset of the brightness, and the cost.
#[derive(Clone, Copy)]
struct Fit {
    /// Rotation `R` = `camera_now_from_camera_previous`.
    rotation: UnitQuaternion<f64>,
    gain: f64,
    offset: f64,
    cost: f64,
}

impl CoarseAligner {
    pub(super) fn new(camera: CameraModel) -> Self {
        Self { camera, levels: Vec::new() }
    }

    /// Rotation `camera_now_from_camera_previous` with which features are predicted: the prediction if it is accurate,
    /// otherwise the rotation measured on the images; `None` without either.
    pub(super) fn search_rotation(
        &mut self,
        previous: &Pyramid,
        now: &Pyramid,
        predicted: Option<&PredictedRotation>,
    ) -> Option<UnitQuaternion<f64>> {
        let fallback = predicted.map(|predicted| predicted.rotation);
        self.sample_levels(previous);
        let Some(coarsest) = self.levels.first() else { return fallback };
        let Some(view) = View::new(&self.camera, coarsest, previous, now, predicted) else { return fallback };
        let identity = UnitQuaternion::identity();
        let unrotated_levels = view.observe(&identity);
        let unrotated = view.fit_brightness(&identity, &unrotated_levels);
        let mut starts = vec![unrotated];
        let mut prior = predicted;
        if let Some(predicted) = predicted {
            let expected_levels = view.observe(&predicted.rotation);
            let expected = view.fit_brightness(&predicted.rotation, &expected_levels);
            let consistent =
                view.misfit(&expected, &expected_levels) <= view.misfit(&unrotated, &unrotated_levels) + WORSE_BY;
            if consistent && predicted.sigma_rad() * self.camera.focal_length_px() <= ACCURATE_SIGMA_PX {
                return fallback;
            }
            if !consistent && predicted.sigma_rad() * self.camera.focal_length_px() <= ACCURATE_SIGMA_PX {
                // The prediction is inconsistent with the images: its covariance is not used.
                prior = None;
            }
            starts.push(expected);
        }
        let mut best: Option<Fit> = None;
        for (sampled, steps) in self.levels.iter().zip(STEPS) {
            let Some(view) = View::new(&self.camera, sampled, previous, now, prior) else { break };
            best = starts
                .iter()
                .map(|start| view.gauss_newton(start, steps))
                .fold(None, |best: Option<Fit>, fit| best.filter(|best| best.cost <= fit.cost).or(Some(fit)));
            starts = best.into_iter().collect();
        }
        best.map(|fit| fit.rotation).or(fallback)
    }

    /// Selects the samples for the size of the levels.
    fn sample_levels(&mut self, pyramid: &Pyramid) {
        let count = pyramid.levels().len();
        let first = count.saturating_sub(STEPS.len()).max(1);
        if !self.levels.is_empty() || count < 2 {
            return;
        }
        for level in (first..count).rev() {
            let image = &pyramid.levels()[level];
            let stride = ((image.width * image.height) as f64 / MAX_SAMPLES as f64).sqrt().ceil().max(1.0) as usize;
            let scale = f64::from(1_u32 << level);
            let mut samples = Vec::new();
            for y in (1..image.height.saturating_sub(1)).step_by(stride) {
                for x in (1..image.width.saturating_sub(1)).step_by(stride) {
                    let Some(bearing) = self.camera.unproject(&(Vector2::new(x as f64, y as f64) * scale)) else {
                        continue;
                    };
                    if let Some((_, by_point)) = self.camera.project_with_jacobian(&bearing) {
                        samples.push(Sample { x, y, bearing, by_rotation: by_point * -so3::hat(&bearing) / scale });
                    }
                }
            }
            self.levels.push(SampledLevel { level, samples });
        }
    }
}

/// Samples, images and prior on one level.
struct View<'a> {
    camera: &'a CameraModel,
    samples: &'a [Sample],
    previous: &'a GrayImage,
    now: &'a GrayImage,
    /// Pixels of the image per pixel of the level.
    scale_px: f64,
    /// Scale of the robust loss, in grey levels.
    scale: f64,
    /// Expected rotation and its information.
    prior: Option<(UnitQuaternion<f64>, Matrix3<f64>)>,
}

impl<'a> View<'a> {
    /// Returns `None` if an image has too little contrast.
    fn new(
        camera: &'a CameraModel,
        sampled: &'a SampledLevel,
        previous: &'a Pyramid,
        now: &'a Pyramid,
        prior: Option<&PredictedRotation>,
    ) -> Option<Self> {
        let (previous, now) = (previous.levels().get(sampled.level)?, now.levels().get(sampled.level)?);
        let samples = &sampled.samples;
        let (mut sum, mut square) = (0.0, 0.0);
        for sample in samples {
            let value = grey(previous, sample.x, sample.y);
            sum += value;
            square += value * value;
        }
        let count = samples.len().max(1) as f64;
        let contrast = (square / count - (sum / count).powi(2)).max(0.0).sqrt();
        let view = Self {
            camera,
            samples,
            previous,
            now,
            scale_px: f64::from(1_u32 << sampled.level),
            scale: (SCALE_RATIO * contrast).max(MIN_SCALE),
            prior: prior.map(|prior| (prior.rotation, prior.information())),
        };
        (contrast >= MIN_CONTRAST).then_some(view)
    }

    /// Grey level of the current image at a sample's predicted position, `None` outside the image.
    fn observed(&self, sample: &Sample, rotation: &UnitQuaternion<f64>) -> Option<f64> {
        let at = self.camera.project(&(rotation * sample.bearing))? / self.scale_px;
        let (width, height) = (self.now.width as f64, self.now.height as f64);
        if at.x < 0.0 || at.y < 0.0 || at.x >= width - 1.0 || at.y >= height - 1.0 {
            return None;
        }
        let (x, y) = (at.x as usize, at.y as usize);
        let (right, down) = (at.x - x as f64, at.y - y as f64);
        let line = |y: usize| (1.0 - right) * grey(self.now, x, y) + right * grey(self.now, x + 1, y);
        Some((1.0 - down) * line(y) + down * line(y + 1))
    }

    /// [`Self::observed`] of every sample.
    fn observe(&self, rotation: &UnitQuaternion<f64>) -> Vec<Option<f64>> {
        self.samples.iter().map(|sample| self.observed(sample, rotation)).collect()
    }

    /// Initial fit at a rotation with its observed grey levels: gain 1 and the mean offset of brightness.
    fn fit_brightness(&self, rotation: &UnitQuaternion<f64>, observed: &[Option<f64>]) -> Fit {
        let (mut sum, mut count) = (0.0, 0.0);
        for (sample, value) in self.samples.iter().zip(observed) {
            if let Some(value) = value {
                sum += value - grey(self.previous, sample.x, sample.y);
                count += 1.0;
            }
        }
        Fit { rotation: *rotation, gain: 1.0, offset: if count > 0.0 { sum / count } else { 0.0 }, cost: f64::INFINITY }
    }

    /// Mean cost of a sample, from 0 (all fit) to 1, with the grey levels observed at the rotation of the fit.
    fn misfit(&self, fit: &Fit, observed: &[Option<f64>]) -> f64 {
        let sum: f64 = self
            .samples
            .iter()
            .zip(observed)
            .map(|(sample, value)| {
                let Some(value) = value else { return OUTSIDE_COST };
                let residual = value - fit.gain * grey(self.previous, sample.x, sample.y) - fit.offset;
                let ratio = (residual / self.scale).powi(2);
                ratio / (1.0 + ratio)
            })
            .sum();
        sum / self.samples.len().max(1) as f64
    }

    /// Gauss–Newton iterations from a start; returns the iterate with the lowest cost.
    fn gauss_newton(&self, start: &Fit, steps: usize) -> Fit {
        let mut best = Fit { cost: f64::INFINITY, ..*start };
        let mut at = *start;
        for _ in 0..steps {
            let (cost, step) = self.linearize(&at);
            if cost < best.cost {
                best = Fit { cost, ..at };
            }
            let Some(step) = step else { return best };
            let rotation_vector: Vector3<f64> = step.fixed_rows::<3>(0).into_owned();
            let rotation = so3::plus(&at.rotation, &-rotation_vector);
            at = Fit { rotation, gain: at.gain + step[3], offset: at.offset + step[4], cost };
            if rotation_vector.norm() * self.camera.focal_length_px() < SHORT_STEP_PX * self.scale_px {
                break;
            }
        }
        let (cost, _) = self.linearize(&at);
        if cost < best.cost { Fit { cost, ..at } } else { best }
    }

    /// Cost of a fit, and the Gauss–Newton step `[φ; gain; offset]` (5 × 1) that decreases it.
    fn linearize(&self, fit: &Fit) -> (f64, Option<Vector5<f64>>) {
        let mut normal = Matrix5::<f64>::zeros();
        let mut right = Vector5::zeros();
        let mut cost = 0.0;
        for sample in self.samples {
            let Some(value) = self.observed(sample, &fit.rotation) else {
                cost += OUTSIDE_COST;
                continue;
            };
            let before = grey(self.previous, sample.x, sample.y);
            let residual = value - fit.gain * before - fit.offset;
            let ratio = (residual / self.scale).powi(2);
            cost += ratio / (1.0 + ratio);
            let weight = geman_mcclure(ratio);
            let by_rotation = gradient(self.previous, sample.x, sample.y) * sample.by_rotation * fit.gain;
            let row = Vector5::new(by_rotation[0], by_rotation[1], by_rotation[2], before, 1.0);
            normal += row * row.transpose() * weight;
            right += row * (weight * residual);
        }
        let independent = INDEPENDENT_SAMPLES / self.samples.len().max(1) as f64;
        cost *= independent;
        let unit = independent / (self.scale * self.scale);
        normal *= unit;
        right *= unit;
        if let Some((expected, information)) = &self.prior {
            let error = so3::log(&(fit.rotation * expected.inverse()));
            cost += error.dot(&(information * error));
            let rotation = fit.rotation.to_rotation_matrix().into_inner();
            let prior_gradient: Vector3<f64> = rotation.transpose() * (information * error);
            let mut corner = normal.fixed_view_mut::<3, 3>(0, 0);
            corner += rotation.transpose() * information * rotation;
            let mut top = right.fixed_rows_mut::<3>(0);
            top += prior_gradient;
        }
        damp(&mut normal, 1e-6);
        let step = normal.cholesky().map(|factor| factor.solve(&right));
        (cost, step.filter(|step| step.iter().all(|value| value.is_finite())))
    }
}

fn grey(image: &GrayImage, x: usize, y: usize) -> f64 {
    f64::from(image.pixels[y * image.width + x])
}

/// Gradient at an inner pixel in grey levels per pixel, as a row.
fn gradient(image: &GrayImage, x: usize, y: usize) -> RowVector2<f64> {
    let along = grey(image, x + 1, y) - grey(image, x - 1, y);
    let down = grey(image, x, y + 1) - grey(image, x, y - 1);
    RowVector2::new(0.5 * along, 0.5 * down)
}
