//! Rotations, rigid transforms and the perturbation rule; tangent plane of a direction, mean and spread of
//! vectors, median, quantiles of χ², t and F.
//!
//! The rule is written here once: a perturbation is `[φ; δt]`, rotation first, with `R ← R·Exp(φ)` (right, local) and
//! `t ← t + δt` (a vector in the outer frame).
//! The paper's Eqs. 12–14 print the left form; `φ_left = R·φ_right`.

pub mod dense;
mod dimension;
mod rigid_transform;
mod scalars;
mod signed_axes;
pub mod so3;
mod split_mix;
mod statistics;
#[cfg(test)]
mod tests;
pub(crate) mod triangular_factor;

pub use dimension::Dimension;
pub use rigid_transform::RigidTransform;
pub use scalars::{during, planar_length};
pub use scalars::{
    ns_from_seconds, principal_angle, seconds_from_ns, smooth_step, tangent_basis, ticks, vertical_angle, wrap_angle,
};
pub use signed_axes::SignedAxes;
pub use so3::best_rotation;
pub use split_mix::SplitMix64;
pub use statistics::{
    MEDIAN_PLANAR_LENGTH, SIGMA_PER_MEDIAN, consecutive_correlation, correlation, f_survival, mean,
    mean_square_quantile, median, normal_quantile_of_chi_square, quantile, standard_deviation, t_quantile,
};
