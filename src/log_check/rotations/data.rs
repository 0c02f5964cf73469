//! Rotations of a camera between its images with the measurements that predict them, as recorded or with a correction.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::fit::RotationPair;
use super::readout::between_first_rows;
use crate::faults::{Fault, JointMap, LensChange, Sensor, joint_maps};
use crate::flight_log::stream::angle_fit::FittedAngle;
use crate::frontend::readout::{RowObservation, RowTrack};
use crate::geometry::{ns_from_seconds, seconds_from_ns, so3, wrap_angle};
use crate::gimbal::ClassicalChain;
use crate::log_check::imu::ImuFacts;
use crate::log_check::report::ImageRotation;
use crate::log_check::survey::Survey;
use crate::sensors::{AngularRates, CameraRig, Rig};

/// Length over which the rotations of a camera on joints are joined, in seconds: the angles of joints are noisy.
pub(crate) const JOINED_S: f64 = 0.3;

/// Number of rotations with which other lenses are tried first, and of consecutive ones in a block.
const THINNED: usize = 200;
const BLOCK: usize = 10;
/// Difference of stamps that are the same, in nanoseconds: rotations are stamped by way of seconds.
const SAME_NS: i64 = 1_000;
/// Samples to either side over which an angle is smoothed for the direction of a joint's motion, and the change by which it
/// turns back, in standard deviations and in radians.
const SMOOTHED: usize = 8;
const MOVING_SIGMAS: f64 = 2.0;
const MOVING_RAD: f64 = 1e-3;

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
    /// Stamps of the first images of the rotations that are used, `None` for all.
    used_ns: Option<BTreeSet<i64>>,
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
        Self { survey, rig, imu_facts, camera, readout_s, delay_s: 0.0, images, measured, used_ns: None }
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
        if *lens == LensChange::NONE { self.measured.clone() } else { self.with_lens_at(|_| *lens) }
    }

    /// Rotations with intrinsics that depend on the stamp of an image, in seconds since the log began.
    pub(crate) fn with_lens_at(&self, lens_at: impl Fn(f64) -> LensChange) -> Vec<MeasuredRotation> {
        let observation = |lens: &LensChange, seen: &RowObservation| RowObservation {
            bearing: lens.bearing(&seen.bearing),
            row: seen.row,
        };
        let of_camera = self.images.iter().filter(|image| image.camera_key == self.camera.key);
        let changed = of_camera.filter(|image| self.is_used(image)).map(|image| {
            let [previous, now] = [image.from_ns, image.to_ns].map(|stamp_ns| lens_at(seconds_from_ns(stamp_ns)));
            let track = |track: &RowTrack| RowTrack {
                previous: observation(&previous, &track.previous),
                now: observation(&now, &track.now),
            };
            ImageRotation {
                second_from_first: so3::exp(&now.rotation(&so3::log(&image.second_from_first))),
                tracks: image.tracks.iter().map(track).collect(),
                ..image.clone()
            }
        });
        first_rows(self.camera, &changed.collect::<Vec<_>>(), self.readout_s)
    }

    /// The data with at most about [`THINNED`] rotations, in blocks of consecutive images over the whole log.
    pub(crate) fn thinned(&self) -> Self {
        let thinning = self.measured.len().div_ceil(THINNED).max(1);
        let blocks = self.measured.chunks(BLOCK).step_by(thinning);
        let used_ns = blocks.flatten().map(|it| it.rotation.from_ns).collect();
        let thinned = Self { used_ns: Some(used_ns), ..self.clone() };
        let measured = self.measured.iter().filter(|it| thinned.is_used(&it.rotation)).cloned().collect();
        Self { measured, ..thinned }
    }

    fn is_used(&self, rotation: &ImageRotation) -> bool {
        let near = rotation.from_ns - SAME_NS..=rotation.from_ns + SAME_NS;
        self.used_ns.as_ref().is_none_or(|used_ns| used_ns.range(near).next().is_some())
    }

    /// [`Self::with_lens`] for several lenses.
    pub(crate) fn with_lenses(&self, lenses: &[LensChange]) -> Vec<Vec<MeasuredRotation>> {
        lenses.par_iter().map(|lens| self.with_lens(lens)).collect()
    }

    /// Direction, −1 or 1, in which each joint moved last, at each sample of the joint angles: as by a gear with play, it changes
    /// where the angle turns back by more than its noise.
    fn directions(&self) -> Vec<Vec<f64>> {
        let samples = &self.survey.joint_samples;
        let joints = samples.first().map_or(0, |sample| sample.angles_rad.len());
        let middle_ns = samples.get(samples.len() / 2).map_or(0, |sample| sample.stamp_ns);
        let fitted = self.survey.fitted_angles_at(middle_ns);
        let direction = |joint: usize| {
            let sigma_rad =
                fitted.as_ref().and_then(|fitted| fitted.get(joint)).map_or(0.0, |it| it.variance_rad2.sqrt());
            let smallest_rad = (MOVING_SIGMAS * sigma_rad).max(MOVING_RAD);
            let smooth = |place: usize| {
                let near = &samples[place.saturating_sub(SMOOTHED)..(place + SMOOTHED + 1).min(samples.len())];
                let around_rad = samples[place].angles_rad[joint];
                let changes = near.iter().map(|sample| wrap_angle(sample.angles_rad[joint] - around_rad));
                around_rad + changes.sum::<f64>() / near.len() as f64
            };
            let mut directions = vec![0.0; samples.len()];
            let (mut direction, mut turned, mut unwrapped_rad) = (1.0, 0, 0.0);
            let (mut farthest_rad, mut last_rad) = (f64::NEG_INFINITY, samples.first().map_or(0.0, |_| smooth(0)));
            for place in 0..samples.len() {
                let angle_rad = smooth(place);
                unwrapped_rad += wrap_angle(angle_rad - last_rad);
                last_rad = angle_rad;
                let ahead_rad = direction * unwrapped_rad;
                if ahead_rad > farthest_rad {
                    (farthest_rad, turned) = (ahead_rad, place);
                } else if farthest_rad - ahead_rad > smallest_rad {
                    direction = -direction;
                    directions[turned..place].fill(direction);
                    (farthest_rad, turned) = (-ahead_rad, place);
                }
                directions[place] = direction;
            }
            directions
        };
        (0..joints).map(direction).collect()
    }

    /// Predictor with a fault undone; the rotations that it is used for must be measured with the lens of the fault.
    pub(crate) fn predictor<'b>(&'b self, chain: &'b ClassicalChain, fault: Option<&'b Fault>) -> Predictor<'b> {
        let corrected = |fault: &Fault| {
            let rates = &self.imu_facts.gyroscope;
            // The bias belongs to the sound measurements before a fault that begins.
            let before = fault.since_s.and(self.imu_facts.gyroscope_bias_rad_per_s);
            let bias = before.unwrap_or_default();
            fault.corrects(Sensor::Imu).then(|| rates.changed(|rate| fault.angular_velocity(&(rate + bias)) - bias))
        };
        let joints = joint_maps(fault, &self.rig.joint_names());
        let has_play = joints.iter().any(|joint| joint.play_rad != 0.0);
        let directions = if has_play { self.directions() } else { Vec::new() };
        Predictor { data: self, chain, fault, joints, directions, rates: fault.and_then(corrected) }
    }
}

/// Predicts rotations by gyroscope, joints and chain with a fault undone.
pub(crate) struct Predictor<'a> {
    data: &'a RotationData<'a>,
    chain: &'a ClassicalChain,
    fault: Option<&'a Fault>,
    joints: Vec<JointMap>,
    /// Directions of the joints at all samples; empty without play.
    directions: Vec<Vec<f64>>,
    /// Corrected angular rates, `None` for those recorded.
    rates: Option<AngularRates>,
}

impl Predictor<'_> {
    /// A measured rotation with the data that predict it; `None` where these are missing.
    pub(crate) fn pair(&self, measured: &MeasuredRotation) -> Option<RotationPair> {
        self.pair_at(measured, [0.0; 2])
    }

    /// [`Self::pair`] with seconds that are added to the stamps of the first and the second image.
    pub(crate) fn pair_at(&self, measured: &MeasuredRotation, shifts_s: [f64; 2]) -> Option<RotationPair> {
        let rotation = &measured.rotation;
        let corrected_ns = |stamp_ns: i64, shift_s: f64| {
            let extra_s = self.fault.map_or(0.0, |fault| fault.camera_shift_s(seconds_from_ns(stamp_ns)));
            stamp_ns + ns_from_seconds(self.data.camera.timeshift_cam_imu_s + self.data.delay_s + extra_s + shift_s)
        };
        let (from_ns, to_ns) = (corrected_ns(rotation.from_ns, shifts_s[0]), corrected_ns(rotation.to_ns, shifts_s[1]));
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
        let at_ns = stamp_ns - ns_from_seconds(shift_s);
        let readings = self.data.survey.fitted_angles_at(at_ns)?;
        let place = self.data.survey.joint_samples.partition_point(|sample| sample.stamp_ns < at_ns);
        let direction =
            |joint: usize| self.directions.get(joint).and_then(|all| all.get(place)).copied().unwrap_or(0.0);
        let angle = |joint: &JointMap| {
            let reading = readings.get(joint.source)?;
            let variance_rad2 = reading.variance_rad2 * joint.scale * joint.scale;
            let play_rad = joint.play_rad * direction(joint.source);
            let angle_rad = joint.scale * reading.angle_rad + joint.offset_rad + play_rad;
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
