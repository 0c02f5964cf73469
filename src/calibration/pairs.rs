//! Conversion of the information between two views from their poses to the unknowns; an assembly spends most of its
//! time here.
//!
//! Every entry is the sum that matrix products of the complete Jacobians would give, without their zero columns.
//! Entries are added in the order of the pairs for any number of threads.

#![expect(clippy::inline_always, reason = "code that is not inlined is not compiled for the registers of its caller")]

use std::ops::Range;

use nalgebra::{DMatrix, Dim, Dyn, Matrix, Matrix6, RawStorage};
use pulp::{Arch, NullaryFnOnce};

use super::arrow::{ArrowMatrix, Band};
use super::state::ViewMap;

/// Jacobian of a view's pose, laid out for sums over pairs of views.
#[derive(Clone, Debug)]
pub(super) struct ViewRows<'a> {
    map: &'a ViewMap,
    own: PoseRows,
    shared: PoseRows,
    /// First column of the view's frame set in the band.
    start: usize,
}

/// Six rows of the nonzero columns, row by row.
#[derive(Clone, Debug)]
struct PoseRows {
    columns: Range<usize>,
    entries: Vec<f64>,
}

/// Two views, `first ≤ second`, with their block of the Hessian over poses.
#[derive(Clone, Copy, Debug)]
pub(super) struct ViewPair<'a> {
    pub(super) first: &'a ViewRows<'a>,
    pub(super) second: &'a ViewRows<'a>,
    pub(super) block: &'a Matrix6<f64>,
}

impl<'a> ViewRows<'a> {
    /// `start` is the column of the band at which the view's frame set starts.
    pub(super) fn new(map: &'a ViewMap, start: usize) -> Self {
        Self { map, own: PoseRows::shown(&map.own), shared: PoseRows::shown(&map.shared), start }
    }
}

impl PoseRows {
    /// Columns of a matrix with six rows.
    fn of<S: RawStorage<f64, R, Dyn>, R: Dim>(matrix: &Matrix<f64, R, Dyn, S>, columns: Range<usize>) -> Self {
        let mut entries = Vec::with_capacity(6 * columns.len());
        for row in 0..6 {
            entries.extend(columns.clone().map(|column| matrix[(row, column)]));
        }
        Self { columns, entries }
    }

    /// Columns from the first to the last nonzero one.
    fn shown(matrix: &DMatrix<f64>) -> Self {
        let shows = |column: &usize| matrix.column(*column).iter().any(|entry| *entry != 0.0);
        let first = (0..matrix.ncols()).find(shows).unwrap_or(0);
        let end = (first..matrix.ncols()).rev().find(shows).map_or(first, |last| last + 1);
        Self::of(matrix, first..end)
    }

    /// Adds the products of a 6-vector with the first columns to as many entries of `target`.
    #[inline(always)]
    fn add_products(&self, column: &[f64; 6], target: &mut [f64]) {
        let len = self.columns.len();
        let count = target.len().min(len);
        let [a, b, c, d, e, f] = std::array::from_fn(|row| &self.entries[row * len..][..count]);
        let [u, v, w, x, y, z] = column;
        for (place, entry) in target[..count].iter_mut().enumerate() {
            *entry += a[place] * u + b[place] * v + c[place] * w + d[place] * x + e[place] * y + f[place] * z;
        }
    }
}

/// Column of a matrix with six rows.
#[inline(always)]
fn column_of<S: RawStorage<f64, R, Dyn>, R: Dim>(matrix: &Matrix<f64, R, Dyn, S>, column: usize) -> [f64; 6] {
    std::array::from_fn(|row| matrix[(row, column)])
}

/// Adds all pairs to the matrix of the unknowns.
pub(super) fn add_pairs(matrix: &mut ArrowMatrix, pairs: &[ViewPair<'_>]) {
    let (band, border, corner) = matrix.parts_mut();
    // Both tasks take about as long.
    rayon::join(
        || Arch::new().dispatch(BandAndCorner { pairs, band, corner }),
        || Arch::new().dispatch(Border { pairs, border }),
    );
}

/// Adds pairs to the band and to the corner, compiled for every width of vector registers.
struct BandAndCorner<'a> {
    pairs: &'a [ViewPair<'a>],
    band: &'a mut Band,
    corner: &'a mut DMatrix<f64>,
}

impl NullaryFnOnce for BandAndCorner<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { pairs, band, corner } = self;
        let mut shared = DMatrix::zeros(corner.nrows(), corner.ncols());
        for ViewPair { first, second, block } in pairs {
            let right = *block * &second.map.own;
            let same = std::ptr::eq(*first, *second);
            if !same && first.start == second.start {
                // Both cameras of one frame set: the lower triangle contains both orders of the pair.
                let own = first.map.own.tr_mul(&right);
                for a in 0..own.nrows() {
                    for b in 0..own.ncols() {
                        band.add(second.start + b, first.start + a, own[(a, b)]);
                        band.add(first.start + a, second.start + b, own[(a, b)]);
                    }
                }
            } else {
                for column in second.own.columns.clone() {
                    let row = second.start + column;
                    let start = first.start + first.own.columns.start;
                    // Rows of the later frame set; the lower triangle within one view.
                    let end = (start + first.own.columns.len()).min(row + 1);
                    if start < end {
                        first.own.add_products(&column_of(&right, column), band.row_mut(row, start..end));
                    }
                }
            }
            let right = *block * &second.map.shared;
            let (rows, columns) = (first.shared.columns.clone(), second.shared.columns.clone());
            for column in columns.clone() {
                let products = &mut shared.as_mut_slice()[column * corner.nrows()..][rows.clone()];
                products.fill(0.0);
                first.shared.add_products(&column_of(&right, column), products);
                for (entry, product) in corner.column_mut(column).rows_range_mut(rows.clone()).iter_mut().zip(products)
                {
                    *entry += *product;
                }
            }
            if !same {
                for column in columns {
                    for row in rows.clone() {
                        corner[(column, row)] += shared[(row, column)];
                    }
                }
            }
        }
    }
}

/// Adds pairs to the border, compiled for every width of vector registers.
struct Border<'a> {
    pairs: &'a [ViewPair<'a>],
    border: &'a mut [Vec<f64>],
}

impl NullaryFnOnce for Border<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { pairs, border } = self;
        for ViewPair { first, second, block } in pairs {
            let right = PoseRows::of(&(*block * &second.map.own), second.own.columns.clone());
            for unknown in first.shared.columns.clone() {
                let target = &mut border[unknown][second.start..][second.own.columns.clone()];
                right.add_products(&column_of(&first.map.shared, unknown), target);
            }
            if std::ptr::eq(*first, *second) {
                continue;
            }
            let right = *block * &second.map.shared;
            for unknown in second.shared.columns.clone() {
                let target = &mut border[unknown][first.start..][first.own.columns.clone()];
                first.own.add_products(&column_of(&right, unknown), target);
            }
        }
    }
}
