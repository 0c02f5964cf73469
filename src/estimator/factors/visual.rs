//! All reprojection factors of a window, linearized by camera poses, with the landmarks eliminated.
//!
//! Six columns per frame hold whatever the camera sees, however many joints and parameters move it: the Schur
//! complement of the landmarks is formed there and only its result is carried on to the states.

use nalgebra::{Matrix2x3, Matrix2x6, Matrix3, Matrix6, Matrix6x3, Vector2, Vector3, Vector6};

use super::pose_blocks::PoseBlocks;
use super::reprojection::{self, CameraPose, Landmark, RelativePose, Reprojection};
use crate::camera::CameraModel;
use crate::estimator::options::{EstimatorOptions, LandmarkModel, RobustLoss};

/// Squared whitened residual that an observation counts for when its landmark cannot be projected.
const UNSEEN_SQUARED: f64 = 1e4;

/// One measurement of a feature: the slot of the frame and the pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sighting {
    /// Slot of the frame in the window.
    pub(crate) slot: usize,
    /// Measured pixel.
    pub(crate) uv_px: Vector2<f64>,
}

/// The observations of one feature that takes part, its anchor's first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Track {
    /// In the order of the slots.
    pub(crate) sightings: Vec<Sighting>,
}

/// How pixels are weighed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VisualModel<'a> {
    pub(crate) camera: &'a CameraModel,
    pub(crate) sigma_px: f64,
    pub(crate) loss: RobustLoss,
    pub(crate) landmark_model: LandmarkModel,
}

impl<'a> VisualModel<'a> {
    pub(crate) fn new(camera: &'a CameraModel, options: &EstimatorOptions) -> Self {
        Self { camera, sigma_px: options.pixel_sigma_px, loss: options.loss, landmark_model: options.landmark_model }
    }

    /// Whether the anchor's own measurement is a residual.
    fn measures_in_anchor(&self) -> bool {
        self.landmark_model == LandmarkModel::BearingAndInverseDistance
    }
}

/// Relative poses of every pair of frames, `[anchor][observer]`.
#[derive(Clone, Debug)]
pub(crate) struct RelativePoses {
    frames: usize,
    pairs: Vec<RelativePose>,
}

impl RelativePoses {
    pub(crate) fn new(cameras: &[CameraPose]) -> Self {
        let pairs = cameras
            .iter()
            .flat_map(|anchor| cameras.iter().map(move |observer| RelativePose::new(anchor, observer)))
            .collect();
        Self { frames: cameras.len(), pairs }
    }

    pub(crate) fn get(&self, anchor: usize, observer: usize) -> &RelativePose {
        &self.pairs[anchor * self.frames + observer]
    }
}

/// Pixel residual of one sighting, `None` when the landmark cannot be seen there.
pub(crate) fn sighting_residual_px(
    model: &VisualModel<'_>,
    relative: &RelativePoses,
    anchor: usize,
    landmark: &Landmark,
    sighting: &Sighting,
) -> Option<Vector2<f64>> {
    reprojection::residual_px(model.camera, relative.get(anchor, sighting.slot), landmark, &sighting.uv_px)
}

/// Robust cost (half the sum of losses) of all reprojection factors.
pub(crate) fn cost(model: &VisualModel<'_>, cameras: &[CameraPose], tracks: &[Track], landmarks: &[Landmark]) -> f64 {
    let relative = RelativePoses::new(cameras);
    let mut total = 0.0;
    for (track, landmark) in tracks.iter().zip(landmarks) {
        let Some(anchor) = track.sightings.first().map(|first| first.slot) else { continue };
        for sighting in &track.sightings {
            if sighting.slot == anchor && !model.measures_in_anchor() {
                continue;
            }
            let squared = sighting_residual_px(model, &relative, anchor, landmark, sighting)
                .map_or(UNSEEN_SQUARED, |residual| residual.norm_squared() / (model.sigma_px * model.sigma_px));
            total += 0.5 * model.loss.cost_and_weight(squared).0;
        }
    }
    total
}

/// One landmark's part of the normal equations.
#[derive(Clone, Debug)]
struct LandmarkBlock {
    hessian: Matrix3<f64>,
    gradient: Vector3<f64>,
    /// By slot: coupling of the camera pose with the landmark.
    couplings: Vec<(usize, Matrix6x3<f64>)>,
}

/// Normal equations of the reprojection factors: camera poses on one side, landmarks on the other.
#[derive(Clone, Debug)]
pub(crate) struct VisualSystem {
    hessian: PoseBlocks,
    gradient: Vec<Vector6<f64>>,
    landmarks: Vec<LandmarkBlock>,
}

/// The camera side after the landmarks were eliminated.
#[derive(Clone, Debug)]
pub(crate) struct ReducedVisualSystem {
    hessian: PoseBlocks,
    gradient: Vec<Vector6<f64>>,
    /// For the way back: inverse of each damped landmark block.
    inverses: Vec<Matrix3<f64>>,
}

impl VisualSystem {
    /// Linearizes at `current`, with the derivatives by poses taken at `linearized`.
    pub(crate) fn new(
        model: &VisualModel<'_>,
        current: &[CameraPose],
        linearized: &[CameraPose],
        tracks: &[Track],
        landmarks: &[Landmark],
    ) -> Self {
        let frames = current.len();
        let relative = RelativePoses::new(current);
        let relative_linearized = RelativePoses::new(linearized);
        let mut system = Self {
            hessian: PoseBlocks::new(frames),
            gradient: vec![Vector6::zeros(); frames],
            landmarks: Vec::with_capacity(tracks.len()),
        };
        for (track, landmark) in tracks.iter().zip(landmarks) {
            let block = system.add_track(model, &relative, &relative_linearized, track, landmark);
            system.landmarks.push(block);
        }
        system
    }

    fn add_track(
        &mut self,
        model: &VisualModel<'_>,
        relative: &RelativePoses,
        linearized: &RelativePoses,
        track: &Track,
        landmark: &Landmark,
    ) -> LandmarkBlock {
        let mut block = LandmarkBlock { hessian: Matrix3::zeros(), gradient: Vector3::zeros(), couplings: Vec::new() };
        let Some(anchor) = track.sightings.first().map(|first| first.slot) else { return block };
        block.couplings.reserve_exact(track.sightings.len());
        let mut anchor_hessian = Matrix6::zeros();
        let mut anchor_gradient = Vector6::zeros();
        let mut anchor_coupling = Matrix6x3::zeros();
        for sighting in &track.sightings {
            let Some(term) = whitened(model, relative, linearized, anchor, landmark, sighting, None) else { continue };
            block.hessian += term.by_landmark.tr_mul(&term.by_landmark);
            block.gradient += term.by_landmark.tr_mul(&term.residual_px);
            if sighting.slot == anchor {
                continue;
            }
            *self.hessian.block_mut(sighting.slot, sighting.slot) += term.by_observer.tr_mul(&term.by_observer);
            self.gradient[sighting.slot] += term.by_observer.tr_mul(&term.residual_px);
            block.couplings.push((sighting.slot, term.by_observer.tr_mul(&term.by_landmark)));
            anchor_hessian += term.by_anchor.tr_mul(&term.by_anchor);
            anchor_gradient += term.by_anchor.tr_mul(&term.residual_px);
            anchor_coupling += term.by_anchor.tr_mul(&term.by_landmark);
            // Sightings come in the order of the slots and the anchor is the first of them.
            *self.hessian.block_mut(anchor, sighting.slot) += term.by_anchor.tr_mul(&term.by_observer);
        }
        *self.hessian.block_mut(anchor, anchor) += anchor_hessian;
        self.gradient[anchor] += anchor_gradient;
        block.couplings.insert(0, (anchor, anchor_coupling));
        block
    }

    /// Eliminates the landmarks, their diagonal raised by the factor `1 + damping`.
    pub(crate) fn eliminate(&self, damping: f64) -> ReducedVisualSystem {
        let mut reduced = ReducedVisualSystem {
            hessian: self.hessian.clone(),
            gradient: self.gradient.clone(),
            inverses: Vec::with_capacity(self.landmarks.len()),
        };
        let mut weighted: Vec<Matrix6x3<f64>> = Vec::new();
        for block in &self.landmarks {
            let inverse = damped_inverse(&block.hessian, damping);
            weighted.clear();
            weighted.extend(block.couplings.iter().map(|(_, coupling)| coupling * inverse));
            for (first, (row, _)) in block.couplings.iter().enumerate() {
                reduced.gradient[*row] -= weighted[first] * block.gradient;
                for (column, coupling) in &block.couplings[first..] {
                    subtract_product(reduced.hessian.block_mut(*row, *column), &weighted[first], coupling);
                }
            }
            reduced.inverses.push(inverse);
        }
        reduced
    }

    /// Steps of the landmarks that belong to steps of the camera poses.
    pub(crate) fn substitute(&self, reduced: &ReducedVisualSystem, camera_steps: &[Vector6<f64>]) -> Vec<Vector3<f64>> {
        self.landmarks
            .iter()
            .zip(&reduced.inverses)
            .map(|(block, inverse)| {
                let mut right = -block.gradient;
                for (slot, coupling) in &block.couplings {
                    right -= coupling.tr_mul(&camera_steps[*slot]);
                }
                inverse * right
            })
            .collect()
    }
}

/// Takes `left · rightᵀ` off `block`, without a matrix in between: most of an elimination's time goes here.
fn subtract_product(block: &mut Matrix6<f64>, left: &Matrix6x3<f64>, right: &Matrix6x3<f64>) {
    let [a, b, c] = &left.data.0;
    let [x, y, z] = &right.data.0;
    for (column, target) in block.data.0.iter_mut().enumerate() {
        for row in 0..6 {
            target[row] -= a[row] * x[column] + b[row] * y[column] + c[row] * z[column];
        }
    }
}

/// The inverse of a landmark's block with its diagonal raised; directions without information get no step.
pub(crate) fn damped_inverse(hessian: &Matrix3<f64>, damping: f64) -> Matrix3<f64> {
    let mut damped = *hessian;
    let floor = 1e-9 * hessian.trace().max(1e-6);
    for axis in 0..3 {
        damped[(axis, axis)] += damping * hessian[(axis, axis)] + floor;
    }
    damped.cholesky().map_or_else(Matrix3::zeros, |factor| factor.inverse())
}

impl ReducedVisualSystem {
    /// The block of two camera poses, `row ≤ column`.
    pub(crate) fn block(&self, row: usize, column: usize) -> &Matrix6<f64> {
        self.hessian.block(row, column)
    }

    /// The gradient by one camera pose.
    pub(crate) fn gradient(&self, slot: usize) -> &Vector6<f64> {
        &self.gradient[slot]
    }
}

/// One sighting linearized, divided by sigma and times the root of its robust weight: the one of its residual, unless it is
/// known.
pub(crate) fn whitened(
    model: &VisualModel<'_>,
    relative: &RelativePoses,
    linearized: &RelativePoses,
    anchor: usize,
    landmark: &Landmark,
    sighting: &Sighting,
    known_weight: Option<f64>,
) -> Option<Reprojection> {
    let term = if sighting.slot == anchor {
        if !model.measures_in_anchor() {
            return None;
        }
        reprojection::linearize_in_anchor(model.camera, landmark, &sighting.uv_px)?
    } else {
        reprojection::linearize(
            model.camera,
            relative.get(anchor, sighting.slot),
            linearized.get(anchor, sighting.slot),
            landmark,
            &sighting.uv_px,
        )?
    };
    let squared = term.residual_px.norm_squared() / (model.sigma_px * model.sigma_px);
    let weight = known_weight.unwrap_or_else(|| model.loss.cost_and_weight(squared).1);
    let scale = weight.sqrt() / model.sigma_px;
    let mut by_landmark: Matrix2x3<f64> = term.by_landmark * scale;
    if !model.measures_in_anchor() {
        by_landmark.fixed_view_mut::<2, 2>(0, 0).fill(0.0);
    }
    let by_anchor: Matrix2x6<f64> = term.by_anchor * scale;
    let by_observer: Matrix2x6<f64> = term.by_observer * scale;
    Some(Reprojection { residual_px: term.residual_px * scale, by_anchor, by_observer, by_landmark })
}
