//! The linearization of a step with typed columns, for the analysis of its observability.

use nalgebra::{DMatrix, DVector};

use crate::estimator::state::layout::{Layout, POSE, SPEED_BIAS};
use crate::gimbal::Chain;

/// What a block of columns stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ColumnGroup {
    /// Static calibration.
    Calibration,
    /// Joint angles of a frame.
    Joints,
    /// Pose of a frame (rotation, translation).
    Pose,
    /// Velocity and biases of a frame.
    SpeedBias,
    /// Inverse depth of a feature.
    InverseDepth,
}

/// A run of columns that belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColumnBlock {
    /// What kind.
    pub group: ColumnGroup,
    /// For the calibration the parameter's name, else `pose 12`, `joints 12`, `depth 345`.
    pub name: String,
    /// First column.
    pub start: usize,
    /// Number of columns.
    pub len: usize,
}

/// The whitened linearization of the step at its final estimate, without the priors on the calibration.
///
/// The inverse depths are already projected out by orthogonal projection (each feature's own rows rotated and its first
/// row dropped), so that the rows stay whitened residuals and no normal equations were formed.
#[derive(Clone, Debug, PartialEq)]
pub struct Linearization {
    /// Column blocks in order: calibration, joints, poses, speed-biases.
    pub columns: Vec<ColumnBlock>,
    /// Names of calibration parameters that are held at their values: they are known, and have no columns.
    pub held: Vec<String>,
    /// Jacobian of the measurements, rows whitened.
    pub jacobian: DMatrix<f64>,
    /// Jacobian of the priors (rig prior on the calibration, marginalization prior), same columns, whitened.
    pub prior_jacobian: DMatrix<f64>,
    /// How many rows of these, the first ones, are the rig's prior.
    pub rig_prior_rows: usize,
    /// Norm of each calibration column before the depths were projected out, for the reference of the rank rule.
    pub calibration_column_norms: DVector<f64>,
    /// The chain at which the calibration's columns were taken (with first estimates not the present one).
    pub chain: Chain,
}

/// What the columns of a linearization stand for; `names` are the calibration's.
pub(crate) fn column_blocks(layout: &Layout, names: &[String], numbers: &[usize]) -> Vec<ColumnBlock> {
    let mut blocks = Vec::new();
    let mut start = 0;
    let mut push = |group: ColumnGroup, name: String, len: usize| {
        if len > 0 {
            blocks.push(ColumnBlock { group, name, start, len });
            start += len;
        }
    };
    if layout.calibration > 0 {
        for name in names {
            push(ColumnGroup::Calibration, name.clone(), 1);
        }
    }
    for (group, kind, len) in [
        (ColumnGroup::Joints, "joints", layout.joints),
        (ColumnGroup::Pose, "pose", POSE),
        (ColumnGroup::SpeedBias, "speed-bias", SPEED_BIAS),
    ] {
        for number in numbers {
            push(group, format!("{kind} {number}"), len);
        }
    }
    blocks
}

/// Columns of the layout in the order of the report: calibration, joints, poses, speeds and biases.
pub(crate) fn column_order(layout: &Layout) -> Vec<usize> {
    let mut order: Vec<usize> = layout.calibration().collect();
    order.extend((0..layout.frames).flat_map(|slot| layout.joints(slot)));
    order.extend((0..layout.frames).flat_map(|slot| layout.pose(slot)));
    order.extend((0..layout.frames).flat_map(|slot| layout.speed_bias(slot)));
    order
}
