//! Linearization of a step with typed columns, for the observability analysis.

use nalgebra::{DMatrix, DVector};

use super::columns::{ColumnBlock, ColumnId, FrameId};
use crate::estimator::state::layout::{Layout, POSE, VELOCITY_BIAS};
use crate::gimbal::{Chain, ParameterId};

/// Whitened linearization of the step at its final estimate, without the priors on the calibration.
///
/// The inverse depths are already eliminated by orthogonal projection (each feature's rows are rotated and their first
/// row is dropped), so that the rows stay whitened residuals and no normal equations are formed.
#[derive(Clone, Debug, PartialEq)]
pub struct Linearization {
    /// Column blocks in order: calibration, joints, poses, velocities and biases.
    pub columns: Vec<ColumnBlock>,
    /// Calibration parameters fixed at their values; they have no columns.
    pub fixed_parameters: Vec<ParameterId>,
    /// Jacobian of the measurements, rows whitened.
    pub jacobian: DMatrix<f64>,
    /// Jacobian of the priors (rig prior on the calibration, marginalization prior), same columns, whitened.
    pub prior_jacobian: DMatrix<f64>,
    /// Number of leading rows of `prior_jacobian` that belong to the rig's prior.
    pub rig_prior_rows: usize,
    /// Norm of each calibration column before elimination of the depths, as reference of the rank rule.
    pub calibration_column_norms: DVector<f64>,
    /// Chain at which the calibration columns were evaluated (the first estimate, not the current one, where there is
    /// one).
    pub chain: Chain,
}

/// Column blocks of a linearization, in the order of the report.
pub(crate) fn column_blocks(layout: &Layout, parameters: &[ParameterId], frames: &[FrameId]) -> Vec<ColumnBlock> {
    let mut blocks = Vec::new();
    let mut start = 0;
    let mut push = |id: ColumnId, len: usize| {
        if len > 0 {
            blocks.push(ColumnBlock { id, start, len });
            start += len;
        }
    };
    if layout.calibration > 0 {
        for parameter in parameters {
            push(ColumnId::Calibration(*parameter), 1);
        }
    }
    for frame in frames {
        push(ColumnId::Joints(*frame), layout.joint_block());
    }
    for frame in frames {
        push(ColumnId::Pose(*frame), POSE);
    }
    for frame in frames {
        push(ColumnId::VelocityBias(*frame), VELOCITY_BIAS);
    }
    blocks
}

/// Columns of the layout in the order of the report: calibration, joints, poses, velocities and biases.
pub(crate) fn column_order(layout: &Layout) -> Vec<usize> {
    let mut order: Vec<usize> = layout.calibration().collect();
    order.extend((0..layout.frames).flat_map(|slot| layout.joints(slot).start..layout.joint_motion(slot).end));
    order.extend((0..layout.frames).flat_map(|slot| layout.pose(slot)));
    order.extend((0..layout.frames).flat_map(|slot| layout.velocity_bias(slot)));
    order
}
