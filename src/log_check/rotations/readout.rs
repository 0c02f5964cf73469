//! Rolling shutters: the readout of each camera, measured from the variation of the image motion over the rows.

use nalgebra::Matrix3;

use crate::faults::{Fault, FaultKind, Sentence, Subject};
use crate::frontend::readout::{
    FirstRowRotation, ImagePair, ReadoutMeasurement, ReadoutOptions, measure_readout, rotations_of_first_rows,
};
use crate::geometry::{ns_from_seconds, seconds_from_ns};
use crate::log_check::imu::ImuFacts;
use crate::log_check::report::{Area, Findings, ImageRotation, Severity};
use crate::sensors::{AngularRates, CameraMount, CameraRig, Rig};

/// A readout is reported if it differs from the rig's by more standard deviations than this.
const SIGNIFICANT_SIGMAS: f64 = 5.0;
/// It must also differ by more than this; below, rows are exposed within a millisecond of the rig's time.
const TOLERANCE_S: f64 = 0.002;
/// With a larger standard deviation the readout counts as unobservable.
const USEFUL_SIGMA_S: f64 = 0.003;

/// Checks a camera's readout by the features of consecutive images; returns the readout to be used for its rotations.
pub(crate) fn check_readout(
    rig: &Rig,
    camera: &CameraRig,
    imu_facts: &ImuFacts,
    rotations: &[ImageRotation],
    findings: &mut Findings,
) -> f64 {
    let key = &camera.key;
    let images = image_pairs(camera, rotations);
    if images.is_empty() {
        return camera.readout_s;
    }
    let Some(found) = measured(camera, &images, imu_facts) else {
        let title = format!("the readout of {key} is unobservable from its images");
        let evidence = format!("{} image pairs, with too little rotation for rows to differ", images.len());
        findings.add(Severity::Note, Area::Time, title, evidence, ROTATE);
        return camera.readout_s;
    };
    let ReadoutMeasurement { readout_s, sigma_s, misfits_rad, .. } = found;
    let [without_px, with_px] = misfits_rad.map(|misfit_rad| misfit_rad * camera.model.focal_length_px());
    let evidence = format!(
        "readout {:+.1} ms ± {:.1} ms by {} image pairs; 90 % of the features are within {without_px:.2} px of the motion of \
         their pair with all rows exposed at once, within {with_px:.2} px with this readout",
        readout_s * 1e3,
        sigma_s * 1e3,
        found.pairs
    );
    let difference_s = (readout_s - camera.readout_s).abs();
    let difference = difference_s > TOLERANCE_S && difference_s > SIGNIFICANT_SIGMAS * sigma_s;
    if difference {
        let fault = Fault::new(FaultKind::Shutter, &[readout_s, sigma_s]).of_camera(key);
        let Sentence { severity, statement, remedy } = Subject { rig, camera_key: key }.sentence(&fault);
        findings.add(severity, Area::Time, statement, evidence, remedy);
        findings.state_faults([fault]);
        return readout_s;
    }
    if sigma_s > USEFUL_SIGMA_S {
        let title = format!("the readout of {key} is unobservable from its images");
        findings.add(Severity::Note, Area::Time, title, evidence, ROTATE);
    } else if camera.readout_s == 0.0 {
        findings.good(Area::Time, format!("{key} exposes all rows at once"), evidence);
    } else {
        findings.good(Area::Time, format!("the readout of {key} agrees with the rig"), evidence);
    }
    camera.readout_s
}

const ROTATE: &str = "rotate faster, back and forth about all axes";

/// Features of a camera's consecutive images, with the rig's time offset applied.
fn image_pairs(camera: &CameraRig, rotations: &[ImageRotation]) -> Vec<ImagePair> {
    let of_camera = rotations.iter().filter(|rotation| rotation.camera_key == camera.key);
    of_camera
        .filter(|rotation| !rotation.tracks.is_empty())
        .map(|rotation| ImagePair {
            stamps_s: [rotation.from_ns, rotation.to_ns]
                .map(|stamp_ns| seconds_from_ns(stamp_ns) + camera.timeshift_cam_imu_s),
            rotation: rotation.second_from_first,
            tracks: rotation.tracks.clone(),
        })
        .collect()
}

/// A camera's rotations between the first rows of its images, to which their stamps refer, each with the covariance of its
/// rotation vector in rad²; images with too few features are omitted.
pub(crate) fn between_first_rows(
    camera: &CameraRig,
    rotations: &[ImageRotation],
    readout_s: f64,
) -> Vec<(ImageRotation, Matrix3<f64>)> {
    let options = ReadoutOptions::for_focal_length(camera.model.focal_length_px());
    let stamp_ns = |time_s: f64| ns_from_seconds(time_s - camera.timeshift_cam_imu_s);
    let rotation = |found: FirstRowRotation| {
        let rotation = ImageRotation {
            camera_key: camera.key.clone(),
            from_ns: stamp_ns(found.stamps_s[0]),
            to_ns: stamp_ns(found.stamps_s[1]),
            second_from_first: found.rotation,
            tracks: Vec::new(),
        };
        (rotation, found.covariance_rad2)
    };
    rotations_of_first_rows(&image_pairs(camera, rotations), readout_s, &options).into_iter().map(rotation).collect()
}

fn measured(camera: &CameraRig, images: &[ImagePair], imu_facts: &ImuFacts) -> Option<ReadoutMeasurement> {
    let options = ReadoutOptions::for_focal_length(camera.model.focal_length_px());
    let CameraMount::Static { imu_from_camera } = &camera.mount else {
        return measure_readout(images, None, &options);
    };
    let camera_from_imu = imu_from_camera.rotation.inverse();
    let gyroscope = AngularRates::new(
        imu_facts
            .samples
            .iter()
            .map(|sample| (seconds_from_ns(sample.stamp_ns), camera_from_imu * sample.angular_velocity_rad_per_s)),
    );
    measure_readout(images, Some(&gyroscope), &options)
}
