//! QR factorization of rows that arrive in portions, by Householder reflections.

#![expect(clippy::inline_always, reason = "code that is not inlined is not compiled for the registers of its caller")]

use std::ops::Range;

use nalgebra::DMatrix;
use pulp::{Arch, Simd, WithSimd};

/// Reflections that are applied together.
const PANEL: usize = 4;
/// Rows of a portion are padded with zeros to a multiple of this, so that they fill vector registers.
const LANES: usize = 8;
/// Largest number of rows that are merged together, so that they stay in the nearest caches.
pub(crate) const PORTION: usize = 128;

/// Upper triangular factor `R` (n × n) of rows `A`: `RᵀR = AᵀA`.
///
/// A row costs nothing in the columns before its first entry, and little in columns in which neither its portion nor
/// the rows of `R` above have entries: merge rows that begin at the same column together.
#[derive(Clone, Debug)]
pub(crate) struct TriangularFactor {
    columns: usize,
    /// Column-major, n × n.
    entries: Vec<f64>,
    /// True for each row of `R` that has been set.
    is_set: Vec<bool>,
    portion: Portion,
}

/// Rows to merge, and the reflections that clear them.
#[derive(Clone, Debug, Default)]
struct Portion {
    /// Column-major, [`Self::stride`] rows per column.
    entries: Vec<f64>,
    stride: usize,
    /// True for each column with entries.
    is_filled: Vec<bool>,
    /// Vectors of the reflections, [`Self::stride`] entries each.
    vectors: Vec<f64>,
    /// Columns that a panel changes.
    changed: Vec<usize>,
}

/// Householder reflection `I − τ·v·vᵀ`.
#[derive(Clone, Copy, Debug, Default)]
struct Reflection {
    tau: f64,
    /// Entry of `v` at the row of `R`: 1 when that row is part of the reflection, else 0.
    top: f64,
    /// Row of the portion that becomes the row of `R`.
    taken: Option<usize>,
}

impl TriangularFactor {
    /// Factor of a matrix without rows.
    pub(crate) fn new(columns: usize) -> Self {
        Self {
            columns,
            entries: vec![0.0; columns * columns],
            is_set: vec![false; columns],
            portion: Portion::default(),
        }
    }

    /// Adds `height` rows that are zero before the column `first`; `write` fills a column of them.
    pub(crate) fn merge(&mut self, first: usize, height: usize, mut write: impl FnMut(usize, &mut [f64])) {
        let width = self.columns - first;
        let portion = &mut self.portion;
        portion.stride = height.next_multiple_of(LANES);
        portion.entries.clear();
        portion.entries.resize(width * portion.stride, 0.0);
        portion.is_filled.clear();
        for (index, column) in portion.entries.chunks_exact_mut(portion.stride.max(1)).enumerate() {
            write(first + index, &mut column[..height]);
            portion.is_filled.push(column.iter().any(|entry| *entry != 0.0));
        }
        portion.vectors.clear();
        portion.vectors.resize(PANEL * portion.stride, 0.0);
        let mut taken = 0;
        let mut begin = first;
        while begin < self.columns && taken < height {
            let end = (begin + PANEL).min(self.columns);
            if portion_is_empty(&self.portion, begin - first..end - first) {
                begin = end;
                continue;
            }
            let mut panel = [Reflection::default(); PANEL];
            self.portion.vectors.fill(0.0);
            for column in begin..end {
                let index = column - begin;
                panel[index] = self.reflection(column, index, first, &mut taken, height);
                self.apply::<1>([panel[index]], index, column, first, column + 1..end);
            }
            self.apply(panel, 0, begin, first, end..self.columns);
            begin = end;
        }
    }

    /// Returns the reflection that clears a column of the portion; `index` counts within its panel.
    fn reflection(
        &mut self,
        column: usize,
        index: usize,
        first: usize,
        taken: &mut usize,
        height: usize,
    ) -> Reflection {
        let diagonal = column * self.columns + column;
        let stride = self.portion.stride;
        let place = (column - first) * stride;
        let entries = &self.portion.entries[place..place + stride];
        if *taken == height || entries[*taken..].iter().all(|entry| *entry == 0.0) {
            return Reflection::default();
        }
        let merges = self.is_set[column];
        let (alpha, below) = if merges { (self.entries[diagonal], *taken) } else { (entries[*taken], *taken + 1) };
        let vector = &mut self.portion.vectors[index * stride..(index + 1) * stride];
        vector[below..].copy_from_slice(&entries[below..]);
        let mut squares = [0.0; LANES];
        for part in vector.chunks_exact(LANES) {
            for (square, entry) in squares.iter_mut().zip(part) {
                *square += entry * entry;
            }
        }
        let square: f64 = squares.iter().sum();
        let mut reflection = Reflection { tau: 0.0, top: f64::from(u8::from(merges)), taken: None };
        let mut beta = alpha;
        if square > 0.0 {
            beta = -(alpha * alpha + square).sqrt().copysign(alpha);
            reflection.tau = (beta - alpha) / beta;
            let scale = (alpha - beta).recip();
            for entry in &mut *vector {
                *entry *= scale;
            }
        }
        if !merges {
            vector[*taken] = 1.0;
            reflection.taken = Some(*taken);
            self.is_set[column] = true;
            *taken += 1;
        }
        self.entries[diagonal] = beta;
        reflection
    }

    /// Applies the reflections of a panel from `index` on, which belong to the rows of `R` from `row` on, to a block of
    /// later columns.
    fn apply<const N: usize>(
        &mut self,
        panel: [Reflection; N],
        index: usize,
        row: usize,
        first: usize,
        columns: Range<usize>,
    ) {
        let (factor, count) = (&mut self.entries, self.columns);
        let portion = &mut self.portion;
        let rows = N.min(count - row);
        portion.changed.clear();
        for column in columns {
            let upper = &factor[column * count + row..][..rows];
            let touched = portion.is_filled[column - first]
                || upper.iter().zip(&panel).any(|(entry, reflection)| reflection.top * entry != 0.0);
            if touched {
                portion.is_filled[column - first] = true;
                portion.changed.push(column);
            }
        }
        if !portion.changed.is_empty() {
            Arch::new().dispatch(Application { panel, index, factor, count, row, rows, first, portion });
        }
    }

    /// Adds the rows of a matrix; column `k` of the factor is column `order[k]` of the matrix.
    pub(crate) fn merge_rows(&mut self, matrix: &DMatrix<f64>, order: &[usize]) {
        let mut begins = vec![order.len(); matrix.nrows()];
        // Rows before their first entry, and rows from their first entry on.
        let mut open: Vec<usize> = (0..matrix.nrows()).collect();
        let mut rows = Vec::with_capacity(open.len());
        for (place, column) in order.iter().enumerate() {
            let entries = matrix.column(*column);
            open.retain(|row| {
                let begins_here = entries[*row] != 0.0;
                if begins_here {
                    begins[*row] = place;
                    rows.push(*row);
                }
                !begins_here
            });
        }
        let mut rest = rows.as_slice();
        while let Some(row) = rest.first() {
            let first = begins[*row];
            let near = |row: &&usize| begins[**row] < first + 2 * PANEL;
            let count = rest.iter().take(PORTION).take_while(near).count();
            let (together, later) = rest.split_at(count);
            self.merge(first, count, |column, entries| {
                let source = matrix.column(order[column]);
                for (entry, row) in entries.iter_mut().zip(together) {
                    *entry = source[*row];
                }
            });
            rest = later;
        }
    }

    /// `R`, upper triangular (n × n).
    pub(crate) fn into_matrix(self) -> DMatrix<f64> {
        DMatrix::from_vec(self.columns, self.columns, self.entries)
    }

    /// First `count` rows of `R`, without those that no row was merged into.
    pub(crate) fn leading_rows(&self, count: usize) -> DMatrix<f64> {
        let rows: Vec<usize> = (0..count).filter(|row| self.is_set[*row]).collect();
        DMatrix::from_fn(rows.len(), self.columns, |row, column| self.entries[column * self.columns + rows[row]])
    }

    /// Factor of the columns from `first` on, with the others projected out.
    pub(crate) fn trailing(&self, first: usize) -> Self {
        let columns = self.columns - first;
        let mut entries = Vec::with_capacity(columns * columns);
        for column in first..self.columns {
            entries.extend_from_slice(&self.entries[column * self.columns + first..(column + 1) * self.columns]);
        }
        Self { columns, entries, is_set: self.is_set[first..].to_vec(), portion: Portion::default() }
    }
}

fn portion_is_empty(portion: &Portion, columns: Range<usize>) -> bool {
    portion.is_filled[columns].iter().all(|filled| !filled)
}

/// Consecutive reflections, applied to the changed columns of the portion and to their rows of `R`.
struct Application<'a, const N: usize> {
    panel: [Reflection; N],
    /// Index of the first reflection's vector.
    index: usize,
    factor: &'a mut [f64],
    /// Number of columns of `R`.
    count: usize,
    /// Row of `R` of the first reflection.
    row: usize,
    /// Rows of `R`: less than the reflections in the last panel.
    rows: usize,
    /// First column of the portion.
    first: usize,
    portion: &'a mut Portion,
}

impl<const N: usize> WithSimd for Application<'_, N> {
    type Output = ();

    // Without closures, which would not be compiled for the registers of their caller.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { panel, index, factor, count, row, rows, first, portion } = self;
        let Portion { entries, stride, vectors, changed, .. } = portion;
        let stride = *stride;
        let length = stride / S::F64_LANES;
        let mut of_panel: [&[S::f64s]; N] = [&[]; N];
        for k in 0..N {
            of_panel[k] = &S::as_simd_f64s(&vectors[(index + k) * stride..(index + k + 1) * stride]).0[..length];
        }
        let zero = simd.splat_f64s(0.0);
        // Products of each vector with the vectors before it.
        let mut products = [[0.0; N]; N];
        for k in 1..N {
            for before in 0..k {
                let mut sum = zero;
                for place in 0..length {
                    sum = simd.mul_add_e_f64s(of_panel[k][place], of_panel[before][place], sum);
                }
                products[k][before] = simd.reduce_sum_f64s(sum);
            }
        }
        let mut pairs = changed.chunks_exact(2);
        for pair in &mut pairs {
            let (left, right) = entries.split_at_mut((pair[1] - first) * stride);
            let left = &mut S::as_mut_simd_f64s(&mut left[(pair[0] - first) * stride..][..stride]).0[..length];
            let right = &mut S::as_mut_simd_f64s(&mut right[..stride]).0[..length];
            let (mut of_left, mut of_right) = ([zero; N], [zero; N]);
            for place in 0..length {
                for k in 0..N {
                    let entry = of_panel[k][place];
                    of_left[k] = simd.mul_add_e_f64s(entry, left[place], of_left[k]);
                    of_right[k] = simd.mul_add_e_f64s(entry, right[place], of_right[k]);
                }
            }
            let (mut by_left, mut by_right) = ([0.0; N], [0.0; N]);
            for k in 0..N {
                by_left[k] = simd.reduce_sum_f64s(of_left[k]);
                by_right[k] = simd.reduce_sum_f64s(of_right[k]);
            }
            finish(&panel, &products, &mut factor[pair[0] * count + row..][..rows], &mut by_left);
            finish(&panel, &products, &mut factor[pair[1] * count + row..][..rows], &mut by_right);
            for k in 0..N {
                of_left[k] = simd.splat_f64s(-by_left[k]);
                of_right[k] = simd.splat_f64s(-by_right[k]);
            }
            for place in 0..length {
                let (mut a, mut b) = (left[place], right[place]);
                for k in 0..N {
                    let entry = of_panel[k][place];
                    a = simd.mul_add_e_f64s(entry, of_left[k], a);
                    b = simd.mul_add_e_f64s(entry, of_right[k], b);
                }
                (left[place], right[place]) = (a, b);
            }
        }
        for column in pairs.remainder() {
            let own = &mut S::as_mut_simd_f64s(&mut entries[(column - first) * stride..][..stride]).0[..length];
            let mut sums = [zero; N];
            for place in 0..length {
                for k in 0..N {
                    sums[k] = simd.mul_add_e_f64s(of_panel[k][place], own[place], sums[k]);
                }
            }
            let mut weights = [0.0; N];
            for k in 0..N {
                weights[k] = simd.reduce_sum_f64s(sums[k]);
            }
            finish(&panel, &products, &mut factor[column * count + row..][..rows], &mut weights);
            for k in 0..N {
                sums[k] = simd.splat_f64s(-weights[k]);
            }
            for place in 0..length {
                let mut entry = own[place];
                for k in 0..N {
                    entry = simd.mul_add_e_f64s(of_panel[k][place], sums[k], entry);
                }
                own[place] = entry;
            }
        }
        // Rows of the portion that become rows of `R`.
        for (k, reflection) in panel.iter().enumerate() {
            if let Some(taken) = reflection.taken {
                for column in changed.iter() {
                    factor[column * count + row + k] = entries[(column - first) * stride + taken];
                }
            }
        }
    }
}

/// Converts the products of the vectors with a column into their factors in the reflected column; reflects the rows of
/// `R`.
#[inline(always)]
fn finish<const N: usize>(
    panel: &[Reflection; N],
    products: &[[f64; N]; N],
    upper: &mut [f64],
    weights: &mut [f64; N],
) {
    for k in 0..upper.len().min(N) {
        let mut dot = weights[k] + panel[k].top * upper[k];
        for before in 0..k {
            dot -= products[k][before] * weights[before];
        }
        weights[k] = panel[k].tau * dot;
        upper[k] -= panel[k].top * weights[k];
    }
}

/// Reflects an upper triangular matrix so that a column that depends on those before it takes up no row. Returns the
/// independent columns among the first `columns`: one leading row begins in each of them, and the other rows are zero
/// in all of these columns.
///
/// A column depends on those before it when no more than `tolerance` of its norm is independent of them.
pub(crate) fn skip_dependent_columns(
    upper: &mut DMatrix<f64>,
    columns: usize,
    norms: &[f64],
    tolerance: f64,
) -> Vec<usize> {
    let (height, width) = upper.shape();
    let mut independent = Vec::with_capacity(columns);
    for column in 0..columns {
        let rank = independent.len();
        // Below this row the triangle is empty; each dependent column has left it one row deeper.
        let end = (column + 1).min(height);
        if rank == end {
            break;
        }
        if rank == column && upper[(column, column)].abs() > tolerance * norms[column] {
            independent.push(column);
            continue;
        }
        let mut axis = upper.view((rank, column), (end - rank, 1)).column(0).into_owned();
        let norm = axis.norm();
        upper.view_mut((rank, column), (end - rank, 1)).fill(0.0);
        if norm <= tolerance * norms[column] {
            continue;
        }
        // Reflection onto the first row; a single row needs none.
        let pivot = if end - rank == 1 { axis[0] } else { -norm.copysign(axis[0]) };
        axis[0] -= pivot;
        if axis[0] != 0.0 {
            let scale = 2.0 / axis.norm_squared();
            for mut later in upper.view_mut((rank, column + 1), (end - rank, width - column - 1)).column_iter_mut() {
                let along = scale * axis.dot(&later);
                later.axpy(-along, &axis, 1.0);
            }
        }
        upper[(rank, column)] = pivot;
        independent.push(column);
    }
    independent
}

/// Upper triangular factor `R` of `matrix = Q R` (Householder): `matrixᵀ matrix = Rᵀ R`.
pub(crate) fn triangularize(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let order: Vec<usize> = (0..matrix.ncols()).collect();
    let mut factor = TriangularFactor::new(matrix.ncols());
    factor.merge_rows(matrix, &order);
    factor.into_matrix()
}

/// A column depends on the previous ones when no more than this fraction of it is independent: its information, the square,
/// is then at most the rounding error of normal equations.
const DEPENDENT: f64 = 1e-8;

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
