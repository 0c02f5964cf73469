//! The actuated chain between the IMU and a gimballed camera, in each parameterization.
//!
//! Rigs write the [`ClassicalChain`]; the estimator works with a [`Chain`], which holds the same mechanism in one
//! [`Parameterization`] and knows its columns: their parameters ([`ParameterId`]), values, derivatives, update rule and margins to the chart's
//! locks.
//! A joint's angle is the encoder's reading plus the static offset of its link.
//! Parameterizations and their singularities: docs/mathematics.md, sections 3 and 4.

mod chain;
mod classical;
mod conversion;
mod covariance;
mod frame;
mod linearize;
mod manifold;
mod nearest;
mod parameter;
mod parameterization;
mod redundancy;
mod singularity;
#[cfg(test)]
pub(crate) mod tests;

pub use chain::Chain;
pub use classical::{ClassicalChain, DhLink};
pub use covariance::{generic_joint_angles, stacked_jacobian, transport, transport_covariance};
pub use linearize::ChainLinearization;
pub use nearest::NearestForm;
pub use parameter::{ParameterId, ParameterNames, ParameterPart, Quantity};
pub use parameterization::{Parameterization, UnknownParameterization};
pub use redundancy::redundant_directions;
pub use singularity::{SWITCH_MARGIN, Singularity, auto_parameterization};
