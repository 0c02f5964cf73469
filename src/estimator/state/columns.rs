//! Columns of a Jacobian, in blocks of unknowns.

use std::fmt;

use crate::geometry::Dimension;
use crate::gimbal::ParameterId;

/// Index of an image in its camera's stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FrameId(pub usize);

impl fmt::Display for FrameId {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(formatter)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ColumnId {
    Calibration(ParameterId),
    /// Joint angles of a frame; with a rolling shutter also joint rates and joint accelerations, in this order.
    Joints(FrameId),
    /// Pose of a frame, rotation before translation, six columns.
    Pose(FrameId),
    /// Velocity, gyroscope and accelerometer bias of a frame, nine columns.
    VelocityBias(FrameId),
    /// Velocity, gyroscope and accelerometer bias of the IMU on the gimbal at a frame, nine columns.
    GimbalImu(FrameId),
    /// Inverse depth of the row's feature, one column.
    InverseDepth,
}

/// Kind of a block of columns, independent of frame and parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ColumnGroup {
    Calibration,
    Joints,
    Pose,
    VelocityBias,
    GimbalImu,
    InverseDepth,
}

impl ColumnId {
    pub const fn group(self) -> ColumnGroup {
        match self {
            Self::Calibration(_) => ColumnGroup::Calibration,
            Self::Joints(_) => ColumnGroup::Joints,
            Self::Pose(_) => ColumnGroup::Pose,
            Self::VelocityBias(_) => ColumnGroup::VelocityBias,
            Self::GimbalImu(_) => ColumnGroup::GimbalImu,
            Self::InverseDepth => ColumnGroup::InverseDepth,
        }
    }

    /// Calibration parameter of a [`ColumnId::Calibration`], `None` for other blocks.
    pub const fn parameter(self) -> Option<ParameterId> {
        match self {
            Self::Calibration(parameter) => Some(parameter),
            _ => None,
        }
    }

    /// Frame of the block, `None` for calibration and inverse depth.
    pub const fn frame(self) -> Option<FrameId> {
        match self {
            Self::Joints(frame) | Self::Pose(frame) | Self::VelocityBias(frame) | Self::GimbalImu(frame) => Some(frame),
            Self::Calibration(_) | Self::InverseDepth => None,
        }
    }

    /// Typical size of column `place` of the block, which makes columns comparable: [`Dimension::scale`] for
    /// angles, lengths, time offsets and the relative inverse depth, 0.1 m/s, 1 °/s and 0.1 m/s².
    pub const fn scale(self, place: usize) -> f64 {
        const VELOCITY_M_PER_S: f64 = 0.1;
        const GYROSCOPE_BIAS_RAD_PER_S: f64 = std::f64::consts::PI / 180.0;
        const ACCELEROMETER_BIAS_M_PER_S2: f64 = 0.1;
        match (self, place) {
            (Self::Calibration(parameter), _) => parameter.scale(),
            (Self::Joints(_), _) | (Self::Pose(_), 0..3) => Dimension::Angle.scale(),
            (Self::Pose(_), _) => Dimension::Length.scale(),
            (Self::VelocityBias(_) | Self::GimbalImu(_), 0..3) => VELOCITY_M_PER_S,
            (Self::VelocityBias(_) | Self::GimbalImu(_), 3..6) => GYROSCOPE_BIAS_RAD_PER_S,
            (Self::VelocityBias(_) | Self::GimbalImu(_), _) => ACCELEROMETER_BIAS_M_PER_S2,
            (Self::InverseDepth, _) => Dimension::Ratio.scale(),
        }
    }
}

/// Consecutive columns of one block of unknowns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColumnBlock {
    pub id: ColumnId,
    pub start: usize,
    pub len: usize,
}

/// [`ColumnId::scale`] of all columns of the blocks.
pub(crate) fn scales_of(columns: &[ColumnBlock]) -> Vec<f64> {
    columns.iter().flat_map(|block| (0..block.len).map(move |place| block.id.scale(place))).collect()
}
