//! The sliding window: its frames and features, the least-squares problem that they make, solver and marginalization.

pub(crate) mod contradictions;
pub(crate) mod features;
pub(crate) mod frames;
pub(crate) mod information_gain;
pub(crate) mod jacobian_source;
pub(crate) mod joints;
pub(crate) mod linearization;
pub(crate) mod marginalization;
pub(crate) mod motion_parts;
pub(crate) mod problem;
pub(crate) mod reporting;
pub(crate) mod rows;
pub(crate) mod solver;
pub(crate) mod standstill;
pub(crate) mod tracking;
