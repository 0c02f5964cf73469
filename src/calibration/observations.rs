//! Conversion of the front end's tracks to tracks of the bundle.

use std::collections::BTreeMap;

use super::frame_sets::FrameSet;
use super::state::{AnchoredLandmark, Camera, ViewId};
use super::visual::{BundleTrack, PixelModel};
use super::{CalibrationInput, CalibrationOptions};
use crate::frontend::{FeatureId, ObservedPixel, TrackedFrame};
use crate::optimization::{CameraPose, Ray};

/// Tracked features of a camera in a frame set.
pub(super) fn tracked<'a>(
    input: &'a CalibrationInput,
    frame_set: &FrameSet,
    camera: Camera,
) -> Option<&'a TrackedFrame> {
    match camera {
        Camera::Static => Some(&input.static_camera.views[frame_set.static_view].tracks),
        Camera::Gimbal => frame_set.gimbal.as_ref().map(|gimbal| &*input.gimbal_camera.views[gimbal.view].tracks),
    }
}

/// Tracks of one camera over the frame sets that satisfy `wanted`, cut to the largest length of
/// the options; the parts of one track have no common observation.
pub(super) fn collect(
    input: &CalibrationInput,
    options: &CalibrationOptions,
    frame_sets: &[FrameSet],
    camera: Camera,
    wanted: &dyn Fn(usize) -> bool,
) -> Vec<BundleTrack> {
    let mut open: BTreeMap<FeatureId, BundleTrack> = BTreeMap::new();
    let mut finished = Vec::new();
    for (index, frame_set) in frame_sets.iter().enumerate() {
        let Some(frame) = tracked(input, frame_set, camera).filter(|_| wanted(index)) else { continue };
        for feature in &frame.features {
            let Some(observation) = feature.seen_in(ViewId::new(index, camera)) else { continue };
            let track = open.entry(feature.id).or_default();
            let begin = track.observations.first().map_or(index, |first| first.view.frame_set());
            if index - begin >= options.max_frame_sets_per_track {
                finished.push(std::mem::take(track));
            }
            track.observations.push(observation);
        }
    }
    finished.extend(open.into_values());
    finished.retain(|track| track.observations.len() >= options.min_observations);
    finished.sort_by_key(|track| track.observations[0].view);
    finished
}

/// Triangulates the tracks with the current poses; omits tracks without a landmark.
pub(super) fn triangulated(
    tracks: Vec<BundleTrack>,
    poses: &BTreeMap<ViewId, CameraPose>,
    options: &CalibrationOptions,
) -> (Vec<BundleTrack>, Vec<AnchoredLandmark>) {
    tracks
        .into_iter()
        .filter_map(|track| {
            let ray = |observation: &ObservedPixel<ViewId>| {
                let pose = poses.get(&observation.view)?;
                Some(Ray { centre: pose.position_m, direction: pose.rotation * observation.bearing })
            };
            let rays: Vec<Ray> = track.observations.iter().filter_map(ray).collect();
            let landmark = AnchoredLandmark::triangulate(&rays, options.min_parallax_rad)?;
            Some((track, landmark))
        })
        .unzip()
}

/// Drops observations with residuals beyond `limit` standard deviations, and landmarks with too few
/// remaining observations.
pub(super) fn without_outliers(
    tracks: Vec<BundleTrack>,
    landmarks: &[AnchoredLandmark],
    poses: &BTreeMap<ViewId, CameraPose>,
    pixels: &PixelModel<'_>,
    limit: f64,
    options: &CalibrationOptions,
) -> (Vec<BundleTrack>, Vec<AnchoredLandmark>) {
    tracks
        .into_iter()
        .zip(landmarks)
        .filter_map(|(mut track, landmark)| {
            track.observations.retain(|observation| {
                let sigma = pixels.sigma_px[observation.view.0 % 2];
                pixels
                    .residual_px(poses, landmark, observation)
                    .is_some_and(|residual| residual.norm() <= limit * sigma)
            });
            (track.observations.len() >= options.min_observations).then_some((track, *landmark))
        })
        .unzip()
}

/// Lengths of the reprojection residuals of one camera, in pixels.
pub(super) fn residual_lengths_px(
    tracks: &[BundleTrack],
    landmarks: &[AnchoredLandmark],
    poses: &BTreeMap<ViewId, CameraPose>,
    pixels: &PixelModel<'_>,
    camera: Camera,
) -> Vec<f64> {
    tracks
        .iter()
        .zip(landmarks)
        .flat_map(|(track, landmark)| track.observations.iter().map(move |observation| (landmark, observation)))
        .filter(|(_, observation)| observation.view.camera() == camera)
        .filter_map(|(landmark, observation)| pixels.residual_px(poses, landmark, observation))
        .map(|residual| residual.norm())
        .collect()
}
