//! The reprojection factors as rows over the camera poses, every landmark projected out orthogonally: no normal
//! equations are formed, so that what is exactly unseen stays exactly unseen.

use nalgebra::{DMatrix, DVector};

use super::dense;
use super::pose_blocks::PoseBlocks;
use super::reprojection::{CameraPose, Landmark, Reprojection};
use super::visual::{RelativePoses, Track, VisualModel, whitened};

/// Columns of a landmark.
const LANDMARK: usize = 3;
/// Columns of a camera pose.
const POSE: usize = 6;

/// The whitened rows of some tracks.
#[derive(Clone, Debug)]
pub(crate) struct ProjectedRows {
    /// `[camera poses 6·frames | residual]`, compressed to its upper echelon factor.
    pub(crate) rows: DMatrix<f64>,
    /// What the sightings of the newest frame add to those of the others, of the same columns: their rows when the
    /// landmarks were known from the others as far as those tell them. They are among `rows` already.
    pub(crate) newest_rows: DMatrix<f64>,
    /// `JᵀJ` of the camera poses before the landmarks were projected out.
    blocks: PoseBlocks,
}

impl ProjectedRows {
    /// Linearizes at `current`, with the derivatives by poses taken at `linearized`.
    pub(crate) fn new(
        model: &VisualModel<'_>,
        current: &[CameraPose],
        linearized: &[CameraPose],
        tracks: &[Track],
        landmarks: &[Landmark],
        apart: NewestRows,
    ) -> Self {
        let frames = current.len();
        let newest = frames.saturating_sub(1);
        let relative = RelativePoses::new(current);
        let relative_linearized = RelativePoses::new(linearized);
        let mut blocks = PoseBlocks::new(frames);
        let columns = POSE * frames + 1;
        // By the first slot that sees the feature, from its columns on.
        let mut rows: Vec<Vec<f64>> =
            (0..frames).map(|slot| Vec::with_capacity(height_of(tracks, slot) * (columns - POSE * slot))).collect();
        let mut newest_rows = Vec::new();
        let mut local = TrackRows::default();
        for (track, landmark) in tracks.iter().zip(landmarks) {
            let Some(anchor) = track.sightings.first().map(|first| first.slot) else { continue };
            local.begin(anchor, track.sightings.len());
            for sighting in &track.sightings {
                let term = whitened(model, &relative, &relative_linearized, anchor, landmark, sighting, None);
                let Some(term) = term else { continue };
                if sighting.slot != anchor {
                    blocks.add(anchor, sighting.slot, &term);
                }
                local.push(sighting.slot, &term);
            }
            let seen_last = anchor != newest && local.slots.last() == Some(&newest);
            if apart == NewestRows::Apart && seen_last {
                local.project_out_landmark_apart();
                local.append_to(&mut newest_rows, columns, 0, local.used..local.used + local.added);
            } else {
                local.project_out_landmark(local.height());
            }
            let first = first_slot(track).unwrap_or(anchor);
            local.append_to(&mut rows[first], columns, first, local.used..local.height());
        }
        // Without a row that holds nothing but the residual that no camera pose can change.
        let rows = dense::triangularize_groups(&rows, POSE, columns);
        let newest_rows = DMatrix::from_row_slice(newest_rows.len() / columns, columns, &newest_rows);
        Self { rows, newest_rows, blocks }
    }

    /// Sum of squares of the columns that move the cameras by `columns` (per slot 6 × n), before the projection.
    pub(crate) fn squared_column_norms(&self, columns: &[DMatrix<f64>]) -> DVector<f64> {
        self.blocks.squared_norms(columns)
    }
}

/// The anchor need not be the first to see a feature.
fn first_slot(track: &Track) -> Option<usize> {
    track.sightings.iter().map(|sighting| sighting.slot).min()
}

/// Most rows that the tracks leave which begin in a slot.
fn height_of(tracks: &[Track], slot: usize) -> usize {
    let beginning = tracks.iter().filter(|track| first_slot(track) == Some(slot));
    beginning.map(|track| (2 * track.sightings.len()).saturating_sub(LANDMARK)).sum()
}

/// Whether the rows that the newest frame adds are told apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NewestRows {
    /// They are not asked for.
    Among,
    /// They are kept beside the others, too.
    Apart,
}

/// The rows of one track, `[landmark 3 | anchor 6 | observers 6 each | residual]`: of the camera poses only those that
/// the track has sightings from.
#[derive(Debug, Default)]
struct TrackRows {
    /// Row-major.
    entries: Vec<f64>,
    width: usize,
    /// Slots of the blocks of columns, the anchor's first.
    slots: Vec<usize>,
    /// Rows that the landmark still fills after the projection.
    used: usize,
    /// Rows behind them that the last sighting adds to the others.
    added: usize,
    reflector: Vec<f64>,
    products: Vec<f64>,
}

impl TrackRows {
    /// A track without rows yet, of at most so many sightings.
    fn begin(&mut self, anchor: usize, sightings: usize) {
        self.slots.clear();
        self.slots.push(anchor);
        self.entries.clear();
        self.width = LANDMARK + POSE * sightings.max(1) + 1;
        (self.used, self.added) = (0, 0);
    }

    fn height(&self) -> usize {
        self.entries.len() / self.width
    }

    fn push(&mut self, slot: usize, term: &Reprojection) {
        let anchor = self.slots[0];
        if slot != anchor {
            self.slots.push(slot);
        }
        let place = LANDMARK + POSE * (self.slots.len() - 1);
        for axis in 0..2 {
            let begin = self.entries.len();
            self.entries.resize(begin + self.width, 0.0);
            let row = &mut self.entries[begin..];
            for k in 0..LANDMARK {
                row[k] = term.by_landmark[(axis, k)];
            }
            if slot != anchor {
                for k in 0..POSE {
                    row[LANDMARK + k] = term.by_anchor[(axis, k)];
                    row[place + k] = term.by_observer[(axis, k)];
                }
            }
            row[self.width - 1] = term.residual_px[axis];
        }
    }

    /// Projects the landmark out of the rows before the last sighting first, and then out of what is left of it there
    /// together with the last sighting.
    fn project_out_landmark_apart(&mut self) {
        const SIGHTING: usize = 2;
        let older = self.height() - SIGHTING;
        self.project_out_landmark(older);
        let landmark = self.used;
        // The last sighting goes right behind what is left of the landmark.
        self.entries[landmark * self.width..].rotate_right(SIGHTING * self.width);
        self.used = 0;
        self.project_out_landmark(landmark + SIGHTING);
        self.added = landmark + SIGHTING - self.used;
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

    /// Some rows, with the camera poses of the window from the slot `first` on.
    fn append_to(&self, rows: &mut Vec<f64>, columns: usize, first: usize, range: std::ops::Range<usize>) {
        let width = columns - POSE * first;
        for row in self.entries.chunks_exact(self.width).skip(range.start).take(range.len()) {
            let begin = rows.len();
            rows.resize(begin + width, 0.0);
            let target = &mut rows[begin..];
            for (slot, block) in self.slots.iter().zip(row[LANDMARK..].chunks_exact(POSE)) {
                let place = POSE * (slot - first);
                target[place..place + POSE].copy_from_slice(block);
            }
            target[width - 1] = row[self.width - 1];
        }
    }
}
