//! Normal equations of factors over the columns of the layout.

use nalgebra::{DMatrix, DMatrixView, DVector, DVectorView};

use super::factor::{Products, Sink, WhitenedRows};
use super::kind::FactorLabel;
use crate::estimator::state::layout::{POSE, VELOCITY_BIAS};

/// Width of a factor between the navigation states of two frames, the most frequent one.
const TWO_STATES: usize = 2 * (POSE + VELOCITY_BIAS);

/// `JᵀJ` (lower triangle at least) and `Jᵀr`.
#[derive(Clone, Debug)]
pub(crate) struct DenseEquations {
    pub(crate) hessian: DMatrix<f64>,
    pub(crate) gradient: DVector<f64>,
    scratch: Scratch,
}

/// Products of one factor with several blocks.
#[derive(Clone, Debug, Default)]
struct Scratch {
    /// Column of the layout for each column of the blocks.
    columns: Vec<usize>,
    /// One row of all blocks.
    row: Vec<f64>,
    /// `JᵀJ` of the blocks: lower triangle, column by column.
    hessian: Vec<f64>,
    gradient: Vec<f64>,
}

impl DenseEquations {
    pub(crate) fn zeros(columns: usize) -> Self {
        Self {
            hessian: DMatrix::zeros(columns, columns),
            gradient: DVector::zeros(columns),
            scratch: Scratch::default(),
        }
    }

    /// Adds rows with one block of consecutive columns.
    fn add_block(&mut self, rows: &WhitenedRows<'_>, start: usize, entries: &[f64]) {
        let height = rows.residual.len();
        let jacobian = DMatrixView::from_slice(entries, height, entries.len() / height);
        let mut corner = self.hessian.view_mut((start, start), (jacobian.ncols(), jacobian.ncols()));
        corner += jacobian.tr_mul(&jacobian);
        let mut part = self.gradient.rows_mut(start, jacobian.ncols());
        part += jacobian.tr_mul(&DVectorView::from_slice(rows.residual, height));
    }

    /// Adds `JᵀJ` and `Jᵀr` that the caller has already formed.
    fn add_products(&mut self, rows: &WhitenedRows<'_>, products: Products<'_>) {
        let columns = &mut self.scratch.columns;
        columns.clear();
        columns.extend(rows.columns());
        for (local, column) in columns.iter().enumerate() {
            self.gradient[*column] += products.gradient[local];
            let mut target = self.hessian.column_mut(*column);
            for (entry, row) in products.hessian.column(local).iter().zip(&*columns) {
                target[*row] += entry;
            }
        }
    }

    /// Adds rows with several blocks.
    fn add_blocks(&mut self, rows: &WhitenedRows<'_>) {
        let scratch = &mut self.scratch;
        scratch.columns.clear();
        scratch.columns.extend(rows.columns());
        match scratch.columns.len() {
            // A constant width lets the compiler unroll the loops.
            TWO_STATES => scratch.multiply(rows, TWO_STATES),
            width => scratch.multiply(rows, width),
        }
        let width = scratch.columns.len();
        for (local, column) in scratch.columns.iter().enumerate() {
            self.gradient[*column] += scratch.gradient[local];
            for (later, row) in scratch.columns.iter().enumerate().skip(local) {
                self.hessian[(*row.max(column), *row.min(column))] += scratch.hessian[local * width + later];
            }
        }
    }
}

impl Scratch {
    /// Computes the products of the blocks; sums run over the rows in their order.
    #[expect(clippy::inline_always, reason = "the caller passes a constant width where it can")]
    #[inline(always)]
    fn multiply(&mut self, rows: &WhitenedRows<'_>, width: usize) {
        let height = rows.residual.len();
        self.hessian.clear();
        self.hessian.resize(width * width, 0.0);
        self.gradient.clear();
        self.gradient.resize(width, 0.0);
        for (index, residual) in rows.residual.iter().enumerate() {
            self.row.clear();
            for block in rows.blocks {
                self.row.extend(block.entries[index..].iter().step_by(height));
            }
            let row = &self.row[..width];
            for (column, sums) in self.hessian.chunks_exact_mut(width).enumerate() {
                let factor = row[column];
                for (sum, entry) in sums[column..].iter_mut().zip(&row[column..]) {
                    *sum += entry * factor;
                }
            }
            for (sum, entry) in self.gradient.iter_mut().zip(row) {
                *sum += entry * residual;
            }
        }
    }
}

impl Sink for DenseEquations {
    const DERIVATIVES: bool = true;

    fn add(&mut self, _label: FactorLabel, rows: &WhitenedRows<'_>) {
        match (rows.products, rows.blocks) {
            (Some(products), _) => self.add_products(rows, products),
            (None, [block]) => self.add_block(rows, block.start, block.entries),
            (None, _) => self.add_blocks(rows),
        }
    }
}
