//! Actuated chain between the IMU and a gimballed camera, in each parameterization.
//!
//! Rigs define a [`ClassicalChain`]. The estimator works with a [`Chain`]: the same mechanism in one
//! [`Parameterization`], with the parameters ([`ParameterId`]), values, derivatives, update rule and
//! singularity margins of its columns. A joint angle is the encoder reading plus the static offset of its link.
//! Parameterizations and their singularities: docs/mathematics.md, sections 3 and 4.

mod chain;
mod classical;
mod conversion;
mod covariance;
mod form;
mod frame;
mod inverse;
mod linearize;
mod manifold;
mod nearest;
mod parameter;
mod parameterization;
mod redundancy;
mod singularity;
#[cfg(test)]
pub(crate) mod tests;

pub use self::classical::JointAxis;
pub use chain::Chain;
pub use classical::{ClassicalChain, DhLink};
pub use covariance::{generic_joint_angles, stacked_jacobian, transport, transport_covariance};
pub use inverse::{InverseChain, InverseSolution};
pub use linearize::ChainLinearization;
pub use nearest::NearestForm;
pub use parameter::{ParameterGroup, ParameterId, ParameterNames, ParameterPart, Quantity, Singularity};
pub use parameterization::{Parameterization, UnknownParameterization};
pub use redundancy::redundant_directions;
pub use singularity::{SWITCH_MARGIN, auto_parameterization};
