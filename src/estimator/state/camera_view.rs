//! A camera in a window at one estimate: its model, and its pose at each observation.

use std::borrow::Cow;
use std::cell::OnceCell;

use nalgebra::{Matrix2x6, Vector2, Vector3};

use super::calibration::Calibration;
use super::camera_pose::{self, CameraSensor, ROLLING_ROWS};
use super::frame_state::FrameState;
use super::track::TrackObservation;
use crate::camera::CameraModel;
use crate::optimization::{CameraPose, PoseBlocksOf, RelativePose, RelativePoses};

/// Blocks per frame of a rolling shutter.
pub(crate) const ROLLING_BLOCKS: usize = ROLLING_ROWS.len();

/// A camera with its intrinsics and poses at an estimate.
///
/// Derivatives are by blocks of six: one per frame with a global shutter, the pose `[φ; δt]` of `world_from_camera`; three
/// per frame with a rolling shutter, the poses of the first, the middle and the last row; and after all frames the intrinsics, where
/// they are estimated. [`camera_pose::CameraMaps`] has the same blocks.
#[derive(Clone, Debug)]
pub(crate) struct CameraView<'a> {
    model: Cow<'a, CameraModel>,
    has_intrinsics: bool,
    frames: usize,
    poses: Poses<'a>,
}

#[derive(Clone, Debug)]
enum Poses<'a> {
    Global {
        /// By slot.
        poses: Vec<CameraPose>,
        /// Made at first use: most callers need poses alone.
        relative: OnceCell<RelativePoses>,
    },
    Rolling {
        frames: Cow<'a, [FrameState]>,
        sensor: Box<CameraSensor<'a>>,
        /// Of the first, the middle and the last row, by slot.
        rows: Vec<[CameraPose; 3]>,
    },
}

impl<'a> CameraView<'a> {
    /// The camera of a calibration over the frames of a window; `given` is the model of the rig.
    pub(crate) fn new(frames: &'a [FrameState], calibration: &'a Calibration, given: &'a CameraModel) -> Self {
        let has_intrinsics = !calibration.intrinsics_columns().is_empty();
        Self::of_sensor(
            Cow::Borrowed(frames),
            calibration.sensor_model(),
            calibration.camera_model(given),
            has_intrinsics,
        )
    }

    /// [`Self::new`] with states of its own.
    pub(crate) fn of_states(frames: Vec<FrameState>, calibration: &'a Calibration, given: &'a CameraModel) -> Self {
        let has_intrinsics = !calibration.intrinsics_columns().is_empty();
        Self::of_sensor(Cow::Owned(frames), calibration.sensor_model(), calibration.camera_model(given), has_intrinsics)
    }

    /// [`Self::new`] for a given sensor.
    pub(crate) fn of_sensor(
        frames: Cow<'a, [FrameState]>,
        sensor: CameraSensor<'a>,
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
        Self { model, has_intrinsics, frames: count, poses }
    }

    /// A camera at given poses by slot, with a global shutter.
    pub(crate) fn of_poses(poses: Vec<CameraPose>, model: &'a CameraModel) -> Self {
        let frames = poses.len();
        Self {
            model: Cow::Borrowed(model),
            has_intrinsics: false,
            frames,
            poses: Poses::Global { poses, relative: OnceCell::new() },
        }
    }

    /// The camera model with the estimated intrinsics.
    pub(crate) fn model(&self) -> &CameraModel {
        &self.model
    }

    /// Unit bearing of a pixel; `nominal` is that of the rig's model.
    pub(crate) fn bearing(&self, uv_px: &Vector2<f64>, nominal: &Vector3<f64>) -> Vector3<f64> {
        if self.has_intrinsics { self.model.unproject(uv_px).unwrap_or(*nominal) } else { *nominal }
    }

    /// Whether all observations of a frame have its one pose and the bearings of the rig's model.
    pub(crate) fn has_nominal_bearings(&self) -> bool {
        !self.has_intrinsics && matches!(self.poses, Poses::Global { .. })
    }

    /// Number of blocks of a frame.
    pub(crate) fn blocks_per_frame(&self) -> usize {
        match self.poses {
            Poses::Global { .. } => 1,
            Poses::Rolling { .. } => ROLLING_BLOCKS,
        }
    }

    /// Number of all blocks.
    pub(crate) fn blocks(&self) -> usize {
        self.frames * self.blocks_per_frame() + usize::from(self.has_intrinsics)
    }

    /// Number of frames.
    pub(crate) fn frames(&self) -> usize {
        self.frames
    }

    /// Block of the intrinsics, `None` where they are fixed.
    pub(crate) fn intrinsics_block(&self) -> Option<usize> {
        self.has_intrinsics.then(|| self.frames * self.blocks_per_frame())
    }

    /// Blocks of the pose of a frame, `N` per frame ([`Self::blocks_per_frame`]).
    pub(crate) fn blocks_of<const N: usize>(slot: usize) -> [usize; N] {
        std::array::from_fn(|row| N * slot + row)
    }

    /// Pose at the row of a pixel.
    pub(crate) fn pose(&self, slot: usize, uv_px: &Vector2<f64>) -> CameraPose {
        match &self.poses {
            Poses::Global { poses, .. } => poses[slot],
            Poses::Rolling { frames, sensor, .. } => {
                camera_pose::at_row(&frames[slot], sensor, self.row_fraction(uv_px))
            }
        }
    }

    /// Pose at the first row, by slot.
    pub(crate) fn first_row(&self, slot: usize) -> CameraPose {
        match &self.poses {
            Poses::Global { poses, .. } => poses[slot],
            Poses::Rolling { rows, .. } => rows[slot][0],
        }
    }

    /// Relative poses of other observations to an anchor's.
    pub(crate) fn relative_to(&self, anchor: &TrackObservation) -> RelativeTo<'_> {
        RelativeTo { view: self, slot: anchor.slot, pose: self.pose(anchor.slot, &anchor.uv_px) }
    }

    /// Place of a pixel's row between the first one (0) and the end of the last one (1).
    pub(crate) fn row_fraction(&self, uv_px: &Vector2<f64>) -> f64 {
        uv_px.y / self.model.resolution_px[1] as f64
    }

    /// Derivatives by the blocks of a frame from those by the pose at an observation's row (2 × 6), which is `pose`.
    ///
    /// Between the first, the middle and the last row, a change of the pose is interpolated by a parabola, rotations in world
    /// axes; `N` is [`Self::blocks_per_frame`]. It is exact for changes of pose, velocity, readout, joint rates and joint accelerations but for the rotation of
    /// their axes during the readout, which it follows to second order.
    pub(crate) fn by_blocks<const N: usize>(
        &self,
        observation: &TrackObservation,
        pose: &CameraPose,
        by_pose: &Matrix2x6<f64>,
    ) -> PoseBlocksOf<usize, N> {
        let slot = observation.slot;
        let Poses::Rolling { rows, .. } = &self.poses else { return [(slot, *by_pose); N] };
        let fraction = self.row_fraction(&observation.uv_px);
        let by_world = by_pose.fixed_columns::<3>(0) * pose.rotation.transpose();
        let weights = [
            (2.0 * fraction - 1.0) * (fraction - 1.0),
            4.0 * fraction * (1.0 - fraction),
            fraction * (2.0 * fraction - 1.0),
        ];
        std::array::from_fn(|row| {
            let mut by_row = by_pose * weights[row];
            by_row.fixed_columns_mut::<3>(0).copy_from(&(by_world * rows[slot][row].rotation * weights[row]));
            (N * slot + row, by_row)
        })
    }
}

/// An anchor's observation to which others are related.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RelativeTo<'a> {
    view: &'a CameraView<'a>,
    slot: usize,
    /// At the row of the anchor's observation.
    pub(crate) pose: CameraPose,
}

impl<'a> RelativeTo<'a> {
    /// `observer_from_anchor` at the rows of both observations.
    pub(crate) fn get(&self, observation: &TrackObservation) -> Cow<'a, RelativePose> {
        self.with_pose(observation).0
    }

    /// [`Self::get`] with the pose at the row of the observation.
    pub(crate) fn with_pose(&self, observation: &TrackObservation) -> (Cow<'a, RelativePose>, Cow<'a, CameraPose>) {
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
