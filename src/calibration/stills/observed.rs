//! Pose loops of one set: rigid camera, chain and gimbal camera must agree on the world.
//!
//! Of each rigid camera `s` the residual compares the measured `rigid_from_gimbal` `M = T_s_w·T_g_w⁻¹` with the predicted
//! one `A = F_s·T_I_C(q)`, `F_s` being `rigid_from_first`:
//!
//! ```text
//! E = M⁻¹·A,  r = [Log R_E; t_E]                       (6 per loop; rad and m, in the gimbal camera's frame)
//! ∂r/∂[φ; δt] of T_I_C:  [J_r⁻¹, 0; 0, R_Mᵀ R_F]
//! ∂r/∂[φ; δt] of F_s:    [J_r⁻¹ R_Cᵀ, 0; −R_Mᵀ R_F [t_C]×, R_Mᵀ]       C = T_I_C
//! ∂r/∂[φ; δt] of T_s_w:  [−R_Mᵀ R_s, 0; R_g [W]×, −R_Mᵀ]              W = R_sᵀ (t_M − t_s)
//! ∂r/∂[φ; δt] of T_g_w:  [R_Mᵀ R_s, 0; −R_g [W]×, I]
//! ```
//!
//! The last two are taken at the measurement. They carry the covariances of the two poses to the residual, and the errors
//! of the map: one pose error per rigid camera and station, and one position error of the gimbal camera per set. A rotation
//! error of the gimbal camera's map is not separable from the errors of the encoders.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6};

use super::view_pose::{ViewPose, view_pose};
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::Chain;
use crate::optimization::square_root_information;
use crate::sensors::{StillSet, Stills};

/// Set with refined camera poses.
#[derive(Clone, Debug)]
pub(super) struct ObservedSet {
    /// Index of the set in [`Stills::sets`].
    pub(super) index: usize,
    pub(super) id: u64,
    pub(super) station: u64,
    pub(super) readings_rad: Vec<f64>,
    pub(super) gimbal: ViewPose,
    /// Rigid cameras with a pose, by their index in [`Stills::rigid_cameras`].
    pub(super) rigid: Vec<(usize, ViewPose)>,
    /// `W` with `WᵀW` the inverse covariance of the stacked residuals by the noise of the pixels (6K × 6K).
    whitening: DMatrix<f64>,
    /// Derivative of the whitened residuals by the position error of the gimbal camera (6K × 3).
    pub(super) by_gimbal_map: DMatrix<f64>,
    /// Derivative of the whitened residuals by the pose error of each camera of `rigid` (6K × 6 each).
    pub(super) by_rigid_map: Vec<DMatrix<f64>>,
}

/// Whitened residual of a set with its derivatives.
pub(super) struct SetRows {
    /// Residual of the K rigid cameras (6K × 1).
    pub(super) residual: DVector<f64>,
    /// Derivative by the parameters of the chain (6K × dof).
    pub(super) by_chain: DMatrix<f64>,
    /// Derivative by the joint angles (6K × N).
    pub(super) by_joints: DMatrix<f64>,
    /// By `[φ; δt]` of each rigid camera after the first one (6K × 6·further).
    pub(super) by_further: DMatrix<f64>,
}

/// Refines all camera poses. Views whose points fit no pose are left out, with a sentence each.
pub(super) fn observe(stills: &Stills) -> (Vec<ObservedSet>, Vec<String>) {
    let mut left_out = Vec::new();
    let mut sets = Vec::new();
    for (index, set) in stills.sets.iter().enumerate() {
        let mut refuse = |camera: &str, effect: &str| {
            left_out.push(format!(
                "set {}: the points of '{camera}' fit no camera pose, {effect}; check its points and intrinsics",
                set.id
            ));
        };
        let Some(gimbal) = view_pose(&stills.gimbal_camera, &set.gimbal) else {
            refuse(&stills.gimbal_camera.name, "the set is left out");
            continue;
        };
        let mut rigid = Vec::new();
        for (camera, (view, model)) in set.rigid.iter().zip(&stills.rigid_cameras).enumerate() {
            match view.as_ref().map(|view| view_pose(model, view)) {
                Some(Some(pose)) => rigid.push((camera, pose)),
                Some(None) => refuse(&model.name, "the view is left out"),
                None => {}
            }
        }
        sets.extend(ObservedSet::new(index, set, gimbal, rigid));
    }
    (sets, left_out)
}

impl ObservedSet {
    /// Whitens the loops of a set; `None` without a rigid camera or if a covariance is singular.
    fn new(index: usize, set: &StillSet, gimbal: ViewPose, rigid: Vec<(usize, ViewPose)>) -> Option<Self> {
        let rows = 6 * rigid.len();
        let mut covariance = DMatrix::zeros(rows, rows);
        let mut by_gimbal = DMatrix::zeros(rows, 6);
        let mut by_rigid = Vec::new();
        for (place, (_, view)) in rigid.iter().enumerate() {
            let [rigid_error, gimbal_error] = by_measured_poses(&view.camera_from_world, &gimbal.camera_from_world);
            let own = rigid_error * view.covariance * rigid_error.transpose();
            covariance.fixed_view_mut::<6, 6>(6 * place, 6 * place).copy_from(&own);
            by_gimbal.fixed_view_mut::<6, 6>(6 * place, 0).copy_from(&gimbal_error);
            let mut padded = DMatrix::zeros(rows, 6);
            padded.fixed_view_mut::<6, 6>(6 * place, 0).copy_from(&rigid_error);
            by_rigid.push(padded);
        }
        covariance += &by_gimbal * gimbal.covariance * by_gimbal.transpose();
        let whitening = square_root_information(covariance)?;
        Some(Self {
            index,
            id: set.id,
            station: set.station,
            readings_rad: set.joint_readings_rad.clone(),
            by_gimbal_map: &whitening * by_gimbal.columns(3, 3),
            by_rigid_map: by_rigid.iter().map(|rows| &whitening * rows).collect(),
            gimbal,
            rigid,
            whitening,
        })
        .filter(|_| rows > 0)
    }

    /// Measured `rigid_from_gimbal` of each loop.
    fn measured(&self) -> impl Iterator<Item = (usize, RigidTransform)> + '_ {
        let world_from_gimbal = self.gimbal.camera_from_world.inverse();
        self.rigid.iter().map(move |(camera, view)| (*camera, view.camera_from_world * world_from_gimbal))
    }

    /// Whitened residual (6K × 1) at joint angles; `further` has `camera_from_first` of the rigid cameras after the first.
    pub(super) fn residual(&self, chain: &Chain, further: &[RigidTransform], joints_rad: &[f64]) -> DVector<f64> {
        let imu_from_camera = chain.imu_from_camera(joints_rad);
        let mut residual = DVector::zeros(self.whitening.nrows());
        for (place, (camera, measured)) in self.measured().enumerate() {
            let error = measured.inverse() * from_first(further, camera) * imu_from_camera;
            residual.fixed_rows_mut::<3>(6 * place).copy_from(&so3::log(&error.rotation));
            residual.fixed_rows_mut::<3>(6 * place + 3).copy_from(&error.translation_m);
        }
        &self.whitening * residual
    }

    /// [`Self::residual`] with its derivatives.
    pub(super) fn rows(&self, chain: &Chain, further: &[RigidTransform], joints_rad: &[f64]) -> SetRows {
        let at = chain.linearize(joints_rad);
        let rows = self.whitening.nrows();
        let (dof, joints) = (at.by_parameters.ncols(), at.by_joints.ncols());
        let mut by_chain = DMatrix::zeros(rows, dof);
        let mut by_joints = DMatrix::zeros(rows, joints);
        let mut by_further = DMatrix::zeros(rows, 6 * further.len());
        let camera_rotation = at.imu_from_camera.rotation_matrix();
        for (place, (camera, measured)) in self.measured().enumerate() {
            let first = from_first(further, camera);
            let error = measured.inverse() * first * at.imu_from_camera;
            let by_rotation = so3::right_jacobian_inverse(&so3::log(&error.rotation));
            let into_gimbal: Matrix3<f64> = measured.rotation_matrix().transpose();
            let shifted = into_gimbal * first.rotation_matrix();
            for (part, whole) in [(&at.by_parameters, &mut by_chain), (&at.by_joints, &mut by_joints)] {
                let top = by_rotation * part.fixed_rows::<3>(0);
                whole.fixed_rows_mut::<3>(6 * place).copy_from(&top);
                whole.fixed_rows_mut::<3>(6 * place + 3).copy_from(&(shifted * part.fixed_rows::<3>(3)));
            }
            if let Some(column) = camera.checked_sub(1).map(|index| 6 * index) {
                let lever = shifted * so3::hat(&at.imu_from_camera.translation_m);
                let mut block = Matrix6::zeros();
                block.fixed_view_mut::<3, 3>(0, 0).copy_from(&(by_rotation * camera_rotation.transpose()));
                block.fixed_view_mut::<3, 3>(3, 0).copy_from(&-lever);
                block.fixed_view_mut::<3, 3>(3, 3).copy_from(&into_gimbal);
                by_further.fixed_view_mut::<6, 6>(6 * place, column).copy_from(&block);
            }
        }
        SetRows {
            residual: self.residual(chain, further, joints_rad),
            by_chain: &self.whitening * by_chain,
            by_joints: &self.whitening * by_joints,
            by_further: &self.whitening * by_further,
        }
    }
}

/// `rigid_from_first` of a rigid camera.
pub(super) fn from_first(further: &[RigidTransform], camera: usize) -> RigidTransform {
    camera.checked_sub(1).map_or_else(RigidTransform::identity, |index| further[index])
}

/// Derivatives of a loop's residual by `[φ; δt]` of `rigid_from_world` and of `gimbal_from_world` (6 × 6 each).
fn by_measured_poses(rigid_from_world: &RigidTransform, gimbal_from_world: &RigidTransform) -> [Matrix6<f64>; 2] {
    let measured = *rigid_from_world * gimbal_from_world.inverse();
    let into_gimbal: Matrix3<f64> = measured.rotation_matrix().transpose();
    let in_world = rigid_from_world.rotation.inverse() * (measured.translation_m - rigid_from_world.translation_m);
    let lever = gimbal_from_world.rotation_matrix() * so3::hat(&in_world);
    let turned = into_gimbal * rigid_from_world.rotation_matrix();
    let blocks = |rotation: Matrix3<f64>, lever: Matrix3<f64>, shift: Matrix3<f64>| {
        let mut matrix = Matrix6::zeros();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
        matrix.fixed_view_mut::<3, 3>(3, 0).copy_from(&lever);
        matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&shift);
        matrix
    };
    [blocks(-turned, lever, -into_gimbal), blocks(turned, -lever, Matrix3::identity())]
}
