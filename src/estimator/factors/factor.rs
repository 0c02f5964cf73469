//! A factor, its whitened rows, and the sinks that take them.

use nalgebra::{DMatrix, DVector, Vector3};

use super::kind::FactorLabel;
use crate::estimator::state::estimate::Estimate;
use crate::estimator::state::frame::Frame;
use crate::estimator::state::gimbal_imu_noise::GimbalImuNoise;
use crate::estimator::state::layout::Layout;

/// A factor of the least-squares problem: whitened residuals with their derivatives by columns of the layout.
///
/// Reprojection factors are separate ([`super::reprojection`]): their landmarks are eliminated before.
pub(crate) trait Factor {
    fn label(&self) -> FactorLabel;

    /// Passes the rows to a sink: residuals at the current estimate, derivatives at the linearization point.
    fn rows<S: Sink>(&self, sink: &mut S);
}

/// Use of the rows of factors: their cost, their normal equations, or the rows themselves.
pub(crate) trait Sink {
    /// False if derivatives are not used; factors then omit them.
    const DERIVATIVES: bool;

    /// True if rows of this factor are to be added.
    fn wants(&self, _label: FactorLabel) -> bool {
        true
    }

    fn add(&mut self, label: FactorLabel, rows: &WhitenedRows<'_>);

    /// Adds the rows of a factor, if there is one and they are wanted.
    fn take(&mut self, factor: Option<impl Factor>)
    where
        Self: Sized,
    {
        if let Some(factor) = factor.filter(|factor| self.wants(factor.label())) {
            factor.rows(self);
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct WhitenedRows<'a> {
    /// Residual over its standard deviation (m × 1).
    pub(crate) residual: &'a [f64],
    /// Derivatives by columns of the layout; empty if the sink does not use derivatives.
    pub(crate) blocks: &'a [JacobianBlock<'a>],
    /// Normal equations of these rows, `None` if they are to be computed from the blocks.
    pub(crate) products: Option<Products<'a>>,
}

impl WhitenedRows<'_> {
    /// Columns of the layout, block by block.
    pub(crate) fn columns(&self) -> impl Iterator<Item = usize> + '_ {
        let height = self.residual.len();
        self.blocks.iter().flat_map(move |block| block.start..block.start + block.entries.len() / height)
    }
}

/// Derivative by consecutive columns of the layout.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JacobianBlock<'a> {
    /// First column of the layout.
    pub(crate) start: usize,
    /// Entries (m × n), column by column.
    pub(crate) entries: &'a [f64],
}

/// Normal equations of a factor by the columns of its blocks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Products<'a> {
    /// Product `JᵀJ` over the columns of the blocks.
    pub(crate) hessian: &'a DMatrix<f64>,
    /// Product `Jᵀr` over the columns of the blocks.
    pub(crate) gradient: &'a DVector<f64>,
}

/// States and measurements from which the factors of a window are made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point<'a> {
    pub(crate) layout: Layout,
    pub(crate) frames: &'a [Frame],
    /// Gravity in the world frame, in m/s².
    pub(crate) gravity_in_world: &'a Vector3<f64>,
    pub(crate) gimbal_imu_noise: GimbalImuNoise,
    /// Values x at which residuals are evaluated.
    pub(crate) at: &'a Estimate,
    /// Values at which derivatives are evaluated.
    pub(crate) linearized: &'a Estimate,
}

impl Point<'_> {
    /// `x ⊟ x₀` of all unknowns with a first estimate x₀, zero for the others (columns of the layout).
    pub(crate) fn first_estimate_offset(&self) -> DVector<f64> {
        let mut offset = DVector::zeros(self.layout.total());
        for (slot, (frame, current)) in self.frames.iter().zip(&self.at.frames).enumerate() {
            if let Some(first) = &frame.first_estimate {
                offset.rows_range_mut(self.layout.frame(slot)).copy_from(&current.minus(first));
            }
        }
        if self.layout.calibration > 0
            && let Some(change) = self.at.calibration.first_estimate_offset()
        {
            offset.rows_range_mut(self.layout.calibration()).copy_from(&change);
        }
        offset
    }
}

/// First columns of a navigation state `[φ, p | v | b_g, b_a]`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NavigationColumns {
    pub(crate) pose: usize,
    pub(crate) velocity: usize,
    pub(crate) biases: usize,
}

impl NavigationColumns {
    /// Columns of the frame at `slot`.
    pub(crate) fn of(layout: &Layout, slot: usize) -> Self {
        let velocity = layout.velocity_bias(slot).start;
        Self { pose: layout.pose(slot).start, velocity, biases: velocity + 3 }
    }

    /// Blocks of a derivative by the state (m × 15, column by column).
    pub(crate) fn blocks<'a>(&self, entries: &'a [f64]) -> [JacobianBlock<'a>; 3] {
        let height = entries.len() / 15;
        let (by_pose, others) = entries.split_at(6 * height);
        let (by_velocity, by_biases) = others.split_at(3 * height);
        [
            JacobianBlock { start: self.pose, entries: by_pose },
            JacobianBlock { start: self.velocity, entries: by_velocity },
            JacobianBlock { start: self.biases, entries: by_biases },
        ]
    }
}
