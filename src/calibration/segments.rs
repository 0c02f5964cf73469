//! Measured poses of the gimbal camera: short reconstructions from its images alone, each with a separate frame
//! and unit of length.

use nalgebra::UnitQuaternion;

use super::bundle::gimbal_view;
use super::frame_sets::FrameSet;
use super::observations::tracked;
use super::state::{BundleEstimate, Camera};
use super::{CalibrationInput, CalibrationOptions};
use crate::estimator::gravity_in_world;
use crate::estimator::initialization::{InitializationOptions, ReconstructionGuess, reconstruct_views};
use crate::frontend::TrackedFeature;
use crate::geometry::RigidTransform;

/// Number of common features of neighbouring views below which a segment ends.
const MIN_COMMON: usize = 25;
/// Smallest number of views of a segment; its frame and unit alone have seven unknowns.
const MIN_VIEWS: usize = 6;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Segment {
    /// Frame sets of the views, ascending.
    pub(super) frame_sets: Vec<usize>,
    /// `segment_from_camera` of each view, translations in the segment's unit.
    pub(super) poses: Vec<RigidTransform>,
}

/// Number of gimbal camera views by use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct SegmentCounts {
    /// Frame sets with an image of the gimbal camera and encoder readings.
    pub(super) offered: usize,
    /// Offered views in runs too short to reconstruct.
    pub(super) broken: usize,
    /// Offered views in failed reconstructions, mostly for lack of parallax.
    pub(super) unsolved: usize,
}

/// Reconstructs the gimbal camera's poses over the whole flight, segment by segment.
pub(super) fn reconstruct(
    input: &CalibrationInput,
    options: &CalibrationOptions,
    frame_sets: &[FrameSet],
    estimate: &BundleEstimate,
) -> (Vec<Segment>, SegmentCounts) {
    let gravity = gravity_in_world(input.gravity_m_per_s2);
    let gimbal = &input.gimbal_camera;
    // Standard deviation of the predicted rotations between views: two readings per joint, and the part of the
    // chain's error that rotates with the joints.
    let joints = gimbal.chain.joint_count() as f64;
    let chain_rad = gimbal.prior.sigmas().1;
    let sigma_rad =
        (encoder_sigma_rad(frame_sets) * (2.0 * joints).sqrt()).hypot(chain_rad * (joints + 2.0).sqrt()).max(0.02);
    let limits = InitializationOptions { min_views: MIN_VIEWS, ..InitializationOptions::default() };
    let mut counts = SegmentCounts::default();
    let mut segments = Vec::new();
    for stretch in stretches(input, options, frame_sets, &mut counts) {
        let views: Vec<&[TrackedFeature]> = stretch
            .iter()
            .filter_map(|&index| tracked(input, &frame_sets[index], Camera::Gimbal))
            .map(|frame| frame.features.as_slice())
            .collect();
        let rotations: Vec<UnitQuaternion<f64>> = stretch
            .iter()
            .map(|&index| {
                let vehicle = estimate.world_from_imu(gimbal_view(index), frame_sets, &gravity);
                vehicle.rotation * estimate.chain.imu_from_camera(&estimate.joints_rad[index]).rotation
            })
            .collect();
        let guess = ReconstructionGuess { rotations: &rotations, sigma_rad, seed: stretch[0] as u64 };
        match reconstruct_views(&views, &guess, &limits) {
            Some(reconstruction) => {
                counts.unsolved += stretch.len() - reconstruction.views.len();
                segments.push(Segment {
                    frame_sets: reconstruction.views.iter().map(|view| stretch[*view]).collect(),
                    poses: reconstruction.poses,
                });
            }
            None => counts.unsolved += stretch.len(),
        }
    }
    (segments, counts)
}

/// Root mean square of the standard deviations of all readings.
pub(super) fn encoder_sigma_rad(frame_sets: &[FrameSet]) -> f64 {
    let sigmas =
        frame_sets.iter().filter_map(|frame_set| frame_set.gimbal.as_ref()).flat_map(|g| &g.encoder.sigmas_rad);
    let (sum, count) = sigmas.fold((0.0, 0_usize), |(sum, count), sigma| (sum + sigma * sigma, count + 1));
    (sum / count.max(1) as f64).sqrt()
}

/// Runs of neighbouring frame sets whose gimbal images have common features, cut to the largest length of the
/// options.
fn stretches(
    input: &CalibrationInput,
    options: &CalibrationOptions,
    frame_sets: &[FrameSet],
    counts: &mut SegmentCounts,
) -> Vec<Vec<usize>> {
    let mut stretches: Vec<Vec<usize>> = vec![Vec::new()];
    for index in 0..frame_sets.len() {
        let Some(frame) = tracked(input, &frame_sets[index], Camera::Gimbal) else {
            stretches.push(Vec::new());
            continue;
        };
        counts.offered += 1;
        let Some(last) = stretches.last_mut() else { continue };
        let linked = last.last().is_none_or(|before| {
            tracked(input, &frame_sets[*before], Camera::Gimbal)
                .is_some_and(|other| common(&other.features, &frame.features) >= MIN_COMMON)
        });
        if linked && last.len() < options.segment_views {
            last.push(index);
        } else {
            stretches.push(vec![index]);
        }
    }
    let (long, short): (Vec<_>, Vec<_>) = stretches.into_iter().partition(|stretch| stretch.len() >= MIN_VIEWS);
    counts.broken += short.iter().map(Vec::len).sum::<usize>();
    long
}

/// Number of common features of two images, both ordered by id.
fn common(first: &[TrackedFeature], second: &[TrackedFeature]) -> usize {
    let mut rest = second.iter().peekable();
    first
        .iter()
        .filter(|feature| {
            while rest.next_if(|other| other.id < feature.id).is_some() {}
            rest.next_if(|other| other.id == feature.id).is_some()
        })
        .count()
}
