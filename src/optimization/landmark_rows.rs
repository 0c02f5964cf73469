//! Elimination of a landmark by QR: the rows of its observations are projected orthogonally onto the complement of the
//! landmark's columns, no normal equations are formed, so that what is exactly unobservable stays exactly so.

use std::ops::Range;

use super::Reprojection;

/// Columns of a landmark.
const LANDMARK: usize = 3;
/// Columns of a camera pose.
const POSE: usize = 6;

/// The whitened rows of one landmark's observations, `[landmark 3 | anchor 6 | observers 6 each | residual 1]`: of the
/// camera poses only those that observe it.
#[derive(Debug, Default)]
pub(crate) struct LandmarkRows {
    /// Row-major.
    entries: Vec<f64>,
    width: usize,
    /// Poses of the blocks of columns, the anchor's first.
    poses: Vec<usize>,
    /// Rows that the landmark still fills after the projection.
    used: usize,
    /// Rows behind them that the last observation adds to the others.
    added: usize,
    reflector: Vec<f64>,
    products: Vec<f64>,
}

impl LandmarkRows {
    /// A landmark without rows yet, of at most so many observations.
    pub(crate) fn begin(&mut self, anchor: usize, observations: usize) {
        self.poses.clear();
        self.poses.push(anchor);
        self.entries.clear();
        self.width = LANDMARK + POSE * observations.max(1) + 1;
        (self.used, self.added) = (0, 0);
    }

    fn height(&self) -> usize {
        self.entries.len() / self.width
    }

    /// Adds the two rows of an observation from a pose.
    pub(crate) fn push(&mut self, pose: usize, term: &Reprojection) {
        let anchor = self.poses[0];
        if pose != anchor {
            self.poses.push(pose);
        }
        let place = LANDMARK + POSE * (self.poses.len() - 1);
        for axis in 0..2 {
            let begin = self.entries.len();
            self.entries.resize(begin + self.width, 0.0);
            let row = &mut self.entries[begin..];
            for k in 0..LANDMARK {
                row[k] = term.by_landmark[(axis, k)];
            }
            if pose != anchor {
                for k in 0..POSE {
                    row[LANDMARK + k] = term.by_anchor[(axis, k)];
                    row[place + k] = term.by_observer[(axis, k)];
                }
            }
            row[self.width - 1] = term.residual[axis];
        }
    }

    /// The pose of the newest observation; the anchor's before any other.
    pub(crate) fn last_pose(&self) -> Option<usize> {
        self.poses.last().copied()
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

    /// Appends some rows, row-major, as `[poses from first on, 6 each | residual]`; `columns` counts those of all poses and
    /// the residual.
    pub(crate) fn append_to(&self, rows: &mut Vec<f64>, columns: usize, first: usize, range: Range<usize>) {
        let width = columns - POSE * first;
        for row in self.entries.chunks_exact(self.width).skip(range.start).take(range.len()) {
            let begin = rows.len();
            rows.resize(begin + width, 0.0);
            let target = &mut rows[begin..];
            for (pose, block) in self.poses.iter().zip(row[LANDMARK..].chunks_exact(POSE)) {
                let place = POSE * (pose - first);
                target[place..place + POSE].copy_from_slice(block);
            }
            target[width - 1] = row[self.width - 1];
        }
    }
}
