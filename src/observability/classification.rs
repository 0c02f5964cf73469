//! Causes of rank loss, from the chain's Jacobians alone.

use nalgebra::DMatrix;

use super::Deficit;
use crate::geometry::{Dimension, dense};
use crate::gimbal::{Chain, generic_joint_angles, stacked_jacobian};

/// Splits the deficit `columns − rank` by cause, as differences of ranks of the chain's Jacobians; the columns
/// `kept` are unknown.
///
/// With J of `T_IC` by the parameters, stacked over generic joint angles or over the angles θ of the window, and J without
/// its part in the columns `J_θ` of the joint angles (docs/mathematics.md, section 8):
///
/// ```text
/// G = n − rank J    F = n − rank J(θ) − G    E = n − rank J(θ)⊥ − G − F    M: the rest
/// ```
pub(super) fn classify(
    chain: &Chain,
    kept: &[usize],
    joint_angles_rad: &[Vec<f64>],
    joints_free: bool,
    columns: usize,
    rank: usize,
) -> Deficit {
    let deficit = columns.saturating_sub(rank);
    let generic = generic_joint_angles(chain.joint_count(), 4 * (chain.joint_count() + 1));
    let anywhere = scaled_stack(chain, &generic).select_columns(kept);
    let values = singular_values(&anywhere);
    let anywhere = rank_above(&anywhere, &values, largest(&values));
    // Each other camera adds its own columns.
    let others = columns.saturating_sub(kept.len());
    let parameterization = columns.saturating_sub(anywhere + others).min(deficit);
    if joint_angles_rad.is_empty() {
        return Deficit { parameterization, joints: 0, absorbed: 0, motion: deficit - parameterization };
    }
    let mut stack = scaled_stack(chain, joint_angles_rad).select_columns(kept);
    let values = singular_values(&stack);
    let reference = largest(&values);
    let here = rank_above(&stack, &values, reference).min(anywhere);
    let joints = (anywhere - here).min(deficit - parameterization);
    let mut absorbed = 0;
    if joints_free && chain.joint_count() > 0 {
        project_joints_out(chain, joint_angles_rad, &mut stack);
        let unabsorbed = rank_above(&stack, &singular_values(&stack), reference).min(here);
        absorbed = (here - unabsorbed).min(deficit - parameterization - joints);
    }
    Deficit { parameterization, joints, absorbed, motion: deficit - parameterization - joints - absorbed }
}

/// Returns orthonormal directions (dof × k, in units of 10° and 3 cm) that are observable under some motion of joints
/// and vehicle: neither redundant in the parameterization nor absorbed by free joint angles. Empty for a chain that is
/// not finite.
pub(super) fn excitable_directions(chain: &Chain, joints_free: bool) -> DMatrix<f64> {
    let generic = generic_joint_angles(chain.joint_count(), 4 * (chain.joint_count() + 1));
    let mut stack = scaled_stack(chain, &generic);
    let reference = largest(&singular_values(&stack));
    if joints_free && chain.joint_count() > 0 {
        project_joints_out(chain, &generic, &mut stack);
    }
    let Some(svd) = dense::thin_svd(&stack) else { return DMatrix::zeros(chain.dof(), 0) };
    let values: Vec<f64> = svd.singular_values.iter().copied().collect();
    svd.v.columns(0, rank_above(&stack, &values, reference)).into_owned()
}

/// Stacked Jacobians of the chain, rows and columns in units of 10° and 3 cm.
fn scaled_stack(chain: &Chain, joint_angles_rad: &[Vec<f64>]) -> DMatrix<f64> {
    let mut stack = stacked_jacobian(chain, joint_angles_rad);
    for (mut column, parameter) in stack.column_iter_mut().zip(chain.parameters()) {
        let column_scale = parameter.scale();
        for (row, entry) in column.iter_mut().enumerate() {
            *entry *= column_scale / row_scale(row);
        }
    }
    stack
}

fn row_scale(row: usize) -> f64 {
    let dimension = if row % 6 < 3 { Dimension::Angle } else { Dimension::Length };
    dimension.scale()
}

/// Projects the joint angles of each frame out of its six rows.
fn project_joints_out(chain: &Chain, joint_angles_rad: &[Vec<f64>], stack: &mut DMatrix<f64>) {
    for (frame, angles) in joint_angles_rad.iter().enumerate() {
        let mut by_joints =
            DMatrix::from_iterator(6, chain.joint_count(), chain.linearize(angles).by_joints.iter().copied());
        for mut column in by_joints.column_iter_mut() {
            column.iter_mut().enumerate().for_each(|(row, entry)| *entry /= row_scale(row));
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
        }
        let Some(svd) = dense::thin_svd(&by_joints) else { continue };
        let mut rows = stack.rows_mut(6 * frame, 6);
        for (direction, singular_value) in svd.u.column_iter().zip(&svd.singular_values) {
            if *singular_value > tolerance(6, chain.joint_count()) {
                let along = direction.tr_mul(&rows);
                rows -= direction * along;
            }
        }
    }
}

/// Relative threshold of a structural zero, `100·ε·max(m, n)`.
pub(super) fn tolerance(rows: usize, columns: usize) -> f64 {
    100.0 * f64::EPSILON * rows.max(columns) as f64
}

/// Singular values in descending order; none for a matrix that is not finite.
fn singular_values(matrix: &DMatrix<f64>) -> Vec<f64> {
    dense::singular_values(matrix).unwrap_or_default()
}

/// Spectral norm from the singular values.
fn largest(singular_values: &[f64]) -> f64 {
    singular_values.first().copied().unwrap_or(0.0)
}

/// Number of singular values above the threshold relative to a reference norm.
fn rank_above(matrix: &DMatrix<f64>, singular_values: &[f64], reference: f64) -> usize {
    let threshold = tolerance(matrix.nrows(), matrix.ncols()) * reference;
    singular_values.iter().filter(|value| **value > threshold).count()
}
