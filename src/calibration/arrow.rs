//! Symmetric positive definite systems of a band with a border: states in time order, then what all of them share.

use nalgebra::{DMatrix, DVector};

/// Lower triangle of `[band Cᵀ; C corner]`, the band of `len` unknowns stored row by row.
#[derive(Clone, Debug)]
pub(super) struct ArrowMatrix {
    len: usize,
    /// Entries left of the diagonal that are stored.
    half_width: usize,
    /// Row `i` holds the columns `i − half_width ..= i`.
    band: Vec<f64>,
    /// One row of the band's length per border unknown.
    border: Vec<Vec<f64>>,
    corner: DMatrix<f64>,
}

impl ArrowMatrix {
    /// All zero.
    pub(super) fn zeros(len: usize, half_width: usize, borders: usize) -> Self {
        let half_width = half_width.min(len.saturating_sub(1));
        Self {
            len,
            half_width,
            band: vec![0.0; len * (half_width + 1)],
            border: vec![vec![0.0; len]; borders],
            corner: DMatrix::zeros(borders, borders),
        }
    }

    /// Adds to an entry of the lower triangle of the band; what lies above the diagonal is passed over.
    pub(super) fn add(&mut self, row: usize, column: usize, value: f64) {
        if column <= row {
            debug_assert!(row - column <= self.half_width, "within the band");
            self.band[row * (self.half_width + 1) + column + self.half_width - row] += value;
        }
    }

    /// Adds to the coupling of a border unknown with one of the band.
    pub(super) fn add_border(&mut self, border: usize, column: usize, value: f64) {
        self.border[border][column] += value;
    }

    /// The border's own block; both triangles are kept.
    pub(super) fn corner_mut(&mut self) -> &mut DMatrix<f64> {
        &mut self.corner
    }

    /// Multiplies the diagonal by `1 + factor` and adds `floor` to it.
    pub(super) fn damp(&mut self, factor: f64, floor: f64) {
        for row in 0..self.len {
            let index = row * (self.half_width + 1) + self.half_width;
            self.band[index] += factor * self.band[index] + floor;
        }
        for border in 0..self.corner.nrows() {
            self.corner[(border, border)] += factor * self.corner[(border, border)] + floor;
        }
    }

    /// The Cholesky factor, `None` when the matrix is not positive definite.
    pub(super) fn factor(mut self) -> Option<ArrowFactor> {
        let (width, half) = (self.half_width + 1, self.half_width);
        for row in 0..self.len {
            let first = row.saturating_sub(half);
            let (above, this) = self.band.split_at_mut(row * width);
            for column in first..=row {
                let this_at = |k: usize| k + half - row;
                if column == row {
                    let squares = dot(&this[this_at(first)..half], &this[this_at(first)..half]);
                    let pivot = this[half] - squares;
                    if !(pivot > 0.0 && pivot.is_finite()) {
                        return None;
                    }
                    this[half] = pivot.sqrt();
                } else {
                    let begin = first.max(column.saturating_sub(half));
                    let other = &above[column * width..(column + 1) * width];
                    let at = |k: usize| k + half - column;
                    let product = dot(&this[this_at(begin)..this_at(column)], &other[at(begin)..half]);
                    let index = this_at(column);
                    this[index] = (this[index] - product) / other[half];
                }
            }
        }
        let mut factor = ArrowFactor {
            len: self.len,
            half_width: half,
            band: self.band,
            border: self.border,
            corner: DMatrix::zeros(0, 0),
        };
        let mut border = std::mem::take(&mut factor.border);
        for row in &mut border {
            factor.forward(row);
        }
        let mut corner = self.corner;
        for row in 0..border.len() {
            for column in 0..=row {
                let product = dot(&border[row], &border[column]);
                corner[(row, column)] -= product;
                corner[(column, row)] = corner[(row, column)];
            }
        }
        factor.border = border;
        factor.corner = corner;
        Some(factor)
    }
}

/// The factor `L` of the band, `L⁻¹Cᵀ`, and the border's Schur complement.
#[derive(Clone, Debug)]
pub(super) struct ArrowFactor {
    len: usize,
    half_width: usize,
    band: Vec<f64>,
    border: Vec<Vec<f64>>,
    corner: DMatrix<f64>,
}

impl ArrowFactor {
    /// Information about the border's unknowns once those of the band are eliminated.
    pub(super) fn border_information(&self) -> &DMatrix<f64> {
        &self.corner
    }

    /// Solves for the band's and the border's unknowns, `None` when the border is not positive definite.
    pub(super) fn solve(&self, band: &[f64], border: &DVector<f64>) -> Option<(Vec<f64>, DVector<f64>)> {
        let mut solution = band.to_vec();
        self.forward(&mut solution);
        let mut reduced = border.clone();
        for (entry, row) in reduced.iter_mut().zip(&self.border) {
            *entry -= dot(row, &solution);
        }
        let shared = if reduced.is_empty() { reduced } else { self.corner.clone().cholesky()?.solve(&reduced) };
        for (value, row) in shared.iter().zip(&self.border) {
            for (entry, coupling) in solution.iter_mut().zip(row) {
                *entry -= value * coupling;
            }
        }
        self.backward(&mut solution);
        Some((solution, shared))
    }

    /// `L⁻¹ x`, in place.
    fn forward(&self, vector: &mut [f64]) {
        let (width, half) = (self.half_width + 1, self.half_width);
        for row in 0..self.len {
            let first = row.saturating_sub(half);
            let entries = &self.band[row * width..(row + 1) * width];
            let product = dot(&entries[first + half - row..half], &vector[first..row]);
            vector[row] = (vector[row] - product) / entries[half];
        }
    }

    /// `L⁻ᵀ x`, in place.
    fn backward(&self, vector: &mut [f64]) {
        let (width, half) = (self.half_width + 1, self.half_width);
        for row in (0..self.len).rev() {
            let first = row.saturating_sub(half);
            let entries = &self.band[row * width..(row + 1) * width];
            vector[row] /= entries[half];
            let value = vector[row];
            for (entry, coupling) in vector[first..row].iter_mut().zip(&entries[first + half - row..half]) {
                *entry -= value * coupling;
            }
        }
    }
}

/// The scalar product, summed in eight strands of a fixed order.
fn dot(left: &[f64], right: &[f64]) -> f64 {
    let mut strands = [0.0; 8];
    let (left_chunks, right_chunks) = (left.chunks_exact(8), right.chunks_exact(8));
    let rest: f64 = left_chunks.remainder().iter().zip(right_chunks.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in left_chunks.zip(right_chunks) {
        for strand in 0..8 {
            strands[strand] += a[strand] * b[strand];
        }
    }
    strands.iter().sum::<f64>() + rest
}
