//! Selection of the window's keyframes.

use super::fixture;
use super::flight::step;
use crate::estimator::Estimator;
use crate::estimator::config::{
    EstimatorConfig, EstimatorOptions, FIRST_KEYFRAME_INTERVAL_S, KEYFRAME_JOINT_INTERVAL_S,
};
use crate::estimator::report::EventKind;
use crate::geometry::seconds_from_ns;
use crate::gimbal::Parameterization;
use crate::sensors::ChainPrior;
use crate::simulation::{SyntheticOptions, synthetic_tracks};

/// Keyframe of a flight.
#[derive(Debug)]
struct Keyframe {
    reason: String,
    since_last_s: f64,
    /// True before the first marginalization.
    is_of_first_window: bool,
}

/// Keyframes of a flight whose chain is given with errors of rotation up to a bound.
fn keyframes(rotation_bound_rad: f64, use_encoder: bool, options: &SyntheticOptions) -> Vec<Keyframe> {
    let start_error = ChainPrior { translation_bound_m: 0.01, rotation_bound_rad };
    let flight = synthetic_tracks(&SyntheticOptions { start_error, ..options.clone() });
    let config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
    let mut estimator = Estimator::new(EstimatorConfig { use_encoder, ..config });
    let (mut keyframes, mut newest_s, mut is_of_first_window) = (Vec::new(), 0.0, true);
    for frame in &flight.frames {
        let report = step(&mut estimator, frame);
        let time_s = seconds_from_ns(frame.stamp_ns);
        let chosen = report.events.iter().find(|event| event.kind == EventKind::KeyframeChosen);
        if let Some(event) = chosen.filter(|_| report.keyframe) {
            let reason = event.message.clone();
            keyframes.push(Keyframe { reason, since_last_s: time_s - newest_s, is_of_first_window });
            newest_s = time_s;
        }
        is_of_first_window &= report.events.iter().all(|event| event.kind != EventKind::OldestMarginalized);
    }
    keyframes
}

#[test]
fn moving_joints_make_keyframes_where_rotations_of_the_chain_are_inaccurate() {
    // A vehicle that stands still from 4.5 s on, whose images have no parallax, while a joint swings by 15°.
    let by_joints = |rotation_bound_rad: f64, use_encoder: bool| -> Vec<f64> {
        let keyframes = keyframes(rotation_bound_rad, use_encoder, &fixture::joint_swing(0, 12.0));
        let by_joints = keyframes.iter().filter(|keyframe| keyframe.reason.contains("a joint has moved"));
        by_joints.map(|keyframe| keyframe.since_last_s).collect()
    };
    let inaccurate = by_joints(5_f64.to_radians(), true);
    assert!(inaccurate.len() >= 20, "{inaccurate:?}");
    assert!(inaccurate.iter().all(|since_s| *since_s >= KEYFRAME_JOINT_INTERVAL_S - 1e-6), "{inaccurate:?}");
    assert!(by_joints(0.5_f64.to_radians(), true).is_empty());
    assert!(by_joints(5_f64.to_radians(), false).is_empty());
}

#[test]
fn keyframes_of_the_first_window_of_an_inaccurate_chain_are_apart() {
    // Number of keyframes by parallax within the interval, in the first window and later.
    let early = |rotation_bound_rad: f64| {
        let options = SyntheticOptions { duration_s: 9.0, ..SyntheticOptions::default() };
        let keyframes = keyframes(rotation_bound_rad, true, &options);
        let is_early = |keyframe: &&Keyframe| {
            keyframe.reason.contains("parallax") && keyframe.since_last_s < FIRST_KEYFRAME_INTERVAL_S
        };
        let (first, later): (Vec<_>, Vec<_>) =
            keyframes.iter().filter(is_early).partition(|keyframe| keyframe.is_of_first_window);
        [first.len(), later.len()]
    };
    let [first, later] = early(5_f64.to_radians());
    assert!(first == 0 && later > 0, "{first} in the first window, {later} later");
    let [first, _] = early(0.5_f64.to_radians());
    assert!(first > 0, "{first} in the first window");
}
