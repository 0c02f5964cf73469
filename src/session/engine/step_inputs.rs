//! The inputs of a run's steps, kept for recomputation.

use std::ops::Range;
use std::sync::Arc;

use parking_lot::{Condvar, Mutex};

use crate::estimator::{StepMeasurements, StepReport, allocated_bytes};
use crate::files::scratch::ScratchFile;
use crate::flight_log::SensorFrame;
use crate::frontend::{TrackedFeature, TrackedFrame};
use crate::geometry::RigidTransform;
use crate::observability::RankReport;
use crate::sensors::{ImuSample, JointAngles};
use crate::session::record::{KeptTracks, StepImage, StepRecord, tracks_bytes};

/// Image of one camera in the input of a step, with its feature tracks.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::session) struct InputImage {
    /// Index in the camera's stream, `None` where the camera has no image in the step.
    pub(in crate::session) index: Option<usize>,
    pub(in crate::session) tracks: Arc<TrackedFrame>,
}

impl InputImage {
    fn recorded(&self) -> StepImage {
        StepImage { index: self.index, tracks: Arc::clone(&self.tracks).into() }
    }
}

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
    pub(in crate::session) images: Vec<InputImage>,
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
            tracks: Arc::clone(self.main_tracks()).into(),
            further_images: self.images[1..].iter().map(InputImage::recorded).collect(),
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
            images: vec![InputImage { index: Some(frame.index), tracks: Arc::new(tracks) }],
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

    /// Memory in bytes with all tracks.
    fn bytes(&self) -> usize {
        self.own_bytes() + tracks_bytes(self.main_tracks())
    }

    /// Memory in bytes without the main camera's tracks, which all runs on the camera share. It is counted for every run that
    /// shares the input.
    fn own_bytes(&self) -> usize {
        let further: usize = self.images.iter().skip(1).map(|image| tracks_bytes(&image.tracks)).sum();
        allocated_bytes(size_of::<Self>() + 2 * size_of::<usize>())
            + allocated_bytes(self.imu.capacity() * size_of::<ImuSample>())
            + allocated_bytes(self.imu_after.capacity() * size_of::<ImuSample>())
            + allocated_bytes(self.image_times_s.capacity() * size_of::<f64>())
            + allocated_bytes(self.gimbal_imu.capacity() * size_of::<ImuSample>())
            + self.joint_angles.as_ref().map_or(0, |angles| allocated_bytes(angles.heap_bytes()))
            + allocated_bytes(self.images.capacity() * size_of::<InputImage>())
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

/// Number of the newest inputs that stay in memory in any case; snapshots of the estimator look up measurements in them.
const NEWEST: usize = 320;

/// Inputs of a run's steps so far, shared with its forks. Beyond a budget the oldest are kept in a temporary file, so that
/// the memory of a run does not grow with every hour.
#[derive(Debug, Default)]
pub(in crate::session) struct StepInputs {
    state: Mutex<InputQueue>,
    grown: Condvar,
}

#[derive(Debug, Default)]
struct InputQueue {
    steps: Vec<InputPlace>,
    ended: bool,
    /// Number of the first inputs that are in the file.
    stored: usize,
    /// Memory of the others, and without the main camera's tracks.
    bytes: usize,
    own_bytes: usize,
    /// Budget for them, `None` for no limit.
    budget_bytes: Option<usize>,
    file: Option<ScratchFile>,
}

#[derive(Clone, Debug)]
enum InputPlace {
    Memory(Arc<OwnedStepInput>),
    File(Range<u64>),
}

impl InputQueue {
    fn get(&mut self, step: usize) -> Option<Arc<OwnedStepInput>> {
        match self.steps.get(step)? {
            InputPlace::Memory(input) => Some(Arc::clone(input)),
            InputPlace::File(place) => {
                // An input that cannot be read any more, as on a disk that is gone, is like one that is not computed.
                let bytes = self.file.as_mut()?.read(place).ok()?;
                OwnedStepInput::from_bytes(&bytes).map(Arc::new)
            }
        }
    }

    /// Moves the oldest inputs into the file until the others fit into their budget. Without space for the file they stay
    /// in memory.
    fn keep_within_budget(&mut self) {
        while self.budget_bytes.is_some_and(|budget| self.bytes > budget) && self.steps.len() > self.stored + NEWEST {
            let Some(InputPlace::Memory(input)) = self.steps.get(self.stored).cloned() else { return };
            if self.file.is_none() {
                self.file = ScratchFile::unnamed().ok();
            }
            let Some(place) = self.file.as_mut().and_then(|file| file.append(&input.to_bytes()).ok()) else {
                self.budget_bytes = None;
                return;
            };
            self.steps[self.stored] = InputPlace::File(place);
            self.stored += 1;
            self.bytes -= input.bytes();
            self.own_bytes -= input.own_bytes();
        }
    }
}

impl StepInputs {
    /// Appends the input of the next step.
    pub(in crate::session) fn push(&self, input: Arc<OwnedStepInput>) {
        let mut state = self.state.lock();
        state.bytes += input.bytes();
        state.own_bytes += input.own_bytes();
        state.steps.push(InputPlace::Memory(input));
        state.keep_within_budget();
        drop(state);
        self.grown.notify_all();
    }

    /// Marks the end of the inputs, so that no reader waits for more.
    pub(in crate::session) fn end(&self) {
        self.state.lock().ended = true;
        self.grown.notify_all();
    }

    /// Input of a step, `None` if it has not been computed.
    pub(in crate::session) fn get(&self, step: usize) -> Option<Arc<OwnedStepInput>> {
        self.state.lock().get(step)
    }

    /// Memory in bytes of the inputs that are not in the file, without the main camera's tracks.
    pub(in crate::session) fn own_bytes(&self) -> usize {
        self.state.lock().own_bytes
    }

    /// Memory in bytes of the main camera's tracks that are not in the file, which all runs on the camera share.
    pub(in crate::session) fn tracks_bytes(&self) -> usize {
        let state = self.state.lock();
        state.bytes - state.own_bytes
    }

    /// Sets the memory budget in bytes.
    pub(in crate::session) fn set_budget(&self, bytes: usize) {
        let mut state = self.state.lock();
        state.budget_bytes = Some(bytes);
        state.keep_within_budget();
    }

    /// Inputs of a range of steps; fewer if some have not been computed.
    pub(super) fn range(&self, steps: Range<usize>) -> Vec<Arc<OwnedStepInput>> {
        let mut state = self.state.lock();
        steps.map_while(|step| state.get(step)).collect()
    }

    /// Input of a step. Blocks until it is available; `None` after the last one.
    pub(in crate::session) fn wait_for(&self, step: usize) -> Option<Arc<OwnedStepInput>> {
        let mut state = self.state.lock();
        self.grown.wait_while(&mut state, |state| state.steps.len() <= step && !state.ended);
        state.get(step)
    }
}

impl KeptTracks for StepInputs {
    fn tracks(&self, step: usize, camera: usize) -> Option<Arc<TrackedFrame>> {
        Some(Arc::clone(&self.get(step)?.images.get(camera)?.tracks))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector2, Vector3};

    use super::*;
    use crate::frontend::{FeatureId, FrontEndStatistics};
    use crate::sensors::JointMotionFit;
    use crate::session::tests::memory::estimated;
    use crate::simulation::{SyntheticOptions, synthetic_tracks};

    /// Input with other values in every field by its number.
    fn rich(number: usize) -> OwnedStepInput {
        let value = |offset: usize| (number * 100 + offset) as f64 * 0.1;
        let vector = |offset: usize| Vector3::new(value(offset), -value(offset + 1), value(offset + 2));
        let imu = |offset: usize| ImuSample {
            stamp_ns: (number * 10 + offset) as i64,
            angular_velocity_rad_per_s: vector(offset),
            specific_force_m_per_s2: vector(offset + 3),
            unmeasured_s: value(offset),
        };
        let feature = |offset: usize| TrackedFeature {
            id: FeatureId((number + offset) as u64),
            age: offset as u32,
            uv_px: Vector2::new(value(offset), value(offset + 1)),
            previous_uv_px: (offset > 0).then(|| Vector2::new(value(offset), 0.5)),
            bearing: vector(offset),
        };
        let tracks = |offset: usize| TrackedFrame {
            stamp_ns: offset as i64,
            features: (0..30).map(|more| feature(offset + more)).collect(),
            matched: vec![feature(offset + 2)],
            statistics: FrontEndStatistics {
                tracked: number,
                detected: offset,
                lost: 3,
                rejected: 4,
                mean_parallax_px: value(5),
                median_flow_px: value(6),
            },
        };
        OwnedStepInput {
            frame_index: number,
            stamp_ns: number as i64 * 50,
            log_time_ns: -7,
            imu: vec![imu(0), imu(1)],
            imu_after: vec![imu(2)],
            image_times_s: vec![value(1), value(2)],
            gimbal_imu: vec![imu(3)],
            joint_angles: Some(JointAngles {
                angles_rad: vec![value(1)],
                sigmas_rad: vec![value(2)],
                lasting_sigmas_rad: vec![value(3)],
                rates_rad_per_s: vec![value(4)],
                motion_fits: vec![JointMotionFit {
                    rate_sigma_rad_per_s: f64::INFINITY,
                    acceleration_rad_per_s2: value(5),
                    acceleration_sigma_rad_per_s2: value(6),
                }],
            }),
            images: vec![
                InputImage { index: Some(number), tracks: Arc::new(tracks(0)) },
                InputImage { index: None, tracks: Arc::new(tracks(5)) },
            ],
            ground_truth: Some(RigidTransform::new(UnitQuaternion::from_euler_angles(0.1, value(1), 0.3), vector(7))),
            frontend_ms: value(9),
        }
    }

    #[test]
    fn an_input_is_restored_from_its_bytes_to_the_bit() {
        let without = OwnedStepInput { joint_angles: None, ground_truth: None, ..rich(3) };
        for input in [rich(1), without] {
            let bytes = input.to_bytes();
            assert_eq!(OwnedStepInput::from_bytes(&bytes), Some(input));
            assert_eq!(OwnedStepInput::from_bytes(&bytes[..bytes.len() - 1]), None);
            assert_eq!(OwnedStepInput::from_bytes(&[&bytes[..], &[0]].concat()), None);
        }
    }

    #[test]
    fn the_record_of_a_step_reads_tracks_that_are_no_longer_in_memory() {
        let flight = synthetic_tracks(&SyntheticOptions { duration_s: 0.2, ..SyntheticOptions::default() });
        let report = &estimated(&flight, "auto").steps[0].report;
        let inputs = Arc::new(StepInputs::default());
        let kept: Arc<dyn KeptTracks> = Arc::clone(&inputs) as _;
        inputs.set_budget(0);
        let records: Vec<StepRecord> = (0..=NEWEST)
            .map(|number| {
                let input = Arc::new(rich(number));
                inputs.push(Arc::clone(&input));
                let mut record = input.record(report.clone(), None);
                assert_ne!(record.tracks_bytes(), 0);
                record.keep_tracks_in(&kept, number);
                assert_eq!(record.tracks_bytes(), 0);
                record
            })
            .collect();
        assert_eq!(inputs.tracks_bytes(), NEWEST * tracks_bytes(rich(0).main_tracks()));
        for number in [0, 1, NEWEST] {
            let [record, same] = [&records[number], &records[number].clone()];
            let images = [&record.tracks, &record.further_images[0].tracks];
            for (image, expected) in images.into_iter().zip(&rich(number).images) {
                assert_eq!(image.frame(), expected.tracks, "{number}");
                assert_eq!((image.stamp_ns, image.count), (expected.tracks.stamp_ns, expected.tracks.features.len()));
            }
            assert!(record.tracks.is_same(&same.tracks) && !record.tracks.is_same(&record.further_images[0].tracks));
        }
    }

    #[test]
    fn inputs_beyond_the_budget_are_read_from_the_file() {
        let inputs = StepInputs::default();
        let count = 3 * NEWEST;
        inputs.push(Arc::new(rich(0)));
        let one = inputs.own_bytes();
        inputs.set_budget(0);
        (1..count).for_each(|number| inputs.push(Arc::new(rich(number))));
        assert_eq!(inputs.own_bytes(), one * NEWEST, "of {one} bytes each");
        for number in [0, 1, NEWEST, 2 * NEWEST - 1, 2 * NEWEST, count - 1] {
            assert_eq!(inputs.get(number).as_deref(), Some(&rich(number)), "{number}");
        }
        assert_eq!(inputs.range(2 * NEWEST - 2..2 * NEWEST + 2).len(), 4);
        assert_eq!(inputs.range(count - 1..count + 5).len(), 1);
        assert_eq!(inputs.get(count), None);
        let unlimited = StepInputs::default();
        unlimited.set_budget(usize::MAX);
        (0..count).for_each(|number| unlimited.push(Arc::new(rich(number))));
        assert_eq!(unlimited.own_bytes(), one * count);
    }

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
                images: vec![InputImage::default()],
                ground_truth: None,
                frontend_ms: 0.0,
            }));
        }
        inputs.end();
        assert_eq!(reader.join().unwrap(), [10, 20, 30]);
        assert!(inputs.get(3).is_none());
    }
}
