use std::sync::Arc;

use crate::estimator::{FactorRows, InformationGain, StepReport, allocated_bytes};
use crate::frontend::{TrackedFeature, TrackedFrame};
use crate::geometry::RigidTransform;
use crate::observability::RankReport;

/// One step of one run with what it was computed from.
#[derive(Clone, Debug)]
pub struct StepRecord {
    /// The estimator's report; its `linearization` has been analysed and dropped.
    pub report: StepReport,
    /// Observability of the calibration in this step, `None` while initializing.
    pub rank: Option<RankReport>,
    /// Feature tracks of the main camera; empty where it has no image.
    pub tracks: Arc<TrackedFrame>,
    /// Ground truth of `world_from_imu`.
    pub ground_truth: Option<RigidTransform>,
    /// Log time of the image since the log began, beside the report's header stamp.
    pub log_time_ns: i64,
    /// Whether features, older frames of the window and most landmarks were evicted to save memory; see
    /// [`RunRecord::step_at`](super::RunRecord::step_at).
    pub summary_only: bool,
}

impl StepRecord {
    /// The calibration's columns and the information gain of the image in them; `None` before the estimator tracks.
    pub fn gain(&self) -> Option<(&RankReport, &InformationGain)> {
        Some((self.rank.as_ref()?, self.report.gain.as_ref()?))
    }

    /// Bytes without the tracks, which the runs on the same camera share.
    pub fn own_bytes(&self) -> usize {
        let reference_counts = 2 * size_of::<usize>();
        // The report's own fields lie within the record's.
        let fields = size_of::<Self>() - size_of::<StepReport>();
        allocated_bytes(reference_counts + fields)
            + self.report.bytes().total()
            + self.rank.as_ref().map_or(0, RankReport::heap_bytes)
    }

    /// Bytes of the tracks.
    pub fn tracks_bytes(&self) -> usize {
        tracks_bytes(&self.tracks)
    }
}

/// The linearized rows of one step's factors other than reprojection, which records do not keep.
#[derive(Clone, Debug)]
pub struct StepFactorRows {
    /// Number of the step.
    pub step: usize,
    /// By factor, `None` where the step has no window.
    pub rows: Option<Vec<FactorRows>>,
}

/// Bytes of one camera's tracks behind an [`Arc`].
pub(in crate::session) fn tracks_bytes(tracks: &TrackedFrame) -> usize {
    allocated_bytes(size_of::<TrackedFrame>() + 2 * size_of::<usize>())
        + allocated_bytes(tracks.features.capacity() * size_of::<TrackedFeature>())
}
