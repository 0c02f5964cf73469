//! The instants at which a run takes a step: the images that its cameras took together, and the motion since the instant
//! before.

use std::sync::Arc;
use std::sync::mpsc::Receiver;

use thiserror::Error;

use super::tracker::TrackedSensorFrame;
use crate::frontend::TrackedFrame;
use crate::geometry::RigidTransform;
use crate::sensors::{ImuSample, JointAngles};

/// Images further apart were not taken together. A vehicle that turns by 3 rad/s turns by 0.1° meanwhile, a pixel.
const TOGETHER_NS: i64 = 500_000;
/// So many images of each camera without any pair, and the cameras are not synchronized.
const LONE_IMAGES: usize = 10;
/// Images of other cameras are counted from here where the main one has none: no camera has taken so many.
const BESIDE_MAIN: usize = 1 << 30;

/// Why a run cannot watch its cameras together.
#[derive(Debug, Error, PartialEq)]
#[error(
    "the images of {first} and {second} were not taken together: those of {second} are {offset_ms:+.2} ms from those of \
     {first} (median of {count}, at most {:.1} ms is allowed); trigger both cameras at once, or correct \
     timeshift_cam_imu in the rig if a clock is off, or let two runs watch one camera each",
    TOGETHER_NS as f64 * 1e-6
)]
pub(in crate::session) struct NotSynchronized {
    first: String,
    second: String,
    offset_ms: f64,
    count: usize,
}

/// What a run is given for one step.
#[derive(Clone, Debug)]
pub(in crate::session) struct Instant {
    /// By camera of the run, the main one's first; at least one is there.
    frames: Vec<Option<Arc<TrackedSensorFrame>>>,
    /// Header stamp since the log began, on the main camera's clock.
    stamp_ns: i64,
    /// Since the instant before, where that is not what an image brings.
    motion: Option<Vec<ImuSample>>,
}

impl Instant {
    /// An instant of a run that watches one camera.
    #[cfg(test)]
    pub(in crate::session) fn of_one(frame: Arc<TrackedSensorFrame>) -> Self {
        Self { stamp_ns: frame.frame.stamp_ns, frames: vec![Some(frame)], motion: None }
    }

    /// The image that tells what all cameras share: the main camera's where there is one.
    fn any(&self) -> &TrackedSensorFrame {
        self.frames.iter().flatten().next().expect("an instant has an image")
    }

    /// Number of the main camera's image; where it is missing, one that no image has.
    pub(in crate::session) fn frame_index(&self) -> usize {
        let index = self.any().frame.index;
        if self.frames[0].is_some() { index } else { BESIDE_MAIN + index }
    }

    /// Header stamp since the log began, on the main camera's clock.
    pub(in crate::session) fn stamp_ns(&self) -> i64 {
        self.stamp_ns
    }

    /// Log time since the log began.
    pub(in crate::session) fn log_time_ns(&self) -> i64 {
        self.any().frame.log_time_ns
    }

    /// Inertial samples since the instant before.
    pub(in crate::session) fn imu(&self) -> &[ImuSample] {
        self.motion.as_deref().unwrap_or(&self.any().frame.imu)
    }

    /// Encoder angles at the stamp.
    pub(in crate::session) fn joint_angles(&self) -> Option<&JointAngles> {
        self.any().frame.joint_angles.as_ref()
    }

    /// True pose of the IMU.
    pub(in crate::session) fn truth(&self) -> Option<RigidTransform> {
        self.any().frame.truth
    }

    /// Tracks of a camera of the run, `None` without an image.
    pub(in crate::session) fn tracks(&self, camera: usize) -> Option<&Arc<TrackedFrame>> {
        self.frames.get(camera)?.as_ref().map(|tracked| &tracked.tracks)
    }

    /// Number of cameras that the run watches.
    pub(in crate::session) fn cameras(&self) -> usize {
        self.frames.len()
    }

    /// What the front ends of all its images took.
    pub(in crate::session) fn frontend_ms(&self) -> f64 {
        self.frames.iter().flatten().map(|tracked| tracked.frontend_ms).sum()
    }
}

/// One camera's images on their way to a run.
#[derive(Debug)]
struct CameraImages {
    key: String,
    images: Receiver<Arc<TrackedSensorFrame>>,
    next: Option<Arc<TrackedSensorFrame>>,
    ended: bool,
    /// When images were taken since the last that was taken together with another camera's.
    lone_ns: Vec<i64>,
}

impl CameraImages {
    fn wait(&mut self) {
        if self.next.is_none() && !self.ended {
            self.next = self.images.recv().ok();
            self.ended = self.next.is_none();
        }
    }

    /// When the next image was taken, on the clock of the IMU.
    fn next_ns(&self) -> Option<i64> {
        self.next.as_deref().map(taken_ns)
    }
}

/// The instants of a run in time order.
#[derive(Debug)]
pub(in crate::session) struct Instants {
    cameras: Vec<CameraImages>,
    /// Inertial sample at the end of the last instant.
    end: Option<ImuSample>,
    /// How far the IMU's clock is ahead of the main camera's, once an image of it has told.
    main_shift_ns: Option<i64>,
}

impl Instants {
    /// From the images of the run's cameras by their keys, the main camera's first.
    pub(in crate::session) fn new(
        cameras: impl IntoIterator<Item = (String, Receiver<Arc<TrackedSensorFrame>>)>,
    ) -> Self {
        let cameras = cameras
            .into_iter()
            .map(|(key, images)| CameraImages { key, images, next: None, ended: false, lone_ns: Vec::new() })
            .collect();
        Self { cameras, end: None, main_shift_ns: None }
    }

    /// Waits for the next instant, `None` at the end of all streams.
    pub(in crate::session) fn next(&mut self) -> Result<Option<Instant>, NotSynchronized> {
        self.cameras.iter_mut().for_each(CameraImages::wait);
        let Some(first_ns) = self.cameras.iter().filter_map(CameraImages::next_ns).min() else { return Ok(None) };
        let mut frames = Vec::with_capacity(self.cameras.len());
        for camera in &mut self.cameras {
            let taken_ns = camera.next_ns().filter(|taken_ns| taken_ns - first_ns <= TOGETHER_NS);
            frames.push(if taken_ns.is_some() { camera.next.take() } else { None });
            camera.lone_ns.extend(taken_ns);
        }
        self.check_together(&frames)?;
        if let Some(main) = &frames[0] {
            self.main_shift_ns = Some(taken_ns(main) - main.frame.stamp_ns);
        }
        let mut instant = Instant { frames, stamp_ns: 0, motion: None };
        let image = instant.any();
        instant.stamp_ns = self.main_shift_ns.map_or(image.frame.stamp_ns, |shift_ns| taken_ns(image) - shift_ns);
        if self.cameras.len() > 1 {
            let motion = self.motion_to(&instant);
            self.end = motion.last().copied().or(self.end);
            instant.motion = Some(motion);
        }
        Ok(Some(instant))
    }

    /// An image brings the samples since the image before it of the same camera, which another one may have followed.
    fn motion_to(&self, instant: &Instant) -> Vec<ImuSample> {
        let samples = &instant.any().frame.imu;
        let Some(end) = self.end else { return samples.clone() };
        std::iter::once(end).chain(samples.iter().filter(|sample| sample.stamp_ns > end.stamp_ns).copied()).collect()
    }

    fn check_together(&mut self, frames: &[Option<Arc<TrackedSensorFrame>>]) -> Result<(), NotSynchronized> {
        if frames.iter().flatten().count() > 1 {
            self.cameras.iter_mut().for_each(|camera| camera.lone_ns.clear());
        }
        let [first, second] = self.cameras.as_slice() else { return Ok(()) };
        if first.lone_ns.len().min(second.lone_ns.len()) < LONE_IMAGES {
            return Ok(());
        }
        let mut offsets_ns: Vec<i64> =
            second.lone_ns.iter().filter_map(|at| nearest_offset(*at, &first.lone_ns)).collect();
        offsets_ns.sort_unstable();
        Err(NotSynchronized {
            first: first.key.clone(),
            second: second.key.clone(),
            offset_ms: offsets_ns[offsets_ns.len() / 2] as f64 * 1e-6,
            count: offsets_ns.len(),
        })
    }
}

/// When an image was taken, on the clock of the IMU.
fn taken_ns(image: &TrackedSensorFrame) -> i64 {
    image.frame.imu.last().map_or(image.frame.stamp_ns, |last| last.stamp_ns)
}

/// How much later an instant is than the nearest of others.
fn nearest_offset(at_ns: i64, others_ns: &[i64]) -> Option<i64> {
    others_ns.iter().map(|other_ns| at_ns - other_ns).min_by_key(|offset_ns| offset_ns.abs())
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::sync_channel;

    use nalgebra::Vector3;

    use super::*;
    use crate::flight_log::SensorFrame;
    use crate::sensors::GrayImage;

    const PERIOD_NS: i64 = 50_000_000;

    /// Images at these stamps, each with the samples since the one before at 200 Hz.
    fn images(stamps_ns: &[i64]) -> Receiver<Arc<TrackedSensorFrame>> {
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
            let frame = SensorFrame {
                index,
                stamp_ns: *stamp_ns,
                log_time_ns: *stamp_ns,
                image: Arc::new(GrayImage { width: 0, height: 0, pixels: Vec::new() }),
                imu,
                joint_angles: None,
                truth: None,
                warnings: Vec::new(),
            };
            let tracks = Arc::new(TrackedFrame { stamp_ns: *stamp_ns, ..TrackedFrame::default() });
            sender.send(Arc::new(TrackedSensorFrame { frame, tracks, frontend_ms: 1.0 })).unwrap();
        }
        receiver
    }

    fn instants(main_ns: &[i64], rigid_ns: &[i64]) -> Instants {
        Instants::new([("cam0".to_owned(), images(main_ns)), ("cam1".to_owned(), images(rigid_ns))])
    }

    fn periods(count: i64, shift_ns: i64) -> Vec<i64> {
        (1..=count).map(|number| number * PERIOD_NS + shift_ns).collect()
    }

    #[test]
    fn images_of_one_stamp_are_one_instant_and_the_motion_between_instants_has_no_gap() {
        let mut main_ns = periods(12, 0);
        let mut rigid_ns = periods(12, 300_000);
        main_ns.remove(4);
        rigid_ns.remove(7);
        rigid_ns.remove(8);
        let mut instants = instants(&main_ns, &rigid_ns);
        let mut ends_ns = 0;
        let mut seen = Vec::new();
        while let Some(instant) = instants.next().unwrap() {
            let imu = instant.imu();
            assert_eq!(imu[0].stamp_ns, ends_ns);
            assert!(imu.windows(2).all(|pair| pair[0].stamp_ns < pair[1].stamp_ns), "{imu:?}");
            ends_ns = imu.last().unwrap().stamp_ns;
            assert_eq!(ends_ns, instant.stamp_ns());
            assert_eq!(instant.frontend_ms(), (0..2).filter(|camera| instant.tracks(*camera).is_some()).count() as f64);
            seen.push([instant.tracks(0).is_some(), instant.tracks(1).is_some()]);
            // The main camera's image where there is one, else a number that no image of it has.
            assert_eq!(instant.frame_index() < BESIDE_MAIN, instant.tracks(0).is_some());
        }
        assert_eq!(seen.len(), 12);
        assert_eq!((seen[4], seen[7], seen[9]), ([false, true], [true, false], [true, false]));
        assert_eq!(seen.iter().filter(|seen| **seen == [true, true]).count(), 9);
    }

    #[test]
    fn cameras_that_are_not_synchronized_are_refused_with_their_offset() {
        let mut instants = instants(&periods(40, 0), &periods(40, -12_300_000));
        let refused = loop {
            match instants.next() {
                Ok(instant) => assert!(instant.is_some(), "not refused"),
                Err(refused) => break refused.to_string(),
            }
        };
        assert!(refused.contains("cam1 are -12.30 ms") && refused.contains("timeshift_cam_imu"), "{refused}");
    }

    #[test]
    fn a_camera_that_starts_later_or_ends_earlier_leaves_the_others_alone() {
        let rigid_ns: Vec<i64> = periods(40, 0)[15..25].to_vec();
        let mut instants = instants(&periods(40, 0), &rigid_ns);
        let mut count = 0;
        while instants.next().unwrap().is_some() {
            count += 1;
        }
        assert_eq!(count, 40);
    }
}
