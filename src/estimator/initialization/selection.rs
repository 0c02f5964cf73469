//! Selection of views among the frames: spaced by parallax and time, newest first.

use nalgebra::{UnitQuaternion, Vector3};

use super::bearing::fit_rotation;
use super::{InitializationFrame, InitializationOptions};
use crate::frontend::TrackedFeature;
use crate::geometry::{seconds_from_ns, so3};
use crate::sensors::rotation_steps;

/// `first_imu_from_camera` rotation of every frame, from the bias-corrected gyroscope and the extrinsics.
pub(super) fn guessed_rotations(
    frames: &[InitializationFrame<'_>],
    gyroscope_bias: &Vector3<f64>,
) -> Vec<UnitQuaternion<f64>> {
    let mut first_from_imu = UnitQuaternion::identity();
    let mut rotations = Vec::with_capacity(frames.len());
    for (index, frame) in frames.iter().enumerate() {
        if index > 0 {
            let steps = rotation_steps(frame.imu, gyroscope_bias);
            let finite = steps.filter(|step| step.iter().all(|value| value.is_finite()));
            first_from_imu *= finite.fold(UnitQuaternion::identity(), |rotation, step| rotation * so3::exp(&step));
        }
        rotations.push(so3::composed(&first_from_imu, &frame.imu_from_camera.rotation));
    }
    rotations
}

/// Indices of the selected frames, ascending; the newest one is always selected.
///
/// Going back in time, a frame is selected when its parallax or time difference to the last selected one is large
/// enough, or when the next older frame has too few features in common with the last selected one. The views start
/// where even neighbouring frames have too few common features.
pub(super) fn select_views(
    frames: &[InitializationFrame<'_>],
    rotations: &[UnitQuaternion<f64>],
    options: &InitializationOptions,
) -> Vec<usize> {
    let Some(newest) = frames.len().checked_sub(1) else { return Vec::new() };
    let age = |from: usize, to: usize| seconds_from_ns(frames[to].stamp_ns - frames[from].stamp_ns);
    let mut selected = vec![newest];
    let mut last = newest;
    let mut candidate = newest;
    // Oldest frame so far with enough features in common with the last selected one.
    let mut linked = None;
    while candidate > 0 && selected.len() < options.max_views {
        candidate -= 1;
        if age(candidate, newest) > options.longest_window_s {
            break;
        }
        let pairs = shared_bearings(frames[candidate].features, frames[last].features);
        let mut taken = None;
        if pairs.len() < options.min_common_features {
            let Some(frame) = linked else { break };
            taken = Some(frame);
        } else {
            linked = Some(candidate);
            let spacing = age(candidate, last);
            if spacing >= options.max_spacing_s {
                taken = linked;
            } else if spacing >= options.min_spacing_s {
                let guess = rotations[last].inverse() * rotations[candidate];
                let parallax = fit_rotation(&pairs, &guess).map_or(0.0, |fit| fit.median_parallax_rad);
                taken = linked.filter(|_| parallax >= options.spacing_parallax_rad);
            }
        }
        if let Some(frame) = taken {
            selected.push(frame);
            (last, candidate, linked) = (frame, frame, None);
        }
    }
    selected.reverse();
    selected
}

/// Bearings of the common features of two frames, both ordered by id.
pub(super) fn shared_bearings(
    first: &[TrackedFeature],
    second: &[TrackedFeature],
) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let mut shared = Vec::new();
    let mut rest = second.iter().peekable();
    for feature in first {
        while rest.next_if(|other| other.id < feature.id).is_some() {}
        if let Some(other) = rest.next_if(|other| other.id == feature.id)
            && feature.bearing.norm().is_finite()
            && other.bearing.norm().is_finite()
        {
            shared.push((feature.bearing, other.bearing));
        }
    }
    shared
}
