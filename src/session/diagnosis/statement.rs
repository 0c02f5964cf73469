//! Causes in words: the statement with its value, and the remedy.

use super::hypotheses::{Cause, TrialHypothesis};
use super::trial::{DiagnosedRun, TrialResult};
use crate::calibration::transform_distance;
use crate::gimbal::{ParameterId, ParameterPart, Quantity};
use crate::session::plan::MeasurementCorrection;
use crate::text::Named as _;

/// Statement and remedy of a cause; `from_s` is the stamp from which on its change acts, `None` for the whole run.
pub(super) fn texts(
    run: &DiagnosedRun<'_>,
    hypothesis: &TrialHypothesis,
    result: &TrialResult,
    from_s: Option<f64>,
) -> (String, String) {
    let camera = run.camera_key;
    let since = from_s.map_or_else(String::new, |from_s| format!(" from {from_s:.2} s on"));
    let corrections = hypothesis.changes.corrections.as_slice();
    let (statement, remedy) = match corrections {
        [first, rest @ ..] if !matches!(hypothesis.cause, Cause::Intrinsics) => {
            let (statement, remedy) = of_correction(run, first);
            match rest.first().map(|second| of_correction(run, second)) {
                Some((second, other)) => (format!("{statement}, and {second}"), format!("{remedy}; {other}")),
                None => (statement, remedy),
            }
        }
        _ => of_estimate(run, hypothesis, result, camera),
    };
    let remedy = match (from_s, hypothesis.cause) {
        (Some(from_s), Cause::Focal | Cause::Zoom) => {
            format!(
                "fix the zoom of {camera}; of this recording use --duration {from_s:.1}, or the rest with another rig"
            )
        }
        (Some(from_s), _) => format!("{remedy}; it holds from {from_s:.2} s on, before that the rig is right"),
        (None, _) => remedy,
    };
    (format!("{statement}{since}"), remedy)
}

fn of_correction(run: &DiagnosedRun<'_>, correction: &MeasurementCorrection) -> (String, String) {
    let camera = run.camera_key;
    let rig_camera = run.rig.camera(camera).ok();
    match correction {
        MeasurementCorrection::Focal(factor) => {
            let intrinsics = rig_camera.map_or([0.0; 6], |camera| camera.model.intrinsics());
            let [fx, fy, cx, cy, ..] = intrinsics;
            let error = if *factor < 1.0 {
                format!("{:.3} times too long", 1.0 / factor)
            } else {
                format!("{factor:.3} times too short")
            };
            (
                format!("the focal length of {camera} in the rig is {error}"),
                format!(
                    "calibrate the camera, or set {camera}.intrinsics: [{:.1}, {:.1}, {cx:.1}, {cy:.1}]",
                    fx * factor,
                    fy * factor
                ),
            )
        }
        MeasurementCorrection::Zoom(factor, over_s) => (
            format!("the focal length of {camera} changes by a factor of {factor:.2} over {over_s:.1} s"),
            format!("fix the zoom of {camera}"),
        ),
        MeasurementCorrection::Image(flip) => (
            format!("the images of {camera} are {}", flip.name()),
            format!("record {camera} without this operation, or convert the images and give them their own extrinsics"),
        ),
        MeasurementCorrection::Ignored(half) => (
            format!("the {} half of the images of {camera} contradicts the rest", half.name()),
            format!("mask what moves with the camera or the vehicle there: {camera}.mask in the rig"),
        ),
        MeasurementCorrection::CameraShift(shift_s) => {
            let given_s = rig_camera.map_or(0.0, |camera| camera.timeshift_cam_imu_s);
            let side = if *shift_s > 0.0 { "earlier" } else { "later" };
            (
                format!("the stamps of {camera} are {:.1} ms {side} than the rig says", 1e3 * shift_s.abs()),
                format!(
                    "set {camera}.timeshift_cam_imu: {:.4} in the rig, or run with timeshift=on",
                    given_s + shift_s
                ),
            )
        }
        MeasurementCorrection::JointShift(shift_s) => {
            let given_s = run.rig.gimbal.as_ref().map_or(0.0, |gimbal| gimbal.timeshift_gimbal_imu_s);
            let side = if *shift_s > 0.0 { "earlier" } else { "later" };
            (
                format!("the stamps of the joint angles are {:.1} ms {side} than the rig says", 1e3 * shift_s.abs()),
                format!(
                    "set gimbal.timeshift_gimbal_imu: {:.4} in the rig, or run with timeshift=on",
                    given_s + shift_s
                ),
            )
        }
        MeasurementCorrection::Reversed(joint) => (
            format!("joint {joint} counts in the other direction"),
            format!("reverse the sign of {joint} in the recording, or turn its axis in the rig"),
        ),
        MeasurementCorrection::Swapped(first, second) => (
            format!("joints {first} and {second} have each other's readings"),
            "correct the names of gimbal.links in the rig, or the order in the recording".to_owned(),
        ),
        MeasurementCorrection::Offset(joint, offset_rad) => (
            format!("the readings of joint {joint} are {:.1}° off", -offset_rad.to_degrees()),
            format!("check the zero of {joint}, or the heading of the vehicle if angles come from attitudes"),
        ),
        MeasurementCorrection::JointScale(factor) => {
            let unit = if *factor < 1.0 { "degrees" } else { "radians that were converted twice" };
            (format!("the joint angles are in {unit}"), "record radians, or set the unit of gimbal.source".to_owned())
        }
        MeasurementCorrection::ImuAxes(axes) => {
            let frame = if axes.is_left_handed() { "form a left-handed frame" } else { "belong to another frame" };
            (
                format!("the axes of the IMU {frame}: x/y/z of the rig's IMU are {axes} of the recording"),
                "correct the axes in the driver or the converter; check T_cam_imu or T_I_B if the frame is right-handed"
                    .to_owned(),
            )
        }
        MeasurementCorrection::GyroscopeAxes(axes) => (
            format!("the axes of the gyroscope differ from the accelerometer's: x/y/z are {axes} of the recording"),
            "correct the axes of the angular velocities in the driver or the converter".to_owned(),
        ),
        MeasurementCorrection::AccelerometerAxes(axes) => (
            format!("the axes of the accelerometer differ from the gyroscope's: x/y/z are {axes} of the recording"),
            "correct the axes of the specific forces in the driver or the converter".to_owned(),
        ),
        MeasurementCorrection::GyroscopeScale(factor) => (
            scale_text("angular velocities", *factor, std::f64::consts::PI / 180.0, "degrees per second"),
            "record rad/s; check the range setting of the gyroscope".to_owned(),
        ),
        MeasurementCorrection::AccelerometerScale(factor) => (
            scale_text("specific forces", *factor, 9.806_65, "g"),
            "record m/s²; check the range setting of the accelerometer".to_owned(),
        ),
    }
}

fn scale_text(what: &str, factor: f64, of_unit: f64, unit: &str) -> String {
    if (factor / of_unit - 1.0).abs() < 0.05 {
        format!("the {what} are in {unit}")
    } else {
        format!("the {what} are {:.3} times the true ones", 1.0 / factor)
    }
}

/// Texts of a cause whose value is estimated by the trial.
fn of_estimate(
    run: &DiagnosedRun<'_>,
    hypothesis: &TrialHypothesis,
    result: &TrialResult,
    camera: &str,
) -> (String, String) {
    let value = |part, quantity| result.calibration.get(&ParameterId { part, quantity }).copied();
    let changes = &hypothesis.changes;
    match hypothesis.cause {
        Cause::Shutter => {
            let (readout_s, sigma_s) = value(ParameterPart::Camera(0), Quantity::Readout).unwrap_or_default();
            let given_s = run.rig.camera(camera).map_or(0.0, |camera| camera.readout_s);
            let found = format!("{:.1} ± {:.1} ms", 1e3 * readout_s, 1e3 * sigma_s);
            let statement = if given_s == 0.0 {
                format!("{camera} has a rolling shutter: readout {found}")
            } else {
                format!("the readout of {camera} is {found}, not {:.1} ms", 1e3 * given_s)
            };
            (statement, format!("set {camera}.readout: {readout_s:.4} in the rig, or run with readout=on"))
        }
        Cause::Intrinsics => {
            let names = [("fx", Quantity::Fx), ("fy", Quantity::Fy), ("cx", Quantity::Cx), ("cy", Quantity::Cy)];
            let shown = names.iter().filter_map(|(name, quantity)| {
                let (value, sigma) = value(ParameterPart::Camera(0), *quantity)?;
                Some(format!("{name} {value:.1} ± {sigma:.1}"))
            });
            (
                format!("the intrinsics of {camera} are wrong: {}", shown.collect::<Vec<_>>().join(", ")),
                "calibrate the camera, or run with intrinsics=on".to_owned(),
            )
        }
        Cause::Chain => chain_texts(run, result),
        Cause::ImuIntrinsics => (
            "scale or misalignment of gyroscope and accelerometer".to_owned(),
            "calibrate the IMU, or run with imu-intrinsics=on".to_owned(),
        ),
        Cause::ImuNoise => (
            format!("the IMU is noisier than its noise densities in the rig, about {:.0} times", changes.imu_noise),
            "measure the densities: dcvins noise".to_owned(),
        ),
        Cause::EncoderNoise => {
            let sigma_rad = run.rig.gimbal.as_ref().and_then(|gimbal| gimbal.encoder_sigma_rad).unwrap_or_default();
            let found_rad = sigma_rad * changes.encoder_noise;
            (
                format!(
                    "the joint angles are noisier than gimbal.encoder_sigma, {:.2}° instead of {:.2}°",
                    found_rad.to_degrees(),
                    sigma_rad.to_degrees()
                ),
                format!("set gimbal.encoder_sigma: {found_rad:.5} in the rig, or check what makes the readings wrong"),
            )
        }
        _ => ("time offsets of camera and joint angles".to_owned(), "run with timeshift=on".to_owned()),
    }
}

fn chain_texts(run: &DiagnosedRun<'_>, result: &TrialResult) -> (String, String) {
    let on_gimbal = run.rig.chain_of_camera(run.camera_key).is_some_and(|chain| !chain.links.is_empty());
    let name = if on_gimbal { "gimbal chain" } else { "pose" };
    let found = result.chain.as_ref().zip(run.rig.chain_of_camera(run.camera_key)).and_then(|(found, given)| {
        let angles = &result.joints_rad.last()?.1;
        let fits = found.links.len() == angles.len() && given.links.len() == angles.len();
        fits.then(|| transform_distance(&found.imu_from_camera(angles), &given.imu_from_camera(angles)))
    });
    let by = found.map_or_else(String::new, |(distance_m, angle_rad)| {
        format!(" by {:.1}° and {:.0} mm", angle_rad.to_degrees(), 1e3 * distance_m)
    });
    let bounds = if on_gimbal { "gimbal.prior: its bounds are smaller than the error" } else { "T_cam_imu" };
    (
        format!("the {name} of {} in the rig is wrong{by}", run.camera_key),
        format!("calibrate it (dcvins calibrate, or the rig.yaml of a run with the fork's change); check {bounds}"),
    )
}
