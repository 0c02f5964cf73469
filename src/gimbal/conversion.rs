//! Conversions between the classical and the other parameterizations, in closed forms that exist for every
//! chain (docs/mathematics.md, section 5).

use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::geometry::RigidTransform;

use super::form::MinimalChain;
use super::frame::{Axis, ChainFrame};
use super::{ClassicalChain, DhLink, Parameterization};

/// A decomposition is singular when the cosine (or sine) of its middle angle is below this.
const SINGULAR_COSINE: f64 = 1e-12;

/// Converts a chain with at least one joint to a minimal parameterization.
///
/// At a singularity of the base, the first base angle is set to zero; at one of the end block, `y` (or `alpha`) is.
pub(super) fn minimal(classical: &ClassicalChain, parameterization: Parameterization) -> MinimalChain {
    let base = split_base(&ChainFrame::of(&classical.imu_from_base), parameterization.base_yx());
    let mut links = classical.links.clone();
    links[0].theta_offset_rad += base.joint_rotation_rad;
    links[0].d_m += base.joint_translation_m;
    let end = links.len() - 1;
    let block = split_end(&end_block(&links[end], &classical.effector_from_camera), parameterization.end_swapped());
    links[end] = block.link;
    MinimalChain {
        base_angles_rad: base.angles_rad,
        base_shift_m: base.shift_m,
        links,
        beta_rad: block.beta_rad,
        y_m: block.y_m,
    }
}

/// Transform of the last link and the camera after it, at joint angle zero of that link.
pub(super) fn end_block(link: &DhLink, effector_from_camera: &RigidTransform) -> ChainFrame {
    let mut frame = ChainFrame::identity();
    link.extend(&mut frame, 0.0);
    frame.then(effector_from_camera);
    frame
}

struct Base {
    angles_rad: [f64; 2],
    shift_m: [f64; 2],
    /// Rotation about and translation along z that are moved to the first joint.
    joint_rotation_rad: f64,
    joint_translation_m: f64,
}

/// Decomposes into `Rx·Ry·T(tx, ty, 0)·Rz(θ)·Tz(d)`, or with `Ry·Rx`.
fn split_base(base: &ChainFrame, yx: bool) -> Base {
    let r = &base.rotation;
    let (angles_rad, axes) = if yx {
        let middle_cosine = r[(0, 2)].hypot(r[(2, 2)]);
        let ry = if middle_cosine < SINGULAR_COSINE { 0.0 } else { r[(0, 2)].atan2(r[(2, 2)]) };
        ([ry, (-r[(1, 2)]).atan2(middle_cosine)], [Axis::Y, Axis::X])
    } else {
        let middle_cosine = r[(1, 2)].hypot(r[(2, 2)]);
        let rx = if middle_cosine < SINGULAR_COSINE { 0.0 } else { (-r[(1, 2)]).atan2(r[(2, 2)]) };
        ([rx, r[(0, 2)].atan2(middle_cosine)], [Axis::X, Axis::Y])
    };
    let mut rotated = ChainFrame::identity();
    rotated.rotate(axes[0], angles_rad[0]);
    rotated.rotate(axes[1], angles_rad[1]);
    let rest = rotated.rotation.tr_mul(r);
    let shift = rotated.rotation.tr_mul(&base.origin);
    Base {
        angles_rad,
        shift_m: [shift.x, shift.y],
        joint_rotation_rad: rest[(1, 0)].atan2(rest[(1, 1)]),
        joint_translation_m: shift.z,
    }
}

struct End {
    link: DhLink,
    beta_rad: f64,
    y_m: f64,
}

/// Decomposes into `Rz·Tz·Tx·Rx·Ry(β)·Ty(y)` (Eq. 19), or into `Rz·Tz·Tx·Ty(y)·Ry(β)·Rx`.
fn split_end(block: &ChainFrame, swapped: bool) -> End {
    let (r, t) = (&block.rotation, &block.origin);
    if swapped {
        let middle_cosine = r[(0, 0)].hypot(r[(1, 0)]);
        let singular = middle_cosine < SINGULAR_COSINE;
        let beta_rad = (-r[(2, 0)]).atan2(middle_cosine);
        // At the singularity only a combination of theta and alpha is determined: R·Ry(−beta) is the rotation about
        // z for alpha = 0.
        let theta_offset_rad = if singular { (-r[(0, 1)]).atan2(r[(1, 1)]) } else { r[(1, 0)].atan2(r[(0, 0)]) };
        let alpha_rad = if singular { 0.0 } else { r[(2, 1)].atan2(r[(2, 2)]) };
        let shift = rotated_back(theta_offset_rad, t);
        return End {
            link: DhLink { theta_offset_rad, d_m: shift.z, a_m: shift.x, alpha_rad },
            beta_rad,
            y_m: shift.y,
        };
    }
    let middle_cosine = r[(0, 1)].hypot(r[(1, 1)]);
    let alpha_rad = r[(2, 1)].atan2(middle_cosine);
    if middle_cosine < SINGULAR_COSINE {
        // Theta and beta rotate about the same line; theta is chosen such that y is zero.
        let theta_offset_rad = if t.x == 0.0 && t.y == 0.0 { 0.0 } else { t.y.atan2(t.x) };
        let mut rotated = ChainFrame::identity();
        rotated.rotate(Axis::Z, theta_offset_rad);
        rotated.rotate(Axis::X, alpha_rad);
        let rest = rotated.rotation.tr_mul(r);
        return End {
            link: DhLink { theta_offset_rad, d_m: t.z, a_m: t.x.hypot(t.y), alpha_rad },
            beta_rad: rest[(0, 2)].atan2(rest[(0, 0)]),
            y_m: 0.0,
        };
    }
    let theta_offset_rad = (-r[(0, 1)]).atan2(r[(1, 1)]);
    let shift = rotated_back(theta_offset_rad, t);
    let y_m = shift.y / middle_cosine;
    End {
        link: DhLink { theta_offset_rad, d_m: shift.z - y_m * alpha_rad.sin(), a_m: shift.x, alpha_rad },
        beta_rad: (-r[(2, 0)]).atan2(r[(2, 2)]),
        y_m,
    }
}

/// Vector `Rz(−angle)·v` (3 × 1).
fn rotated_back(angle_rad: f64, v: &Vector3<f64>) -> Vector3<f64> {
    let (sine, cosine) = angle_rad.sin_cos();
    Vector3::new(cosine * v.x + sine * v.y, cosine * v.y - sine * v.x, v.z)
}

/// Converts a minimal chain to the classical parameterization: the base keeps its rotations, and the transform after
/// the last link (with the swapped end block: after its translation along y) becomes `effector_from_camera`.
pub(super) fn classical_of_minimal(chain: &MinimalChain, parameterization: Parameterization) -> ClassicalChain {
    let mut base = ChainFrame::identity();
    let order = if parameterization.base_yx() { [Axis::Y, Axis::X] } else { [Axis::X, Axis::Y] };
    for (axis, angle) in order.into_iter().zip(chain.base_angles_rad) {
        base.rotate(axis, angle);
    }
    base.translate(Axis::X, chain.base_shift_m[0]);
    base.translate(Axis::Y, chain.base_shift_m[1]);
    let mut links = chain.links.clone();
    let mut camera = ChainFrame::identity();
    if parameterization.end_swapped() {
        camera.translate(Axis::Y, chain.y_m);
        camera.rotate(Axis::Y, chain.beta_rad);
        if let Some(last) = links.last_mut() {
            camera.rotate(Axis::X, last.alpha_rad);
            last.alpha_rad = 0.0;
        }
    } else {
        camera.rotate(Axis::Y, chain.beta_rad);
        camera.translate(Axis::Y, chain.y_m);
    }
    ClassicalChain { imu_from_base: base.to_transform(), links, effector_from_camera: camera.to_transform() }
}

/// Returns the transforms `X0 … XN` of the product of exponentials, for a chain with at least one joint.
pub(super) fn poe_blocks(classical: &ClassicalChain) -> Vec<RigidTransform> {
    let mut blocks = vec![classical.imu_from_base];
    blocks.extend(classical.links.iter().map(|link| link.transform(0.0)));
    let end = blocks.len() - 1;
    blocks[end] = blocks[end] * classical.effector_from_camera;
    blocks
}

/// Converts a product of exponentials to the classical parameterization.
///
/// Inner transforms become links. The screw along its own z axis that a link cannot represent moves on to the
/// next transform. The last transform becomes a link followed by a rotation about and a translation along y,
/// in the end block with the larger singularity margin.
pub(super) fn classical_of_poe(blocks: &[RigidTransform]) -> ClassicalChain {
    let last = blocks.len() - 1;
    let mut links = Vec::with_capacity(last);
    let mut handed_on = RigidTransform::identity();
    for block in &blocks[1..last] {
        let (link, joint_rotation_rad, joint_translation_m) = split_inner(&ChainFrame::of(&(handed_on * *block)));
        links.push(link);
        handed_on = RigidTransform::new(
            Rotation3::from_axis_angle(&Vector3::z_axis(), joint_rotation_rad).into(),
            Vector3::new(0.0, 0.0, joint_translation_m),
        );
    }
    let block = ChainFrame::of(&(handed_on * blocks[last]));
    let swapped = block.rotation[(2, 0)].abs() < block.rotation[(2, 1)].abs();
    let end = split_end(&block, swapped);
    links.push(end.link);
    let chain =
        MinimalChain { base_angles_rad: [0.0; 2], base_shift_m: [0.0; 2], links, beta_rad: end.beta_rad, y_m: end.y_m };
    let on_the_first_joint = classical_of_minimal(&chain, Parameterization::minimal(false, swapped));
    ClassicalChain { imu_from_base: blocks[0], ..on_the_first_joint }
}

/// Decomposes into `Rz·Tz·Tx·Rx·Rz(θ)·Tz(d)` with a twist between 0 and π.
fn split_inner(block: &ChainFrame) -> (DhLink, f64, f64) {
    let (r, t) = (&block.rotation, &block.origin);
    let twist_sine = r[(0, 2)].hypot(r[(1, 2)]);
    let alpha_rad = twist_sine.atan2(r[(2, 2)]);
    let parallel = twist_sine < SINGULAR_COSINE;
    let theta_offset_rad = if !parallel {
        r[(0, 2)].atan2(-r[(1, 2)])
    } else if t.x == 0.0 && t.y == 0.0 {
        0.0
    } else {
        t.y.atan2(t.x)
    };
    let mut rotated = ChainFrame::identity();
    rotated.rotate(Axis::Z, theta_offset_rad);
    rotated.rotate(Axis::X, alpha_rad);
    let rest: Matrix3<f64> = rotated.rotation.tr_mul(r);
    let joint_rotation_rad = rest[(1, 0)].atan2(rest[(0, 0)]);
    let shift = rotated_back(theta_offset_rad, t);
    let joint_translation_m = if parallel { 0.0 } else { -shift.y / twist_sine };
    let d_m = shift.z - joint_translation_m * r[(2, 2)];
    (DhLink { theta_offset_rad, d_m, a_m: shift.x, alpha_rad }, joint_rotation_rad, joint_translation_m)
}
