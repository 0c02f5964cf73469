use nalgebra::{DMatrix, Vector3};
use serde_json::Value;

use super::window::{Landmark, Window};
use crate::camera::CameraModel;
use crate::gimbal::tests::golden::{
    GOLDEN_FORMS, array, check_values, classical, golden, matrix, names, numbers, transform,
};
use crate::gimbal::{Chain, ParameterNames, Parameterization};
use crate::observability::{RankReport, analyse};

fn window(golden: &Value) -> Window {
    let focal_px = golden["fx"].as_f64().unwrap();
    assert_eq!(golden["sigma_px"].as_f64(), Some(1.0));
    let landmark = |value: &Value| {
        let bearing = numbers(&value["bearing"]);
        Landmark {
            anchor: value["anchor"].as_u64().unwrap() as usize,
            bearing: Vector3::new(bearing[0], bearing[1], bearing[2]),
            inverse_depth_per_m: value["inverse_depth"].as_f64().unwrap(),
        }
    };
    let observation = |value: &Value| {
        let ids = numbers(value);
        [ids[0] as usize, ids[1] as usize, ids[2] as usize]
    };
    Window {
        camera: CameraModel::pinhole([focal_px, focal_px, 0.0, 0.0], [640, 480]).unwrap(),
        world_from_imu: array(&golden["T_W_I"]).iter().map(transform).collect(),
        joint_angles_rad: array(&golden["theta"]).iter().map(numbers).collect(),
        landmarks: array(&golden["landmarks"]).iter().map(landmark).collect(),
        observations: array(&golden["observations"]).iter().map(observation).collect(),
    }
}

/// Projector onto the structural null space, from the directions of the report.
fn null_projector(report: &RankReport) -> DMatrix<f64> {
    let columns = report.parameters.len();
    let null: Vec<_> = report.directions.iter().filter(|direction| direction.structural).collect();
    let basis = DMatrix::from_fn(columns, null.len(), |row, column| null[column].weights[row]);
    let orthonormal = basis.qr().q();
    &orthonormal * orthonormal.transpose()
}

#[test]
fn golden_windows() {
    let file = golden();
    let mut compared = 0;
    for golden in array(&file["windows"]) {
        let window = window(golden);
        let joints_free = golden["joints"] == "free";
        let joints = golden["N"].as_u64().unwrap() as usize;
        assert!(window.observations.iter().all(|[landmark, anchor, _]| window.landmarks[*landmark].anchor == *anchor));
        let given = classical(&golden["expected"]["classical"]["values"], joints);
        for (name, parameterization) in GOLDEN_FORMS {
            let Some(expected) = golden["expected"].get(name) else { continue };
            let context = format!("{} {name}", golden["id"]);
            let chain = Chain::from_classical(&given, parameterization);
            check_values(&chain, &expected["values"], 1e-12, &context);
            let linearization = window.linearize(&chain, joints_free);
            let report = analyse(&linearization, &chain, &window.joint_angles_rad, joints_free).unwrap();
            let found: Vec<String> =
                report.parameters.iter().map(|parameter| ParameterNames::default().name(*parameter)).collect();
            assert_eq!(found, names(&expected["names"]), "{context}");
            assert_eq!(report.rank_structural as u64, expected["rank"].as_u64().unwrap(), "{context}");
            let deficits = [
                ("G", report.deficit_parameterization),
                ("F", report.deficit_joints),
                ("E", report.deficit_absorbed),
                ("M", report.deficit_motion),
            ];
            for (class, found) in deficits {
                assert_eq!(found as u64, expected["classes"][class].as_u64().unwrap(), "{context} {class}");
            }
            let below = report.parameters.len() - report.rank_informed;
            assert_eq!(below as u64, expected["n_sigma_below_1"].as_u64().unwrap(), "{context}");
            for (found, expected) in
                report.singular_values.iter().zip(numbers(&expected["singular_values_prior_scaled"]))
            {
                assert!((found / expected - 1.0).abs() < 1e-7, "{context}: {found} for {expected}");
            }
            for value in &report.singular_values[report.rank_structural..] {
                assert!(*value < 1e-3 * report.structural_threshold + 1e-13 * report.reference, "{context}: {value}");
            }
            let spectral = expected["ref_norm"].as_f64().unwrap();
            let bound = spectral * (report.parameters.len() as f64).sqrt();
            assert!(report.reference >= spectral * (1.0 - 1e-9) && report.reference <= bound, "{context}");
            let projector = null_projector(&report);
            for (index, expected) in numbers(&expected["null_projector_prior_scaled_diag"]).into_iter().enumerate() {
                assert!(
                    (projector[(index, index)] - expected).abs() < 1e-6,
                    "{context} {:?}",
                    report.parameters[index]
                );
            }
            assert!(matrix(&Value::Null).is_empty());
            // Closed forms and measurement agree: the six directions of the classical parameterization, and offsets
            // absorbed by free joint angles.
            let six = if parameterization == Parameterization::Classical { 6 } else { 0 };
            let absorbed =
                report.parameters.iter().filter(|parameter| joints_free && parameter.is_joint_offset()).count();
            assert!(report.known.len() >= six + absorbed, "{context}: {:?}", report.known);
            for known in &report.known {
                assert!(known.agrees && known.response < 1e-13, "{context}: {known:?}");
            }
            assert!(report.known.len() <= report.parameters.len() - report.rank_structural, "{context}");
            compared += 1;
        }
    }
    assert!(compared >= 50, "only {compared} windows were compared");
}
