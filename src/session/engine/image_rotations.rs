//! Camera rotations between images, estimated from the images alone. `check` compares them with the rig.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::stereo_pairs::stereo_pairs;
use crate::camera::CameraModel;
use crate::estimator::initialization::relative_pose::{RotationPrior, relative_poses};
use crate::flight_log::{FlightLog, FrameStream, ImageReader, LogError, MessageKind};
use crate::frontend::readout::{RowObservation, RowTrack};
use crate::frontend::{FeatureId, FrontEnd, FrontEndOptions, TrackedFeature, TrackedFrame};
use crate::geometry::seconds_from_ns;
use crate::log_check::{self, CheckReport, ImageRotation};
use crate::sensors::{CameraRig, GrayImage, Rig};

/// Smallest and largest number of sections of the log, evenly spaced: a fault that begins in the flight is found in logs
/// up to their length together, and a section per processor core is read at a time.
const SECTIONS: [usize; 2] = [2, 10];
/// Length of a section in seconds.
const SECTION_S: f64 = 5.0;
/// Time offset in seconds from which on the stamps belong to another clock.
const ANOTHER_CLOCK_S: f64 = 1.0;
/// Standard deviation of a tracked feature's position, per coordinate, in pixels.
const PIXEL_SIGMA_PX: f64 = 0.5;
/// Standard deviation of a camera's rotation between consecutive images, per axis. It does not depend on the rig,
/// because the rig is checked.
const ROTATION_SIGMA_RAD: f64 = 0.3;
/// Minimum number of common features for a rotation.
const MIN_PAIRS: usize = 30;
const MIN_INLIER_RATIO: f64 = 0.6;

/// Checks a log against its rig with the rotations between its images and the matches of its stereo pairs.
pub fn check_log(log: &Arc<FlightLog>, rig: &Rig) -> CheckReport {
    let mut report = log_check::check(log, Ok(rig), &image_rotations(log, rig));
    report.add_pairs(rig, &stereo_pairs(log, &without_joint_topic(rig)));
    report
}

/// Rotations between consecutive images of some sections of the log, for every camera of the rig that the log has.
///
/// They do not depend on gyroscope, encoders and extrinsics. A camera whose images cannot be read has none; `check`
/// reports the reason.
pub fn image_rotations(log: &Arc<FlightLog>, rig: &Rig) -> Vec<ImageRotation> {
    let rig = &without_joint_topic(rig);
    let jobs: Vec<(&CameraRig, f64, f64)> = rig
        .cameras
        .iter()
        .flat_map(|camera| {
            let (begin_s, duration_s) = span_of(log, rig, camera);
            let sections = ((duration_s / SECTION_S).ceil() as usize).clamp(SECTIONS[0], SECTIONS[1]);
            let length_s = SECTION_S.min(duration_s / sections as f64);
            let middle_s = move |number: usize| begin_s + duration_s * (number as f64 + 0.5) / sections as f64;
            (0..sections).map(move |number| (camera, middle_s(number) - 0.5 * length_s, length_s))
        })
        .collect();
    let found: Vec<Vec<ImageRotation>> = jobs
        .par_iter()
        .map(|(camera, start_s, length_s)| rotations_of(log, rig, camera, *start_s, *length_s))
        .collect();
    found.into_iter().flatten().collect()
}

/// The rig without joint angles: an unreadable topic of them must not prevent reading the images.
fn without_joint_topic(rig: &Rig) -> Rig {
    let mut rig = rig.clone();
    if let Some(gimbal) = &mut rig.gimbal {
        gimbal.topic = None;
    }
    rig
}

/// First stamp and duration of a camera's images in camera time, in seconds: start and duration of the log, unless the
/// time offset of the rig is an offset between two clocks.
fn span_of(log: &Arc<FlightLog>, rig: &Rig, camera: &CameraRig) -> (f64, f64) {
    let of_log = (0.0, seconds_from_ns(log.duration_ns()));
    if camera.timeshift_cam_imu_s.abs() < ANOTHER_CLOCK_S {
        return of_log;
    }
    let stamps = ImageReader::new(Arc::clone(log), rig).stamps_ns(&camera.key);
    match (stamps.first(), stamps.last()) {
        (Some((_, first_ns)), Some((_, last_ns))) => {
            (seconds_from_ns(*first_ns), seconds_from_ns(last_ns.saturating_sub(*first_ns)))
        }
        _ => of_log,
    }
}

fn rotations_of(
    log: &Arc<FlightLog>,
    rig: &Rig,
    camera: &CameraRig,
    start_s: f64,
    length_s: f64,
) -> Vec<ImageRotation> {
    let Ok(mut stream) = FrameStream::new(Arc::clone(log), rig, &camera.key, start_s, Some(length_s)) else {
        return Vec::new();
    };
    between(camera, std::iter::from_fn(|| stream.next_frame().map(|frame| (frame.stamp_ns, frame.image))))
}

/// Rotations between consecutive images of one camera in evenly spaced sections of its images. Of the rig, only the
/// camera model is needed: the stamps may be on another clock than the IMU's.
///
/// # Errors
/// If the log has no such camera.
pub fn camera_rotations(
    log: &Arc<FlightLog>,
    rig: &Rig,
    camera_key: &str,
    sections: usize,
    section_s: f64,
) -> Result<Vec<ImageRotation>, LogError> {
    let camera = rig.camera(camera_key)?;
    log.require_topic(&format!("{camera_key}.rostopic"), &camera.topic, &MessageKind::IMAGES)?;
    let stamps = ImageReader::new(Arc::clone(log), rig).stamps_ns(camera_key);
    let duration_s = match (stamps.first(), stamps.last()) {
        (Some((_, first)), Some((_, last))) if last > first => seconds_from_ns(last - first),
        _ => return Ok(Vec::new()),
    };
    let length = ((section_s / duration_s * stamps.len() as f64).ceil() as usize).clamp(1, stamps.len());
    // A short video is one section.
    let (sections, length) = if sections * length >= stamps.len() { (1, stamps.len()) } else { (sections, length) };
    let of_section = |number: usize| {
        let middle = stamps.len() * (2 * number + 1) / (2 * sections);
        let first = middle.saturating_sub(length / 2).min(stamps.len() - length);
        let reader = ImageReader::new(Arc::clone(log), rig);
        let image = |(index, stamp_ns): &(usize, i64)| Some((*stamp_ns, reader.image(camera_key, *index).ok()?));
        between(camera, stamps[first..first + length].iter().filter_map(image))
    };
    let found: Vec<Vec<ImageRotation>> = (0..sections).into_par_iter().map(of_section).collect();
    Ok(found.into_iter().flatten().collect())
}

/// Rotations between consecutive images with their stamps.
fn between(camera: &CameraRig, images: impl Iterator<Item = (i64, Arc<GrayImage>)>) -> Vec<ImageRotation> {
    let mask = camera.mask.as_ref().map(|mask| mask.image.clone());
    let mut front_end = FrontEnd::new(camera.model.clone(), FrontEndOptions::default()).with_mask(mask);
    let mut previous: Option<(TrackedFrame, i64)> = None;
    let mut rotations = Vec::new();
    for (stamp_ns, image) in images {
        let Ok(tracks) = front_end.process(&image, stamp_ns, None) else { continue };
        if let Some((before, from_ns)) = &previous
            && let Some(second_from_first) = rotation_between(&camera.model, before, &tracks)
        {
            let (camera_key, to_ns) = (camera.key.clone(), stamp_ns);
            let tracks = row_tracks(camera, before, &tracks);
            rotations.push(ImageRotation { camera_key, from_ns: *from_ns, to_ns, second_from_first, tracks });
        }
        previous = Some((tracks, stamp_ns));
    }
    rotations
}

/// Features observed in both images, with their image rows.
fn row_tracks(camera: &CameraRig, first: &TrackedFrame, second: &TrackedFrame) -> Vec<RowTrack> {
    let height_px = camera.model.resolution_px[1] as f64;
    let observation =
        |feature: &TrackedFeature| RowObservation { bearing: feature.bearing, row: feature.uv_px.y / height_px };
    let before: BTreeMap<FeatureId, RowObservation> =
        first.features.iter().map(|feature| (feature.id, observation(feature))).collect();
    let track =
        |feature: &TrackedFeature| Some(RowTrack { previous: *before.get(&feature.id)?, now: observation(feature) });
    second.features.iter().filter_map(track).collect()
}

/// Rotation `second_from_first` of the camera from the features observed in both images, `None` with too few inliers.
pub(in crate::session) fn rotation_between(
    model: &CameraModel,
    first: &TrackedFrame,
    second: &TrackedFrame,
) -> Option<UnitQuaternion<f64>> {
    let focal_px = 0.5 * (model.intrinsics_px[0] + model.intrinsics_px[1]);
    let before: BTreeMap<FeatureId, Vector3<f64>> =
        first.features.iter().map(|feature| (feature.id, feature.bearing)).collect();
    let pairs: Vec<(Vector3<f64>, Vector3<f64>)> =
        second.features.iter().filter_map(|feature| Some((*before.get(&feature.id)?, feature.bearing))).collect();
    if pairs.len() < MIN_PAIRS {
        return None;
    }
    let prior = RotationPrior { rotation: UnitQuaternion::identity(), sigma_rad: ROTATION_SIGMA_RAD };
    let best =
        relative_poses(&pairs, &prior, PIXEL_SIGMA_PX / focal_px, second.stamp_ns.unsigned_abs()).into_iter().next()?;
    let fits = best.inliers.len() as f64 >= MIN_INLIER_RATIO * pairs.len() as f64;
    fits.then_some(best.camera_j_from_camera_i.rotation)
}
