//! A rig's values of estimated parameters, and a run's values in a rig.

use super::memory::estimated;
use crate::faults::LensChange;
use crate::gimbal::{ParameterGroup, ParameterId, Quantity};
use crate::observability::Determination;
use crate::session::FlightVerdicts;
use crate::session::tests::parameter;
use crate::simulation::{SyntheticOptions, synthetic_tracks};
use crate::text::Named as _;

#[test]
fn every_estimated_parameter_has_a_value_in_a_rig_and_leads_back_to_it() {
    let intrinsics_error = LensChange { focal: 1.01, ..LensChange::NONE };
    let flight = synthetic_tracks(&SyntheticOptions {
        duration_s: 5.0,
        features: 60,
        readout_s: 0.02,
        intrinsics_error,
        imu_intrinsics_error: [0.01, 0.01],
        ..SyntheticOptions::default()
    });
    let run = estimated(&flight, "auto:readout=on,intrinsics=on,imu-intrinsics=on");
    let estimate = &run.steps.last().unwrap().report.calibration;
    let count = |group| estimate.parameters.iter().filter(|id| id.group() == group).count();
    let groups: Vec<usize> = ParameterGroup::all().map(count).collect();
    assert_eq!(groups[2..], [15, 1], "{groups:?}");
    assert!(groups[0] == 18 && groups[1] >= 4, "{groups:?}");

    let truth = run.values_in(&flight.true_rig, &flight.given_rig, estimate).unwrap();
    let of = |values: &[(ParameterId, f64)], wanted: ParameterId| {
        values.iter().find(|(id, _)| *id == wanted).map(|(_, value)| *value)
    };
    assert!(estimate.parameters.iter().all(|id| of(&truth, *id).is_some()), "{truth:?}");
    let camera = &flight.true_rig.cameras[0];
    assert_eq!(of(&truth, parameter("readout")), Some(0.02));
    assert_eq!(of(&truth, parameter("fx")), Some(camera.model.intrinsics_px[0]));
    let imu = flight.true_rig.imu.intrinsics.parameters();
    assert_eq!(of(&truth, parameter("gyroscope.ry")), Some(imu.gyroscope_rotation_rad.y));
    assert_eq!(of(&truth, parameter("accelerometer.mxz")), Some(imu.accelerometer.misalignment.y));
    assert!(imu.accelerometer.misalignment.y != 0.0);

    let calibrated = run.calibrated_rig(&flight.given_rig);
    let written = run.values_in(&calibrated, &calibrated, estimate).unwrap();
    for (id, value) in estimate.parameters.iter().zip(&estimate.values) {
        let (found, expected) = (of(&written, *id).unwrap(), id.principal_value(*value));
        assert!((found - expected).abs() < 1e-9 * id.scale(), "{id:?}: {found} and {expected}");
    }
    assert!(calibrated.cameras[0].value(Quantity::Readout) != Some(0.0) && !calibrated.imu.intrinsics.is_identity());

    let rows = FlightVerdicts::of_run(&run, &flight.given_rig.required_accuracy)
        .table(&flight.given_rig.parameter_names(), None);
    assert_eq!(rows.len(), estimate.parameters.len());
    assert!(rows.is_sorted_by_key(|row| row.parameter.group()));
    let readout = rows.iter().find(|row| row.parameter == parameter("readout")).unwrap();
    assert!(readout.sigma.unwrap() < 0.002 && readout.verdict != Determination::Initializing, "{readout:?}");
}

#[test]
fn pose_and_clock_of_the_second_imu_lead_back_to_the_rig() {
    let flight = synthetic_tracks(&SyntheticOptions {
        duration_s: 5.0,
        features: 60,
        gimbal_imu: true,
        ..SyntheticOptions::default()
    });
    let run = estimated(&flight, "auto:gimbal-imu-axes=on");
    let estimate = &run.steps.last().unwrap().report.calibration;
    let calibrated = run.calibrated_rig(&flight.given_rig);
    assert_eq!(calibrated.imu, flight.given_rig.imu, "no intrinsics were estimated");
    assert_ne!(calibrated.gimbal_imu, flight.given_rig.gimbal_imu);
    let written = run.values_in(&calibrated, &flight.given_rig, estimate).unwrap();
    for name in ["imu1.rx", "imu1.ry", "imu1.rz", "imu1.tx", "imu1.ty", "imu1.tz", "imu1.timeshift"] {
        let id = parameter(name);
        let column = estimate.parameters.iter().position(|known| *known == id).unwrap();
        let found = written.iter().find(|(known, _)| *known == id).unwrap().1;
        assert!((found - estimate.values[column]).abs() < 1e-9, "{name}: {found} and {}", estimate.values[column]);
    }
}
