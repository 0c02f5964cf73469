//! Symmetric positive definite systems with a band and a border: states in time order, then the unknowns common
//! to all states.

#![expect(clippy::inline_always, reason = "code that is not inlined is not compiled for the registers of its caller")]

use std::ops::Range;

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::Llt;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::prelude::{Reborrow as _, ReborrowMut as _};
use faer::{Accum, MatMut, MatRef, Par, Side};
use nalgebra::{DMatrix, DVector};
use pulp::{Arch, NullaryFnOnce};
use rayon::prelude::*;

/// Block size of the band's factorization, in rows and columns.
const BLOCK: usize = 64;
/// Number of entries that one thread zeroes at a time.
const FILLED: usize = 1 << 17;
/// Number of border rows solved together.
const FORWARD_ROWS: usize = 3;

/// Lower triangle of `[band Cᵀ; C corner]`.
#[derive(Clone, Debug)]
pub(super) struct ArrowMatrix {
    band: Band,
    /// One row per border unknown, as long as the band.
    border: Vec<Vec<f64>>,
    corner: DMatrix<f64>,
}

/// Lower triangle of a band, row by row.
///
/// The stored rows of a block of [`BLOCK`] start at the same column, so that blocks are matrices. Entries left
/// of the first column or after the last row are zero.
#[derive(Clone, Debug)]
pub(super) struct Band {
    len: usize,
    /// Number of stored blocks left of the diagonal.
    reach: usize,
    entries: Vec<f64>,
}

impl Band {
    /// `memory` is reused between iterations: hundreds of megabytes on a long flight; zeroing is faster than
    /// allocating.
    fn zeros(len: usize, half_width: usize, memory: Vec<f64>) -> Self {
        let reach = half_width.min(len.saturating_sub(1)).div_ceil(BLOCK);
        let size = len.div_ceil(BLOCK) * BLOCK * (reach + 1) * BLOCK;
        let mut entries = memory;
        entries.truncate(size);
        entries.par_chunks_mut(FILLED).for_each(|part| part.fill(0.0));
        entries.resize(size, 0.0);
        Self { len, reach, entries }
    }

    /// Number of stored entries per row.
    fn width(&self) -> usize {
        (self.reach + 1) * BLOCK
    }

    /// Stored columns of a row before its diagonal, and their indices in the storage.
    fn stored(&self, row: usize) -> (Range<usize>, Range<usize>) {
        let first = (row / BLOCK * BLOCK).saturating_sub(self.reach * BLOCK);
        (first..row, self.index(row, first)..self.index(row, row))
    }

    /// Index of an entry of the lower triangle in the storage.
    fn index(&self, row: usize, column: usize) -> usize {
        row * self.width() + self.reach * BLOCK + column - row / BLOCK * BLOCK
    }

    /// Adds to an entry of the lower triangle; entries above the diagonal are ignored.
    pub(super) fn add(&mut self, row: usize, column: usize, value: f64) {
        if column <= row {
            debug_assert!(column >= self.stored(row).0.start, "within the band");
            let index = self.index(row, column);
            self.entries[index] += value;
        }
    }

    /// Entries of a row in `columns`, at most up to its diagonal.
    pub(super) fn row_mut(&mut self, row: usize, columns: Range<usize>) -> &mut [f64] {
        debug_assert!(columns.start >= self.stored(row).0.start && columns.end <= row + 1, "within the band");
        let first = self.index(row, columns.start);
        &mut self.entries[first..first + columns.len()]
    }

    fn diagonal(&mut self, row: usize) -> &mut f64 {
        let index = self.index(row, row);
        &mut self.entries[index]
    }

    /// Cholesky factorization in place; `false` when the matrix is not positive definite.
    ///
    /// Right-looking by blocks: each finished block column is subtracted from the blocks within its reach. Sums have
    /// a fixed order for any number of threads.
    fn factor(&mut self) -> bool {
        let (width, reach) = (self.width(), self.reach);
        // Padding rows of the last block.
        for row in self.len..self.entries.len() / width.max(1) {
            *self.diagonal(row) = 1.0;
        }
        let mut rows: Vec<&mut [f64]> = self.entries.chunks_exact_mut(BLOCK * width).collect();
        let mut panel = vec![0.0; reach * BLOCK * BLOCK];
        for first in 0..rows.len() {
            let end = rows.len().min(first + reach + 1);
            let [own, below @ ..] = &mut rows[first..end] else { break };
            let Some(pivot) = factored_block(own, width) else { return false };
            let panel = &mut panel[..below.len() * BLOCK * BLOCK];
            below.par_iter_mut().zip(panel.par_chunks_exact_mut(BLOCK * BLOCK)).enumerate().for_each(
                |(place, (rows, panel))| {
                    let target = MatMut::from_row_major_slice_mut(rows, BLOCK, width);
                    let mut target = target.subcols_mut((reach - 1 - place) * BLOCK, BLOCK);
                    solve_lower_triangular_in_place(pivot.L(), target.rb_mut().transpose_mut(), Par::Seq);
                    MatMut::from_row_major_slice_mut(panel, BLOCK, BLOCK).copy_from(target);
                },
            );
            below.par_iter_mut().enumerate().for_each(|(place, rows)| {
                let count = (place + 1) * BLOCK;
                let own = MatRef::from_row_major_slice(&panel[place * BLOCK * BLOCK..][..BLOCK * BLOCK], BLOCK, BLOCK);
                let others = MatRef::from_row_major_slice(&panel[..count * BLOCK], count, BLOCK);
                let target = MatMut::from_row_major_slice_mut(rows, BLOCK, width);
                let target = target.subcols_mut((reach - place) * BLOCK, count);
                matmul(target, Accum::Add, own, others.transpose(), -1.0, Par::Seq);
            });
        }
        true
    }

    /// Replaces the factor `L` by the entries of `(L Lᵀ)⁻¹` within the band, both triangles of its diagonal blocks.
    ///
    /// An entry of the inverse depends only on the entries of later columns within the band (Erisman and Tinney, *On
    /// Computing Certain Elements of the Inverse of a Sparse Matrix*, CACM 1975), here by blocks from the last column
    /// back. Sums have a fixed order for any number of threads.
    fn invert(&mut self) {
        let (width, reach) = (self.width(), self.reach);
        let mut rows: Vec<&mut [f64]> = self.entries.chunks_exact_mut(BLOCK * width).collect();
        let mut ratios = vec![0.0; reach * BLOCK * BLOCK];
        let mut inverse = vec![0.0; reach * BLOCK * BLOCK];
        for column in (0..rows.len()).rev() {
            let end = rows.len().min(column + reach + 1);
            let [own, below @ ..] = &mut rows[column..end] else { break };
            let mut own = MatMut::from_row_major_slice_mut(own, BLOCK, width).subcols_mut(reach * BLOCK, BLOCK);
            let pivot = own.to_owned();
            let count = below.len();
            let ratios = &mut ratios[..count * BLOCK * BLOCK];
            let inverse = &mut inverse[..count * BLOCK * BLOCK];
            // Rows of `L₂₁ L₁₁⁻¹`.
            below.par_iter().zip(ratios.par_chunks_exact_mut(BLOCK * BLOCK)).enumerate().for_each(
                |(place, (rows, ratio))| {
                    let mut ratio = MatMut::from_row_major_slice_mut(ratio, BLOCK, BLOCK);
                    ratio.copy_from(block_of(rows, width, reach - 1 - place));
                    solve_upper_triangular_in_place(pivot.transpose(), ratio.rb_mut().transpose_mut(), Par::Seq);
                },
            );
            inverse.par_chunks_exact_mut(BLOCK * BLOCK).enumerate().for_each(|(row, target)| {
                let mut target = MatMut::from_row_major_slice_mut(target, BLOCK, BLOCK);
                target.fill(0.0);
                for (other, ratio) in ratios.chunks_exact(BLOCK * BLOCK).enumerate() {
                    let ratio = MatRef::from_row_major_slice(ratio, BLOCK, BLOCK);
                    let known = block_of(below[row.max(other)], width, reach - row.abs_diff(other));
                    let known = if row >= other { known } else { known.transpose() };
                    matmul(target.rb_mut(), Accum::Add, known, ratio, -1.0, Par::Seq);
                }
            });
            own.fill(0.0);
            own.rb_mut().diagonal_mut().fill(1.0);
            solve_lower_triangular_in_place(pivot.as_ref(), own.rb_mut(), Par::Seq);
            solve_upper_triangular_in_place(pivot.transpose(), own.rb_mut(), Par::Seq);
            for (place, rows) in below.iter_mut().enumerate() {
                let part = place * BLOCK * BLOCK..(place + 1) * BLOCK * BLOCK;
                let ratio = MatRef::from_row_major_slice(&ratios[part.clone()], BLOCK, BLOCK);
                let found = MatRef::from_row_major_slice(&inverse[part], BLOCK, BLOCK);
                matmul(own.rb_mut(), Accum::Add, ratio.transpose(), found, -1.0, Par::Seq);
                let target = MatMut::from_row_major_slice_mut(rows, BLOCK, width);
                target.subcols_mut((reach - 1 - place) * BLOCK, BLOCK).copy_from(found);
            }
        }
    }

    /// Computes `L⁻¹ x` in place for several vectors, with a single pass over the factor.
    fn forward(&self, vectors: &mut [Vec<f64>]) {
        Arch::new().dispatch(Forward { band: self, vectors });
    }

    /// Computes `L⁻ᵀ x` in place.
    fn backward(&self, vector: &mut [f64]) {
        for row in (0..self.len).rev() {
            let (columns, places) = self.stored(row);
            vector[row] /= self.entries[places.end];
            let value = vector[row];
            for (entry, coupling) in vector[columns].iter_mut().zip(&self.entries[places]) {
                *entry -= value * coupling;
            }
        }
    }
}

/// [`Band::forward`], compiled for every width of vector registers.
struct Forward<'a> {
    band: &'a Band,
    vectors: &'a mut [Vec<f64>],
}

impl NullaryFnOnce for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { band, vectors } = self;
        for row in 0..band.len {
            let (columns, places) = band.stored(row);
            let (entries, diagonal) = (&band.entries[places.clone()], band.entries[places.end]);
            for vector in &mut *vectors {
                let product = dot(entries, &vector[columns.clone()]);
                vector[row] = (vector[row] - product) / diagonal;
            }
        }
    }
}

/// Block at index `place` of the stored columns of a block of rows.
fn block_of(rows: &[f64], width: usize, place: usize) -> MatRef<'_, f64> {
    MatRef::from_row_major_slice(rows, BLOCK, width).subcols(place * BLOCK, BLOCK)
}

/// Factors the diagonal block at the end of its rows and returns the factor.
fn factored_block(rows: &mut [f64], width: usize) -> Option<Llt<f64>> {
    let mut block = MatMut::from_row_major_slice_mut(rows, BLOCK, width).subcols_mut(width - BLOCK, BLOCK);
    let factor = block.rb().llt(Side::Lower).ok()?;
    block.copy_from(factor.L());
    (0..BLOCK).all(|place| block[(place, place)].is_finite()).then_some(factor)
}

impl ArrowMatrix {
    /// Zero matrix for `len` unknowns in the band and `borders` in the border; reuses the memory of an earlier one
    /// ([`ArrowFactor::into_memory`]).
    pub(super) fn zeros(len: usize, half_width: usize, borders: usize, memory: Vec<f64>) -> Self {
        Self {
            band: Band::zeros(len, half_width, memory),
            border: vec![vec![0.0; len]; borders],
            corner: DMatrix::zeros(borders, borders),
        }
    }

    /// Adds to an entry of the band's lower triangle; entries above the diagonal are ignored.
    pub(super) fn add(&mut self, row: usize, column: usize, value: f64) {
        self.band.add(row, column, value);
    }

    /// Adds to the coupling between a border unknown and a band unknown.
    pub(super) fn add_border(&mut self, border: usize, column: usize, value: f64) {
        self.border[border][column] += value;
    }

    /// Band, rows of the border, and block of the border, for parallel additions.
    pub(super) fn parts_mut(&mut self) -> (&mut Band, &mut [Vec<f64>], &mut DMatrix<f64>) {
        (&mut self.band, &mut self.border, &mut self.corner)
    }

    /// Block of the border (borders × borders, both triangles).
    pub(super) fn corner_mut(&mut self) -> &mut DMatrix<f64> {
        &mut self.corner
    }

    /// Multiplies the diagonal by `1 + factor` and adds `floor` to it.
    pub(super) fn damp(&mut self, factor: f64, floor: f64) {
        for row in 0..self.band.len {
            let entry = self.band.diagonal(row);
            *entry += factor * *entry + floor;
        }
        for border in 0..self.corner.nrows() {
            self.corner[(border, border)] += factor * self.corner[(border, border)] + floor;
        }
    }

    /// Cholesky factor, `None` when the matrix is not positive definite.
    pub(super) fn factor(self) -> Option<ArrowFactor> {
        let Self { mut band, mut border, mut corner } = self;
        if !band.factor() {
            return None;
        }
        border.par_chunks_mut(FORWARD_ROWS).for_each(|rows| band.forward(rows));
        let products: Vec<Vec<f64>> = border
            .par_iter()
            .enumerate()
            .map(|(row, of_row)| {
                border[..=row].iter().map(|of_column| Arch::new().dispatch(Dot(of_row, of_column))).collect()
            })
            .collect();
        for (row, products) in products.iter().enumerate() {
            for (column, product) in products.iter().enumerate() {
                corner[(row, column)] -= product;
                corner[(column, row)] = corner[(row, column)];
            }
        }
        Some(ArrowFactor { band, border, corner })
    }
}

/// Cholesky factor: `L` of the band, `L⁻¹Cᵀ`, and the border's Schur complement.
#[derive(Clone, Debug)]
pub(super) struct ArrowFactor {
    band: Band,
    border: Vec<Vec<f64>>,
    corner: DMatrix<f64>,
}

impl ArrowFactor {
    /// Memory of the band, for the next matrix.
    pub(super) fn into_memory(self) -> Vec<f64> {
        self.band.entries
    }

    /// Information matrix of the border's unknowns (borders × borders), the band eliminated.
    pub(super) fn border_information(&self) -> &DMatrix<f64> {
        &self.corner
    }

    /// Covariances of ranges of consecutive band unknowns within the band's width, all others marginalized; `None` when
    /// the border's Schur complement is not positive definite.
    pub(super) fn covariances(self, ranges: &[Range<usize>]) -> Option<Vec<DMatrix<f64>>> {
        let Self { mut band, mut border, corner } = self;
        // From `L⁻¹Cᵀ` to `A⁻¹Cᵀ`, which adds the uncertainty of the border to the uncertainty of the band.
        border.par_iter_mut().for_each(|row| band.backward(row));
        band.invert();
        let shared = if corner.is_empty() { corner } else { corner.cholesky()?.inverse() };
        let covariance = |range: &Range<usize>| {
            let response =
                DMatrix::from_fn(border.len(), range.len(), |unknown, place| border[unknown][range.start + place]);
            let by_border = response.tr_mul(&(&shared * &response));
            DMatrix::from_fn(range.len(), range.len(), |row, column| {
                let (later, earlier) = (range.start + row.max(column), range.start + row.min(column));
                band.entries[band.index(later, earlier)] + by_border[(row, column)]
            })
        };
        Some(ranges.iter().map(covariance).collect())
    }

    /// Solves for band and border; `None` when the border's Schur complement is not positive definite.
    pub(super) fn solve(&self, band: &[f64], border: &DVector<f64>) -> Option<(Vec<f64>, DVector<f64>)> {
        let mut solution = [band.to_vec()];
        self.band.forward(&mut solution);
        let [mut solution] = solution;
        let mut reduced = border.clone();
        for (entry, row) in reduced.iter_mut().zip(&self.border) {
            *entry -= dot(row, &solution);
        }
        let shared = if reduced.is_empty() { reduced } else { self.corner.clone().cholesky()?.solve(&reduced) };
        for (value, row) in shared.iter().zip(&self.border) {
            for (entry, coupling) in solution.iter_mut().zip(row) {
                *entry -= value * coupling;
            }
        }
        self.band.backward(&mut solution);
        Some((solution, shared))
    }
}

/// [`dot`], compiled for every width of vector registers.
struct Dot<'a>(&'a [f64], &'a [f64]);

impl NullaryFnOnce for Dot<'_> {
    type Output = f64;

    #[inline(always)]
    fn call(self) -> f64 {
        dot(self.0, self.1)
    }
}

/// Scalar product, summed in eight accumulators in a fixed order.
#[inline(always)]
fn dot(left: &[f64], right: &[f64]) -> f64 {
    let mut strands = [0.0; 8];
    let (left_chunks, right_chunks) = (left.chunks_exact(8), right.chunks_exact(8));
    let rest: f64 = left_chunks.remainder().iter().zip(right_chunks.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in left_chunks.zip(right_chunks) {
        for strand in 0..8 {
            strands[strand] += a[strand] * b[strand];
        }
    }
    strands.iter().sum::<f64>() + rest
}
