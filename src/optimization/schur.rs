//! Normal equations of reprojection residuals, with elimination of the landmarks by their Schur complement.
//!
//! The equations have six columns per camera pose, independent of the number of joints and parameters that move it: the
//! landmarks are eliminated there, and only the result is converted to the states. A rolling shutter has three poses
//! per image ([`BlockTerm`]), and the intrinsics of the camera are another block of six.
//!
//! ```text
//! [ H_pp  H_pl ] [ δp ]     [ g_p ]        (H_pp − H_pl H_ll⁻¹ H_lp) δp = −(g_p − H_pl H_ll⁻¹ g_l)
//! [ H_lp  H_ll ] [ δl ] = − [ g_l ]   ⇒    δl = −H_ll⁻¹ (g_l + H_lp δp)
//! ```
//!
//! `H_ll` is block-diagonal, 3 × 3 per landmark.

#![expect(clippy::inline_always, reason = "code that is not inlined is not compiled for the registers of its caller")]

mod sparse;

use std::ops::Range;

use nalgebra::{ArrayStorage, Matrix2x6, Matrix3, Matrix6, Matrix6x3, Vector3, Vector6};
use pulp::{Arch, NullaryFnOnce};

pub(crate) use self::sparse::SparsePoseEquations;
use super::{BlockTerm, PoseBlocks, Reprojection};

/// Hessian and gradient over camera poses; only the blocks `(row, column)` with `row ≤ column` of the Hessian.
pub(crate) trait PoseEquations: Clone {
    /// Identifier of a camera pose.
    type Pose: Copy + PartialEq;

    /// Block of the Hessian, `row ≤ column`.
    fn hessian_mut(&mut self, row: Self::Pose, column: Self::Pose) -> &mut Matrix6<f64>;

    fn gradient_mut(&mut self, pose: Self::Pose) -> &mut Vector6<f64>;
}

/// Equations that couple (nearly) every pair of poses, as in a window; poses are numbered from 0.
#[derive(Clone, Debug)]
pub(crate) struct DensePoseEquations {
    /// Upper blocks of the Hessian.
    pub(crate) hessian: PoseBlocks,
    pub(crate) gradient: Vec<Vector6<f64>>,
}

impl DensePoseEquations {
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

/// Contribution of one landmark to the normal equations.
#[derive(Clone, Debug)]
struct LandmarkBlock {
    hessian: Matrix3<f64>,
    gradient: Vector3<f64>,
    /// Range of its blocks of `H_pl` in the list of all landmarks.
    couplings: Range<usize>,
}

/// Key and block (6 × 3) of `H_pl`.
type Coupling<K> = (K, Matrix6x3<f64>);

/// Normal equations of whitened reprojection residuals over camera poses and landmarks.
#[derive(Clone, Debug)]
pub(crate) struct ReprojectionEquations<P: PoseEquations> {
    poses: P,
    landmarks: Vec<LandmarkBlock>,
    /// Blocks of `H_pl`, landmark by landmark, by ascending pose.
    couplings: Vec<Coupling<P::Pose>>,
}

/// Equations of the camera poses after elimination of the landmarks.
#[derive(Clone, Debug)]
pub(crate) struct ReducedEquations<P> {
    /// Hessian and gradient of the poses, reduced by the landmarks: `H_pp − H_pl H_ll⁻¹ H_lp`, `g_p − H_pl H_ll⁻¹ g_l`.
    pub(crate) poses: P,
    /// Inverse of each landmark's damped block, for the substitution.
    inverses: Vec<Matrix3<f64>>,
}

impl<P: PoseEquations> ReprojectionEquations<P> {
    /// Equations over these poses, without residuals.
    pub(crate) fn new(poses: P, landmarks: usize) -> Self {
        Self { poses, landmarks: Vec::with_capacity(landmarks), couplings: Vec::new() }
    }

    /// Adds one landmark by the whitened terms of its observations, by ascending pose.
    ///
    /// The anchor, if it is among the poses, comes first; its own term constrains only the landmark.
    pub(crate) fn add_landmark(
        &mut self,
        anchor: Option<P::Pose>,
        observations: usize,
        terms: impl Iterator<Item = (P::Pose, Reprojection)>,
    ) {
        let terms = terms.map(|(pose, term)| BlockTerm::of_poses(anchor, pose, &term));
        self.add_landmark_by_blocks(anchor.map(|anchor| [anchor]), None, observations, terms);
    }

    /// [`Self::add_landmark`] for terms with several blocks: the anchor's in ascending order, then the observers' in
    /// ascending order, then the shared one.
    pub(crate) fn add_landmark_by_blocks<const N: usize>(
        &mut self,
        anchor: Option<[P::Pose; N]>,
        shared: Option<P::Pose>,
        observations: usize,
        terms: impl Iterator<Item = BlockTerm<P::Pose, N>>,
    ) {
        let first = self.couplings.len();
        let mut block =
            LandmarkBlock { hessian: Matrix3::zeros(), gradient: Vector3::zeros(), couplings: first..first };
        self.couplings.reserve(N + observations + 1);
        self.couplings.extend(anchor.iter().flatten().map(|pose| (*pose, Matrix6x3::zeros())));
        // Nearly every term contributes to the anchor's blocks and the shared one: these are summed here first.
        let mut of_anchor = [CommonBlock::<N>::ZERO; N];
        let mut of_shared = CommonBlock::<N>::ZERO;
        for term in terms {
            block.hessian += term.by_landmark.tr_mul(&term.by_landmark);
            block.gradient += term.by_landmark.tr_mul(&term.residual);
            let observers = term.observer.as_ref().map_or(&[][..], |blocks| blocks);
            for (place, (pose, by_pose)) in observers.iter().enumerate() {
                for (other, by_other) in &observers[place..] {
                    add_product(self.poses.hessian_mut(*pose, *other), by_pose, by_other);
                }
                *self.poses.gradient_mut(*pose) += by_pose.tr_mul(&term.residual);
                self.couplings.push((*pose, by_pose.tr_mul(&term.by_landmark)));
                for (anchor, by_anchor) in term.anchor.iter().flatten() {
                    add_product(self.poses.hessian_mut(*anchor, *pose), by_anchor, by_pose);
                }
                if let Some((shared, by_shared)) = &term.shared {
                    add_product(self.poses.hessian_mut(*pose, *shared), by_pose, by_shared);
                }
            }
            let anchors = term.anchor.as_ref().map_or(&[][..], |blocks| blocks);
            for (row, (sum, (_, left))) in of_anchor.iter_mut().zip(anchors).enumerate() {
                sum.add(&term, left);
                for (column, (_, right)) in anchors.iter().enumerate().skip(row) {
                    add_product(&mut sum.with_anchor[column], left, right);
                }
                if let Some((_, right)) = &term.shared {
                    add_product(&mut sum.with_shared, left, right);
                }
            }
            if let Some((_, by_shared)) = &term.shared {
                of_shared.add(&term, by_shared);
                add_product(&mut of_shared.with_shared, by_shared, by_shared);
            }
        }
        for (row, (first, sum)) in anchor.iter().flatten().zip(&of_anchor).enumerate() {
            *self.poses.gradient_mut(*first) += sum.gradient;
            self.couplings[block.couplings.start + row].1 = sum.coupling;
            for (second, hessian) in anchor.iter().flatten().zip(&sum.with_anchor).skip(row) {
                *self.poses.hessian_mut(*first, *second) += hessian;
            }
            if let Some(shared) = shared {
                *self.poses.hessian_mut(*first, shared) += sum.with_shared;
            }
        }
        if let Some(shared) = shared {
            *self.poses.gradient_mut(shared) += of_shared.gradient;
            *self.poses.hessian_mut(shared, shared) += of_shared.with_shared;
            self.couplings.push((shared, of_shared.coupling));
        }
        block.couplings.end = self.couplings.len();
        self.landmarks.push(block);
    }

    /// Eliminates the landmarks, after multiplication of the diagonals of their blocks by `1 + damping`.
    pub(crate) fn eliminate(&self, damping: f64) -> ReducedEquations<P> {
        let mut reduced =
            ReducedEquations { poses: self.poses.clone(), inverses: Vec::with_capacity(self.landmarks.len()) };
        let mut weighted: Vec<Matrix6x3<f64>> = Vec::new();
        let architecture = Arch::new();
        for block in &self.landmarks {
            let inverse = damped_inverse(&block.hessian, damping);
            architecture.dispatch(Elimination::<P> {
                poses: &mut reduced.poses,
                gradient: &block.gradient,
                couplings: &self.couplings[block.couplings.clone()],
                inverse: &inverse,
                weighted: &mut weighted,
            });
            reduced.inverses.push(inverse);
        }
        reduced
    }

    /// Steps of the landmarks for steps `[φ; δt]` of the camera poses.
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
                for (pose, coupling) in &self.couplings[block.couplings.clone()] {
                    right -= coupling.tr_mul(&pose_step(*pose));
                }
                inverse * right
            })
            .collect()
    }
}

/// Subtraction of one landmark's contribution from the equations of the poses, compiled for every width of vector
/// registers.
struct Elimination<'a, P: PoseEquations> {
    poses: &'a mut P,
    gradient: &'a Vector3<f64>,
    couplings: &'a [Coupling<P::Pose>],
    /// Inverse of the landmark's block.
    inverse: &'a Matrix3<f64>,
    /// Couplings `H_pl` times `inverse` (6 × 3 each).
    weighted: &'a mut Vec<Matrix6x3<f64>>,
}

impl<P: PoseEquations> NullaryFnOnce for Elimination<'_, P> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { poses, gradient, couplings, inverse, weighted } = self;
        weighted.clear();
        weighted.extend(couplings.iter().map(|(_, coupling)| times_inverse(coupling, inverse)));
        for (first, (row, _)) in couplings.iter().enumerate() {
            *poses.gradient_mut(*row) -= weighted[first] * gradient;
            for (column, coupling) in &couplings[first..] {
                subtract_product(poses.hessian_mut(*row, *column), &weighted[first], coupling);
            }
        }
    }
}

/// Sums over the terms of a landmark for a block that most of them have: one of the anchor's, or the shared one.
#[derive(Clone, Copy)]
struct CommonBlock<const N: usize> {
    gradient: Vector6<f64>,
    coupling: Matrix6x3<f64>,
    /// Sums for the blocks of the Hessian between this block and the anchor's blocks, from this block on.
    with_anchor: [Matrix6<f64>; N],
    with_shared: Matrix6<f64>,
}

impl<const N: usize> CommonBlock<N> {
    const ZERO: Self = Self {
        gradient: Vector6::from_array_storage(ArrayStorage([[0.0; 6]; 1])),
        coupling: Matrix6x3::from_array_storage(ArrayStorage([[0.0; 6]; 3])),
        with_anchor: [Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6])); N],
        with_shared: Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6])),
    };

    /// Adds a term to gradient and coupling.
    fn add<K>(&mut self, term: &BlockTerm<K, N>, by_block: &Matrix2x6<f64>) {
        self.gradient += by_block.tr_mul(&term.residual);
        self.coupling += by_block.tr_mul(&term.by_landmark);
    }
}

/// Adds `leftᵀ · right` to `block`, without a temporary matrix.
fn add_product(block: &mut Matrix6<f64>, left: &Matrix2x6<f64>, right: &Matrix2x6<f64>) {
    for (target, [x, y]) in block.data.0.iter_mut().zip(&right.data.0) {
        for (entry, [a, b]) in target.iter_mut().zip(&left.data.0) {
            *entry += a * x + b * y;
        }
    }
}

/// Coupling times the inverse of its landmark's block.
#[inline(always)]
fn times_inverse(coupling: &Matrix6x3<f64>, inverse: &Matrix3<f64>) -> Matrix6x3<f64> {
    let [a, b, c] = &coupling.data.0;
    let mut product = [[0.0; 6]; 3];
    for (column, target) in product.iter_mut().enumerate() {
        let [x, y, z] = inverse.data.0[column];
        for row in 0..6 {
            target[row] = a[row] * x + b[row] * y + c[row] * z;
        }
    }
    Matrix6x3::from_array_storage(ArrayStorage(product))
}

/// Subtracts `left · rightᵀ` from `block` without a temporary matrix; an elimination spends most of its time here.
#[inline(always)]
fn subtract_product(block: &mut Matrix6<f64>, left: &Matrix6x3<f64>, right: &Matrix6x3<f64>) {
    let [a, b, c] = &left.data.0;
    let [x, y, z] = &right.data.0;
    for (column, target) in block.data.0.iter_mut().enumerate() {
        for row in 0..6 {
            target[row] -= a[row] * x[column] + b[row] * y[column] + c[row] * z[column];
        }
    }
}

/// Inverse of a landmark's damped block; directions without information get no step.
fn damped_inverse(hessian: &Matrix3<f64>, damping: f64) -> Matrix3<f64> {
    let mut damped = *hessian;
    let floor = 1e-9 * hessian.trace().max(1e-6);
    for axis in 0..3 {
        damped[(axis, axis)] += damping * hessian[(axis, axis)] + floor;
    }
    damped.cholesky().map_or_else(Matrix3::zeros, |factor| factor.inverse())
}
