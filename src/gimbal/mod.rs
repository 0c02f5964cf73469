//! The actuated chain between the IMU and a gimballed camera, in each parameterization.

use crate::geometry::RigidTransform;

/// One Denavit–Hartenberg link, `Rz(θ + theta_offset)·Tz(d)·Tx(a)·Rx(α)` (Eq. 2).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DhLink {
    /// Static offset added to the encoder's angle.
    pub theta_offset_rad: f64,
    /// Shift along the joint's axis.
    pub d_m: f64,
    /// Shift along the link.
    pub a_m: f64,
    /// Twist about the link.
    pub alpha_rad: f64,
}

/// The chain of Eqs. 5–6 as rigs write it; without links it is a rigid camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClassicalChain {
    /// `T^{I:B}`.
    pub imu_from_base: RigidTransform,
    /// The links in order.
    pub links: Vec<DhLink>,
    /// `T^{E:C}`.
    pub effector_from_camera: RigidTransform,
}
