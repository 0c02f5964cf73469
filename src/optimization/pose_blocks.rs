//! Derivatives of one observation by blocks of six unknowns: camera poses, and a block shared by all observations of a
//! camera.

use nalgebra::{DMatrix, DVector, Matrix2x3, Matrix2x6, Matrix6, Vector2};

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

/// Symmetric matrix over camera poses; its upper 6 × 6 blocks are stored row by row: `(0,0) (0,1) … (1,1) …`.
#[derive(Clone, Debug)]
pub(crate) struct PoseBlocks {
    frames: usize,
    blocks: Vec<Matrix6<f64>>,
}

impl PoseBlocks {
    pub(crate) fn new(frames: usize) -> Self {
        Self { frames, blocks: vec![Matrix6::zeros(); frames * (frames + 1) / 2] }
    }

    fn index(&self, row: usize, column: usize) -> usize {
        debug_assert!(row <= column && column < self.frames, "upper blocks only");
        row * (2 * self.frames + 1 - row) / 2 + column - row
    }

    /// Block of two camera poses, `row ≤ column`.
    pub(crate) fn block(&self, row: usize, column: usize) -> &Matrix6<f64> {
        &self.blocks[self.index(row, column)]
    }

    /// Block of two camera poses in either order.
    pub(crate) fn symmetric_block(&self, row: usize, column: usize) -> Matrix6<f64> {
        if row <= column { *self.block(row, column) } else { self.block(column, row).transpose() }
    }

    /// Mutable reference to [`Self::block`].
    pub(crate) fn block_mut(&mut self, row: usize, column: usize) -> &mut Matrix6<f64> {
        let index = self.index(row, column);
        &mut self.blocks[index]
    }

    /// Adds the `JᵀJ` of one observation.
    pub(crate) fn add<const N: usize>(&mut self, term: &BlockTerm<usize, N>) {
        let mut blocks = term.blocks();
        while let Some((block, by_block)) = blocks.next() {
            *self.block_mut(*block, *block) += by_block.tr_mul(by_block);
            for (other, by_other) in blocks.clone() {
                if block <= other {
                    *self.block_mut(*block, *other) += by_block.tr_mul(by_other);
                } else {
                    *self.block_mut(*other, *block) += by_other.tr_mul(by_block);
                }
            }
        }
    }

    /// Diagonal of `CᵀAC` for columns `C` that move the camera poses, a 6 × n matrix per pose.
    pub(crate) fn squared_norms(&self, columns: &[DMatrix<f64>]) -> DVector<f64> {
        let count = columns.first().map_or(0, DMatrix::ncols);
        let mut norms = DVector::zeros(count);
        for row in 0..self.frames {
            for column in row..self.frames {
                let block = self.block(row, column);
                let factor = if row == column { 1.0 } else { 2.0 };
                for k in 0..count {
                    let right = block * columns[column].fixed_view::<6, 1>(0, k);
                    norms[k] += factor * columns[row].fixed_view::<6, 1>(0, k).dot(&right);
                }
            }
        }
        norms
    }
}
