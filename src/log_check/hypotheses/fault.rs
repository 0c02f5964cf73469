//! Findings of the hypotheses as faults with their values.

use nalgebra::Matrix3;

use super::fit::{Fitted, Kind};
use crate::geometry::SignedAxes;
use crate::log_check::measured_fault::{FaultySource, MeasuredFault};
use crate::log_check::rotations::data::RotationData;
use crate::sensors::CameraMount;

/// Fault that a fit describes; `None` if the fit does not give its value.
pub(super) fn fault(data: &RotationData<'_>, found: &Fitted) -> Option<MeasuredFault> {
    let camera_key = data.camera.key.clone();
    let correction = &found.correction;
    let joints = data.rig.gimbal.as_ref().map_or(&[][..], |gimbal| &gimbal.joints);
    let name = |joint: usize| joints.get(joint).map(|joint| joint.name.clone());
    Some(match &found.kind {
        Kind::LeftHanded => MeasuredFault::GyroscopeAxes(recorded_axes(data, found)?),
        Kind::GyroscopeScale => MeasuredFault::GyroscopeScale(correction.gyroscope_scale),
        Kind::Focal => MeasuredFault::FocalLength { camera_key, ratio: correction.lens.focal },
        Kind::Centre | Kind::Intrinsics => MeasuredFault::PrincipalPoint { camera_key },
        Kind::FocalPieces(pieces) => match pieces.as_slice() {
            [_, (since_s, ratio)] => MeasuredFault::Zoom { camera_key, since_s: *since_s, ratio: *ratio },
            _ => MeasuredFault::Irreversible(FaultySource::Camera(camera_key)),
        },
        Kind::CameraDrift | Kind::Mount => MeasuredFault::Irreversible(FaultySource::Camera(camera_key)),
        Kind::JointSigns(reversed) => {
            MeasuredFault::JointsReversed(reversed.iter().map(|joint| name(*joint)).collect::<Option<_>>()?)
        }
        Kind::JointOrder => {
            let sources: Vec<usize> = correction.joints.iter().map(|joint| joint.source).collect();
            let pair = |[first, second]: [usize; 2]| Some([name(first)?, name(second)?]);
            MeasuredFault::JointsExchanged(exchanges(&sources).into_iter().map(pair).collect::<Option<_>>()?)
        }
        Kind::JointUnit => MeasuredFault::JointUnit(correction.joints.first()?.scale),
        // A fork scales the readings of all joints alike.
        Kind::JointScale(_) if joints.len() > 1 => MeasuredFault::Irreversible(FaultySource::Joints),
        Kind::JointScale(joint) => MeasuredFault::JointUnit(correction.joints.get(*joint)?.scale),
        Kind::JointOffset(joint) => MeasuredFault::JointOffset {
            joint: name(*joint)?,
            offset_rad: correction.joints.get(*joint)?.offset_rad,
            since_s: found.since_s,
        },
        Kind::JointDelay => MeasuredFault::JointShift { shift_s: -correction.joint_delay_s },
    })
}

/// Axes of the rig's IMU as those of a recording with a left-handed frame; the camera's orientation by the rig says which
/// are exchanged.
pub(super) fn recorded_axes(data: &RotationData<'_>, found: &Fitted) -> Option<SignedAxes> {
    let CameraMount::Static { imu_from_camera } = &data.camera.mount else { return None };
    // Recorded rates are ω' = P ω; the images measure R₀ ω = −R₁ R₀ ω' with the fitted orientation R₁.
    let rotation = imu_from_camera.rotation.inverse().to_rotation_matrix().into_inner();
    let orientation = found.fit.orientation.to_rotation_matrix().into_inner();
    let true_from_recorded: Matrix3<f64> = -(rotation.transpose() * orientation * rotation);
    SignedAxes::nearest(&true_from_recorded)
}

/// Pairs of places whose exchange, one after the other, puts the entry `sources[i]` to place `i`.
fn exchanges(sources: &[usize]) -> Vec<[usize; 2]> {
    let mut entries: Vec<usize> = (0..sources.len()).collect();
    let mut pairs = Vec::new();
    for (place, source) in sources.iter().enumerate() {
        match entries.iter().position(|entry| entry == source) {
            Some(other) if other != place => {
                entries.swap(place, other);
                pairs.push([place, other]);
            }
            _ => {}
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exchanges_give_the_order() {
        for sources in [vec![0, 1, 2], vec![0, 2, 1], vec![2, 0, 1], vec![1, 2, 0], vec![2, 1, 0]] {
            let mut entries = vec![0, 1, 2];
            for [first, second] in exchanges(&sources) {
                entries.swap(first, second);
            }
            assert_eq!(entries, sources);
        }
        assert_eq!(exchanges(&[0, 2, 1]), [[1, 2]]);
    }
}
