//! Preintegration of a continuous IMU (Forster et al., TRO 2017), with derivatives by its biases and intrinsics.
//!
//! Angular rate ω and specific force a are functions of time. The integral of
//!
//! ```text
//! ΔṘ = ΔR [ω]×    Δv̇ = ΔR a    Δṗ = Δv
//! ```
//!
//! its derivatives and the poses between frames therefore belong to one exact motion: a null direction of the motion is
//! a null direction of the window up to rounding errors.

use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, UnitQuaternion, Vector3};

use crate::estimator::state::imu_errors::{self, IMU_ERRORS, ImuErrors};
use crate::estimator::state::navigation::Matrix15;
use crate::estimator::{ImuBias, MotionIncrement, Preintegration};
use crate::geometry::so3;
use crate::observability::laboratory::motion::MechanismMotion;
use crate::sensors::{ImuNoise, ImuSample};

/// Columns of the biases `[b_g, b_a]`.
pub(super) const BIASES: usize = 6;
/// Values on which the integral depends: biases, then intrinsics in the order of [`ImuErrors`].
pub(super) const IMU_COLUMNS: usize = BIASES + IMU_ERRORS;
/// Largest step of the integration, in seconds; its fourth-order error is about 1e-12.
const STEP_S: f64 = 5e-3;

/// Derivative of an angular rate or of a specific force by the values of the IMU.
type ByImu = SMatrix<f64, 3, IMU_COLUMNS>;

/// Exact IMU of a motion, corrected by intrinsics and biases.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContinuousImu<'a> {
    pub(super) flight: &'a MechanismMotion<'a>,
    pub(super) errors: ImuErrors,
    pub(super) bias: ImuBias,
}

/// Corrected rate ω and force a at a time, with their derivatives.
struct Input {
    rate: Vector3<f64>,
    force: Vector3<f64>,
    rate_by: ByImu,
    force_by: ByImu,
}

impl ContinuousImu<'_> {
    fn input(&self, time_s: f64) -> Input {
        let (angular_velocity_rad_per_s, specific_force_m_per_s2) = self.flight.rate_and_force(time_s);
        let sample = ImuSample { stamp_ns: 0, angular_velocity_rad_per_s, specific_force_m_per_s2, unmeasured_s: 0.0 };
        let corrected = imu_errors::corrected(&self.errors, &sample);
        let (rate_by_errors, force_by_errors) = imu_errors::derivatives(&self.errors, &sample);
        let (mut rate_by, mut force_by) = (ByImu::zeros(), ByImu::zeros());
        rate_by.fixed_columns_mut::<3>(0).fill_diagonal(-1.0);
        rate_by.fixed_columns_mut::<IMU_ERRORS>(BIASES).copy_from(&rate_by_errors);
        force_by.fixed_columns_mut::<3>(3).fill_diagonal(-1.0);
        force_by.fixed_columns_mut::<IMU_ERRORS>(BIASES).copy_from(&force_by_errors);
        Input {
            rate: corrected.angular_velocity_rad_per_s - self.bias.gyroscope_rad_per_s,
            force: corrected.specific_force_m_per_s2 - self.bias.accelerometer_m_per_s2,
            rate_by,
            force_by,
        }
    }
}

/// Change of rotation, position and velocity since a start time, in the IMU frame at that time and without gravity.
#[derive(Clone, Debug)]
pub(super) struct Change {
    /// ΔR, `first_from_last` of the IMU frames at both times.
    pub(super) rotation: Matrix3<f64>,
    /// Δp in the first frame, in metres, without gravity and initial velocity.
    pub(super) position: Vector3<f64>,
    /// Δv in the first frame, in m/s, without gravity.
    pub(super) velocity: Vector3<f64>,
    /// Derivative of `[φ, p, v]` by biases and intrinsics, rotations perturbed on the right.
    pub(super) by_imu: SMatrix<f64, 9, IMU_COLUMNS>,
    /// Covariance (9 × 9) of `[φ, p, v]` due to white noise; `None` without noise.
    covariance: Option<SMatrix<f64, 9, 9>>,
}

impl Change {
    fn zero(noise: Option<&ImuNoise>) -> Self {
        Self {
            rotation: Matrix3::identity(),
            position: Vector3::zeros(),
            velocity: Vector3::zeros(),
            by_imu: SMatrix::zeros(),
            covariance: noise.map(|_| SMatrix::zeros()),
        }
    }

    /// Integrates an IMU over `duration_s` from `start_s`, forwards or backwards.
    fn integrate(imu: &ContinuousImu<'_>, (start_s, duration_s): (f64, f64), noise: Option<&ImuNoise>) -> Self {
        let steps = (duration_s.abs() / STEP_S).ceil();
        let step_s = duration_s / steps.max(1.0);
        let mut change = Self::zero(noise);
        let mut from = imu.input(start_s);
        for step in 0..steps as usize {
            (change, from) = change.continued(imu, (start_s + step as f64 * step_s, step_s), &from, noise);
        }
        change
    }

    /// Preintegrated motion over an interval, with the covariance of these noise densities.
    pub(super) fn preintegration(
        imu: &ContinuousImu<'_>,
        (start_s, duration_s): (f64, f64),
        noise: Option<&ImuNoise>,
    ) -> Preintegration {
        let change = Self::integrate(imu, (start_s, duration_s), noise);
        let mut covariance = Matrix15::zeros();
        if let (Some(motion), Some(noise)) = (change.covariance, noise) {
            covariance.fixed_view_mut::<9, 9>(0, 0).copy_from(&motion);
            for (first, density) in [(9, noise.gyroscope_random_walk), (12, noise.accelerometer_random_walk)] {
                covariance.fixed_view_mut::<3, 3>(first, first).fill_diagonal(density * density * duration_s);
            }
        }
        let increment = MotionIncrement {
            rotation: change.unit_rotation(),
            position_m: change.position,
            velocity_m_per_s: change.velocity,
        };
        let by_bias = change.by_imu.fixed_columns::<BIASES>(0).into_owned();
        let intrinsics = (imu.errors, change.by_imu.fixed_columns::<IMU_ERRORS>(BIASES).into_owned());
        Preintegration::of_motion(imu.bias, duration_s, increment, &by_bias, intrinsics, &covariance)
    }

    /// ΔR as a quaternion.
    pub(super) fn unit_rotation(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(self.rotation))
    }

    /// Change after one more step, by Runge–Kutta of order four, with the input at its end; `from` is that at its start.
    fn continued(
        &self,
        imu: &ContinuousImu<'_>,
        (time_s, step_s): (f64, f64),
        from: &Input,
        noise: Option<&ImuNoise>,
    ) -> (Self, Input) {
        let (middle, to) = (imu.input(time_s + 0.5 * step_s), imu.input(time_s + step_s));
        let first = self.rate(from, noise);
        let second = self.advanced(&first, 0.5 * step_s).rate(&middle, noise);
        let third = self.advanced(&second, 0.5 * step_s).rate(&middle, noise);
        let fourth = self.advanced(&third, step_s).rate(&to, noise);
        let change = self
            .advanced(&first, step_s / 6.0)
            .advanced(&second, step_s / 3.0)
            .advanced(&third, step_s / 3.0)
            .advanced(&fourth, step_s / 6.0);
        (change, to)
    }

    fn advanced(&self, rate: &Self, step_s: f64) -> Self {
        Self {
            rotation: self.rotation + rate.rotation * step_s,
            position: self.position + rate.position * step_s,
            velocity: self.velocity + rate.velocity * step_s,
            by_imu: self.by_imu + rate.by_imu * step_s,
            covariance: self.covariance.zip(rate.covariance).map(|(covariance, rate)| covariance + rate * step_s),
        }
    }

    /// Derivative with respect to time; with y the values of the IMU
    ///
    /// ```text
    /// d/dt ∂φ/∂y = ∂ω/∂y − [ω]× ∂φ/∂y    d/dt ∂v/∂y = ΔR (∂a/∂y − [a]× ∂φ/∂y)    d/dt ∂p/∂y = ∂v/∂y
    /// ```
    fn rate(&self, input: &Input, noise: Option<&ImuNoise>) -> Self {
        let (spin, force) = (so3::hat(&input.rate), so3::hat(&input.force));
        let rotation_by = self.by_imu.fixed_rows::<3>(0);
        let mut by_imu = SMatrix::<f64, 9, IMU_COLUMNS>::zeros();
        by_imu.fixed_rows_mut::<3>(0).copy_from(&(input.rate_by - spin * rotation_by));
        by_imu.fixed_rows_mut::<3>(3).copy_from(&self.by_imu.fixed_rows::<3>(6));
        by_imu.fixed_rows_mut::<3>(6).copy_from(&(self.rotation * (input.force_by - force * rotation_by)));
        Self {
            rotation: self.rotation * spin,
            position: self.velocity,
            velocity: self.rotation * input.force,
            by_imu,
            covariance: noise
                .zip(self.covariance.as_ref())
                .map(|(noise, covariance)| self.covariance_rate(covariance, &spin, &force, noise)),
        }
    }

    /// `F P + P Fᵀ + Q` with the derivative F of the error's rate by the error `[φ, p, v]`.
    fn covariance_rate(
        &self,
        covariance: &SMatrix<f64, 9, 9>,
        spin: &Matrix3<f64>,
        force: &Matrix3<f64>,
        noise: &ImuNoise,
    ) -> SMatrix<f64, 9, 9> {
        let mut by_error = SMatrix::<f64, 9, 9>::zeros();
        by_error.fixed_view_mut::<3, 3>(0, 0).copy_from(&-spin);
        by_error.fixed_view_mut::<3, 3>(3, 6).copy_from(&Matrix3::identity());
        by_error.fixed_view_mut::<3, 3>(6, 0).copy_from(&-(self.rotation * force));
        let densities = [noise.gyroscope_noise_density, 0.0, noise.accelerometer_noise_density];
        let white = SVector::<f64, 9>::from_fn(|row, _| densities[row / 3] * densities[row / 3]);
        let spread = by_error * covariance;
        spread + spread.transpose() + SMatrix::from_diagonal(&white)
    }
}

/// Changes since the time of a frame at whole steps, which the changes to the rows of its image share.
pub(super) struct ReadoutChanges<'a> {
    imu: ContinuousImu<'a>,
    start_s: f64,
    /// Change at each whole step, with the input there.
    steps: Vec<(Change, Input)>,
}

impl<'a> ReadoutChanges<'a> {
    /// Integrates an IMU in whole steps from `start_s` over at most `duration_s`.
    pub(super) fn new(imu: ContinuousImu<'a>, (start_s, duration_s): (f64, f64)) -> Self {
        let mut steps = vec![(Change::zero(None), imu.input(start_s))];
        for step in 1..=(duration_s / STEP_S).max(0.0) as usize {
            let (change, from) = &steps[step - 1];
            let next = change.continued(&imu, (start_s + (step - 1) as f64 * STEP_S, STEP_S), from, None);
            steps.push(next);
        }
        Self { imu, start_s, steps }
    }

    /// Change from the start over `since_s`, forwards or backwards, with the angular rate there in rad/s.
    pub(super) fn after(&self, since_s: f64) -> (Change, Vector3<f64>) {
        let whole = ((since_s / STEP_S).max(0.0) as usize).min(self.steps.len() - 1);
        let (change, from) = &self.steps[whole];
        let begin_s = whole as f64 * STEP_S;
        let rest_s = since_s - begin_s;
        if rest_s.abs() > STEP_S {
            // Before the frame, or after the longest readout.
            let change = Change::integrate(&self.imu, (self.start_s, since_s), None);
            return (change, self.imu.input(self.start_s + since_s).rate);
        }
        let (change, to) = change.continued(&self.imu, (self.start_s + begin_s, rest_s), from, None);
        (change, to.rate)
    }
}
