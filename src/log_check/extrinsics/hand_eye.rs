//! Cameras against the gyroscope: rotations measured from the images alone, compared with those that gyroscope,
//! encoders and rig predict. A constant rotation between them is an error of the extrinsics, a delay is a time offset.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{UnitQuaternion, Vector3};

use crate::faults::{Fault, FaultKind, Sentence, Subject};
use crate::geometry::{best_rotation, so3};
use crate::gimbal::ClassicalChain;
use crate::log_check::clock_alignment::{
    ClockAlignment, OFFSET_TOLERANCE_S, ORIENTATION_TOLERANCE_RAD, RotationReference, SCALE_SIGMA, SCALE_TOLERANCE,
    align_clocks,
};
use crate::log_check::report::suspects::Suspects;
use crate::log_check::report::verdict::MOST_LIKELY;
use crate::log_check::report::{Area, Findings, ImageRotation, Measurement, Severity};
use crate::log_check::rotations::data::{JOINED_S, RotationData, joined};
use crate::log_check::rotations::fit::{FREE_ORIENTATION_RAD, FitPriors, RotationFit, RotationPair};
use crate::log_check::rotations::hypotheses::{self, LensValue, WithinNoise};
use crate::log_check::statistics::{SIGNIFICANT_SIGMAS, median};
use crate::sensors::{CameraMount, CameraRig};

/// Minimum number of image rotations.
const MIN_ROTATIONS: usize = 20;
/// Minimum median rotation between two images.
const MIN_ROTATION_RAD: f64 = 0.003;
/// Largest magnitude of a time offset in the search.
const MAX_OFFSET_S: f64 = 0.15;
/// Number of standard deviations from which a time offset of a camera on joints is reported: its derivatives come from
/// noisy images, and its standard deviation is too small by up to a third.
const SIGNIFICANT_SIGMAS_ON_JOINTS: f64 = 5.0;
/// Largest standard deviation of a time offset that counts as observable.
const MAX_OFFSET_SIGMA_S: f64 = 0.01;
/// A larger error means a wrong matrix, not an inaccurate one.
const WRONG_ROTATION_RAD: f64 = 0.35;
/// Smallest ratio of the second singular value to the first; below it all rotations are about one axis, and the rotation
/// about that axis is unobservable.
const MIN_SPREAD: f64 = 0.02;
/// Largest ratio of the misfit by another convention to the misfit as in the rig with which the rig has that convention.
const OTHER_MISFIT: f64 = 0.5;
/// Prior standard deviation of the time offset where chains are compared within their bounds.
const BOUND_OFFSET_S: f64 = 0.01;
/// Decrease of −2·ln of the likelihood by which another convention is decisive.
const DECISIVE: f64 = 12.0;
/// Largest ratio of the squared corrections that the chain of another convention needs to the corrections of the rig's chain.
const SMALLER_CHANGE: f64 = 0.25;

const CALIBRATE: &str =
    "check direction and axes of the extrinsics (T_cam_imu maps from the IMU to the camera), or calibrate";

/// Comparison of a camera's rotations with those predicted by gyroscope and chain.
struct HandEye<'a> {
    data: RotationData<'a>,
    camera: &'a CameraRig,
    /// Sensors that may be the cause of a misfit.
    suspects: &'a Suspects,
}

/// Chain by another convention than the rig's.
struct OtherChain {
    chain: ClassicalChain,
    title: String,
    remedy: String,
    /// Median difference of predicted and measured rotations, in radians.
    misfit_rad: f64,
    /// False if only the size of the corrections that the rig's chain would need speaks for it.
    is_certain: bool,
}

/// Consequence of a comparison for other checks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum HandEyeOutcome {
    /// The intrinsics are wrong, so that other measurements by the camera's features are, too.
    WrongIntrinsics,
    /// The orientation of a rigid camera differs from the rig: as if the IMU was rotated by this, IMU frame.
    OtherOrientation(UnitQuaternion<f64>),
    Other,
}

/// Checks orientation and time offset of a camera by its image rotations, if there are any. A misfit beyond the noise is traced to
/// its cause, a fault of one of the suspects.
pub(super) fn check_against_gyroscope(
    data: RotationData<'_>,
    suspects: &Suspects,
    findings: &mut Findings,
) -> HandEyeOutcome {
    let RotationData { rig, camera, .. } = data;
    let chain = rig.chain_of_camera(&camera.key).filter(|_| data.measured.len() >= MIN_ROTATIONS);
    let Some(chain) = chain else { return HandEyeOutcome::Other };
    let faulty = if !findings.can_compare(Measurement::Gyroscope) {
        Some("gyroscope")
    } else if !chain.links.is_empty() && !findings.can_compare(Measurement::Joints) {
        Some("joint angles")
    } else {
        None
    };
    if let Some(faulty) = faulty {
        let title = format!("the rotations of {} are not compared", camera.key);
        let evidence = format!("the fault of the {faulty} is reported above");
        findings.unverified(Area::Extrinsics, title, evidence, "check again when it is corrected");
        return HandEyeOutcome::Other;
    }
    let hand_eye = HandEye { data, camera, suspects };
    let given = hand_eye.pairs(&chain, 0.0, 0.0);
    let angles_rad: Vec<f64> = given.iter().map(|pair| pair.measured.norm()).collect();
    let rotation_rad = median(&angles_rad);
    if given.len() < MIN_ROTATIONS || rotation_rad < MIN_ROTATION_RAD {
        let title = format!("too little rotation of {} to check its extrinsics", camera.key);
        let evidence = format!("{} image rotations, {:.2}° in the median", given.len(), rotation_rad.to_degrees());
        findings.unverified(Area::Extrinsics, title, evidence, "rotate about all axes");
        return HandEyeOutcome::Other;
    }
    let aligned = hand_eye.aligned(&chain);
    let (offset_s, sigma_s) = aligned
        .as_ref()
        .map_or((0.0, MAX_OFFSET_SIGMA_S), |found| (found.offset_s - camera.timeshift_cam_imu_s, found.offset_sigma_s));
    let pairs = hand_eye.pairs(&chain, offset_s, 0.0);
    let priors = FitPriors {
        orientation_rad: FREE_ORIENTATION_RAD,
        time_offset_s: sigma_s,
        scale: SCALE_SIGMA,
        chain: hand_eye.data.chain_sigma_rad(),
    };
    let Some(fit) = RotationFit::of(&pairs, &chain, &priors) else { return HandEyeOutcome::Other };
    // Over longer times the rotations of a gimbal exceed the noise of its joint angles.
    let longer = (!chain.links.is_empty())
        .then(|| RotationFit::of(&hand_eye.pairs(&chain, offset_s, JOINED_S), &chain, &priors))
        .flatten();
    let is_scaled = chain.links.is_empty()
        && (fit.scale - 1.0).abs() > SCALE_TOLERANCE.max(SIGNIFICANT_SIGMAS * fit.orientation_sigma_rad);
    let is_explained = fit.is_explained() && longer.is_none_or(|longer| longer.is_explained()) && !is_scaled;
    let within_noise = is_explained.then(|| {
        hypotheses::explain_within_noise(&hand_eye.data.delayed(offset_s), &chain, suspects, tolerance_rad(&fit))
    });
    // A fault in a part of the log also changes the time offset that fits best.
    let is_sound = within_noise.as_ref().is_some_and(|found| found.cause.is_none());
    hand_eye.report_time_offset(aligned, is_sound, findings);
    hand_eye.report_orientation(&fit, &pairs, &chain, offset_s, within_noise, findings)
}

impl HandEye<'_> {
    /// Rotations over at least `length_s` with the data that predict them at an additional time offset.
    fn pairs(&self, chain: &ClassicalChain, offset_s: f64, length_s: f64) -> Vec<RotationPair> {
        let shift = Fault::new(FaultKind::CameraClock, &[offset_s]);
        let predictor = self.data.predictor(chain, Some(&shift));
        joined(&self.data.measured, length_s).iter().filter_map(|it| predictor.pair(it)).collect()
    }

    /// Alignment of the camera's clock, or the reason that its time offset is unobservable.
    fn aligned(&self, chain: &ClassicalChain) -> Result<ClockAlignment, String> {
        let data = &self.data;
        let reference = RotationReference::from_chain(&data.imu_facts.gyroscope, &data.survey.joint_samples, chain);
        let rotations: Vec<ImageRotation> = data.measured.iter().map(|it| it.rotation.clone()).collect();
        let found = align_clocks(&rotations, &reference, self.camera.timeshift_cam_imu_s, MAX_OFFSET_S)
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
        let sigmas = match self.camera.mount {
            CameraMount::Gimbal => SIGNIFICANT_SIGMAS_ON_JOINTS,
            CameraMount::Static { .. } => SIGNIFICANT_SIGMAS,
        };
        if offset_s.abs() < OFFSET_TOLERANCE_S.max(sigmas * sigma_s) {
            findings.good(Area::Time, format!("{key} and the gyroscope are synchronized"), evidence);
        } else if is_explained {
            let fault = Fault::new(FaultKind::CameraClock, &[offset_s]).of_camera(key);
            let subject = Subject { rig: self.data.rig, camera_key: key };
            let Sentence { severity, statement, remedy } = subject.sentence(&fault);
            findings.add(severity, Area::Time, statement, evidence, remedy);
            findings.state_faults([fault]);
            findings.mark_by_pair(&[Measurement::Gyroscope]);
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
        within_noise: Option<WithinNoise>,
        findings: &mut Findings,
    ) -> HandEyeOutcome {
        let key = &self.camera.key;
        let given_rad = misfit_rad(pairs, chain);
        let (error_rad, sigma_rad) = (fit.orientation.angle(), fit.orientation_sigma_rad);
        let tolerance_rad = tolerance_rad(fit);
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
        if let Some(other) = self.other_chain(chain, offset_s, given_rad) {
            let OtherChain { title, remedy, misfit_rad, is_certain, .. } = other;
            let (severity, likely) = if is_certain { (Severity::Error, "") } else { (Severity::Warning, MOST_LIKELY) };
            let title = format!("{likely}{title}, according to the rotations of {key}");
            let evidence = format!("{evidence}; by {:.3}° with this corrected", misfit_rad.to_degrees());
            findings.add(severity, Area::Extrinsics, title, evidence, remedy);
            findings.state_faults([Fault::from(FaultKind::Chain).of_camera(key)]);
            return HandEyeOutcome::Other;
        }
        let Some(found) = within_noise else {
            let remedy = if self.camera.mount == CameraMount::Gimbal {
                "no orientation, no time offset and none of the causes that are tried explains it: check joints, intrinsics \
                 and the axes of the IMU"
            } else {
                "no orientation, no time offset and none of the causes that are tried explains it: check intrinsics, shutter, \
                 and axes, signs and units of the IMU"
            };
            let explanation = hypotheses::explain(&self.data, chain, self.suspects, tolerance_rad);
            explanation.report(key, &evidence, remedy, findings);
            if explanation.is_of(Area::Intrinsics) {
                return HandEyeOutcome::WrongIntrinsics;
            }
            if explanation.is_of(Area::Imu) {
                findings.exclude(Measurement::Gyroscope);
            }
            return HandEyeOutcome::Other;
        };
        if let Some(cause) = found.cause {
            cause.report(key, &evidence, "", findings);
        } else if fit.spread < MIN_SPREAD {
            let title = format!("{key} rotated about one axis only: its orientation cannot be checked");
            findings.unverified(Area::Extrinsics, title, evidence, "rotate about all axes");
        } else if sigma_rad > ORIENTATION_TOLERANCE_RAD {
            let title = format!("the rotations of {key} are predicted too inaccurately to check its orientation");
            let remedy = "noise of gyroscope or encoders is as large as the rotations: rotate faster or longer";
            findings.unverified(Area::Extrinsics, title, evidence, remedy);
        } else if error_rad > tolerance_rad {
            self.report_other_orientation(&fit.orientation, &found, evidence, findings);
            if let CameraMount::Static { imu_from_camera } = &self.camera.mount {
                let rotation = imu_from_camera.rotation;
                return HandEyeOutcome::OtherOrientation(rotation * fit.orientation * rotation.inverse());
            }
        } else {
            findings.good(Area::Extrinsics, format!("the orientation of {key} agrees with the rig"), evidence);
            self.report_unverified(&found.unverified, findings);
        }
        HandEyeOutcome::Other
    }

    /// Reports values of the lens whose errors no rotation shows.
    fn report_unverified(&self, values: &[LensValue], findings: &mut Findings) {
        if values.is_empty() {
            return;
        }
        let names: Vec<&str> = values.iter().map(|value| value.name).collect();
        let precisions: Vec<String> = values.iter().map(LensValue::precision).collect();
        let title = format!("the rotations of {} do not verify its {}", self.camera.key, names.join(" and "));
        let evidence = format!("{} rotations measure {}", self.data.measured.len(), precisions.join(", "));
        let remedy = "rotate the camera itself, about all axes: a stabilized camera hardly rotates";
        findings.unverified(Area::Intrinsics, title, evidence, remedy);
    }

    /// Reports an orientation of the camera against the rig, camera frame, with causes that explain it as well.
    fn report_other_orientation(
        &self,
        orientation: &UnitQuaternion<f64>,
        found: &WithinNoise,
        evidence: String,
        findings: &mut Findings,
    ) {
        let key = &self.camera.key;
        let angle_rad = orientation.angle();
        let severity = if angle_rad > WRONG_ROTATION_RAD { Severity::Error } else { Severity::Warning };
        let (title, remedy) = if let Some((images, remedy)) = turned_images(orientation) {
            (format!("the images of {key} are {images}, or its orientation differs from the rig"), remedy)
        } else {
            (format!("the orientation of {key} differs from the rig by {:.1}°", angle_rad.to_degrees()), CALIBRATE)
        };
        let causes = &found.instead_of_orientation;
        let mut titles: Vec<&str> = causes.iter().map(|cause| cause.sentence.statement.as_str()).collect();
        let mut remedies: Vec<&str> = causes.iter().map(|cause| cause.sentence.remedy.as_str()).collect();
        // Half a turn of a joint is less likely than images that are turned.
        let place = if turned_images(orientation).is_some() { 0 } else { found.more_likely };
        titles.insert(place, &title);
        remedies.insert(place, remedy);
        findings.add(severity, Area::Extrinsics, titles.join(", or "), evidence, remedies.join("; or "));
        let kind = if turned_images(orientation).is_some() { FaultKind::ImageFlip } else { FaultKind::Chain };
        let mut faults: Vec<Fault> = causes.iter().filter_map(|cause| cause.fault.clone()).collect();
        faults.insert(place.min(faults.len()), Fault::from(kind).of_camera(key));
        findings.state_faults(faults);
    }

    /// Chain of another convention that predicts the rotations much better than the rig's, with an orientation of the camera
    /// within tolerance; or, of a gimbal, one that explains them within the bounds of the rig, which the rig's does not.
    fn other_chain(&self, chain: &ClassicalChain, offset_s: f64, given_rad: f64) -> Option<OtherChain> {
        let candidates = self.other_chains(chain);
        let misfit = |candidate: &OtherChain| {
            let pairs = self.pairs(&candidate.chain, offset_s, 0.0);
            let vectors: Vec<_> = pairs.iter().map(|pair| (pair.predicted(&candidate.chain), pair.measured)).collect();
            let (error, _) = best_rotation(&vectors)?;
            Some((error.angle() < ORIENTATION_TOLERANCE_RAD, misfit_rad(&pairs, &candidate.chain)))
        };
        let measured = candidates.into_iter().filter_map(|candidate| {
            let (is_near, misfit_rad) = misfit(&candidate)?;
            is_near.then_some(OtherChain { misfit_rad, ..candidate })
        });
        let mut measured: Vec<OtherChain> = measured.collect();
        measured.sort_by(|one, other| one.misfit_rad.total_cmp(&other.misfit_rad));
        let is_clear = |best: &OtherChain| best.misfit_rad < OTHER_MISFIT * given_rad;
        if measured.first().is_some_and(is_clear) || self.camera.mount != CameraMount::Gimbal {
            return measured.into_iter().next().filter(is_clear);
        }
        let bound_rad = self.data.chain_sigma_rad();
        let priors = FitPriors {
            orientation_rad: bound_rad,
            time_offset_s: BOUND_OFFSET_S,
            scale: SCALE_SIGMA,
            chain: bound_rad,
        };
        let fit = |chain: &ClassicalChain| RotationFit::of(&self.pairs(chain, offset_s, JOINED_S), chain, &priors);
        let given = fit(chain)?;
        let fits = measured.into_iter().filter_map(|candidate| Some((fit(&candidate.chain)?, candidate)));
        let is_better = |(found, _): &(RotationFit, OtherChain)| {
            found.is_explained()
                && found.deviance + found.prior_square + DECISIVE < given.deviance + given.prior_square
                && found.prior_square < SMALLER_CHANGE * given.prior_square
        };
        let cost = |found: &RotationFit| found.deviance + found.prior_square;
        let best = fits.filter(is_better).min_by(|one, other| cost(&one.0).total_cmp(&cost(&other.0)));
        best.map(|(_, candidate)| OtherChain { is_certain: false, ..candidate })
    }

    /// Chains by other conventions than the rig's.
    fn other_chains(&self, chain: &ClassicalChain) -> Vec<OtherChain> {
        let inverted = |field: &str, chain: ClassicalChain| OtherChain {
            title: format!("{field} is inverted"),
            remedy: format!(
                "write the inverse of {field}: T_a_b maps points from b to a (Kalibr: T_cam_imu from the IMU to the camera)"
            ),
            chain,
            misfit_rad: f64::INFINITY,
            is_certain: true,
        };
        let base = ClassicalChain { imu_from_base: chain.imu_from_base.inverse(), ..chain.clone() };
        if self.camera.mount != CameraMount::Gimbal {
            return vec![inverted(&format!("{}.T_cam_imu", self.camera.key), base)];
        }
        let end = ClassicalChain { effector_from_camera: chain.effector_from_camera.inverse(), ..chain.clone() };
        let both = ClassicalChain { effector_from_camera: end.effector_from_camera, ..base.clone() };
        vec![
            inverted("gimbal.T_E_C", end),
            inverted("gimbal.T_I_B", base),
            inverted("each of gimbal.T_I_B and gimbal.T_E_C", both),
            OtherChain {
                title: "gimbal.links follow the modified convention of Denavit and Hartenberg (Craig)".to_owned(),
                remedy:
                    "move a and alpha of each link to the link before it: in the rig they follow the rotation and the \
                         translation about the joint's axis (classical convention)"
                        .to_owned(),
                chain: chain.read_as_modified(),
                misfit_rad: f64::INFINITY,
                is_certain: true,
            },
        ]
    }
}

/// Smallest error of the orientation that is one, in radians.
fn tolerance_rad(fit: &RotationFit) -> f64 {
    ORIENTATION_TOLERANCE_RAD.max(SIGNIFICANT_SIGMAS * fit.orientation_sigma_rad)
}

/// State of images by which the camera seems to be rotated, camera frame (x right, y down), with the remedy; `None` for
/// other rotations.
fn turned_images(orientation: &UnitQuaternion<f64>) -> Option<(&'static str, &'static str)> {
    const TURN: &str = "turn them upright in the driver, or turn T_cam_imu (T_E_C on a gimbal) about the optical axis";
    // Rotations are axial vectors: in an image mirrored at one axis they are rotated by 180° about the other one.
    const MIRROR: &str = "look at text in the images: mirror them back in the driver, or correct the extrinsics, by which \
                          the camera then looks backwards";
    let about = |axis: Vector3<f64>, angle_rad: f64| {
        so3::exp(&(axis * angle_rad)).angle_to(orientation) < ORIENTATION_TOLERANCE_RAD
    };
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    [
        (about(z, PI), ("upside down (rotated by 180°)", TURN)),
        (about(z, FRAC_PI_2), ("rotated by 90°", TURN)),
        (about(z, -FRAC_PI_2), ("rotated by -90°", TURN)),
        (about(x, PI), ("mirrored (left and right exchanged)", MIRROR)),
        (about(y, PI), ("mirrored (top and bottom exchanged)", MIRROR)),
    ]
    .into_iter()
    .find_map(|(is_near, found)| is_near.then_some(found))
}

/// Median difference of predicted and measured rotations, in radians.
fn misfit_rad(pairs: &[RotationPair], chain: &ClassicalChain) -> f64 {
    median(&pairs.iter().map(|pair| (pair.predicted(chain) - pair.measured).norm()).collect::<Vec<_>>())
}
