use nalgebra::{UnitQuaternion, Vector2, Vector3};
use thiserror::Error;

use super::coarse::{self, CoarseAligner};
use super::corners::{CornerDetector, CornerOptions, PointGrid};
use super::keyed::{Key, KeyFinder, KeyOptions, Sighting};
use super::lucas_kanade::{self, LucasKanadeOptions};
use super::outliers::{self, BearingPair, Motion, OutlierOptions};
use super::prediction::PredictedRotation;
use super::pyramid::Pyramid;
use super::tracks::{FeatureId, FrontEndStatistics, TrackedFeature, TrackedFrame};
use crate::camera::CameraModel;
use crate::geometry::median;
use crate::sensors::GrayImage;

/// What a front end can be told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrontEndOptions {
    /// Finding new features.
    pub corners: CornerOptions,
    /// Following them from image to image.
    pub lucas_kanade: LucasKanadeOptions,
    /// Holding them to their first sighting.
    pub keys: KeyOptions,
    /// Rejecting those that do not move with the scene.
    pub outliers: OutlierOptions,
}

/// Why an image was refused.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum FrontEndError {
    /// It does not have the camera's size.
    #[error("the image is {width}×{height}, but the camera model is for {expected_width}×{expected_height}")]
    ImageSize {
        /// Columns it has.
        width: usize,
        /// Rows it has.
        height: usize,
        /// Columns of the camera model.
        expected_width: usize,
        /// Rows of the camera model.
        expected_height: usize,
    },
    /// Its pixels are not as many as its size says.
    #[error("the image of {width}×{height} holds {pixels} pixels")]
    PixelCount {
        /// Columns it should have.
        width: usize,
        /// Rows it should have.
        height: usize,
        /// Pixels it has.
        pixels: usize,
    },
}

/// A feature on its way.
#[derive(Clone, Debug)]
struct Track {
    id: FeatureId,
    age: u32,
    uv_px: Vector2<f64>,
    bearing: Vector3<f64>,
    /// What it looked like at first, `None` when too near to the border or without texture then.
    key: Option<Key>,
}

/// A feature that was found in the image of now.
#[derive(Clone, Debug)]
struct Step {
    /// What it was in the image before.
    id: FeatureId,
    age: u32,
    previous_uv_px: Vector2<f64>,
    previous_bearing: Vector3<f64>,
    /// What it is now.
    uv_px: Vector2<f64>,
    bearing: Vector3<f64>,
    key: Option<Key>,
}

/// What following features works on.
struct Buffers {
    motion: Box<lucas_kanade::Buffers>,
    keys: KeyFinder,
}

/// Follows features through one camera's images.
///
/// It is given images in the order of time and remembers the last one; a clone goes on exactly as the original would.
#[derive(Clone, Debug)]
pub struct FrontEnd {
    camera: CameraModel,
    options: FrontEndOptions,
    previous: Pyramid,
    now: Pyramid,
    tracks: Vec<Track>,
    next_id: u64,
    coarse: CoarseAligner,
    detector: CornerDetector,
    crowd: PointGrid,
    found: Vec<Vector2<f64>>,
}

/// Two guesses of where a feature is are worth a try each when they differ by this much, in pixels.
const DIFFERENT_GUESS_PX: f64 = 2.0;
/// Fewer tracks than this say nothing about where the others went.
const MIN_TRACKS_FOR_GUESS: usize = 8;
/// Features that came nearer to each other than this share of the least distance are thinned out.
const CROWDED_SHARE: f64 = 0.5;

impl FrontEnd {
    /// A front end for one camera, before its first image.
    pub fn new(camera: CameraModel, options: FrontEndOptions) -> Self {
        Self {
            coarse: CoarseAligner::new(camera.clone()),
            camera,
            options,
            previous: Pyramid::default(),
            now: Pyramid::default(),
            tracks: Vec::new(),
            next_id: 0,
            detector: CornerDetector::default(),
            crowd: PointGrid::default(),
            found: Vec::new(),
        }
    }

    /// The camera whose images it follows.
    pub fn camera(&self) -> &CameraModel {
        &self.camera
    }

    /// Takes in the next image.
    ///
    /// `predicted` is the rotation since the last image that was taken in, as from
    /// [`predict_camera_rotation`](super::predict_camera_rotation); it may be wrong, and `None` when nothing is known.
    ///
    /// # Errors
    /// When the image does not have the camera's size; the front end is then as before.
    pub fn process(
        &mut self,
        image: &GrayImage,
        stamp_ns: i64,
        predicted: Option<&PredictedRotation>,
    ) -> Result<TrackedFrame, FrontEndError> {
        self.check(image)?;
        self.now.build(image, self.options.lucas_kanade.levels + coarse::EXTRA_LEVELS);
        let mut statistics = FrontEndStatistics::default();
        let before = self.tracks.len();
        let expected = self.coarse.search_rotation(&self.previous, &self.now, predicted);
        let steps = self.follow(expected.as_ref());
        statistics.lost = before - steps.len();
        let (steps, motion) = self.reject(steps, expected.as_ref(), predicted);
        let steps = self.thin_out(steps);
        statistics.tracked = steps.len();
        statistics.rejected = before - statistics.lost - steps.len();
        statistics.median_flow_px =
            median(steps.iter().map(|step| (step.uv_px - step.previous_uv_px).norm())).unwrap_or(0.0);
        statistics.mean_parallax_px = self.mean_parallax_px(&steps, &motion.rotation);

        let mut features: Vec<TrackedFeature> = steps
            .iter()
            .map(|step| TrackedFeature {
                id: step.id,
                age: step.age + 1,
                uv_px: step.uv_px,
                previous_uv_px: Some(step.previous_uv_px),
                bearing: step.bearing,
            })
            .collect();
        self.detect(image, &mut features);
        statistics.detected = features.len() - steps.len();
        let keys = steps.into_iter().map(|step| step.key).chain(std::iter::repeat(None));
        self.tracks.clear();
        self.tracks.extend(features.iter().zip(keys).map(|(feature, key)| Track {
            id: feature.id,
            age: feature.age,
            uv_px: feature.uv_px,
            bearing: feature.bearing,
            key: key.or_else(|| Key::cut(image, &feature.uv_px)),
        }));
        std::mem::swap(&mut self.previous, &mut self.now);
        Ok(TrackedFrame { stamp_ns, features, statistics })
    }

    fn check(&self, image: &GrayImage) -> Result<(), FrontEndError> {
        let [expected_width, expected_height] = self.camera.resolution_px;
        let GrayImage { width, height, ref pixels } = *image;
        if (width, height) != (expected_width, expected_height) || width * height == 0 {
            return Err(FrontEndError::ImageSize { width, height, expected_width, expected_height });
        }
        if pixels.len() != width * height {
            return Err(FrontEndError::PixelCount { width, height, pixels: pixels.len() });
        }
        Ok(())
    }

    /// Looks for every feature where it should be now, then for the lost ones where the found ones say they should be.
    fn follow(&self, expected: Option<&UnitQuaternion<f64>>) -> Vec<Step> {
        let guesses: Vec<Vector2<f64>> = self
            .tracks
            .iter()
            .map(|track| expected.map_or(track.uv_px, |rotation| self.turned(track, rotation)))
            .collect();
        let mut buffers = Buffers { motion: lucas_kanade::Buffers::new(), keys: KeyFinder::new() };
        let mut results: Vec<Option<Step>> =
            self.tracks.iter().zip(&guesses).map(|(track, guess)| self.track(track, guess, &mut buffers)).collect();
        let found: Vec<BearingPair> = results.iter().flatten().map(pair_of).collect();
        let lost = results.len() - found.len();
        if lost > 0 {
            let start = expected.copied().unwrap_or_else(UnitQuaternion::identity);
            let floor = self.options.outliers.threshold_px / self.camera.focal_length_px();
            let seen = (found.len() >= MIN_TRACKS_FOR_GUESS).then(|| outliers::fit_rotation(&found, &start, floor));
            // When most are lost, the expectation may be all wrong.
            let start_over = 2 * lost > results.len();
            for ((track, guess), result) in self.tracks.iter().zip(&guesses).zip(&mut results) {
                let others =
                    [seen.as_ref().map(|rotation| self.turned(track, rotation)), start_over.then_some(track.uv_px)];
                for other in others.into_iter().flatten() {
                    if result.is_none() && (other - guess).norm() > DIFFERENT_GUESS_PX {
                        *result = self.track(track, &other, &mut buffers);
                    }
                }
            }
        }
        results.into_iter().flatten().collect()
    }

    fn track(&self, track: &Track, guess_px: &Vector2<f64>, buffers: &mut Buffers) -> Option<Step> {
        let options = &self.options.lucas_kanade;
        let Buffers { motion, keys } = buffers;
        let near_px = lucas_kanade::approach(&self.previous, &self.now, &track.uv_px, guess_px, options, motion)?;
        let mut key = track.key.clone();
        let sighting = match &mut key {
            Some(key) => key.find(self.now.levels().first()?, &near_px, &self.options.keys, keys),
            None => Sighting::OutOfView,
        };
        let uv_px = match sighting {
            Sighting::Found(uv_px) => uv_px,
            Sighting::Changed | Sighting::OutOfView => {
                key = key.filter(|_| sighting == Sighting::OutOfView);
                lucas_kanade::arrive(&self.previous, &self.now, &track.uv_px, &near_px, options, motion)?
            }
        };
        let bearing = self.camera.unproject(&uv_px)?;
        Some(Step {
            id: track.id,
            age: track.age,
            previous_uv_px: track.uv_px,
            previous_bearing: track.bearing,
            uv_px,
            bearing,
            key,
        })
    }

    /// Where a feature comes to lie when the camera only turns; where it was when that is out of view.
    fn turned(&self, track: &Track, rotation: &UnitQuaternion<f64>) -> Vector2<f64> {
        self.camera
            .project(&(rotation * track.bearing))
            .filter(|uv_px| self.camera.contains(uv_px, 0.0))
            .unwrap_or(track.uv_px)
    }

    /// Leaves out what does not move with the scene.
    fn reject(
        &self,
        steps: Vec<Step>,
        expected: Option<&UnitQuaternion<f64>>,
        predicted: Option<&PredictedRotation>,
    ) -> (Vec<Step>, Motion) {
        let pairs: Vec<BearingPair> = steps.iter().map(pair_of).collect();
        let start = expected.copied().unwrap_or_else(UnitQuaternion::identity);
        let focal_px = self.camera.focal_length_px();
        let motion = outliers::judge(&pairs, &start, predicted, focal_px, &self.options.outliers);
        let kept = steps.into_iter().zip(&motion.is_inlier).filter_map(|(step, inlier)| inlier.then_some(step));
        (kept.collect(), motion)
    }

    /// Of features that ran into each other the one seen longest stays.
    fn thin_out(&mut self, mut steps: Vec<Step>) -> Vec<Step> {
        let [width, height] = self.camera.resolution_px;
        self.crowd.reset(width, height, CROWDED_SHARE * self.options.corners.min_distance_px);
        steps.sort_by_key(|step| (std::cmp::Reverse(step.age), step.id));
        steps.retain(|step| {
            let free = self.crowd.is_free(&step.uv_px);
            if free {
                self.crowd.insert(step.uv_px);
            }
            free
        });
        steps.sort_by_key(|step| step.id);
        steps
    }

    fn detect(&mut self, image: &GrayImage, features: &mut Vec<TrackedFeature>) {
        let existing = features.iter().map(|feature| feature.uv_px);
        self.detector.detect(image, existing, &self.options.corners, &mut self.found);
        for uv_px in &self.found {
            if let Some(bearing) = self.camera.unproject(uv_px) {
                let id = FeatureId(self.next_id);
                self.next_id += 1;
                features.push(TrackedFeature { id, age: 0, uv_px: *uv_px, previous_uv_px: None, bearing });
            }
        }
    }

    fn mean_parallax_px(&self, steps: &[Step], rotation: &UnitQuaternion<f64>) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for step in steps {
            if let Some(turned) = self.camera.project(&(rotation * step.previous_bearing)) {
                sum += (step.uv_px - turned).norm();
                count += 1;
            }
        }
        if count == 0 { 0.0 } else { sum / f64::from(count) }
    }
}

fn pair_of(step: &Step) -> BearingPair {
    BearingPair { previous: step.previous_bearing, now: step.bearing }
}
