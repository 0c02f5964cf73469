//! Derivatives of one observation by blocks of six unknowns: camera poses, and a block shared by all observations of a
//! camera.

use nalgebra::{Matrix2x3, Matrix2x6, Vector2};

use super::Reprojection;

/// Residual of one observation with its derivatives by the landmark and by blocks of six unknowns named by `K`.
///
/// `N` blocks per camera pose: a global shutter has one; a rolling shutter has three, the poses of the first, the
/// middle and the last row. The intrinsics of a camera are another block, shared by all its observations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BlockTerm<K, const N: usize> {
    /// Predicted minus measured (2 × 1), whitened.
    pub(crate) residual: Vector2<f64>,
    /// Derivative by the landmark's step in [`super::Landmark::plus`].
    pub(crate) by_landmark: Matrix2x3<f64>,
    /// Derivatives by the blocks of the anchor's camera pose; `None` in the anchor's own observation.
    pub(crate) anchor: Option<PoseBlocksOf<K, N>>,
    /// Derivatives by the blocks of the observing camera pose; `None` in the anchor's own observation.
    pub(crate) observer: Option<PoseBlocksOf<K, N>>,
    /// Derivative by the block shared by all observations, `None` without one.
    pub(crate) shared: Option<(K, Matrix2x6<f64>)>,
}

/// Derivatives by the blocks of one camera pose.
pub(crate) type PoseBlocksOf<K, const N: usize> = [(K, Matrix2x6<f64>); N];

impl<K: Copy + PartialEq> BlockTerm<K, 1> {
    /// Term with one block per camera pose; the anchor's own observation (`anchor` equals `pose`) has none.
    pub(crate) fn of_poses(anchor: Option<K>, pose: K, term: &Reprojection) -> Self {
        let apart = anchor != Some(pose);
        Self {
            residual: term.residual,
            by_landmark: term.by_landmark,
            anchor: anchor.filter(|_| apart).map(|anchor| [(anchor, term.by_anchor)]),
            observer: apart.then_some([(pose, term.by_observer)]),
            shared: None,
        }
    }
}

impl<K, const N: usize> BlockTerm<K, N> {
    /// Blocks with their derivatives.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = &(K, Matrix2x6<f64>)> + Clone {
        self.anchor.iter().flatten().chain(&self.shared).chain(self.observer.iter().flatten())
    }
}
