//! Moving a window along its null directions leaves every residual unchanged.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::super::LaboratoryForm;
use super::super::table::set_ranks;
use super::super::window::{SensorState, SensorWindow};
use super::golden::{CASES, Case};
use crate::geometry::dense;
use crate::gimbal::Parameterization;
use crate::observability::laboratory::SensorColumns;

/// Length of a step in units of the column scale: 0.2°, 0.6 mm, 0.4 ms, 0.2 px, 0.02 % for the IMU.
const STEP: f64 = 0.02;
/// Relative size of a singular value that is treated as zero in a least-squares step.
const ZERO: f64 = 1e-10;

/// Minimum-norm change of all columns with the smallest linearized residual; the columns after the first `open` ones
/// keep their change in `delta`.
fn step(reduced: &DMatrix<f64>, delta: &DVector<f64>, open: usize) -> DVector<f64> {
    let jacobian = reduced.columns(0, delta.len());
    let target = -(reduced.column(delta.len()) + jacobian * delta);
    let mut open = jacobian.columns(0, open).into_owned();
    // A column of rounding errors keeps a zero change.
    let largest = open.column_iter().map(|column| column.norm()).fold(0.0, f64::max);
    let scales: Vec<f64> =
        open.column_iter().map(|it| it.norm()).map(|it| if it > ZERO * largest { it.recip() } else { 0.0 }).collect();
    for (mut column, scale) in open.column_iter_mut().zip(&scales) {
        column *= *scale;
    }
    let svd = dense::thin_svd(&open).unwrap();
    let mut along = svd.u.tr_mul(&target);
    for (value, singular) in along.iter_mut().zip(svd.singular_values.iter()) {
        *value = if *singular > ZERO * svd.singular_values[0] { *value / singular } else { 0.0 };
    }
    let mut whole = delta.clone();
    for (index, change) in (&svd.v * along).iter().enumerate() {
        whole[index] += change * scales[index];
    }
    whole
}

/// State after a step of the columns, with the landmarks that fit best.
fn moved(window: &SensorWindow<'_>, state: &SensorState, delta: &DVector<f64>) -> SensorState {
    let rows = window.rows(state).unwrap();
    let mut next = state.plus(&window.layout, delta.as_slice());
    for (position, rows) in next.landmarks.iter_mut().zip(&rows) {
        let target = -(rows.residual() + rows.jacobian() * delta);
        let svd = dense::thin_svd(&rows.by_landmark).unwrap();
        for (index, singular) in svd.singular_values.iter().enumerate() {
            if *singular > ZERO * svd.singular_values[0] {
                let along = svd.u.column(index).dot(&target) / singular;
                *position += svd.v.column(index) * along;
            }
        }
    }
    next
}

fn residual(window: &SensorWindow<'_>, state: &SensorState) -> f64 {
    window.rows(state).unwrap().iter().map(|rows| rows.residual().amax()).fold(0.0, f64::max)
}

/// Effect of a finite step along the null directions on the residuals.
#[derive(Debug)]
struct Moved {
    /// Largest whitened residual after a linear step and after half of it.
    first_order: [f64; 2],
    /// Largest whitened residual after the same step and iterations over all unknowns.
    followed: f64,
    /// Ratio of the step that remains after these iterations.
    remaining: f64,
}

fn move_along(case: &Case) -> Option<Moved> {
    let sets = SensorColumns::ALL;
    let setup = case.setup();
    let form = LaboratoryForm::whole(Parameterization::Minimal);
    let ranks = set_ranks(&setup, form, &[sets]).unwrap();
    let window = SensorWindow::new(&setup, form, sets);
    let parameters = &ranks[0].parameters;
    if ranks[0].null.is_empty() {
        return None;
    }
    let mut direction = DVector::zeros(parameters.len());
    for (index, null) in ranks[0].null.iter().enumerate() {
        let weight = if index % 2 == 0 { 1.0 } else { -0.7 };
        direction += DVector::from_column_slice(&null.weights) * weight;
    }
    direction.normalize_mut();
    let (first, total) = (window.layout.calibration().start, window.layout.total());
    let at_truth = window.reduced(&window.truth).unwrap();
    let given = |size: f64| {
        let mut delta = DVector::zeros(total);
        for (column, parameter) in parameters.iter().enumerate() {
            delta[first + column] = size * direction[column] * parameter.scale();
        }
        delta
    };
    let first_order = [STEP, 0.5 * STEP]
        .map(|size| residual(&window, &moved(&window, &window.truth, &step(&at_truth, &given(size), first))));
    let mut state = moved(&window, &window.truth, &step(&at_truth, &given(STEP), first));
    let mut moved_by = given(STEP).rows_range(first..).into_owned();
    for _ in 0..3 {
        let delta = step(&window.reduced(&state).unwrap(), &DVector::zeros(total), total);
        moved_by += delta.rows_range(first..);
        state = moved(&window, &state, &delta);
    }
    let scaled = DVector::from_fn(parameters.len(), |column, _| moved_by[column] / parameters[column].scale());
    Some(Moved { first_order, followed: residual(&window, &state), remaining: scaled.dot(&direction) / STEP })
}

#[test]
fn residuals_are_unchanged_along_null_directions() {
    CASES.par_iter().for_each(|case| {
        let moved = move_along(case).expect("every case has a null direction");
        let [whole, half] = moved.first_order;
        // Curved symmetries leave a second-order remainder in a straight step.
        assert!(half < 0.3 * whole + 1e-8, "{}: {moved:?}", case.name());
        assert!(whole < 1e-2, "{}: {moved:?}", case.name());
        assert!(moved.followed < 1e-7, "{}: {moved:?}", case.name());
        // The other unknowns do not undo the step; rounding errors may extend it.
        assert!(moved.remaining.abs() > 0.5, "{}: {moved:?}", case.name());
    });
}
