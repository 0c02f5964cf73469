//! Projects nuisance columns out of a Jacobian, by orthogonal transformations of the rows.

use nalgebra::DMatrix;

use crate::geometry::triangular_factor::{TriangularFactor, skip_dependent_columns};

/// A column is dependent if at most this fraction of it is independent of the columns before it.
///
/// The four unobservable directions of visual-inertial windows leave about 1e-15; weakly observable directions stay
/// above 1e-9.
const DEPENDENT: f64 = 1e-11;

/// Rows of a triangular factor with its first `nuisance` columns projected out; `norms` are the column norms of the
/// matrix that was factorized.
pub(super) fn project_out(factor: TriangularFactor, nuisance: usize, norms: &[f64]) -> DMatrix<f64> {
    let mut upper = factor.into_matrix();
    let rank = skip_dependent_columns(&mut upper, nuisance, norms, DEPENDENT).len();
    upper.view((rank, nuisance), (upper.nrows() - rank, upper.ncols() - nuisance)).into_owned()
}

/// Rows with their first `count` columns projected out.
pub(super) fn without_leading(rows: &DMatrix<f64>, count: usize) -> DMatrix<f64> {
    let order: Vec<usize> = (0..rows.ncols()).collect();
    let norms: Vec<f64> = rows.column_iter().map(|column| column.norm()).collect();
    let mut factor = TriangularFactor::new(rows.ncols());
    factor.merge_rows(rows, &order);
    project_out(factor, count, &norms)
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
