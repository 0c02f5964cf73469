//! Normal equations of reprojection residuals, the landmarks eliminated by their Schur complement.
//!
//! Six columns per camera pose hold whatever a camera observes, however many joints and parameters move it: the landmarks
//! are eliminated there, and only the result is carried on to the states. A rolling shutter has three poses per image
//! ([`BlockTerm`]), and the intrinsics of the camera are one more block of six.
//!
//! ```text
//! [ H_pp  H_pl ] [ δp ]     [ g_p ]        (H_pp − H_pl H_ll⁻¹ H_lp) δp = −(g_p − H_pl H_ll⁻¹ g_l)
//! [ H_lp  H_ll ] [ δl ] = − [ g_l ]   ⇒    δl = −H_ll⁻¹ (g_l + H_lp δp)
//! ```
//!
//! `H_ll` is block-diagonal, 3 × 3 a landmark.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Matrix6, Matrix6x3, Vector3, Vector6};

use super::{BlockTerm, MAX_POSE_BLOCKS, PoseBlocks, Reprojection};

/// Hessian and gradient over camera poses; of the Hessian the blocks `(row, column)` with `row ≤ column`.
pub(crate) trait PoseEquations: Clone {
    /// Names a camera pose.
    type Pose: Copy + PartialEq;

    /// A block of the Hessian, `row ≤ column`.
    fn hessian_mut(&mut self, row: Self::Pose, column: Self::Pose) -> &mut Matrix6<f64>;

    /// The gradient by one pose.
    fn gradient_mut(&mut self, pose: Self::Pose) -> &mut Vector6<f64>;
}

/// Equations that couple (nearly) every pair of poses, as in a window; poses are numbered.
#[derive(Clone, Debug)]
pub(crate) struct DensePoseEquations {
    /// Upper blocks of the Hessian.
    pub(crate) hessian: PoseBlocks,
    /// By pose.
    pub(crate) gradient: Vec<Vector6<f64>>,
}

impl DensePoseEquations {
    /// Zeros.
    pub(crate) fn new(poses: usize) -> Self {
        Self { hessian: PoseBlocks::new(poses), gradient: vec![Vector6::zeros(); poses] }
    }
}

impl PoseEquations for DensePoseEquations {
    type Pose = usize;

    fn hessian_mut(&mut self, row: usize, column: usize) -> &mut Matrix6<f64> {
        self.hessian.block_mut(row, column)
    }

    fn gradient_mut(&mut self, pose: usize) -> &mut Vector6<f64> {
        &mut self.gradient[pose]
    }
}

/// Equations of many poses of which each is coupled with few others, as over a whole flight.
#[derive(Clone, Debug)]
pub(crate) struct SparsePoseEquations<K> {
    /// Blocks that are not zero, by `(row, column)`.
    pub(crate) hessian: BTreeMap<(K, K), Matrix6<f64>>,
    /// By pose.
    pub(crate) gradient: BTreeMap<K, Vector6<f64>>,
}

impl<K> SparsePoseEquations<K> {
    /// Zeros.
    pub(crate) fn new() -> Self {
        Self { hessian: BTreeMap::new(), gradient: BTreeMap::new() }
    }
}

impl<K: Copy + Ord> PoseEquations for SparsePoseEquations<K> {
    type Pose = K;

    fn hessian_mut(&mut self, row: K, column: K) -> &mut Matrix6<f64> {
        self.hessian.entry((row, column)).or_insert_with(Matrix6::zeros)
    }

    fn gradient_mut(&mut self, pose: K) -> &mut Vector6<f64> {
        self.gradient.entry(pose).or_insert_with(Vector6::zeros)
    }
}

/// One landmark's part of the normal equations.
#[derive(Clone, Debug)]
struct LandmarkBlock<K> {
    hessian: Matrix3<f64>,
    gradient: Vector3<f64>,
    /// Blocks of `H_pl`, poses rising.
    couplings: Vec<(K, Matrix6x3<f64>)>,
}

/// Normal equations of whitened reprojection residuals: camera poses on one side, landmarks on the other.
#[derive(Clone, Debug)]
pub(crate) struct ReprojectionEquations<P: PoseEquations> {
    poses: P,
    landmarks: Vec<LandmarkBlock<P::Pose>>,
}

/// The equations of the camera poses after the landmarks were eliminated.
#[derive(Clone, Debug)]
pub(crate) struct ReducedEquations<P> {
    /// Reduced Hessian and gradient.
    pub(crate) poses: P,
    /// Inverse of each landmark's damped block, for the substitution.
    inverses: Vec<Matrix3<f64>>,
}

impl<P: PoseEquations> ReprojectionEquations<P> {
    /// Equations without a residual, over these poses.
    pub(crate) fn new(poses: P, landmarks: usize) -> Self {
        Self { poses, landmarks: Vec::with_capacity(landmarks) }
    }

    /// Adds one landmark by the whitened terms of its observations, poses rising.
    ///
    /// The anchor, where the landmark has one among the poses, comes before all others; its own term moves the landmark
    /// only.
    pub(crate) fn add_landmark(
        &mut self,
        anchor: Option<P::Pose>,
        observations: usize,
        terms: impl Iterator<Item = (P::Pose, Reprojection)>,
    ) {
        let terms = terms.map(|(pose, term)| BlockTerm::of_poses(anchor, pose, &term));
        self.add_landmark_by_blocks([anchor, None, None], None, observations, terms);
    }

    /// [`Self::add_landmark`] by terms that may have several blocks: those of the anchor rise and come before those of the
    /// observers, which rise as well; the shared one comes after all.
    pub(crate) fn add_landmark_by_blocks(
        &mut self,
        anchor: [Option<P::Pose>; MAX_POSE_BLOCKS],
        shared: Option<P::Pose>,
        observations: usize,
        terms: impl Iterator<Item = BlockTerm<P::Pose>>,
    ) {
        let mut block = LandmarkBlock {
            hessian: Matrix3::zeros(),
            gradient: Vector3::zeros(),
            couplings: Vec::with_capacity(observations + 1),
        };
        // The anchor's blocks and the shared one have a part of nearly every term: summed here first.
        let common = [anchor[0], anchor[1], anchor[2], shared];
        let mut hessians = [[Matrix6::zeros(); MAX_POSE_BLOCKS + 1]; MAX_POSE_BLOCKS + 1];
        let mut gradients = [Vector6::zeros(); MAX_POSE_BLOCKS + 1];
        let mut couplings = [Matrix6x3::zeros(); MAX_POSE_BLOCKS + 1];
        for term in terms {
            block.hessian += term.by_landmark.tr_mul(&term.by_landmark);
            block.gradient += term.by_landmark.tr_mul(&term.residual);
            let of_common = [&term.anchor[0], &term.anchor[1], &term.anchor[2], &term.shared];
            for (place, observed) in term.observer.iter().enumerate() {
                let Some((pose, by_pose)) = observed else { continue };
                for (other, by_other) in term.observer[place..].iter().flatten() {
                    *self.poses.hessian_mut(*pose, *other) += by_pose.tr_mul(by_other);
                }
                *self.poses.gradient_mut(*pose) += by_pose.tr_mul(&term.residual);
                block.couplings.push((*pose, by_pose.tr_mul(&term.by_landmark)));
                for (anchor, by_anchor) in term.anchor.iter().flatten() {
                    *self.poses.hessian_mut(*anchor, *pose) += by_anchor.tr_mul(by_pose);
                }
                if let Some((shared, by_shared)) = &term.shared {
                    *self.poses.hessian_mut(*pose, *shared) += by_pose.tr_mul(by_shared);
                }
            }
            for (row, left) in of_common.iter().enumerate() {
                let Some((_, left)) = left else { continue };
                gradients[row] += left.tr_mul(&term.residual);
                couplings[row] += left.tr_mul(&term.by_landmark);
                for (column, right) in of_common.iter().enumerate().skip(row) {
                    let Some((_, right)) = right else { continue };
                    hessians[row][column] += left.tr_mul(right);
                }
            }
        }
        for (row, first) in common.iter().enumerate() {
            let Some(first) = first else { continue };
            *self.poses.gradient_mut(*first) += gradients[row];
            for (column, second) in common.iter().enumerate().skip(row) {
                let Some(second) = second else { continue };
                *self.poses.hessian_mut(*first, *second) += hessians[row][column];
            }
        }
        let anchors = anchor.iter().enumerate().filter_map(|(row, anchor)| Some(((*anchor)?, couplings[row])));
        block.couplings.splice(0..0, anchors);
        block.couplings.extend(shared.map(|shared| (shared, couplings[MAX_POSE_BLOCKS])));
        self.landmarks.push(block);
    }

    /// Eliminates the landmarks, the diagonals of their blocks raised by the factor `1 + damping`.
    pub(crate) fn eliminate(&self, damping: f64) -> ReducedEquations<P> {
        let mut reduced =
            ReducedEquations { poses: self.poses.clone(), inverses: Vec::with_capacity(self.landmarks.len()) };
        let mut weighted: Vec<Matrix6x3<f64>> = Vec::new();
        for block in &self.landmarks {
            let inverse = damped_inverse(&block.hessian, damping);
            weighted.clear();
            weighted.extend(block.couplings.iter().map(|(_, coupling)| coupling * inverse));
            for (first, (row, _)) in block.couplings.iter().enumerate() {
                *reduced.poses.gradient_mut(*row) -= weighted[first] * block.gradient;
                for (column, coupling) in &block.couplings[first..] {
                    subtract_product(reduced.poses.hessian_mut(*row, *column), &weighted[first], coupling);
                }
            }
            reduced.inverses.push(inverse);
        }
        reduced
    }

    /// Steps of the landmarks that belong to steps `[φ; δt]` of the camera poses.
    pub(crate) fn substitute(
        &self,
        reduced: &ReducedEquations<P>,
        pose_step: impl Fn(P::Pose) -> Vector6<f64>,
    ) -> Vec<Vector3<f64>> {
        self.landmarks
            .iter()
            .zip(&reduced.inverses)
            .map(|(block, inverse)| {
                let mut right = -block.gradient;
                for (pose, coupling) in &block.couplings {
                    right -= coupling.tr_mul(&pose_step(*pose));
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
fn damped_inverse(hessian: &Matrix3<f64>, damping: f64) -> Matrix3<f64> {
    let mut damped = *hessian;
    let floor = 1e-9 * hessian.trace().max(1e-6);
    for axis in 0..3 {
        damped[(axis, axis)] += damping * hessian[(axis, axis)] + floor;
    }
    damped.cholesky().map_or_else(Matrix3::zeros, |factor| factor.inverse())
}
