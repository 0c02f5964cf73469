//! Dense algebra on the window: nalgebra keeps the matrices, faer factors them.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::qr::no_pivoting::factor::{qr_in_place, qr_in_place_scratch, recommended_block_size};
use faer::linalg::solvers::Solve as _;
use faer::{Mat, MatMut, MatRef, Par, Side};
use nalgebra::{DMatrix, DVector};

use crate::geometry::dense::as_faer;

/// A lower Cholesky factor.
#[derive(Clone, Debug)]
pub(super) struct Cholesky(faer::linalg::solvers::Llt<f64>);

impl Cholesky {
    /// Factors a symmetric matrix of which the lower triangle is read; `None` when it is not positive definite.
    pub(super) fn new(matrix: &DMatrix<f64>) -> Option<Self> {
        let view = MatRef::from_column_major_slice(matrix.as_slice(), matrix.nrows(), matrix.ncols());
        view.llt(Side::Lower).ok().map(Self)
    }

    /// Solves `A x = b`.
    pub(super) fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let mut solution = right.clone();
        let rows = solution.len();
        self.0.solve_in_place(MatMut::from_column_major_slice_mut(solution.as_mut_slice(), rows, 1));
        solution
    }

    /// Covariance of the last `count` unknowns: `(L₂₂ L₂₂ᵀ)⁻¹`, the others marginalized.
    pub(super) fn trailing_covariance(&self, count: usize) -> DMatrix<f64> {
        let lower = self.0.L();
        let first = lower.nrows() - count;
        let corner =
            DMatrix::from_fn(
                count,
                count,
                |row, column| {
                    if row >= column { lower[(first + row, first + column)] } else { 0.0 }
                },
            );
        let inverse = corner
            .solve_lower_triangular(&DMatrix::identity(count, count))
            .unwrap_or_else(|| DMatrix::from_element(count, count, f64::NAN));
        inverse.tr_mul(&inverse)
    }
}

/// The upper echelon factor `R` of `matrix = Q R` (Householder), at most as many rows as columns; `matrixᵀ matrix = Rᵀ R`.
///
/// Dependent columns leave explicit zeros, so that a row's first non-zero entry tells which column it belongs to.
pub(super) fn triangularize(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    triangularized(as_faer(matrix))
}

/// [`triangularize`] of rows of so many entries, one after another.
pub(super) fn triangularize_rows(entries: &[f64], columns: usize) -> DMatrix<f64> {
    triangularized(MatRef::from_row_major_slice(entries, entries.len() / columns.max(1), columns))
}

fn triangularized(view: MatRef<'_, f64>) -> DMatrix<f64> {
    let (rows, columns) = view.shape();
    if rows == 0 || columns == 0 {
        return DMatrix::zeros(0, columns);
    }
    let mut factors = view.to_owned();
    let height = rows.min(columns);
    let block = recommended_block_size::<f64>(rows, columns);
    let mut coefficients = Mat::zeros(block, height);
    let scratch = qr_in_place_scratch::<f64>(rows, columns, block, Par::Seq, Default::default());
    let mut memory = MemBuffer::new(scratch);
    let stack = MemStack::new(&mut memory);
    qr_in_place(factors.as_mut(), coefficients.as_mut(), Par::Seq, stack, Default::default());
    DMatrix::from_fn(height, columns, |row, column| if row <= column { factors[(row, column)] } else { 0.0 })
}
