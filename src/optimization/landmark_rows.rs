//! Elimination of a landmark by QR: the rows of its observations are projected orthogonally onto the complement of the
//! landmark's columns. No normal equations are formed, so exactly unobservable directions stay exactly unobservable.

#![expect(clippy::inline_always, reason = "code that is not inlined is not compiled for the registers of its caller")]

use std::ops::Range;

use nalgebra::Matrix2x6;
use pulp::{Arch, NullaryFnOnce};

use super::BlockTerm;

const LANDMARK: usize = 3;
/// Number of columns before the blocks: landmark and residual.
const LEADING: usize = LANDMARK + 1;
const BLOCK: usize = 6;
/// Rows that an observation adds.
pub(crate) const OBSERVATION_ROWS: usize = 2;
/// A column of the landmark depends on the previous ones when no more than this fraction of it is independent.
const DEPENDENT: f64 = 1e-12;

/// Whitened rows of one landmark's observations, `[landmark 3 | residual 1 | anchor | shared | observers]`, six columns
/// per block, with only those blocks on which its observations depend.
///
/// The landmark is eliminated observation by observation: the rows that an observation adds depend only on the blocks
/// of the observations up to this one, and are conditioned on the landmark's posterior from the previous ones.
#[derive(Debug, Default)]
pub(crate) struct LandmarkRows {
    /// Entries of the matrix, row by row.
    entries: Vec<f64>,
    width: usize,
    /// Blocks of columns: anchor, shared block, observers.
    blocks: Vec<usize>,
    /// Number of blocks before the observers'.
    common: usize,
    /// Added rows by observation, in order.
    added: Vec<AddedRows>,
    products: Vec<f64>,
}

/// Rows that an observation adds.
#[derive(Clone, Debug)]
struct AddedRows {
    /// Row range; after the elimination, the rows of the landmark follow the rows of the last observation.
    rows: Range<usize>,
    /// Number of leading blocks on which the rows depend.
    blocks: usize,
}

impl LandmarkRows {
    /// Starts a landmark without rows: blocks of its anchor, the block shared by all observations, and space for
    /// `observers` blocks.
    pub(crate) fn begin(&mut self, anchor: impl IntoIterator<Item = usize>, shared: Option<usize>, observers: usize) {
        self.blocks.clear();
        self.blocks.extend(anchor);
        self.blocks.extend(shared);
        self.common = self.blocks.len();
        self.entries.clear();
        self.added.clear();
        self.width = LEADING + BLOCK * (self.common + observers);
    }

    pub(crate) fn push<const N: usize>(&mut self, term: &BlockTerm<usize, N>) {
        let observers = self.blocks.len();
        self.blocks.extend(term.observer.iter().flatten().map(|(block, _)| *block));
        for axis in 0..OBSERVATION_ROWS {
            let begin = self.entries.len();
            self.entries.resize(begin + self.width, 0.0);
            let row = &mut self.entries[begin..];
            for k in 0..LANDMARK {
                row[k] = term.by_landmark[(axis, k)];
            }
            row[LANDMARK] = term.residual[axis];
            let mut write = |place: usize, by_block: &Matrix2x6<f64>| {
                for k in 0..BLOCK {
                    row[LEADING + BLOCK * place + k] = by_block[(axis, k)];
                }
            };
            for (place, (_, by_block)) in term.anchor.iter().flatten().enumerate() {
                write(place, by_block);
            }
            if let Some((_, by_block)) = &term.shared {
                write(self.common - 1, by_block);
            }
            for (place, (_, by_block)) in (observers..).zip(term.observer.iter().flatten()) {
                write(place, by_block);
            }
        }
        let height = self.entries.len() / self.width;
        self.added.push(AddedRows { rows: height - OBSERVATION_ROWS..height, blocks: self.blocks.len() });
    }

    pub(crate) fn eliminate(&mut self) {
        Arch::new().dispatch(Elimination(self));
    }

    /// Rows of each observation after the elimination, with the blocks on which they depend.
    pub(crate) fn added(&self) -> impl DoubleEndedIterator<Item = (Range<usize>, &[usize])> {
        self.added.iter().map(|added| (added.rows.clone(), &self.blocks[..added.blocks]))
    }

    /// Appends the rows of `range`, row-major, as `[blocks, 6 columns each | residual]` of `width` columns; `place`
    /// returns the first column of a block.
    pub(crate) fn append_to(
        &self,
        rows: &mut Vec<f64>,
        width: usize,
        range: Range<usize>,
        blocks: &[usize],
        place: impl Fn(usize) -> usize,
    ) {
        for row in self.entries.chunks_exact(self.width).skip(range.start).take(range.len()) {
            let begin = rows.len();
            rows.resize(begin + width, 0.0);
            let target = &mut rows[begin..];
            for (block, entries) in blocks.iter().zip(row[LEADING..].chunks_exact(BLOCK)) {
                let place = place(*block);
                target[place..place + BLOCK].copy_from_slice(entries);
            }
            target[width - 1] = row[LANDMARK];
        }
    }
}

/// Elimination of a landmark, compiled for every width of vector registers.
struct Elimination<'a>(&'a mut LandmarkRows);

impl NullaryFnOnce for Elimination<'_> {
    type Output = ();

    /// Applies Householder reflections to the landmark's rows so far together with the rows of the next observation.
    #[inline(always)]
    fn call(self) {
        let LandmarkRows { entries, width, added, products, .. } = self.0;
        let width = *width;
        let mut squares = [0.0; LANDMARK];
        let mut filled = 0;
        for AddedRows { rows, blocks } in added {
            let columns = LEADING + BLOCK * *blocks;
            for row in entries[rows.start * width..rows.end * width].chunks_exact(width) {
                for (square, entry) in squares.iter_mut().zip(row) {
                    *square += entry * entry;
                }
            }
            let begin = rows.start - filled;
            let part = &mut entries[begin * width..rows.end * width];
            filled = 0;
            for column in 0..LANDMARK {
                let left = &mut part[filled * width..];
                let tail = left.chunks_exact(width).map(|row| row[column] * row[column]).sum::<f64>().sqrt();
                if tail <= DEPENDENT * squares[column].sqrt().max(1e-300) {
                    continue;
                }
                reflect(left, width, columns, column, tail, products);
                filled += 1;
                if filled * width == part.len() {
                    break;
                }
            }
            // Move the landmark's rows directly before the rows of the next observation.
            part.rotate_left(filled * width);
            *rows = begin..rows.end - filled;
        }
    }
}

/// Reflects rows so that a column becomes zero below the first one; `norm` is the norm of the column.
#[inline(always)]
fn reflect(rows: &mut [f64], width: usize, columns: usize, column: usize, norm: f64, products: &mut Vec<f64>) {
    // I − v·vᵀ / (norm·|v₀|)
    let first = rows[column];
    let pivot = if first > 0.0 { -norm } else { norm };
    let factor = (norm * (first - pivot).abs()).recip();
    let weight = |row: usize, entry: f64| if row == 0 { first - pivot } else { entry };
    products.clear();
    products.resize(columns, 0.0);
    for (index, row) in rows.chunks_exact(width).enumerate() {
        let weight = weight(index, row[column]);
        for (product, entry) in products.iter_mut().zip(row) {
            *product += weight * entry;
        }
    }
    for (index, row) in rows.chunks_exact_mut(width).enumerate() {
        let weight = factor * weight(index, row[column]);
        for (entry, product) in row.iter_mut().zip(&*products) {
            *entry -= weight * product;
        }
    }
}
