//! Equations of many poses, each coupled with few others, as over a whole flight.

use nalgebra::{Matrix3, Matrix6, Vector6};
use pulp::{Arch, NullaryFnOnce};
use rayon::prelude::*;

use super::{PoseEquations, ReducedEquations, ReprojectionEquations, damped_inverse, subtract_product, times_inverse};

/// Number of parts of the poses that are processed in parallel; more than processors, because the parts take
/// different times.
const PARTS: usize = 16;

/// Hessian and gradient over poses numbered from 0.
#[derive(Clone, Debug)]
pub(crate) struct SparsePoseEquations<K> {
    /// Rows by pose; `None` for a pose without observations.
    rows: Vec<Option<PoseRow<K>>>,
}

#[derive(Clone, Debug)]
struct PoseRow<K> {
    gradient: Vector6<f64>,
    /// Blocks of the Hessian of this pose and later ones, by distance from this pose; `None` for zero blocks.
    blocks: Vec<Option<(K, Matrix6<f64>)>>,
}

impl<K> PoseRow<K> {
    const ZERO: Self = Self { gradient: Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), blocks: Vec::new() };

    /// Block with the pose at a distance of `behind` from this one.
    fn block_mut(&mut self, behind: usize, column: K) -> &mut Matrix6<f64> {
        if self.blocks.len() <= behind {
            self.blocks.resize_with(behind + 1, || None);
        }
        &mut self.blocks[behind].get_or_insert_with(|| (column, Matrix6::zeros())).1
    }
}

impl<K: Copy + Into<usize>> SparsePoseEquations<K> {
    pub(crate) fn new() -> Self {
        Self { rows: Vec::new() }
    }

    fn row_mut(&mut self, pose: K) -> &mut PoseRow<K> {
        let place = pose.into();
        if self.rows.len() <= place {
            self.rows.resize_with(place + 1, || None);
        }
        self.rows[place].get_or_insert(PoseRow::ZERO)
    }

    /// Gradient of each pose with an observation, by ascending pose.
    pub(crate) fn gradients(&self) -> impl Iterator<Item = (K, &Vector6<f64>)> {
        self.rows.iter().flatten().filter_map(|row| Some((row.blocks.first()?.as_ref()?.0, &row.gradient)))
    }

    /// Nonzero upper blocks of the Hessian, by ascending row, then column.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = (K, K, &Matrix6<f64>)> {
        self.rows.iter().flatten().flat_map(|row| {
            let first = row.blocks.first().and_then(|block| Some(block.as_ref()?.0));
            row.blocks.iter().flatten().filter_map(move |(column, block)| Some((first?, *column, block)))
        })
    }
}

impl<K: Copy + PartialEq + Into<usize>> PoseEquations for SparsePoseEquations<K> {
    type Pose = K;

    fn hessian_mut(&mut self, row: K, column: K) -> &mut Matrix6<f64> {
        self.row_mut(row).block_mut(column.into() - row.into(), column)
    }

    fn gradient_mut(&mut self, pose: K) -> &mut Vector6<f64> {
        &mut self.row_mut(pose).gradient
    }
}

impl<K: Copy + PartialEq + Into<usize> + Send + Sync> ReprojectionEquations<SparsePoseEquations<K>> {
    /// [`Self::eliminate`] in parallel.
    ///
    /// Each part of the poses processes the landmarks in their order: the sums are the same for any number of threads.
    pub(crate) fn eliminate_by_parts(&self, damping: f64) -> ReducedEquations<SparsePoseEquations<K>> {
        let inverses: Vec<Matrix3<f64>> =
            self.landmarks.par_iter().map(|block| damped_inverse(&block.hessian, damping)).collect();
        let mut poses = self.poses.clone();
        let mut reaches = vec![0; poses.rows.len()];
        for landmark in &self.landmarks {
            let couplings = &self.couplings[landmark.couplings.clone()];
            let Some((last, _)) = couplings.last() else { continue };
            for (pose, _) in couplings {
                let place = (*pose).into();
                reaches[place] = (*last).into().saturating_sub(place).max(reaches[place]);
            }
        }
        let len = poses.rows.len().div_ceil(PARTS).max(1);
        poses.rows.par_chunks_mut(len).zip(reaches.par_chunks(len)).enumerate().for_each(|(part, (rows, reaches))| {
            for (row, reach) in rows.iter_mut().zip(reaches) {
                // Reserves once instead of block by block.
                let blocks = &mut row.get_or_insert(PoseRow::ZERO).blocks;
                blocks.reserve_exact((reach + 1).saturating_sub(blocks.len()));
            }
            Arch::new().dispatch(PartOfElimination { equations: self, inverses: &inverses, rows, first: part * len });
        });
        ReducedEquations { poses, inverses }
    }
}

/// Subtraction of all landmarks' contributions from the rows of some poses, compiled for every width of vector
/// registers.
struct PartOfElimination<'a, K: Copy + PartialEq + Into<usize>> {
    equations: &'a ReprojectionEquations<SparsePoseEquations<K>>,
    inverses: &'a [Matrix3<f64>],
    rows: &'a mut [Option<PoseRow<K>>],
    /// Pose of the first row.
    first: usize,
}

impl<K: Copy + PartialEq + Into<usize>> NullaryFnOnce for PartOfElimination<'_, K> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { equations, inverses, rows, first } = self;
        for (landmark, inverse) in equations.landmarks.iter().zip(inverses) {
            let couplings = &equations.couplings[landmark.couplings.clone()];
            for (place, (pose, coupling)) in couplings.iter().enumerate() {
                let pose: usize = (*pose).into();
                let Some(slot) = pose.checked_sub(first).and_then(|place| rows.get_mut(place)) else { continue };
                let row = slot.get_or_insert(PoseRow::ZERO);
                let weighted = times_inverse(coupling, inverse);
                row.gradient -= weighted * landmark.gradient;
                for (column, other) in &couplings[place..] {
                    subtract_product(row.block_mut((*column).into() - pose, *column), &weighted, other);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2x3, Matrix2x6, Vector2};

    use super::*;
    use crate::geometry::SplitMix64;
    use crate::optimization::Reprojection;

    /// Landmarks, each observed by every third pose of a range of 20.
    fn example(poses: usize) -> ReprojectionEquations<SparsePoseEquations<usize>> {
        let mut numbers = SplitMix64::new(7);
        let mut equations = ReprojectionEquations::new(SparsePoseEquations::new(), 4 * poses);
        for landmark in 0..4 * poses {
            let first = landmark % poses;
            let observers: Vec<usize> = (first..poses.min(first + 20)).step_by(3).collect();
            let terms: Vec<(usize, Reprojection)> = observers
                .iter()
                .map(|pose| {
                    let mut random = || numbers.next_unit() - 0.5;
                    let residual = Vector2::from_fn(|_, _| random());
                    let by_observer = Matrix2x6::from_fn(|_, _| random());
                    let by_landmark = Matrix2x3::from_fn(|_, _| random());
                    (*pose, Reprojection { residual, by_anchor: Matrix2x6::zeros(), by_observer, by_landmark })
                })
                .collect();
            equations.add_landmark(None, terms.len(), terms.into_iter());
        }
        equations
    }

    #[test]
    fn elimination_by_parts_gives_the_same_bits() {
        for poses in [1, 5, 40, 131] {
            let equations = example(poses);
            let (whole, parts) = (equations.eliminate(1e-3), equations.eliminate_by_parts(1e-3));
            assert!(whole.poses.gradients().eq(parts.poses.gradients()), "{poses}");
            assert!(whole.poses.blocks().eq(parts.poses.blocks()), "{poses}");
            assert_eq!(whole.poses.gradients().count(), poses);
            assert_eq!(whole.inverses, parts.inverses);
        }
    }
}
