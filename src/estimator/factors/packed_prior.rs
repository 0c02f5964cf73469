//! Marginalization prior without its products and zeros.

use nalgebra::{DMatrix, DVector};

use super::marginal_prior::{Prior, PriorColumn};

/// [`Prior`] that stores of each column of the Jacobian only the entries down to the last nonzero one: the Jacobian is
/// nearly triangular.
#[derive(Clone, Debug)]
pub(crate) struct PackedPrior {
    columns: Vec<PriorColumn>,
    /// Number of stored entries of each column.
    heights: Vec<u16>,
    entries: Vec<f64>,
    residual: DVector<f64>,
}

impl PackedPrior {
    pub(crate) fn new(prior: &Prior) -> Self {
        let height = |column: &[f64]| column.iter().rposition(|entry| entry.to_bits() != 0).map_or(0, |last| last + 1);
        let jacobian = prior.jacobian();
        let columns = || jacobian.as_slice().chunks_exact(jacobian.nrows().max(1));
        let heights: Vec<u16> = columns().map(|column| height(column) as u16).collect();
        let mut entries = Vec::with_capacity(heights.iter().map(|height| usize::from(*height)).sum());
        for (column, height) in columns().zip(&heights) {
            entries.extend_from_slice(&column[..usize::from(*height)]);
        }
        Self { columns: prior.columns().to_vec(), heights, entries, residual: prior.offset().clone() }
    }

    pub(crate) fn unpacked(&self) -> Prior {
        let mut jacobian = DMatrix::zeros(self.residual.len(), self.heights.len());
        let mut entries = &self.entries[..];
        for (mut column, height) in jacobian.column_iter_mut().zip(&self.heights) {
            let (own, rest) = entries.split_at(usize::from(*height));
            column.as_mut_slice()[..own.len()].copy_from_slice(own);
            entries = rest;
        }
        Prior::new(self.columns.clone(), jacobian, self.residual.clone())
    }

    pub(crate) fn heap_bytes(&self) -> usize {
        self.columns.capacity() * size_of::<PriorColumn>()
            + self.heights.capacity() * size_of::<u16>()
            + (self.entries.capacity() + self.residual.len()) * size_of::<f64>()
    }
}
