//! IMU residual between two frames and its Jacobians.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::factor::{Factor, JacobianBlock, NavigationColumns, Point, Sink, WhitenedRows};
use super::kind::FactorLabel;
use crate::estimator::state::frame_state::FrameState;
use crate::estimator::state::imu_errors::ImuErrors;
use crate::estimator::state::navigation::{Matrix15, NavigationState, Vector15};
use crate::estimator::state::preintegration::{MotionIncrement, Preintegration};
use crate::geometry::so3;

type Vector9 = SVector<f64, 9>;
type Matrix9 = SMatrix<f64, 9, 9>;

/// IMU factor between two frames of a window (IMU term of Eq. 8): 15 rows `[φ, p, v, b_g, b_a]`.
#[derive(Clone, Debug)]
pub(crate) struct ImuFactor<'a> {
    /// Slot of the later frame.
    pub(crate) slot: usize,
    pub(crate) motion: &'a Preintegration,
    /// Square-root information of `motion` (15 × 15).
    pub(crate) information: &'a Matrix15,
    /// Gravity in the world frame, in m/s².
    pub(crate) gravity_in_world: &'a Vector3<f64>,
    /// States of the earlier and of the later frame.
    pub(crate) current: [&'a NavigationState; 2],
    /// The same at the linearization point.
    pub(crate) linearized: [&'a NavigationState; 2],
    /// Columns of both states.
    pub(crate) columns: [NavigationColumns; 2],
    /// Intrinsics of the IMU with their first column, `None` if they are not estimated.
    pub(crate) intrinsics: Option<(&'a ImuErrors, usize)>,
}

impl<'a> ImuFactor<'a> {
    /// Factor that ends at `slot`, `None` without IMU samples.
    pub(crate) fn of(point: &Point<'a>, slot: usize) -> Option<Self> {
        let (frame, layout, calibration) = (&point.frames[slot], &point.layout, &point.at.calibration);
        let first = layout.calibration().start + calibration.imu_columns().start;
        let states = |states: &'a [FrameState]| [&states[slot - 1].navigation, &states[slot].navigation];
        Some(Self {
            slot,
            motion: &frame.motion,
            information: frame.motion.information()?,
            gravity_in_world: point.gravity_in_world,
            current: states(&point.at.frames),
            linearized: states(&point.linearized.frames),
            columns: [slot - 1, slot].map(|slot| NavigationColumns::of(layout, slot)),
            intrinsics: calibration.imu_errors().map(|errors| (errors, first)),
        })
    }
}

impl Factor for ImuFactor<'_> {
    fn label(&self) -> FactorLabel {
        FactorLabel::Imu(self.slot as u16)
    }

    fn rows<S: Sink>(&self, sink: &mut S) {
        let errors = self.intrinsics.map(|(errors, _)| errors);
        let [from, to] = self.current;
        let residual = self.information * residual(self.motion, from, to, self.gravity_in_world, errors);
        let mut rows = WhitenedRows { residual: residual.as_slice(), blocks: &[], products: None };
        if !S::DERIVATIVES {
            return sink.add(self.label(), &rows);
        }
        let [from, to] = self.linearized;
        let [by_from, by_to, by_intrinsics] = jacobians(self.motion, from, to, self.gravity_in_world, errors);
        let [by_from, by_to] = [by_from, by_to].map(|by_state| sparse_product(self.information, &by_state));
        let [from, to] = self.columns;
        let mut blocks = Vec::with_capacity(7);
        blocks.extend(from.blocks(by_from.as_slice()));
        blocks.extend(to.blocks(by_to.as_slice()));
        let by_intrinsics = sparse_product(self.information, &by_intrinsics);
        blocks.extend(self.intrinsics.map(|(_, start)| JacobianBlock { start, entries: by_intrinsics.as_slice() }));
        rows.blocks = &blocks;
        sink.add(self.label(), &rows);
    }
}

/// Residual `[φ, p, v]` (9 × 1) of a motion increment against two states (IMU term of Eq. 8), not whitened.
///
/// `duration_s` is the time between the states; gravity is in the frame of the poses, in m/s².
pub fn motion_residual(
    motion: &MotionIncrement,
    duration_s: f64,
    from: &NavigationState,
    to: &NavigationState,
    gravity: &Vector3<f64>,
) -> Vector9 {
    let back = from.world_from_imu.rotation.inverse();
    let relative_rotation = back * to.world_from_imu.rotation;
    let (shift, gain) = moved(duration_s, from, to, gravity);
    let mut residual = Vector9::zeros();
    residual.fixed_rows_mut::<3>(0).copy_from(&so3::log(&(motion.rotation.inverse() * relative_rotation)));
    residual.fixed_rows_mut::<3>(3).copy_from(&(back * shift - motion.position_m));
    residual.fixed_rows_mut::<3>(6).copy_from(&(back * gain - motion.velocity_m_per_s));
    residual
}

/// Derivatives of [`motion_residual`]; rotations are perturbed on the right.
#[derive(Clone, Debug)]
pub struct MotionJacobians {
    /// By `[φ, p, v]` of the earlier state (9 × 9).
    pub by_from: Matrix9,
    /// By `[φ, p, v]` of the later state (9 × 9).
    pub by_to: Matrix9,
    pub by_gravity: SMatrix<f64, 9, 3>,
    /// Of the rows φ by the rotation of the increment (3 × 3); the rows p and v have −I by its position and velocity.
    pub rotation_by_motion: Matrix3<f64>,
}

impl MotionJacobians {
    pub fn new(
        motion: &MotionIncrement,
        duration_s: f64,
        from: &NavigationState,
        to: &NavigationState,
        gravity: &Vector3<f64>,
    ) -> Self {
        let back_rotation = from.world_from_imu.rotation.inverse();
        let back: Matrix3<f64> = back_rotation.to_rotation_matrix().into_inner();
        let relative_rotation = back_rotation * to.world_from_imu.rotation;
        let rotation_error = so3::log(&(motion.rotation.inverse() * relative_rotation));
        let error_inverse = so3::right_jacobian_inverse(&rotation_error);
        let relative_rotation_transpose: Matrix3<f64> = relative_rotation.inverse().to_rotation_matrix().into_inner();
        let error_back: Matrix3<f64> = so3::exp(&-rotation_error).to_rotation_matrix().into_inner();
        let (shift, gain) = moved(duration_s, from, to, gravity);

        let mut by_from = Matrix9::zeros();
        by_from.fixed_view_mut::<3, 3>(0, 0).copy_from(&-(error_inverse * relative_rotation_transpose));
        by_from.fixed_view_mut::<3, 3>(3, 0).copy_from(&so3::hat(&(back * shift)));
        by_from.fixed_view_mut::<3, 3>(3, 3).copy_from(&-back);
        by_from.fixed_view_mut::<3, 3>(3, 6).copy_from(&(-back * duration_s));
        by_from.fixed_view_mut::<3, 3>(6, 0).copy_from(&so3::hat(&(back * gain)));
        by_from.fixed_view_mut::<3, 3>(6, 6).copy_from(&-back);
        let mut by_to = Matrix9::zeros();
        by_to.fixed_view_mut::<3, 3>(0, 0).copy_from(&error_inverse);
        by_to.fixed_view_mut::<3, 3>(3, 3).copy_from(&back);
        by_to.fixed_view_mut::<3, 3>(6, 6).copy_from(&back);
        let mut by_gravity = SMatrix::<f64, 9, 3>::zeros();
        by_gravity.fixed_view_mut::<3, 3>(3, 0).copy_from(&(back * (-0.5 * duration_s * duration_s)));
        by_gravity.fixed_view_mut::<3, 3>(6, 0).copy_from(&(back * -duration_s));
        Self { by_from, by_to, by_gravity, rotation_by_motion: -(error_inverse * error_back) }
    }

    /// Chain rule: derivative by `n` parameters of which the increment `[φ, p, v]` has the derivative `motion_by`
    /// (9 × n).
    pub fn by_parameters<const N: usize>(&self, motion_by: &SMatrix<f64, 9, N>) -> SMatrix<f64, 9, N> {
        let mut derivative = SMatrix::<f64, 9, N>::zeros();
        derivative.fixed_rows_mut::<3>(0).copy_from(&(self.rotation_by_motion * motion_by.fixed_rows::<3>(0)));
        derivative.fixed_rows_mut::<6>(3).copy_from(&-motion_by.fixed_rows::<6>(3));
        derivative
    }
}

/// Displacement and change of velocity between two states without gravity and initial velocity, in the frame of the
/// poses.
fn moved(t: f64, from: &NavigationState, to: &NavigationState, gravity: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let shift = to.world_from_imu.translation_m
        - from.world_from_imu.translation_m
        - from.velocity_m_per_s * t
        - gravity * (0.5 * t * t);
    (shift, to.velocity_m_per_s - from.velocity_m_per_s - gravity * t)
}

/// Residual `[φ, p, v, b_g, b_a]` (15 × 1) of two states given the IMU samples between them, not whitened; intrinsics
/// of the IMU are `None` if they are not estimated.
pub(crate) fn residual(
    preintegration: &Preintegration,
    from: &NavigationState,
    to: &NavigationState,
    gravity_in_world: &Vector3<f64>,
    errors: Option<&ImuErrors>,
) -> Vector15 {
    let motion = preintegration.shifted(&preintegration.shift(&from.bias, errors));
    let mut residual = Vector15::zeros();
    residual.fixed_rows_mut::<9>(0).copy_from(&motion_residual(
        &motion,
        preintegration.duration_s(),
        from,
        to,
        gravity_in_world,
    ));
    residual.fixed_rows_mut::<3>(9).copy_from(&(to.bias.gyroscope_rad_per_s - from.bias.gyroscope_rad_per_s));
    residual.fixed_rows_mut::<3>(12).copy_from(&(to.bias.accelerometer_m_per_s2 - from.bias.accelerometer_m_per_s2));
    residual
}

/// Derivatives of [`residual`] by `from`, by `to` (each 15 × 15 in the order `[φ, p, v, b_g, b_a]`), and by the
/// intrinsics of the IMU (15 × 15, zero without any).
pub(crate) fn jacobians(
    preintegration: &Preintegration,
    from: &NavigationState,
    to: &NavigationState,
    gravity_in_world: &Vector3<f64>,
    errors: Option<&ImuErrors>,
) -> [Matrix15; 3] {
    let total_shift = preintegration.shift(&from.bias, errors);
    let motion = preintegration.shifted(&total_shift);
    let mut jacobians = MotionJacobians::new(&motion, preintegration.duration_s(), from, to, gravity_in_world);
    // The correction of the increment rotates by Exp(J δb).
    jacobians.rotation_by_motion *= so3::right_jacobian(&total_shift.fixed_rows::<3>(0).into_owned());
    let identity = SMatrix::<f64, 6, 6>::identity();
    let mut by_from = Matrix15::zeros();
    by_from.fixed_view_mut::<9, 9>(0, 0).copy_from(&jacobians.by_from);
    by_from.fixed_view_mut::<9, 6>(0, 9).copy_from(&jacobians.by_parameters(preintegration.bias_jacobian()));
    by_from.fixed_view_mut::<6, 6>(9, 9).copy_from(&-identity);
    let mut by_to = Matrix15::zeros();
    by_to.fixed_view_mut::<9, 9>(0, 0).copy_from(&jacobians.by_to);
    by_to.fixed_view_mut::<6, 6>(9, 9).copy_from(&identity);
    let mut by_intrinsics = Matrix15::zeros();
    if errors.is_some() {
        let by_errors = jacobians.by_parameters(&preintegration.intrinsics_jacobian());
        by_intrinsics.fixed_rows_mut::<9>(0).copy_from(&by_errors);
    }
    [by_from, by_to, by_intrinsics]
}

/// `left · right` for a mostly zero right matrix.
fn sparse_product(left: &Matrix15, right: &Matrix15) -> Matrix15 {
    let mut product = Matrix15::zeros();
    for (target, factors) in product.data.0.iter_mut().zip(&right.data.0) {
        for (column, factor) in left.data.0.iter().zip(factors) {
            if *factor != 0.0 {
                for (entry, source) in target.iter_mut().zip(column) {
                    *entry += source * factor;
                }
            }
        }
    }
    product
}
