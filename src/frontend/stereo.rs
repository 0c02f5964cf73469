//! Features of one camera in the image that another camera of a stereo pair takes at the same moment.
//!
//! The first match of a feature is searched for along its epipolar curve, at inverse distances from zero to one over two
//! and a half baselines, by the normalized correlation of small patches on a coarse level of the pyramid; later ones start at the
//! inverse distance of the last one. Each is refined on all levels, compared with the window of the feature, and rejected
//! if its epipolar distance is larger than the uncertainty of the relative pose allows.

use std::collections::BTreeMap;

use nalgebra::{Vector2, Vector3};

use super::epipolar::{BearingPair, epipolar_distance};
use super::lucas_kanade::{self, LucasKanadeOptions};
use super::pyramid::{Pyramid, mirrored};
use super::reference::{ReferenceOptions, ReferencePatch, ReferenceSearch};
use super::tracks::{FeatureId, TrackedFeature};
use crate::camera::CameraModel;
use crate::geometry::RigidTransform;
use crate::sensors::{GrayImage, ImageMask};

/// Distance of the nearest object in baselines: its window would look different in both images.
const NEAREST_BASELINES: f64 = 2.5;
/// Level of the pyramid on which the epipolar curve is searched.
const SEARCH_LEVEL: usize = 2;
/// Half the side of the patches compared there, in pixels of the level.
const PATCH_RADIUS: i32 = 4;
/// Smallest normalized correlation of these patches.
const MIN_CORRELATION: f64 = 0.6;
/// Largest number of candidates along an epipolar curve.
const MAX_CANDIDATES: usize = 96;
/// Epipolar distance in pixels that matches of a perfectly known pair have.
const MATCHING_PX: f64 = 0.8;
/// Factor of the standard deviation of the relative orientation in the largest epipolar distance.
const ORIENTATION_FACTOR: f64 = 3.0;

/// Camera that sees the features of another one, in whose frame its pose is known.
#[derive(Clone, Debug)]
pub struct StereoCamera {
    pub model: CameraModel,
    /// Excludes the masked pixels.
    pub mask: Option<ImageMask>,
    /// Pose of the camera whose features are matched in the frame of this one.
    pub here_from_features: RigidTransform,
    /// Standard deviation of the relative orientation (each axis), in radians.
    pub orientation_sigma_rad: f64,
}

/// Matches the features of one camera in the images of another one, in order of time.
#[derive(Clone, Debug)]
pub struct StereoMatcher {
    features: CameraModel,
    camera: StereoCamera,
    tracking: LucasKanadeOptions,
    reference: ReferenceOptions,
    now: Pyramid,
    /// Inverse distances of the matches in the last image, in 1/m.
    known_per_m: BTreeMap<FeatureId, f64>,
    /// Angle across the epipolar curve up to which matches are searched for, to both sides of it and at negative distances as
    /// well; `None` if the pose is trusted.
    untrusted_rad: Option<f64>,
}

impl StereoMatcher {
    /// `features` is the model of the camera whose features are matched.
    pub fn new(features: CameraModel, camera: StereoCamera) -> Self {
        Self {
            features,
            camera,
            tracking: LucasKanadeOptions::default(),
            reference: ReferenceOptions::default(),
            now: Pyramid::default(),
            known_per_m: BTreeMap::new(),
            untrusted_rad: None,
        }
    }

    /// Matcher that checks the pose: it searches up to this angle across the epipolar curves, and in their continuation beyond
    /// infinity, and accepts matches that contradict the pose.
    #[must_use]
    pub fn untrusting(self, across_rad: f64) -> Self {
        Self { untrusted_rad: Some(across_rad), ..self }
    }

    /// Observations of `features`, found in the image with the pyramid `own`, in the image of the other camera at the same
    /// moment; a feature without a match is missing. Each has the id and the age of its feature, and its bearing in the frame
    /// of the other camera.
    ///
    /// Empty if the image does not have the size of the camera's.
    pub fn match_features(
        &mut self,
        own: &Pyramid,
        image: &GrayImage,
        features: &[TrackedFeature],
    ) -> Vec<TrackedFeature> {
        let known_per_m = std::mem::take(&mut self.known_per_m);
        let [width, height] = self.camera.model.resolution_px;
        if (image.width, image.height) != (width, height) || image.pixels.len() != width * height {
            return Vec::new();
        }
        self.now.build(image, self.tracking.levels);
        let mut buffers = lucas_kanade::Buffers::new();
        let mut search = ReferenceSearch::new();
        let mut matches = Vec::new();
        for feature in features {
            let guess = match known_per_m.get(&feature.id) {
                Some(known) if self.untrusted_rad.is_none() => self.pixel_at(feature, *known),
                _ => self.search(own, feature),
            };
            let found = guess.and_then(|guess| self.refine(own, feature, &guess, &mut buffers, &mut search));
            if let Some((found, inverse_distance_per_m)) = found {
                self.known_per_m.insert(feature.id, inverse_distance_per_m);
                matches.push(found);
            }
        }
        matches
    }

    /// Pixel of a feature in the other camera at an inverse distance in 1/m; `None` out of view.
    fn pixel_at(&self, feature: &TrackedFeature, inverse_distance_per_m: f64) -> Option<Vector2<f64>> {
        let pose = &self.camera.here_from_features;
        let direction = pose.rotation * feature.bearing + pose.translation_m * inverse_distance_per_m;
        let uv_px = self.camera.model.project(&direction)?;
        self.camera.model.contains(&uv_px, 0.0).then_some(uv_px)
    }

    /// Pixel on the epipolar curve whose neighbourhood correlates best with the feature's.
    fn search(&self, own: &Pyramid, feature: &TrackedFeature) -> Option<Vector2<f64>> {
        let level = SEARCH_LEVEL.min(own.levels().len().min(self.now.levels().len()).checked_sub(1)?);
        let scale = f64::from(1_u32 << level);
        let patch = Patch::cut(&own.levels()[level], &(feature.uv_px / scale))?;
        let nearest_per_m = (NEAREST_BASELINES * self.camera.here_from_features.translation_m.norm()).recip();
        let far = self.pixel_at(feature, 0.0);
        let near = self.pixel_at(feature, nearest_per_m);
        let length_px = far.zip(near).map_or(scale * MAX_CANDIDATES as f64, |(far, near)| (far - near).norm());
        let count = ((length_px / scale).ceil() as i32).clamp(1, MAX_CANDIDATES as i32);
        let across_px = self.untrusted_rad.unwrap_or(0.0) * self.camera.model.focal_length_px();
        let steps = (across_px / scale).ceil() as i32;
        let first = if self.untrusted_rad.is_some() { -count } else { 0 };
        let across = far.zip(near).map_or_else(Vector2::y, |(far, near)| {
            let along = near - far;
            Vector2::new(-along.y, along.x).try_normalize(1e-9).unwrap_or_else(Vector2::y)
        });
        let mut best: Option<(f64, Vector2<f64>)> = None;
        for candidate in first..=count {
            let inverse_distance_per_m = nearest_per_m * f64::from(candidate) / f64::from(count);
            let Some(on_curve_px) = self.pixel_at(feature, inverse_distance_per_m) else { continue };
            for step in -steps..=steps {
                let uv_px = on_curve_px + across * (f64::from(step) * scale);
                let other = Patch::cut(&self.now.levels()[level], &(uv_px / scale));
                let Some(correlation) = other.map(|other| patch.correlation(&other)) else { continue };
                if correlation >= MIN_CORRELATION && best.is_none_or(|(highest, _)| correlation > highest) {
                    best = Some((correlation, uv_px));
                }
            }
        }
        best.map(|(_, uv_px)| uv_px)
    }

    /// Match near a guess, with its inverse distance in 1/m.
    fn refine(
        &self,
        own: &Pyramid,
        feature: &TrackedFeature,
        guess_px: &Vector2<f64>,
        buffers: &mut lucas_kanade::Buffers,
        search: &mut ReferenceSearch,
    ) -> Option<(TrackedFeature, f64)> {
        let from_px = feature.uv_px;
        let options = &self.tracking;
        let near_px = lucas_kanade::track_on_coarse_levels(own, &self.now, &from_px, guess_px, options, buffers)?;
        let mut reference = ReferencePatch::cut(own.levels().first()?, &self.features, &from_px, &(near_px - from_px))?;
        let uv_px = reference.find(self.now.levels().first()?, &near_px, &self.reference, search)?;
        if self.camera.mask.as_ref().is_some_and(|mask| mask.covers(&uv_px)) {
            return None;
        }
        let bearing = self.camera.model.unproject(&uv_px)?;
        let inverse = inverse_distance_per_m(&self.camera.here_from_features, &feature.bearing, &bearing);
        let inverse_distance_per_m = if inverse.is_finite() { inverse.max(0.0) } else { 0.0 };
        let matched = TrackedFeature { uv_px, bearing, previous_uv_px: None, ..*feature };
        if self.untrusted_rad.is_some() {
            return Some((matched, inverse_distance_per_m));
        }
        let pose = &self.camera.here_from_features;
        let pair = BearingPair { previous: feature.bearing, now: bearing };
        let direction = pose.translation_m.normalize();
        let matching_rad = MATCHING_PX / self.camera.model.focal_length_px();
        let largest_rad = matching_rad.hypot(ORIENTATION_FACTOR * self.camera.orientation_sigma_rad);
        if epipolar_distance(&pair, &pose.rotation, &direction) > largest_rad {
            return None;
        }
        Some((matched, inverse_distance_per_m))
    }
}

/// Inverse distance of a point from the camera of the features, in 1/m, by its unit bearings there and in the other camera
/// `here`; negative for a point that seems farther than infinity, NaN in the direction of the baseline:
///
/// ```text
/// s b' = R b + λ t    ⇒    λ = −(b' × R b)·(b' × t) / |b' × t|²
/// ```
pub fn inverse_distance_per_m(here_from_features: &RigidTransform, bearing: &Vector3<f64>, here: &Vector3<f64>) -> f64 {
    let across = here.cross(&here_from_features.translation_m);
    -here.cross(&(here_from_features.rotation * bearing)).dot(&across) / across.norm_squared()
}

/// Side of a patch in pixels.
const PATCH_SIDE: usize = 2 * PATCH_RADIUS as usize + 1;

/// Grey levels around a pixel, less their mean, with the length of the vector.
struct Patch {
    grey: [f32; PATCH_SIDE * PATCH_SIDE],
    length: f32,
}

impl Patch {
    /// Patch around the nearest pixel, mirrored at the borders; `None` without texture.
    fn cut(image: &GrayImage, centre_px: &Vector2<f64>) -> Option<Self> {
        let (x, y) = (centre_px.x.round() as i32, centre_px.y.round() as i32);
        let mut grey = [0.0; PATCH_SIDE * PATCH_SIDE];
        let offsets =
            (-PATCH_RADIUS..=PATCH_RADIUS).flat_map(|dy| (-PATCH_RADIUS..=PATCH_RADIUS).map(move |dx| (dx, dy)));
        for (value, (dx, dy)) in grey.iter_mut().zip(offsets) {
            let (column, row) = (mirrored(x + dx, image.width), mirrored(y + dy, image.height));
            *value = f32::from(image.pixels[row * image.width + column]);
        }
        let mean = grey.iter().sum::<f32>() / grey.len() as f32;
        for value in &mut grey {
            *value -= mean;
        }
        let length = grey.iter().map(|value| value * value).sum::<f32>().sqrt();
        (length > f32::from(PATCH_SIDE as u8)).then_some(Self { grey, length })
    }

    /// Normalized correlation, from −1 to 1.
    fn correlation(&self, other: &Self) -> f64 {
        let product: f32 = self.grey.iter().zip(&other.grey).map(|(one, other)| one * other).sum();
        f64::from(product / (self.length * other.length))
    }
}
