//! Extrinsic rotations against gravity, and, where somebody has measured image rotations, against the gyroscope.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::super::Rig;
use super::super::rig::{CameraMount, CameraRig};
use super::inertial::InertialFacts;
use super::statistics::median;
use super::survey::Survey;
use super::{Area, Findings, ImageRotation, Severity};
use crate::geometry::{RigidTransform, ns_from_seconds, seconds_from_ns, so3};

/// Fewer image rotations than this say nothing.
const FEWEST_ROTATIONS: usize = 20;
/// Time offsets are searched so far to both sides.
const LARGEST_OFFSET_S: f64 = 0.15;
/// Step of that search.
const OFFSET_STEP_S: f64 = 0.005;
/// Offsets from this size on are told.
const OFFSET_TOLERANCE_S: f64 = 0.008;
/// A camera may be this far from where the rotations say it points.
const ROTATION_TOLERANCE_RAD: f64 = 0.07;

/// Checks every camera's orientation.
pub(super) fn check_rotations(
    survey: &Survey,
    rig: &Rig,
    inertial: &InertialFacts,
    rotations: &[ImageRotation],
    findings: &mut Findings,
) {
    for camera in &rig.cameras {
        check_against_gravity(survey, rig, camera, inertial, findings);
        check_lever(camera, findings);
        let own: Vec<&ImageRotation> = rotations.iter().filter(|rotation| rotation.camera_key == camera.key).collect();
        if own.len() >= FEWEST_ROTATIONS {
            check_against_gyroscope(survey, rig, camera, inertial, &own, findings);
        }
    }
}

/// Pose of a camera on the IMU at a time, from the nearest encoder reading where it sits on the gimbal.
fn imu_from_camera(survey: &Survey, rig: &Rig, camera: &CameraRig, stamp_ns: i64) -> Option<RigidTransform> {
    match &camera.mount {
        CameraMount::Static { imu_from_camera } => Some(*imu_from_camera),
        CameraMount::Gimbal => {
            let gimbal = rig.gimbal.as_ref()?;
            let after = survey.joints.partition_point(|message| message.stamp_ns < stamp_ns);
            let nearest = [after.checked_sub(1), Some(after)]
                .into_iter()
                .flatten()
                .filter_map(|index| survey.joints.get(index))
                .min_by_key(|message| (message.stamp_ns - stamp_ns).abs())
                .filter(|message| (message.stamp_ns - stamp_ns).abs() < 100_000_000)?;
            let angles: Option<Vec<f64>> =
                nearest.angles_rad.iter().map(|angle| angle.filter(|angle| angle.is_finite())).collect();
            Some(gimbal.chain.imu_from_camera(&angles?))
        }
    }
}

/// Roll of the image about the optical axis and elevation of that axis, in whole degrees, seen against gravity. Both are zero
/// for an upright camera that looks at the horizon.
fn attitude_deg(camera_from_imu: &UnitQuaternion<f64>, up_in_imu: &Vector3<f64>) -> (f64, f64) {
    let up = camera_from_imu * up_in_imu;
    // Whole degrees, and no minus before a zero.
    let degrees = |angle_rad: f64| angle_rad.to_degrees().round() + 0.0;
    (degrees(up.x.atan2(-up.y)), degrees(up.z.clamp(-1.0, 1.0).asin()))
}

fn check_against_gravity(
    survey: &Survey,
    rig: &Rig,
    camera: &CameraRig,
    inertial: &InertialFacts,
    findings: &mut Findings,
) {
    let Some((stamp_ns, force)) = inertial.up else { return };
    let Some(up_in_imu) = force.try_normalize(1.0) else { return };
    let Some(pose) = imu_from_camera(survey, rig, camera, stamp_ns) else { return };
    let (roll, elevation) = attitude_deg(&pose.rotation.inverse(), &up_in_imu);
    let (inverse_roll, inverse_elevation) = attitude_deg(&pose.rotation, &up_in_imu);
    let evidence = format!(
        "against the specific force at {:.1} s its axis is {elevation:+.0}° above the horizon and its image rolled by {roll:+.0}°; \
         with the inverse matrix {inverse_elevation:+.0}° and {inverse_roll:+.0}°",
        seconds_from_ns(stamp_ns)
    );
    // Roll means nothing for a camera that looks straight up or down.
    if elevation.abs() > 70.0 || roll.abs() < 45.0 {
        return findings.good(Area::Extrinsics, format!("{} is upright", camera.key), evidence);
    }
    let inverted = inverse_roll.abs() < 30.0 && inverse_elevation.abs() < 70.0;
    let field = if camera.mount == CameraMount::Gimbal { "gimbal.T_I_B and T_E_C" } else { "T_cam_imu" };
    let (severity, title) = if inverted {
        (Severity::Error, format!("the extrinsics of {} look inverted", camera.key))
    } else {
        (Severity::Note, format!("{} is mounted on its side or upside down", camera.key))
    };
    let remedy = format!("check {field}: T_a_b maps points from b to a (Kalibr: T_cam_imu from the IMU to the camera)");
    findings.add(severity, Area::Extrinsics, title, evidence, remedy);
}

fn check_lever(camera: &CameraRig, findings: &mut Findings) {
    let CameraMount::Static { imu_from_camera } = &camera.mount else { return };
    let lever_m = imu_from_camera.translation_m.norm();
    if lever_m > 1.0 {
        let evidence = format!("{lever_m:.3} m from the IMU");
        let title = format!("{} sits far from the IMU", camera.key);
        findings.add(Severity::Warning, Area::Extrinsics, title, evidence, "the translation of T_cam_imu is in metres");
    }
    if imu_from_camera.rotation.angle() == 0.0 {
        let title = format!("the rotation of {} is the identity", camera.key);
        let evidence = "T_cam_imu has the axes of camera and IMU coincide: z forward, x right, y down";
        let remedy = "this is mostly a value that was never filled in; calibrate it, with Kalibr for one";
        findings.add(Severity::Warning, Area::Extrinsics, title, evidence, remedy);
    }
}

/// The IMU's turn between two times by its gyroscope, bias removed: rotates vectors of its first frame into its second.
fn imu_turn(inertial: &InertialFacts, from_ns: i64, to_ns: i64) -> Option<UnitQuaternion<f64>> {
    let samples = &inertial.samples;
    let (first, last) = (samples.first()?.stamp_ns, samples.last()?.stamp_ns);
    if from_ns < first || to_ns > last || to_ns <= from_ns {
        return None;
    }
    let bias = inertial.rest_rate_rad_per_s.unwrap_or_default();
    let mut first_from_now = UnitQuaternion::identity();
    let begin = samples.partition_point(|sample| sample.stamp_ns <= from_ns).saturating_sub(1);
    for pair in samples[begin..].windows(2) {
        let (start, end) = (pair[0].stamp_ns.max(from_ns), pair[1].stamp_ns.min(to_ns));
        if start >= to_ns {
            break;
        }
        let rate = (pair[0].angular_velocity_rad_per_s + pair[1].angular_velocity_rad_per_s) * 0.5 - bias;
        first_from_now *= so3::exp(&(rate * ((end - start).max(0) as f64 * 1e-9)));
    }
    Some(first_from_now.inverse())
}

/// Rotation vectors of the camera between two images: as the rig and the gyroscope say, for an offset of the clocks.
fn predicted(
    survey: &Survey,
    rig: &Rig,
    camera: &CameraRig,
    inertial: &InertialFacts,
    rotation: &ImageRotation,
    offset_s: f64,
) -> Option<Vector3<f64>> {
    let shift = ns_from_seconds(camera.timeshift_cam_imu_s + offset_s);
    let (from_ns, to_ns) = (rotation.from_ns + shift, rotation.to_ns + shift);
    let turn = imu_turn(inertial, from_ns, to_ns)?;
    let first = imu_from_camera(survey, rig, camera, from_ns)?.rotation;
    let second = imu_from_camera(survey, rig, camera, to_ns)?.rotation;
    Some(so3::log(&(second.inverse() * turn * first)))
}

/// The rotation `E` that brings the predicted rotation vectors closest to the measured ones (Wahba's problem), with the
/// second singular value over the first: near zero when all turns were about one axis.
fn best_rotation(pairs: &[(Vector3<f64>, Vector3<f64>)]) -> Option<(UnitQuaternion<f64>, f64)> {
    let sum: Matrix3<f64> = pairs.iter().map(|(predicted, measured)| measured * predicted.transpose()).sum();
    let svd = sum.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mut handed = Matrix3::identity();
    handed[(2, 2)] = (u * v_t).determinant().signum();
    let rotation = Rotation3::from_matrix_unchecked(u * handed * v_t);
    Some((UnitQuaternion::from_rotation_matrix(&rotation), svd.singular_values[1] / svd.singular_values[0].max(1e-12)))
}

fn misfit_rad(pairs: &[(Vector3<f64>, Vector3<f64>)]) -> f64 {
    median(&pairs.iter().map(|(predicted, measured)| (predicted - measured).norm()).collect::<Vec<_>>())
}

fn check_against_gyroscope(
    survey: &Survey,
    rig: &Rig,
    camera: &CameraRig,
    inertial: &InertialFacts,
    rotations: &[&ImageRotation],
    findings: &mut Findings,
) {
    let pairs_at = |offset_s: f64| -> Vec<(Vector3<f64>, Vector3<f64>)> {
        let pair = |rotation: &&ImageRotation| {
            let measured = so3::log(&rotation.second_from_first);
            predicted(survey, rig, camera, inertial, rotation, offset_s).map(|predicted| (predicted, measured))
        };
        rotations.iter().filter_map(pair).collect()
    };
    let given = pairs_at(0.0);
    let turns: Vec<f64> = given.iter().map(|(_, measured)| measured.norm()).collect();
    if given.len() < FEWEST_ROTATIONS || median(&turns) < 0.003 {
        let title = format!("{} turns too little to check its extrinsics", camera.key);
        let evidence = format!("{} image rotations, {:.2}° in the median", given.len(), median(&turns).to_degrees());
        return findings.add(Severity::Note, Area::Extrinsics, title, evidence, "fly turns about all axes");
    }
    // The time offset first, from the angles alone: they do not depend on a constant rotation of the camera.
    let cost = |offset_s: f64| {
        let pairs = pairs_at(offset_s);
        median(
            &pairs.iter().map(|(predicted, measured)| (predicted.norm() - measured.norm()).abs()).collect::<Vec<_>>(),
        )
    };
    let steps = (LARGEST_OFFSET_S / OFFSET_STEP_S) as i32;
    let costs: Vec<(f64, f64)> =
        (-steps..=steps).map(|step| f64::from(step) * OFFSET_STEP_S).map(|offset| (offset, cost(offset))).collect();
    let best = costs.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0.0, 0.0));
    let unshifted = costs.iter().find(|(offset, _)| offset.abs() < 1e-9).map_or(best.1, |entry| entry.1);
    let evidence = format!(
        "turns differ by {:.3}° in the median, by {:.3}° with the images {:+.0} ms later",
        unshifted.to_degrees(),
        best.1.to_degrees(),
        best.0 * 1e3
    );
    let offset_found = best.0.abs() >= OFFSET_TOLERANCE_S && best.1 < 0.7 * unshifted;
    if offset_found {
        let title = format!("{} and the gyroscope are {:+.0} ms apart", camera.key, best.0 * 1e3);
        let remedy = format!("set {}.timeshift_cam_imu to {:+.3}", camera.key, camera.timeshift_cam_imu_s + best.0);
        findings.add(Severity::Warning, Area::Time, title, evidence, remedy);
    } else {
        findings.good(Area::Time, format!("{} and the gyroscope turn at the same time", camera.key), evidence);
    }
    let pairs = if offset_found { pairs_at(best.0) } else { given };
    let Some((error, spread)) = best_rotation(&pairs) else { return };
    let corrected: Vec<_> = pairs.iter().map(|(predicted, measured)| (error * predicted, *measured)).collect();
    let evidence = format!(
        "image rotations differ from the gyroscope's by {:.3}° in the median, by {:.3}° with the camera turned by {:.1}°; \
         {} pairs, second axis {:.0} % of the first",
        misfit_rad(&pairs).to_degrees(),
        misfit_rad(&corrected).to_degrees(),
        error.angle().to_degrees(),
        pairs.len(),
        spread * 100.0
    );
    if spread < 0.02 {
        let title = format!("{} turned about one axis only: its rotation cannot be checked", camera.key);
        findings.add(Severity::Note, Area::Extrinsics, title, evidence, "fly turns about all axes");
    } else if error.angle() > ROTATION_TOLERANCE_RAD && misfit_rad(&corrected) < 0.8 * misfit_rad(&pairs) {
        let severity = if error.angle() > 0.35 { Severity::Error } else { Severity::Warning };
        let title = format!("{} does not point where the rig says", camera.key);
        let remedy =
            "check direction and axes of the extrinsics (T_cam_imu maps from the IMU to the camera), or calibrate";
        findings.add(severity, Area::Extrinsics, title, evidence, remedy);
    } else {
        findings.good(Area::Extrinsics, format!("{} points where the rig says", camera.key), evidence);
    }
}
