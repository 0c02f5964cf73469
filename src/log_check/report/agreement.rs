//! Agreement of the sources that measure one quantity: the matrix from which a wrong source is isolated.

use serde::{Deserialize, Serialize};

use super::interval::FindingInterval;

/// Quantity that several sources measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Rotations of the vehicle over 0.3 s, in radians.
    Rotation,
    /// Accelerations of the vehicle in m/s².
    SpecificForce,
    /// Direction of a camera's motion, in radians.
    Direction,
}

/// Two sources of a quantity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PairAgreement {
    pub quantity: Quantity,
    /// Names, such as `the gyroscope`.
    pub sources: [String; 2],
    pub agrees: bool,
    /// Misfit in units of the predicted noise; before the interval, if they disagree from a time on.
    pub misfit: f64,
    /// Misfit by axis as a standard deviation, in the unit of the quantity.
    pub by_axis: Vec<f64>,
    /// Predicted standard deviation per axis, in the unit of the quantity.
    pub noise: f64,
    /// Middle of each bin in seconds since the log began, with its misfit in units of the predicted noise.
    pub bins: Vec<[f64; 2]>,
    /// Time in which they disagree.
    #[serde(flatten)]
    pub interval: FindingInterval,
}

/// Agreement of all sources of a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Agreement {
    pub pairs: Vec<PairAgreement>,
    /// Sentences about sources that disagree, also where a finding names the cause.
    pub isolated: Vec<String>,
}
