//! The hypotheses that are tried for a camera.

use std::f64::consts::PI;

use super::super::correction::{Correction, Parameter};
use super::super::permutations::permutations;
use super::fit::{Hypothesis, Kind};
use super::joint_unit::JointUnit;
use crate::gimbal::ClassicalChain;
use crate::log_check::rotations::data::RotationData;
use crate::sensors::CameraMount;

/// Ratios from which a factor is fitted.
const SCALES: [f64; 4] = [1.0, 2.0, 0.5, PI / 180.0];
/// Delays of joint angles from which the delay is fitted, in seconds.
const DELAYS_S: [f64; 5] = [-0.1, 0.0, 0.1, 0.2, 0.35];
/// Offsets of a joint from which its offset is fitted, in radians.
const OFFSETS_RAD: [f64; 5] = [0.0, 0.6, -0.6, PI / 2.0, -PI / 2.0];
/// Number of times at which a change is tried.
const TIMES: usize = 12;

/// Hypotheses about intrinsics that do not change, from an approximate ratio of the focal length to the rig's.
pub(super) fn intrinsics(joints: usize, focal: f64) -> Vec<Hypothesis> {
    let none = Correction::none(joints);
    let mut scaled = none.clone();
    scaled.lens.focal = focal;
    let [centre_x, centre_y] = [0, 1].map(Parameter::Centre);
    vec![
        Hypothesis::new(Kind::Focal, vec![scaled.clone()], &[Parameter::Focal]),
        Hypothesis::new(Kind::Centre, vec![none], &[centre_x, centre_y]),
        Hypothesis::new(Kind::Intrinsics, vec![scaled], &[Parameter::Focal, centre_x, centre_y]),
    ]
}

/// Hypotheses for a camera on a chain, but for those about its intrinsics; a chain without joints is that of a rigid
/// camera.
pub(super) fn candidates(data: &RotationData<'_>, chain: &ClassicalChain) -> Vec<Hypothesis> {
    let joints = chain.joint_count();
    let none = Correction::none(joints);
    let changed = |change: &dyn Fn(&mut Correction)| {
        let mut correction = none.clone();
        change(&mut correction);
        correction
    };
    let mut all = vec![
        Hypothesis::new(Kind::LeftHanded, vec![changed(&|it| it.gyroscope_scale = -1.0)], &[]),
        Hypothesis::new(
            Kind::GyroscopeScale,
            SCALES.iter().map(|scale| changed(&|it| it.gyroscope_scale = *scale)).collect(),
            &[Parameter::GyroscopeScale],
        ),
        Hypothesis::new(Kind::CameraDrift, vec![none.clone()], &[Parameter::CameraDelay, Parameter::CameraDrift]),
        Hypothesis::new(Kind::Mount, vec![none.clone()], &[0, 1, 2].map(Parameter::Mount)).since_one_of(times_s(data)),
    ];
    if data.camera.mount != CameraMount::Gimbal || joints == 0 {
        return all;
    }
    all.push(Hypothesis::new(
        Kind::JointDelay,
        DELAYS_S.iter().map(|delay_s| changed(&|it| it.joint_delay_s = *delay_s)).collect(),
        &[Parameter::JointDelay],
    ));
    // Joint angles that are computed from an attitude have neither sign nor order of their own.
    if data.rig.gimbal.as_ref().is_some_and(|gimbal| gimbal.attitude.is_some()) {
        return all;
    }
    for signs in 1..1_usize << joints {
        let reversed: Vec<usize> = (0..joints).filter(|joint| signs >> joint & 1 == 1).collect();
        let start = changed(&|it| reversed.iter().for_each(|joint| it.joints[*joint].scale = -1.0));
        let offsets: Vec<Parameter> = reversed.iter().map(|joint| Parameter::JointOffset(*joint)).collect();
        all.push(Hypothesis::new(Kind::JointSigns(reversed), vec![start], &offsets));
    }
    let orders = permutations(joints).into_iter().skip(1);
    let swapped =
        orders.map(|order| changed(&|it| order.iter().enumerate().for_each(|(at, from)| it.joints[at].source = *from)));
    all.push(Hypothesis::new(Kind::JointOrder, swapped.collect(), &[]));
    let in_unit = |unit: JointUnit| changed(&|it| it.joints.iter_mut().for_each(|joint| joint.scale = unit.size_rad()));
    all.push(Hypothesis::new(Kind::JointUnit, JointUnit::all().map(in_unit).collect(), &[]));
    for joint in 0..joints {
        let offsets = OFFSETS_RAD.iter().map(|offset| changed(&|it| it.joints[joint].offset_rad = *offset));
        all.push(Hypothesis::new(Kind::JointScale(joint), vec![none.clone()], &[Parameter::JointScale(joint)]));
        let offset = |starts: Vec<Correction>| {
            Hypothesis::new(Kind::JointOffset(joint), starts, &[Parameter::JointOffset(joint)])
        };
        // With any orientation of the camera, an offset of the last joint would be unobservable.
        all.push(offset(offsets.collect()).with_orientation_of_rig());
        all.push(offset(vec![none.clone()]).since_one_of(times_s(data)));
    }
    all
}

/// Times within the rotations at which a change is tried, in seconds.
fn times_s(data: &RotationData<'_>) -> Vec<f64> {
    let middles: Vec<f64> = data.measured.iter().map(|it| it.middle_s()).collect();
    (1..=TIMES).filter_map(|number| middles.get(number * middles.len() / (TIMES + 1)).copied()).collect()
}
