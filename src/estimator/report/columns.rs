//! What the columns of a Jacobian stand for.

use std::fmt;

use crate::geometry::Dimension;
use crate::gimbal::ParameterId;

/// Number of an image in its camera's stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FrameId(pub usize);

impl fmt::Display for FrameId {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(formatter)
    }
}

/// Unknowns that belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ColumnId {
    /// A parameter of the static calibration, one column.
    Calibration(ParameterId),
    /// Joint angles of a frame.
    Joints(FrameId),
    /// Pose of a frame, rotation before translation, six columns.
    Pose(FrameId),
    /// Velocity, gyroscope and accelerometer bias of a frame, nine columns.
    VelocityBias(FrameId),
    /// Inverse depth of the feature that a row belongs to, one column.
    InverseDepth,
}

/// What a block of columns stands for, whichever frame or parameter it is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ColumnGroup {
    /// Static calibration.
    Calibration,
    /// Joint angles.
    Joints,
    /// Poses.
    Pose,
    /// Velocities and biases.
    VelocityBias,
    /// Inverse depths.
    InverseDepth,
}

impl ColumnId {
    /// The group that it belongs to.
    pub const fn group(self) -> ColumnGroup {
        match self {
            Self::Calibration(_) => ColumnGroup::Calibration,
            Self::Joints(_) => ColumnGroup::Joints,
            Self::Pose(_) => ColumnGroup::Pose,
            Self::VelocityBias(_) => ColumnGroup::VelocityBias,
            Self::InverseDepth => ColumnGroup::InverseDepth,
        }
    }

    /// The calibration parameter that it is.
    pub const fn parameter(self) -> Option<ParameterId> {
        match self {
            Self::Calibration(parameter) => Some(parameter),
            _ => None,
        }
    }

    /// What 1 means in one of its columns, counted by `place` within the block, so that columns compare: the scale of the
    /// dimension ([`Dimension::scale`]) of angles, lengths and clocks and the ratio of the inverse depth, 0.1 m/s, 1 °/s
    /// and 0.1 m/s².
    pub const fn scale(self, place: usize) -> f64 {
        const VELOCITY_M_PER_S: f64 = 0.1;
        const GYROSCOPE_BIAS_RAD_PER_S: f64 = std::f64::consts::PI / 180.0;
        const ACCELEROMETER_BIAS_M_PER_S2: f64 = 0.1;
        match (self, place) {
            (Self::Calibration(parameter), _) => parameter.dimension().scale(),
            (Self::Joints(_), _) | (Self::Pose(_), 0..3) => Dimension::Angle.scale(),
            (Self::Pose(_), _) => Dimension::Length.scale(),
            (Self::VelocityBias(_), 0..3) => VELOCITY_M_PER_S,
            (Self::VelocityBias(_), 3..6) => GYROSCOPE_BIAS_RAD_PER_S,
            (Self::VelocityBias(_), _) => ACCELEROMETER_BIAS_M_PER_S2,
            (Self::InverseDepth, _) => Dimension::Ratio.scale(),
        }
    }
}

/// A run of columns that belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColumnBlock {
    /// What they stand for.
    pub id: ColumnId,
    /// First column.
    pub start: usize,
    /// Number of columns.
    pub len: usize,
}

/// The scales of all columns of some blocks.
pub(crate) fn scales_of(columns: &[ColumnBlock]) -> Vec<f64> {
    columns.iter().flat_map(|block| (0..block.len).map(move |place| block.id.scale(place))).collect()
}
