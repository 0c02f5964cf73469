//! Band with border against dense algebra.

use nalgebra::{DMatrix, DVector};

use crate::calibration::arrow::ArrowMatrix;
use crate::geometry::SplitMix64;

/// Positive definite arrow matrix of this shape, dense and stored.
fn example(len: usize, half_width: usize, borders: usize) -> (DMatrix<f64>, ArrowMatrix) {
    let total = len + borders;
    let mut numbers = SplitMix64::new(12345);
    let mut random = || numbers.next_unit() - 0.5;
    let mut dense = DMatrix::zeros(total, total);
    for row in 0..total {
        for column in 0..=row {
            if row >= len || row - column <= half_width {
                let value = if row == column { total as f64 } else { random() };
                dense[(row, column)] = value;
                dense[(column, row)] = value;
            }
        }
    }
    let mut arrow = ArrowMatrix::zeros(len, half_width, borders, vec![1.5; 1000]);
    for row in 0..len {
        for column in row.saturating_sub(half_width)..(row + half_width + 1).min(len) {
            arrow.add(row, column, dense[(row, column)]);
        }
    }
    for border in 0..borders {
        for column in 0..len {
            arrow.add_border(border, column, dense[(len + border, column)]);
        }
    }
    arrow.corner_mut().copy_from(&dense.view((len, len), (borders, borders)));
    (dense, arrow)
}

fn check(len: usize, half_width: usize, borders: usize) {
    let (dense, arrow) = example(len, half_width, borders);
    let right = DVector::from_fn(len + borders, |row, _| (row as f64 * 0.7).sin());
    let expected = dense.clone().lu().solve(&right).unwrap();
    let factor = arrow.factor().unwrap();
    let border = right.rows(len, borders).into_owned();
    let (band, shared) = factor.solve(&right.as_slice()[..len], &border).unwrap();
    let found: Vec<f64> = band.into_iter().chain(shared.iter().copied()).collect();
    assert!((DVector::from_vec(found) - expected).amax() < 1e-12, "{len} {half_width} {borders}");
    let inverse = dense.try_inverse().unwrap();
    let size = len.min(6).min(half_width + 1);
    let ranges: Vec<_> = (0..=len - size).step_by(size).map(|start| start..start + size).collect();
    for (range, found) in ranges.iter().zip(factor.clone().covariances(&ranges).unwrap()) {
        let expected = inverse.view((range.start, range.start), (size, size));
        assert!((found - expected).amax() < 1e-14, "{len} {half_width} {borders}: {range:?}");
    }
    if borders > 0 {
        let covariance = inverse.view((len, len), (borders, borders)).into_owned();
        let information = factor.border_information().clone().try_inverse().unwrap();
        assert!((covariance - information).amax() < 1e-12);
    }
}

#[test]
fn the_bordered_band_solver_equals_dense_algebra() {
    let small = [(1, 0, 0), (5, 4, 0), (40, 7, 3), (33, 16, 1), (20, 100, 4)];
    // Several blocks, complete and incomplete.
    let large = [(130, 0, 1), (128, 64, 2), (200, 70, 3), (321, 130, 2), (150, 149, 1)];
    for (len, half_width, borders) in small.into_iter().chain(large) {
        check(len, half_width, borders);
    }
}

#[test]
fn a_matrix_that_is_not_positive_definite_is_refused() {
    let mut arrow = ArrowMatrix::zeros(3, 1, 0, Vec::new());
    arrow.add(0, 0, 1.0);
    arrow.add(1, 1, -1.0);
    arrow.add(2, 2, 1.0);
    assert!(arrow.factor().is_none());
}
