//! Dense linear algebra of the window.

use nalgebra::DMatrix;

use crate::geometry::triangular_factor::{TriangularFactor, skip_dependent_columns};

/// Upper triangular factor `R` of `matrix = Q R` (Householder): `matrixᵀ matrix = Rᵀ R`.
pub(crate) fn triangularize(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let order: Vec<usize> = (0..matrix.ncols()).collect();
    let mut factor = TriangularFactor::new(matrix.ncols());
    factor.merge_rows(matrix, &order);
    factor.into_matrix()
}

/// A column depends on the previous ones when no more than this fraction of it is independent.
const DEPENDENT: f64 = 1e-9;

/// Row echelon form of `[A | b]`: orthogonal rows, without those that are zero in `A`.
pub(crate) struct Echelon {
    /// Rows `[R | Qᵀb]`, as many as `A` has rank: each starts at a column that is independent of the previous ones.
    pub(crate) rows: DMatrix<f64>,
    pub(crate) leading_rank: usize,
}

/// Triangularizes `[A | b]` such that a column that depends on the previous ones has no row.
///
/// Plain triangularization gives every column a row. The row of a dependent column then has a pivot of rounding errors,
/// and entries that belong to later columns or a part of `b` that nothing in `A` can change. `leading` is the number of
/// leading columns whose rank is also returned.
pub(crate) fn echelon(matrix: &DMatrix<f64>, leading: usize) -> Echelon {
    let norms: Vec<f64> = matrix.column_iter().map(|column| column.norm()).collect();
    let mut upper = triangularize(matrix);
    let independent = skip_dependent_columns(&mut upper, matrix.ncols() - 1, &norms, DEPENDENT);
    let leading_rank = independent.iter().filter(|column| **column < leading).count();
    Echelon { rows: upper.rows(0, independent.len()).into_owned(), leading_rank }
}
