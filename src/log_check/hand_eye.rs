//! Cameras against the gyroscope: rotations measured from the images alone, compared with those that gyroscope,
//! encoders and rig predict. A constant rotation between them is an error of the extrinsics, a delay is a time offset.

use nalgebra::{Matrix3, Vector3};

use super::clock_alignment::{ClockAlignment, RotationReference, align_clocks, best_rotation};
use super::imu_facts::ImuFacts;
use super::readout::between_first_rows;
use super::rotation_fit::{FitPriors, RotationFit, RotationPair};
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
/// Smallest reported time offset: a twelfth of the image interval at 20 Hz; rolling shutter and exposure shift stamps
/// by less.
const OFFSET_TOLERANCE_S: f64 = 0.004;
/// Number of standard deviations from which a time offset, an orientation error or a scale is reported.
const SIGNIFICANT_SIGMAS: f64 = 3.0;
/// Largest standard deviation of a time offset that counts as observable.
const MAX_OFFSET_SIGMA_S: f64 = 0.01;
/// Tolerated error of a camera's orientation.
const ROTATION_TOLERANCE_RAD: f64 = 0.07;
/// A larger error means a wrong matrix, not an inaccurate one.
const WRONG_ROTATION_RAD: f64 = 0.35;
/// Smallest ratio of the second singular value to the first; below it all rotations are about one axis, and the rotation
/// about that axis is unobservable.
const MIN_SPREAD: f64 = 0.02;

/// Measured rotations of one camera and the data that predict them.
struct HandEye<'a> {
    survey: &'a Survey,
    rig: &'a Rig,
    imu_facts: &'a ImuFacts,
    camera: &'a CameraRig,
    rotations: Vec<ImageRotation>,
    /// Covariance of each rotation, in rad².
    covariances_rad2: Vec<Matrix3<f64>>,
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
    let (rotations, covariances_rad2): (Vec<_>, Vec<_>) =
        between_first_rows(camera, rotations, readout_s).into_iter().unzip();
    let Some(chain) = rig.chain_of_camera(&camera.key).filter(|_| rotations.len() >= MIN_ROTATIONS) else { return };
    let hand_eye = HandEye { survey, rig, imu_facts, camera, rotations, covariances_rad2 };
    let given = hand_eye.pairs(&chain, 0.0);
    let angles_rad: Vec<f64> = given.iter().map(|pair| pair.measured.norm()).collect();
    let rotation_rad = median(&angles_rad);
    if given.len() < MIN_ROTATIONS || rotation_rad < MIN_ROTATION_RAD {
        let title = format!("too little rotation of {} to check its extrinsics", camera.key);
        let evidence = format!("{} image rotations, {:.2}° in the median", given.len(), rotation_rad.to_degrees());
        return findings.add(Severity::Note, Area::Extrinsics, title, evidence, "rotate about all axes");
    }
    let aligned = hand_eye.aligned(&chain);
    let (offset_s, sigma_s) = aligned
        .as_ref()
        .map_or((0.0, MAX_OFFSET_SIGMA_S), |found| (found.offset_s - camera.timeshift_cam_imu_s, found.offset_sigma_s));
    let pairs = hand_eye.pairs(&chain, offset_s);
    let chain_sigma = rig.gimbal.as_ref().map_or(1.0, |gimbal| gimbal.prior.rotation_bound_rad);
    let priors = FitPriors { time_offset_s: sigma_s, chain: chain_sigma };
    let Some(fit) = RotationFit::of(&pairs, &chain, &priors) else { return };
    hand_eye.report_time_offset(aligned, fit.is_explained(), findings);
    hand_eye.report_orientation(&fit, &pairs, &chain, offset_s, findings);
}

impl HandEye<'_> {
    /// Rotations with the data that predict them at an additional time offset.
    fn pairs(&self, chain: &ClassicalChain, offset_s: f64) -> Vec<RotationPair> {
        let shift = ns_from_seconds(self.camera.timeshift_cam_imu_s + offset_s);
        let angles_at = |stamp_ns: i64| {
            if chain.links.is_empty() { Some(Vec::new()) } else { self.survey.fitted_angles_at(stamp_ns) }
        };
        let gyroscope_variance = self.rig.imu.noise.gyroscope_noise_density.powi(2);
        let pair = |(index, rotation): (usize, &ImageRotation)| {
            let (from_ns, to_ns) = (rotation.from_ns + shift, rotation.to_ns + shift);
            let [from_s, to_s] = [from_ns, to_ns].map(seconds_from_ns);
            let interval_s = to_s - from_s;
            Some(RotationPair {
                measured: so3::log(&rotation.second_from_first),
                covariance_rad2: self.covariances_rad2[index] + Matrix3::identity() * (gyroscope_variance * interval_s),
                of_imu: self.imu_facts.gyroscope.rotation_between(from_s, to_s)?,
                interval_s,
                rate_change: self.rate_change(index),
                angles: [angles_at(from_ns)?, angles_at(to_ns)?],
            })
        };
        self.rotations.iter().enumerate().filter_map(pair).collect()
    }

    /// Derivative of a measured rotation by a shift of both its times, from the neighbouring rotations, in rad/s; zero
    /// without neighbours.
    fn rate_change(&self, index: usize) -> Vector3<f64> {
        let neighbours = index.checked_sub(1).and_then(|before| self.rotations.get(before..index + 2));
        let Some([before, at, after]) = neighbours else { return Vector3::zeros() };
        if before.to_ns != at.from_ns || at.to_ns != after.from_ns {
            return Vector3::zeros();
        }
        let [before_s, after_s] = [before, after].map(|pair| 0.5 * seconds_from_ns(pair.from_ns + pair.to_ns));
        (so3::log(&after.second_from_first) - so3::log(&before.second_from_first)) / (after_s - before_s)
    }

    /// Alignment of the camera's clock, or the reason that its time offset is unobservable.
    fn aligned(&self, chain: &ClassicalChain) -> Result<ClockAlignment, String> {
        let reference = RotationReference::from_chain(&self.imu_facts.gyroscope, &self.survey.joint_samples, chain);
        let found = align_clocks(&self.rotations, &reference, self.camera.timeshift_cam_imu_s, MAX_OFFSET_S)
            .map_err(|error| error.to_string())?;
        if found.offset_sigma_s < MAX_OFFSET_SIGMA_S {
            return Ok(found);
        }
        let offset_s = found.offset_s - self.camera.timeshift_cam_imu_s;
        Err(format!("images {:+.1} ± {:.1} ms later than in the rig", offset_s * 1e3, found.offset_sigma_s * 1e3))
    }

    fn report_time_offset(&self, aligned: Result<ClockAlignment, String>, is_explained: bool, findings: &mut Findings) {
        let (key, given_s) = (&self.camera.key, self.camera.timeshift_cam_imu_s);
        let found = match aligned {
            Ok(found) => found,
            Err(evidence) => {
                let title = format!("the time offset of {key} is unobservable from its rotations");
                let remedy = "rotate faster or longer, or use a calibration such as Kalibr's timeshift_cam_imu";
                return findings.add(Severity::Note, Area::Time, title, evidence, remedy);
            }
        };
        let (offset_s, sigma_s) = (found.offset_s - given_s, found.offset_sigma_s);
        let evidence = format!(
            "images {:+.1} ± {:.1} ms later than in the rig; {} rotations of {:.3}° in the median then differ by {:.3}°",
            offset_s * 1e3,
            sigma_s * 1e3,
            found.rotations,
            found.rotation_deg,
            found.residual_deg
        );
        if offset_s.abs() < OFFSET_TOLERANCE_S.max(SIGNIFICANT_SIGMAS * sigma_s) {
            findings.good(Area::Time, format!("{key} and the gyroscope are synchronized"), evidence);
        } else if is_explained {
            let title = format!("time offset of {key} to the gyroscope: {:+.0} ms", offset_s * 1e3);
            let remedy = format!("set {key}.timeshift_cam_imu to {:+.3}", given_s + offset_s);
            findings.add(Severity::Warning, Area::Time, title, evidence, remedy);
        } else {
            let title = format!("no time offset of {key} explains its rotations");
            findings.add(Severity::Note, Area::Time, title, evidence, "see the finding on its orientation");
        }
    }

    fn report_orientation(
        &self,
        fit: &RotationFit,
        pairs: &[RotationPair],
        chain: &ClassicalChain,
        offset_s: f64,
        findings: &mut Findings,
    ) {
        let key = &self.camera.key;
        let given_rad = misfit_rad(pairs, chain);
        let (error_rad, sigma_rad) = (fit.orientation.angle(), fit.orientation_sigma_rad);
        let evidence = format!(
            "image rotations differ from the gyroscope's by {:.3}° in the median; by {:.3}° with the camera rotated by \
             {:.1} ± {:.1}°, where noise predicts {:.3}° (χ²/dof {:.2}, at most {:.2} for {} dof); {} pairs, scale {:.3}, \
             second axis {:.0} % of the first",
            given_rad.to_degrees(),
            fit.misfit_rad.to_degrees(),
            error_rad.to_degrees(),
            sigma_rad.to_degrees(),
            fit.predicted_misfit_rad.to_degrees(),
            fit.mean_square,
            fit.largest_mean_square(),
            fit.degrees_of_freedom,
            pairs.len(),
            fit.scale,
            fit.spread * 100.0
        );
        if let Some((field, misfit)) = self.inverted(chain, offset_s, given_rad) {
            let title = format!("{field} is inverted, according to the rotations of {key}");
            let evidence = format!("{evidence}; by {:.3}° with {field} inverted", misfit.to_degrees());
            let remedy = format!(
                "write the inverse of {field}: T_a_b maps points from b to a (Kalibr: T_cam_imu from the IMU to the camera)"
            );
            findings.add(Severity::Error, Area::Extrinsics, title, evidence, remedy);
        } else if !fit.is_explained() {
            let title =
                format!("unexplained: the rotations of {key} differ from the prediction by more than their noise");
            let remedy = if self.camera.mount == CameraMount::Gimbal {
                "no orientation and no time offset of the camera explains it: check signs, order and units of the joints, \
                 the intrinsics and the axes of the IMU"
            } else {
                "no orientation and no time offset of the camera explains it: check the intrinsics, also whether they \
                 change, and axes, signs and units of the IMU"
            };
            findings.add(Severity::Warning, Area::Extrinsics, title, evidence, remedy);
        } else if fit.spread < MIN_SPREAD {
            let title = format!("{key} rotated about one axis only: its orientation cannot be checked");
            findings.add(Severity::Note, Area::Extrinsics, title, evidence, "rotate about all axes");
        } else if sigma_rad > ROTATION_TOLERANCE_RAD {
            let title = format!("the rotations of {key} are predicted too inaccurately to check its orientation");
            let remedy = "noise of gyroscope or encoders is as large as the rotations: rotate faster or longer";
            findings.add(Severity::Note, Area::Extrinsics, title, evidence, remedy);
        } else if error_rad > ROTATION_TOLERANCE_RAD.max(SIGNIFICANT_SIGMAS * sigma_rad) {
            let severity = if error_rad > WRONG_ROTATION_RAD { Severity::Error } else { Severity::Warning };
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
            let vectors: Vec<_> = pairs.iter().map(|pair| (pair.predicted(&chain), pair.measured)).collect();
            let (error, _) = best_rotation(&vectors)?;
            let misfit = misfit_rad(&pairs, &chain);
            (error.angle() < ROTATION_TOLERANCE_RAD).then_some((field, misfit))
        });
        misfits.filter(|(_, misfit)| *misfit < 0.5 * given_rad).min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Median difference of predicted and measured rotations, in radians.
fn misfit_rad(pairs: &[RotationPair], chain: &ClassicalChain) -> f64 {
    median(&pairs.iter().map(|pair| (pair.predicted(chain) - pair.measured).norm()).collect::<Vec<_>>())
}
