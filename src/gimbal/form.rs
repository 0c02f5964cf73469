//! Values of a chain, one form for each kind of columns.

use super::{ClassicalChain, DhLink};
use crate::geometry::RigidTransform;

/// Values of a chain with at least one joint in a minimal parameterization.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MinimalChain {
    /// Base rotations `rx ry`, or `ry rx` in the `yx` order, in radians.
    pub(super) base_angles_rad: [f64; 2],
    /// Base translation `tx ty` after those rotations, in metres.
    pub(super) base_shift_m: [f64; 2],
    /// All links; `alpha` of the last one belongs to the end block.
    pub(super) links: Vec<DhLink>,
    /// Rotation β about y in the end block.
    pub(super) beta_rad: f64,
    /// Translation along y in the end block.
    pub(super) y_m: f64,
}

/// Values of a chain, one variant for each set of columns.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Form {
    Classical(ClassicalChain),
    Minimal(MinimalChain),
    /// Initial transforms `X0 … XN` of the product of exponentials.
    Poe(Vec<RigidTransform>),
    /// Chain without joints: a single rigid transform in every parameterization but the classical one.
    Rigid(RigidTransform),
}
