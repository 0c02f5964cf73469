//! Frame sets of a run with several cameras: the images of one moment, or the images next to each image of one camera,
//! and the IMU samples since the previous set.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::Receiver;

use super::frame_camera::{FrameCamera, TOGETHER_NS};
use super::step_inputs::{InputImage, OwnedStepInput};
use crate::estimator::OTHER_CAMERA_FRAMES;
use crate::geometry::seconds_from_ns;
use crate::sensors::ImuSample;

/// Images of one camera of a run.
#[derive(Debug)]
struct CameraInputs {
    inputs: Receiver<Arc<OwnedStepInput>>,
    /// Received images that are in no set yet.
    waiting: VecDeque<Arc<OwnedStepInput>>,
    ended: bool,
}

impl CameraInputs {
    fn new(inputs: Receiver<Arc<OwnedStepInput>>) -> Self {
        Self { inputs, waiting: VecDeque::new(), ended: false }
    }

    /// Receives images until `count` are waiting, or the stream ends.
    fn wait(&mut self, count: usize) {
        self.wait_while(|waiting| waiting.len() < count);
    }

    fn wait_while(&mut self, is_short: impl Fn(&VecDeque<Arc<OwnedStepInput>>) -> bool) {
        while !self.ended && is_short(&self.waiting) {
            match self.inputs.recv() {
                Ok(input) => self.waiting.push_back(input),
                Err(_) => self.ended = true,
            }
        }
    }

    /// Stamp of a waiting image on the IMU's clock.
    fn stamp_ns(&self, place: usize) -> Option<i64> {
        self.waiting.get(place).map(|input| input.imu_stamp_ns())
    }
}

/// Step inputs of a run in time order, one per set.
#[derive(Debug)]
pub(super) struct FrameSets {
    cameras: Vec<CameraInputs>,
    /// Camera whose images have a set each; `None` if the cameras are triggered together.
    frame_camera: Option<FrameCamera>,
    /// Last IMU sample of the previous set.
    end: Option<ImuSample>,
    /// The same of the IMU on the gimbal; `None` where its samples are missing.
    gimbal_end: Option<ImuSample>,
    /// IMU samples after the previous set's frame, until its last image; needed where the next frame lies at the image of
    /// another camera.
    after_frame: Vec<ImuSample>,
    /// Offset of the IMU's clock from the main camera's, from its last image.
    main_shift_ns: Option<i64>,
}

impl FrameSets {
    /// Inputs of the run's cameras, the main camera first.
    pub(super) fn new(
        inputs: impl IntoIterator<Item = Receiver<Arc<OwnedStepInput>>>,
        frame_camera: Option<FrameCamera>,
    ) -> Self {
        let cameras = inputs.into_iter().map(CameraInputs::new).collect();
        Self { cameras, frame_camera, end: None, gimbal_end: None, after_frame: Vec::new(), main_shift_ns: None }
    }

    /// The next set; blocks until it is available. `None` at the end of all streams.
    pub(super) fn next(&mut self) -> Option<Arc<OwnedStepInput>> {
        if let [camera] = self.cameras.as_mut_slice() {
            camera.wait(1);
            return camera.waiting.pop_front();
        }
        let set = match self.frame_camera {
            Some(frame_camera) => self.next_of(frame_camera),
            None => self.next_together(),
        }?;
        Some(Arc::new(self.combined(&set)))
    }

    /// Images with the earliest stamp.
    fn next_together(&mut self) -> Option<FrameSet> {
        self.cameras.iter_mut().for_each(|camera| camera.wait(1));
        let first_ns = self.cameras.iter().filter_map(|camera| camera.stamp_ns(0)).min()?;
        let is_of_set = |stamp_ns: i64| stamp_ns - first_ns <= TOGETHER_NS;
        let images: Vec<_> = self
            .cameras
            .iter_mut()
            .map(|camera| camera.stamp_ns(0).is_some_and(is_of_set).then(|| camera.waiting.pop_front()).flatten())
            .collect();
        let frame = images.iter().position(Option::is_some)?;
        Some(FrameSet { images, frame })
    }

    /// The next image of a camera with the nearest image of each other one; or an image that is far from all of them.
    fn next_of(&mut self, FrameCamera { camera: frame, reach_ns }: FrameCamera) -> Option<FrameSet> {
        self.cameras[frame].wait(2);
        let at_ns = self.cameras[frame].stamp_ns(0);
        // Images up to the middle between this frame and the next belong to this one.
        let until_ns = at_ns.map(|at_ns| {
            let half_ns = self.cameras[frame].stamp_ns(1).map(|next_ns| (next_ns - at_ns) / 2);
            at_ns + half_ns.map_or(reach_ns, |half_ns| half_ns.min(reach_ns))
        });
        let others: Vec<usize> = (0..self.cameras.len()).filter(|camera| *camera != frame).collect();
        for camera in &others {
            let is_short = |waiting: &VecDeque<Arc<OwnedStepInput>>| {
                waiting.back().is_none_or(|last| until_ns.is_some_and(|until_ns| last.imu_stamp_ns() < until_ns))
            };
            self.cameras[*camera].wait_while(is_short);
        }
        let first = |camera: &usize| Some((self.cameras[*camera].stamp_ns(0)?, *camera));
        let is_alone = |(stamp_ns, _): &(i64, usize)| at_ns.is_none_or(|at_ns| *stamp_ns < at_ns - reach_ns);
        let earliest = others.iter().filter_map(first).min().filter(is_alone);
        let mut images: Vec<Option<Arc<OwnedStepInput>>> = vec![None; self.cameras.len()];
        if let Some((_, camera)) = earliest {
            images[camera] = self.cameras[camera].waiting.pop_front();
            return Some(FrameSet { images, frame: camera });
        }
        let (at_ns, until_ns) = at_ns.zip(until_ns)?;
        images[frame] = self.cameras[frame].waiting.pop_front();
        for camera in others {
            let waiting = &mut self.cameras[camera].waiting;
            let count = waiting.partition_point(|input| input.imu_stamp_ns() < until_ns);
            images[camera] = waiting.drain(..count).min_by_key(|input| (input.imu_stamp_ns() - at_ns).abs());
        }
        // Without a feature in its image, as behind a lens cap, the frame lies at the image of another camera.
        let sees = |camera: &usize| images[*camera].as_ref().is_some_and(|image| image.has_features());
        let frame = std::iter::once(frame).chain(0..images.len()).find(sees).unwrap_or(frame);
        Some(FrameSet { images, frame })
    }

    /// Merges the inputs of the cameras into one.
    fn combined(&mut self, set: &FrameSet) -> OwnedStepInput {
        let main = set.images[0].as_deref();
        let frame = set.frame_image();
        if let Some(main) = main {
            self.main_shift_ns = Some(main.imu_stamp_ns() - main.stamp_ns);
        }
        // An input has the samples since the previous image of its own camera, but another camera may have had an image
        // since then.
        let begins_later = frame.imu.first().zip(self.end).is_some_and(|(first, end)| first.stamp_ns > end.stamp_ns);
        let imu = if begins_later && !self.after_frame.is_empty() {
            following(self.end, &merged([self.after_frame.as_slice(), &frame.imu]))
        } else {
            following(self.end, &frame.imu)
        };
        let is_interleaved = self.frame_camera.is_some();
        let imu_after = if is_interleaved { set.imu_after() } else { frame.imu_after.clone() };
        if is_interleaved {
            self.after_frame.clone_from(&imu_after);
        }
        self.end = imu.last().copied().or(self.end);
        let gimbal_imu =
            if frame.gimbal_imu.is_empty() { Vec::new() } else { following(self.gimbal_end, &frame.gimbal_imu) };
        self.gimbal_end = gimbal_imu.last().copied();
        let image = |image: &Option<Arc<OwnedStepInput>>| {
            image.as_ref().map_or_else(InputImage::default, |image| image.images[0].clone())
        };
        OwnedStepInput {
            frame_index: main.map_or(OTHER_CAMERA_FRAMES * set.frame + frame.frame_index, |main| main.frame_index),
            stamp_ns: self.main_shift_ns.map_or(frame.stamp_ns, |shift_ns| frame.imu_stamp_ns() - shift_ns),
            log_time_ns: frame.log_time_ns,
            imu,
            imu_after,
            image_times_s: if is_interleaved { set.image_times_s() } else { Vec::new() },
            gimbal_imu,
            joint_angles: main.unwrap_or(frame).joint_angles.clone(),
            images: set.images.iter().map(image).collect(),
            ground_truth: frame.ground_truth,
            frontend_ms: set.images.iter().flatten().map(|image| image.frontend_ms).sum(),
        }
    }
}

/// Images of one step.
#[derive(Debug)]
struct FrameSet {
    /// By camera, `None` where an image is missing.
    images: Vec<Option<Arc<OwnedStepInput>>>,
    /// Camera at whose image the frame lies.
    frame: usize,
}

impl FrameSet {
    fn frame_image(&self) -> &OwnedStepInput {
        self.images[self.frame].as_deref().expect("a set has an image at its frame")
    }

    /// Stamps of the images after the frame's in seconds, by camera; empty if all have its stamp.
    fn image_times_s(&self) -> Vec<f64> {
        let at_ns = self.frame_image().imu_stamp_ns();
        let time_s = |image: &Option<Arc<OwnedStepInput>>| {
            image.as_ref().map_or(0.0, |image| seconds_from_ns(image.imu_stamp_ns() - at_ns))
        };
        let times_s: Vec<f64> = self.images.iter().map(time_s).collect();
        if times_s.iter().all(|time_s| *time_s == 0.0) { Vec::new() } else { times_s }
    }

    /// IMU samples from the frame's stamp until the last image of the set is exposed.
    fn imu_after(&self) -> Vec<ImuSample> {
        let frame = self.frame_image();
        let Some(at) = frame.imu.last() else { return Vec::new() };
        let of_images = self.images.iter().flatten().flat_map(|image| [image.imu.as_slice(), &image.imu_after]);
        let samples = merged(of_images).into_iter().filter(|sample| sample.stamp_ns > at.stamp_ns);
        std::iter::once(*at).chain(samples).collect()
    }
}

/// Samples in time order, each stamp once.
fn merged<'a>(samples: impl IntoIterator<Item = &'a [ImuSample]>) -> Vec<ImuSample> {
    let mut samples: Vec<ImuSample> = samples.into_iter().flatten().copied().collect();
    samples.sort_by_key(|sample| sample.stamp_ns);
    samples.dedup_by_key(|sample| sample.stamp_ns);
    samples
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

#[cfg(test)]
mod tests {
    use std::sync::mpsc::sync_channel;

    use nalgebra::{Vector2, Vector3};

    use super::*;
    use crate::frontend::{FeatureId, TrackedFeature, TrackedFrame};

    const PERIOD_NS: i64 = 50_000_000;

    /// Images at these stamps, each with the IMU samples since the previous one at 200 Hz.
    fn images(stamps_ns: &[i64]) -> Receiver<Arc<OwnedStepInput>> {
        images_with_features(stamps_ns, false)
    }

    fn images_with_features(stamps_ns: &[i64], sees: bool) -> Receiver<Arc<OwnedStepInput>> {
        let feature = TrackedFeature {
            id: FeatureId(1),
            age: 0,
            uv_px: Vector2::zeros(),
            previous_uv_px: None,
            bearing: Vector3::z(),
        };
        let features = if sees { vec![feature] } else { Vec::new() };
        let (sender, receiver) = sync_channel(stamps_ns.len());
        let mut before_ns = 0;
        for (index, stamp_ns) in stamps_ns.iter().enumerate() {
            let sample = |stamp_ns: i64| ImuSample {
                stamp_ns,
                angular_velocity_rad_per_s: Vector3::zeros(),
                specific_force_m_per_s2: Vector3::new(0.0, 0.0, stamp_ns as f64),
                unmeasured_s: 0.0,
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
                    image_times_s: Vec::new(),
                    gimbal_imu: Vec::new(),
                    joint_angles: None,
                    images: vec![InputImage {
                        index: Some(index),
                        tracks: Arc::new(TrackedFrame {
                            stamp_ns: *stamp_ns,
                            features: features.clone(),
                            ..TrackedFrame::default()
                        }),
                    }],
                    ground_truth: None,
                    frontend_ms: 1.0,
                }))
                .unwrap();
        }
        receiver
    }

    fn frame_sets(main_ns: &[i64], rigid_ns: &[i64]) -> FrameSets {
        FrameSets::new([images(main_ns), images(rigid_ns)], None)
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
        while let Some(input) = sets.next() {
            // Tracks of a missing image have stamp 0.
            let has = |camera: usize| input.images[camera].tracks.stamp_ns != 0;
            let imu = &input.imu;
            assert_eq!(imu[0].stamp_ns, ends_ns);
            assert!(imu.windows(2).all(|pair| pair[0].stamp_ns < pair[1].stamp_ns), "{imu:?}");
            ends_ns = imu.last().unwrap().stamp_ns;
            assert_eq!(ends_ns, input.stamp_ns);
            assert_eq!(input.frontend_ms, (0..2).filter(|camera| has(*camera)).count() as f64);
            seen.push([has(0), has(1)]);
            // The index of the main camera's image where there is one, else an index that no image of it has.
            assert_eq!(input.frame_index < OTHER_CAMERA_FRAMES, has(0));
        }
        assert_eq!(seen.len(), 12);
        assert_eq!((seen[4], seen[7], seen[9]), ([false, true], [true, false], [true, false]));
        assert_eq!(seen.iter().filter(|seen| **seen == [true, true]).count(), 9);
    }

    /// Stamps of the images of each set of interleaved cameras in milliseconds, `None` where one is missing.
    fn interleaved_ms(main_ns: &[i64], rigid_ns: &[i64], frame_camera: usize) -> Vec<[Option<i64>; 2]> {
        sets_ms([images(main_ns), images(rigid_ns)], frame_camera)
    }

    fn sets_ms(inputs: [Receiver<Arc<OwnedStepInput>>; 2], frame_camera: usize) -> Vec<[Option<i64>; 2]> {
        let mut sets = FrameSets::new(inputs, Some(FrameCamera { camera: frame_camera, reach_ns: 30_000_000 }));
        let (mut end_ns, mut seen) = (0, Vec::new());
        while let Some(input) = sets.next() {
            assert_eq!(input.imu[0].stamp_ns, end_ns, "a gap");
            let gap = input.imu.windows(2).find(|pair| pair[1].stamp_ns - pair[0].stamp_ns > 5_000_000);
            assert!(gap.is_none(), "a gap: {gap:?}");
            end_ns = input.imu.last().unwrap().stamp_ns;
            let stamps_ns: Vec<i64> = input.images.iter().map(|image| image.tracks.stamp_ns).collect();
            for (camera, stamp_ns) in stamps_ns.iter().enumerate().filter(|(_, stamp_ns)| **stamp_ns != 0) {
                let time_s = input.image_times_s.get(camera).copied().unwrap_or(0.0);
                assert!((seconds_from_ns(stamp_ns - end_ns) - time_s).abs() < 1e-12);
                assert!(input.imu_after.last().unwrap().stamp_ns >= *stamp_ns, "{:?}", input.imu_after);
            }
            assert_eq!(input.imu_after[0].stamp_ns, end_ns);
            assert!(input.imu_after.windows(2).all(|pair| pair[0].stamp_ns < pair[1].stamp_ns));
            let of = |stamp_ns: i64| (stamp_ns != 0).then_some(stamp_ns / 1_000_000);
            seen.push([of(stamps_ns[0]), of(stamps_ns[1])]);
        }
        seen
    }

    #[test]
    fn each_image_of_the_frame_camera_has_the_nearest_image_of_the_other() {
        let seen = interleaved_ms(&periods(6, -20_000_000), &periods(6, 0), 1);
        assert_eq!(seen.len(), 6);
        assert!(seen.iter().all(|[main, rigid]| main.unwrap() + 20 == rigid.unwrap()), "{seen:?}");
        // Of a faster camera one image each remains (the first one is far from any frame), and a slower one leaves frames without it.
        let fast: Vec<i64> = (1..=18).map(|number| number * PERIOD_NS / 3 + 3_000_000).collect();
        let seen = interleaved_ms(&fast, &periods(6, 0), 1);
        assert_eq!(seen[1..].iter().map(|[main, rigid]| main.unwrap() - rigid.unwrap()).collect::<Vec<_>>(), [3; 6]);
        let seen = interleaved_ms(&periods(6, 3_000_000), &fast, 1);
        assert_eq!((seen.len(), seen.iter().filter(|[main, _]| main.is_some()).count()), (18, 6));
    }

    #[test]
    fn images_without_a_frame_near_them_are_sets_of_their_own() {
        let main_ns = periods(24, 10_000_000);
        let mut rigid_ns = periods(24, 0);
        rigid_ns.drain(8..16);
        let seen = interleaved_ms(&main_ns, &rigid_ns, 1);
        let (alone, missing) =
            (seen.iter().filter(|[_, rigid]| rigid.is_none()), seen.iter().filter(|[main, _]| main.is_none()));
        assert_eq!((alone.count(), missing.count()), (8, 0), "{seen:?}");
        assert!(seen.windows(2).all(|pair| pair[0].iter().max() < pair[1].iter().max()), "{seen:?}");
    }

    #[test]
    fn frames_lie_at_the_images_of_another_camera_where_those_of_the_frame_camera_have_no_features() {
        let inputs = [images_with_features(&periods(8, 20_000_000), true), images(&periods(8, 0))];
        let mut sets = FrameSets::new(inputs, Some(FrameCamera { camera: 1, reach_ns: 30_000_000 }));
        let stamps_ns: Vec<i64> = std::iter::from_fn(|| sets.next()).map(|input| input.imu_stamp_ns()).collect();
        assert_eq!(stamps_ns, periods(8, 20_000_000));
        let inputs = [images_with_features(&periods(8, 20_000_000), true), images(&periods(8, 0))];
        assert!(sets_ms(inputs, 1).iter().all(|[main, rigid]| main.unwrap() - rigid.unwrap() == 20));
    }

    #[test]
    fn a_camera_that_starts_later_or_ends_earlier_leaves_the_others_alone() {
        let rigid_ns: Vec<i64> = periods(40, 0)[15..25].to_vec();
        let mut sets = frame_sets(&periods(40, 0), &rigid_ns);
        let mut count = 0;
        while sets.next().is_some() {
            count += 1;
        }
        assert_eq!(count, 40);
    }
}
