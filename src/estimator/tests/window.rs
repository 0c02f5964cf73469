//! Least-squares problem of the window: Jacobians, elimination, marginalization, solve.

use nalgebra::{DMatrix, DVector, Vector3};

use super::fixture;
use super::fixture::TestWindow;
use crate::estimator::config::{EstimatorOptions, VisualLoss};
use crate::estimator::factors::kind::{FactorKind, FactorLabel};
use crate::estimator::factors::labelled_rows::stack;
use crate::estimator::problem::marginalization;
use crate::estimator::problem::solver::{self, SolverLimits};
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::state::estimate::Estimate;
use crate::estimator::window::drop_or_marginalize_frame;
use crate::estimator::window::solve::covariances;
use crate::geometry::triangular_factor;
use crate::gimbal::Parameterization;
use crate::optimization::{Cholesky, RobustLoss};

fn quadratic() -> EstimatorOptions {
    EstimatorOptions { loss: VisualLoss::Fixed(RobustLoss::None), ..EstimatorOptions::default() }
}

/// Windows of a gimbal in each parameterization, a rigid camera, both cameras with and without time offsets, a
/// rolling shutter of 20 ms, intrinsics, and an IMU on the gimbal.
pub(super) fn windows() -> Vec<(&'static str, TestWindow)> {
    let gimbal = |parameterization| fixture::window(parameterization, true, quadratic());
    vec![
        ("minimal", gimbal(Parameterization::Minimal)),
        ("minimal-swapped-yx", gimbal(Parameterization::MinimalSwappedYx)),
        ("classical", gimbal(Parameterization::Classical)),
        ("poe", gimbal(Parameterization::Poe)),
        ("rigid", fixture::window(Parameterization::Minimal, false, quadratic())),
        ("cluster", fixture::cluster_window(quadratic(), false)),
        ("cluster with clocks", fixture::cluster_window(quadratic(), true)),
        ("mounted on cameras", fixture::mounted_window(quadratic(), false)),
        ("interleaved", fixture::interleaved_window(quadratic(), false)),
        ("interleaved with clocks", fixture::interleaved_window(quadratic(), true)),
        (
            "rigid, rolling",
            fixture::changed_window(false, quadratic(), |config| {
                (config.estimate_readout, config.estimate_timeshift) = (true, true);
                config.sensor.readout_s = 0.02;
            }),
        ),
        (
            "gimbal, rolling",
            fixture::changed_window(true, quadratic(), |config| {
                (config.estimate_readout, config.estimate_intrinsics) = (true, true);
                config.sensor.readout_s = 0.02;
            }),
        ),
        ("IMU intrinsics", fixture::changed_window(false, quadratic(), |config| config.estimate_imu_intrinsics = true)),
        ("intrinsics", fixture::changed_window(true, quadratic(), |config| config.estimate_intrinsics = true)),
        ("gimbal IMU", fixture::gimbal_imu_window(quadratic(), |_| {})),
        ("gimbal IMU, axes", fixture::gimbal_imu_window(quadratic(), |config| config.estimate_gimbal_imu = true)),
    ]
}

#[test]
fn the_gradient_of_every_factor_meets_central_differences() {
    let mounted = ("mounted on cameras, intrinsics", fixture::mounted_window(quadratic(), true));
    let pair = ("stereo pair", fixture::stereo_window(quadratic()));
    for (name, mut estimator) in windows().into_iter().chain([mounted, pair]) {
        // Steps are taken from the first estimates: derivatives equal finite differences only there.
        fixture::disturb(&mut estimator, 0.2);
        fixture::marginalize_once(&mut estimator);
        let active = estimator.active_tracks();
        let problem = estimator.problem(&active);
        assert!(problem.prior.is_some(), "{name}: a prior takes part");
        let estimate = estimator.estimate(&active);
        let equations = problem.linearize(&estimate);
        // A damping of 1e14 leaves the landmarks unchanged.
        let carried = equations.eliminate(1e14);
        let (_, gradient) = equations.reduced(&problem.layout, &carried);
        let still: Vec<Vec<Vector3<f64>>> =
            estimate.landmarks.iter().map(|landmarks| vec![Vector3::zeros(); landmarks.len()]).collect();
        for column in 0..problem.layout.total() {
            let step = 1e-6;
            let mut delta = DVector::zeros(problem.layout.total());
            delta[column] = step;
            let up = problem.costs(&problem.stepped(&estimate, &delta, &still)).total();
            let down = problem.costs(&problem.stepped(&estimate, &-delta, &still)).total();
            let numeric = (up - down) / (2.0 * step);
            // The prior of poe treats rotations as a vector space; between rows of a rolling shutter a change of the
            // pose is interpolated.
            let tolerance = match name {
                "poe" => 2e-2,
                name if name.ends_with("rolling") => 2e-3,
                // Between IMU samples a rotation has a constant rate, a rate does not.
                "interleaved with clocks" => 5e-3,
                _ => 2e-5,
            };
            let scale = gradient.amax().min(1e3 + gradient[column].abs());
            assert!(
                (gradient[column] - numeric).abs() < tolerance * scale,
                "{name}, column {column} of {}: {} against {numeric}",
                problem.layout.total(),
                gradient[column]
            );
        }
    }
}

#[test]
fn projecting_landmarks_out_equals_their_schur_complement() {
    for (name, estimator) in windows() {
        let active = estimator.active_tracks();
        let problem = estimator.problem(&active);
        let estimate = estimator.estimate(&active);
        let rows = problem.visual_rows(&estimate, &problem.linearization_point(&estimate));
        let total = problem.layout.total();
        let jacobian = rows.columns(0, total);
        let equations = problem.linearize(&estimate);
        let reduced = equations.eliminate(0.0);
        let (with, gradient_with) = equations.reduced(&problem.layout, &reduced);
        let without = estimator.problem(&[]);
        let plain = without.linearize(&Estimate { landmarks: Vec::new(), ..estimate.clone() });
        let nothing = plain.eliminate(0.0);
        let (others, gradient_others) = plain.reduced(&problem.layout, &nothing);
        let expected = with - others;
        let found = jacobian.tr_mul(&jacobian);
        let scale = expected.amax();
        for column in 0..total {
            for row in column..total {
                let difference = (expected[(row, column)] - found[(row, column)]).abs();
                assert!(difference < 1e-7 * scale, "{name}: entry {row}, {column} differs by {difference}");
            }
        }
        let gradient = jacobian.tr_mul(&rows.column(total));
        let expected = gradient_with - gradient_others;
        assert!((gradient - &expected).amax() < 1e-7 * expected.amax(), "{name}: gradient");
    }
}

/// The step of the other unknowns is equal whether the oldest frame is in the batch or marginalized before.
#[test]
fn marginalizing_the_oldest_agrees_with_the_full_batch() {
    for (name, estimator) in windows() {
        let active = estimator.active_tracks();
        let problem = estimator.problem(&active);
        let layout = problem.layout;
        let estimate = estimator.estimate(&active);
        let equations = problem.linearize(&estimate);
        let (hessian, gradient) = equations.reduced(&layout, &equations.eliminate(0.0));
        let batch = Cholesky::new(&hessian).unwrap().solve(&-gradient);

        // The oldest frame and all tracks marginalized first, then the other factors with the resulting prior.
        let mut prior = marginalization::oldest(&problem, &estimate).unwrap();
        let rest = fixture::rows(&problem, &estimate, |label| match label {
            FactorLabel::CalibrationPrior => true,
            FactorLabel::Imu(slot) | FactorLabel::GimbalImu(slot) => slot >= 2,
            FactorLabel::Encoder(slot) => slot >= 1,
            FactorLabel::ZeroVelocity | FactorLabel::MarginalizationPrior => false,
        });
        prior.renumber(0);
        let later = crate::estimator::state::layout::Layout { frames: layout.frames - 1, ..layout };
        let kept: Vec<usize> = (layout.frame(1).start..=layout.total()).collect();
        let zero = DVector::zeros(later.total());
        let rows = stack(&[rest.select_columns(&kept), prior.rows(&later, &zero)], 0..=later.total());
        let upper = triangular_factor::triangularize(&rows);
        let count = later.total();
        let solution =
            upper.view((0, 0), (count, count)).solve_upper_triangular(&-upper.view((0, count), (count, 1))).unwrap();
        let difference = solution.column(0) - batch.rows(layout.frame(1).start, count);
        // In their units, joint accelerations are a thousand times less accurate than the angles.
        let tolerance = if layout.joint_motion > 0 { 1e-3 } else { 1e-5 };
        assert!(difference.amax() < tolerance * batch.amax(), "{name}: {}", difference.amax());
    }
}

#[test]
fn dropping_a_frame_from_the_prior_keeps_the_information_on_the_others() {
    let mut estimator = fixture::window(Parameterization::Minimal, true, quadratic());
    fixture::marginalize_once(&mut estimator);
    let problem = estimator.problem(&[]);
    let estimate = estimator.estimate(&[]);
    let (prior, layout) = (problem.prior.unwrap(), problem.layout);
    let gone = 2;
    assert!(prior.holds_frame(gone));
    let zero = DVector::zeros(layout.total());
    let carried = prior.rows(&layout, &zero);
    let readings = fixture::rows(&problem, &estimate, |label| label == FactorLabel::Encoder(gone as u16));
    let rows = stack([&carried, &readings], 0..=layout.total());
    let information = |rows: &DMatrix<f64>, columns: &[usize]| {
        let part = rows.select_columns(columns);
        part.tr_mul(&part)
    };
    let removed: Vec<usize> = layout.camera(gone).collect();
    let kept: Vec<usize> = (0..layout.total())
        .filter(|column| !removed.contains(column))
        .filter(|column| carried.column(*column).amax() > 0.0)
        .collect();
    let cross = rows.select_columns(&kept).tr_mul(&rows.select_columns(&removed));
    let inverse = information(&rows, &removed).try_inverse().unwrap();
    let expected = information(&rows, &kept) - &cross * inverse * cross.transpose();
    let dropped = marginalization::dropped(&problem, &estimate, gone).unwrap();
    assert!(!dropped.holds_frame(gone));
    let found = information(&dropped.rows(&layout, &zero), &kept);
    let difference = (&found - &expected).amax() / expected.amax();
    assert!(difference < 1e-7, "{difference}");
}

/// A dependent column is in the span of the earlier ones: the rows below belong to other columns, and no row has the
/// residual only.
#[test]
fn an_echelon_gives_dependent_columns_no_row() {
    // Columns 1 and 3 are combinations of those before them; the residual has a part outside all of them.
    let free = DMatrix::from_fn(9, 4, |row, column| (((row + 1) * (column + 1)) as f64).sin());
    let (one, three) = (free.column(0) * -2.0, free.column(0) * 0.5 + free.column(1) * 1e3);
    let columns =
        [free.column(0).into(), one, free.column(1).into(), three, free.column(2).into(), free.column(3).into()];
    let matrix = DMatrix::from_columns(&columns);
    let echelon = triangular_factor::echelon(&matrix, 2);
    assert_eq!((echelon.leading_rank, echelon.rows.nrows()), (1, 3));
    let jacobian = echelon.rows.columns(0, 5);
    let expected = matrix.columns(0, 5).tr_mul(&matrix);
    let found = jacobian.tr_mul(&echelon.rows);
    assert!((found - &expected).amax() < 1e-12 * expected.amax());
    assert_eq!(echelon.rows.view((1, 0), (2, 2)).amax(), 0.0);
}

/// A residual that no step can change would add to every later cost and accumulate over a flight.
#[test]
fn a_prior_contains_only_estimated_columns() {
    for (name, mut estimator) in windows() {
        for left in (3..6).rev() {
            fixture::disturb(&mut estimator, 0.2);
            estimator.setup.config.options.window = left - 1;
            estimator.setup.config.options.first_window_factor = 1;
            estimator.window.drop_or_marginalize_frame(&estimator.setup, &mut Vec::new());
            let problem = estimator.problem(&[]);
            let estimate = estimator.estimate(&[]);
            let total = problem.layout.total();
            let rows = problem
                .prior
                .unwrap()
                .rows(&problem.layout, &problem.point(&estimate, &estimate).first_estimate_offset());
            let residual = rows.column(total).into_owned();
            // Normalized columns, since units differ.
            let mut jacobian = rows.columns(0, total).into_owned();
            for mut column in jacobian.column_iter_mut() {
                column /= column.norm().max(f64::MIN_POSITIVE);
            }
            let step = jacobian.clone().svd(true, true).solve(&residual, 1e-9).unwrap();
            let unchanged = &residual - jacobian * step;
            let (floor, cost) = (unchanged.norm_squared(), residual.norm_squared());
            assert!(floor < 1e-6 * cost.max(1.0), "{name}, {left} frames left: {floor} of {cost}");
        }
    }
}

/// Measurements do not change along the six redundant directions of the classical chain.
#[test]
fn the_classical_chain_keeps_its_null_directions_with_first_estimates() {
    let mut estimator = fixture::window(Parameterization::Classical, true, quadratic());
    fixture::marginalize_once(&mut estimator);
    fixture::disturb(&mut estimator, 0.5);
    let active = estimator.active_tracks();
    let problem = estimator.problem(&active);
    let estimate = estimator.estimate(&active);
    let total = problem.layout.total();
    let parts = [
        problem.visual_rows(&estimate, &problem.linearization_point(&estimate)),
        problem.prior.unwrap().rows(&problem.layout, &DVector::zeros(total)),
        fixture::rows(&problem, &estimate, |label| matches!(label, FactorLabel::Imu(_))),
    ];
    let rows = stack(&parts, 0..=total);
    let first = estimate.calibration.at_first_estimate();
    let directions = crate::gimbal::redundant_directions(&first.of(MAIN).chain().to_classical());
    assert_eq!(directions.ncols(), 6);
    let calibration = rows.columns_range(problem.layout.calibration()).into_owned();
    let moved = &calibration * &directions;
    assert!(moved.amax() < 1e-9 * calibration.norm(), "{}", moved.amax() / calibration.norm());
}

#[test]
fn solving_converges_to_the_ground_truth_from_disturbed_values() {
    for (name, mut estimator) in windows() {
        fixture::disturb(&mut estimator, 1.0);
        let active = estimator.active_tracks();
        let problem = estimator.problem(&active);
        let limits = SolverLimits { iterations: 20, relative_cost_tolerance: 1e-9 };
        let solution = solver::solve(&problem, estimator.estimate(&active), limits);
        let tracks = active.iter().flat_map(|active| &active.tracks);
        let residuals = 2 * tracks.map(|track| track.observations.len()).sum::<usize>();
        // The pixel noise of the tracks is 0.3 px (standard deviation).
        let expected = residuals as f64 * (0.3 / estimator.setup.config.options.pixel_sigma_px).powi(2);
        assert!(
            solution.costs_after.of(FactorKind::Visual) < 1.5 * expected,
            "{name}: {:?} of {expected}",
            solution.costs_after
        );
        assert!(solution.costs_after.total() < 0.01 * solution.costs_before.total(), "{name}");
    }
}

/// The covariance excludes the damping, both of a first step and of a final rejected step.
#[test]
fn the_covariance_of_a_solve_is_without_damping() {
    let mut rejected = 0;
    for (name, mut estimator) in windows() {
        for (scale, iterations) in [(0.0, 1), (4.0, 1), (8.0, 2), (16.0, 3), (32.0, 4)] {
            fixture::disturb(&mut estimator, scale);
            let expected = covariances(&estimator.setup, &estimator.window);
            let solution = estimator.window.solve(&estimator.setup, iterations).solution;
            let Some(last) = solution.iterations.last() else { continue };
            rejected += usize::from(!last.accepted);
            // Equations are linearized at the estimate before the step; a rejected step keeps that estimate.
            let expected = match last.accepted {
                true if scale > 0.0 => continue,
                true => expected,
                false => covariances(&estimator.setup, &estimator.window),
            };
            let Some(expected) = expected else { continue };
            let difference = (&solution.calibration_covariance - &expected.calibration).amax();
            assert!(
                difference < 1e-3 * expected.calibration.amax(),
                "{name}, disturbed {scale} times: {difference} of {}",
                expected.calibration.amax()
            );
        }
    }
    assert!(rejected > 5, "{rejected} solves end with a rejected step");
}

#[test]
fn an_inaccurate_chain_gets_a_larger_first_window() {
    let frame_limit = |test: &TestWindow| {
        drop_or_marginalize_frame::first_window_frames(&test.window.calibration, &test.setup.config.options)
    };
    let gimbal = |rotation_sigma_rad: f64, calibrate: bool| {
        fixture::changed_window(true, quadratic(), |config| {
            (config.chain_prior, config.calibrate) = (Some((0.005, rotation_sigma_rad)), calibrate);
        })
    };
    let usual = frame_limit(&gimbal(0.0087, true));
    assert_eq!(2 * frame_limit(&gimbal(0.1, true)), 3 * usual);
    assert_eq!(frame_limit(&gimbal(0.1, false)), usual, "a fixed chain does not move");
    assert_eq!(frame_limit(&fixture::cluster_window(quadratic(), false)), usual, "a rigid camera leads");
}
