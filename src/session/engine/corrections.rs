//! Corrections of a fork, applied to the measurements of its steps.

use nalgebra::Vector2;

use crate::camera::CameraModel;
use crate::faults::{Fault, FaultKind, Sensor, check_joints, correct_joint_angles};
use crate::frontend::{TrackedFeature, TrackedFrame};
use crate::geometry::{ns_from_seconds, seconds_from_ns};
use crate::sensors::{ImuSample, JointAngles, Rig};
use crate::session::plan::ForkError;

/// Steps of a fork with another offset of a joint whose readings are not used.
const UNREAD_STEPS: usize = 2;

/// Corrections with the joints and the camera that they change.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct MeasurementCorrections {
    /// Model of the main camera in the rig; `None` without a correction of its images.
    camera: Option<CameraModel>,
    joint_names: Vec<String>,
    /// In the order in which they are applied.
    faults: Vec<Fault>,
    /// Stamp of the first step of the fork; `None` before it.
    start_ns: Option<i64>,
    /// Number of steps from then on without joint angles: readings within a change of an offset are in between.
    unread: usize,
}

impl MeasurementCorrections {
    /// The corrections of a fork. `camera_key` is the key of the main camera.
    ///
    /// # Errors
    /// If the rig has no such joint.
    pub(super) fn of(faults: &[Fault], rig: &Rig, camera_key: &str) -> Result<Self, ForkError> {
        let joint_names = rig.joint_names();
        check_joints(faults, &joint_names)
            .map_err(|problem| ForkError::BadChange { text: "correct=…".to_owned(), problem })?;
        let changes_images = faults.iter().any(|fault| fault.corrects(Sensor::Camera));
        let camera = rig.camera(camera_key).ok().filter(|_| changes_images).map(|camera| camera.model.clone());
        let has_offset = faults.iter().any(|fault| fault.kind == FaultKind::JointOffset);
        let unread = if has_offset { UNREAD_STEPS } else { 0 };
        Ok(Self { camera, joint_names, faults: faults.to_vec(), start_ns: None, unread })
    }

    /// Adds the corrections of a fork to the corrections of its parent.
    pub(super) fn add(&mut self, other: Self) {
        self.camera = other.camera.or_else(|| self.camera.take());
        self.joint_names = other.joint_names;
        self.faults.extend(other.faults);
        (self.start_ns, self.unread) = (None, other.unread);
    }

    /// Takes note of the next step; true if its joint angles are not used.
    pub(super) fn begin_step(&mut self, stamp_ns: i64) -> bool {
        self.start_ns.get_or_insert(stamp_ns);
        let unread = self.unread > 0;
        self.unread = self.unread.saturating_sub(1);
        unread
    }

    pub(super) fn camera_shift_ns(&self) -> i64 {
        ns_from_seconds(self.faults.iter().map(|fault| fault.camera_shift_s(0.0)).sum())
    }

    /// The main camera's tracks, `None` without a correction of images; features outside the domain of the camera model
    /// are dropped.
    ///
    /// Positions are those at which the rig's camera would see the same directions: with a focal length `F` times the
    /// rig's, their errors are `1/F` times those in the image.
    pub(super) fn tracks(&self, tracks: &TrackedFrame) -> Option<TrackedFrame> {
        let camera = self.camera.as_ref()?;
        let since_s = self.start_ns.map_or(0.0, |start_ns| seconds_from_ns(tracks.stamp_ns - start_ns));
        let corrected = |uv_px: Vector2<f64>| {
            self.faults.iter().try_fold(uv_px, |uv_px, fault| fault.pixel(camera, uv_px, since_s))
        };
        let features = tracks.features.iter().filter_map(|feature| {
            let uv_px = corrected(feature.uv_px)?;
            let previous_uv_px = feature.previous_uv_px.and_then(corrected);
            let bearing = camera.unproject(&uv_px)?;
            Some(TrackedFeature { uv_px, previous_uv_px, bearing, ..*feature })
        });
        Some(TrackedFrame { features: features.collect(), ..tracks.clone() })
    }

    /// Corrected samples, `None` without a correction of the IMU.
    pub(super) fn imu(&self, samples: &[ImuSample]) -> Option<Vec<ImuSample>> {
        let of_imu: Vec<&Fault> = self.faults.iter().filter(|fault| fault.corrects(Sensor::Imu)).collect();
        let corrected = |sample: &ImuSample| of_imu.iter().fold(*sample, |sample, fault| fault.imu_sample(&sample));
        (!of_imu.is_empty()).then(|| samples.iter().map(corrected).collect())
    }

    /// Corrects the readings at an image.
    pub(super) fn joint_angles(&self, angles: &mut JointAngles) {
        correct_joint_angles(&self.faults, &self.joint_names, angles);
    }

    pub(super) fn changes_joints(&self) -> bool {
        self.faults.iter().any(|fault| fault.corrects(Sensor::Joints) || fault.kind == FaultKind::CameraClock)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frontend::FeatureId;
    use crate::sensors::JointMotionFit;
    use crate::simulation::{SyntheticOptions, synthetic_tracks};

    fn corrections(texts: &[&str]) -> Result<(MeasurementCorrections, Rig), ForkError> {
        let flight = synthetic_tracks(&SyntheticOptions { duration_s: 0.1, ..SyntheticOptions::default() });
        let all: Vec<Fault> = texts.iter().map(|text| text.parse().unwrap()).collect();
        Ok((MeasurementCorrections::of(&all, &flight.given_rig, "cam0")?, flight.given_rig))
    }

    fn frame(rig: &Rig, uv_px: Vector2<f64>, stamp_ns: i64) -> TrackedFrame {
        let bearing = rig.cameras[0].model.unproject(&uv_px).unwrap();
        let feature = TrackedFeature { id: FeatureId(1), age: 0, uv_px, previous_uv_px: None, bearing };
        TrackedFrame { stamp_ns, features: vec![feature], ..TrackedFrame::default() }
    }

    #[test]
    fn directions_are_those_of_the_corrected_camera() {
        let (found, rig) = corrections(&["focal:0.5"]).unwrap();
        let camera = &rig.cameras[0].model;
        let [fx, _, cx, cy, ..] = camera.intrinsics();
        let tracks = found.tracks(&frame(&rig, Vector2::new(cx + 0.1 * fx, cy), 0)).unwrap();
        let bearing = tracks.features[0].bearing;
        assert!((bearing.x / bearing.z - 0.2).abs() < 1e-9, "{bearing}");
        let (mut zoom, _) = corrections(&["zoom:2:1s"]).unwrap();
        assert!(!zoom.begin_step(5_000_000_000));
        let later = zoom.tracks(&frame(&rig, Vector2::new(cx + 0.3 * fx, cy), 5_500_000_000)).unwrap();
        let bearing = later.features[0].bearing;
        assert!((bearing.x / bearing.z - 0.2).abs() < 1e-9, "{bearing}");
        let (none, _) = corrections(&["camera-shift:5ms"]).unwrap();
        assert_eq!(none.tracks(&frame(&rig, Vector2::new(cx, cy), 0)), None);
        let (half, _) = corrections(&["ignored:left"]).unwrap();
        assert!(half.tracks(&frame(&rig, Vector2::new(10.0, cy), 0)).unwrap().features.is_empty());
    }

    #[test]
    fn joints_are_corrected_with_their_rates() {
        let rig = corrections(&[]).unwrap().1;
        let name = rig.joint_names()[1].clone();
        let (mut found, _) = corrections(&[&format!("reversed:{name}"), "joint-shift:0.02s"]).unwrap();
        let fit = JointMotionFit { acceleration_rad_per_s2: 3.0, ..JointMotionFit::UNKNOWN };
        let mut angles = JointAngles {
            angles_rad: vec![0.1, 0.2, 0.3],
            rates_rad_per_s: vec![0.0, 1.0, 0.0],
            motion_fits: vec![JointMotionFit::UNKNOWN, fit, JointMotionFit::UNKNOWN],
            ..JointAngles::default()
        };
        assert!(found.changes_joints() && !found.begin_step(0));
        found.joint_angles(&mut angles);
        assert_eq!((angles.angles_rad[0], angles.angles_rad[2]), (0.1, 0.3));
        assert!((angles.angles_rad[1] - (-0.2 + 0.02 - 0.5 * 3.0 * 0.02 * 0.02)).abs() < 1e-12, "{angles:?}");
        assert!((angles.rates_rad_per_s[1] - (-1.0 + 0.06)).abs() < 1e-12, "{angles:?}");
        let unknown = corrections(&["offset:elbow:1deg"]).unwrap_err().to_string();
        assert!(unknown.contains("no joint 'elbow'") && unknown.contains(&name), "{unknown}");
        let (mut offset, _) = corrections(&[&format!("offset:{name}:1deg")]).unwrap();
        assert_eq!([0, 1, 2].map(|stamp_ns| offset.begin_step(stamp_ns)), [true, true, false]);
    }

    #[test]
    fn samples_are_rotated_in_the_order_of_the_forks() {
        let (mut found, _) = corrections(&["imu-axes:y/x/z"]).unwrap();
        found.add(corrections(&["accelerometer-scale:2"]).unwrap().0);
        let sample = ImuSample {
            stamp_ns: 0,
            angular_velocity_rad_per_s: nalgebra::Vector3::new(1.0, 2.0, 3.0),
            specific_force_m_per_s2: nalgebra::Vector3::new(4.0, 5.0, 6.0),
            unmeasured_s: 0.0,
        };
        let corrected = found.imu(&[sample]).unwrap()[0];
        assert_eq!(corrected.angular_velocity_rad_per_s, nalgebra::Vector3::new(2.0, 1.0, 3.0));
        assert_eq!(corrected.specific_force_m_per_s2, nalgebra::Vector3::new(10.0, 8.0, 12.0));
    }
}
