//! A camera of the window at one estimate: its model, and its pose at each observation of a track.

use std::borrow::Cow;
use std::cell::OnceCell;

use nalgebra::{Matrix2x6, Vector2, Vector3};

use super::calibrations::Calibrations;
use super::camera_pose::{self, CameraCalibration, ROLLING_ROWS};
use super::frame_state::FrameState;
use crate::camera::CameraModel;
use crate::optimization::{CameraPose, PoseBlocksOf, RelativePose, RelativePoses};

/// Blocks per frame of a rolling shutter.
pub(crate) const ROLLING_BLOCKS: usize = ROLLING_ROWS.len();

/// Camera with its intrinsics and poses at an estimate.
///
/// Derivatives are in blocks of six. A global shutter has one block per frame, the pose `[φ; δt]` of
/// `world_from_camera`; a rolling shutter has three, the poses of the first, the middle and the last row. In a stereo pair
/// the blocks of the other camera follow in each frame. The intrinsics, if estimated, follow after all frames.
/// [`camera_pose::CameraMaps`] has the same blocks.
#[derive(Clone, Debug)]
pub(crate) struct CameraView<'a> {
    model: Cow<'a, CameraModel>,
    has_intrinsics: bool,
    frames: usize,
    poses: Poses<'a>,
    /// Other camera of a stereo pair, which observes features of this one; with as many blocks per frame.
    partner: Option<Box<Self>>,
}

#[derive(Clone, Debug)]
enum Poses<'a> {
    Global {
        /// Pose of each frame by slot.
        poses: Vec<CameraPose>,
        /// Computed at first use: most callers need only the poses.
        relative: OnceCell<RelativePoses>,
    },
    Rolling {
        frames: Cow<'a, [FrameState]>,
        sensor: Box<CameraCalibration<'a>>,
        /// Poses of the first, the middle and the last row, by slot.
        rows: Vec<[CameraPose; 3]>,
    },
}

impl<'a> CameraView<'a> {
    /// A camera over the frames of a window; `given` returns the rig's model of a camera.
    pub(crate) fn new(
        frames: impl Into<Cow<'a, [FrameState]>>,
        calibrations: &'a Calibrations,
        camera: usize,
        given: &dyn Fn(usize) -> &'a CameraModel,
    ) -> Self {
        let frames = frames.into();
        let calibration = calibrations.of(camera);
        let has_intrinsics = !calibration.intrinsics_columns().is_empty();
        let partner = calibration.partner().map(|partner| {
            // The partner of a pair has none.
            Box::new(Self::new(frames.clone(), calibrations, partner, given))
        });
        let sensor = calibrations.sensor_model(camera);
        let view = Self::of_sensor(frames, sensor, calibration.camera_model(given(camera)), has_intrinsics);
        Self { partner, ..view }
    }

    /// [`Self::new`] for a given sensor.
    pub(crate) fn of_sensor(
        frames: Cow<'a, [FrameState]>,
        sensor: CameraCalibration<'a>,
        model: Cow<'a, CameraModel>,
        has_intrinsics: bool,
    ) -> Self {
        let count = frames.len();
        let poses = if sensor.rolling {
            let rows = |state: &FrameState| ROLLING_ROWS.map(|row| camera_pose::at_row(state, &sensor, row));
            Poses::Rolling { rows: frames.iter().map(rows).collect(), frames, sensor: Box::new(sensor) }
        } else {
            let poses: Vec<CameraPose> = frames.iter().map(|state| camera_pose::at_row(state, &sensor, 0.0)).collect();
            Poses::Global { relative: OnceCell::new(), poses }
        };
        Self { model, has_intrinsics, frames: count, poses, partner: None }
    }

    /// Camera with a global shutter at given poses by slot.
    pub(crate) fn of_poses(poses: Vec<CameraPose>, model: &'a CameraModel) -> Self {
        let frames = poses.len();
        Self {
            model: Cow::Borrowed(model),
            has_intrinsics: false,
            frames,
            poses: Poses::Global { poses, relative: OnceCell::new() },
            partner: None,
        }
    }

    /// Camera model with the estimated intrinsics.
    pub(crate) fn model(&self) -> &CameraModel {
        &self.model
    }

    /// Unit bearing of a pixel; `nominal` is its bearing by the rig's model.
    pub(crate) fn bearing(&self, uv_px: &Vector2<f64>, nominal: &Vector3<f64>) -> Vector3<f64> {
        if self.has_intrinsics { self.model.unproject(uv_px).unwrap_or(*nominal) } else { *nominal }
    }

    /// True if all observations of a frame have the same pose and the bearings of the rig's model.
    pub(crate) fn has_nominal_bearings(&self) -> bool {
        !self.has_intrinsics && matches!(self.poses, Poses::Global { .. })
    }

    /// Blocks of the pose of an image.
    pub(crate) fn blocks_per_image(&self) -> usize {
        match self.poses {
            Poses::Global { .. } => 1,
            Poses::Rolling { .. } => ROLLING_BLOCKS,
        }
    }

    pub(crate) fn blocks_per_frame(&self) -> usize {
        self.blocks_per_image() * if self.partner.is_some() { 2 } else { 1 }
    }

    /// The other camera of a stereo pair, `None` without one.
    pub(crate) fn partner(&self) -> Option<&Self> {
        self.partner.as_deref()
    }

    /// Camera that made an observation: this one, or the other one of the pair.
    pub(crate) fn observer(&self, observation: &TrackObservation) -> &Self {
        self.partner.as_deref().filter(|_| observation.matched).unwrap_or(self)
    }

    pub(crate) fn blocks(&self) -> usize {
        self.frames * self.blocks_per_frame() + usize::from(self.has_intrinsics)
    }

    pub(crate) fn frames(&self) -> usize {
        self.frames
    }

    /// Block of the intrinsics, `None` if they are fixed.
    pub(crate) fn intrinsics_block(&self) -> Option<usize> {
        self.has_intrinsics.then(|| self.frames * self.blocks_per_frame())
    }

    /// Blocks of the pose of an observation, `N` per image ([`Self::blocks_per_image`]).
    pub(crate) fn blocks_of<const N: usize>(&self, observation: &TrackObservation) -> [usize; N] {
        let first = self.blocks_per_frame() * observation.slot + if observation.matched { N } else { 0 };
        std::array::from_fn(|row| first + row)
    }

    /// `world_from_camera` at the row of a pixel.
    pub(crate) fn pose(&self, slot: usize, uv_px: &Vector2<f64>) -> CameraPose {
        match &self.poses {
            Poses::Global { poses, .. } => poses[slot],
            Poses::Rolling { frames, sensor, .. } => {
                camera_pose::at_row(&frames[slot], sensor, self.row_fraction(uv_px))
            }
        }
    }

    /// `world_from_camera` at the first row.
    pub(crate) fn first_row(&self, slot: usize) -> CameraPose {
        match &self.poses {
            Poses::Global { poses, .. } => poses[slot],
            Poses::Rolling { rows, .. } => rows[slot][0],
        }
    }

    /// Relative poses of other observations with respect to the anchor's.
    pub(crate) fn relative_to(&self, anchor: &TrackObservation) -> RelativeTo<'_> {
        RelativeTo { view: self, slot: anchor.slot, pose: self.pose(anchor.slot, &anchor.uv_px) }
    }

    /// Row of a pixel as a fraction of the image: 0 for the first row, 1 for the end of the last one.
    pub(crate) fn row_fraction(&self, uv_px: &Vector2<f64>) -> f64 {
        uv_px.y / self.model.resolution_px[1] as f64
    }

    /// Converts derivatives by `pose`, the pose at an observation's row (2 × 6), to derivatives by the blocks of its
    /// frame.
    ///
    /// A change of the pose at the fraction f of the image is interpolated between the first, the middle and the last row
    /// by a parabola, `(2f − 1)(f − 1)`, `4f (1 − f)` and `f (2f − 1)` of them, rotations in world axes; `N` is
    /// [`Self::blocks_per_image`]. The interpolation is exact for changes of pose, velocity, readout time, joint rates and
    /// joint accelerations, except that the rotation of their axes during the readout is of second order.
    pub(crate) fn by_blocks<const N: usize>(
        &self,
        observation: &TrackObservation,
        pose: &CameraPose,
        by_pose: &Matrix2x6<f64>,
    ) -> PoseBlocksOf<usize, N> {
        let (slot, blocks) = (observation.slot, self.blocks_of::<N>(observation));
        let observer = self.observer(observation);
        let Poses::Rolling { rows, .. } = &observer.poses else { return blocks.map(|block| (block, *by_pose)) };
        let fraction = observer.row_fraction(&observation.uv_px);
        let by_world = by_pose.fixed_columns::<3>(0) * pose.rotation.transpose();
        let weights = [
            (2.0 * fraction - 1.0) * (fraction - 1.0),
            4.0 * fraction * (1.0 - fraction),
            fraction * (2.0 * fraction - 1.0),
        ];
        std::array::from_fn(|row| {
            let mut by_row = by_pose * weights[row];
            by_row.fixed_columns_mut::<3>(0).copy_from(&(by_world * rows[slot][row].rotation * weights[row]));
            (blocks[row], by_row)
        })
    }
}

/// Observation in the anchor, with the view that relates other observations to it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RelativeTo<'a> {
    view: &'a CameraView<'a>,
    slot: usize,
    /// Pose at the row of the anchor's observation.
    pub(crate) pose: CameraPose,
}

impl<'a> RelativeTo<'a> {
    /// `observer_from_anchor` at the rows of both observations.
    pub(crate) fn get(&self, observation: &TrackObservation) -> Cow<'a, RelativePose> {
        self.with_pose(observation).0
    }

    /// [`Self::get`], and the pose at the row of the observation.
    pub(crate) fn with_pose(&self, observation: &TrackObservation) -> (Cow<'a, RelativePose>, Cow<'a, CameraPose>) {
        if observation.matched {
            let pose = self.view.observer(observation).pose(observation.slot, &observation.uv_px);
            return (Cow::Owned(RelativePose::new(&self.pose, &pose)), Cow::Owned(pose));
        }
        match &self.view.poses {
            Poses::Global { poses, relative } => {
                let relative = relative.get_or_init(|| RelativePoses::new(poses)).get(self.slot, observation.slot);
                (Cow::Borrowed(relative), Cow::Borrowed(&poses[observation.slot]))
            }
            Poses::Rolling { .. } => {
                let pose = self.view.pose(observation.slot, &observation.uv_px);
                (Cow::Owned(RelativePose::new(&self.pose, &pose)), Cow::Owned(pose))
            }
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TrackObservation {
    pub(crate) slot: usize,
    /// True if the other camera of a stereo pair made it.
    pub(crate) matched: bool,
    pub(crate) uv_px: Vector2<f64>,
}

/// Observations of one feature in the solve.
#[derive(Clone, Debug, Default)]
pub(crate) struct Track {
    /// By ascending slot, of the camera itself before the other one of a pair; the anchor's comes first.
    pub(crate) observations: Vec<TrackObservation>,
}
