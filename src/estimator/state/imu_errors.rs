//! Scale, misalignment and rotation errors of the IMU, as unknowns.

use nalgebra::{SMatrix, SVector, Vector3};

use crate::geometry::so3;
use crate::gimbal::{ParameterId, ParameterPart, Quantity};
use crate::sensors::{ImuIntrinsics, ImuIntrinsicsParameters, ImuSample, ScaleMisalignment};

pub(crate) const IMU_ERRORS: usize = 15;

/// Parameters of the correction of samples (15 × 1): gyroscope scale (3), misalignment (3) and rotation vector (3),
/// accelerometer scale (3) and misalignment (3), as in [`ImuIntrinsicsParameters`].
pub(crate) type ImuErrors = SVector<f64, IMU_ERRORS>;

pub(crate) fn parameters() -> Vec<ParameterId> {
    let of = |part: ParameterPart| move |quantity: Quantity| ParameterId { part, quantity };
    let gyroscope = Quantity::SCALE_MISALIGNMENT.into_iter().chain(Quantity::ROTATION);
    let gyroscope = gyroscope.map(of(ParameterPart::Gyroscope));
    gyroscope.chain(Quantity::SCALE_MISALIGNMENT.map(of(ParameterPart::Accelerometer))).collect()
}

/// Correction with these parameters.
pub(crate) fn intrinsics(errors: &ImuErrors) -> ImuIntrinsics {
    let three = |first: usize| errors.fixed_rows::<3>(first).into_owned();
    ImuIntrinsics::from_parameters(&ImuIntrinsicsParameters {
        gyroscope: ScaleMisalignment { scale: three(0), misalignment: three(3) },
        gyroscope_rotation_rad: three(6),
        accelerometer: ScaleMisalignment { scale: three(9), misalignment: three(12) },
    })
}

/// Parameters of a correction.
pub(crate) fn of_intrinsics(intrinsics: &ImuIntrinsics) -> ImuErrors {
    let parameters = intrinsics.parameters();
    let parts = [
        parameters.gyroscope.scale,
        parameters.gyroscope.misalignment,
        parameters.gyroscope_rotation_rad,
        parameters.accelerometer.scale,
        parameters.accelerometer.misalignment,
    ];
    ImuErrors::from_iterator(parts.iter().flat_map(Vector3::iter).copied())
}

pub(crate) fn corrected(errors: &ImuErrors, sample: &ImuSample) -> ImuSample {
    intrinsics(errors).correct(sample)
}

/// Derivatives of the corrected angular velocity and of the corrected specific force by the parameters (3 × 15 each).
///
/// ```text
/// ω = Exp(r) U ω_m    ∂ω/∂u = Exp(r) ∂(U ω_m)/∂u    ∂ω/∂r = −Exp(r) [U ω_m]× J_r(r)
/// ```
pub(crate) fn derivatives(
    errors: &ImuErrors,
    sample: &ImuSample,
) -> (SMatrix<f64, 3, IMU_ERRORS>, SMatrix<f64, 3, IMU_ERRORS>) {
    let rotation_vector: Vector3<f64> = errors.fixed_rows::<3>(6).into_owned();
    let rotation = so3::exp(&rotation_vector).to_rotation_matrix().into_inner();
    let measured = sample.angular_velocity_rad_per_s;
    let without_rotation = rotation.transpose() * intrinsics(errors).correct_angular_velocity(&measured);
    let mut rates = SMatrix::<f64, 3, IMU_ERRORS>::zeros();
    rates.fixed_view_mut::<3, 6>(0, 0).copy_from(&(rotation * by_scale_misalignment(&measured)));
    let by_rotation = -(rotation * so3::hat(&without_rotation) * so3::right_jacobian(&rotation_vector));
    rates.fixed_view_mut::<3, 3>(0, 6).copy_from(&by_rotation);
    let mut forces = SMatrix::<f64, 3, IMU_ERRORS>::zeros();
    forces.fixed_view_mut::<3, 6>(0, 9).copy_from(&by_scale_misalignment(&sample.specific_force_m_per_s2));
    (rates, forces)
}

/// Derivative of `U m` by `[sx, sy, sz, mxy, mxz, myz]` (3 × 6).
fn by_scale_misalignment(measured: &Vector3<f64>) -> SMatrix<f64, 3, 6> {
    let (x, y, z) = (measured.x, measured.y, measured.z);
    #[rustfmt::skip]
    let by = SMatrix::<f64, 3, 6>::new(
        x, 0.0, 0.0, y, z, 0.0,
        0.0, y, 0.0, 0.0, 0.0, z,
        0.0, 0.0, z, 0.0, 0.0, 0.0,
    );
    by
}
