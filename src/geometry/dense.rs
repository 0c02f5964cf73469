//! Decompositions of dense matrices: nalgebra keeps them, faer factors them.

use faer::{Mat, MatRef};
use nalgebra::{DMatrix, DVector};

/// `A = U·diag(s)·Vᵀ` with as many columns as the smaller side has, largest singular value first.
#[derive(Clone, Debug, PartialEq)]
pub struct ThinSvd {
    /// Left singular vectors, one column each.
    pub u: DMatrix<f64>,
    /// Singular values in descending order.
    pub singular_values: DVector<f64>,
    /// Right singular vectors, one column each.
    pub v: DMatrix<f64>,
}

/// The thin singular value decomposition, `None` for a matrix that is not finite.
pub fn thin_svd(matrix: &DMatrix<f64>) -> Option<ThinSvd> {
    let (rows, columns) = matrix.shape();
    if rows == 0 || columns == 0 {
        return Some(ThinSvd {
            u: DMatrix::zeros(rows, 0),
            singular_values: DVector::zeros(0),
            v: DMatrix::zeros(columns, 0),
        });
    }
    if !is_finite(matrix) {
        return None;
    }
    let svd = as_faer(matrix).thin_svd().ok()?;
    let singular_values = svd.S().column_vector();
    Some(ThinSvd {
        u: from_faer(svd.U()),
        singular_values: DVector::from_fn(singular_values.nrows(), |index, _| singular_values[index]),
        v: from_faer(svd.V()),
    })
}

/// The singular values in descending order, `None` for a matrix that is not finite.
pub fn singular_values(matrix: &DMatrix<f64>) -> Option<Vec<f64>> {
    if matrix.is_empty() {
        return Some(vec![]);
    }
    if !is_finite(matrix) {
        return None;
    }
    as_faer(matrix).singular_values().ok()
}

fn is_finite(matrix: &DMatrix<f64>) -> bool {
    matrix.iter().all(|entry| entry.is_finite())
}

/// A view of a matrix for faer, without a copy.
pub fn as_faer(matrix: &DMatrix<f64>) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(matrix.as_slice(), matrix.nrows(), matrix.ncols())
}

/// A copy of a matrix from faer.
pub fn from_faer(matrix: MatRef<'_, f64>) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |row, column| matrix[(row, column)])
}

/// A copy of a matrix for faer.
pub fn to_faer(matrix: &DMatrix<f64>) -> Mat<f64> {
    as_faer(matrix).to_owned()
}
