//! The lists of factors of a window, reprojections excepted.

use super::calibration_prior::CalibrationPriorFactor;
use super::encoder::EncoderFactor;
use super::factor::{Point, Sink};
use super::gimbal_imu::{GimbalImuFactor, GimbalImuStates};
use super::imu::ImuFactor;
use super::joint_motion::JointMotionFactor;
use super::marginal_prior::{MarginalPriorFactor, Prior};
use super::start_prior::{GimbalImuStartFactor, StartPrior, StartPriorFactor};
use super::zero_velocity::ZeroVelocityFactor;

/// Passes the measurements of the frames before `slots` to a sink.
pub(crate) fn measurements<S: Sink>(point: &Point<'_>, slots: usize, sink: &mut S) {
    for slot in 1..slots {
        sink.take(ImuFactor::of(point, slot));
    }
    for slot in 0..slots {
        sink.take(EncoderFactor::of(point, slot));
        sink.take(JointMotionFactor::of(point, slot));
    }
    for slot in 0..slots {
        sink.take(ZeroVelocityFactor::of(point, slot));
    }
    if let Some(states) = GimbalImuStates::new(point, slots, S::DERIVATIVES) {
        for slot in 1..slots {
            sink.take(GimbalImuFactor::of(point, &states, slot));
        }
    }
}

/// Passes the priors to a sink: on the calibration, of marginalized frames, and at the start of the window.
pub(crate) fn priors(point: &Point<'_>, prior: Option<&Prior>, start: Option<&StartPrior>, sink: &mut impl Sink) {
    sink.take(CalibrationPriorFactor::of(point));
    sink.take(prior.map(|prior| MarginalPriorFactor::of(prior, point)));
    sink.take(start.and_then(|start| StartPriorFactor::of(start, point)));
    sink.take(start.and_then(|start| GimbalImuStartFactor::of(start, point)));
}
