use std::sync::Arc;

use super::step_tracks::{KeptTracks, StepTracks};
use crate::estimator::{FactorRows, InformationGain, OTHER_CAMERA_FRAMES, StepReport, StepWarning, allocated_bytes};
use crate::frontend::{FeatureId, TrackedFeature};
use crate::geometry::RigidTransform;
use crate::observability::RankReport;

/// Image of one camera in a step, with its feature tracks.
#[derive(Clone, Debug)]
pub struct StepImage {
    /// Index in the camera's stream, `None` where the camera has no image in the step.
    pub index: Option<usize>,
    pub tracks: StepTracks,
}

/// One step of one run, with the tracks and ground truth of its images.
#[derive(Clone, Debug)]
pub struct StepRecord {
    /// The estimator's report; its `linearization` is dropped after the analysis unless it is to be kept.
    pub report: StepReport,
    /// Observability of the calibration in this step, `None` during initialization.
    pub rank: Option<RankReport>,
    /// Feature tracks of the main camera; empty where it has no image.
    pub tracks: StepTracks,
    /// Images of the run's further cameras, in their order.
    pub further_images: Vec<StepImage>,
    /// `world_from_imu` of the ground truth.
    pub ground_truth: Option<RigidTransform>,
    /// Log time of the image in nanoseconds since the log began; the report has its header stamp.
    pub log_time_ns: i64,
    /// True if features, older frames of the window and most landmarks were evicted to save memory; see
    /// [`RunRecord::step_at`](super::RunRecord::step_at).
    pub summary_only: bool,
}

impl StepRecord {
    /// Rank report of the calibration and the image's information gain in its columns; `None` before the estimator
    /// tracks.
    pub fn gain(&self) -> Option<(&RankReport, &InformationGain)> {
        Some((self.rank.as_ref()?, self.report.gain.as_ref()?))
    }

    /// Index and tracks of a camera's image in the step, `None` where it has none; 0 is the main camera.
    pub fn image(&self, camera: usize) -> Option<(usize, &StepTracks)> {
        match camera.checked_sub(1) {
            None => (self.report.frame_index < OTHER_CAMERA_FRAMES).then_some((self.report.frame_index, &self.tracks)),
            Some(further) => {
                let image = self.further_images.get(further)?;
                Some((image.index?, &image.tracks))
            }
        }
    }

    /// A feature in the images of the step; the id has its camera.
    pub fn track(&self, id: FeatureId) -> Option<TrackedFeature> {
        let (_, tracks) = self.image(id.camera())?;
        tracks.frame().features.iter().find(|feature| feature.id.of_camera(id.camera()) == id).copied()
    }

    /// Leaves the tracks of all cameras to the measurements of the run's steps, of which this is the one with a number.
    pub(in crate::session) fn keep_tracks_in(&mut self, all: &Arc<dyn KeptTracks>, step: usize) {
        let further = self.further_images.iter_mut().map(|image| &mut image.tracks);
        for (camera, tracks) in std::iter::once(&mut self.tracks).chain(further).enumerate() {
            tracks.keep_in(all, step, camera);
        }
    }

    /// Features of all cameras that are tracked from their previous images, and newly detected ones.
    pub fn tracked_and_detected(&self) -> [usize; 2] {
        let statistics = self.tracks_of_all().map(|tracks| tracks.statistics);
        statistics.fold([0, 0], |[tracked, detected], of| [tracked + of.tracked, detected + of.detected])
    }

    /// Number of features in the images of all cameras.
    pub fn feature_count(&self) -> usize {
        self.tracks_of_all().map(|tracks| tracks.count).sum()
    }

    /// Tracks by camera, the main camera first; empty where an image is missing.
    fn tracks_of_all(&self) -> impl Iterator<Item = &StepTracks> {
        let further = self.further_images.iter().map(|image| &image.tracks);
        std::iter::once(&self.tracks).chain(further)
    }

    /// Memory in bytes without the tracks, which runs on the same camera share.
    pub fn own_bytes(&self) -> usize {
        let reference_counts = 2 * size_of::<usize>();
        // The size of the record already includes the report itself.
        let fields = size_of::<Self>() - size_of::<StepReport>();
        allocated_bytes(reference_counts + fields)
            + self.report.bytes().total()
            + self.rank.as_ref().map_or(0, RankReport::heap_bytes)
            + allocated_bytes(self.further_images.capacity() * size_of::<StepImage>())
    }

    /// Memory in bytes of the main camera's tracks, unless the measurements of the run's steps have them.
    pub fn tracks_bytes(&self) -> usize {
        self.tracks.own_bytes()
    }
}

/// The linearized rows of one step's factors other than reprojection, which records do not keep.
#[derive(Clone, Debug)]
pub struct StepFactorRows {
    pub step: usize,
    /// Rows by factor, `None` where the step has no window.
    pub rows: Option<Vec<FactorRows>>,
}

/// A warning and the steps that reported it.
#[derive(Clone, Debug, PartialEq)]
pub struct RunWarning {
    /// The problem and its remedy.
    pub warning: StepWarning,
    /// Header stamp of the first step that reported it.
    pub first_ns: i64,
    /// Header stamp of the last step that reported it.
    pub last_ns: i64,
    /// Number of steps that reported it.
    pub steps: usize,
}

/// The warnings of a run's steps, ordered by their first step.
pub(in crate::session) fn warnings_of(steps: &[Arc<StepRecord>]) -> Vec<RunWarning> {
    let mut warnings = Vec::new();
    for step in steps {
        add_warnings(&mut warnings, &step.report);
    }
    warnings
}

/// Adds the warnings of one more step.
pub(in crate::session) fn add_warnings(warnings: &mut Vec<RunWarning>, report: &StepReport) {
    for warning in &report.warnings {
        match warnings.iter_mut().find(|known| known.warning == *warning) {
            Some(known) => {
                known.steps += 1;
                known.last_ns = report.stamp_ns;
            }
            None => warnings.push(RunWarning {
                warning: warning.clone(),
                first_ns: report.stamp_ns,
                last_ns: report.stamp_ns,
                steps: 1,
            }),
        }
    }
}
