//! Chains against independently computed poses, Jacobians and ranks.

use std::path::Path;

use nalgebra::{DMatrix, Matrix2x3, Matrix4, Matrix6xX, SMatrix, Vector2, Vector3};
use serde_json::Value;

use crate::camera::CameraModel;
use crate::geometry::{Dimension, RigidTransform, so3};
use crate::gimbal::{
    Chain, ClassicalChain, DhLink, ParameterNames, Parameterization, generic_joint_angles, redundant_directions,
    stacked_jacobian,
};

/// `tests/data/golden.json`, described in `tests/data/README.md`.
pub(crate) fn golden() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/golden.json");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{error} ({})", path.display()));
    serde_json::from_str(&text).unwrap()
}

pub(crate) const GOLDEN_FORMS: [(&str, Parameterization); 6] = [
    ("classical", Parameterization::Classical),
    ("minimal_eq19_xy", Parameterization::Minimal),
    ("minimal_eq19_yx", Parameterization::MinimalYx),
    ("minimal_swapB_xy", Parameterization::MinimalSwapped),
    ("minimal_swapB_yx", Parameterization::MinimalSwappedYx),
    ("poe", Parameterization::Poe),
];

pub(crate) fn array(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

pub(crate) fn numbers(value: &Value) -> Vec<f64> {
    array(value).iter().map(|entry| entry.as_f64().unwrap()).collect()
}

pub(crate) fn matrix(value: &Value) -> DMatrix<f64> {
    let rows: Vec<_> = array(value).iter().map(numbers).collect();
    DMatrix::from_fn(rows.len(), rows.first().map_or(0, Vec::len), |row, column| rows[row][column])
}

pub(crate) fn transform(value: &Value) -> RigidTransform {
    RigidTransform::from_matrix(&Matrix4::from_iterator(matrix(value).iter().copied()), 1e-9).unwrap()
}

pub(crate) fn names(value: &Value) -> Vec<String> {
    array(value).iter().map(|name| name.as_str().unwrap().to_owned()).collect()
}

/// Classical chain of a golden `values` object.
pub(crate) fn classical(values: &Value, joints: usize) -> ClassicalChain {
    let links = (1..=joints).map(|index| {
        let number = |name: &str| values[format!("L{index}.{name}")].as_f64().unwrap();
        DhLink { theta_offset_rad: number("theta"), d_m: number("d"), a_m: number("a"), alpha_rad: number("alpha") }
    });
    ClassicalChain {
        imu_from_base: transform(&values["T_IB"]),
        links: links.collect(),
        effector_from_camera: transform(&values["T_EC"]),
    }
}

/// Column names, with links by number.
fn names_of(chain: &Chain) -> Vec<String> {
    chain.parameters().into_iter().map(|parameter| ParameterNames::default().name(parameter)).collect()
}

/// Compares the values of a chain with the values in the file: by name, rigid transforms as matrices.
pub(crate) fn check_values(chain: &Chain, values: &Value, tolerance: f64, context: &str) {
    let found = chain.values();
    let parameters = chain.parameters();
    let names = names_of(chain);
    for (name, expected) in values.as_object().unwrap() {
        if let Some(expected) = expected.as_f64() {
            let index = names.iter().position(|other| other == name).unwrap();
            let revolutions = (found[index] - expected) / std::f64::consts::TAU;
            let angle = parameters[index].dimension() == Dimension::Angle;
            let error = if angle {
                (revolutions - revolutions.round()) * std::f64::consts::TAU
            } else {
                found[index] - expected
            };
            assert!(error.abs() < tolerance, "{context} {name}: {} for {expected}", found[index]);
        } else if let Some(first) = names.iter().position(|other| *other == format!("{}.rx", &name[2..])) {
            let rotation_vector = Vector3::new(found[first], found[first + 1], found[first + 2]);
            let shift = Vector3::new(found[first + 3], found[first + 4], found[first + 5]);
            let error = (RigidTransform::new(so3::exp(&rotation_vector), shift).to_matrix()
                - transform(expected).to_matrix())
            .amax();
            assert!(error < tolerance, "{context} {name}: {error}");
        }
    }
}

fn amax_difference(found: &Matrix6xX<f64>, expected: &DMatrix<f64>) -> f64 {
    // A matrix without columns is stored without a shape.
    if found.ncols() == 0 { 0.0 } else { (found - expected).amax() }
}

#[test]
fn golden_chains() {
    let file = golden();
    let mut compared = 0;
    for golden in array(&file["chains"]) {
        let id = golden["id"].as_str().unwrap();
        let joints = golden["N"].as_u64().unwrap() as usize;
        let forms = &golden["parameterizations"];
        let given = classical(&forms["classical"]["values"], joints);
        let encoder: Vec<_> = array(&golden["theta_encoder"]).iter().map(numbers).collect();
        for (name, parameterization) in GOLDEN_FORMS {
            let Some(form) = forms.get(name) else { continue };
            let context = format!("{id} {name}");
            let chain = Chain::from_classical(&given, parameterization);
            assert_eq!(names_of(&chain), names(&form["names"]), "{context}");
            let units: Vec<_> = chain.parameters().into_iter().map(|parameter| parameter.dimension().unit()).collect();
            assert_eq!(units, names(&form["units"]), "{context}");
            let canonical = chain.canonical();
            let singular = chain.margins().iter().any(|(_, margin)| *margin < 1e-9);
            check_values(&canonical, &form["values"], 1e-11, &context);
            for (angles, pose) in encoder.iter().zip(array(&golden["T_I_C"])) {
                for chain in [&chain, &canonical] {
                    let error = (chain.imu_from_camera(angles).to_matrix() - transform(pose).to_matrix()).amax();
                    assert!(error < 1e-12, "{context}: {error}");
                }
            }
            for expected in array(&form["jacobians"]) {
                let found = canonical.linearize(&numbers(&expected["theta"]));
                let error = amax_difference(&found.by_parameters, &matrix(&expected["J"]));
                assert!(error < 1e-11, "{context} (singular: {singular}): {error}");
                assert!(amax_difference(&found.by_joints, &matrix(&expected["J_theta"])) < 1e-11, "{context}");
                compared += 1;
            }
            let singular_values = stacked_jacobian(&chain, &generic_joint_angles(joints, 40)).singular_values();
            let rank = singular_values.iter().filter(|value| **value > 1e-10 * singular_values.max()).count();
            assert_eq!(rank as u64, form["kinematic_rank"].as_u64().unwrap(), "{context}");
            let minimal = !matches!(parameterization, Parameterization::Classical | Parameterization::Poe);
            if joints > 0 && minimal {
                let margins = chain.margins();
                assert!((margins[0].1 - form["margin_base"].as_f64().unwrap()).abs() < 1e-12, "{context}");
                assert!((margins[1].1 - form["margin_end"].as_f64().unwrap()).abs() < 1e-12, "{context}");
            }
        }
        let expected = matrix(&forms["classical"]["gauge_null"]);
        let found = redundant_directions(&given);
        if joints > 0 {
            assert!((&found - &expected).amax() < 1e-14, "{id}");
        } else {
            // The same subspace, for any basis.
            let both =
                DMatrix::from_fn(
                    12,
                    12,
                    |row, column| {
                        if column < 6 { found[(row, column)] } else { expected[(row, column - 6)] }
                    },
                );
            assert_eq!(both.rank(1e-10), 6, "{id}");
        }
    }
    assert!(compared >= 100, "only {compared} Jacobians were compared");
}

/// Derivatives of one reprojection (Eqs. 9–17) through chain, perturbation rule and camera.
#[test]
fn golden_visual_residuals() {
    let file = golden();
    let camera = CameraModel::pinhole([460.0, 460.0, 0.0, 0.0], [640, 480]).unwrap();
    let mut compared = 0;
    for golden in array(&file["chains"]) {
        let visual = &golden["visual"];
        if visual.is_null() {
            continue;
        }
        let joints = golden["N"].as_u64().unwrap() as usize;
        let given = classical(&golden["parameterizations"]["classical"]["values"], joints);
        for (name, parameterization) in
            [("classical", Parameterization::Classical), ("minimal_eq19_xy", Parameterization::Minimal)]
        {
            let chain = Chain::from_classical(&given, parameterization).canonical();
            let found = Reprojection::of(&chain, visual, &camera);
            let context = golden["id"].as_str().unwrap();
            let check = |found: DMatrix<f64>, key: &str| {
                let error = (found - matrix(&visual["d_zhat"][key])).amax();
                assert!(error < 1e-8, "{context} {key}: {error}");
            };
            let expected = numbers(&visual["z_hat"]);
            assert!((found.uv_px - Vector2::new(expected[0], expected[1])).amax() < 1e-9, "{context}");
            check(found.by_parameters, &format!("calib_{name}"));
            check(found.by_joints_i, "theta_i");
            check(found.by_joints_j, "theta_j");
            check(found.by_inverse_depth, "inverse_depth");
            check(found.by_pose_i, "pose_i");
            check(found.by_pose_j, "pose_j");
            compared += 1;
        }
    }
    assert!(compared >= 18, "only {compared} reprojections were compared");
}

/// Predicted pixel with its derivatives.
pub(crate) struct Reprojection {
    pub(crate) uv_px: Vector2<f64>,
    pub(crate) by_parameters: DMatrix<f64>,
    pub(crate) by_joints_i: DMatrix<f64>,
    pub(crate) by_joints_j: DMatrix<f64>,
    pub(crate) by_inverse_depth: DMatrix<f64>,
    pub(crate) by_pose_i: DMatrix<f64>,
    pub(crate) by_pose_j: DMatrix<f64>,
}

impl Reprojection {
    fn of(chain: &Chain, visual: &Value, camera: &CameraModel) -> Self {
        let bearing = numbers(&visual["bearing_i"]);
        Self::new(
            chain,
            camera,
            (&transform(&visual["T_W_Ii"]), &numbers(&visual["theta_i"])),
            (&transform(&visual["T_W_Ij"]), &numbers(&visual["theta_j"])),
            &Vector3::new(bearing[0], bearing[1], bearing[2]),
            visual["inverse_depth"].as_f64().unwrap(),
        )
    }

    /// Predicts the feature that is anchored in frame i with `(x/z, y/z, 1)` and its inverse depth, observed in frame
    /// j; each frame is given by its `world_from_imu` and its joint angles.
    pub(crate) fn new(
        chain: &Chain,
        camera: &CameraModel,
        frame_i: (&RigidTransform, &[f64]),
        frame_j: (&RigidTransform, &[f64]),
        bearing: &Vector3<f64>,
        inverse_depth: f64,
    ) -> Self {
        let (chain_i, chain_j) = (chain.linearize(frame_i.1), chain.linearize(frame_j.1));
        let world_from_camera_i = *frame_i.0 * chain_i.imu_from_camera;
        let world_from_camera_j = *frame_j.0 * chain_j.imu_from_camera;
        let point_in_i = bearing / inverse_depth;
        let point_in_world = world_from_camera_i.transform(&point_in_i);
        let point_in_j = world_from_camera_j.inverse().transform(&point_in_world);
        let (uv_px, by_point) = camera.project_with_jacobian(&point_in_j).unwrap();
        let world_to_j = world_from_camera_j.rotation_matrix().transpose();
        let by_world: Matrix2x3<f64> = by_point * world_to_j;
        // Derivative of the point with respect to [φ; δt] of a camera pose, in world (i) or in camera j.
        let by_camera_i =
            block(&(by_world * world_from_camera_i.rotation_matrix() * -so3::hat(&point_in_i)), &by_world);
        let by_camera_j = block(&(by_point * so3::hat(&point_in_j)), &-by_world);
        let imu_i = imu_to_world_camera(frame_i.0, &chain_i.imu_from_camera);
        let imu_j = imu_to_world_camera(frame_j.0, &chain_j.imu_from_camera);
        let chain_block = |world_from_imu: &RigidTransform| {
            let mut lift = DMatrix::identity(6, 6);
            lift.view_mut((3, 3), (3, 3)).copy_from(&world_from_imu.rotation_matrix());
            lift
        };
        let (lift_i, lift_j) = (chain_block(frame_i.0), chain_block(frame_j.0));
        let by_inverse_depth = by_world * world_from_camera_i.rotation_matrix() * (-bearing / inverse_depth.powi(2));
        Self {
            uv_px,
            by_parameters: &by_camera_i * &lift_i * &chain_i.by_parameters
                + &by_camera_j * &lift_j * &chain_j.by_parameters,
            by_joints_i: &by_camera_i * lift_i * &chain_i.by_joints,
            by_joints_j: &by_camera_j * lift_j * &chain_j.by_joints,
            by_inverse_depth: DMatrix::from_column_slice(2, 1, by_inverse_depth.as_slice()),
            by_pose_i: &by_camera_i * imu_i,
            by_pose_j: &by_camera_j * imu_j,
        }
    }
}

fn block(by_rotation: &Matrix2x3<f64>, by_translation: &Matrix2x3<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(
        2,
        6,
        |row, column| {
            if column < 3 { by_rotation[(row, column)] } else { by_translation[(row, column - 3)] }
        },
    )
}

/// Derivative of `[φ; δt]` of `world_from_imu · imu_from_camera` by `[φ; δt]` of `world_from_imu` (the paper's Eq. 13
/// in the right convention).
fn imu_to_world_camera(world_from_imu: &RigidTransform, imu_from_camera: &RigidTransform) -> DMatrix<f64> {
    let mut jacobian = SMatrix::<f64, 6, 6>::identity();
    let arm = world_from_imu.rotation_matrix() * so3::hat(&imu_from_camera.translation_m);
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&imu_from_camera.rotation_matrix().transpose());
    jacobian.fixed_view_mut::<3, 3>(3, 0).copy_from(&-arm);
    DMatrix::from_column_slice(6, 6, jacobian.as_slice())
}
