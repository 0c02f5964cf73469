//! The prior at the start of the window.

use nalgebra::{DMatrix, DVector, Vector3};

use super::factor::{Block, Factor, Point, Rows, Sink};
use super::kind::FactorLabel;
use crate::estimator::state::frame_state::FrameState;
use crate::estimator::state::layout::POSE;
use crate::estimator::state::navigation::ImuBias;

/// Prior at the start of the window: position and yaw of the first frame, which fix the gauge, and the biases.
#[derive(Clone, Debug)]
pub(crate) struct StartPrior {
    /// State at which the prior was set.
    pub(crate) reference: FrameState,
    /// Mean of the biases.
    pub(crate) bias: ImuBias,
    /// Standard deviation of the accelerometer bias by axis, in m/s².
    pub(crate) accelerometer_bias_sigma: Vector3<f64>,
    /// Standard deviation of the gyroscope bias by axis, in rad/s.
    pub(crate) gyroscope_bias_sigma: Vector3<f64>,
}

/// Standard deviation of the first position, in metres: only fixes the origin.
const ORIGIN_SIGMA_M: f64 = 1e-3;
/// Standard deviation of the first yaw, in radians: only fixes the direction of the axes.
const YAW_SIGMA_RAD: f64 = 1e-4;

impl StartPrior {
    /// Number of scalar residuals.
    pub(crate) const LEN: usize = 10;

    /// Whitened rows on the first frame's block `[pose | joints | velocity and biases]` (10 × columns) and their
    /// residuals.
    pub(crate) fn rows(&self, state: &FrameState) -> (DMatrix<f64>, DVector<f64>) {
        let joints = state.joint_block();
        let mut jacobian = DMatrix::zeros(Self::LEN, 15 + joints);
        let mut residual = DVector::zeros(Self::LEN);
        let pose = &state.navigation.world_from_imu;
        let reference = &self.reference.navigation.world_from_imu;
        let rotation_error = crate::geometry::so3::log(&(pose.rotation * reference.rotation.inverse()));
        let vertical = pose.rotation.inverse() * Vector3::z();
        residual[0] = rotation_error.z / YAW_SIGMA_RAD;
        for axis in 0..3 {
            jacobian[(0, axis)] = vertical[axis] / YAW_SIGMA_RAD;
            jacobian[(1 + axis, 3 + axis)] = 1.0 / ORIGIN_SIGMA_M;
            residual[1 + axis] = (pose.translation_m[axis] - reference.translation_m[axis]) / ORIGIN_SIGMA_M;
            let gyroscope = POSE + joints + 3 + axis;
            jacobian[(4 + axis, gyroscope)] = 1.0 / self.gyroscope_bias_sigma[axis];
            residual[4 + axis] = (state.navigation.bias.gyroscope_rad_per_s[axis]
                - self.bias.gyroscope_rad_per_s[axis])
                / self.gyroscope_bias_sigma[axis];
            let accelerometer = POSE + joints + 6 + axis;
            jacobian[(7 + axis, accelerometer)] = 1.0 / self.accelerometer_bias_sigma[axis];
            residual[7 + axis] = (state.navigation.bias.accelerometer_m_per_s2[axis]
                - self.bias.accelerometer_m_per_s2[axis])
                / self.accelerometer_bias_sigma[axis];
        }
        (jacobian, residual)
    }
}

/// [`StartPrior`] on the oldest frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StartPriorFactor<'a> {
    prior: &'a StartPrior,
    state: &'a FrameState,
    /// First column of the frame.
    start: usize,
}

impl<'a> StartPriorFactor<'a> {
    /// Factor of the window, `None` without a frame.
    pub(crate) fn of(prior: &'a StartPrior, point: &Point<'a>) -> Option<Self> {
        Some(Self { prior, state: point.at.frames.first()?, start: point.layout.frame(0).start })
    }
}

impl Factor for StartPriorFactor<'_> {
    fn label(&self) -> FactorLabel {
        FactorLabel::MarginalizationPrior
    }

    fn rows<S: Sink>(&self, sink: &mut S) {
        let (jacobian, residual) = self.prior.rows(self.state);
        let blocks = [Block { start: self.start, entries: jacobian.as_slice() }];
        sink.add(self.label(), &Rows { residual: residual.as_slice(), blocks: &blocks, products: None });
    }
}
