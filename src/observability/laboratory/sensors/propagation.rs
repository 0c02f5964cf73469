//! Preintegration of a continuous IMU, with derivatives by its biases and intrinsics.
//!
//! The measured rate and force are functions of time. The integral, its derivatives and the poses between frames
//! therefore belong to one exact motion: a null direction of the motion is a null direction of the window up to
//! rounding errors.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::values::{ACCELEROMETER_COLUMNS, GYROSCOPE_COLUMNS, SensorValues};
use crate::estimator::ImuBias;
use crate::geometry::so3;
use crate::sensors::ImuNoise;

/// Columns on which the integral depends: gyroscope bias and intrinsics, accelerometer bias and intrinsics.
pub(super) const IMU_COLUMNS: usize = 3 + GYROSCOPE_COLUMNS + 3 + ACCELEROMETER_COLUMNS;
/// Columns of the gyroscope's bias and intrinsics.
const RATE_COLUMNS: usize = 3 + GYROSCOPE_COLUMNS;
/// Largest step of the integration, in seconds; its fourth-order error is about 1e-12.
const STEP_S: f64 = 5e-3;

/// Measured angular rate in rad/s and specific force in m/s² at one time, with intrinsics errors, without bias.
pub(super) type Measured = (Vector3<f64>, Vector3<f64>);

/// Change of rotation, velocity and position since a start time, in the IMU frame at that time and without gravity.
#[derive(Clone, Debug)]
pub(super) struct Change {
    pub(super) rotation: Matrix3<f64>,
    pub(super) velocity: Vector3<f64>,
    pub(super) position: Vector3<f64>,
    /// Derivative of the rotation vector, right perturbation.
    pub(super) rotation_by: SMatrix<f64, 3, IMU_COLUMNS>,
    pub(super) velocity_by: SMatrix<f64, 3, IMU_COLUMNS>,
    pub(super) position_by: SMatrix<f64, 3, IMU_COLUMNS>,
    /// Covariance (9 × 9) of rotation, position and velocity due to white noise; `None` without noise.
    pub(super) covariance: Option<SMatrix<f64, 9, 9>>,
}

impl Change {
    fn zero(noise: Option<&ImuNoise>) -> Self {
        Self {
            rotation: Matrix3::identity(),
            velocity: Vector3::zeros(),
            position: Vector3::zeros(),
            rotation_by: SMatrix::zeros(),
            velocity_by: SMatrix::zeros(),
            position_by: SMatrix::zeros(),
            covariance: noise.map(|_| SMatrix::zeros()),
        }
    }

    /// Integrates `measured` over `duration_s` from `start_s`, forwards or backwards.
    pub(super) fn integrate(
        measured: &dyn Fn(f64) -> Measured,
        (start_s, duration_s): (f64, f64),
        values: &SensorValues,
        biases: &ImuBias,
        noise: Option<&ImuNoise>,
    ) -> Self {
        let steps = (duration_s.abs() / STEP_S).ceil();
        let step_s = duration_s / steps.max(1.0);
        let input = |time_s: f64| Input::new(&measured(time_s), values, biases);
        let mut change = Self::zero(noise);
        let mut from = input(start_s);
        for step in 0..steps as usize {
            (change, from) = change.continued(&input, (start_s + step as f64 * step_s, step_s), &from, noise);
        }
        change
    }

    /// Change after one more step, by Runge–Kutta of order four, with the input at its end; `from` is that at its start.
    fn continued(
        &self,
        input: &impl Fn(f64) -> Input,
        (time_s, step_s): (f64, f64),
        from: &Input,
        noise: Option<&ImuNoise>,
    ) -> (Self, Input) {
        let (middle, to) = (input(time_s + 0.5 * step_s), input(time_s + step_s));
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
            velocity: self.velocity + rate.velocity * step_s,
            position: self.position + rate.position * step_s,
            rotation_by: self.rotation_by + rate.rotation_by * step_s,
            velocity_by: self.velocity_by + rate.velocity_by * step_s,
            position_by: self.position_by + rate.position_by * step_s,
            covariance: self.covariance.zip(rate.covariance).map(|(covariance, rate)| covariance + rate * step_s),
        }
    }

    /// Derivative with respect to time.
    fn rate(&self, input: &Input, noise: Option<&ImuNoise>) -> Self {
        let (spin, force) = (so3::hat(&input.rate), so3::hat(&input.force));
        Self {
            rotation: self.rotation * spin,
            velocity: self.rotation * input.force,
            position: self.velocity,
            rotation_by: input.rate_by - spin * self.rotation_by,
            velocity_by: self.rotation * (input.force_by - force * self.rotation_by),
            position_by: self.velocity_by,
            covariance: noise
                .zip(self.covariance.as_ref())
                .map(|(noise, covariance)| self.covariance_rate(covariance, &spin, &force, noise)),
        }
    }
}

impl Change {
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
pub(super) struct ReadoutChanges {
    start_s: f64,
    /// Change at each whole step, with the input there.
    steps: Vec<(Change, Input)>,
}

impl ReadoutChanges {
    /// Integrates `measured` in whole steps from `start_s` over at most `duration_s`.
    pub(super) fn new(
        measured: &dyn Fn(f64) -> Measured,
        (start_s, duration_s): (f64, f64),
        values: &SensorValues,
        biases: &ImuBias,
    ) -> Self {
        let input = |time_s: f64| Input::new(&measured(time_s), values, biases);
        let mut steps = vec![(Change::zero(None), input(start_s))];
        for step in 1..=(duration_s / STEP_S).max(0.0) as usize {
            let (change, from) = &steps[step - 1];
            let next = change.continued(&input, (start_s + (step - 1) as f64 * STEP_S, STEP_S), from, None);
            steps.push(next);
        }
        Self { start_s, steps }
    }

    /// Change from the start over `since_s`, forwards or backwards.
    pub(super) fn after(
        &self,
        measured: &dyn Fn(f64) -> Measured,
        since_s: f64,
        values: &SensorValues,
        biases: &ImuBias,
    ) -> Change {
        let whole = ((since_s / STEP_S).max(0.0) as usize).min(self.steps.len() - 1);
        let (change, from) = &self.steps[whole];
        let begin_s = whole as f64 * STEP_S;
        let rest_s = since_s - begin_s;
        if rest_s.abs() > STEP_S {
            // Before the frame, or after the longest readout.
            return Change::integrate(measured, (self.start_s, since_s), values, biases, None);
        }
        let input = |time_s: f64| Input::new(&measured(time_s), values, biases);
        change.continued(&input, (self.start_s + begin_s, rest_s), from, None).0
    }
}

/// Corrected rate and force at a time, with their derivatives.
struct Input {
    rate: Vector3<f64>,
    force: Vector3<f64>,
    rate_by: SMatrix<f64, 3, IMU_COLUMNS>,
    force_by: SMatrix<f64, 3, IMU_COLUMNS>,
}

impl Input {
    fn new((rate, force): &Measured, values: &SensorValues, biases: &ImuBias) -> Self {
        let (rate, by_gyroscope) = values.correct_rate(rate);
        let (force, by_accelerometer) = values.correct_force(force);
        let mut rate_by = SMatrix::<f64, 3, IMU_COLUMNS>::zeros();
        let mut force_by = rate_by;
        rate_by.fixed_view_mut::<3, 3>(0, 0).copy_from(&-Matrix3::identity());
        rate_by.fixed_view_mut::<3, GYROSCOPE_COLUMNS>(0, 3).copy_from(&by_gyroscope);
        force_by.fixed_view_mut::<3, 3>(0, RATE_COLUMNS).copy_from(&-Matrix3::identity());
        force_by.fixed_view_mut::<3, ACCELEROMETER_COLUMNS>(0, RATE_COLUMNS + 3).copy_from(&by_accelerometer);
        Self {
            rate: rate - biases.gyroscope_rad_per_s,
            force: force - biases.accelerometer_m_per_s2,
            rate_by,
            force_by,
        }
    }
}
