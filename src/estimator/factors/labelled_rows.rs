//! Rows of factors as matrices `[columns of the layout | residual]`.

use std::ops::Range;

use nalgebra::{DMatrix, DMatrixView, DVectorView};

use super::factor::{Sink, WhitenedRows};
use super::kind::FactorLabel;

/// Whitened rows with the label of their factor, in the order in which they were added.
#[derive(Clone, Debug)]
pub(crate) struct LabelledRows<W = fn(FactorLabel) -> bool> {
    /// Number of columns of the layout; the residual is the column after them.
    columns: usize,
    wanted: W,
    pub(crate) parts: Vec<LabelledPart>,
}

/// Rows that were added at once.
#[derive(Clone, Debug)]
pub(crate) struct LabelledPart {
    pub(crate) label: FactorLabel,
    /// `[columns of the layout | residual]`.
    pub(crate) rows: DMatrix<f64>,
    /// Columns of each block.
    blocks: Vec<Range<usize>>,
}

impl LabelledPart {
    /// True if a block has some of these columns.
    pub(crate) fn touches(&self, columns: &Range<usize>) -> bool {
        self.blocks.iter().any(|block| block.start < columns.end && columns.start < block.end)
    }
}

impl LabelledRows {
    /// Takes the rows of all factors.
    pub(crate) fn new(columns: usize) -> Self {
        Self::of(columns, |_| true)
    }
}

impl<W: Fn(FactorLabel) -> bool> LabelledRows<W> {
    /// Takes the rows of the wanted factors.
    pub(crate) fn of(columns: usize, wanted: W) -> Self {
        Self { columns, wanted, parts: Vec::new() }
    }

    /// Rows of each part.
    pub(crate) fn matrices(&self) -> impl Iterator<Item = &DMatrix<f64>> {
        self.parts.iter().map(|part| &part.rows)
    }

    /// Rows of each factor in one matrix; adjacent parts with equal labels belong together.
    pub(crate) fn by_factor(&self) -> impl Iterator<Item = (FactorLabel, DMatrix<f64>)> + '_ {
        self.parts
            .chunk_by(|one, next| one.label == next.label)
            .map(|parts| (parts[0].label, stack(parts.iter().map(|part| &part.rows), 0..=self.columns)))
    }
}

impl<W: Fn(FactorLabel) -> bool> Sink for LabelledRows<W> {
    const DERIVATIVES: bool = true;

    fn wants(&self, label: FactorLabel) -> bool {
        (self.wanted)(label)
    }

    fn add(&mut self, label: FactorLabel, rows: &WhitenedRows<'_>) {
        let height = rows.residual.len();
        let mut matrix = DMatrix::zeros(height, self.columns + 1);
        let mut blocks = Vec::with_capacity(rows.blocks.len());
        for block in rows.blocks {
            let width = block.entries.len() / height;
            let entries = DMatrixView::from_slice(block.entries, height, width);
            matrix.columns_mut(block.start, width).copy_from(&entries);
            blocks.push(block.start..block.start + width);
        }
        matrix.set_column(self.columns, &DVectorView::from_slice(rows.residual, height));
        self.parts.push(LabelledPart { label, rows: matrix, blocks });
    }
}

/// Stacks the given columns of matrices.
pub(crate) fn stack<'a>(
    parts: impl IntoIterator<Item = &'a DMatrix<f64>>,
    columns: impl IntoIterator<Item = usize>,
) -> DMatrix<f64> {
    let (parts, columns): (Vec<&DMatrix<f64>>, Vec<usize>) =
        (parts.into_iter().collect(), columns.into_iter().collect());
    let height = parts.iter().map(|part| part.nrows()).sum();
    let mut stacked = DMatrix::zeros(height, columns.len());
    for (target, source) in columns.into_iter().enumerate() {
        let mut start = 0;
        for part in &parts {
            stacked.view_mut((start, target), (part.nrows(), 1)).copy_from(&part.column(source));
            start += part.nrows();
        }
    }
    stacked
}
