//! Reprojection factors as rows over the camera poses with every landmark projected out orthogonally: without
//! normal equations, unobservable directions stay exactly unobservable.

use nalgebra::{DMatrix, DVector};

use crate::estimator::factors::visual::{Track, VisualModel, whitened};
use crate::optimization::{CameraPose, Landmark, LandmarkRows, PoseBlocks, RelativePoses, dense};

/// Columns of a landmark.
const LANDMARK: usize = 3;
/// Columns of a camera pose.
const POSE: usize = 6;

/// The whitened rows of some tracks.
#[derive(Clone, Debug)]
pub(crate) struct ProjectedRows {
    /// `[camera poses 6·frames | residual]`, compressed to its upper echelon factor.
    pub(crate) rows: DMatrix<f64>,
    /// Rows of the newest frame's observations, conditioned on the landmarks' posterior from all other
    /// observations, in the same columns. They are included in `rows`.
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
        // Grouped by the first observing slot, from its columns on.
        let mut rows: Vec<Vec<f64>> =
            (0..frames).map(|slot| Vec::with_capacity(height_of(tracks, slot) * (columns - POSE * slot))).collect();
        let mut newest_rows = Vec::new();
        let mut local = LandmarkRows::default();
        for (track, landmark) in tracks.iter().zip(landmarks) {
            let Some(anchor) = track.observations.first().map(|first| first.slot) else { continue };
            local.begin(anchor, track.observations.len());
            for observation in &track.observations {
                let term = whitened(model, &relative, &relative_linearized, anchor, landmark, observation, None);
                let Some(term) = term else { continue };
                if observation.slot != anchor {
                    blocks.add(anchor, observation.slot, &term);
                }
                local.push(observation.slot, &term);
            }
            let seen_last = anchor != newest && local.last_pose() == Some(newest);
            if apart == NewestRows::Apart && seen_last {
                local.eliminate_last_apart();
                local.append_to(&mut newest_rows, columns, 0, local.added_by_last());
            } else {
                local.eliminate();
            }
            let first = first_slot(track).unwrap_or(anchor);
            local.append_to(&mut rows[first], columns, first, local.remaining());
        }
        // Without a row of the residual alone, which no camera pose can change.
        let rows = dense::triangularize_groups(&rows, POSE, columns);
        let newest_rows = DMatrix::from_row_slice(newest_rows.len() / columns, columns, &newest_rows);
        Self { rows, newest_rows, blocks }
    }

    /// Squared norms of the columns that move the cameras by `columns` (per slot 6 × n), before the projection.
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
