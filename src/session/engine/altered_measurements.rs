//! Measurements as changed by a fork.

use std::collections::BTreeSet;

use super::corrections::MeasurementCorrections;
use crate::frontend::{FeatureId, TrackedFrame};
use crate::geometry::SplitMix64;
use crate::sensors::JointAngles;

/// Changes to a run's measurements before the estimator uses them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct AlteredMeasurements {
    pub(super) dropped: BTreeSet<u64>,
    /// Indices of cameras whose tracks are not used.
    pub(super) disabled_cameras: BTreeSet<usize>,
    pub(super) encoder_off: bool,
    pub(super) joint_noise_rad: f64,
    pub(super) encoder_noise: f64,
    pub(super) corrections: MeasurementCorrections,
}

impl Default for AlteredMeasurements {
    fn default() -> Self {
        Self {
            dropped: BTreeSet::new(),
            disabled_cameras: BTreeSet::new(),
            encoder_off: false,
            joint_noise_rad: 0.0,
            encoder_noise: 1.0,
            corrections: MeasurementCorrections::default(),
        }
    }
}

impl AlteredMeasurements {
    /// Adds the changes of a fork to the changes of its parent.
    pub(super) fn add(&mut self, other: Self) {
        self.dropped.extend(other.dropped);
        self.disabled_cameras.extend(other.disabled_cameras);
        self.encoder_off |= other.encoder_off;
        self.joint_noise_rad = self.joint_noise_rad.hypot(other.joint_noise_rad);
        self.encoder_noise *= other.encoder_noise;
        self.corrections.add(other.corrections);
    }

    /// True if encoder readings are not used.
    pub(super) fn encoder_off(&self) -> bool {
        self.encoder_off
    }

    /// True if the images of a camera are not used.
    pub(super) fn is_disabled(&self, camera: usize) -> bool {
        self.disabled_cameras.contains(&camera)
    }

    /// The corrected tracks of a camera without the dropped features, `None` where nothing is changed.
    pub(super) fn tracks(&self, camera: usize, tracks: &TrackedFrame) -> Option<TrackedFrame> {
        let corrected = if camera == 0 { self.corrections.tracks(tracks) } else { None };
        self.kept(camera, corrected.as_ref().unwrap_or(tracks)).or(corrected)
    }

    /// The tracks without the dropped features, `None` where no feature is dropped.
    fn kept(&self, camera: usize, tracks: &TrackedFrame) -> Option<TrackedFrame> {
        let disabled = self.is_disabled(camera);
        let gone = |id: FeatureId| disabled || self.dropped.contains(&id.of_camera(camera).0);
        tracks.features.iter().any(|feature| gone(feature.id)).then(|| {
            let mut kept = tracks.clone();
            kept.features.retain(|feature| !gone(feature.id));
            kept.matched.retain(|feature| !gone(feature.id));
            kept
        })
    }

    /// Corrected joint angles with added Gaussian noise that depends only on stamp and joint, `None` where nothing is
    /// changed.
    pub(super) fn joint_angles(&self, angles: &JointAngles, stamp_ns: i64) -> Option<JointAngles> {
        if self.joint_noise_rad == 0.0 && self.encoder_noise == 1.0 && !self.corrections.changes_joints() {
            return None;
        }
        let mut altered = angles.clone();
        self.corrections.joint_angles(&mut altered);
        let mut random = SplitMix64::new(stamp_ns.unsigned_abs());
        for angle in &mut altered.angles_rad {
            // Irwin–Hall distribution: the sum of twelve uniform numbers has variance one.
            let normal = (0..12).map(|_| random.next_unit()).sum::<f64>() - 6.0;
            *angle += self.joint_noise_rad * normal;
        }
        let sigmas = altered.sigmas_rad.iter_mut().chain(&mut altered.lasting_sigmas_rad);
        sigmas.for_each(|sigma| *sigma *= self.encoder_noise);
        Some(altered)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measurements_are_altered_the_same_way_every_time() {
        let mut altered_measurements = AlteredMeasurements::default();
        let angles = JointAngles {
            angles_rad: vec![0.1, 0.2],
            sigmas_rad: vec![0.01, 0.01],
            lasting_sigmas_rad: vec![0.0, 0.0],
            ..JointAngles::default()
        };
        assert!(altered_measurements.joint_angles(&angles, 7).is_none());
        altered_measurements.add(AlteredMeasurements { joint_noise_rad: 0.03, ..AlteredMeasurements::default() });
        altered_measurements.add(AlteredMeasurements {
            joint_noise_rad: 0.04,
            encoder_noise: 2.0,
            ..AlteredMeasurements::default()
        });
        let altered = altered_measurements.joint_angles(&angles, 7).unwrap();
        assert_eq!(Some(&altered), altered_measurements.joint_angles(&angles, 7).as_ref());
        assert_eq!(altered.sigmas_rad, [0.02, 0.02]);
        let errors: Vec<f64> = (0..2000)
            .map(|stamp_ns| altered_measurements.joint_angles(&angles, stamp_ns).unwrap().angles_rad[1] - 0.2)
            .collect();
        let measured_sigma = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
        assert!((measured_sigma - 0.05).abs() < 0.003, "{measured_sigma}");
    }
}
