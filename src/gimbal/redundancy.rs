use nalgebra::{DMatrix, Vector3};

use super::ClassicalChain;

/// Returns the redundant directions of the classical parameterization: steps that leave the camera pose unchanged at
/// all joint angles, in closed form (Eqs. 11–17).
///
/// (12 + 4N) × 6, one direction per column, in radians and metres and in the order of the classical columns.
/// At the base: a rotation about and a translation along the first axis,
///
/// ```text
/// φ_IB = e₃, θ₁ = −1        t_IB = −R_IB e₃, d₁ = 1
/// ```
///
/// At the end: each parameter of the last link against `[φ; t]` of `effector_from_camera` = `(R, t)`, with the joint
/// axis `u = (0, sin α, cos α)`,
///
/// ```text
/// θ = 1: [−Rᵀu; −u × (t + a e₁)]    d = 1: [0; −u]    a = 1: [0; −e₁]    α = 1: [−Rᵀe₁; −e₁ × t]
/// ```
///
/// Without joints: the two rigid transforms against each other.
pub fn redundant_directions(chain: &ClassicalChain) -> DMatrix<f64> {
    let joints = chain.links.len();
    let camera = 6 + 4 * joints;
    let mut directions = DMatrix::zeros(camera + 6, 6);
    let set = |directions: &mut DMatrix<f64>, direction: usize, row: usize, value: &Vector3<f64>| {
        directions.fixed_view_mut::<3, 1>(row, direction).copy_from(value);
    };
    let base_rotation = chain.imu_from_base.rotation_matrix();
    let camera_rotation = chain.effector_from_camera.rotation_matrix();
    let camera_position = chain.effector_from_camera.translation_m;
    // Rotation about an axis through a point of the effector, compensated by `effector_from_camera`.
    let undo_rotation = |directions: &mut DMatrix<f64>, direction: usize, axis: &Vector3<f64>, arm: &Vector3<f64>| {
        set(directions, direction, camera, &-camera_rotation.tr_mul(axis));
        set(directions, direction, camera + 3, &-axis.cross(arm));
    };
    let Some(last) = chain.links.last() else {
        for index in 0..3 {
            let axis = Vector3::ith(index, 1.0);
            directions[(index, index)] = 1.0;
            undo_rotation(&mut directions, index, &axis, &camera_position);
            set(&mut directions, 3 + index, 3, &(base_rotation * axis));
            set(&mut directions, 3 + index, camera + 3, &-axis);
        }
        return directions;
    };
    directions[(2, 0)] = 1.0;
    directions[(6, 0)] = -1.0;
    directions[(7, 1)] = 1.0;
    set(&mut directions, 1, 3, &-base_rotation.column(2));
    let link = 6 + 4 * (joints - 1);
    let (sine, cosine) = last.alpha_rad.sin_cos();
    let joint_axis = Vector3::new(0.0, sine, cosine);
    directions[(link, 2)] = 1.0;
    undo_rotation(&mut directions, 2, &joint_axis, &(camera_position + Vector3::x() * last.a_m));
    directions[(link + 1, 3)] = 1.0;
    set(&mut directions, 3, camera + 3, &-joint_axis);
    directions[(link + 2, 4)] = 1.0;
    set(&mut directions, 4, camera + 3, &-Vector3::x());
    directions[(link + 3, 5)] = 1.0;
    undo_rotation(&mut directions, 5, &Vector3::x(), &camera_position);
    directions
}
