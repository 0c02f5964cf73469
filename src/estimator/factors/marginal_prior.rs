//! Marginalization prior in square-root form around fixed linearization points: the term `‖r_p − H_p X‖²` of Eq. 8.
//!
//! Rows `[J_m J_k | r]` by eliminated and by kept columns are transformed orthogonally, so that no normal equations are
//! formed (Demmel et al., Square Root Marginalization for Sliding-Window Bundle Adjustment, ICCV 2021):
//!
//! ```text
//! Qᵀ [J_m J_k | r] = [R_m * | *; 0 J | r_p]
//! ```
//!
//! The rows below `R_m` are the prior; it equals the prior of the Schur complement `H_kk − H_km H_mm⁻¹ H_mk`.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::factor::{Factor, JacobianBlock, Point, Products, Sink, WhitenedRows};
use super::kind::FactorLabel;
use crate::estimator::state::layout::{Layout, POSE};
use crate::geometry::triangular_factor::echelon;

/// Unknown that a column of the prior belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum PriorColumn {
    /// Entry `offset` of the block of the frame at `slot`, in the order of [`Layout`].
    Frame { slot: usize, offset: usize },
    /// Index of a calibration column.
    Calibration(usize),
}

impl PriorColumn {
    /// Column in the layout of the window.
    pub(crate) fn index(self, layout: &Layout) -> usize {
        match self {
            Self::Frame { slot, offset } => layout.frame(slot).start + offset,
            Self::Calibration(parameter) => layout.calibration().start + parameter,
        }
    }

    fn from_index(index: usize, layout: &Layout) -> Self {
        if index >= layout.calibration().start {
            return Self::Calibration(index - layout.calibration().start);
        }
        Self::Frame { slot: index / layout.frame_len(), offset: index % layout.frame_len() }
    }
}

/// `½‖r + J (x ⊟ x₀)‖²` with `x₀` the first estimates of the frames and of the calibration.
#[derive(Clone, Debug)]
pub(crate) struct Prior {
    columns: Vec<PriorColumn>,
    jacobian: DMatrix<f64>,
    residual: DVector<f64>,
    /// `JᵀJ`, constant over all iterations, as is `gradient = Jᵀr`.
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
}

impl Prior {
    /// Prior from whitened rows `[columns of the layout | residual]` with residuals at `x₀`, after elimination of the
    /// columns of the frame at `gone`; `None` when nothing remains.
    pub(crate) fn eliminating(rows: &DMatrix<f64>, layout: &Layout, gone: usize) -> Option<Self> {
        let total = layout.total();
        let removed = layout.frame(gone);
        let active = |column: &usize| rows.column(*column).iter().any(|entry| *entry != 0.0);
        let eliminated: Vec<usize> = removed.clone().filter(active).collect();
        let kept: Vec<usize> = (0..total).filter(|column| !removed.contains(column)).filter(active).collect();
        if kept.is_empty() {
            return None;
        }
        let ordered: Vec<usize> = eliminated.iter().chain(&kept).copied().chain([total]).collect();
        // Drops residuals that no unknown can change: their cost would accumulate over a flight until no step
        // seemed to lower the cost.
        let echelon = echelon(&rows.select_columns(&ordered), eliminated.len());
        let (first, height) = (echelon.leading_rank, echelon.rows.nrows() - echelon.leading_rank);
        if height == 0 {
            return None;
        }
        let jacobian = echelon.rows.view((first, eliminated.len()), (height, kept.len())).into_owned();
        let residual = echelon.rows.view((first, eliminated.len() + kept.len()), (height, 1)).column(0).into_owned();
        let columns = kept.iter().map(|index| PriorColumn::from_index(*index, layout)).collect();
        Some(Self::new(columns, jacobian, residual))
    }

    pub(crate) fn new(columns: Vec<PriorColumn>, jacobian: DMatrix<f64>, residual: DVector<f64>) -> Self {
        let hessian = jacobian.transpose() * &jacobian;
        let gradient = jacobian.tr_mul(&residual);
        Self { columns, jacobian, residual, hessian, gradient }
    }

    /// Renumbers the slots after removal of the frame at `gone`, which the prior must not contain.
    pub(crate) fn renumber(&mut self, gone: usize) {
        for column in &mut self.columns {
            if let PriorColumn::Frame { slot, .. } = column {
                debug_assert!(*slot != gone, "the frame was eliminated before it left");
                if *slot > gone {
                    *slot -= 1;
                }
            }
        }
    }

    /// Renumbers the columns for a layout with more columns: joint motion within each frame, and calibration,
    /// where `places` has the new index of each old column.
    pub(crate) fn move_columns(&mut self, old: &Layout, new: &Layout, places: &[usize]) {
        let added = new.joint_motion - old.joint_motion;
        let before_motion = POSE + old.joints;
        for column in &mut self.columns {
            match column {
                PriorColumn::Frame { offset, .. } if *offset >= before_motion => *offset += added,
                PriorColumn::Frame { .. } => {}
                PriorColumn::Calibration(place) => *place = places[*place],
            }
        }
    }

    /// True if the prior has columns of the frame at `slot`.
    pub(crate) fn holds_frame(&self, slot: usize) -> bool {
        self.columns
            .iter()
            .any(|column| matches!(column, PriorColumn::Frame { slot: contained, .. } if *contained == slot))
    }

    /// True if the prior has columns of some of these calibration parameters.
    pub(crate) fn holds_calibration(&self, parameters: &Range<usize>) -> bool {
        let contained = |column: &PriorColumn| matches!(column, PriorColumn::Calibration(contained) if parameters.contains(contained));
        self.columns.iter().any(contained)
    }

    /// Number of scalar residuals.
    pub(crate) fn len(&self) -> usize {
        self.residual.len()
    }

    /// The unknowns of the columns.
    pub(crate) fn columns(&self) -> &[PriorColumn] {
        &self.columns
    }

    /// Square-root information matrix `J` of the prior.
    pub(crate) fn jacobian(&self) -> &DMatrix<f64> {
        &self.jacobian
    }

    /// `r`, the residual at `x₀`.
    pub(crate) fn offset(&self) -> &DVector<f64> {
        &self.residual
    }

    /// Residual at an estimate; `first_estimate_offset` is `x ⊟ x₀` in the window's layout.
    pub(crate) fn residual(&self, layout: &Layout, first_estimate_offset: &DVector<f64>) -> DVector<f64> {
        &self.residual + &self.jacobian * self.gather(layout, first_estimate_offset)
    }

    /// Whitened rows `[columns of the layout | residual]`, residuals at `first_estimate_offset` from `x₀`.
    pub(crate) fn rows(&self, layout: &Layout, first_estimate_offset: &DVector<f64>) -> DMatrix<f64> {
        let mut rows = DMatrix::zeros(self.len(), layout.total() + 1);
        for (column, place) in self.columns.iter().enumerate() {
            rows.set_column(place.index(layout), &self.jacobian.column(column));
        }
        rows.set_column(layout.total(), &self.residual(layout, first_estimate_offset));
        rows
    }

    /// Transforms the calibration columns to another parameterization: `old = by_new · new` to first order.
    ///
    /// `first_estimate_offsets` are the offsets of the calibration from its first estimate in the old and in the
    /// new parameterization. If they differ beyond first order, the residual compensates the difference, so that
    /// cost and gradient are unchanged at the current estimate.
    pub(crate) fn transport_calibration(
        &mut self,
        old_from_new: &DMatrix<f64>,
        first_estimate_offsets: Option<&(DVector<f64>, DVector<f64>)>,
        layout: &Layout,
    ) {
        let zero = DVector::zeros(layout.total());
        let rows = self.rows(layout, &zero);
        let calibration = layout.calibration();
        let moved = rows.columns_range(calibration.clone()) * old_from_new;
        let mut columns: Vec<PriorColumn> =
            self.columns.iter().copied().filter(|column| matches!(column, PriorColumn::Frame { .. })).collect();
        let mut jacobian = DMatrix::zeros(self.len(), columns.len() + moved.ncols());
        for (local, column) in columns.iter().enumerate() {
            jacobian.set_column(local, &rows.column(column.index(layout)));
        }
        jacobian.columns_mut(columns.len(), moved.ncols()).copy_from(&moved);
        columns.extend((0..moved.ncols()).map(PriorColumn::Calibration));
        let mut residual = self.residual.clone();
        if let Some((old, new)) = first_estimate_offsets {
            residual += rows.columns_range(calibration) * (old - old_from_new * new);
        }
        *self = Self::new(columns, jacobian, residual);
    }

    fn gather(&self, layout: &Layout, first_estimate_offset: &DVector<f64>) -> DVector<f64> {
        DVector::from_iterator(
            self.columns.len(),
            self.columns.iter().map(|column| first_estimate_offset[column.index(layout)]),
        )
    }
}

/// [`Prior`] on the window.
#[derive(Clone, Debug)]
pub(crate) struct MarginalPriorFactor<'a> {
    prior: &'a Prior,
    layout: Layout,
    /// `x ⊟ x₀` in the columns of the prior.
    offset: DVector<f64>,
}

impl<'a> MarginalPriorFactor<'a> {
    /// Factor of the window.
    pub(crate) fn of(prior: &'a Prior, point: &Point<'_>) -> Self {
        Self { prior, layout: point.layout, offset: prior.gather(&point.layout, &point.first_estimate_offset()) }
    }
}

impl Factor for MarginalPriorFactor<'_> {
    fn label(&self) -> FactorLabel {
        FactorLabel::MarginalizationPrior
    }

    fn rows<S: Sink>(&self, sink: &mut S) {
        let prior = self.prior;
        let residual = &prior.residual + &prior.jacobian * &self.offset;
        let mut rows = WhitenedRows { residual: residual.as_slice(), blocks: &[], products: None };
        if !S::DERIVATIVES {
            return sink.add(self.label(), &rows);
        }
        let columns = prior.columns.iter().zip(prior.jacobian.as_slice().chunks_exact(prior.len()));
        let blocks: Vec<JacobianBlock<'_>> =
            columns.map(|(column, entries)| JacobianBlock { start: column.index(&self.layout), entries }).collect();
        let gradient = &prior.gradient + &prior.hessian * &self.offset;
        rows.blocks = &blocks;
        rows.products = Some(Products { hessian: &prior.hessian, gradient: &gradient });
        sink.add(self.label(), &rows);
    }
}
