//! Rotations, rigid transforms and the perturbation rule; tangent plane of a direction, mean and spread of
//! vectors, median, quantiles of χ².
//!
//! The rule is written here once: a perturbation is `[φ; δt]`, rotation first, with `R ← R·Exp(φ)` (right, local) and
//! `t ← t + δt` (a vector in the outer frame).
//! The paper's Eqs. 12–14 print the left form; `φ_left = R·φ_right`.

mod angle;
mod chi_square;
pub mod dense;
mod dimension;
mod median;
mod planar;
mod rigid_transform;
pub mod so3;
mod split_mix;
mod tangent;
#[cfg(test)]
mod tests;
pub(crate) mod triangular_factor;
mod vector_statistics;

pub use angle::{principal_angle, wrap_angle};
pub use chi_square::mean_square_quantile;
pub use dimension::Dimension;
pub use median::median;
pub(crate) use planar::planar_length;
pub use rigid_transform::RigidTransform;
pub use split_mix::SplitMix64;
pub use tangent::tangent_basis;
pub use vector_statistics::{mean, standard_deviation};

pub fn seconds_from_ns(time_ns: i64) -> f64 {
    time_ns as f64 * 1e-9
}

/// Rounded to the nearest nanosecond.
pub fn ns_from_seconds(time_s: f64) -> i64 {
    (time_s * 1e9).round() as i64
}
