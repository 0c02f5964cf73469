//! Preintegration of the IMU samples between two frames (Forster et al., TRO 2017) with covariance and bias
//! Jacobians.
//!
//! Angular velocity ω and specific force a, without bias, are linear between two samples h seconds apart. The rotation
//! over the interval has two terms of the Magnus expansion, velocity and position follow Simpson's rule:
//!
//! ```text
//! ΔR ← ΔR Exp(φ)    Δp ← Δp + Δv h + ΔR δp    Δv ← Δv + ΔR δv
//! φ = ½ (ω₀ + ω₁) h + ω₀ × ω₁ h²/12    δp = (a₀ + 2 E_½ a_½) h²/6    δv = (a₀ + 4 E_½ a_½ + E a₁) h/6
//! ```
//!
//! with `E = Exp(φ)` and `E_½` over half of the interval. The covariance of the error `[φ, p, v, b_g, b_a]` and the
//! Jacobian by the biases follow from the derivatives of these: `P ← A P Aᵀ + Q`, `J ← A J`.
//! Error vectors are ordered `[φ, p, v, b_g, b_a]` (15), with the perturbation rule of [`crate::geometry`].

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

use super::imu_errors::{self, ImuErrors};

pub use crate::estimator::state::navigation::{ImuBias, Matrix15, NavigationState, Vector15};
use crate::geometry::{RigidTransform, seconds_from_ns, so3};
use crate::optimization::square_root_information;
use crate::sensors::{ImuNoise, ImuSample, LONGEST_INTERVAL_S};

/// Derivative of `[φ, p, v]` with respect to `[b_g, b_a]` (9 × 6).
pub type BiasJacobian = SMatrix<f64, 9, 6>;

/// Derivative of `[φ, p, v]` with respect to the IMU intrinsics (9 × 15), in the order of [`ImuErrors`].
pub(crate) type IntrinsicsJacobian = SMatrix<f64, 9, 15>;

/// Intrinsics used in the integration, and the derivative of the increment by them.
#[derive(Clone, Debug)]
struct IntegratedIntrinsics {
    errors: ImuErrors,
    jacobian: IntrinsicsJacobian,
}

/// Motion of the IMU over an interval from `i` to `j`, in its frame at the start, without gravity and initial velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionIncrement {
    /// Rotation `ΔR` = `imu_i_from_imu_j` of the interval.
    pub rotation: UnitQuaternion<f64>,
    /// `R_iᵀ (p_j − p_i − v_i T − g T²/2)` in metres.
    pub position_m: Vector3<f64>,
    /// `R_iᵀ (v_j − v_i − g T)` in m/s.
    pub velocity_m_per_s: Vector3<f64>,
}

/// Number of equal consecutive values of an axis that indicates saturation, if the value is at least
/// [`MIN_SATURATED_RAD_PER_S`] or [`MIN_SATURATED_M_PER_S2`]. Noise never repeats a value of full
/// resolution.
const SATURATED_REPEATS: u8 = 3;

/// Smallest angular rate of a saturated axis: every sensor's range includes smaller ones.
const MIN_SATURATED_RAD_PER_S: f64 = 0.5;

/// Smallest specific force of a saturated axis: every sensor's range includes gravity.
const MIN_SATURATED_M_PER_S2: f64 = 12.0;

/// Noise density of a saturated axis relative to its value, in √s: the true value exceeds it by about half its size
/// (standard deviation) for about a tenth of a second.
const SATURATED_DENSITY: f64 = 0.16;

/// Random walk of the angular velocity of a vehicle, in rad/s/√s: it changes by this much in a second. It is the
/// uncertainty in gaps of the IMU: the errors of integration over artificial gaps of 0.06 to 1.5 s correspond to 0.05 to
/// 1.5, in EuRoC to 0.25 to 0.5, in a flight of PX4 to 0.35 to 0.7.
const ANGULAR_VELOCITY_WALK: f64 = 1.5;

/// Random walk of the specific force of a vehicle, in m/s²/√s; the errors over gaps correspond to 0.3 to 2, in EuRoC to
/// 1.3 to 2, in a flight of PX4 to 0.5 to 1. Twice the largest one, because the error of the orientation is not small over
/// a long gap.
const SPECIFIC_FORCE_WALK: f64 = 4.5;

/// Number of repetitions of the value of each axis.
#[derive(Clone, Copy, Debug, Default)]
struct Repeats {
    gyroscope: [u8; 3],
    accelerometer: [u8; 3],
}

impl Repeats {
    fn count(&mut self, from: &ImuSample, to: &ImuSample) {
        let follow = |counts: &mut [u8; 3], before: &Vector3<f64>, now: &Vector3<f64>| {
            for axis in 0..3 {
                counts[axis] = if before[axis] == now[axis] { counts[axis].saturating_add(1) } else { 0 };
            }
        };
        follow(&mut self.gyroscope, &from.angular_velocity_rad_per_s, &to.angular_velocity_rad_per_s);
        follow(&mut self.accelerometer, &from.specific_force_m_per_s2, &to.specific_force_m_per_s2);
    }

    /// Squared noise densities of the axes, larger for saturated ones; true if any axis is saturated.
    fn densities(counts: &[u8; 3], shown: &Vector3<f64>, least: f64, density: f64) -> (Vector3<f64>, bool) {
        let mut saturated = false;
        let squares = Vector3::from_fn(|axis, _| {
            let at_end = counts[axis] + 1 >= SATURATED_REPEATS && shown[axis].abs() >= least;
            saturated |= at_end;
            let density = if at_end { SATURATED_DENSITY * shown[axis].abs() } else { density };
            density * density
        });
        (squares, saturated)
    }
}

/// Preintegrated IMU samples of an interval.
#[derive(Clone, Debug)]
pub struct Preintegration {
    noise: ImuNoise,
    samples: Vec<ImuSample>,
    bias: ImuBias,
    duration_s: f64,
    increment: MotionIncrement,
    bias_jacobian: BiasJacobian,
    /// `None` if the samples are not corrected.
    intrinsics: Option<Box<IntegratedIntrinsics>>,
    covariance: Matrix15,
    repeats: Repeats,
    saturated: usize,
}

impl Preintegration {
    /// Empty interval, to be integrated with `bias`.
    pub fn new(noise: ImuNoise, bias: ImuBias) -> Self {
        Self {
            noise,
            samples: Vec::new(),
            bias,
            duration_s: 0.0,
            increment: MotionIncrement {
                rotation: UnitQuaternion::identity(),
                position_m: Vector3::zeros(),
                velocity_m_per_s: Vector3::zeros(),
            },
            bias_jacobian: BiasJacobian::zeros(),
            intrinsics: None,
            covariance: Matrix15::zeros(),
            repeats: Repeats::default(),
            saturated: 0,
        }
    }

    /// [`Self::new`] with samples corrected by intrinsics, if there are any.
    pub(crate) fn with_intrinsics(noise: ImuNoise, bias: ImuBias, errors: Option<ImuErrors>) -> Self {
        let intrinsics =
            errors.map(|errors| Box::new(IntegratedIntrinsics { errors, jacobian: IntrinsicsJacobian::zeros() }));
        Self { intrinsics, ..Self::new(noise, bias) }
    }

    /// Interval whose motion, integrated without samples at `bias` and these intrinsics, is given with its derivatives and
    /// its covariance.
    pub(crate) fn of_motion(
        bias: ImuBias,
        duration_s: f64,
        increment: MotionIncrement,
        bias_jacobian: &BiasJacobian,
        (errors, jacobian): (ImuErrors, IntrinsicsJacobian),
        covariance: &Matrix15,
    ) -> Self {
        let intrinsics = Some(Box::new(IntegratedIntrinsics { errors, jacobian }));
        let (bias_jacobian, covariance) = (*bias_jacobian, *covariance);
        Self { duration_s, increment, bias_jacobian, intrinsics, covariance, ..Self::new(ImuNoise::ZERO, bias) }
    }

    /// Integrates the samples of one interval, both ends included.
    pub fn from_samples(noise: ImuNoise, bias: ImuBias, samples: &[ImuSample]) -> Self {
        let mut preintegration = Self::new(noise, bias);
        preintegration.extend(samples);
        preintegration
    }

    /// Appends the samples of the following interval; skips samples that are not finite or not later than the last one.
    pub fn extend(&mut self, samples: &[ImuSample]) {
        for sample in samples {
            if !Self::takes(self.samples.last(), sample) {
                continue;
            }
            if let Some(last) = self.samples.last().copied() {
                self.propagate(&last, sample);
            }
            self.samples.push(*sample);
        }
    }

    /// True if a sample is integrated after the last one: it is finite and later.
    pub(crate) fn takes(last: Option<&ImuSample>, sample: &ImuSample) -> bool {
        let finite = sample.angular_velocity_rad_per_s.iter().all(|x| x.is_finite())
            && sample.specific_force_m_per_s2.iter().all(|x| x.is_finite());
        finite && last.is_none_or(|last| sample.stamp_ns > last.stamp_ns)
    }

    /// Integrates the samples again with another bias.
    pub fn reintegrate(&mut self, bias: ImuBias) {
        let errors = self.intrinsics.as_ref().map(|intrinsics| intrinsics.errors);
        self.reintegrate_with(bias, errors);
    }

    /// Integrates the samples again with another bias and other intrinsics.
    pub(crate) fn reintegrate_with(&mut self, bias: ImuBias, errors: Option<ImuErrors>) {
        let samples = std::mem::take(&mut self.samples);
        *self = Self::with_intrinsics(self.noise, bias, errors);
        self.extend(&samples);
    }

    pub fn samples(&self) -> &[ImuSample] {
        &self.samples
    }

    /// Noise densities used in the integration.
    pub(crate) fn noise(&self) -> &ImuNoise {
        &self.noise
    }

    /// Intrinsics used in the integration, `None` if the samples are not corrected.
    pub(crate) fn intrinsics(&self) -> Option<&ImuErrors> {
        self.intrinsics.as_ref().map(|intrinsics| &intrinsics.errors)
    }

    /// Bias used in the integration.
    pub fn bias(&self) -> &ImuBias {
        &self.bias
    }

    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Number of samples with a saturated axis.
    pub fn saturated_samples(&self) -> usize {
        self.saturated
    }

    /// Motion at the bias of the integration.
    pub fn increment(&self) -> &MotionIncrement {
        &self.increment
    }

    /// Derivative of the increment's `[φ, p, v]` with respect to `[b_g, b_a]` (9 × 6).
    pub fn bias_jacobian(&self) -> &BiasJacobian {
        &self.bias_jacobian
    }

    /// Covariance of `[φ, p, v, b_g, b_a]` over the interval (15 × 15); the bias blocks are their random walk.
    pub fn covariance(&self) -> &Matrix15 {
        &self.covariance
    }

    /// Derivative of the increment's `[φ, p, v]` with respect to the intrinsics (9 × 15), zero without any.
    pub(crate) fn intrinsics_jacobian(&self) -> IntrinsicsJacobian {
        self.intrinsics.as_ref().map_or_else(IntrinsicsJacobian::zeros, |intrinsics| intrinsics.jacobian)
    }

    /// Change of the intrinsics since the integration; `None` if either the integration or `errors` has none.
    pub(crate) fn intrinsics_change(&self, errors: Option<&ImuErrors>) -> Option<ImuErrors> {
        Some(errors? - self.intrinsics.as_ref()?.errors)
    }

    /// Motion at another bias, to first order in the change.
    pub fn corrected(&self, bias: &ImuBias) -> MotionIncrement {
        self.shifted(&self.shift(bias, None))
    }

    /// Change `J δb` of `[φ, p, v]` (9 × 1) due to a change δb of bias and intrinsics, to first order.
    pub(crate) fn shift(&self, bias: &ImuBias, errors: Option<&ImuErrors>) -> SVector<f64, 9> {
        let shift: SVector<f64, 9> = self.bias_jacobian * self.bias_change(bias);
        match self.intrinsics_change(errors) {
            Some(change) => shift + self.intrinsics_jacobian() * change,
            None => shift,
        }
    }

    /// Increment changed by `[φ, p, v]`: `(ΔR Exp(φ), Δp + p, Δv + v)`.
    pub(crate) fn shifted(&self, shift: &SVector<f64, 9>) -> MotionIncrement {
        MotionIncrement {
            rotation: self.increment.rotation * so3::exp(&shift.fixed_rows::<3>(0).into_owned()),
            position_m: self.increment.position_m + shift.fixed_rows::<3>(3),
            velocity_m_per_s: self.increment.velocity_m_per_s + shift.fixed_rows::<3>(6),
        }
    }

    /// Difference `[b_g, b_a]` of `bias` from the bias of the integration (6 × 1).
    pub fn bias_change(&self, bias: &ImuBias) -> SVector<f64, 6> {
        let mut change = SVector::<f64, 6>::zeros();
        change.fixed_rows_mut::<3>(0).copy_from(&(bias.gyroscope_rad_per_s - self.bias.gyroscope_rad_per_s));
        change.fixed_rows_mut::<3>(3).copy_from(&(bias.accelerometer_m_per_s2 - self.bias.accelerometer_m_per_s2));
        change
    }

    /// Predicts the state at the end of the interval from the one at its start, T seconds earlier:
    ///
    /// ```text
    /// R_j = R_i ΔR    p_j = p_i + v_i T + ½ g T² + R_i Δp    v_j = v_i + g T + R_i Δv
    /// ```
    pub fn predict(&self, start: &NavigationState, gravity_in_world: &Vector3<f64>) -> NavigationState {
        let motion = self.corrected(&start.bias);
        let t = self.duration_s;
        let rotation = start.world_from_imu.rotation;
        NavigationState {
            world_from_imu: RigidTransform::new(
                so3::composed(&rotation, &motion.rotation),
                start.world_from_imu.translation_m
                    + start.velocity_m_per_s * t
                    + gravity_in_world * (0.5 * t * t)
                    + rotation * motion.position_m,
            ),
            velocity_m_per_s: start.velocity_m_per_s + gravity_in_world * t + rotation * motion.velocity_m_per_s,
            bias: start.bias,
        }
    }

    /// Lower triangular `W` (15 × 15) with `Wᵀ W = covariance⁻¹`, `None` for an empty interval.
    pub fn square_root_information(&self) -> Option<Matrix15> {
        let inverse = square_root_information(self.covariance)?;
        inverse.iter().all(|x| x.is_finite()).then_some(inverse)
    }

    fn propagate(&mut self, from: &ImuSample, to: &ImuSample) {
        let [gyroscope_noise, force_noise] = self.squared_densities(from, to);
        let corrected = |sample: &ImuSample| match &self.intrinsics {
            Some(intrinsics) => imu_errors::corrected(&intrinsics.errors, sample),
            None => *sample,
        };
        let ends = [corrected(from), corrected(to)];
        let rates = ends.map(|sample| sample.angular_velocity_rad_per_s - self.bias.gyroscope_rad_per_s);
        let forces = ends.map(|sample| sample.specific_force_m_per_s2 - self.bias.accelerometer_m_per_s2);
        let interval_s = seconds_from_ns(to.stamp_ns - from.stamp_ns);
        let step = SampleStep::new(interval_s, rates, forces, &self.increment.rotation);
        self.propagate_bias_jacobian(&step);
        self.propagate_intrinsics_jacobian(&step, [from, to]);
        let transition = step.transition();
        self.covariance = transition * self.covariance * transition.transpose();
        self.add_noise(&step, &gyroscope_noise, &force_noise);
        self.increment.position_m += self.increment.velocity_m_per_s * step.h + step.r * step.dp;
        self.increment.velocity_m_per_s += step.r * step.dv;
        self.increment.rotation = so3::composed(&self.increment.rotation, &step.rotation);
        self.duration_s += step.h;
    }

    /// Squared noise densities by axis of gyroscope and accelerometer over an interval; counts saturated samples.
    fn squared_densities(&mut self, from: &ImuSample, to: &ImuSample) -> [Vector3<f64>; 2] {
        self.repeats.count(from, to);
        let (gyroscope, gyroscope_saturated) = Repeats::densities(
            &self.repeats.gyroscope,
            &to.angular_velocity_rad_per_s,
            MIN_SATURATED_RAD_PER_S,
            self.noise.gyroscope_noise_density,
        );
        let (accelerometer, accelerometer_saturated) = Repeats::densities(
            &self.repeats.accelerometer,
            &to.specific_force_m_per_s2,
            MIN_SATURATED_M_PER_S2,
            self.noise.accelerometer_noise_density,
        );
        self.saturated += usize::from(gyroscope_saturated || accelerometer_saturated);
        // Between two samples that are far apart the motion deviates from the interpolated one like a random walk with both
        // ends fixed, whose integral over a gap T has the variance q T³/12: as white noise of density q T²/12.
        let interval_s = seconds_from_ns(to.stamp_ns - from.stamp_ns);
        let own_s = if interval_s > LONGEST_INTERVAL_S { interval_s } else { 0.0 };
        let gap_s = own_s.max(from.unmeasured_s).max(to.unmeasured_s);
        let density = |walk: f64| Vector3::repeat(walk * walk * gap_s * gap_s / 12.0);
        [gyroscope + density(ANGULAR_VELOCITY_WALK), accelerometer + density(SPECIFIC_FORCE_WALK)]
    }

    fn propagate_bias_jacobian(&mut self, step: &SampleStep) {
        let j = &mut self.bias_jacobian;
        let phi_by_bg: Matrix3<f64> = j.fixed_view::<3, 3>(0, 0).into_owned();
        let v_by_bg: Matrix3<f64> = j.fixed_view::<3, 3>(6, 0).into_owned();
        let v_by_ba: Matrix3<f64> = j.fixed_view::<3, 3>(6, 3).into_owned();
        let mut p_by_bg = j.fixed_view_mut::<3, 3>(3, 0);
        p_by_bg += v_by_bg * step.h + step.dp_by_phi * phi_by_bg - step.dp_by_w;
        let mut p_by_ba = j.fixed_view_mut::<3, 3>(3, 3);
        p_by_ba += v_by_ba * step.h - step.dp_by_a;
        let mut v_by_bg = j.fixed_view_mut::<3, 3>(6, 0);
        v_by_bg += step.dv_by_phi * phi_by_bg - step.dv_by_w;
        let mut v_by_ba = j.fixed_view_mut::<3, 3>(6, 3);
        v_by_ba -= step.dv_by_a;
        j.fixed_view_mut::<3, 3>(0, 0).copy_from(&(step.e_transpose * phi_by_bg - step.phi_by_w));
    }

    /// Propagates the Jacobian by the intrinsics over one interval; their effect on both ends is nearly equal, so that its
    /// mean over the interval is used.
    fn propagate_intrinsics_jacobian(&mut self, step: &SampleStep, ends: [&ImuSample; 2]) {
        let Some(intrinsics) = &mut self.intrinsics else { return };
        let [first, second] = ends.map(|sample| imu_errors::derivatives(&intrinsics.errors, sample));
        let (rates, forces) = ((first.0 + second.0) * 0.5, (first.1 + second.1) * 0.5);
        let j = &mut intrinsics.jacobian;
        let phi: SMatrix<f64, 3, 15> = j.fixed_rows::<3>(0).into_owned();
        let velocity: SMatrix<f64, 3, 15> = j.fixed_rows::<3>(6).into_owned();
        let mut position = j.fixed_rows_mut::<3>(3);
        position += velocity * step.h + step.dp_by_phi * phi + step.dp_by_w * rates + step.dp_by_a * forces;
        let mut velocity = j.fixed_rows_mut::<3>(6);
        velocity += step.dv_by_phi * phi + step.dv_by_w * rates + step.dv_by_a * forces;
        j.fixed_rows_mut::<3>(0).copy_from(&(step.e_transpose * phi + step.phi_by_w * rates));
    }

    /// Adds white noise and random walk of one sample interval (15 × 15), from the squared continuous densities of
    /// angular velocity and specific force by axis.
    fn add_noise(&mut self, step: &SampleStep, gyroscope_noise: &Vector3<f64>, force_noise: &Vector3<f64>) {
        let h = step.h;
        let square = |density: f64| density * density;
        let mut by_angular_rate = SMatrix::<f64, 9, 3>::zeros();
        by_angular_rate.fixed_view_mut::<3, 3>(0, 0).copy_from(&step.phi_by_w);
        by_angular_rate.fixed_view_mut::<3, 3>(3, 0).copy_from(&step.dp_by_w);
        by_angular_rate.fixed_view_mut::<3, 3>(6, 0).copy_from(&step.dv_by_w);
        let mut motion = self.covariance.fixed_view_mut::<9, 9>(0, 0);
        motion += by_angular_rate * Matrix3::from_diagonal(gyroscope_noise) * by_angular_rate.transpose() / h;
        // White noise of the specific force correlates velocity and position over the interval.
        let force_noise = step.r * Matrix3::from_diagonal(force_noise) * step.r.transpose();
        for (row, column, factor) in [(3, 3, h * h * h / 3.0), (3, 6, h * h / 2.0), (6, 3, h * h / 2.0), (6, 6, h)] {
            let mut block = self.covariance.fixed_view_mut::<3, 3>(row, column);
            block += force_noise * factor;
        }
        for axis in 0..3 {
            self.covariance[(9 + axis, 9 + axis)] += square(self.noise.gyroscope_random_walk) * h;
            self.covariance[(12 + axis, 12 + axis)] += square(self.noise.accelerometer_random_walk) * h;
        }
    }
}

/// Motion over one sample interval in the frame at its start, with derivatives in the frame of the increment: by a
/// constant change of ω and of a over the interval, and by the rotation φ of the increment before it.
struct SampleStep {
    h: f64,
    /// Rotation over the interval, `E = Exp(φ)`.
    rotation: UnitQuaternion<f64>,
    e_transpose: Matrix3<f64>,
    /// `ΔR` before the interval.
    r: Matrix3<f64>,
    dp: Vector3<f64>,
    dv: Vector3<f64>,
    phi_by_w: Matrix3<f64>,
    dp_by_w: Matrix3<f64>,
    dv_by_w: Matrix3<f64>,
    dp_by_a: Matrix3<f64>,
    dv_by_a: Matrix3<f64>,
    dp_by_phi: Matrix3<f64>,
    dv_by_phi: Matrix3<f64>,
}

impl SampleStep {
    /// Step over h seconds between rates and forces without bias, after the rotation ΔR.
    fn new(
        h: f64,
        [w0, w1]: [Vector3<f64>; 2],
        [a0, a1]: [Vector3<f64>; 2],
        rotation_before: &UnitQuaternion<f64>,
    ) -> Self {
        let (w_half, a_half) = ((w0 + w1) * 0.5, (a0 + a1) * 0.5);
        let phi_half = so3::of_linear_rate(&w0, &w_half, 0.5 * h);
        let phi = so3::of_linear_rate(&w0, &w1, h);
        let (half_rotation, rotation) = (so3::exp(&phi_half), so3::exp(&phi));
        let force_half = half_rotation * a_half;
        let dv = (a0 + force_half * 4.0 + rotation * a1) * (h / 6.0);
        let dp = (a0 + force_half * 2.0) * (h * h / 6.0);

        let r = rotation_before.to_rotation_matrix().into_inner();
        let e_half: Matrix3<f64> = half_rotation.to_rotation_matrix().into_inner();
        let e: Matrix3<f64> = rotation.to_rotation_matrix().into_inner();
        let identity = Matrix3::identity();
        let phi_by_w = so3::right_jacobian(&phi) * (identity * h - so3::hat(&(w1 - w0)) * (h * h / 12.0));
        let phi_half_by_w =
            so3::right_jacobian(&phi_half) * (identity * (0.5 * h) - so3::hat(&(w_half - w0)) * (h * h / 48.0));
        // Derivatives of `E_½ a_½` and of `E a₁`.
        let half_by_w = -(e_half * so3::hat(&a_half) * phi_half_by_w);
        let end_by_w = -(e * so3::hat(&a1) * phi_by_w);
        Self {
            h,
            rotation,
            e_transpose: e.transpose(),
            r,
            dp,
            dv,
            phi_by_w,
            dp_by_w: r * half_by_w * (h * h / 3.0),
            dv_by_w: r * (half_by_w * 4.0 + end_by_w) * (h / 6.0),
            dp_by_a: r * (identity + e_half * 2.0) * (h * h / 6.0),
            dv_by_a: r * (identity + e_half * 4.0 + e) * (h / 6.0),
            dp_by_phi: -(r * so3::hat(&dp)),
            dv_by_phi: -(r * so3::hat(&dv)),
        }
    }

    /// Transition A (15 × 15) of the error `[φ, p, v, b_g, b_a]`; a bias acts as a negative change of ω or a.
    fn transition(&self) -> Matrix15 {
        let mut transition = Matrix15::identity();
        transition.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.e_transpose);
        transition.fixed_view_mut::<3, 3>(0, 9).copy_from(&-self.phi_by_w);
        transition.fixed_view_mut::<3, 3>(3, 0).copy_from(&self.dp_by_phi);
        transition.fixed_view_mut::<3, 3>(3, 6).copy_from(&(Matrix3::identity() * self.h));
        transition.fixed_view_mut::<3, 3>(3, 9).copy_from(&-self.dp_by_w);
        transition.fixed_view_mut::<3, 3>(3, 12).copy_from(&-self.dp_by_a);
        transition.fixed_view_mut::<3, 3>(6, 0).copy_from(&self.dv_by_phi);
        transition.fixed_view_mut::<3, 3>(6, 9).copy_from(&-self.dv_by_w);
        transition.fixed_view_mut::<3, 3>(6, 12).copy_from(&-self.dv_by_a);
        transition
    }
}
