//! Extrinsics of the cameras compared with gravity and the gyroscope, and the plausibility of their values.

mod hand_eye;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use nalgebra::{UnitQuaternion, Vector3};

use self::hand_eye::HandEyeOutcome;
use super::imu::ImuFacts;
use super::report::suspects::Suspects;
use super::report::{Area, Findings, ImageRotation, Measurement, Severity};
use super::rotations::data::{MeasuredRotation, RotationData};
use super::rotations::readout::check_readout;
use super::survey::Survey;
use crate::geometry::{RigidTransform, seconds_from_ns};
use crate::sensors::{CameraMount, CameraRig, Rig};

/// A camera farther from the IMU than this is unusual on a drone.
pub(super) const MAX_LEVER_M: f64 = 1.0;
/// Elevation of an optical axis, in degrees, beyond which it counts as vertical: its roll is then inaccurate.
const VERTICAL_DEG: f64 = 70.0;
/// Largest roll of an upright camera, in degrees.
const UPRIGHT_ROLL_DEG: f64 = 45.0;
/// Largest roll by the inverse matrix, in degrees, with which it counts as the right one.
const INVERSE_ROLL_DEG: f64 = 30.0;

/// Rotations of a camera with the findings on its readout.
pub(super) struct CameraRotations<'a> {
    data: RotationData<'a>,
    of_readout: Findings,
}

/// Rotations of all cameras between the first rows of consecutive images.
pub(super) fn camera_rotations<'a>(
    survey: &'a Survey,
    rig: &'a Rig,
    imu_facts: &'a ImuFacts,
    rotations: &'a [ImageRotation],
) -> Vec<CameraRotations<'a>> {
    let of_camera = |camera| {
        let mut of_readout = Findings::default();
        let readout_s = check_readout(rig, camera, imu_facts, rotations, &mut of_readout);
        let data = RotationData::new(survey, rig, imu_facts, camera, rotations, readout_s);
        CameraRotations { data, of_readout }
    };
    rig.cameras.iter().map(of_camera).collect()
}

/// Those rotations by camera key.
pub(super) fn measured_of(cameras: &[CameraRotations<'_>]) -> BTreeMap<String, Vec<MeasuredRotation>> {
    cameras.iter().map(|it| (it.data.camera.key.clone(), it.data.measured.clone())).collect()
}

/// Checks the extrinsics of all cameras; `suspects` are the sensors that may be the cause of the misfit of a camera with a key.
/// Returns rotations of the IMU, in its frame, that would explain the orientations of rigid cameras that differ from the rig.
pub(super) fn check_rotations(
    cameras: Vec<CameraRotations<'_>>,
    suspects: impl Fn(&str) -> Suspects,
    findings: &mut Findings,
) -> Vec<UnitQuaternion<f64>> {
    let mut of_imu = Vec::new();
    for CameraRotations { data, mut of_readout } in cameras {
        let RotationData { survey, rig, imu_facts, camera, .. } = data;
        check_against_gravity(survey, rig, camera, imu_facts, findings);
        check_lever(camera, findings);
        match hand_eye::check_against_gyroscope(data, &suspects(&camera.key), findings) {
            // By a wrong lens, features move faster in one half of the image, as by a rolling shutter.
            HandEyeOutcome::WrongIntrinsics => continue,
            HandEyeOutcome::OtherOrientation(rotation) => of_imu.push(rotation),
            HandEyeOutcome::Other => {}
        }
        findings.list.append(&mut of_readout.list);
    }
    of_imu
}

/// `imu_from_camera` at a time, with the measured joint angles for a gimbal camera.
fn imu_from_camera(survey: &Survey, rig: &Rig, camera: &CameraRig, stamp_ns: i64) -> Option<RigidTransform> {
    let chain = rig.chain_of_camera(&camera.key)?;
    let angles_rad = if chain.links.is_empty() { Vec::new() } else { survey.joint_angles_at(stamp_ns)? };
    Some(chain.imu_from_camera(&angles_rad))
}

/// Roll about the optical axis, and elevation of that axis relative to gravity, in whole degrees; both are zero for an
/// upright camera with a horizontal axis.
fn attitude_deg(camera_from_imu: &UnitQuaternion<f64>, up_in_imu: &Vector3<f64>) -> (f64, f64) {
    let up = camera_from_imu * up_in_imu;
    // Adding zero converts −0 to 0.
    let degrees = |angle_rad: f64| angle_rad.to_degrees().round() + 0.0;
    (degrees(up.x.atan2(-up.y)), degrees(up.z.clamp(-1.0, 1.0).asin()))
}

fn check_against_gravity(
    survey: &Survey,
    rig: &Rig,
    camera: &CameraRig,
    imu_facts: &ImuFacts,
    findings: &mut Findings,
) {
    let moves = camera.mount == CameraMount::Gimbal;
    if !findings.can_compare(Measurement::Accelerometer) || (moves && !findings.can_compare(Measurement::Joints)) {
        return;
    }
    let Some((stamp_ns, force)) = imu_facts.up else { return };
    let Some(up_in_imu) = force.try_normalize(1.0) else { return };
    let Some(pose) = imu_from_camera(survey, rig, camera, stamp_ns) else { return };
    let (roll, elevation) = attitude_deg(&pose.rotation.inverse(), &up_in_imu);
    let (inverse_roll, inverse_elevation) = attitude_deg(&pose.rotation, &up_in_imu);
    let evidence = format!(
        "relative to the specific force at {:.1} s: elevation of the optical axis {elevation:+.0}°, image roll {roll:+.0}°; \
         with the inverse matrix {inverse_elevation:+.0}° and {inverse_roll:+.0}°",
        seconds_from_ns(stamp_ns)
    );
    if elevation.abs() > VERTICAL_DEG || roll.abs() < UPRIGHT_ROLL_DEG {
        return findings.good(Area::Extrinsics, format!("{} is upright", camera.key), evidence);
    }
    let inverted = inverse_roll.abs() < INVERSE_ROLL_DEG && inverse_elevation.abs() < VERTICAL_DEG;
    let field = if camera.mount == CameraMount::Gimbal { "gimbal.T_I_B and T_E_C" } else { "T_cam_imu" };
    let (severity, title) = if inverted {
        (Severity::Error, format!("the extrinsics of {} appear inverted", camera.key))
    } else {
        (Severity::Note, format!("{} is rotated sideways or upside down", camera.key))
    };
    let remedy = format!("check {field}: T_a_b maps points from b to a (Kalibr: T_cam_imu from the IMU to the camera)");
    findings.add(severity, Area::Extrinsics, title, evidence, remedy);
}

fn check_lever(camera: &CameraRig, findings: &mut Findings) {
    let CameraMount::Static { imu_from_camera } = &camera.mount else { return };
    let lever_m = imu_from_camera.translation_m.norm();
    if lever_m > MAX_LEVER_M {
        let evidence = format!("{lever_m:.3} m from the IMU");
        let title = format!("{} is far from the IMU", camera.key);
        findings.add(Severity::Warning, Area::Extrinsics, title, evidence, "the translation of T_cam_imu is in metres");
    }
    if imu_from_camera.rotation.angle() == 0.0 {
        let title = format!("the rotation of {} is the identity", camera.key);
        let evidence = "the axes of camera and IMU coincide by T_cam_imu: z forward, x right, y down";
        let remedy = "this is usually a default value: calibrate it, for example with Kalibr";
        findings.add(Severity::Warning, Area::Extrinsics, title, evidence, remedy);
    }
}
