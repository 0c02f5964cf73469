//! Cameras against the gyroscope: rotations measured from the images alone, compared with those that gyroscope,
//! encoders and rig predict. A constant rotation between them is an error of the extrinsics, a delay is a time offset.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::imu_facts::ImuFacts;
use super::readout::between_first_rows;
use super::statistics::median;
use super::survey::Survey;
use super::{Area, Findings, ImageRotation, Severity};
use crate::geometry::{ns_from_seconds, seconds_from_ns, so3};
use crate::gimbal::ClassicalChain;
use crate::sensors::{CameraMount, CameraRig, Rig};

/// Minimum number of image rotations.
const MIN_ROTATIONS: usize = 20;
/// Minimum median rotation between two images.
const MIN_ROTATION_RAD: f64 = 0.003;
/// Largest magnitude of a time offset in the search.
const MAX_OFFSET_S: f64 = 0.15;
/// Step of that search, in seconds.
const OFFSET_STEP_S: f64 = 0.005;
/// Smallest reported time offset: a twelfth of the image interval at 20 Hz; rolling shutter and exposure shift stamps
/// by less.
const OFFSET_TOLERANCE_S: f64 = 0.004;
/// Minimum relative decrease of the squared misfit by a time offset.
const MIN_GAIN: f64 = 0.2;
/// Tolerated error of a camera's orientation.
const ROTATION_TOLERANCE_RAD: f64 = 0.07;
/// A larger error means a wrong matrix, not an inaccurate one.
const WRONG_ROTATION_RAD: f64 = 0.35;
/// Largest ratio of misfit to rotation with which the prediction is usable; noisy encoders of a stabilized camera
/// exceed it.
const MAX_NOISE_RATIO: f64 = 0.5;
/// Smallest ratio of the second singular value to the first; below it all rotations are about one axis, and the rotation
/// about that axis is unobservable.
const MIN_SPREAD: f64 = 0.02;

/// Predicted and measured rotation vector in the camera frame, in radians.
type Pair = (Vector3<f64>, Vector3<f64>);

/// Measured rotations of one camera and the data that predict them.
struct HandEye<'a> {
    survey: &'a Survey,
    imu_facts: &'a ImuFacts,
    camera: &'a CameraRig,
    rotations: Vec<ImageRotation>,
}

/// Checks the orientation and time offset of a camera with a readout by its image rotations, if there are any.
pub(super) fn check_against_gyroscope(
    survey: &Survey,
    rig: &Rig,
    camera: &CameraRig,
    imu_facts: &ImuFacts,
    rotations: &[ImageRotation],
    readout_s: f64,
    findings: &mut Findings,
) {
    let rotations = between_first_rows(camera, rotations, readout_s);
    let Some(chain) = rig.chain_of_camera(&camera.key).filter(|_| rotations.len() >= MIN_ROTATIONS) else { return };
    let hand_eye = HandEye { survey, imu_facts, camera, rotations };
    let given = hand_eye.pairs(&chain, 0.0);
    let angles_rad: Vec<f64> = given.iter().map(|(_, measured)| measured.norm()).collect();
    if given.len() < MIN_ROTATIONS || median(&angles_rad) < MIN_ROTATION_RAD {
        let title = format!("too little rotation of {} to check its extrinsics", camera.key);
        let evidence =
            format!("{} image rotations, {:.2}° in the median", given.len(), median(&angles_rad).to_degrees());
        return findings.add(Severity::Note, Area::Extrinsics, title, evidence, "rotate about all axes");
    }
    let rotation_rad = median(&angles_rad);
    let offset_s = hand_eye.check_time_offset(&chain, rotation_rad, findings);
    hand_eye.check_orientation(&chain, rotation_rad, offset_s, findings);
}

impl HandEye<'_> {
    /// Predicted and measured rotation vectors for a chain and an additional time offset.
    fn pairs(&self, chain: &ClassicalChain, offset_s: f64) -> Vec<Pair> {
        let shift = ns_from_seconds(self.camera.timeshift_cam_imu_s + offset_s);
        let imu_from_camera = |stamp_ns: i64| {
            let angles_rad = if chain.links.is_empty() { Vec::new() } else { self.survey.joint_angles_at(stamp_ns)? };
            Some(chain.imu_from_camera(&angles_rad).rotation)
        };
        let pair = |rotation: &ImageRotation| {
            let (from_ns, to_ns) = (rotation.from_ns + shift, rotation.to_ns + shift);
            let [from_s, to_s] = [from_ns, to_ns].map(seconds_from_ns);
            let rotation_of_imu = self.imu_facts.gyroscope.rotation_between(from_s, to_s)?;
            let predicted =
                so3::log(&(imu_from_camera(to_ns)?.inverse() * rotation_of_imu * imu_from_camera(from_ns)?));
            Some((predicted, so3::log(&rotation.second_from_first)))
        };
        self.rotations.iter().filter_map(pair).collect()
    }

    /// Time offset in seconds, `t_imu = t_cam + offset` beyond the rig's, that minimizes the misfit under any constant
    /// rotation; 0 if it is too small or unobservable.
    fn check_time_offset(&self, chain: &ClassicalChain, rotation_rad: f64, findings: &mut Findings) -> f64 {
        let key = &self.camera.key;
        let cost = |offset_s: f64| {
            let pairs = self.pairs(chain, offset_s);
            best_rotation(&pairs).map_or(f64::INFINITY, |(error, _)| misfit_rad(&pairs, &error))
        };
        let steps = (MAX_OFFSET_S / OFFSET_STEP_S).round() as i32;
        let costs: Vec<(f64, f64)> =
            (-steps..=steps).map(|step| f64::from(step) * OFFSET_STEP_S).map(|offset| (offset, cost(offset))).collect();
        let best = (0..costs.len()).min_by(|a, b| costs[*a].1.total_cmp(&costs[*b].1)).unwrap_or(0);
        let unshifted = costs[steps as usize].1;
        let (offset_s, least) = (vertex(&costs, best, OFFSET_STEP_S), costs[best].1);
        let evidence = format!(
            "rotations of {:.3}° in the median differ by {:.3}°, by {:.3}° with the images {:+.1} ms later",
            rotation_rad.to_degrees(),
            unshifted.to_degrees(),
            least.to_degrees(),
            offset_s * 1e3
        );
        let far = costs.iter().filter(|(offset, _)| (offset - offset_s).abs() > 0.05).map(|(_, cost)| *cost);
        let gain = |from: f64| 1.0 - (least / from.max(f64::MIN_POSITIVE)).powi(2);
        if least > MAX_NOISE_RATIO * rotation_rad || gain(far.fold(f64::INFINITY, f64::min)) < MIN_GAIN {
            let title = format!("the time offset of {key} is unobservable from its rotations");
            let remedy = "rotate faster, or use a calibration such as Kalibr's timeshift_cam_imu";
            findings.add(Severity::Note, Area::Time, title, evidence, remedy);
            return 0.0;
        }
        if offset_s.abs() < OFFSET_TOLERANCE_S || gain(unshifted) < MIN_GAIN {
            findings.good(Area::Time, format!("{key} and the gyroscope are synchronized"), evidence);
            return 0.0;
        }
        let title = format!("time offset of {key} to the gyroscope: {:+.0} ms", offset_s * 1e3);
        let remedy = format!("set {key}.timeshift_cam_imu to {:+.3}", self.camera.timeshift_cam_imu_s + offset_s);
        findings.add(Severity::Warning, Area::Time, title, evidence, remedy);
        offset_s
    }

    fn check_orientation(&self, chain: &ClassicalChain, rotation_rad: f64, offset_s: f64, findings: &mut Findings) {
        let key = &self.camera.key;
        let pairs = self.pairs(chain, offset_s);
        let Some((error, spread)) = best_rotation(&pairs) else { return };
        let (given, corrected) = (misfit_rad(&pairs, &UnitQuaternion::identity()), misfit_rad(&pairs, &error));
        let evidence = format!(
            "image rotations differ from the gyroscope's by {:.3}° in the median, by {:.3}° with the camera rotated by {:.1}°; \
             {} pairs, second axis {:.0} % of the first",
            given.to_degrees(),
            corrected.to_degrees(),
            error.angle().to_degrees(),
            pairs.len(),
            spread * 100.0
        );
        let inverted = self.inverted(chain, offset_s, given);
        if let Some((field, misfit)) = inverted {
            let title = format!("{field} is inverted, according to the rotations of {key}");
            let evidence = format!("{evidence}; by {:.3}° with {field} inverted", misfit.to_degrees());
            let remedy = format!(
                "write the inverse of {field}: T_a_b maps points from b to a (Kalibr: T_cam_imu from the IMU to the camera)"
            );
            findings.add(Severity::Error, Area::Extrinsics, title, evidence, remedy);
        } else if corrected > MAX_NOISE_RATIO * rotation_rad {
            let title = format!("the rotations of {key} are predicted too inaccurately to check its orientation");
            let remedy = if self.camera.mount == CameraMount::Gimbal {
                "encoder noise is as large as the rotations: record with the gimbal fixed, or see the findings on encoders"
            } else {
                "images and gyroscope are inconsistent: see the findings on time and intrinsics"
            };
            findings.add(Severity::Note, Area::Extrinsics, title, evidence, remedy);
        } else if spread < MIN_SPREAD {
            let title = format!("{key} rotated about one axis only: its orientation cannot be checked");
            findings.add(Severity::Note, Area::Extrinsics, title, evidence, "rotate about all axes");
        } else if error.angle() > ROTATION_TOLERANCE_RAD && corrected < 0.8 * given {
            let severity = if error.angle() > WRONG_ROTATION_RAD { Severity::Error } else { Severity::Warning };
            let title = format!("the orientation of {key} differs from the rig");
            let remedy =
                "check direction and axes of the extrinsics (T_cam_imu maps from the IMU to the camera), or calibrate";
            findings.add(severity, Area::Extrinsics, title, evidence, remedy);
        } else {
            findings.good(Area::Extrinsics, format!("the orientation of {key} agrees with the rig"), evidence);
        }
    }

    /// Transform of the rig whose inverse predicts the rotations much better, up to an error within tolerance, with the
    /// misfit in radians.
    fn inverted(&self, chain: &ClassicalChain, offset_s: f64, given_rad: f64) -> Option<(String, f64)> {
        let key = &self.camera.key;
        let base = ClassicalChain { imu_from_base: chain.imu_from_base.inverse(), ..chain.clone() };
        let candidates = if self.camera.mount == CameraMount::Gimbal {
            let end = ClassicalChain { effector_from_camera: chain.effector_from_camera.inverse(), ..chain.clone() };
            let both = ClassicalChain { effector_from_camera: end.effector_from_camera, ..base.clone() };
            vec![
                ("gimbal.T_E_C".to_owned(), end),
                ("gimbal.T_I_B".to_owned(), base),
                ("each of gimbal.T_I_B and gimbal.T_E_C".to_owned(), both),
            ]
        } else {
            vec![(format!("{key}.T_cam_imu"), base)]
        };
        let misfits = candidates.into_iter().filter_map(|(field, chain)| {
            let pairs = self.pairs(&chain, offset_s);
            let (error, _) = best_rotation(&pairs)?;
            let misfit = misfit_rad(&pairs, &UnitQuaternion::identity());
            (error.angle() < ROTATION_TOLERANCE_RAD).then_some((field, misfit))
        });
        misfits.filter(|(_, misfit)| *misfit < 0.5 * given_rad).min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Rotation that minimizes `Σ |measured − R·predicted|²` (Wahba's problem, by SVD), with the ratio of the second
/// singular value to the first, which is near zero if all rotations are about one axis.
pub(super) fn best_rotation(pairs: &[Pair]) -> Option<(UnitQuaternion<f64>, f64)> {
    let sum: Matrix3<f64> = pairs.iter().map(|(predicted, measured)| measured * predicted.transpose()).sum();
    let svd = sum.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mut handed = Matrix3::identity();
    handed[(2, 2)] = (u * v_t).determinant().signum();
    let rotation = Rotation3::from_matrix_unchecked(u * handed * v_t);
    Some((UnitQuaternion::from_rotation_matrix(&rotation), svd.singular_values[1] / svd.singular_values[0].max(1e-12)))
}

/// Median of `|error·predicted − measured|` in radians.
fn misfit_rad(pairs: &[Pair], error: &UnitQuaternion<f64>) -> f64 {
    median(&pairs.iter().map(|(predicted, measured)| (error * predicted - measured).norm()).collect::<Vec<_>>())
}

/// Minimum of the parabola through the squared costs around the best offset, in seconds; the offset itself at the end of
/// the range.
pub(super) fn vertex(costs: &[(f64, f64)], best: usize, step: f64) -> f64 {
    let square = |index: usize| costs[index].1 * costs[index].1;
    let offset_s = costs[best].0;
    if best == 0 || best + 1 >= costs.len() {
        return offset_s;
    }
    let (left, middle, right) = (square(best - 1), square(best), square(best + 1));
    let curvature = left - 2.0 * middle + right;
    if curvature > 0.0 { offset_s + 0.5 * step * (left - right) / curvature } else { offset_s }
}
