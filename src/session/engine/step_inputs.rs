//! The inputs of a run's steps, kept for recomputation.

use std::ops::Range;
use std::sync::Arc;

use parking_lot::{Condvar, Mutex};

use crate::estimator::{StepMeasurements, StepReport, allocated_bytes};
use crate::flight_log::SensorFrame;
use crate::frontend::{TrackedFeature, TrackedFrame};
use crate::geometry::RigidTransform;
use crate::observability::RankReport;
use crate::sensors::{ImuSample, JointAngles};
use crate::session::record::{StepImage, StepRecord, tracks_bytes};

/// Input of one step: measurements of one camera, or of a set of images.
///
/// Three types carry measurements from the log to the estimator. A [`SensorFrame`] holds the data of one image of one
/// camera from the log: it owns the image, which is not needed after the front end, and has no tracks. The estimator's
/// [`StepInput`](crate::estimator::StepInput) borrows its measurements for the call, because a fork changes some of
/// them first. `OwnedStepInput` owns the same measurements: tracker threads send it to the runs, and their histories
/// keep it, so that steps are recomputed without tracking features again. The front end does not depend on the
/// estimator, so the tracks are the same for every run. Runs on the same camera share the input.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::session) struct OwnedStepInput {
    /// Index of the main camera's image; where that image is missing, an index that no image has.
    pub(in crate::session) frame_index: usize,
    /// Header stamp on the main camera's clock, in nanoseconds since the log began.
    pub(in crate::session) stamp_ns: i64,
    /// Log time, in nanoseconds since the log began.
    pub(in crate::session) log_time_ns: i64,
    /// IMU samples from the stamp of the previous input to this one, both ends included.
    pub(in crate::session) imu: Vec<ImuSample>,
    /// IMU samples from the stamp on, for the rows of rolling shutters and later images; empty where no run needs them.
    pub(in crate::session) imu_after: Vec<ImuSample>,
    /// Stamps of the images after the step's in seconds, by camera; empty if all have its stamp.
    pub(in crate::session) image_times_s: Vec<f64>,
    /// Samples of the IMU on the gimbal over the interval of `imu`; empty without one, or where they are missing.
    pub(in crate::session) gimbal_imu: Vec<ImuSample>,
    /// Encoder readings at the stamp of the main camera's image.
    pub(in crate::session) joint_angles: Option<JointAngles>,
    /// Images by camera, the main camera first.
    pub(in crate::session) images: Vec<StepImage>,
    /// `world_from_imu` of the ground truth.
    pub(in crate::session) ground_truth: Option<RigidTransform>,
    /// Computing time of the front ends.
    pub(in crate::session) frontend_ms: f64,
}

impl OwnedStepInput {
    /// Record of the step with this input.
    pub(in crate::session) fn record(&self, report: StepReport, rank: Option<RankReport>) -> StepRecord {
        StepRecord {
            report,
            rank,
            tracks: Arc::clone(self.main_tracks()),
            further_images: self.images[1..].to_vec(),
            ground_truth: self.ground_truth,
            log_time_ns: self.log_time_ns,
            summary_only: false,
        }
    }

    pub(in crate::session) fn of_camera(frame: SensorFrame, tracks: TrackedFrame, frontend_ms: f64) -> Self {
        Self {
            frame_index: frame.index,
            stamp_ns: frame.stamp_ns,
            log_time_ns: frame.log_time_ns,
            imu: frame.imu,
            imu_after: frame.imu_after,
            image_times_s: Vec::new(),
            gimbal_imu: frame.gimbal_imu,
            joint_angles: frame.joint_angles,
            images: vec![StepImage { index: Some(frame.index), tracks: Arc::new(tracks) }],
            ground_truth: frame.ground_truth,
            frontend_ms,
        }
    }

    pub(in crate::session) fn main_tracks(&self) -> &Arc<TrackedFrame> {
        &self.images[0].tracks
    }

    /// True if its main camera has features in its image.
    pub(super) fn has_features(&self) -> bool {
        !self.main_tracks().features.is_empty()
    }

    /// Stamp of the images on the IMU's clock.
    pub(super) fn imu_stamp_ns(&self) -> i64 {
        self.imu.last().map_or(self.stamp_ns, |last| last.stamp_ns)
    }

    /// Memory in bytes without the main camera's tracks, which the step's record counts. Every run that shares the
    /// input counts it.
    pub(super) fn own_bytes(&self) -> usize {
        let further: usize = self.images.iter().skip(1).map(|image| tracks_bytes(&image.tracks)).sum();
        allocated_bytes(size_of::<Self>() + 2 * size_of::<usize>())
            + allocated_bytes(self.imu.capacity() * size_of::<ImuSample>())
            + allocated_bytes(self.imu_after.capacity() * size_of::<ImuSample>())
            + allocated_bytes(self.image_times_s.capacity() * size_of::<f64>())
            + allocated_bytes(self.gimbal_imu.capacity() * size_of::<ImuSample>())
            + self.joint_angles.as_ref().map_or(0, |angles| allocated_bytes(angles.heap_bytes()))
            + allocated_bytes(self.images.capacity() * size_of::<StepImage>())
            + further
    }
}

impl StepMeasurements for OwnedStepInput {
    fn stamp_ns(&self) -> i64 {
        self.stamp_ns
    }

    fn imu(&self) -> &[ImuSample] {
        &self.imu
    }

    fn gimbal_imu(&self) -> &[ImuSample] {
        &self.gimbal_imu
    }

    fn features(&self, camera: usize) -> &[TrackedFeature] {
        self.images.get(camera).map_or(&[], |image| &image.tracks.features)
    }

    fn matched(&self, camera: usize) -> &[TrackedFeature] {
        self.images.get(camera).map_or(&[], |image| &image.tracks.matched)
    }
}

/// Inputs of a run's steps so far, shared with its forks.
#[derive(Debug, Default)]
pub(in crate::session) struct StepInputs {
    state: Mutex<InputQueue>,
    grown: Condvar,
}

#[derive(Debug, Default)]
struct InputQueue {
    steps: Vec<Arc<OwnedStepInput>>,
    ended: bool,
}

impl StepInputs {
    /// Appends the input of the next step.
    pub(in crate::session) fn push(&self, input: Arc<OwnedStepInput>) {
        self.state.lock().steps.push(input);
        self.grown.notify_all();
    }

    /// Marks the end of the inputs, so that no reader waits for more.
    pub(in crate::session) fn end(&self) {
        self.state.lock().ended = true;
        self.grown.notify_all();
    }

    /// Input of a step, `None` if it has not been computed.
    pub(in crate::session) fn get(&self, step: usize) -> Option<Arc<OwnedStepInput>> {
        self.state.lock().steps.get(step).cloned()
    }

    /// Inputs of a range of steps; fewer if some have not been computed.
    pub(super) fn range(&self, steps: Range<usize>) -> Vec<Arc<OwnedStepInput>> {
        let state = self.state.lock();
        let end = steps.end.min(state.steps.len());
        state.steps[steps.start.min(end)..end].to_vec()
    }

    /// Input of a step. Blocks until it is available; `None` after the last one.
    pub(in crate::session) fn wait_for(&self, step: usize) -> Option<Arc<OwnedStepInput>> {
        let mut state = self.state.lock();
        self.grown.wait_while(&mut state, |state| state.steps.len() <= step && !state.ended);
        state.steps.get(step).cloned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_waiting_reader_receives_the_input_or_the_end() {
        let inputs = Arc::new(StepInputs::default());
        let waiting = Arc::clone(&inputs);
        let reader = std::thread::Builder::new().spawn(move || {
            let mut seen = Vec::new();
            while let Some(input) = waiting.wait_for(seen.len()) {
                seen.push(input.stamp_ns);
            }
            seen
        });
        let reader = reader.unwrap();
        for stamp_ns in [10, 20, 30] {
            inputs.push(Arc::new(OwnedStepInput {
                frame_index: 0,
                stamp_ns,
                log_time_ns: 0,
                imu: Vec::new(),
                imu_after: Vec::new(),
                image_times_s: Vec::new(),
                gimbal_imu: Vec::new(),
                joint_angles: None,
                images: vec![StepImage::default()],
                ground_truth: None,
                frontend_ms: 0.0,
            }));
        }
        inputs.end();
        assert_eq!(reader.join().unwrap(), [10, 20, 30]);
        assert!(inputs.get(3).is_none());
    }
}
