//! Cholesky factorization of a symmetric matrix that skips zeros.

#![expect(clippy::inline_always, reason = "code that is not inlined is not compiled for the registers of its caller")]

use nalgebra::{DMatrix, DVector};
use pulp::{Arch, Simd, WithSimd};

/// Addition to the diagonal of an information matrix, so that unknowns without a factor do not move.
pub(crate) const DIAGONAL_FLOOR: f64 = 1e-6;
/// Number of columns eliminated together: velocity and biases of a frame.
const PANEL: usize = 9;

/// Lower Cholesky factor `L` of a matrix whose unknowns are eliminated in a given order.
///
/// Rows that are zero in all columns of a panel are skipped in its elimination: an order that starts with unknowns
/// coupled with few others is cheaper.
#[derive(Clone, Debug)]
pub(crate) struct Cholesky {
    /// Index in the matrix of each unknown, in the order of elimination.
    order: Vec<usize>,
    /// Column-major, n × n.
    lower: Vec<f64>,
}

impl Cholesky {
    /// Factors a symmetric matrix from its lower triangle; `None` when it is not positive definite.
    pub(crate) fn new(matrix: &DMatrix<f64>) -> Option<Self> {
        Self::ordered(matrix, (0..matrix.nrows()).collect(), |diagonal| diagonal)
    }

    /// [`Self::new`] for the unknowns in `order` only, eliminated in that order; `diagonal` maps the diagonal entries.
    pub(crate) fn ordered(matrix: &DMatrix<f64>, order: Vec<usize>, diagonal: impl Fn(f64) -> f64) -> Option<Self> {
        Self::ordered_in(Vec::new(), matrix, order, diagonal)
    }

    /// [`Self::ordered`] in the memory of an earlier factor, see [`Self::into_storage`].
    pub(crate) fn ordered_in(
        storage: Vec<f64>,
        matrix: &DMatrix<f64>,
        order: Vec<usize>,
        diagonal: impl Fn(f64) -> f64,
    ) -> Option<Self> {
        let count = order.len();
        let mut places = vec![None; matrix.nrows()];
        for (place, index) in order.iter().enumerate() {
            places[*index] = Some(place);
        }
        let mut lower = storage;
        lower.clear();
        lower.resize(count * count, 0.0);
        for (column, of_column) in places.iter().enumerate() {
            let Some(of_column) = *of_column else { continue };
            let below = &matrix.column(column).data.into_slice()[column..];
            for (entries, places) in below.chunks(PANEL).zip(places[column..].chunks(PANEL)) {
                if entries.iter().all(|entry| *entry == 0.0) {
                    continue;
                }
                for (entry, of_row) in entries.iter().zip(places) {
                    if let Some(of_row) = *of_row {
                        lower[of_row.min(of_column) * count + of_row.max(of_column)] = *entry;
                    }
                }
            }
        }
        for place in 0..count {
            let entry = &mut lower[place * count + place];
            *entry = diagonal(*entry);
        }
        Arch::new().dispatch(Factorization { lower: &mut lower, count }).then_some(Self { order, lower })
    }

    /// Buffer of this factor, to be reused.
    pub(crate) fn into_storage(self) -> Vec<f64> {
        self.lower
    }

    fn count(&self) -> usize {
        self.order.len()
    }

    /// Column of `L` from the diagonal on.
    fn column(&self, column: usize) -> &[f64] {
        &self.lower[column * self.count() + column..(column + 1) * self.count()]
    }

    /// Solves `A x = b`.
    pub(crate) fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let mut solution: Vec<f64> = self.order.iter().map(|index| right[*index]).collect();
        self.solve_lower(0, &mut solution);
        self.solve_upper(self.count(), &mut solution);
        let mut ordered = right.clone();
        for (index, value) in self.order.iter().zip(solution) {
            ordered[*index] = value;
        }
        ordered
    }

    /// Solves `L₂₂ y = b` in place for the unknowns from `first` on in the order of elimination.
    fn solve_lower(&self, first: usize, right: &mut [f64]) {
        for column in 0..right.len() {
            let (pivot, below) = self.column(first + column).split_first().expect("a column has its diagonal");
            let (value, rest) = right[column..].split_first_mut().expect("the column is one of them");
            *value /= pivot;
            if *value != 0.0 {
                for (entry, factor) in rest.iter_mut().zip(below) {
                    *entry -= factor * *value;
                }
            }
        }
    }

    /// Solves `L₁₁ᵀ x = b` in place for the first `count` unknowns in the order of elimination.
    fn solve_upper(&self, count: usize, right: &mut [f64]) {
        for column in (0..count).rev() {
            let (pivot, below) = self.column(column).split_first().expect("a column has its diagonal");
            let (value, rest) = right[column..count].split_first_mut().expect("the column is one of them");
            *value = (*value - dot(below, rest)) / pivot;
        }
    }

    /// Response of the other unknowns to the last `count` ones, `−A₁₁⁻¹ A₁₂`. It has the rows of the matrix; they are
    /// zero for the last unknowns and for unknowns that are not in the order.
    pub(crate) fn leading_response(&self, count: usize, rows: usize) -> DMatrix<f64> {
        let first = self.count() - count;
        let mut response = DMatrix::zeros(rows, count);
        let mut solution = vec![0.0; first];
        for (column, mut target) in response.column_iter_mut().enumerate() {
            for (row, value) in solution.iter_mut().enumerate() {
                *value = -self.lower[row * self.count() + first + column];
            }
            self.solve_upper(first, &mut solution);
            for (index, value) in self.order.iter().zip(&solution) {
                target[*index] = *value;
            }
        }
        response
    }

    /// Covariance of some unknowns, the others marginalized: their block of `(L Lᵀ)⁻¹`.
    pub(crate) fn covariance_of(&self, unknowns: impl Iterator<Item = usize>) -> DMatrix<f64> {
        let place = |unknown: usize| self.order.iter().position(|index| *index == unknown);
        let places: Vec<usize> = unknowns.filter_map(place).collect();
        // L is zero above the diagonal, so the solution starts at the first of these unknowns.
        let first = places.iter().min().copied().unwrap_or(0);
        let mut inverse = DMatrix::zeros(self.count() - first, places.len());
        for (mut column, place) in inverse.column_iter_mut().zip(&places) {
            column[place - first] = 1.0;
            self.solve_lower(first, column.as_mut_slice());
        }
        inverse.tr_mul(&inverse)
    }

    /// Length of a step of the last `count` unknowns in standard deviations, the others marginalized: `‖L₂₂ᵀ x₂‖`.
    /// `step` is ordered as in the matrix.
    pub(crate) fn trailing_length(&self, count: usize, step: &DVector<f64>) -> f64 {
        let first = self.count() - count;
        let last: Vec<f64> = self.order[first..].iter().map(|index| step[*index]).collect();
        (0..count).map(|place| dot(self.column(first + place), &last[place..]).powi(2)).sum::<f64>().sqrt()
    }

    /// Covariance of the last `count` unknowns, the others marginalized: `(L₂₂ L₂₂ᵀ)⁻¹`.
    pub(crate) fn trailing_covariance(&self, count: usize) -> DMatrix<f64> {
        self.covariance_of(self.order[self.count() - count..].iter().copied())
    }
}

/// Scalar product over the length of the shorter vector.
fn dot(left: &[f64], right: &[f64]) -> f64 {
    const SUMS: usize = 8;
    let count = left.len().min(right.len());
    let (left, right) = (&left[..count], &right[..count]);
    let mut sums = [0.0; SUMS];
    let (left_parts, right_parts) = (left.chunks_exact(SUMS), right.chunks_exact(SUMS));
    let (left_rest, right_rest) = (left_parts.remainder(), right_parts.remainder());
    for (a, b) in left_parts.zip(right_parts) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    let rest: f64 = left_rest.iter().zip(right_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

/// In-place factorization, compiled for every width of vector registers; `false` when a pivot is not positive.
struct Factorization<'a> {
    lower: &'a mut [f64],
    count: usize,
}

impl WithSimd for Factorization<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let Self { lower, count } = self;
        let mut panel = Vec::new();
        // Sum of the absolute entries of each row in the panel.
        let mut sizes = Vec::new();
        // Runs of consecutive rows with entries in the panel: first row and end row (exclusive).
        let mut runs: Vec<(usize, usize)> = Vec::new();
        let mut begin = 0;
        while begin < count {
            let width = PANEL.min(count - begin);
            runs.clear();
            runs.push((begin, begin + width));
            sizes.clear();
            sizes.resize(count - begin - width, 0.0);
            for column in begin..begin + width {
                let below = &lower[column * count + begin + width..(column + 1) * count];
                for (size, entry) in sizes.iter_mut().zip(below) {
                    *size += entry.abs();
                }
            }
            for (offset, size) in sizes.iter().enumerate() {
                if *size == 0.0 {
                    continue;
                }
                let row = begin + width + offset;
                match runs.last_mut() {
                    Some((_, end)) if *end == row => *end += 1,
                    _ => runs.push((row, row + 1)),
                }
            }
            let mut height = 0;
            for (first, end) in &runs {
                height += end - first;
            }
            panel.clear();
            panel.resize(PANEL * height, 0.0);
            for column in 0..width {
                let mut place = column * height;
                for (first, end) in &runs {
                    let source = &lower[(begin + column) * count..][*first..*end];
                    panel[place..place + source.len()].copy_from_slice(source);
                    place += source.len();
                }
            }
            if !factor_panel(&mut panel, height, width) {
                return false;
            }
            for column in 0..width {
                let mut place = column * height;
                for (first, end) in &runs {
                    let target = &mut lower[(begin + column) * count..][*first..*end];
                    target.copy_from_slice(&panel[place..place + target.len()]);
                    place += target.len();
                }
            }
            // Subtract the products of the panel from the rows after it.
            let mut place = width;
            for (index, (first, end)) in runs.iter().enumerate() {
                for column in (begin + width).max(*first)..*end {
                    let mut factors = [0.0; PANEL];
                    for k in 0..PANEL {
                        factors[k] = panel[k * height + place];
                    }
                    let mut source = place;
                    let mut row = column;
                    for (later_first, later_end) in &runs[index..] {
                        row = row.max(*later_first);
                        let target = &mut lower[column * count + row..column * count + later_end];
                        subtract(simd, target, &panel, height, source, &factors);
                        source += target.len();
                    }
                    place += 1;
                }
            }
            begin += width;
        }
        true
    }
}

/// Factors the columns of a panel, whose first rows are the rows of the diagonal block.
#[inline(always)]
fn factor_panel(panel: &mut [f64], height: usize, width: usize) -> bool {
    for column in 0..width {
        let (own, later) = panel[column * height..].split_at_mut(height);
        let pivot = own[column];
        // A NaN pivot is rejected too.
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        let root = pivot.sqrt();
        let inverse = root.recip();
        own[column] = root;
        for entry in &mut own[column + 1..] {
            *entry *= inverse;
        }
        for (offset, target) in later.chunks_exact_mut(height).take(width - column - 1).enumerate() {
            let row = column + 1 + offset;
            let factor = own[row];
            for (entry, source) in target[row..].iter_mut().zip(&own[row..]) {
                *entry -= factor * source;
            }
        }
    }
    true
}

/// Subtracts the products of a panel's rows from `source` on with the factors from the rows `target` of a column.
#[inline(always)]
fn subtract<S: Simd>(simd: S, target: &mut [f64], panel: &[f64], height: usize, source: usize, factors: &[f64; PANEL]) {
    let count = target.len();
    let (vectors, rest) = S::as_mut_simd_f64s(target);
    let first_of_rest = count - rest.len();
    let mut columns: [&[S::f64s]; PANEL] = [&[]; PANEL];
    let mut weights = [simd.splat_f64s(0.0); PANEL];
    for k in 0..PANEL {
        columns[k] = &S::as_simd_f64s(&panel[k * height + source..][..count]).0[..vectors.len()];
        weights[k] = simd.splat_f64s(-factors[k]);
    }
    for (place, vector) in vectors.iter_mut().enumerate() {
        // Two independent sums, because each multiply-add depends on the previous one of the same sum.
        let mut sum = *vector;
        let mut other = simd.splat_f64s(0.0);
        for k in 0..PANEL / 2 {
            sum = simd.mul_add_e_f64s(columns[2 * k][place], weights[2 * k], sum);
            other = simd.mul_add_e_f64s(columns[2 * k + 1][place], weights[2 * k + 1], other);
        }
        sum = simd.mul_add_e_f64s(columns[PANEL - 1][place], weights[PANEL - 1], sum);
        *vector = simd.add_f64s(sum, other);
    }
    for (row, entry) in (first_of_rest..).zip(rest) {
        for k in 0..PANEL {
            *entry -= panel[k * height + source + row] * factors[k];
        }
    }
}
