//! A frame of the window with its measurements.

use std::ops::Deref;

use super::frame_state::FrameState;
use super::imu_errors::ImuErrors;
use super::layout::{Layout, VELOCITY_BIAS};
use super::navigation::{ImuBias, Matrix15};
use super::preintegration::Preintegration;
use crate::sensors::{ImuSample, JointAngles};

/// Zero-velocity update of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stationary {
    /// Start of the stationary phase.
    pub(crate) since_ns: i64,
    /// Standard deviation of the position relative to the previous frame, per axis: the resolution of the images.
    pub(crate) position_sigma_m: f64,
    /// Standard deviation of the velocity, per axis.
    pub(crate) velocity_sigma_m_per_s: f64,
}

/// Preintegrated samples with their square-root information, which follows every change of them.
#[derive(Clone, Debug)]
pub(crate) struct InformedMotion {
    preintegration: Preintegration,
    information: Option<Matrix15>,
}

impl InformedMotion {
    pub(crate) fn new(preintegration: Preintegration) -> Self {
        Self { information: preintegration.square_root_information(), preintegration }
    }

    /// Square-root information (15 × 15), `None` without samples.
    pub(crate) fn information(&self) -> Option<&Matrix15> {
        self.information.as_ref()
    }

    /// These samples and the samples of the next interval, integrated with this bias.
    pub(crate) fn followed_by(self, samples: &[ImuSample]) -> Self {
        let mut joined = self.preintegration;
        joined.extend(samples);
        Self::new(joined)
    }

    /// Integrates the samples again with another bias and other intrinsics.
    pub(crate) fn reintegrate(&mut self, bias: ImuBias, errors: Option<ImuErrors>) {
        self.preintegration.reintegrate_with(bias, errors);
        self.information = self.preintegration.square_root_information();
    }
}

impl Deref for InformedMotion {
    type Target = Preintegration;

    fn deref(&self) -> &Preintegration {
        &self.preintegration
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Frame {
    pub(crate) index: usize,
    /// Header stamp of the image since the start of the log.
    pub(crate) stamp_ns: i64,
    pub(crate) state: FrameState,
    /// Linearization point in the marginalization prior, `None` for frames outside the prior.
    pub(crate) first_estimate: Option<FrameState>,
    /// Encoder angles at the stamp, `None` without usable readings.
    pub(crate) encoder: Option<JointAngles>,
    /// Zero-velocity update, `None` unless the vehicle is stationary.
    pub(crate) stationary: Option<Stationary>,
    pub(crate) keyframe: bool,
    /// Preintegrated IMU samples since the previous frame of the window.
    pub(crate) motion: InformedMotion,
    /// Samples of the IMU on the gimbal since the previous frame of the window; `None` without one, or where some are
    /// missing.
    pub(crate) gimbal_motion: Option<InformedMotion>,
}

impl Frame {
    /// A keyframe outside the prior, without a zero-velocity update; `motion` are the samples since the previous frame.
    pub(crate) fn new(
        index: usize,
        stamp_ns: i64,
        state: FrameState,
        encoder: Option<JointAngles>,
        motion: Preintegration,
    ) -> Self {
        Self {
            index,
            stamp_ns,
            state,
            first_estimate: None,
            encoder,
            stationary: None,
            keyframe: true,
            motion: InformedMotion::new(motion),
            gimbal_motion: None,
        }
    }

    /// This frame with samples of the IMU on the gimbal.
    pub(crate) fn with_gimbal_motion(self, motion: Option<Preintegration>) -> Self {
        Self { gimbal_motion: motion.map(InformedMotion::new), ..self }
    }

    /// State at which derivatives are evaluated: the first estimate as far as `reach` allows, else `current`.
    pub(crate) fn linearization_point(&self, current: &FrameState, reach: FirstEstimateReach) -> FrameState {
        let Some(first) = &self.first_estimate else { return current.clone() };
        let joints_rad = if reach.holds_joints { 0.0 } else { current.joints_from_rad(first) };
        if joints_rad.max(current.attitude_from_rad(first)) <= reach.radius_rad {
            first.clone()
        } else if reach.holds_joints {
            current.with_joints_of(first)
        } else {
            current.clone()
        }
    }
}

/// Changes since the first estimate within which derivatives are evaluated there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FirstEstimateReach {
    /// Largest rotation of the vehicle, in radians, and of the joints unless they are held.
    pub(crate) radius_rad: f64,
    /// Derivatives with respect to joint angles are evaluated at first estimates whatever the change, as those with respect
    /// to the chain are.
    pub(crate) holds_joints: bool,
}

impl FirstEstimateReach {
    /// All derivatives at the current estimate.
    pub(crate) const NONE: Self = Self { radius_rad: 0.0, holds_joints: false };
}

/// Column layout of a window with these frames.
pub(crate) fn layout(frames: &[Frame], calibration: usize) -> Layout {
    let first = frames.first().map(|frame| &frame.state);
    Layout {
        frames: frames.len(),
        joints: first.map_or(0, |state| state.joints_rad.len()),
        joint_motion: first.map_or(0, |state| state.joint_motion.len()),
        moving_rows: first.is_some_and(FrameState::has_moving_rows),
        gimbal_imu: first.and_then(|state| state.gimbal_imu).map_or(0, |_| VELOCITY_BIAS),
        calibration,
    }
}
