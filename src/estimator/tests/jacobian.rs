//! The Jacobian that is written out from a report, against the linearization of the step.

use super::fixture;
use super::flight::fly;
use crate::camera::CameraModel;
use crate::estimator::{ColumnGroup, EstimatorOptions, JacobianFactor, Linearization, StepJacobian, StepReport};
use crate::gimbal::Parameterization;
use crate::simulation::{SyntheticOptions, synthetic_tracks};

/// Holds a report's Jacobian against its linearization: before the landmarks are projected out by the norms of the
/// calibration's columns, and by what only the inertial factors touch.
pub(super) fn check(report: &StepReport, cameras: &[&CameraModel]) -> StepJacobian {
    let linearization: &Linearization = report.linearization.as_ref().expect("it was asked for");
    let jacobian = report.jacobian(cameras).expect("its source is kept");
    let blocks = jacobian.columns.len() - 1;
    assert_eq!(jacobian.columns[..blocks], linearization.columns);
    assert_eq!(jacobian.columns[blocks].group, ColumnGroup::InverseDepth);

    let count = linearization.calibration_column_norms.len();
    let mut squared = vec![0.0; count];
    for feature in &report.features {
        let rows = report.feature_rows(cameras, feature.id).expect("a feature of the report");
        assert!(
            rows.frame_indices.len() <= feature.observations.len() && rows.rows.nrows() == 2 * rows.frame_indices.len()
        );
        for (column, squared) in squared.iter_mut().enumerate() {
            *squared += rows.rows.column(column).norm_squared();
        }
    }
    for (column, norm) in linearization.calibration_column_norms.iter().enumerate() {
        let written = squared[column].sqrt();
        assert!((written - norm).abs() <= 1e-4 * norm + 1e-6, "column {column}: {written} for {norm}");
    }
    // Speeds and biases are in inertial factors and in standing still alone.
    for (number, block) in
        jacobian.columns.iter().enumerate().filter(|(_, block)| block.group == ColumnGroup::SpeedBias)
    {
        let inertial = jacobian
            .rows
            .iter()
            .filter(|row| matches!(row.factor, JacobianFactor::Inertial { .. } | JacobianFactor::Standstill));
        let norms = inertial.flat_map(|row| &row.norms).filter(|(column, _)| usize::from(*column) == number);
        let written = norms.map(|(_, norm)| f64::from(*norm).powi(2)).sum::<f64>().sqrt();
        let scale = |place: usize| crate::estimator::column_scale(ColumnGroup::SpeedBias, "", place);
        let held = (0..block.len)
            .map(|place| (linearization.jacobian.column(block.start + place) * scale(place)).norm_squared())
            .sum::<f64>()
            .sqrt();
        assert!((written - held).abs() <= 1e-4 * held, "{}: {written} for {held}", block.name);
    }
    jacobian
}

#[test]
fn blocks_are_those_of_the_linearization() {
    for (parameterization, calibrate) in
        [(Parameterization::Classical, true), (Parameterization::Minimal, true), (Parameterization::Minimal, false)]
    {
        let flight =
            synthetic_tracks(&SyntheticOptions { duration_s: 5.0, features: 60, ..SyntheticOptions::default() });
        let options = EstimatorOptions { keep_linearization: true, ..EstimatorOptions::default() };
        let mut config = fixture::config(&flight.given_rig, parameterization, options);
        config.calibrate = calibrate;
        let camera = config.camera.clone();
        let (_, reports) = fly(&flight.frames, config);
        let report = reports.last().unwrap();
        let jacobian = check(report, &[&camera]);
        let of = |wanted: fn(&JacobianFactor) -> bool| jacobian.rows.iter().filter(|row| wanted(&row.factor)).count();
        let frames = report.window.len();
        assert_eq!(of(|factor| matches!(factor, JacobianFactor::Feature(_))), report.features.len());
        assert_eq!(of(|factor| matches!(factor, JacobianFactor::Inertial { .. })), frames - 1);
        assert_eq!(of(|factor| matches!(factor, JacobianFactor::Encoder(_))), frames);
        assert_eq!(of(|factor| *factor == JacobianFactor::CalibrationPrior), usize::from(calibrate));
        assert_eq!(of(|factor| *factor == JacobianFactor::MarginalizationPrior), 1);
        // A feature touches nothing but the calibration, the frames that see it, and its depth.
        for (row, feature) in jacobian.rows.iter().zip(&report.features) {
            assert_eq!(row.factor, JacobianFactor::Feature(feature.id));
            let frames: Vec<String> = feature.observations.iter().map(|seen| seen.frame_index.to_string()).collect();
            for (column, norm) in &row.norms {
                let block = &jacobian.columns[usize::from(*column)];
                assert!(*norm > 0.0 && norm.is_finite());
                let number = block.name.rsplit(' ').next().unwrap().to_owned();
                let framed = matches!(block.group, ColumnGroup::Joints | ColumnGroup::Pose);
                assert!(
                    block.group != ColumnGroup::SpeedBias && (!framed || frames.contains(&number)),
                    "{}",
                    block.name
                );
            }
        }
        // Without the right cameras or the source there is none.
        assert_eq!(report.jacobian(&[]), None);
        assert_eq!(reports[0].jacobian(&[&camera]), None);
        assert_eq!(report.feature_rows(&[&camera], crate::frontend::FeatureId(u64::MAX)), None);
    }
}
