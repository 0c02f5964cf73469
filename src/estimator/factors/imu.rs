//! IMU residual between two frames and its Jacobians.

use nalgebra::{Matrix3, Vector3};

use super::factor::{Block, Factor, Point, Rows, Sink};
use super::kind::FactorLabel;
use crate::estimator::state::frame_state::FrameState;
use crate::estimator::state::imu_errors::ImuErrors;
use crate::estimator::state::layout::POSE;
use crate::estimator::state::navigation::{Matrix15, NavigationState, Vector15};
use crate::estimator::state::preintegration::Preintegration;
use crate::geometry::so3;

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
    /// First columns of `[φ, p]` of both frames.
    pub(crate) poses: [usize; 2],
    /// First columns of `[v, b_g, b_a]` of both frames.
    pub(crate) velocity_biases: [usize; 2],
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
            information: frame.motion_information.as_ref()?,
            gravity_in_world: point.gravity_in_world,
            current: states(&point.at.frames),
            linearized: states(point.linearized),
            poses: [slot - 1, slot].map(|slot| layout.pose(slot).start),
            velocity_biases: [slot - 1, slot].map(|slot| layout.velocity_bias(slot).start),
            intrinsics: calibration.imu_errors().map(|errors| (errors, first)),
        })
    }
}

impl Factor for ImuFactor<'_> {
    fn label(&self) -> FactorLabel {
        FactorLabel::Imu(self.slot as u8)
    }

    fn rows<S: Sink>(&self, sink: &mut S) {
        let errors = self.intrinsics.map(|(errors, _)| errors);
        let [from, to] = self.current;
        let residual = self.information * residual_with(self.motion, from, to, self.gravity_in_world, errors);
        let mut rows = Rows { residual: residual.as_slice(), blocks: &[], products: None };
        if !S::DERIVATIVES {
            return sink.add(self.label(), &rows);
        }
        let [from, to] = self.linearized;
        let (by_from, by_to, by_intrinsics) = jacobians_with(self.motion, from, to, self.gravity_in_world, errors);
        let [by_from, by_to] = [by_from, by_to].map(|by_state| sparse_product(self.information, &by_state));
        let mut blocks = Vec::with_capacity(5);
        for (index, by_state) in [&by_from, &by_to].into_iter().enumerate() {
            let (by_pose, by_velocity_bias) = by_state.as_slice().split_at(ROWS * POSE);
            blocks.push(Block { start: self.poses[index], entries: by_pose });
            blocks.push(Block { start: self.velocity_biases[index], entries: by_velocity_bias });
        }
        let by_intrinsics = sparse_product(self.information, &by_intrinsics);
        blocks.extend(self.intrinsics.map(|(_, start)| Block { start, entries: by_intrinsics.as_slice() }));
        rows.blocks = &blocks;
        sink.add(self.label(), &rows);
    }
}

/// Number of rows.
const ROWS: usize = 15;

/// Residual `[φ, p, v, b_g, b_a]` (15 × 1) of two states given the IMU samples between them (IMU term of Eq. 8),
/// not whitened.
pub fn residual(
    preintegration: &Preintegration,
    from: &NavigationState,
    to: &NavigationState,
    gravity_in_world: &Vector3<f64>,
) -> Vector15 {
    residual_with(preintegration, from, to, gravity_in_world, None)
}

/// [`residual`] with intrinsics of the IMU, `None` if they are not estimated.
pub(crate) fn residual_with(
    preintegration: &Preintegration,
    from: &NavigationState,
    to: &NavigationState,
    gravity_in_world: &Vector3<f64>,
    errors: Option<&ImuErrors>,
) -> Vector15 {
    let motion = preintegration.shifted(&preintegration.shift(&from.bias, errors));
    let t = preintegration.duration_s();
    let back = from.world_from_imu.rotation.inverse();
    let relative_rotation = back * to.world_from_imu.rotation;
    let shift = to.world_from_imu.translation_m
        - from.world_from_imu.translation_m
        - from.velocity_m_per_s * t
        - gravity_in_world * (0.5 * t * t);
    let gain = to.velocity_m_per_s - from.velocity_m_per_s - gravity_in_world * t;

    let mut residual = Vector15::zeros();
    residual.fixed_rows_mut::<3>(0).copy_from(&so3::log(&(motion.rotation.inverse() * relative_rotation)));
    residual.fixed_rows_mut::<3>(3).copy_from(&(back * shift - motion.position_m));
    residual.fixed_rows_mut::<3>(6).copy_from(&(back * gain - motion.velocity_m_per_s));
    residual.fixed_rows_mut::<3>(9).copy_from(&(to.bias.gyroscope_rad_per_s - from.bias.gyroscope_rad_per_s));
    residual.fixed_rows_mut::<3>(12).copy_from(&(to.bias.accelerometer_m_per_s2 - from.bias.accelerometer_m_per_s2));
    residual
}

/// Derivatives of [`residual`] with respect to `from` and to `to`, each 15 × 15 in the order `[φ, p, v, b_g, b_a]`.
pub fn jacobians(
    preintegration: &Preintegration,
    from: &NavigationState,
    to: &NavigationState,
    gravity_in_world: &Vector3<f64>,
) -> (Matrix15, Matrix15) {
    let (by_from, by_to, _) = jacobians_with(preintegration, from, to, gravity_in_world, None);
    (by_from, by_to)
}

/// [`jacobians`] with intrinsics of the IMU; the third matrix is the derivative by these (15 × 15, zero without any).
pub(crate) fn jacobians_with(
    preintegration: &Preintegration,
    from: &NavigationState,
    to: &NavigationState,
    gravity_in_world: &Vector3<f64>,
    errors: Option<&ImuErrors>,
) -> (Matrix15, Matrix15, Matrix15) {
    let t = preintegration.duration_s();
    let by_bias = preintegration.bias_jacobian();
    let total_shift = preintegration.shift(&from.bias, errors);
    let motion = preintegration.shifted(&total_shift);
    let back_rotation = from.world_from_imu.rotation.inverse();
    let back: Matrix3<f64> = back_rotation.to_rotation_matrix().into_inner();
    let relative_rotation = back_rotation * to.world_from_imu.rotation;
    let rotation_error = so3::log(&(motion.rotation.inverse() * relative_rotation));
    let error_inverse = so3::right_jacobian_inverse(&rotation_error);
    let relative_rotation_transpose: Matrix3<f64> = relative_rotation.inverse().to_rotation_matrix().into_inner();
    let shift = to.world_from_imu.translation_m
        - from.world_from_imu.translation_m
        - from.velocity_m_per_s * t
        - gravity_in_world * (0.5 * t * t);
    let gain = to.velocity_m_per_s - from.velocity_m_per_s - gravity_in_world * t;
    let identity = Matrix3::<f64>::identity();

    // The bias correction rotates by Exp(J δb): its derivative is transformed by the rotation error.
    let correction = total_shift.fixed_rows::<3>(0).into_owned();
    let error_back: Matrix3<f64> = so3::exp(&-rotation_error).to_rotation_matrix().into_inner();
    let phi_by_correction = -(error_inverse * error_back * so3::right_jacobian(&correction));
    let phi_by_bias = phi_by_correction * by_bias.fixed_view::<3, 6>(0, 0);

    let mut by_from = Matrix15::zeros();
    by_from.fixed_view_mut::<3, 3>(0, 0).copy_from(&-(error_inverse * relative_rotation_transpose));
    by_from.fixed_view_mut::<3, 6>(0, 9).copy_from(&phi_by_bias);
    by_from.fixed_view_mut::<3, 3>(3, 0).copy_from(&so3::hat(&(back * shift)));
    by_from.fixed_view_mut::<3, 3>(3, 3).copy_from(&-back);
    by_from.fixed_view_mut::<3, 3>(3, 6).copy_from(&(-back * t));
    by_from.fixed_view_mut::<3, 6>(3, 9).copy_from(&-by_bias.fixed_view::<3, 6>(3, 0));
    by_from.fixed_view_mut::<3, 3>(6, 0).copy_from(&so3::hat(&(back * gain)));
    by_from.fixed_view_mut::<3, 3>(6, 6).copy_from(&-back);
    by_from.fixed_view_mut::<3, 6>(6, 9).copy_from(&-by_bias.fixed_view::<3, 6>(6, 0));
    by_from.fixed_view_mut::<3, 3>(9, 9).copy_from(&-identity);
    by_from.fixed_view_mut::<3, 3>(12, 12).copy_from(&-identity);

    let mut by_to = Matrix15::zeros();
    by_to.fixed_view_mut::<3, 3>(0, 0).copy_from(&error_inverse);
    by_to.fixed_view_mut::<3, 3>(3, 3).copy_from(&back);
    by_to.fixed_view_mut::<3, 3>(6, 6).copy_from(&back);
    by_to.fixed_view_mut::<3, 3>(9, 9).copy_from(&identity);
    by_to.fixed_view_mut::<3, 3>(12, 12).copy_from(&identity);

    let mut by_intrinsics = Matrix15::zeros();
    if errors.is_some() {
        let increment = preintegration.intrinsics_jacobian();
        by_intrinsics.fixed_rows_mut::<3>(0).copy_from(&(phi_by_correction * increment.fixed_rows::<3>(0)));
        by_intrinsics.fixed_rows_mut::<6>(3).copy_from(&-increment.fixed_rows::<6>(3));
    }
    (by_from, by_to, by_intrinsics)
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
