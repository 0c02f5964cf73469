//! IMU on the gimbal against the images of its camera and against gravity: clock, axes, unit and sensitivity.

use nalgebra::Vector3;

use crate::geometry::{seconds_from_ns, so3};
use crate::log_check::clock_alignment::{
    OFFSET_TOLERANCE_S, ORIENTATION_TOLERANCE_RAD, RotationReference, align_clocks,
};
use crate::log_check::imu::spectrum::check_gimbal_vibration;
use crate::log_check::report::{Area, Findings, ImageRotation, Measurement, Severity};
use crate::log_check::statistics::{SIGNIFICANT_SIGMAS, median};
use crate::log_check::survey::Survey;
use crate::sensors::{AngularRates, CameraMount, CameraRig, GimbalImuRig, Rig};

/// Largest magnitude of a time offset in the search.
const MAX_OFFSET_S: f64 = 0.5;
/// Tolerated ratio of the difference of the median specific force from gravity: accelerations of a flight, and a bias.
const GRAVITY_TOLERANCE: f64 = 0.15;

/// Checks the IMU on the gimbal by the image rotations of the gimbal's camera, if there are any, and by gravity.
pub(crate) fn check_gimbal_imu(survey: &Survey, rig: &Rig, rotations: &[ImageRotation], findings: &mut Findings) {
    let Some(imu) = rig.gimbal_imu.as_ref().filter(|_| !survey.gimbal_imu.is_empty()) else { return };
    check_gravity(survey, rig, findings);
    check_gimbal_vibration(&survey.gimbal_imu, findings);
    let camera = rig.cameras.iter().find(|camera| camera.mount == CameraMount::Gimbal);
    if let Some(camera) = camera.filter(|_| findings.can_compare(Measurement::Gyroscope)) {
        check_against_images(survey, imu, camera, rotations, findings);
    }
}

/// Compares the median magnitude of the specific force with gravity.
fn check_gravity(survey: &Survey, rig: &Rig, findings: &mut Findings) {
    let forces: Vec<f64> = survey.gimbal_imu.iter().map(|sample| sample.specific_force_m_per_s2.norm()).collect();
    let (found, gravity) = (median(&forces), rig.gravity_m_per_s2);
    let evidence = format!("median specific force {found:.2} m/s², gravity {gravity:.2} m/s²");
    if (found / gravity - 1.0).abs() < GRAVITY_TOLERANCE {
        return findings.good(Area::Imu, "the IMU on the gimbal measures gravity", evidence);
    }
    let remedy = "check its units (m/s², with gravity), and that imu1.rostopic is a raw IMU";
    findings.add(Severity::Error, Area::Imu, "the IMU on the gimbal does not measure gravity", evidence, remedy);
}

/// Compares clock and axes with the rotations between images.
fn check_against_images(
    survey: &Survey,
    imu: &GimbalImuRig,
    camera: &CameraRig,
    rotations: &[ImageRotation],
    findings: &mut Findings,
) {
    let of_camera: Vec<ImageRotation> =
        rotations.iter().filter(|rotation| rotation.camera_key == camera.key).cloned().collect();
    if of_camera.is_empty() {
        return;
    }
    let rates = survey
        .gimbal_imu
        .iter()
        .map(|sample| (seconds_from_ns(sample.stamp_ns) + imu.timeshift_s, sample.angular_velocity_rad_per_s));
    let reference = RotationReference::Gyroscope(AngularRates::new(rates));
    let found = match align_clocks(&of_camera, &reference, camera.timeshift_cam_imu_s, MAX_OFFSET_S) {
        Ok(found) => found,
        Err(error) => {
            let title = "clock and axes of the IMU on the gimbal cannot be checked by images";
            return findings.add(Severity::Note, Area::Extrinsics, title, error.to_string(), "rotate the camera more");
        }
    };
    // Images that are later by this in IMU time are matched by a gyroscope whose stamps are too late by it.
    let (late_s, sigma_s) = (found.offset_s - camera.timeshift_cam_imu_s, found.offset_sigma_s);
    let evidence = format!(
        "stamps {:+.1} ± {:.1} ms later than in the rig; {} image rotations of {:.3}° in the median then differ by {:.3}°",
        late_s * 1e3,
        sigma_s * 1e3,
        found.rotations,
        found.rotation_deg,
        found.residual_deg
    );
    if late_s.abs() < OFFSET_TOLERANCE_S.max(SIGNIFICANT_SIGMAS * sigma_s) {
        let title = format!("the IMU on the gimbal and {} are synchronized", camera.key);
        findings.good(Area::Time, title, evidence);
    } else {
        let title = format!("time offset of the IMU on the gimbal: {:+.0} ms", -late_s * 1e3);
        let remedy = format!("set imu1.timeshift_imu1_imu to {:+.3}", imu.timeshift_s - late_s);
        findings.add(Severity::Warning, Area::Time, title, evidence, remedy);
    }
    let measured = so3::exp(&Vector3::from(found.camera_from_body_rad));
    let error_rad = imu.camera_from_imu.rotation.angle_to(&measured);
    let evidence = format!(
        "image rotations fit axes that are rotated by {:.1}° from T_cam_imu; scale {:.3}",
        error_rad.to_degrees(),
        found.scale
    );
    if error_rad < ORIENTATION_TOLERANCE_RAD {
        return findings.good(Area::Extrinsics, "the axes of the IMU on the gimbal agree with the rig", evidence);
    }
    let inverse_rad = imu.camera_from_imu.rotation.inverse().angle_to(&measured);
    let title = format!("the axes of the IMU on the gimbal differ from the rig by {:.0}°", error_rad.to_degrees());
    let remedy = if inverse_rad < ORIENTATION_TOLERANCE_RAD {
        "write the inverse of imu1.T_cam_imu: it maps points from this IMU to the camera"
    } else {
        "correct the rotation of imu1.T_cam_imu: its columns are the axes of this IMU in the camera (x right, y down, z \
         forward)"
    };
    findings.add(Severity::Error, Area::Extrinsics, title, evidence, remedy);
}
