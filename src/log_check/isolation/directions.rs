//! Directions in which a camera moves by the features of its images, against the positions of the ground truth. Scale and
//! sign are unobservable, so that the angle between two lines is compared.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::compared::{Compared, Poses};
use super::orientations::imu_from_camera;
use crate::geometry::{RigidTransform, ns_from_seconds, seconds_from_ns};
use crate::log_check::report::ImageRotation;
use crate::log_check::statistics::median;
use crate::sensors::CameraRig;

/// Standard deviation of the angle between sound directions, in radians: few pixels of parallax from image to image.
pub(super) const NOISE_RAD: f64 = 0.12;
/// Speed from which directions are compared, in m/s.
const MIN_SPEED_M_PER_S: f64 = 0.5;
/// Minimum number of features of an image, and of compared images.
const MIN_FEATURES: usize = 20;
const MIN_DIRECTIONS: usize = 20;
/// Features whose misfit exceeds the median by this factor are not used in a second round.
const OUTLIER_RATIO: f64 = 3.0;

/// Times in seconds and angles in radians between the directions of a camera's motion by images and by poses whose body has
/// the axes `body_from_imu` and whose stamps are stamps of the IMU less `delay_s`; empty with too few.
pub(super) fn angles_rad(
    compared: &Compared<'_>,
    camera: &CameraRig,
    body_from_imu: &UnitQuaternion<f64>,
    delay_s: f64,
) -> Vec<[f64; 2]> {
    let images = compared.images.iter().filter(|image| image.camera_key == camera.key);
    let angle = |image: &ImageRotation| {
        let [from_s, to_s] = [image.from_ns, image.to_ns].map(|at| seconds_from_ns(at) + camera.timeshift_cam_imu_s);
        let [from, to] = [from_s, to_s].map(|at_s| pose_after(compared.poses, ns_from_seconds(at_s - delay_s)));
        let (from, to) = (from?, to?);
        let moved_m = to.translation_m - from.translation_m;
        if moved_m.norm() < MIN_SPEED_M_PER_S * (to_s - from_s) {
            return None;
        }
        let world_from_camera = to.rotation * body_from_imu * imu_from_camera(compared, camera, to_s)?.0;
        let by_poses = (world_from_camera.inverse() * moved_m).normalize();
        Some([0.5 * (from_s + to_s), direction(image)?.dot(&by_poses).abs().min(1.0).acos()])
    };
    let angles: Vec<[f64; 2]> = images.filter_map(angle).collect();
    if angles.len() < MIN_DIRECTIONS { Vec::new() } else { angles }
}

/// Direction of the motion between two images in the frame of the second one, up to its sign.
fn direction(image: &ImageRotation) -> Option<Vector3<f64>> {
    // Both rays of a feature and the direction lie in one plane.
    let normals: Vec<Vector3<f64>> = image
        .tracks
        .iter()
        .map(|track| (image.second_from_first * track.previous.bearing).cross(&track.now.bearing))
        .collect();
    if normals.len() < MIN_FEATURES {
        return None;
    }
    let smallest = |normals: &mut dyn Iterator<Item = &Vector3<f64>>| {
        let eigen = normals.map(|normal| normal * normal.transpose()).sum::<Matrix3<f64>>().symmetric_eigen();
        eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned()
    };
    let first = smallest(&mut normals.iter());
    let misfits: Vec<f64> = normals.iter().map(|normal| normal.dot(&first).abs()).collect();
    let limit = OUTLIER_RATIO * median(&misfits);
    let mut kept = normals.iter().zip(&misfits).filter(|(_, misfit)| **misfit <= limit).map(|(normal, _)| normal);
    Some(smallest(&mut kept))
}

fn pose_after(poses: &Poses, at_ns: i64) -> Option<RigidTransform> {
    let after = poses.partition_point(|(pose_ns, _)| *pose_ns < at_ns);
    let [(before_ns, before), (after_ns, pose)] = [poses.get(after.checked_sub(1)?)?, poses.get(after)?];
    let fraction = (at_ns - before_ns) as f64 / (after_ns - before_ns) as f64;
    Some(RigidTransform::new(pose.rotation, before.translation_m.lerp(&pose.translation_m, fraction)))
}
