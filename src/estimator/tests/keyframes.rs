//! Selection of keyframes.

use super::fixture;
use super::flight::step;
use crate::estimator::Estimator;
use crate::estimator::config::{EstimatorConfig, EstimatorOptions, KEYFRAME_JOINT_INTERVAL_S};
use crate::estimator::report::EventKind;
use crate::geometry::seconds_from_ns;
use crate::gimbal::Parameterization;
use crate::sensors::ChainPrior;
use crate::simulation::{SyntheticOptions, synthetic_tracks};

#[test]
fn moving_joints_make_keyframes_where_rotations_of_the_chain_are_inaccurate() {
    // A vehicle that stands still from 4.5 s on, whose images have no parallax, while a joint swings by 15°.
    let of_rotations = |rotation_bound_rad: f64, use_encoder: bool| {
        let start_error = ChainPrior { translation_bound_m: 0.01, rotation_bound_rad };
        let flight = synthetic_tracks(&SyntheticOptions { start_error, ..fixture::joint_swing(0, 12.0) });
        let config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
        let config = EstimatorConfig { use_encoder, ..config };
        let mut estimator = Estimator::new(config);
        let (mut by_joints, mut newest) = (Vec::new(), 0.0);
        for frame in &flight.frames {
            let report = step(&mut estimator, frame);
            let time_s = seconds_from_ns(frame.stamp_ns);
            let chosen = report.events.iter().find(|event| event.kind == EventKind::KeyframeChosen);
            if let Some(event) = chosen.filter(|_| report.keyframe) {
                if event.message.contains("a joint has moved") {
                    by_joints.push(time_s - newest);
                }
                newest = time_s;
            }
        }
        by_joints
    };
    let by_joints = of_rotations(5_f64.to_radians(), true);
    assert!(by_joints.len() >= 20, "{by_joints:?}");
    assert!(by_joints.iter().all(|since_s| *since_s >= KEYFRAME_JOINT_INTERVAL_S - 1e-6), "{by_joints:?}");
    assert!(of_rotations(0.5_f64.to_radians(), true).is_empty());
    assert!(of_rotations(5_f64.to_radians(), false).is_empty());
}
