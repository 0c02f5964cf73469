//! Elimination of a landmark by QR: the rows of its observations are projected orthogonally onto the complement of the
//! landmark's columns, no normal equations are formed, so that what is exactly unobservable stays exactly so.

use std::ops::Range;

use nalgebra::Matrix2x6;

use super::BlockTerm;

/// Columns of a landmark.
const LANDMARK: usize = 3;
/// Columns of a block.
const BLOCK: usize = 6;

/// The whitened rows of one landmark's observations, `[landmark 3 | anchor | shared | observers | residual 1]`, six columns
/// a block: of the blocks only those that its observations depend on.
#[derive(Debug, Default)]
pub(crate) struct LandmarkRows {
    /// Row-major.
    entries: Vec<f64>,
    width: usize,
    /// The blocks of columns: the anchor's, the shared one, then those of the observers.
    blocks: Vec<usize>,
    /// Number of blocks before those of the observers.
    common: usize,
    /// Rows that the landmark still fills after the projection.
    used: usize,
    /// Rows behind them that the last observation adds to the others.
    added: usize,
    reflector: Vec<f64>,
    products: Vec<f64>,
}

impl LandmarkRows {
    /// A landmark without rows yet, with the blocks of its anchor, the block that all observations share, and room for so
    /// many blocks of observers.
    pub(crate) fn begin(&mut self, anchor: impl IntoIterator<Item = usize>, shared: Option<usize>, observers: usize) {
        self.blocks.clear();
        self.blocks.extend(anchor);
        self.blocks.extend(shared);
        self.common = self.blocks.len();
        self.entries.clear();
        self.width = LANDMARK + BLOCK * (self.common + observers) + 1;
        (self.used, self.added) = (0, 0);
    }

    fn height(&self) -> usize {
        self.entries.len() / self.width
    }

    /// Adds the two rows of an observation.
    pub(crate) fn push<const N: usize>(&mut self, term: &BlockTerm<usize, N>) {
        let observers = self.blocks.len();
        self.blocks.extend(term.observer.iter().flatten().map(|(block, _)| *block));
        for axis in 0..2 {
            let begin = self.entries.len();
            self.entries.resize(begin + self.width, 0.0);
            let row = &mut self.entries[begin..];
            for k in 0..LANDMARK {
                row[k] = term.by_landmark[(axis, k)];
            }
            let mut write = |place: usize, by_block: &Matrix2x6<f64>| {
                for k in 0..BLOCK {
                    row[LANDMARK + BLOCK * place + k] = by_block[(axis, k)];
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
            row[self.width - 1] = term.residual[axis];
        }
    }

    /// The last block of the newest observation, `None` before any but the anchor's.
    pub(crate) fn last_observer(&self) -> Option<usize> {
        self.blocks[self.common..].last().copied()
    }

    /// Eliminates the landmark from all rows.
    pub(crate) fn eliminate(&mut self) {
        self.project_out_landmark(self.height());
    }

    /// Eliminates the landmark from the rows before the last observation first, and then from what is left of it there
    /// together with the last observation.
    pub(crate) fn eliminate_last_apart(&mut self) {
        const OBSERVATION: usize = 2;
        let older = self.height() - OBSERVATION;
        self.project_out_landmark(older);
        let landmark = self.used;
        // The last observation goes right behind what is left of the landmark.
        self.entries[landmark * self.width..].rotate_right(OBSERVATION * self.width);
        self.used = 0;
        self.project_out_landmark(landmark + OBSERVATION);
        self.added = landmark + OBSERVATION - self.used;
    }

    /// Householder reflections of the first `height` rows that clear the landmark's columns below as many rows (fewer for
    /// dependent columns).
    fn project_out_landmark(&mut self, height: usize) {
        let width = self.width;
        for column in 0..LANDMARK {
            if self.used >= height {
                break;
            }
            let entry = |row: usize| self.entries[row * width + column];
            let norm = (0..height).map(|row| entry(row) * entry(row)).sum::<f64>().sqrt();
            let tail = (self.used..height).map(|row| entry(row) * entry(row)).sum::<f64>().sqrt();
            if tail <= 1e-12 * norm.max(1e-300) {
                continue;
            }
            self.reflector.clear();
            self.reflector.extend((self.used..height).map(entry));
            self.reflector[0] += if self.reflector[0] > 0.0 { tail } else { -tail };
            let factor = 2.0 / self.reflector.iter().map(|entry| entry * entry).sum::<f64>();
            self.reflect(factor, height);
            self.used += 1;
        }
    }

    /// `A ← A − factor·v·(vᵀA)` on the rows from `used` to `height`.
    fn reflect(&mut self, factor: f64, height: usize) {
        let rows = &mut self.entries[self.used * self.width..height * self.width];
        self.products.clear();
        self.products.resize(self.width, 0.0);
        for (row, weight) in rows.chunks_exact(self.width).zip(&self.reflector) {
            for (product, entry) in self.products.iter_mut().zip(row) {
                *product += weight * entry;
            }
        }
        for (row, weight) in rows.chunks_exact_mut(self.width).zip(&self.reflector) {
            let weight = factor * weight;
            for (entry, product) in row.iter_mut().zip(&self.products) {
                *entry -= weight * product;
            }
        }
    }

    /// The rows without the landmark, after the elimination.
    pub(crate) fn remaining(&self) -> Range<usize> {
        self.used..self.height()
    }

    /// Of [`Self::remaining`], those that the last observation adds to the others; only after
    /// [`Self::eliminate_last_apart`].
    pub(crate) fn added_by_last(&self) -> Range<usize> {
        self.used..self.used + self.added
    }

    /// Appends some rows, row-major, as `[blocks from first on, 6 each | residual]`; `columns` counts those of all blocks and
    /// the residual.
    pub(crate) fn append_to(&self, rows: &mut Vec<f64>, columns: usize, first: usize, range: Range<usize>) {
        let width = columns - BLOCK * first;
        for row in self.entries.chunks_exact(self.width).skip(range.start).take(range.len()) {
            let begin = rows.len();
            rows.resize(begin + width, 0.0);
            let target = &mut rows[begin..];
            for (number, block) in self.blocks.iter().zip(row[LANDMARK..].chunks_exact(BLOCK)) {
                let place = BLOCK * (number - first);
                target[place..place + BLOCK].copy_from_slice(block);
            }
            target[width - 1] = row[self.width - 1];
        }
    }
}
