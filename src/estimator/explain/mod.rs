//! Blocks of a step's Jacobian, reproduced from its report.

mod jacobian;

pub use jacobian::{FeatureRows, StepJacobian};
