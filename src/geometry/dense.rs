//! Decompositions of dense matrices, stored by nalgebra and factored by faer.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::{Conj, Mat, MatMut, MatRef, Par};
use nalgebra::{DMatrix, DVector};

/// Thin singular value decomposition `A = U·diag(s)·Vᵀ` of an m × n matrix, with k = min(m, n) singular values.
#[derive(Clone, Debug, PartialEq)]
pub struct ThinSvd {
    /// Left singular vectors as columns (m × k).
    pub u: DMatrix<f64>,
    /// Singular values (k × 1), in descending order.
    pub singular_values: DVector<f64>,
    /// Right singular vectors as columns (n × k).
    pub v: DMatrix<f64>,
}

/// Returns the thin singular value decomposition, `None` for a matrix that is not finite.
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

/// Singular values in descending order, `None` for a matrix that is not finite.
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

/// View of a matrix for faer, without a copy.
pub fn as_faer(matrix: &DMatrix<f64>) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(matrix.as_slice(), matrix.nrows(), matrix.ncols())
}

pub fn from_faer(matrix: MatRef<'_, f64>) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |row, column| matrix[(row, column)])
}

pub fn to_faer(matrix: &DMatrix<f64>) -> Mat<f64> {
    as_faer(matrix).to_owned()
}

/// Multiplies `rest` (m × n) in place by `Qᵀ` of `spanning` (m × k) `= Q·R·Pᵀ` and returns the rank r of `spanning`:
/// the first r rows of the product are the part of `rest` within the column space of `spanning`, the other m − r rows
/// the part orthogonal to it.
///
/// Column-pivoted Householder QR, also correct for dependent columns: a pivot counts when it exceeds `tolerance`, so
/// the columns of `spanning` should have norms around 1. Both matrices must be finite.
pub fn split_by_column_space(spanning: MatRef<'_, f64>, rest: MatMut<'_, f64>, tolerance: f64) -> usize {
    use faer::linalg::householder::{
        apply_block_householder_sequence_transpose_on_the_left_in_place_scratch as scratch,
        apply_block_householder_sequence_transpose_on_the_left_in_place_with_conj as apply,
    };
    let factors = spanning.col_piv_qr();
    let pivots = factors.R().diagonal().column_vector();
    let rank = (0..pivots.nrows()).take_while(|&index| pivots[index].abs() > tolerance).count();
    let (basis, coefficients) = (factors.Q_basis(), factors.Q_coeff());
    if rank > 0 && rest.ncols() > 0 {
        let mut memory = MemBuffer::new(scratch::<f64>(basis.nrows(), coefficients.nrows(), rest.ncols()));
        apply(basis, coefficients, Conj::No, rest, Par::Seq, MemStack::new(&mut memory));
    }
    rank
}
