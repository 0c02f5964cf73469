//! The hypotheses that are tried for a camera.

use super::fit::Hypothesis;
use crate::faults::{Fault, FaultKind, JointUnit};
use crate::geometry::SignedAxes;
use crate::gimbal::ClassicalChain;
use crate::log_check::permutations::permutations;
use crate::log_check::rotations::data::RotationData;
use crate::sensors::CameraMount;

/// Number of times at which a change is tried.
const TIMES: usize = 12;

/// Smallest range of a joint that moves, in radians: in a smaller unit the readings would not move the camera.
const MIN_RANGE_RAD: f64 = 0.05;

/// Hypotheses about intrinsics that do not change, from an approximate ratio of the focal length to the rig's.
pub(super) fn intrinsics(focal: f64) -> Vec<Hypothesis> {
    vec![
        Hypothesis::new(vec![Fault::new(FaultKind::Focal, &[focal])], 1),
        Hypothesis::new(vec![Fault::new(FaultKind::PrincipalPoint, &[0.0; 2])], 2),
        Hypothesis::new(vec![Fault::new(FaultKind::Intrinsics, &[focal, 0.0, 0.0])], 3),
    ]
}

/// Hypothesis about a distortion that the rig lacks.
pub(super) fn radial() -> Hypothesis {
    Hypothesis::new(vec![Fault::new(FaultKind::Radial, &[0.0])], 1)
}

/// Hypotheses for a camera on a chain, but for those about its intrinsics; a chain without joints is that of a rigid
/// camera.
pub(super) fn candidates(data: &RotationData<'_>, chain: &ClassicalChain) -> Vec<Hypothesis> {
    let fitted = |kind, joints: &[&String], values| Hypothesis::new(Fault::starts(kind, joints, values), values);
    let mut all = vec![
        Hypothesis::new(vec![Fault::left_handed()], 0),
        fitted(FaultKind::GyroscopeScale, &[], 1),
        fitted(FaultKind::CameraDrift, &[], 2),
        fitted(FaultKind::Mount, &[], 3).since_one_of(times_s(data)),
    ];
    if data.camera.mount != CameraMount::Gimbal || chain.joint_count() == 0 {
        return all;
    }
    all.push(fitted(FaultKind::EncoderClock, &[], 1));
    // Joint angles that are computed from an attitude have neither sign nor order of their own.
    if data.rig.gimbal.as_ref().is_some_and(|gimbal| gimbal.attitude.is_some()) {
        return all;
    }
    let names = data.rig.joint_names();
    for signs in 1..1_usize << names.len() {
        let reversed = names.iter().enumerate().filter(|(joint, _)| signs >> joint & 1 == 1).map(|(_, name)| name);
        let start = Fault::from(FaultKind::JointReversed).of_joints(reversed);
        let offsets = start.joints.len();
        all.push(Hypothesis::new(vec![Fault { values: vec![0.0; offsets], ..start }], offsets));
    }
    let swapped = |order: Vec<usize>| {
        let joints = exchanges(&order).into_iter().flatten();
        Fault::from(FaultKind::JointsSwapped).of_joints(joints.map(|joint| &names[joint]))
    };
    all.push(Hypothesis::new(permutations(names.len()).into_iter().skip(1).map(swapped).collect(), 0));
    let in_unit = |unit: JointUnit| Fault::new(FaultKind::JointScale, &[unit.size_rad()]);
    let range = largest_range(data);
    let moves = |unit: &JointUnit| range * unit.size_rad() > MIN_RANGE_RAD;
    all.push(Hypothesis::new(JointUnit::all().filter(moves).map(in_unit).collect(), 0));
    if names.len() > 1 {
        all.push(fitted(FaultKind::JointScale, &[], 1));
    }
    for name in &names {
        all.push(fitted(FaultKind::JointPlay, &[name], 1));
        all.push(fitted(FaultKind::JointScale, &[name], 1));
        // With any orientation of the camera, an offset of the last joint would be unobservable.
        all.push(fitted(FaultKind::JointOffset, &[name], 1).with_orientation_of_rig());
        let jump = Fault::new(FaultKind::JointOffset, &[0.0]).of_joints([name]);
        all.push(Hypothesis::new(vec![jump], 1).since_one_of(times_s(data)));
    }
    all
}

/// Hypothesis about axes of the gyroscope other than the rig's; of a rigid camera, in the whole log, they are another orientation.
pub(super) fn other_axes() -> Hypothesis {
    Hypothesis::new(SignedAxes::all().skip(1).map(|axes| Fault::of_axes(FaultKind::GyroscopeAxes, axes)).collect(), 0)
}

/// The hypotheses with those that a fault begins at a time in the log, at which the misfits grow, and with further ones that
/// resemble another orientation of the camera if they act in the whole log.
pub(super) fn since(hypotheses: Vec<Hypothesis>, change_s: f64) -> Vec<Hypothesis> {
    let sudden = [
        Hypothesis::new(FaultKind::ImageFlip.trials(&[]), 0),
        Hypothesis::new(vec![Fault::new(FaultKind::CameraClock, &[0.0])], 1),
    ];
    let (mut all, constant): (Vec<_>, Vec<_>) = hypotheses.into_iter().partition(Hypothesis::begins);
    all = all.into_iter().map(|it| it.since(change_s)).collect();
    all.extend(constant.iter().cloned().chain(sudden).map(|it| it.since(change_s)));
    all.extend(constant);
    all
}

/// Largest range of the readings of a joint, in their unit.
fn largest_range(data: &RotationData<'_>) -> f64 {
    let samples = &data.survey.joint_samples;
    let joints = samples.first().map_or(0, |sample| sample.angles_rad.len());
    let range = |joint: usize| {
        let readings = || samples.iter().map(|sample| sample.angles_rad[joint]);
        readings().fold(f64::NEG_INFINITY, f64::max) - readings().fold(f64::INFINITY, f64::min)
    };
    (0..joints).map(range).fold(0.0, f64::max)
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

/// Times within the rotations at which a change is tried, in seconds.
fn times_s(data: &RotationData<'_>) -> Vec<f64> {
    let middles: Vec<f64> = data.measured.iter().map(|it| it.middle_s()).collect();
    (1..=TIMES).filter_map(|number| middles.get(number * middles.len() / (TIMES + 1)).copied()).collect()
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
