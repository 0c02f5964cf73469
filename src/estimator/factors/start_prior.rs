//! The prior at the start of the window, in place of the marginalization prior of Eq. 8.
//!
//! ```text
//! r = [e_zᵀ Log(R R₀ᵀ) / σ_ψ; (p − p₀) / σ_p; (b_g − b_g0) / σ_bg; (b_a − b_a0) / σ_ba]
//! ∂r_ψ/∂φ = (Rᵀ e_z)ᵀ / σ_ψ
//! ```

use nalgebra::{SMatrix, SVector, Vector3};

use super::encoder::diagonal;
use super::factor::{Factor, JacobianBlock, NavigationColumns, Point, Sink, WhitenedRows};
use super::kind::FactorLabel;
use crate::estimator::state::navigation::{ImuBias, NavigationState};
use crate::geometry::{RigidTransform, so3};

/// Prior at the start of the window: position and yaw of the first frame, which fix the gauge, and the biases.
#[derive(Clone, Debug)]
pub(crate) struct StartPrior {
    /// `world_from_imu` at which the prior was set.
    pub(crate) reference: RigidTransform,
    /// Mean of the biases.
    pub(crate) bias: ImuBias,
    /// Standard deviation of the accelerometer bias by axis, in m/s².
    pub(crate) accelerometer_bias_sigma: Vector3<f64>,
    /// Standard deviation of the gyroscope bias by axis, in rad/s.
    pub(crate) gyroscope_bias_sigma: Vector3<f64>,
    /// Standard deviations of the biases of an IMU on the gimbal, with mean zero: gyroscope in rad/s, accelerometer in
    /// m/s²; `None` without one.
    pub(crate) gimbal_bias_sigmas: Option<[f64; 2]>,
}

/// Standard deviation of the first position, in metres: only fixes the origin.
const ORIGIN_SIGMA_M: f64 = 1e-3;
/// Standard deviation of the first yaw, in radians: only fixes the direction of the axes.
const YAW_SIGMA_RAD: f64 = 1e-4;

const ROWS: usize = 10;

/// [`StartPrior`] on the oldest state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StartPriorFactor<'a> {
    pub(crate) prior: &'a StartPrior,
    pub(crate) state: &'a NavigationState,
    pub(crate) columns: NavigationColumns,
}

impl<'a> StartPriorFactor<'a> {
    /// Factor of the window, `None` without a frame.
    pub(crate) fn of(prior: &'a StartPrior, point: &Point<'a>) -> Option<Self> {
        let state = &point.at.frames.first()?.navigation;
        Some(Self { prior, state, columns: NavigationColumns::of(&point.layout, 0) })
    }
}

impl Factor for StartPriorFactor<'_> {
    fn label(&self) -> FactorLabel {
        FactorLabel::MarginalizationPrior
    }

    fn rows<S: Sink>(&self, sink: &mut S) {
        let (prior, pose, bias) = (self.prior, &self.state.world_from_imu, &self.state.bias);
        let mut jacobian = SMatrix::<f64, ROWS, 15>::zeros();
        let mut residual = SVector::<f64, ROWS>::zeros();
        let rotation_error = so3::log(&(pose.rotation * prior.reference.rotation.inverse()));
        let vertical = pose.rotation.inverse() * Vector3::z();
        residual[0] = rotation_error.z / YAW_SIGMA_RAD;
        for axis in 0..3 {
            jacobian[(0, axis)] = vertical[axis] / YAW_SIGMA_RAD;
            jacobian[(1 + axis, 3 + axis)] = 1.0 / ORIGIN_SIGMA_M;
            residual[1 + axis] = (pose.translation_m[axis] - prior.reference.translation_m[axis]) / ORIGIN_SIGMA_M;
            let (gyroscope, accelerometer) = (prior.gyroscope_bias_sigma[axis], prior.accelerometer_bias_sigma[axis]);
            jacobian[(4 + axis, 9 + axis)] = 1.0 / gyroscope;
            residual[4 + axis] = (bias.gyroscope_rad_per_s[axis] - prior.bias.gyroscope_rad_per_s[axis]) / gyroscope;
            jacobian[(7 + axis, 12 + axis)] = 1.0 / accelerometer;
            residual[7 + axis] =
                (bias.accelerometer_m_per_s2[axis] - prior.bias.accelerometer_m_per_s2[axis]) / accelerometer;
        }
        let blocks = self.columns.blocks(jacobian.as_slice());
        sink.add(self.label(), &WhitenedRows { residual: residual.as_slice(), blocks: &blocks, products: None });
    }
}

/// [`StartPrior`] on the biases of the IMU on the gimbal in the oldest frame: six rows `[b_g, b_a]`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GimbalImuStartFactor<'a> {
    sigmas: [f64; 2],
    bias: &'a ImuBias,
    /// Column of the first bias.
    start: usize,
}

impl<'a> GimbalImuStartFactor<'a> {
    /// Factor of the window, `None` without such an IMU.
    pub(crate) fn of(prior: &StartPrior, point: &Point<'a>) -> Option<Self> {
        let own = point.at.frames.first()?.gimbal_imu.as_ref()?;
        // The biases follow the velocity.
        Some(Self { sigmas: prior.gimbal_bias_sigmas?, bias: &own.bias, start: point.layout.gimbal_imu(0).start + 3 })
    }
}

impl Factor for GimbalImuStartFactor<'_> {
    fn label(&self) -> FactorLabel {
        FactorLabel::MarginalizationPrior
    }

    fn rows<S: Sink>(&self, sink: &mut S) {
        let biases = [&self.bias.gyroscope_rad_per_s, &self.bias.accelerometer_m_per_s2];
        let terms = biases.into_iter().zip(self.sigmas).flat_map(|(bias, sigma)| bias.iter().map(move |it| it / sigma));
        let residual: Vec<f64> = terms.collect();
        let slopes: Vec<f64> = self.sigmas.iter().flat_map(|sigma| [sigma.recip(); 3]).collect();
        let entries = diagonal(slopes.into_iter());
        let blocks = [JacobianBlock { start: self.start, entries: &entries }];
        sink.add(self.label(), &WhitenedRows { residual: &residual, blocks: &blocks, products: None });
    }
}
