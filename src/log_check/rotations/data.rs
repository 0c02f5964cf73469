//! Rotations of a camera between its images with the measurements that predict them, as recorded or with a correction.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::fit::RotationPair;
use super::readout::between_first_rows;
use crate::faults::{Fault, JointMap, LensChange, Sensor, joint_maps};
use crate::flight_log::stream::angle_fit::FittedAngle;
use crate::frontend::readout::{RowObservation, RowTrack};
use crate::geometry::{ns_from_seconds, seconds_from_ns, so3};
use crate::gimbal::ClassicalChain;
use crate::log_check::imu::ImuFacts;
use crate::log_check::report::ImageRotation;
use crate::log_check::survey::Survey;
use crate::sensors::{AngularRates, CameraRig, Rig};

/// Length over which the rotations of a camera on joints are joined, in seconds: the angles of joints are noisy.
pub(crate) const JOINED_S: f64 = 0.3;

/// Rotation between two images that need not be consecutive.
#[derive(Clone, Debug)]
pub(crate) struct MeasuredRotation {
    /// With the covariance of the rotation vector, in rad².
    pub(crate) rotation: ImageRotation,
    pub(crate) covariance_rad2: Matrix3<f64>,
    /// Derivative of the rotation vector by a shift of both times, in rad/s; zero without neighbours.
    pub(crate) rate_change: Vector3<f64>,
}

impl MeasuredRotation {
    /// Middle of the rotation in seconds since the log began.
    pub(crate) fn middle_s(&self) -> f64 {
        0.5 * (seconds_from_ns(self.rotation.from_ns) + seconds_from_ns(self.rotation.to_ns))
    }
}

/// Rotations of one camera and the data that predict them.
#[derive(Clone)]
pub(crate) struct RotationData<'a> {
    pub(crate) survey: &'a Survey,
    pub(crate) rig: &'a Rig,
    pub(crate) imu_facts: &'a ImuFacts,
    pub(crate) camera: &'a CameraRig,
    readout_s: f64,
    /// Time to add to the camera's stamps beyond the rig's, in seconds, whatever the correction.
    delay_s: f64,
    /// As measured, with their features.
    images: &'a [ImageRotation],
    /// Between the first rows of consecutive images.
    pub(crate) measured: Vec<MeasuredRotation>,
}

impl<'a> RotationData<'a> {
    pub(crate) fn new(
        survey: &'a Survey,
        rig: &'a Rig,
        imu_facts: &'a ImuFacts,
        camera: &'a CameraRig,
        images: &'a [ImageRotation],
        readout_s: f64,
    ) -> Self {
        let measured = first_rows(camera, images, readout_s);
        Self { survey, rig, imu_facts, camera, readout_s, delay_s: 0.0, images, measured }
    }

    /// The data with the camera's stamps changed by a time in seconds.
    pub(crate) fn delayed(&self, delay_s: f64) -> Self {
        Self { delay_s, ..self.clone() }
    }

    /// Prior standard deviation of every parameter of the chain, in radians; a rigid camera has none.
    pub(crate) fn chain_sigma_rad(&self) -> f64 {
        self.rig.gimbal.as_ref().map_or(1.0, |gimbal| gimbal.prior.rotation_bound_rad)
    }

    /// Rotations with other intrinsics, from the features.
    pub(crate) fn with_lens(&self, lens: &LensChange) -> Vec<MeasuredRotation> {
        if *lens == LensChange::NONE {
            return self.measured.clone();
        }
        let observation =
            |seen: &RowObservation| RowObservation { bearing: lens.bearing(&seen.bearing), row: seen.row };
        let track =
            |track: &RowTrack| RowTrack { previous: observation(&track.previous), now: observation(&track.now) };
        let of_camera = self.images.iter().filter(|image| image.camera_key == self.camera.key);
        let changed = of_camera.map(|image| ImageRotation {
            second_from_first: so3::exp(&lens.rotation(&so3::log(&image.second_from_first))),
            tracks: image.tracks.iter().map(track).collect(),
            ..image.clone()
        });
        first_rows(self.camera, &changed.collect::<Vec<_>>(), self.readout_s)
    }

    /// [`Self::with_lens`] for several lenses.
    pub(crate) fn with_lenses(&self, lenses: &[LensChange]) -> Vec<Vec<MeasuredRotation>> {
        lenses.par_iter().map(|lens| self.with_lens(lens)).collect()
    }

    /// Predictor with a fault undone; the rotations that it is used for must be measured with the lens of the fault.
    pub(crate) fn predictor<'b>(&'b self, chain: &'b ClassicalChain, fault: Option<&'b Fault>) -> Predictor<'b> {
        let corrected = |fault: &Fault| {
            let rates = &self.imu_facts.gyroscope;
            fault.corrects(Sensor::Imu).then(|| rates.changed(|rate| fault.angular_velocity(rate)))
        };
        let joints = joint_maps(fault, &self.rig.joint_names());
        Predictor { data: self, chain, fault, joints, rates: fault.and_then(corrected) }
    }
}

/// Predicts rotations by gyroscope, joints and chain with a fault undone.
pub(crate) struct Predictor<'a> {
    data: &'a RotationData<'a>,
    chain: &'a ClassicalChain,
    fault: Option<&'a Fault>,
    joints: Vec<JointMap>,
    /// Corrected angular rates, `None` for those recorded.
    rates: Option<AngularRates>,
}

impl Predictor<'_> {
    /// A measured rotation with the data that predict it; `None` where these are missing.
    pub(crate) fn pair(&self, measured: &MeasuredRotation) -> Option<RotationPair> {
        let rotation = &measured.rotation;
        let corrected_ns = |stamp_ns: i64| {
            let extra_s = self.fault.map_or(0.0, |fault| fault.camera_shift_s(seconds_from_ns(stamp_ns)));
            stamp_ns + ns_from_seconds(self.data.camera.timeshift_cam_imu_s + self.data.delay_s + extra_s)
        };
        let (from_ns, to_ns) = (corrected_ns(rotation.from_ns), corrected_ns(rotation.to_ns));
        let [from_s, to_s] = [from_ns, to_ns].map(seconds_from_ns);
        let interval_s = to_s - from_s;
        let rates = self.rates.as_ref().unwrap_or(&self.data.imu_facts.gyroscope);
        let gyroscope_variance = self.data.rig.imu.noise.gyroscope_noise_density.powi(2);
        // Rotations are compared in the camera frame of the rig.
        let mount = self.fault.map_or_else(UnitQuaternion::identity, Fault::mount).inverse();
        let turn = mount.to_rotation_matrix().into_inner();
        let covariance = turn * measured.covariance_rad2 * turn.transpose();
        Some(RotationPair {
            middle_s: measured.middle_s(),
            measured: mount * so3::log(&rotation.second_from_first),
            covariance_rad2: covariance + Matrix3::identity() * (gyroscope_variance * interval_s),
            of_imu: rates.rotation_between(from_s, to_s)?,
            interval_s,
            rate_change: mount * measured.rate_change,
            angles: [self.angles_at(from_ns)?, self.angles_at(to_ns)?],
        })
    }

    fn angles_at(&self, stamp_ns: i64) -> Option<Vec<FittedAngle>> {
        if self.chain.links.is_empty() {
            return Some(Vec::new());
        }
        let shift_s = self.fault.map_or(0.0, Fault::joint_shift_s);
        let readings = self.data.survey.fitted_angles_at(stamp_ns - ns_from_seconds(shift_s))?;
        let angle = |joint: &JointMap| {
            let reading = readings.get(joint.source)?;
            let variance_rad2 = reading.variance_rad2 * joint.scale * joint.scale;
            let angle_rad = joint.scale * reading.angle_rad + joint.offset_rad;
            Some(FittedAngle { angle_rad, variance_rad2, ..*reading })
        };
        self.joints.iter().map(angle).collect()
    }
}

/// Rotations between the first rows of consecutive images.
fn first_rows(camera: &CameraRig, images: &[ImageRotation], readout_s: f64) -> Vec<MeasuredRotation> {
    let found = between_first_rows(camera, images, readout_s);
    let rate_change = |index: usize| {
        let neighbours = index.checked_sub(1).and_then(|before| found.get(before..index + 2));
        let Some([(before, _), (at, _), (after, _)]) = neighbours else { return Vector3::zeros() };
        if before.to_ns != at.from_ns || at.to_ns != after.from_ns {
            return Vector3::zeros();
        }
        let [before_s, after_s] = [before, after].map(|pair| 0.5 * seconds_from_ns(pair.from_ns + pair.to_ns));
        (so3::log(&after.second_from_first) - so3::log(&before.second_from_first)) / (after_s - before_s)
    };
    let changes: Vec<Vector3<f64>> = (0..found.len()).map(rate_change).collect();
    let measured =
        |((rotation, covariance_rad2), rate_change)| MeasuredRotation { rotation, covariance_rad2, rate_change };
    found.into_iter().zip(changes).map(measured).collect()
}

/// Joins consecutive rotations to ones over at least `length_s`, which do not overlap: the noise of joint angles does not
/// grow with the time between two images, their rotation does. A length of zero leaves them as they are.
pub(crate) fn joined(measured: &[MeasuredRotation], length_s: f64) -> Vec<MeasuredRotation> {
    if length_s <= 0.0 {
        return measured.to_vec();
    }
    let rate = |of: &ImageRotation| so3::log(&of.second_from_first) / seconds_from_ns(of.to_ns - of.from_ns).max(1e-9);
    let mut all = Vec::new();
    let mut start = 0;
    while let Some(first) = measured.get(start) {
        let (mut rotation, mut covariance) = (first.rotation.second_from_first, first.covariance_rad2);
        let mut end = start;
        let is_short = |end: usize| seconds_from_ns(measured[end].rotation.to_ns - first.rotation.from_ns) < length_s;
        while is_short(end) {
            let follows = |next: &&MeasuredRotation| next.rotation.from_ns == measured[end].rotation.to_ns;
            let Some(next) = measured.get(end + 1).filter(follows) else { break };
            let turn = next.rotation.second_from_first.to_rotation_matrix().into_inner();
            rotation = next.rotation.second_from_first * rotation;
            covariance = turn * covariance * turn.transpose() + next.covariance_rad2;
            end += 1;
        }
        if !is_short(end) {
            let last = &measured[end].rotation;
            all.push(MeasuredRotation {
                rotation: ImageRotation {
                    camera_key: first.rotation.camera_key.clone(),
                    from_ns: first.rotation.from_ns,
                    to_ns: last.to_ns,
                    second_from_first: rotation,
                    tracks: Vec::new(),
                },
                covariance_rad2: covariance,
                rate_change: rate(last) - rate(&first.rotation),
            });
        }
        start = end + 1;
    }
    all
}
