//! Matches between the cameras of stereo pairs, and distances by motion, which `check` compares with the rig.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Vector3;
use rayon::prelude::*;

use super::frame_camera::TOGETHER_NS;
use super::partner_images::PartnerImages;
use crate::estimator::initialization::{
    InitializationFrame, InitializationInput, InitializationOptions, InitializationOutcome, InitializationSolution,
    try_initialize,
};
use crate::flight_log::{FlightLog, FrameStream, SensorFrame, image_stamps};
use crate::frontend::corners::CornerOptions;
use crate::frontend::{
    FeatureId, FrontEnd, FrontEndOptions, StereoCamera, StereoMatcher, TrackedFrame, inverse_distance_per_m,
};
use crate::geometry::{median, ns_from_seconds, seconds_from_ns};
use crate::log_check::{PairMatches, PairMeasurement, median_apart_s};
use crate::sensors::{CameraMount, CameraRig, Rig};

/// Sections of a log in which a pair is measured, and their length in seconds.
const SECTIONS: usize = 4;
const SECTION_S: f64 = 4.5;
/// One pair of images in this many is matched for the relative pose.
const MATCH_EVERY: usize = 5;
/// Angle across the epipolar curves within which matches are searched for, 3°.
const ACROSS_RAD: f64 = 0.052;
/// Features of an image that are matched.
const FEATURES: usize = 100;
/// Noise of a tracked feature in pixels.
const PIXEL_SIGMA_PX: f64 = 0.5;
/// Smallest number of landmarks whose distances by motion and by the pair are compared.
const MIN_LANDMARKS: usize = 12;

/// Measurements of the stereo pairs of a rig without joint angles, whose topic may be unreadable; a pair whose images cannot be read has no matches.
pub(super) fn stereo_pairs(log: &Arc<FlightLog>, rig: &Rig) -> Vec<PairMeasurement> {
    let pairs = rig.cameras.iter().filter_map(|camera| Some([camera, rig.stereo_partner(camera)?]));
    pairs.map(|cameras| measurement(log, rig, cameras)).collect()
}

fn measurement(log: &Arc<FlightLog>, rig: &Rig, cameras: [&CameraRig; 2]) -> PairMeasurement {
    let stamps =
        cameras.map(|camera| image_stamps(log, camera, 0).map(Iterator::collect::<Vec<i64>>).unwrap_or_default());
    let keys = cameras.map(|camera| camera.key.clone());
    let apart_s = median_apart_s(&stamps[0], &stamps[1]);
    if apart_s.is_none_or(|apart_s| ns_from_seconds(apart_s) > TOGETHER_NS) {
        return PairMeasurement { keys, apart_s, ..PairMeasurement::default() };
    }
    let duration_s = seconds_from_ns(log.duration_ns());
    let length_s = SECTION_S.min(duration_s / SECTIONS as f64).max(SECTION_S.min(duration_s));
    let start_s = |number: usize| (duration_s - length_s) * (number as f64 + 0.5) / SECTIONS as f64;
    let sections: Vec<Section> =
        (0..SECTIONS).into_par_iter().map(|number| section(log, rig, cameras, start_s(number), length_s)).collect();
    let (matches, distance_ratios): (Vec<_>, Vec<_>) =
        sections.into_iter().map(|section| (section.matches, section.distance_ratio)).unzip();
    PairMeasurement {
        keys,
        matches: matches.into_iter().flatten().collect(),
        apart_s,
        distance_ratios: distance_ratios.into_iter().flatten().collect(),
    }
}

#[derive(Default)]
struct Section {
    matches: Vec<PairMatches>,
    /// Ratio of distances by motion to those by the pair, with its standard deviation.
    distance_ratio: Option<(f64, f64)>,
}

/// Frame of the first camera with its tracks, and the bearings of its features in the second one.
struct Frame {
    frame: SensorFrame,
    tracks: TrackedFrame,
    matched: BTreeMap<FeatureId, Vector3<f64>>,
}

fn section(log: &Arc<FlightLog>, rig: &Rig, cameras: [&CameraRig; 2], start_s: f64, length_s: f64) -> Section {
    let [first, second] = cameras;
    let stream = |camera: &CameraRig| FrameStream::new(Arc::clone(log), rig, &camera.key, start_s, Some(length_s));
    let (Ok(mut stream), Ok(others)) = (stream(first), stream(second)) else { return Section::default() };
    let Some(first_from_second) = rig.base_from_camera(Some(&first.key), &second.key) else {
        return Section::default();
    };
    let masked = |camera: &CameraRig| camera.mask.as_ref().map(|mask| mask.image.clone());
    let corners = CornerOptions { max_features: FEATURES, ..CornerOptions::default() };
    let mut front_end = FrontEnd::new(first.model.clone(), FrontEndOptions { corners, ..FrontEndOptions::default() })
        .with_mask(masked(first));
    let camera = StereoCamera {
        model: second.model.clone(),
        mask: masked(second),
        here_from_features: first_from_second.inverse(),
        orientation_sigma_rad: 0.0,
    };
    let mut matcher = StereoMatcher::new(first.model.clone(), camera).untrusting(ACROSS_RAD);
    let mut others = PartnerImages::new(others);
    let mut frames: Vec<Frame> = Vec::new();
    while let Some(frame) = stream.next_frame() {
        let Ok(tracks) = front_end.process(&frame.image, frame.stamp_ns, None) else { continue };
        let mut matched = BTreeMap::new();
        if frames.len().is_multiple_of(MATCH_EVERY)
            && let Some(other) = others.of_moment(&frame)
        {
            let found = matcher.match_features(front_end.last_image(), &other.image, &tracks.features);
            matched.extend(found.into_iter().map(|feature| (feature.id, feature.bearing)));
        }
        frames.push(Frame { frame, tracks, matched });
    }
    Section {
        matches: frames.iter().filter(|frame| !frame.matched.is_empty()).map(|frame| matches(frame, second)).collect(),
        distance_ratio: solution(rig, first, &frames)
            .and_then(|solution| distance_ratio(&solution, &frames, &first_from_second.inverse())),
    }
}

fn matches(frame: &Frame, second: &CameraRig) -> PairMatches {
    let rates = frame.frame.imu.iter().rev().take(3).map(|sample| sample.angular_velocity_rad_per_s);
    let count = frame.frame.imu.len().clamp(1, 3) as f64;
    let rate = rates.sum::<Vector3<f64>>() / count;
    let rate_rad_per_s = match &second.mount {
        CameraMount::Static { imu_from_camera } => imu_from_camera.rotation.inverse() * rate,
        CameraMount::Gimbal => rate,
    };
    let bearings =
        frame.tracks.features.iter().filter_map(|feature| Some([feature.bearing, *frame.matched.get(&feature.id)?]));
    PairMatches { stamp_ns: frame.frame.stamp_ns, rate_rad_per_s, bearings: bearings.collect() }
}

/// Distances by motion and IMU, from the first camera alone; `None` without enough motion.
fn solution(rig: &Rig, camera: &CameraRig, frames: &[Frame]) -> Option<InitializationSolution> {
    let CameraMount::Static { imu_from_camera } = &camera.mount else { return None };
    let frames: Vec<InitializationFrame<'_>> = frames
        .iter()
        .map(|frame| InitializationFrame {
            frame_index: frame.frame.index,
            stamp_ns: frame.frame.stamp_ns,
            features: &frame.tracks.features,
            matched: &[],
            imu_from_camera: *imu_from_camera,
            imu: &frame.frame.imu,
        })
        .collect();
    let (translation_m, rotation_rad) = rig.extrinsics_prior(camera).sigmas();
    let options = InitializationOptions::default()
        .for_camera(camera.model.focal_length_px(), PIXEL_SIGMA_PX)
        .for_rigid_camera(rotation_rad, translation_m);
    let input = InitializationInput {
        frames: &frames,
        gravity_m_per_s2: rig.gravity_m_per_s2,
        imu_noise: rig.imu.noise,
        stationary: None,
        bias: None,
        pair: None,
    };
    match try_initialize(&input, &options) {
        InitializationOutcome::Initialized(solution) => Some(*solution),
        InitializationOutcome::Waiting { .. } => None,
    }
}

/// Median ratio of the distances of a solution to those by the pair, with its standard deviation.
fn distance_ratio(
    solution: &InitializationSolution,
    frames: &[Frame],
    second_from_first: &crate::geometry::RigidTransform,
) -> Option<(f64, f64)> {
    let by_index: BTreeMap<usize, &Frame> = frames.iter().map(|frame| (frame.frame.index, frame)).collect();
    let mut ratios = Vec::new();
    for view in &solution.frames {
        let Some(frame) = by_index.get(&view.frame_index).filter(|frame| !frame.matched.is_empty()) else { continue };
        let camera_m = (view.world_from_imu * view.imu_from_camera).translation_m;
        for landmark in &solution.landmarks {
            let Some(there) = frame.matched.get(&landmark.id) else { continue };
            let Ok(place) = frame.tracks.features.binary_search_by_key(&landmark.id, |feature| feature.id) else {
                continue;
            };
            let bearing = &frame.tracks.features[place].bearing;
            let inverse_per_m = inverse_distance_per_m(second_from_first, bearing, there);
            ratios.push((landmark.position_m - camera_m).norm() * inverse_per_m);
        }
    }
    let ratio = median(ratios.iter().copied()).filter(|ratio| *ratio > 0.0)?;
    (ratios.len() >= MIN_LANDMARKS).then_some((ratio, ratio * solution.diagnostics.scale_sigma))
}
