//! Jacobian reproduced from a report, against the linearization of the step.

use super::fixture;
use super::flight::run_flight;
use crate::camera::CameraModel;
use crate::estimator::StepJacobian;
use crate::estimator::config::EstimatorOptions;
use crate::estimator::factors::FactorKind;
use crate::estimator::problem::linearization::Linearization;
use crate::estimator::report::{FactorRows, JacobianFactor, StepReport};
use crate::estimator::state::columns::{ColumnBlock, ColumnGroup, ColumnId, FrameId};
use crate::geometry::Dimension;
use crate::gimbal::{ParameterGroup, Parameterization};
use crate::simulation::{SyntheticOptions, synthetic_tracks};

/// Compares a report's Jacobian with its linearization: by the norms of the calibration columns before the
/// projection of the landmarks, and by the columns of the IMU factors alone.
pub(super) fn check(report: &StepReport, cameras: &[&CameraModel]) -> StepJacobian {
    let linearization: &Linearization = report.linearization.as_ref().expect("it was asked for");
    let jacobian = report.jacobian(cameras).expect("its source is kept");
    let blocks = jacobian.columns.len() - 1;
    assert_eq!(jacobian.columns[..blocks], linearization.columns);
    assert_eq!(jacobian.columns[blocks].id, ColumnId::InverseDepth);

    let count = linearization.calibration_column_norms.len();
    let mut squared = vec![0.0; count];
    for feature in &report.features {
        let rows = report.feature_rows(cameras, feature.id).expect("a feature of the report");
        assert!(rows.frames.len() <= feature.observations.len() && rows.rows.nrows() == 2 * rows.frames.len());
        for (column, squared) in squared.iter_mut().enumerate() {
            *squared += rows.rows.column(column).norm_squared();
        }
    }
    for (column, norm) in linearization.calibration_column_norms.iter().enumerate() {
        let written = squared[column].sqrt();
        assert!((written - norm).abs() <= 1e-4 * norm + 1e-6, "column {column}: {written} for {norm}");
    }
    // Only IMU factors and zero-velocity updates depend on velocities and biases.
    for (number, block) in
        jacobian.columns.iter().enumerate().filter(|(_, block)| block.id.group() == ColumnGroup::VelocityBias)
    {
        let imu_rows = jacobian
            .rows
            .iter()
            .filter(|row| matches!(row.factor, JacobianFactor::Imu { .. } | JacobianFactor::ZeroVelocity));
        let norms = imu_rows.flat_map(|row| &row.norms).filter(|(column, _)| usize::from(*column) == number);
        let written = norms.map(|(_, norm)| f64::from(*norm).powi(2)).sum::<f64>().sqrt();
        let expected = (0..block.len)
            .map(|place| (linearization.jacobian.column(block.start + place) * block.id.scale(place)).norm_squared())
            .sum::<f64>()
            .sqrt();
        assert!((written - expected).abs() <= 1e-4 * expected, "{block:?}: {written} for {expected}");
    }
    jacobian
}

/// Compares the rows of the other factors with the norms of their blocks and the χ² of their kind.
fn check_factor_rows(report: &StepReport, jacobian: &StepJacobian) {
    let all = report.factor_rows.as_ref().expect("they were asked for");
    for FactorRows { factor, rows } in all {
        let row = jacobian.rows.iter().find(|row| row.factor == *factor).expect("its norms are kept");
        assert_eq!(row.height, rows.nrows());
        let blocks = &jacobian.columns[..jacobian.columns.len() - 1];
        assert_eq!(rows.ncols(), blocks.iter().map(|block| block.len).sum::<usize>() + 1);
        for (number, block) in blocks.iter().enumerate() {
            let column = |place: usize| rows.column(block.start + place) * block.id.scale(place);
            let squared: f64 = (0..block.len).map(|place| column(place).norm_squared()).sum();
            let kept = row.norms.iter().find(|(known, _)| usize::from(*known) == number);
            let kept = kept.map_or(0.0, |(_, norm)| f64::from(*norm));
            assert!((squared.sqrt() - kept).abs() <= 1e-5 * kept, "{factor:?}, {block:?}: {kept}");
        }
    }
    let chi2 = |wanted: fn(&JacobianFactor) -> bool| -> f64 {
        let of = all.iter().filter(|rows| wanted(&rows.factor));
        of.map(|rows| rows.rows.column(rows.rows.ncols() - 1).norm_squared()).sum()
    };
    for (kind, measured) in [
        (FactorKind::Imu, chi2(|factor| matches!(factor, JacobianFactor::Imu { .. }))),
        (FactorKind::CalibrationPrior, chi2(|factor| *factor == JacobianFactor::CalibrationPrior)),
        (FactorKind::MarginalizationPrior, chi2(|factor| *factor == JacobianFactor::MarginalizationPrior)),
    ] {
        let reported = report.residuals.iter().find(|summary| summary.factor == kind).expect("every kind is told");
        assert!(
            (reported.chi2_after - measured).abs() < 1e-9 + 1e-6 * measured,
            "{kind:?}: {measured} for {reported:?}"
        );
    }
}

#[test]
fn blocks_are_those_of_the_linearization() {
    for (parameterization, calibrate, clocks) in [
        (Parameterization::Classical, true, false),
        (Parameterization::Minimal, true, false),
        (Parameterization::Minimal, false, false),
        (Parameterization::Minimal, true, true),
    ] {
        let flight =
            synthetic_tracks(&SyntheticOptions { duration_s: 5.0, features: 60, ..SyntheticOptions::default() });
        let options =
            EstimatorOptions { keep_linearization: true, keep_factor_rows: true, ..EstimatorOptions::default() };
        let mut config = fixture::config(&flight.given_rig, parameterization, options);
        (config.calibrate, config.estimate_timeshift) = (calibrate, clocks);
        let camera = config.camera.clone();
        let (_, reports) = run_flight(&flight.frames, config);
        let report = reports.last().unwrap();
        let jacobian = check(report, &[&camera]);
        let of = |wanted: fn(&JacobianFactor) -> bool| jacobian.rows.iter().filter(|row| wanted(&row.factor)).count();
        let frames = report.window.len();
        let timed = jacobian
            .columns
            .iter()
            .filter(|block| block.id.parameter().is_some_and(|it| it.dimension() == Dimension::Time))
            .count();
        assert_eq!(timed, if clocks { 2 } else { 0 });
        check_factor_rows(report, &jacobian);
        assert_eq!(of(|factor| matches!(factor, JacobianFactor::Feature(_))), report.features.len());
        assert_eq!(of(|factor| matches!(factor, JacobianFactor::Imu { .. })), frames - 1);
        assert_eq!(of(|factor| matches!(factor, JacobianFactor::Encoder(_))), frames);
        assert_eq!(of(|factor| *factor == JacobianFactor::CalibrationPrior), usize::from(calibrate));
        assert_eq!(of(|factor| *factor == JacobianFactor::MarginalizationPrior), 1);
        // Rows of a feature depend only on the calibration, the observing frames, and the feature's depth.
        for (row, feature) in jacobian.rows.iter().zip(&report.features) {
            assert_eq!(row.factor, JacobianFactor::Feature(feature.id));
            let sees = |frame: FrameId| feature.observations.iter().any(|seen| seen.frame_index == frame.0);
            for (column, norm) in &row.norms {
                let block = &jacobian.columns[usize::from(*column)];
                assert!(*norm > 0.0 && norm.is_finite());
                let touched = match block.id {
                    ColumnId::Calibration(_) | ColumnId::InverseDepth => true,
                    ColumnId::Joints(frame) | ColumnId::Pose(frame) => sees(frame),
                    ColumnId::VelocityBias(_) | ColumnId::GimbalImu(_) => false,
                };
                assert!(touched, "{block:?}");
            }
        }
        // `None` without the right cameras or without the source.
        assert_eq!(report.jacobian(&[]), None);
        assert_eq!(reports[0].jacobian(&[&camera]), None);
        assert_eq!(report.feature_rows(&[&camera], crate::frontend::FeatureId(u64::MAX)), None);
    }
}

#[test]
fn intrinsics_of_the_imu_alone_have_blocks_in_its_factors() {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 5.0, features: 60, ..SyntheticOptions::default() });
    let options = EstimatorOptions { keep_linearization: true, ..EstimatorOptions::default() };
    let mut config = fixture::config(&flight.given_rig, Parameterization::Minimal, options);
    config.estimate_imu_intrinsics = true;
    let camera = config.camera.clone();
    let (_, reports) = run_flight(&flight.frames, config);
    let jacobian = reports.last().unwrap().jacobian(&[&camera]).expect("its source is kept");
    let of_imu =
        |block: &&ColumnBlock| block.id.parameter().is_some_and(|parameter| parameter.group() == ParameterGroup::Imu);
    assert_eq!(jacobian.columns.iter().filter(of_imu).count(), 15);
    for (number, block) in jacobian.columns.iter().enumerate().filter(|(_, block)| of_imu(block)) {
        let imu_rows = jacobian.rows.iter().filter(|row| matches!(row.factor, JacobianFactor::Imu { .. }));
        let norms =
            imu_rows.flat_map(|row| &row.norms).filter(|(column, norm)| usize::from(*column) == number && *norm > 0.0);
        assert!(norms.count() > 0, "{block:?}");
    }
}
