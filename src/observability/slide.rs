//! Moves the chain along a direction and predicts the reprojections of a step.

use nalgebra::{DVector, Dyn, Vector2, Vector3};

use super::RankReport;
use crate::camera::CameraModel;
use crate::estimator::{FeatureReport, FrameStateReport, StepReport};
use crate::frontend::FeatureId;
use crate::geometry::{Dimension, RigidTransform, so3};
use crate::gimbal::{Chain, ClassicalChain};
use crate::optimization::{NormalEquations, gauss_newton};

/// Chain moved along a direction, with the predicted effect on camera and images.
#[derive(Clone, Debug, PartialEq)]
pub struct ChainSlide {
    /// Stamp of the step whose chain was moved.
    pub stamp_ns: i64,
    /// Amount in units of 10° and 3 cm along the unit direction.
    pub amount: f64,
    pub chain: ClassicalChain,
    /// Change of `imu_from_camera` at the newest frame, in metres and radians.
    pub camera_moves: (f64, f64),
    /// Change of each parameter of the chain in its SI unit, in column order.
    pub changes: Vec<f64>,
    /// Largest change of a reprojection in the window, in pixels.
    pub largest_px: f64,
    /// The same to first order: effect of a small change, scaled up linearly.
    pub largest_first_order_px: f64,
    /// Predicted pixels of the newest frame's features: with the present chain, with the moved chain.
    pub predictions_px: Vec<(FeatureId, [Vector2<f64>; 2])>,
}

/// A change small enough for first-order effects only.
const SMALL: f64 = 1e-4;
/// Iterations of the search for a feature's depth.
const DEPTH_STEPS: usize = 4;
/// Iterations of the joint angles where they are unknown.
const JOINT_STEPS: usize = 4;
/// Smallest inverse depth, in 1/m.
const FARTHEST_PER_M: f64 = 1e-5;

/// Returns the chain of a step's calibration columns; `None` when the parameters differ.
pub fn chain_of_step(report: &StepReport, rank: &RankReport) -> Option<Chain> {
    let chain = Chain::from_classical(&report.calibration.classical, report.calibration.parameterization);
    let has = |chain: &Chain| {
        let mut free = chain.parameters();
        free.retain(|parameter| !rank.fixed_parameters.contains(parameter));
        rank.parameters.starts_with(&free)
    };
    let chain = if has(&chain) { chain } else { chain.without_joint_offsets() };
    has(&chain).then_some(chain)
}

/// Moves the chain of a step along a scaled direction and predicts all features of the window with fixed poses. Each
/// feature takes the depth with the smallest residuals, as in the estimator; joint angles without encoder readings are
/// adapted.
///
/// `None` when no feature can be predicted.
///
/// Along an unobservable direction the pixels do not change, to first order or at any amount, unless the direction
/// includes a change of the poses.
pub fn slide(
    report: &StepReport,
    camera: &CameraModel,
    chain: &Chain,
    weights: &[f64],
    amount: f64,
) -> Option<ChainSlide> {
    let parameters = chain.parameters();
    let weights = weights.get(..parameters.len())?;
    let entries = weights.iter().zip(&parameters).map(|(weight, parameter)| weight * parameter.scale());
    let step = DVector::from_iterator(parameters.len(), entries);
    let all_extrinsics = |chain: &Chain, like: Option<&[RigidTransform]>| -> Vec<RigidTransform> {
        let frames = report.window.iter().enumerate();
        frames.map(|(slot, frame)| extrinsics(frame, chain, like.map(|like| &like[slot]))).collect()
    };
    let extrinsics_before = all_extrinsics(chain, None);
    let poses = |all_extrinsics: &[RigidTransform]| -> Vec<RigidTransform> {
        report.window.iter().zip(all_extrinsics).map(|(frame, extrinsics)| frame.world_from_imu * *extrinsics).collect()
    };
    let window = Window { report, camera, before: poses(&extrinsics_before) };
    let moved = chain.plus(&(&step * amount));
    let extrinsics_after = all_extrinsics(&moved, Some(&extrinsics_before));
    let after = poses(&extrinsics_after);
    let nearby = poses(&all_extrinsics(&chain.plus(&(&step * SMALL)), Some(&extrinsics_before)));
    let newest = report.window.len().checked_sub(1)?;
    let difference = extrinsics_before[newest].inverse() * extrinsics_after[newest];
    let mut slide = ChainSlide {
        stamp_ns: report.stamp_ns,
        amount,
        chain: moved.to_classical(),
        camera_moves: (difference.translation_m.norm(), so3::log(&difference.rotation).norm()),
        changes: (&step * amount).iter().copied().collect(),
        largest_px: 0.0,
        largest_first_order_px: 0.0,
        predictions_px: Vec::new(),
    };
    let mut predicted = false;
    for feature in report.features.iter().filter(|feature| !feature.rejected && feature.id.camera() == 0) {
        let Some(track) = window.track(feature) else { continue };
        let Some(now) = track.pixels(&window.before, track.inverse_depth_per_m, camera) else { continue };
        if let Some(small) = track.fitted(&nearby, &now, camera) {
            slide.largest_first_order_px = slide.largest_first_order_px.max(largest(&now, &small));
        }
        let Some(then) = track.fitted(&after, &now, camera) else { continue };
        predicted = true;
        slide.largest_px = slide.largest_px.max(largest(&now, &then));
        if let Some(place) = track.observers.iter().position(|slot| *slot == newest) {
            slide.predictions_px.push((feature.id, [now[place], then[place]]));
        }
    }
    slide.largest_first_order_px *= amount.abs() / SMALL;
    predicted.then_some(slide)
}

/// `imu_from_camera` at a frame; unknown joint angles are adapted so that it stays as close as possible to `like`.
fn extrinsics(frame: &FrameStateReport, chain: &Chain, like: Option<&RigidTransform>) -> RigidTransform {
    if frame.joint_angles_rad.len() != chain.joint_count() {
        return frame.imu_from_camera;
    }
    let mut angles = frame.joint_angles_rad.clone();
    if let Some(like) = like.filter(|_| frame.encoder_angles_rad.is_none() && !angles.is_empty()) {
        gauss_newton(
            &mut angles,
            JOINT_STEPS,
            |angles| Some(towards(chain, angles, like)),
            |angles, step| {
                angles.iter_mut().zip(step.iter()).for_each(|(angle, change)| *angle += change);
                false
            },
        );
    }
    chain.imu_from_camera(&angles)
}

/// Normal equations of the joint angles that bring `imu_from_camera` closest to `like`; 10° weigh as much as 3 cm.
fn towards(chain: &Chain, angles_rad: &[f64], like: &RigidTransform) -> NormalEquations<Dyn> {
    let linearization = chain.linearize(angles_rad);
    let mut wanted = like.minus(&linearization.imu_from_camera);
    let mut slopes = linearization.by_joints.clone();
    for (start, scale) in [(0, Dimension::Angle.scale()), (3, Dimension::Length.scale())] {
        slopes.fixed_rows_mut::<3>(start).unscale_mut(scale);
        wanted.fixed_rows_mut::<3>(start).unscale_mut(scale);
    }
    let mut equations = NormalEquations::zeros(Dyn(angles_rad.len()));
    equations.add(&-wanted, &slopes, 1.0);
    let floor = 1e-9 * equations.hessian.trace();
    for joint in 0..angles_rad.len() {
        equations.add_diagonal(joint, 0.0, floor);
    }
    equations
}

struct Window<'a> {
    report: &'a StepReport,
    camera: &'a CameraModel,
    before: Vec<RigidTransform>,
}

/// A feature with its bearing and depth in the anchor's camera, and its observing frames.
struct AnchoredFeature {
    anchor: usize,
    /// Point `(x/z, y/z, 1)` on the ray.
    ray: Vector3<f64>,
    inverse_depth_per_m: f64,
    observers: Vec<usize>,
}

impl Window<'_> {
    fn track(&self, feature: &FeatureReport) -> Option<AnchoredFeature> {
        let slot_of = |index: usize| self.report.window.iter().position(|frame| frame.frame_index == index);
        let anchor = slot_of(feature.anchor_frame_index)?;
        let bearing = self.camera.unproject(&feature.observations.iter().next()?.measured_px)?;
        let seen = feature.observations.iter().skip(1);
        let observers: Vec<usize> = seen.filter_map(|seen| slot_of(seen.frame_index)).collect();
        (bearing.z > 0.0 && !observers.is_empty()).then(|| AnchoredFeature {
            anchor,
            ray: bearing / bearing.z,
            inverse_depth_per_m: feature.inverse_depth_per_m.max(FARTHEST_PER_M),
            observers,
        })
    }
}

impl AnchoredFeature {
    /// Predicted pixels, one per observing frame.
    fn pixels(
        &self,
        poses: &[RigidTransform],
        inverse_depth_per_m: f64,
        camera: &CameraModel,
    ) -> Option<Vec<Vector2<f64>>> {
        let point = poses[self.anchor].transform(&(self.ray / inverse_depth_per_m));
        self.observers.iter().map(|slot| camera.project(&poses[*slot].inverse().transform(&point))).collect()
    }

    /// Predicted pixels with the depth that minimizes the distance to `wanted`.
    fn fitted(
        &self,
        poses: &[RigidTransform],
        wanted: &[Vector2<f64>],
        camera: &CameraModel,
    ) -> Option<Vec<Vector2<f64>>> {
        let mut inverse_depth = self.inverse_depth_per_m;
        let mut pixels = self.pixels(poses, inverse_depth, camera)?;
        for _ in 0..DEPTH_STEPS {
            let change = 1e-5 * inverse_depth;
            let shifted = self.pixels(poses, inverse_depth + change, camera)?;
            let (mut slope_squared, mut slope_by_error) = (0.0, 0.0);
            for ((shifted, pixel), wanted) in shifted.iter().zip(&pixels).zip(wanted) {
                let slope = (shifted - pixel) / change;
                slope_squared += slope.norm_squared();
                slope_by_error += slope.dot(&(pixel - wanted));
            }
            if slope_squared <= 0.0 {
                break;
            }
            let better = (inverse_depth - slope_by_error / slope_squared).max(FARTHEST_PER_M);
            let Some(moved) = self.pixels(poses, better, camera) else { break };
            (inverse_depth, pixels) = (better, moved);
        }
        Some(pixels)
    }
}

fn largest(before: &[Vector2<f64>], after: &[Vector2<f64>]) -> f64 {
    before.iter().zip(after).map(|(before, after)| (after - before).norm()).fold(0.0, f64::max)
}
