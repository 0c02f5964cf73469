//! IMU factor between two frames: the term `‖r_B(z, X)‖²` of Eq. 8 with its Jacobians.

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

/// Residual `[φ, p, v]` (9 × 1) of a motion increment `(ΔR, Δp, Δv)` against the states i and j, T seconds apart: the
/// IMU term of Eq. 8 (Forster et al., TRO 2017), not whitened.
///
/// ```text
/// r_φ = Log(ΔRᵀ R_iᵀ R_j)    r_p = R_iᵀ (p_j − p_i − v_i T − ½ g T²) − Δp    r_v = R_iᵀ (v_j − v_i − g T) − Δv
/// ```
///
/// Gravity g is in the frame of the poses, in m/s².
#[expect(non_snake_case, reason = "letters of the formula")]
pub fn motion_residual(
    motion: &MotionIncrement,
    duration_s: f64,
    from: &NavigationState,
    to: &NavigationState,
    gravity: &Vector3<f64>,
) -> Vector9 {
    let R_iT = from.world_from_imu.rotation.inverse();
    let R_ij = R_iT * to.world_from_imu.rotation;
    let (p_ij, v_ij) = displacement(duration_s, from, to, gravity);
    let mut r = Vector9::zeros();
    r.fixed_rows_mut::<3>(0).copy_from(&so3::log(&(motion.rotation.inverse() * R_ij)));
    r.fixed_rows_mut::<3>(3).copy_from(&(R_iT * p_ij - motion.position_m));
    r.fixed_rows_mut::<3>(6).copy_from(&(R_iT * v_ij - motion.velocity_m_per_s));
    r
}

/// Derivatives of [`motion_residual`]; rotations are perturbed on the right.
///
/// ```text
/// by φ_i: [−J_r⁻¹(r_φ) R_jᵀ R_i; [R_iᵀ p_ij]×; [R_iᵀ v_ij]×]    by p_i: [0; −R_iᵀ; 0]    by v_i: [0; −R_iᵀ T; −R_iᵀ]
/// by φ_j: [J_r⁻¹(r_φ); 0; 0]                                  by p_j: [0; R_iᵀ; 0]     by v_j: [0; 0; R_iᵀ]
/// by g: [0; −½ R_iᵀ T²; −R_iᵀ T]    by the increment: [−J_r⁻¹(r_φ) Exp(−r_φ); −I; −I]
/// ```
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
    #[expect(non_snake_case, reason = "letters of the formula")]
    pub fn new(
        motion: &MotionIncrement,
        duration_s: f64,
        from: &NavigationState,
        to: &NavigationState,
        gravity: &Vector3<f64>,
    ) -> Self {
        let R_ij = from.world_from_imu.rotation.inverse() * to.world_from_imu.rotation;
        let R_iT: Matrix3<f64> = from.world_from_imu.rotation.inverse().to_rotation_matrix().into_inner();
        let R_ijT: Matrix3<f64> = R_ij.inverse().to_rotation_matrix().into_inner();
        let r_phi = so3::log(&(motion.rotation.inverse() * R_ij));
        let J_inv = so3::right_jacobian_inverse(&r_phi);
        let Exp_minus_r: Matrix3<f64> = so3::exp(&-r_phi).to_rotation_matrix().into_inner();
        let (p_ij, v_ij) = displacement(duration_s, from, to, gravity);

        let mut by_from = Matrix9::zeros();
        by_from.fixed_view_mut::<3, 3>(0, 0).copy_from(&-(J_inv * R_ijT));
        by_from.fixed_view_mut::<3, 3>(3, 0).copy_from(&so3::hat(&(R_iT * p_ij)));
        by_from.fixed_view_mut::<3, 3>(3, 3).copy_from(&-R_iT);
        by_from.fixed_view_mut::<3, 3>(3, 6).copy_from(&(-R_iT * duration_s));
        by_from.fixed_view_mut::<3, 3>(6, 0).copy_from(&so3::hat(&(R_iT * v_ij)));
        by_from.fixed_view_mut::<3, 3>(6, 6).copy_from(&-R_iT);
        let mut by_to = Matrix9::zeros();
        by_to.fixed_view_mut::<3, 3>(0, 0).copy_from(&J_inv);
        by_to.fixed_view_mut::<3, 3>(3, 3).copy_from(&R_iT);
        by_to.fixed_view_mut::<3, 3>(6, 6).copy_from(&R_iT);
        let mut by_gravity = SMatrix::<f64, 9, 3>::zeros();
        by_gravity.fixed_view_mut::<3, 3>(3, 0).copy_from(&(R_iT * (-0.5 * duration_s * duration_s)));
        by_gravity.fixed_view_mut::<3, 3>(6, 0).copy_from(&(R_iT * -duration_s));
        Self { by_from, by_to, by_gravity, rotation_by_motion: -(J_inv * Exp_minus_r) }
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

/// `p_ij = p_j − p_i − v_i T − ½ g T²` and `v_ij = v_j − v_i − g T`, in the frame of the poses.
fn displacement(
    t: f64,
    from: &NavigationState,
    to: &NavigationState,
    gravity: &Vector3<f64>,
) -> (Vector3<f64>, Vector3<f64>) {
    let p_ij = to.world_from_imu.translation_m
        - from.world_from_imu.translation_m
        - from.velocity_m_per_s * t
        - gravity * (0.5 * t * t);
    (p_ij, to.velocity_m_per_s - from.velocity_m_per_s - gravity * t)
}

/// Residual `[φ, p, v, b_g, b_a]` (15 × 1) of two states given the IMU samples between them, not whitened:
/// [`motion_residual`] with the increment corrected to the biases of the earlier state, and `b_j − b_i`. Intrinsics of
/// the IMU are `None` if they are not estimated.
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
