//! Reprojection factors as rows over the blocks of a camera (its poses and intrinsics), with every landmark eliminated
//! by orthogonal projection: without normal equations, unobservable directions stay exactly unobservable.
//!
//! With the derivatives `J_l` by a landmark and `J_c` by the blocks, the rows are `N (J_c δ + r)` where the rows of N span
//! the complement of `J_l`, `N J_l = 0` (Mourikis and Roumeliotis, ICRA 2007; Demmel et al., CVPR 2021).

use nalgebra::{DMatrix, DVector};

use super::reprojection::{Anchor, VisualFactors, whitened};
use crate::estimator::state::camera_view::ROLLING_BLOCKS;
use crate::geometry::triangular_factor::{PORTION, TriangularFactor};
use crate::optimization::{LandmarkRows, OBSERVATION_ROWS, PoseBlocks};

/// Columns of a block of the camera: a pose, or its intrinsics.
const BLOCK: usize = 6;

/// Whitened rows of some tracks.
#[derive(Clone, Debug)]
pub(crate) struct ProjectedRows {
    /// `[blocks of the camera, 6 columns each | residual]`, compressed to at most as many rows as columns. The first
    /// nonzero entries of a row belong to the newest frame it depends on, so the rows are triangular from the newest
    /// frame back.
    pub(crate) rows: DMatrix<f64>,
    /// Rows of the newest frame's observations, conditioned on the landmarks' posterior from all other
    /// observations, in the same columns; also included in `rows`.
    pub(crate) newest_rows: DMatrix<f64>,
    /// `JᵀJ` of the blocks before elimination of the landmarks.
    blocks: PoseBlocks,
}

impl ProjectedRows {
    pub(crate) fn new(factors: &VisualFactors<'_>, apart: NewestRows) -> Self {
        match factors.current.blocks_per_image() {
            1 => Self::by_blocks::<1>(factors, apart),
            _ => Self::by_blocks::<ROLLING_BLOCKS>(factors, apart),
        }
    }

    /// [`Self::new`] for a camera with `N` blocks per image.
    fn by_blocks<const N: usize>(factors: &VisualFactors<'_>, apart: NewestRows) -> Self {
        let VisualFactors { model, current, linearized, tracks, landmarks } = *factors;
        let frames = current.frames();
        let newest = frames.saturating_sub(1);
        let per_frame = current.blocks_per_frame();
        let mut blocks = PoseBlocks::new(current.blocks());
        let columns = BLOCK * current.blocks() + 1;
        let slot_of = |block: usize| block / per_frame;
        // The newest frame comes first in the triangular factor: the first nonzero entries of a row belong to the
        // newest frame it depends on, and rows of older observations are short. The intrinsics come after all frames.
        let place = |block: usize| {
            let (slot, row) = (block / per_frame, block % per_frame);
            BLOCK * if slot < frames { per_frame * (newest - slot) + row } else { block }
        };
        let mut heights = vec![0; frames];
        for observation in tracks.iter().flat_map(|track| &track.observations) {
            heights[newest - observation.slot] += OBSERVATION_ROWS;
        }
        let capacity = |(begin, height)| Vec::with_capacity(height * (columns - BLOCK * per_frame * begin));
        let mut groups: Vec<Vec<f64>> = heights.into_iter().enumerate().map(capacity).collect();
        let mut newest_rows = Vec::new();
        let mut local = LandmarkRows::default();
        for (track, landmark) in tracks.iter().zip(landmarks) {
            let Some(first) = track.observations.first() else { continue };
            let anchor = Anchor::new(current, linearized, first);
            let observers = N * (track.observations.len() - 1);
            local.begin(current.blocks_of::<N>(first), current.intrinsics_block(), observers);
            let weight = anchor.weight(model, landmark, track);
            for observation in &track.observations {
                let Some(term) = whitened::<N>(model, &anchor, landmark, observation, weight) else { continue };
                blocks.add(&term);
                local.push(&term);
            }
            local.eliminate();
            if apart == NewestRows::Apart {
                // Observations are in ascending order: the rows of the newest frame are conditioned on all others.
                let of_newest = |blocks: &[usize]| blocks.last().is_some_and(|block| slot_of(*block) == newest);
                for (added, of_added) in local.added().filter(|(_, blocks)| of_newest(blocks)) {
                    local.append_to(&mut newest_rows, columns, added, of_added, |block| BLOCK * block);
                }
            }
            for (added, of_added) in local.added() {
                let slots = of_added.iter().map(|block| slot_of(*block)).filter(|slot| *slot < frames);
                let begin = newest - slots.max().unwrap_or(first.slot);
                let skipped = BLOCK * per_frame * begin;
                local.append_to(&mut groups[begin], columns - skipped, added, of_added, |block| place(block) - skipped);
            }
        }
        let mut factor = TriangularFactor::new(columns);
        for (begin, rows) in groups.iter().enumerate() {
            let skipped = BLOCK * per_frame * begin;
            let width = columns - skipped;
            for portion in rows.chunks(PORTION * width) {
                factor.merge(skipped, portion.len() / width, |column, entries| {
                    for (entry, row) in entries.iter_mut().zip(portion.chunks_exact(width)) {
                        *entry = row[column - skipped];
                    }
                });
            }
        }
        // Omits the last row, which has the residual only and which no unknown can change.
        let by_place = factor.leading_rows(columns - 1);
        let mut rows = DMatrix::zeros(by_place.nrows(), columns);
        for block in 0..current.blocks() {
            rows.fixed_columns_mut::<BLOCK>(BLOCK * block).copy_from(&by_place.fixed_columns::<BLOCK>(place(block)));
        }
        rows.set_column(columns - 1, &by_place.column(columns - 1));
        let newest_rows = DMatrix::from_row_slice(newest_rows.len() / columns, columns, &newest_rows);
        Self { rows, newest_rows, blocks }
    }

    /// Squared norms of columns that change the blocks by `columns` (6 × n each), before the elimination.
    pub(crate) fn squared_column_norms(&self, columns: &[DMatrix<f64>]) -> DVector<f64> {
        self.blocks.squared_norms(columns)
    }
}

/// Treatment of the newest frame's rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NewestRows {
    /// Only included in [`ProjectedRows::rows`].
    Among,
    /// Rows that are also stored separately.
    Apart,
}
