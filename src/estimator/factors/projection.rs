//! Reprojection factors as rows over the blocks of a camera (its poses, and its intrinsics) with every landmark projected out orthogonally: without
//! normal equations, unobservable directions stay exactly unobservable.

use nalgebra::{DMatrix, DVector};

use crate::estimator::factors::visual::{Anchor, Track, VisualModel, whitened};
use crate::estimator::state::camera_view::{CameraView, ROLLING_BLOCKS};
use crate::optimization::dense::{self, ColumnGroup};
use crate::optimization::{Landmark, LandmarkRows, PoseBlocks};

/// Columns of a landmark.
const LANDMARK: usize = 3;
/// Columns of a block of the camera: a pose, or its intrinsics.
const BLOCK: usize = 6;

/// The whitened rows of some tracks.
#[derive(Clone, Debug)]
pub(crate) struct ProjectedRows {
    /// `[blocks of the camera, 6 each | residual]`, compressed to its upper echelon factor.
    pub(crate) rows: DMatrix<f64>,
    /// Rows of the newest frame's observations, conditioned on the landmarks' posterior from all other
    /// observations, in the same columns. They are included in `rows`.
    pub(crate) newest_rows: DMatrix<f64>,
    /// `JᵀJ` of the blocks before the landmarks were projected out.
    blocks: PoseBlocks,
}

impl ProjectedRows {
    /// Linearizes at `current`, with the derivatives by poses taken at `linearized`.
    pub(crate) fn new(
        model: &VisualModel<'_>,
        current: &CameraView<'_>,
        linearized: &CameraView<'_>,
        tracks: &[Track],
        landmarks: &[Landmark],
        apart: NewestRows,
    ) -> Self {
        match current.blocks_per_frame() {
            1 => Self::by_blocks::<1>(model, current, linearized, tracks, landmarks, apart),
            _ => Self::by_blocks::<ROLLING_BLOCKS>(model, current, linearized, tracks, landmarks, apart),
        }
    }

    /// [`Self::new`] for a camera with `N` blocks per frame.
    fn by_blocks<const N: usize>(
        model: &VisualModel<'_>,
        current: &CameraView<'_>,
        linearized: &CameraView<'_>,
        tracks: &[Track],
        landmarks: &[Landmark],
        apart: NewestRows,
    ) -> Self {
        let frames = current.frames();
        let newest = frames.saturating_sub(1);
        let mut blocks = PoseBlocks::new(current.blocks());
        let columns = BLOCK * current.blocks() + 1;
        // Grouped by the first observing slot, from its columns on; none begin with the intrinsics.
        let width = BLOCK * N;
        let of_slot = |slot: usize| ColumnGroup {
            columns: width,
            rows: Vec::with_capacity(height_of(tracks, slot) * (columns - width * slot)),
        };
        let mut groups: Vec<ColumnGroup> = (0..frames).map(of_slot).collect();
        groups.extend(current.intrinsics_block().map(|_| ColumnGroup { columns: BLOCK, rows: Vec::new() }));
        let mut newest_rows = Vec::new();
        let mut local = LandmarkRows::default();
        for (track, landmark) in tracks.iter().zip(landmarks) {
            let Some(first) = track.observations.first() else { continue };
            let anchor = Anchor::new(current, linearized, first);
            let observers = N * (track.observations.len() - 1);
            local.begin(CameraView::blocks_of::<N>(first.slot), current.intrinsics_block(), observers);
            for observation in &track.observations {
                let Some(term) = whitened::<N>(model, &anchor, landmark, observation, None) else { continue };
                blocks.add(&term);
                local.push(&term);
            }
            let seen_last = first.slot != newest && local.last_observer().map(|block| block / N) == Some(newest);
            if apart == NewestRows::Apart && seen_last {
                local.eliminate_last_apart();
                local.append_to(&mut newest_rows, columns, 0, local.added_by_last());
            } else {
                local.eliminate();
            }
            let slot = first_slot(track).unwrap_or(first.slot);
            local.append_to(&mut groups[slot].rows, columns, N * slot, local.remaining());
        }
        // Without a row of the residual alone, which no unknown can change.
        let rows = dense::triangularize_groups(&groups, columns);
        let newest_rows = DMatrix::from_row_slice(newest_rows.len() / columns, columns, &newest_rows);
        Self { rows, newest_rows, blocks }
    }

    /// Squared norms of the columns that change the blocks by `columns` (6 × n each), before the projection.
    pub(crate) fn squared_column_norms(&self, columns: &[DMatrix<f64>]) -> DVector<f64> {
        self.blocks.squared_norms(columns)
    }
}

/// The anchor need not be the first observing frame.
fn first_slot(track: &Track) -> Option<usize> {
    track.observations.iter().map(|observation| observation.slot).min()
}

/// Largest number of rows that start in a slot.
fn height_of(tracks: &[Track], slot: usize) -> usize {
    let beginning = tracks.iter().filter(|track| first_slot(track) == Some(slot));
    beginning.map(|track| (2 * track.observations.len()).saturating_sub(LANDMARK)).sum()
}

/// Treatment of the newest frame's rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NewestRows {
    /// Not requested.
    Among,
    /// Stored separately as well.
    Apart,
}
