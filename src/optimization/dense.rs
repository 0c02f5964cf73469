//! Dense algebra on the window.

use nalgebra::DMatrix;

use crate::geometry::triangular_factor::{TriangularFactor, skip_dependent_columns};

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
