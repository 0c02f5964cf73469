//! Rotations of cameras against those of the IMU: the measured ones, the fit of a chain to them, the faults
//! that explain a misfit, and the readout of rows.

pub(super) mod data;
pub(super) mod fit;
pub(super) mod hypotheses;
pub(super) mod readout;
