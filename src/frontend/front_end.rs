use nalgebra::{UnitQuaternion, Vector2, Vector3};
use thiserror::Error;

use super::coarse::{self, CoarseAligner};
use super::corners::{CornerDetector, CornerOptions, PointGrid};
use super::lucas_kanade::{self, LucasKanadeOptions};
use super::outliers::{self, BearingPair, ImageMotion, OutlierOptions};
use super::prediction::{PredictedRotation, RowRotations};
use super::pyramid::Pyramid;
use super::reference::{ReferenceOptions, ReferencePatch, ReferenceSearch};
use super::tracks::{FeatureId, FrontEndStatistics, TrackedFeature, TrackedFrame};
use crate::camera::CameraModel;
use crate::geometry::median;
use crate::sensors::{GrayImage, ImageMask};

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrontEndOptions {
    /// Detection of new features.
    pub corners: CornerOptions,
    /// Tracking from image to image.
    pub lucas_kanade: LucasKanadeOptions,
    /// Refinement against reference patches.
    pub reference: ReferenceOptions,
    /// Rejection of features that do not move with the scene.
    pub outliers: OutlierOptions,
}

/// Reason that an image was rejected.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum FrontEndError {
    /// The image does not have the size of the camera model.
    #[error("the image is {width}×{height}, but the camera model is for {expected_width}×{expected_height}")]
    ImageSize {
        /// Columns of the image.
        width: usize,
        /// Rows of the image.
        height: usize,
        /// Columns of the camera model.
        expected_width: usize,
        /// Rows of the camera model.
        expected_height: usize,
    },
    /// The number of pixels does not match the image size.
    #[error("the image of {width}×{height} has {pixels} pixels")]
    PixelCount {
        /// Columns of the image.
        width: usize,
        /// Rows of the image.
        height: usize,
        /// Number of pixels that the image has.
        pixels: usize,
    },
}

/// A feature of the newest image.
#[derive(Clone, Debug)]
struct Track {
    feature: TrackedFeature,
    /// Window of the feature; `None` if it was too near to the border or had no texture.
    reference: Option<ReferencePatch>,
}

/// A feature of the previous image found in the current one.
#[derive(Clone, Debug)]
struct Match {
    previous: TrackedFeature,
    now: TrackedFeature,
    reference: Option<ReferencePatch>,
}

struct Buffers {
    motion: Box<lucas_kanade::Buffers>,
    search: ReferenceSearch,
}

/// Tracks features through the images of one camera.
///
/// Images are passed in order of time. The front end keeps the last one; a clone continues exactly like the original.
#[derive(Clone, Debug)]
pub struct FrontEnd {
    camera: CameraModel,
    mask: Option<ImageMask>,
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

/// Two predicted positions of a feature are both tried if they differ by more than this, in pixels.
const DIFFERENT_GUESS_PX: f64 = 2.0;
/// Iterations for the row in which a direction is observed; each leaves less than a tenth of the error.
const ROW_STEPS: usize = 3;
/// Minimum number of tracks from which the motion of lost ones is predicted.
const MIN_TRACKS_FOR_GUESS: usize = 8;
/// Ratio of the minimum distance below which the younger of two features is removed.
const CROWDED_RATIO: f64 = 0.5;

impl FrontEnd {
    pub fn new(camera: CameraModel, options: FrontEndOptions) -> Self {
        Self {
            coarse: CoarseAligner::new(camera.clone()),
            camera,
            mask: None,
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

    /// Excludes the masked pixels: features are neither detected nor tracked there. The mask has the camera's size.
    #[must_use]
    pub fn with_mask(mut self, mask: Option<ImageMask>) -> Self {
        self.mask = mask;
        self
    }

    pub fn camera(&self) -> &CameraModel {
        &self.camera
    }

    /// Levels of the last processed image; empty before the first one.
    pub fn last_image(&self) -> &Pyramid {
        &self.previous
    }

    /// Processes the next image and returns its features.
    ///
    /// `predicted` is the rotation since the last processed image, as from
    /// [`predict_camera_rotation`](super::predict_camera_rotation); it may be wrong, and is `None` without a
    /// prediction.
    ///
    /// # Errors
    /// If the image does not have the camera's size; the front end is then unchanged.
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
        let rows = predicted.and_then(|predicted| predicted.rows);
        let matches = self.track_all(expected.as_ref(), rows.as_ref());
        statistics.lost = before - matches.len();
        let (matches, motion) = self.reject_outliers(matches, expected.as_ref(), predicted);
        let matches = self.correct_perspective(matches, &motion.rotation);
        let matches = self.remove_crowded(matches);
        statistics.tracked = matches.len();
        statistics.rejected = before - statistics.lost - matches.len();
        statistics.median_flow_px =
            median(matches.iter().map(|found| (found.now.uv_px - found.previous.uv_px).norm())).unwrap_or(0.0);
        statistics.mean_parallax_px = self.mean_parallax_px(&matches, &motion.rotation, rows.as_ref());

        let mut features: Vec<TrackedFeature> = matches.iter().map(|found| found.now).collect();
        self.detect(image, &mut features);
        statistics.detected = features.len() - matches.len();
        let references = matches.into_iter().map(|found| found.reference).chain(std::iter::repeat(None));
        self.tracks.clear();
        self.tracks.extend(features.iter().zip(references).map(|(feature, reference)| Track {
            feature: *feature,
            reference:
                reference.or_else(|| ReferencePatch::cut(image, &self.camera, &feature.uv_px, &Vector2::zeros())),
        }));
        std::mem::swap(&mut self.previous, &mut self.now);
        Ok(TrackedFrame { stamp_ns, features, matched: Vec::new(), statistics })
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

    /// Tracks every feature from its predicted position, then the lost ones from the motion of the tracked ones.
    fn track_all(&self, expected: Option<&UnitQuaternion<f64>>, rows: Option<&RowRotations>) -> Vec<Match> {
        let guesses: Vec<Vector2<f64>> = self
            .tracks
            .iter()
            .map(|track| expected.map_or(track.feature.uv_px, |rotation| self.rotated(&track.feature, rotation, rows)))
            .collect();
        let mut buffers = Buffers { motion: lucas_kanade::Buffers::new(), search: ReferenceSearch::new() };
        let mut results: Vec<Option<Match>> =
            self.tracks.iter().zip(&guesses).map(|(track, guess)| self.track(track, guess, &mut buffers)).collect();
        let found: Vec<BearingPair> = results.iter().flatten().map(|found| self.pair_of(found, rows)).collect();
        let lost = results.len() - found.len();
        if lost > 0 {
            let start = expected.copied().unwrap_or_else(UnitQuaternion::identity);
            let floor = self.options.outliers.threshold_px / self.camera.focal_length_px();
            let observed = (found.len() >= MIN_TRACKS_FOR_GUESS).then(|| outliers::fit_rotation(&found, &start, floor));
            // If most features are lost, the prediction may be wrong.
            let start_over = 2 * lost > results.len();
            for ((track, guess), result) in self.tracks.iter().zip(&guesses).zip(&mut results) {
                let others = [
                    observed.as_ref().map(|rotation| self.rotated(&track.feature, rotation, rows)),
                    start_over.then_some(track.feature.uv_px),
                ];
                for other in others.into_iter().flatten() {
                    if result.is_none() && (other - guess).norm() > DIFFERENT_GUESS_PX {
                        *result = self.track(track, &other, &mut buffers);
                    }
                }
            }
        }
        results.into_iter().flatten().collect()
    }

    /// Tracks one feature from a guess: on the coarse levels, then by its reference patch or, without a match, on the
    /// finest level.
    fn track(&self, track: &Track, guess_px: &Vector2<f64>, buffers: &mut Buffers) -> Option<Match> {
        let options = &self.options.lucas_kanade;
        let Buffers { motion, search } = buffers;
        let from_px = track.feature.uv_px;
        let near_px =
            lucas_kanade::track_on_coarse_levels(&self.previous, &self.now, &from_px, guess_px, options, motion)?;
        let (previous, now) = (self.previous.levels().first()?, self.now.levels().first()?);
        let renewed = || ReferencePatch::cut(previous, &self.camera, &from_px, &(near_px - from_px));
        let mut matched = |mut reference: ReferencePatch| {
            let uv_px = reference.find(now, &near_px, &self.options.reference, search)?;
            Some((uv_px, Some(reference)))
        };
        let known = track.reference.clone().and_then(&mut matched);
        let (uv_px, reference) = if let Some(found) = known.or_else(|| renewed().and_then(matched)) {
            found
        } else {
            let (previous, now) = (&self.previous, &self.now);
            (lucas_kanade::track_on_finest_level(previous, now, &from_px, &near_px, options, motion)?, None)
        };
        if self.mask.as_ref().is_some_and(|mask| mask.covers(&uv_px)) {
            return None;
        }
        let bearing = self.camera.unproject(&uv_px)?;
        let TrackedFeature { id, age, .. } = track.feature;
        let now = TrackedFeature { id, age: age + 1, uv_px, previous_uv_px: Some(from_px), bearing };
        Some(Match { previous: track.feature, now, reference })
    }

    /// Pixel of a feature under a rotation of the camera alone; its previous pixel when that is out of view.
    fn rotated(
        &self,
        feature: &TrackedFeature,
        rotation: &UnitQuaternion<f64>,
        rows: Option<&RowRotations>,
    ) -> Vector2<f64> {
        let rotated_px = match rows {
            None => self.camera.project(&(rotation * feature.bearing)),
            Some(rows) => {
                let middle = RowRotations::to_middle(&rows.previous_rad, self.row(&feature.uv_px), &feature.bearing);
                self.at_its_row(&(rotation * middle), &rows.now_rad)
            }
        };
        rotated_px.filter(|uv_px| self.camera.contains(uv_px, 0.0)).unwrap_or(feature.uv_px)
    }

    /// Row of a pixel as a ratio of the image's height.
    fn row(&self, uv_px: &Vector2<f64>) -> f64 {
        uv_px.y / self.camera.resolution_px[1] as f64
    }

    /// Pixel of `middle`, a direction in the camera at the middle row, in the row in which it is observed.
    fn at_its_row(&self, middle: &Vector3<f64>, over_readout_rad: &Vector3<f64>) -> Option<Vector2<f64>> {
        let mut uv_px = self.camera.project(middle)?;
        for _ in 0..ROW_STEPS {
            let bearing = RowRotations::from_middle(over_readout_rad, self.row(&uv_px), middle);
            uv_px = self.camera.project(&bearing)?;
        }
        Some(uv_px)
    }

    /// Bearings of a feature in both images; for a rolling shutter, in the cameras at the middle rows.
    fn pair_of(&self, found: &Match, rows: Option<&RowRotations>) -> BearingPair {
        let Match { previous, now, .. } = found;
        let Some(rows) = rows else { return BearingPair { previous: previous.bearing, now: now.bearing } };
        BearingPair {
            previous: RowRotations::to_middle(&rows.previous_rad, self.row(&previous.uv_px), &previous.bearing),
            now: RowRotations::to_middle(&rows.now_rad, self.row(&now.uv_px), &now.bearing),
        }
    }

    /// Rejects features that do not move with the scene.
    fn reject_outliers(
        &self,
        matches: Vec<Match>,
        expected: Option<&UnitQuaternion<f64>>,
        predicted: Option<&PredictedRotation>,
    ) -> (Vec<Match>, ImageMotion) {
        let rows = predicted.and_then(|predicted| predicted.rows);
        let pairs: Vec<BearingPair> = matches.iter().map(|found| self.pair_of(found, rows.as_ref())).collect();
        let start = expected.copied().unwrap_or_else(UnitQuaternion::identity);
        let focal_px = self.camera.focal_length_px();
        let motion = outliers::estimate_motion(&pairs, &start, predicted, focal_px, &self.options.outliers);
        let kept = matches.into_iter().zip(&motion.is_inlier).filter_map(|(found, inlier)| inlier.then_some(found));
        (kept.collect(), motion)
    }

    /// Removes the errors of the matches that are caused by perspective.
    fn correct_perspective(&self, mut matches: Vec<Match>, rotation: &UnitQuaternion<f64>) -> Vec<Match> {
        for Match { now, reference, .. } in &mut matches {
            let Some(reference) = reference else { continue };
            let uv_px = now.uv_px - reference.perspective_error_px(&self.camera, rotation, &now.bearing);
            if let Some(bearing) = self.camera.unproject(&uv_px) {
                (now.uv_px, now.bearing) = (uv_px, bearing);
            }
        }
        matches
    }

    /// Keeps the longest of tracks that are too near to each other.
    fn remove_crowded(&mut self, mut matches: Vec<Match>) -> Vec<Match> {
        let [width, height] = self.camera.resolution_px;
        self.crowd.reset(width, height, CROWDED_RATIO * self.options.corners.min_distance_px);
        matches.sort_by_key(|found| (std::cmp::Reverse(found.now.age), found.now.id));
        matches.retain(|found| {
            let free = self.crowd.is_free(&found.now.uv_px);
            if free {
                self.crowd.insert(found.now.uv_px);
            }
            free
        });
        matches.sort_by_key(|found| found.now.id);
        matches
    }

    fn detect(&mut self, image: &GrayImage, features: &mut Vec<TrackedFeature>) {
        let existing = features.iter().map(|feature| feature.uv_px);
        self.detector.detect(image, existing, &self.options.corners, self.mask.as_ref(), &mut self.found);
        for uv_px in &self.found {
            if let Some(bearing) = self.camera.unproject(uv_px) {
                let id = FeatureId(self.next_id);
                self.next_id += 1;
                features.push(TrackedFeature { id, age: 0, uv_px: *uv_px, previous_uv_px: None, bearing });
            }
        }
    }

    fn mean_parallax_px(&self, matches: &[Match], rotation: &UnitQuaternion<f64>, rows: Option<&RowRotations>) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for found in matches {
            let rotated_px = match rows {
                None => self.camera.project(&(rotation * found.previous.bearing)),
                Some(rows) => self.at_its_row(&(rotation * self.pair_of(found, Some(rows)).previous), &rows.now_rad),
            };
            if let Some(rotated_px) = rotated_px {
                sum += (found.now.uv_px - rotated_px).norm();
                count += 1;
            }
        }
        if count == 0 { 0.0 } else { sum / f64::from(count) }
    }
}
