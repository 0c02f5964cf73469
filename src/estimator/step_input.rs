use crate::frontend::{TrackedFeature, TrackedFrame};
use crate::sensors::{ImuSample, JointAngles};

/// First index of the frames that have an image of the second camera of a run and none of the main one; for the third
/// camera it is twice as large. Larger than any index of the main camera's images.
pub const OTHER_CAMERA_FRAMES: usize = 1 << 27;

/// Measurements of one image as input of the estimator.
#[derive(Clone, Debug)]
pub struct StepInput<'a> {
    /// Index of the image in its camera's stream, plus [`OTHER_CAMERA_FRAMES`] times the camera's index in the run.
    pub frame_index: usize,
    /// Header stamp of the image since the start of the log.
    pub stamp_ns: i64,
    /// IMU samples from the previous image's stamp to this one's, both ends included and interpolated.
    pub imu: &'a [ImuSample],
    /// IMU samples after the stamp (the first one at the stamp) until the last row of a rolling shutter and the last
    /// image of the frame are exposed; empty if no run needs them.
    pub imu_after: &'a [ImuSample],
    /// Stamps of the images after the frame's on the IMU's clock, in seconds, by camera; empty if all have its stamp. Only
    /// with [`crate::estimator::EstimatorConfig::frame_camera`].
    pub image_times_s: &'a [f64],
    /// Samples of the IMU on the gimbal over the interval of `imu`, both ends included and interpolated; empty without
    /// one, or where they are missing.
    pub gimbal_imu: &'a [ImuSample],
    /// Encoder angles at the stamp of the main camera's image with their standard deviations, `None` without encoders.
    pub joint_angles: Option<&'a JointAngles>,
    /// Tracked features of the main camera; empty if it has no image in this frame set.
    pub tracks: &'a TrackedFrame,
    /// Tracked features of [`crate::estimator::EstimatorConfig::further_cameras`] in the same frame set, in their
    /// order; empty where an image is missing.
    pub further_tracks: &'a [&'a TrackedFrame],
}

impl StepInput<'_> {
    /// Features of a camera; index 0 is the main camera.
    pub(crate) fn features(&self, camera: usize) -> &[TrackedFeature] {
        match camera.checked_sub(1) {
            None => &self.tracks.features,
            Some(rigid) => self.further_tracks.get(rigid).map_or(&[], |tracks| &tracks.features),
        }
    }

    /// Features of a camera that the other one of its stereo pair observes as well.
    pub(crate) fn matched(&self, camera: usize) -> &[TrackedFeature] {
        match camera.checked_sub(1) {
            None => &self.tracks.matched,
            Some(further) => self.further_tracks.get(further).map_or(&[], |tracks| &tracks.matched),
        }
    }

    /// Encoder angles of the joints, `None` if one is missing, not finite or without a standard deviation.
    pub(crate) fn encoder_angles(&self, joints: usize) -> Option<&JointAngles> {
        self.joint_angles.filter(|angles| {
            angles.angles_rad.len() == joints
                && angles.sigmas_rad.len() == joints
                && angles.lasting_sigmas_rad.len() == joints
                && angles.angles_rad.iter().all(|angle| angle.is_finite())
                && angles.sigmas_rad.iter().all(|sigma| sigma.is_finite() && *sigma > 0.0)
        })
    }
}

/// Measurements of one step, from which a packed estimator restores the measurements of its window.
pub trait StepMeasurements {
    /// Stamp of the image, as in [`StepInput`].
    fn stamp_ns(&self) -> i64;
    /// The IMU samples, as in [`StepInput`].
    fn imu(&self) -> &[ImuSample];
    /// Samples of the IMU on the gimbal, as in [`StepInput`].
    fn gimbal_imu(&self) -> &[ImuSample];
    /// Features of a camera, ordered by id; index 0 is the main camera.
    fn features(&self, camera: usize) -> &[TrackedFeature];
    /// Those that the other camera of a stereo pair observes as well, ordered by id.
    fn matched(&self, camera: usize) -> &[TrackedFeature];
}
