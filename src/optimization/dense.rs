//! Dense algebra on the window: nalgebra keeps the matrices, faer factors them.

use std::ops::Range;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::qr::no_pivoting::factor::{qr_in_place, qr_in_place_scratch, recommended_block_size};
use faer::linalg::solvers::Solve as _;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Mat, MatMut, MatRef, Par, Side};
use nalgebra::{DMatrix, DVector};

use crate::geometry::dense::as_faer;

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

/// The upper echelon factor `R` of `matrix = Q R` (Householder), at most as many rows as columns; `matrixᵀ matrix = Rᵀ R`.
///
/// Dependent columns leave explicit zeros, so that a row's first non-zero entry tells which column it belongs to.
pub(crate) fn triangularize(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    triangularized(as_faer(matrix).to_owned())
}

/// Rows that begin with the same columns.
#[derive(Clone, Debug)]
pub(crate) struct ColumnGroup {
    /// Number of columns before those of the next group.
    pub(crate) columns: usize,
    /// Row-major, from the first of these columns to the last one of all; the zeros before are left out.
    pub(crate) rows: Vec<f64>,
}

/// [`triangularize`] of rows in groups, without the rows that would begin behind the columns of the groups.
///
/// Each group joins when its first column is at hand, so that the zeros before it are not worked on.
pub(crate) fn triangularize_groups(groups: &[ColumnGroup], columns: usize) -> DMatrix<f64> {
    let mut upper = DMatrix::zeros(groups.iter().map(|group| group.columns).sum(), columns);
    let mut height = 0;
    let mut first = 0;
    // What is left below the rows that are done.
    let mut left = DMatrix::zeros(0, columns);
    for group in groups {
        let width = columns - first;
        let (above, joining) = (left.nrows(), group.rows.len() / width);
        let mut matrix = Mat::zeros(above + joining, width);
        let (mut top, mut bottom) = matrix.as_mut().split_at_row_mut(above);
        top.copy_from(as_faer(&left));
        bottom.copy_from(MatRef::from_row_major_slice(&group.rows, joining, width));
        let factor = triangularized(matrix);
        let done = factor.nrows().min(group.columns);
        upper.view_mut((height, first), (done, width)).copy_from(&factor.rows(0, done));
        height += done;
        left = factor.view((done, group.columns), (factor.nrows() - done, width - group.columns)).into_owned();
        first += group.columns;
    }
    upper.resize_vertically(height, 0.0)
}

fn triangularized(mut factors: Mat<f64>) -> DMatrix<f64> {
    let (rows, columns) = factors.shape();
    if rows == 0 || columns == 0 {
        return DMatrix::zeros(0, columns);
    }
    let height = rows.min(columns);
    let block = recommended_block_size::<f64>(rows, columns);
    let mut coefficients = Mat::zeros(block, height);
    let scratch = qr_in_place_scratch::<f64>(rows, columns, block, Par::Seq, Default::default());
    let mut memory = MemBuffer::new(scratch);
    let stack = MemStack::new(&mut memory);
    qr_in_place(factors.as_mut(), coefficients.as_mut(), Par::Seq, stack, Default::default());
    DMatrix::from_fn(height, columns, |row, column| if row <= column { factors[(row, column)] } else { 0.0 })
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
    let (height, last) = (upper.nrows(), upper.ncols() - 1);
    let (mut rank, mut leading_rank) = (0, 0);
    for column in 0..last {
        // Below this the triangle is empty, and dependent columns have left it one row deeper each.
        let end = (column + 1).min(height);
        if rank == end {
            break;
        }
        let mut axis = upper.view((rank, column), (end - rank, 1)).column(0).into_owned();
        let norm = axis.norm();
        upper.view_mut((rank, column), (end - rank, 1)).fill(0.0);
        if norm <= DEPENDENT * norms[column] {
            continue;
        }
        // A reflection onto the first row; a row alone needs none.
        let pivot = if end - rank == 1 { axis[0] } else { -norm.copysign(axis[0]) };
        axis[0] -= pivot;
        if axis[0] != 0.0 {
            let scale = 2.0 / axis.norm_squared();
            for mut later in upper.view_mut((rank, column + 1), (end - rank, last - column)).column_iter_mut() {
                let along = scale * axis.dot(&later);
                later.axpy(-along, &axis, 1.0);
            }
        }
        upper[(rank, column)] = pivot;
        rank += 1;
        if column < leading {
            leading_rank = rank;
        }
    }
    Echelon { rows: upper.rows(0, rank).into_owned(), leading_rank }
}
