//! Dense algebra on the window: nalgebra keeps the matrices, faer factors them.

use std::ops::Range;

use faer::linalg::solvers::Solve as _;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{MatMut, MatRef, Par, Side};
use nalgebra::{DMatrix, DVector};

use crate::geometry::triangular_factor::{TriangularFactor, skip_dependent_columns};

/// A lower Cholesky factor.
#[derive(Clone, Debug)]
pub(crate) struct Cholesky(faer::linalg::solvers::Llt<f64>);

impl Cholesky {
    /// Factors a symmetric matrix of which the lower triangle is read; `None` when it is not positive definite.
    pub(crate) fn new(matrix: &DMatrix<f64>) -> Option<Self> {
        let view = MatRef::from_column_major_slice(matrix.as_slice(), matrix.nrows(), matrix.ncols());
        view.llt(Side::Lower).ok().map(Self)
    }

    /// Solves `A x = b`.
    pub(crate) fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let mut solution = right.clone();
        let rows = solution.len();
        self.0.solve_in_place(MatMut::from_column_major_slice_mut(solution.as_mut_slice(), rows, 1));
        solution
    }

    /// Response of the leading unknowns to the last `count` ones: `−A₁₁⁻¹ A₁₂`.
    pub(crate) fn leading_response(&self, count: usize) -> DMatrix<f64> {
        let lower = self.0.L();
        let first = lower.nrows() - count;
        let mut response = DMatrix::from_fn(first, count, |row, column| -lower[(first + column, row)]);
        solve_upper_triangular_in_place(
            lower.submatrix(0, 0, first, first).transpose(),
            MatMut::from_column_major_slice_mut(response.as_mut_slice(), first, count),
            Par::Seq,
        );
        response
    }

    /// Covariance of some consecutive unknowns: their block of `(L Lᵀ)⁻¹`, the others marginalized.
    pub(crate) fn covariance_of(&self, unknowns: Range<usize>) -> DMatrix<f64> {
        // L is zero above the diagonal, so that the solution begins at the first of these unknowns.
        let (first, count) = (unknowns.start, unknowns.len());
        let rows = self.0.L().nrows() - first;
        let mut inverse = DMatrix::identity(rows, count);
        solve_lower_triangular_in_place(
            self.0.L().submatrix(first, first, rows, rows),
            MatMut::from_column_major_slice_mut(inverse.as_mut_slice(), rows, count),
            Par::Seq,
        );
        inverse.tr_mul(&inverse)
    }

    /// Covariance of the last `count` unknowns: `(L₂₂ L₂₂ᵀ)⁻¹`, the others marginalized.
    pub(crate) fn trailing_covariance(&self, count: usize) -> DMatrix<f64> {
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

/// The upper triangular factor `R` of `matrix = Q R` (Householder): `matrixᵀ matrix = Rᵀ R`.
pub(crate) fn triangularize(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let order: Vec<usize> = (0..matrix.ncols()).collect();
    let mut factor = TriangularFactor::new(matrix.ncols());
    factor.merge_rows(matrix, &order);
    factor.to_matrix()
}

/// A column of a factor depends on those before it when no more than this fraction of it is independent.
const DEPENDENT: f64 = 1e-9;

/// `[A | b]` by orthogonal rows, without those that hold nothing of `A`.
pub(crate) struct Echelon {
    /// The rows `[R | Qᵀb]`, as many as `A` has rank: each begins at a column that those above do not make up.
    pub(crate) rows: DMatrix<f64>,
    /// Number of rows of the leading columns.
    pub(crate) leading_rank: usize,
}

/// Triangularizes `[A | b]` so that a column which depends on those before it takes up no row.
///
/// A plain triangle gives every column a row, also a dependent one. That row then holds, under a pivot of rounding errors,
/// what belongs to later columns, or a share of `b` that nothing in `A` can change. `leading` is the number of columns
/// whose rank is told apart.
pub(crate) fn echelon(matrix: &DMatrix<f64>, leading: usize) -> Echelon {
    let norms: Vec<f64> = matrix.column_iter().map(|column| column.norm()).collect();
    let mut upper = triangularize(matrix);
    let independent = skip_dependent_columns(&mut upper, matrix.ncols() - 1, &norms, DEPENDENT);
    let leading_rank = independent.iter().filter(|column| **column < leading).count();
    Echelon { rows: upper.rows(0, independent.len()).into_owned(), leading_rank }
}
