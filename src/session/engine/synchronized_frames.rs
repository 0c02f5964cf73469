//! Synchronized frame sets: images of several cameras with the same stamp, and the IMU samples since the previous set.

use std::sync::Arc;
use std::sync::mpsc::Receiver;

use thiserror::Error;

use super::step_inputs::OwnedStepInput;
use crate::sensors::ImuSample;

/// Largest difference of stamps in a synchronized frame set. At an angular rate of 3 rad/s the vehicle rotates by 0.1°
/// in that time, about one pixel.
const MAX_STAMP_DIFFERENCE_NS: i64 = 500_000;
/// Number of images of each camera without a partner after which the cameras count as not synchronized.
const MAX_UNPAIRED_IMAGES: usize = 10;
/// Offset of the indices of sets without an image of the main camera; larger than any index of the main camera.
const MISSING_IMAGE_OFFSET: usize = 1 << 30;

/// The reason why a run cannot use its cameras together.
#[derive(Debug, Error, PartialEq)]
#[error(
    "cameras {first} and {second} are not synchronized: images of {second} are {offset_ms:+.2} ms from those of {first} \
     (median of {count}, limit {:.1} ms); trigger both cameras together, correct timeshift_cam_imu in the rig if there \
     is a time offset, or use one camera each in two runs",
    MAX_STAMP_DIFFERENCE_NS as f64 * 1e-6
)]
pub(in crate::session) struct SynchronizationError {
    first: String,
    second: String,
    offset_ms: f64,
    count: usize,
}

#[derive(Debug)]
struct CameraInputs {
    key: String,
    inputs: Receiver<Arc<OwnedStepInput>>,
    next: Option<Arc<OwnedStepInput>>,
    ended: bool,
    /// Stamps of images since the last set with several images.
    unpaired_ns: Vec<i64>,
}

impl CameraInputs {
    fn wait(&mut self) {
        if self.next.is_none() && !self.ended {
            self.next = self.inputs.recv().ok();
            self.ended = self.next.is_none();
        }
    }

    /// Stamp of the next image, on the IMU's clock.
    fn next_ns(&self) -> Option<i64> {
        self.next.as_deref().map(OwnedStepInput::imu_stamp_ns)
    }
}

/// Step inputs of a run in time order, one per synchronized frame set.
#[derive(Debug)]
pub(super) struct SynchronizedFrames {
    cameras: Vec<CameraInputs>,
    /// Last IMU sample of the previous set.
    end: Option<ImuSample>,
    /// The same of the IMU on the gimbal; `None` where its samples are missing.
    gimbal_end: Option<ImuSample>,
    /// Offset of the IMU's clock from the main camera's, from its last image.
    main_shift_ns: Option<i64>,
}

impl SynchronizedFrames {
    /// Inputs of the run's cameras with their keys, the main camera first.
    pub(super) fn new(cameras: impl IntoIterator<Item = (String, Receiver<Arc<OwnedStepInput>>)>) -> Self {
        let cameras = cameras
            .into_iter()
            .map(|(key, inputs)| CameraInputs { key, inputs, next: None, ended: false, unpaired_ns: Vec::new() })
            .collect();
        Self { cameras, end: None, gimbal_end: None, main_shift_ns: None }
    }

    /// The next set; blocks until it is available. `None` at the end of all streams.
    pub(super) fn next(&mut self) -> Result<Option<Arc<OwnedStepInput>>, SynchronizationError> {
        self.cameras.iter_mut().for_each(CameraInputs::wait);
        if let [camera] = self.cameras.as_mut_slice() {
            return Ok(camera.next.take());
        }
        let Some(first_ns) = self.cameras.iter().filter_map(CameraInputs::next_ns).min() else { return Ok(None) };
        let mut frames = Vec::with_capacity(self.cameras.len());
        for camera in &mut self.cameras {
            let stamp_ns = camera.next_ns().filter(|stamp_ns| stamp_ns - first_ns <= MAX_STAMP_DIFFERENCE_NS);
            frames.push(if stamp_ns.is_some() { camera.next.take() } else { None });
            camera.unpaired_ns.extend(stamp_ns);
        }
        self.check_together(&frames)?;
        Ok(self.combined(&frames).map(Arc::new))
    }

    /// Merges the inputs of the cameras into one. Values common to all cameras are taken from the main camera if it has
    /// an image.
    fn combined(&mut self, frames: &[Option<Arc<OwnedStepInput>>]) -> Option<OwnedStepInput> {
        let main = frames.first()?.as_deref();
        let any = main.or_else(|| frames.iter().flatten().map(|frame| &**frame).next())?;
        if let Some(main) = main {
            self.main_shift_ns = Some(main.imu_stamp_ns() - main.stamp_ns);
        }
        // An input has the samples since the previous image of its own camera, but another camera may have had an image
        // since then.
        let imu = following(self.end, &any.imu);
        self.end = imu.last().copied().or(self.end);
        let gimbal_imu =
            if any.gimbal_imu.is_empty() { Vec::new() } else { following(self.gimbal_end, &any.gimbal_imu) };
        self.gimbal_end = gimbal_imu.last().copied();
        let tracks = |frame: &Option<Arc<OwnedStepInput>>| {
            frame.as_ref().map_or_else(Arc::default, |frame| Arc::clone(frame.main_tracks()))
        };
        Some(OwnedStepInput {
            frame_index: if main.is_some() { any.frame_index } else { MISSING_IMAGE_OFFSET + any.frame_index },
            stamp_ns: self.main_shift_ns.map_or(any.stamp_ns, |shift_ns| any.imu_stamp_ns() - shift_ns),
            log_time_ns: any.log_time_ns,
            imu,
            imu_after: any.imu_after.clone(),
            gimbal_imu,
            joint_angles: any.joint_angles.clone(),
            tracks: frames.iter().map(tracks).collect(),
            ground_truth: any.ground_truth,
            frontend_ms: frames.iter().flatten().map(|frame| frame.frontend_ms).sum(),
        })
    }

    fn check_together(&mut self, frames: &[Option<Arc<OwnedStepInput>>]) -> Result<(), SynchronizationError> {
        if frames.iter().flatten().count() > 1 {
            self.cameras.iter_mut().for_each(|camera| camera.unpaired_ns.clear());
        }
        let [first, second] = self.cameras.as_slice() else { return Ok(()) };
        if first.unpaired_ns.len().min(second.unpaired_ns.len()) < MAX_UNPAIRED_IMAGES {
            return Ok(());
        }
        let mut offsets_ns: Vec<i64> =
            second.unpaired_ns.iter().filter_map(|at| nearest_offset(*at, &first.unpaired_ns)).collect();
        offsets_ns.sort_unstable();
        Err(SynchronizationError {
            first: first.key.clone(),
            second: second.key.clone(),
            offset_ms: offsets_ns[offsets_ns.len() / 2] as f64 * 1e-6,
            count: offsets_ns.len(),
        })
    }
}

/// Samples after the end of the previous set, which comes first; all samples without one.
fn following(end: Option<ImuSample>, samples: &[ImuSample]) -> Vec<ImuSample> {
    match end {
        None => samples.to_vec(),
        Some(end) => std::iter::once(end)
            .chain(samples.iter().filter(|sample| sample.stamp_ns > end.stamp_ns).copied())
            .collect(),
    }
}

/// Signed offset of a stamp from the nearest of `others_ns`.
fn nearest_offset(at_ns: i64, others_ns: &[i64]) -> Option<i64> {
    others_ns.iter().map(|other_ns| at_ns - other_ns).min_by_key(|offset_ns| offset_ns.abs())
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::sync_channel;

    use nalgebra::Vector3;

    use super::*;
    use crate::frontend::TrackedFrame;

    const PERIOD_NS: i64 = 50_000_000;

    /// Images at these stamps, each with the IMU samples since the previous one at 200 Hz.
    fn images(stamps_ns: &[i64]) -> Receiver<Arc<OwnedStepInput>> {
        let (sender, receiver) = sync_channel(stamps_ns.len());
        let mut before_ns = 0;
        for (index, stamp_ns) in stamps_ns.iter().enumerate() {
            let sample = |stamp_ns: i64| ImuSample {
                stamp_ns,
                angular_velocity_rad_per_s: Vector3::zeros(),
                specific_force_m_per_s2: Vector3::new(0.0, 0.0, stamp_ns as f64),
            };
            let inside = (before_ns / 5_000_000 + 1..=(stamp_ns - 1) / 5_000_000).map(|number| number * 5_000_000);
            let imu = [before_ns].into_iter().chain(inside).chain([*stamp_ns]).map(sample).collect();
            before_ns = *stamp_ns;
            sender
                .send(Arc::new(OwnedStepInput {
                    frame_index: index,
                    stamp_ns: *stamp_ns,
                    log_time_ns: *stamp_ns,
                    imu,
                    imu_after: Vec::new(),
                    gimbal_imu: Vec::new(),
                    joint_angles: None,
                    tracks: vec![Arc::new(TrackedFrame { stamp_ns: *stamp_ns, ..TrackedFrame::default() })],
                    ground_truth: None,
                    frontend_ms: 1.0,
                }))
                .unwrap();
        }
        receiver
    }

    fn frame_sets(main_ns: &[i64], rigid_ns: &[i64]) -> SynchronizedFrames {
        SynchronizedFrames::new([("cam0".to_owned(), images(main_ns)), ("cam1".to_owned(), images(rigid_ns))])
    }

    fn periods(count: i64, shift_ns: i64) -> Vec<i64> {
        (1..=count).map(|number| number * PERIOD_NS + shift_ns).collect()
    }

    #[test]
    fn images_of_one_stamp_are_one_set_and_the_imu_samples_between_sets_have_no_gap() {
        let mut main_ns = periods(12, 0);
        let mut rigid_ns = periods(12, 300_000);
        main_ns.remove(4);
        rigid_ns.remove(7);
        rigid_ns.remove(8);
        let mut sets = frame_sets(&main_ns, &rigid_ns);
        let mut ends_ns = 0;
        let mut seen = Vec::new();
        while let Some(input) = sets.next().unwrap() {
            // Tracks of a missing image have stamp 0.
            let has = |camera: usize| input.tracks[camera].stamp_ns != 0;
            let imu = &input.imu;
            assert_eq!(imu[0].stamp_ns, ends_ns);
            assert!(imu.windows(2).all(|pair| pair[0].stamp_ns < pair[1].stamp_ns), "{imu:?}");
            ends_ns = imu.last().unwrap().stamp_ns;
            assert_eq!(ends_ns, input.stamp_ns);
            assert_eq!(input.frontend_ms, (0..2).filter(|camera| has(*camera)).count() as f64);
            seen.push([has(0), has(1)]);
            // The index of the main camera's image where there is one, else an index that no image of it has.
            assert_eq!(input.frame_index < MISSING_IMAGE_OFFSET, has(0));
        }
        assert_eq!(seen.len(), 12);
        assert_eq!((seen[4], seen[7], seen[9]), ([false, true], [true, false], [true, false]));
        assert_eq!(seen.iter().filter(|seen| **seen == [true, true]).count(), 9);
    }

    #[test]
    fn unsynchronized_cameras_are_rejected_with_their_offset() {
        let mut sets = frame_sets(&periods(40, 0), &periods(40, -12_300_000));
        let rejected = loop {
            match sets.next() {
                Ok(input) => assert!(input.is_some(), "not refused"),
                Err(rejected) => break rejected.to_string(),
            }
        };
        assert!(rejected.contains("cam1 are -12.30 ms") && rejected.contains("timeshift_cam_imu"), "{rejected}");
    }

    #[test]
    fn a_camera_that_starts_later_or_ends_earlier_leaves_the_others_alone() {
        let rigid_ns: Vec<i64> = periods(40, 0)[15..25].to_vec();
        let mut sets = frame_sets(&periods(40, 0), &rigid_ns);
        let mut count = 0;
        while sets.next().unwrap().is_some() {
            count += 1;
        }
        assert_eq!(count, 40);
    }
}
