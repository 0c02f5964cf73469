//! Projecting nuisance columns out of a Jacobian, block by block, by orthogonal rotations of the rows alone.

use std::ops::Range;

use faer::Mat;
use nalgebra::DMatrix;

use crate::geometry::dense;

/// A pivot below this fraction of its column's norm belongs to a dependent column.
///
/// The four directions that visual-inertial windows never see leave pivots around 1e-15; directions that are merely weak
/// stay above 1e-9.
const DEPENDENT: f64 = 1e-11;

/// Rows of a Jacobian from which blocks of columns are projected out, in place.
///
/// A block only touches the rows in which it has entries, so that the banded structure of a window is made use of.
/// Rows that a block takes up are dropped; what is left of the others has zeros in the block's columns.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    /// One row of the Jacobian per column, so that a row is contiguous.
    transposed: DMatrix<f64>,
    /// The rows still there.
    alive: Vec<usize>,
}

impl Rows {
    pub(super) fn new(jacobian: &DMatrix<f64>) -> Self {
        Self { transposed: jacobian.transpose(), alive: (0..jacobian.nrows()).collect() }
    }

    /// The rows that are left, and those of another Jacobian with the same columns below them.
    pub(super) fn stacked_on(&self, jacobian: &DMatrix<f64>) -> Self {
        let kept = self.alive.len();
        let count = kept + jacobian.nrows();
        let mut transposed = DMatrix::zeros(self.transposed.nrows(), count);
        for (to, from) in self.alive.iter().enumerate() {
            transposed.column_mut(to).copy_from(&self.transposed.column(*from));
        }
        transposed.columns_mut(kept, jacobian.nrows()).copy_from(&jacobian.transpose());
        Self { transposed, alive: (0..count).collect() }
    }

    /// Projects a block of columns out; `column_norms` are those of all columns before any projection.
    pub(super) fn project_out(&mut self, block: &Range<usize>, column_norms: &[f64]) {
        let touches = |row: &usize| {
            let column = self.transposed.column(*row);
            column.as_slice()[block.clone()].iter().any(|entry| *entry != 0.0)
        };
        let touched: Vec<usize> = self.alive.iter().copied().filter(touches).collect();
        if touched.is_empty() {
            return;
        }
        let mut used = vec![false; self.transposed.nrows()];
        for row in &touched {
            for (used, entry) in used.iter_mut().zip(self.transposed.column(*row).iter()) {
                *used |= *entry != 0.0;
            }
        }
        let others: Vec<usize> = (0..used.len()).filter(|index| used[*index] && !block.contains(index)).collect();
        let spanning = Mat::from_fn(touched.len(), block.len(), |row, index| {
            let column = block.start + index;
            let norm = column_norms[column];
            if norm > 0.0 { self.transposed[(column, touched[row])] / norm } else { 0.0 }
        });
        let mut rest =
            Mat::from_fn(touched.len(), others.len(), |row, index| self.transposed[(others[index], touched[row])]);
        let rank = dense::split_by_column_space(spanning.as_ref(), &mut rest, DEPENDENT);
        for (row, target) in touched.iter().enumerate().skip(rank) {
            let mut column = self.transposed.column_mut(*target);
            column.rows_mut(block.start, block.len()).fill(0.0);
            for (index, other) in others.iter().enumerate() {
                column[*other] = rest[(row, index)];
            }
        }
        let dropped = &touched[..rank];
        self.alive.retain(|row| dropped.binary_search(row).is_err());
    }

    /// The first `count` columns of the rows that are left.
    pub(super) fn leading_columns(&self, count: usize) -> DMatrix<f64> {
        DMatrix::from_fn(self.alive.len(), count, |row, column| self.transposed[(column, self.alive[row])])
    }
}

/// Norms of the columns of two Jacobians with the same columns, one above the other.
pub(super) fn column_norms(measurements: &DMatrix<f64>, priors: &DMatrix<f64>) -> Vec<f64> {
    (0..measurements.ncols())
        .map(|column| {
            let of_priors = if priors.nrows() == 0 { 0.0 } else { priors.column(column).norm_squared() };
            (measurements.column(column).norm_squared() + of_priors).sqrt()
        })
        .collect()
}
