//! How the camera turned, seen on the coarsest levels of the pyramid.
//!
//! Where the tracker looks for its features rests on a predicted rotation.
//! That may be tens of pixels off where encoders are poor, so it has to earn its trust: its own covariance says how far it
//! can be off, and the images say whether it is any better than no turn at all.
//! Where either speaks against it, the turn is measured: the whole coarse image is laid over the other one by
//! Gauss–Newton on the rotation with a gain and an offset, robustly, from the prediction and from no turn at all.
//! The idea is the small blurry image of PTAM (Klein and Murray, "Improving the agility of keyframe-based SLAM").

use nalgebra::{Matrix2x3, Matrix3, Matrix5, RowVector2, UnitQuaternion, Vector2, Vector3, Vector5};

use super::prediction::PredictedRotation;
use super::pyramid::Pyramid;
use crate::camera::CameraModel;
use crate::geometry::so3;
use crate::sensors::GrayImage;

/// Levels that the coarse image needs beyond those of the tracker: at 640 pixels it is then 40 pixels wide.
pub(super) const EXTRA_LEVELS: usize = 1;
/// A prediction that is known better than this is taken as it is, in pixels: the tracker finds a feature from as far.
const TRUSTED_SIGMA_PX: f64 = 6.0;
/// Samples on a level: more say no more.
const MOST_SAMPLES: usize = 1200;
/// What the samples are worth together, in independent measurements of a grey value: neighbours see the same, and near
/// things move otherwise than the rest.
const WORTH: f64 = 100.0;
/// Residuals count less beyond this share of the image's contrast (its standard deviation), and beyond this many levels.
const SCALE_SHARE: f64 = 0.5;
const LEAST_SCALE: f64 = 4.0;
/// An image with less contrast than this says nothing, in grey levels.
const LEAST_CONTRAST: f64 = 2.0;
/// What a sample costs that falls out of the other image; one that fits costs nothing, a wrong one nearly one.
const UNSEEN_COST: f64 = 0.5;
/// A prediction is worse than none when the images fit worse by this under it.
const WORSE_BY: f64 = 0.02;
/// Gauss–Newton steps on each level, coarsest first.
const STEPS: [usize; 2] = [10, 5];
/// A step shorter than this ends the search, in pixels of the level.
const SHORT_STEP_PX: f64 = 0.03;

/// One pixel of a level.
#[derive(Clone, Copy, Debug)]
struct Sample {
    x: usize,
    y: usize,
    /// Its direction in the camera.
    bearing: Vector3<f64>,
    /// How it moves on the level when its bearing is turned, in pixels of the level per radian.
    by_turn: Matrix2x3<f64>,
}

/// The samples of one level.
#[derive(Clone, Debug)]
struct SampledLevel {
    level: usize,
    samples: Vec<Sample>,
}

/// Finds the rotation between two images from their coarsest levels.
#[derive(Clone, Debug)]
pub(super) struct CoarseAligner {
    camera: CameraModel,
    /// Coarsest first; empty before the first image.
    levels: Vec<SampledLevel>,
}

/// A rotation with the brightness that goes with it.
#[derive(Clone, Copy)]
struct Fit {
    /// `camera_now_from_camera_previous`.
    rotation: UnitQuaternion<f64>,
    gain: f64,
    offset: f64,
    cost: f64,
}

impl CoarseAligner {
    pub(super) fn new(camera: CameraModel) -> Self {
        Self { camera, levels: Vec::new() }
    }

    /// The rotation `camera_now_from_camera_previous` from which features are looked for: the prediction where it is good,
    /// what the images say where it is not, `None` where neither says anything.
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
        let still = view.fit_brightness(&identity);
        let mut starts = vec![still];
        let mut prior = predicted;
        if let Some(predicted) = predicted {
            let expected = view.fit_brightness(&predicted.rotation);
            let sound = view.misfit(&expected) <= view.misfit(&still) + WORSE_BY;
            if sound && predicted.sigma_rad() * self.camera.focal_length_px() <= TRUSTED_SIGMA_PX {
                return fallback;
            }
            if !sound && predicted.sigma_rad() * self.camera.focal_length_px() <= TRUSTED_SIGMA_PX {
                // It claims to be good and is not: its covariance is worth nothing.
                prior = None;
            }
            starts.push(expected);
        }
        let mut best: Option<Fit> = None;
        for (sampled, steps) in self.levels.iter().zip(STEPS) {
            let Some(view) = View::new(&self.camera, sampled, previous, now, prior) else { break };
            best = starts
                .iter()
                .map(|start| view.descend(start, steps))
                .fold(None, |best: Option<Fit>, fit| best.filter(|best| best.cost <= fit.cost).or(Some(fit)));
            starts = best.into_iter().collect();
        }
        best.map(|fit| fit.rotation).or(fallback)
    }

    /// Chooses the samples once the size of the levels is known.
    fn sample_levels(&mut self, pyramid: &Pyramid) {
        let count = pyramid.levels().len();
        let first = count.saturating_sub(STEPS.len()).max(1);
        if !self.levels.is_empty() || count < 2 {
            return;
        }
        for level in (first..count).rev() {
            let image = &pyramid.levels()[level];
            let stride = ((image.width * image.height) as f64 / MOST_SAMPLES as f64).sqrt().ceil().max(1.0) as usize;
            let scale = f64::from(1_u32 << level);
            let mut samples = Vec::new();
            for y in (1..image.height.saturating_sub(1)).step_by(stride) {
                for x in (1..image.width.saturating_sub(1)).step_by(stride) {
                    let Some(bearing) = self.camera.unproject(&(Vector2::new(x as f64, y as f64) * scale)) else {
                        continue;
                    };
                    if let Some((_, by_point)) = self.camera.project_with_jacobian(&bearing) {
                        samples.push(Sample { x, y, bearing, by_turn: by_point * -so3::hat(&bearing) / scale });
                    }
                }
            }
            self.levels.push(SampledLevel { level, samples });
        }
    }
}

/// One level of both images.
struct View<'a> {
    camera: &'a CameraModel,
    samples: &'a [Sample],
    previous: &'a GrayImage,
    now: &'a GrayImage,
    /// Pixels of the image per pixel of the level.
    scale_px: f64,
    /// Residual at which a sample begins to count less, in grey levels.
    scale: f64,
    /// Expected rotation and its information.
    prior: Option<(UnitQuaternion<f64>, Matrix3<f64>)>,
}

impl<'a> View<'a> {
    /// `None` when there is nothing to see.
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
            scale: (SCALE_SHARE * contrast).max(LEAST_SCALE),
            prior: prior.map(|prior| (prior.rotation, prior.information())),
        };
        (contrast >= LEAST_CONTRAST).then_some(view)
    }

    /// Grey value of now where a sample comes to lie, `None` outside the image.
    fn seen(&self, sample: &Sample, rotation: &UnitQuaternion<f64>) -> Option<f64> {
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

    /// A rotation with the offset in brightness between the images, as a start.
    fn fit_brightness(&self, rotation: &UnitQuaternion<f64>) -> Fit {
        let (mut sum, mut count) = (0.0, 0.0);
        for sample in self.samples {
            if let Some(value) = self.seen(sample, rotation) {
                sum += value - grey(self.previous, sample.x, sample.y);
                count += 1.0;
            }
        }
        Fit { rotation: *rotation, gain: 1.0, offset: if count > 0.0 { sum / count } else { 0.0 }, cost: f64::INFINITY }
    }

    /// Mean cost of a sample, from 0 (all fit) to 1.
    fn misfit(&self, fit: &Fit) -> f64 {
        let sum: f64 = self
            .samples
            .iter()
            .map(|sample| {
                let Some(value) = self.seen(sample, &fit.rotation) else { return UNSEEN_COST };
                let residual = value - fit.gain * grey(self.previous, sample.x, sample.y) - fit.offset;
                let ratio = (residual / self.scale).powi(2);
                ratio / (1.0 + ratio)
            })
            .sum();
        sum / self.samples.len().max(1) as f64
    }

    /// Gauss–Newton from a start; the best that was met.
    fn descend(&self, start: &Fit, steps: usize) -> Fit {
        let mut best = Fit { cost: f64::INFINITY, ..*start };
        let mut at = *start;
        for _ in 0..steps {
            let (cost, step) = self.linearize(&at);
            if cost < best.cost {
                best = Fit { cost, ..at };
            }
            let Some(step) = step else { return best };
            let turn: Vector3<f64> = step.fixed_rows::<3>(0).into_owned();
            let rotation = UnitQuaternion::new_normalize((at.rotation * so3::exp(&-turn)).into_inner());
            at = Fit { rotation, gain: at.gain + step[3], offset: at.offset + step[4], cost };
            if turn.norm() * self.camera.focal_length_px() < SHORT_STEP_PX * self.scale_px {
                break;
            }
        }
        let (cost, _) = self.linearize(&at);
        if cost < best.cost { Fit { cost, ..at } } else { best }
    }

    /// Cost of a fit, and the step `[turn of the previous image's bearings, gain, offset]` that betters it.
    ///
    /// The inverse compositional form: the gradient is that of the previous image, which does not depend on the rotation.
    fn linearize(&self, fit: &Fit) -> (f64, Option<Vector5<f64>>) {
        let mut normal = Matrix5::<f64>::zeros();
        let mut right = Vector5::zeros();
        let mut cost = 0.0;
        for sample in self.samples {
            let Some(value) = self.seen(sample, &fit.rotation) else {
                cost += UNSEEN_COST;
                continue;
            };
            let before = grey(self.previous, sample.x, sample.y);
            let residual = value - fit.gain * before - fit.offset;
            let ratio = (residual / self.scale).powi(2);
            cost += ratio / (1.0 + ratio);
            let weight = 1.0 / ((1.0 + ratio) * (1.0 + ratio));
            let by_turn = gradient(self.previous, sample.x, sample.y) * sample.by_turn * fit.gain;
            let row = Vector5::new(by_turn[0], by_turn[1], by_turn[2], before, 1.0);
            normal += row * row.transpose() * weight;
            right += row * (weight * residual);
        }
        let worth = WORTH / self.samples.len().max(1) as f64;
        cost *= worth;
        let unit = worth / (self.scale * self.scale);
        normal *= unit;
        right *= unit;
        if let Some((expected, information)) = &self.prior {
            let error = so3::log(&(fit.rotation * expected.inverse()));
            cost += error.dot(&(information * error));
            let rotation = fit.rotation.to_rotation_matrix().into_inner();
            let pull: Vector3<f64> = rotation.transpose() * (information * error);
            let mut corner = normal.fixed_view_mut::<3, 3>(0, 0);
            corner += rotation.transpose() * information * rotation;
            let mut top = right.fixed_rows_mut::<3>(0);
            top += pull;
        }
        for index in 0..5 {
            normal[(index, index)] *= 1.0 + 1e-6;
        }
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
