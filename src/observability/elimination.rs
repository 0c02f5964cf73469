//! Projects nuisance columns out of a Jacobian block by block, by orthogonal transformations of the rows.

use std::ops::Range;

use faer::{MatMut, MatRef};
use nalgebra::DMatrix;

use crate::geometry::dense;

/// A pivot below this fraction of its column's norm marks a dependent column.
///
/// The four unobservable directions of visual-inertial windows leave pivots around 1e-15; weakly observable
/// directions stay above 1e-9.
const DEPENDENT: f64 = 1e-11;

/// Rows of a Jacobian from which blocks of columns are projected out in place.
///
/// A block touches only rows with entries in it, which uses the banded structure of a window. Rows that a block
/// consumes are dropped; the remaining rows are zero in the block's columns.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    /// One row of the Jacobian per column, so that a row is contiguous.
    transposed: DMatrix<f64>,
    /// Indices of the remaining rows.
    alive: Vec<usize>,
}

impl Rows {
    pub(super) fn new(jacobian: &DMatrix<f64>) -> Self {
        Self { transposed: jacobian.transpose(), alive: (0..jacobian.nrows()).collect() }
    }

    /// Returns the remaining rows with the rows of another Jacobian below them.
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
        let touches = |row: &usize| self.row(*row)[block.clone()].iter().any(|entry| *entry != 0.0);
        let touched: Vec<usize> = self.alive.iter().copied().filter(touches).collect();
        if touched.is_empty() {
            return;
        }
        let others = self.filled_columns(&touched, block);
        let width: usize = others.iter().map(ExactSizeIterator::len).sum();
        let scale: Vec<f64> =
            column_norms[block.clone()].iter().map(|norm| if *norm > 0.0 { norm.recip() } else { 0.0 }).collect();
        let mut spanning = Vec::with_capacity(touched.len() * block.len());
        let mut rest = Vec::with_capacity(touched.len() * width);
        for row in &touched {
            let entries = self.row(*row);
            spanning.extend(entries[block.clone()].iter().zip(&scale).map(|(entry, scale)| entry * scale));
            for run in &others {
                rest.extend_from_slice(&entries[run.clone()]);
            }
        }
        let rank = dense::split_by_column_space(
            MatRef::from_row_major_slice(&spanning, touched.len(), block.len()),
            MatMut::from_row_major_slice_mut(&mut rest, touched.len(), width),
            DEPENDENT,
        );
        for (index, row) in touched.iter().enumerate().skip(rank) {
            let entries = self.row_mut(*row);
            entries[block.clone()].fill(0.0);
            let mut from = index * width;
            for run in &others {
                entries[run.clone()].copy_from_slice(&rest[from..from + run.len()]);
                from += run.len();
            }
        }
        let dropped = &touched[..rank];
        self.alive.retain(|row| dropped.binary_search(row).is_err());
    }

    /// Runs of columns outside of a block in which the given rows have entries.
    fn filled_columns(&self, rows: &[usize], block: &Range<usize>) -> Vec<Range<usize>> {
        let mut filled = vec![false; self.transposed.nrows()];
        for row in rows {
            for (filled, entry) in filled.iter_mut().zip(self.row(*row)) {
                *filled |= *entry != 0.0;
            }
        }
        filled[block.clone()].fill(false);
        let mut runs: Vec<Range<usize>> = Vec::new();
        for index in (0..filled.len()).filter(|index| filled[*index]) {
            match runs.last_mut() {
                Some(run) if run.end == index => run.end += 1,
                _ => runs.push(index..index + 1),
            }
        }
        runs
    }

    fn row(&self, row: usize) -> &[f64] {
        let width = self.transposed.nrows();
        &self.transposed.as_slice()[row * width..(row + 1) * width]
    }

    fn row_mut(&mut self, row: usize) -> &mut [f64] {
        let width = self.transposed.nrows();
        &mut self.transposed.as_mut_slice()[row * width..(row + 1) * width]
    }

    /// First `count` columns of the remaining rows.
    pub(super) fn leading_columns(&self, count: usize) -> DMatrix<f64> {
        DMatrix::from_fn(self.alive.len(), count, |row, column| self.transposed[(column, self.alive[row])])
    }
}

/// Norms of the columns of two stacked Jacobians with the same columns.
pub(super) fn column_norms(measurements: &DMatrix<f64>, priors: &DMatrix<f64>) -> Vec<f64> {
    (0..measurements.ncols())
        .map(|column| {
            let of_priors = if priors.nrows() == 0 { 0.0 } else { priors.column(column).norm_squared() };
            (measurements.column(column).norm_squared() + of_priors).sqrt()
        })
        .collect()
}
