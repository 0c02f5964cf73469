use std::collections::BTreeMap;

use nalgebra::{Vector2, Vector3};

use serde::Deserialize;

use super::{CameraError, CameraModel, Distortion, Projection, RationalLens};

const INTRINSICS_PX: [f64; 4] = [352.6, 348.1, 322.4, 238.1];
const RESOLUTION_PX: [usize; 2] = [640, 480];

/// Every combination that Kalibr calibrates, with coefficients of real lenses (`EuRoC`, TUM-VI, BF2M2020S23).
fn cameras() -> Vec<CameraModel> {
    let omni = Projection::Omni { xi: 1.6 };
    let weak_omni = Projection::Omni { xi: 0.7 };
    let radtan = Distortion::Radtan([-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]);
    let pincushion = Distortion::Radtan([0.12, 0.03, -0.002, 0.001]);
    let fisheye = Distortion::Equidistant([0.0034823894, 0.0007150348, -0.0020532361, 0.00020293673]);
    [
        (Projection::Pinhole, Distortion::None),
        (Projection::Pinhole, radtan),
        (Projection::Pinhole, pincushion),
        (
            Projection::Pinhole,
            Distortion::Rational(RationalLens::new([-0.28, 0.07, 2e-4, 2e-5, -0.008, 0.0, 0.0, 0.0])),
        ),
        (Projection::Pinhole, Distortion::Rational(RationalLens::new([8.2, 3.1, -3e-4, 5e-4, 0.12, 8.5, 5.6, 0.61]))),
        (Projection::Pinhole, fisheye),
        (Projection::Pinhole, Distortion::Fov(0.93)),
        (omni, Distortion::None),
        (weak_omni, Distortion::Radtan([-0.05, 0.01, 0.001, -0.0005])),
        (Projection::Eucm { alpha: 0.63, beta: 1.04 }, Distortion::None),
        (Projection::Eucm { alpha: 0.4, beta: 0.9 }, Distortion::None),
        (Projection::Ds { xi: -0.18, alpha: 0.59 }, Distortion::None),
        (Projection::Ds { xi: 0.3, alpha: 0.4 }, Distortion::None),
    ]
    .into_iter()
    .map(|(projection, distortion)| CameraModel::new(projection, distortion, INTRINSICS_PX, RESOLUTION_PX).unwrap())
    .collect()
}

/// Points over the whole field of view, near and far, the optical axis included.
fn points() -> Vec<Vector3<f64>> {
    let mut points = vec![Vector3::new(0.0, 0.0, 2.0), Vector3::new(1e-11, -2e-11, 1.0)];
    for distance in [0.4, 3.0, 60.0] {
        for polar in [1e-4, 0.05, 0.2, 0.4, 0.6, 0.75] {
            for eighth in 0..7 {
                let azimuth = 0.3 + f64::from(eighth) * 0.9;
                points.push(distance * bearing(polar, azimuth));
            }
        }
    }
    points
}

fn bearing(polar: f64, azimuth: f64) -> Vector3<f64> {
    Vector3::new(polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos())
}

#[test]
fn projection_and_back_projection_are_inverse() {
    for camera in cameras() {
        for point in points() {
            let uv = camera.project(&point).unwrap_or_else(|| panic!("{camera:?} does not see {point:?}"));
            let back = camera.unproject(&uv).unwrap_or_else(|| panic!("{camera:?} has no bearing at {uv:?}"));
            assert!((back - point.normalize()).norm() < 1e-11, "{camera:?} {point:?} came back as {back:?}");
            assert!((back.norm() - 1.0).abs() < 1e-14);
        }
        for row in 0..=12 {
            for column in 0..=16 {
                let uv = Vector2::new(f64::from(column) * 40.0 - 0.5, f64::from(row) * 40.0 - 0.5);
                let Some(bearing) = camera.unproject(&uv) else { continue };
                let again = camera.project(&(bearing * 5.0)).unwrap();
                assert!((again - uv).norm() < 1e-8, "{camera:?} {uv:?} came back as {again:?}");
            }
        }
    }
}

#[test]
fn jacobian_meets_central_differences() {
    for camera in cameras() {
        for point in points() {
            let (uv, jacobian) = camera.project_with_jacobian(&point).unwrap();
            assert_eq!(Some(uv), camera.project(&point), "{camera:?}");
            let step = 1e-6 * point.norm();
            for axis in 0..3 {
                let mut shift = Vector3::zeros();
                shift[axis] = step;
                let numeric = (camera.project(&(point + shift)).unwrap() - camera.project(&(point - shift)).unwrap())
                    / (2.0 * step);
                let error = (jacobian.column(axis) - numeric).norm() * point.norm() / 350.0;
                assert!(error < 1e-8, "{camera:?} {point:?} column {axis}: {error}");
            }
        }
    }
}

#[test]
fn intrinsics_jacobian_meets_central_differences() {
    for camera in cameras() {
        let values = camera.intrinsics();
        for point in points() {
            let (uv, by_point, by_intrinsics) = camera.project_with_intrinsics_jacobian(&point).unwrap();
            assert_eq!(Some((uv, by_point)), camera.project_with_jacobian(&point), "{camera:?}");
            for index in 0..6 {
                let step = if index < 4 { 1e-3 } else { 1e-6 };
                let at = |change: f64| {
                    let mut values = values;
                    values[index] += change;
                    camera.with_intrinsics(values).unwrap().project(&point).unwrap()
                };
                let numeric = (at(step) - at(-step)) / (2.0 * step);
                let error = (by_intrinsics.column(index) - numeric).norm();
                let bound = if index < 4 { 1e-9 } else { 1e-6 };
                assert!(error < bound, "{camera:?} {point:?} column {index}: {error}");
            }
        }
    }
}

#[test]
fn intrinsics_are_those_of_the_model() {
    for camera in cameras() {
        assert_eq!(camera.with_intrinsics(camera.intrinsics()).as_ref(), Ok(&camera));
        let expected = match camera.distortion {
            Distortion::None => 4,
            Distortion::Fov(_) => 5,
            Distortion::Radtan(_) | Distortion::Rational(_) | Distortion::Equidistant(_) => 6,
        };
        assert_eq!(camera.intrinsic_count(), expected, "{camera:?}");
        let mut changed = camera.intrinsics();
        for (index, value) in changed.iter_mut().enumerate() {
            *value += if index < 4 { 1.5 } else { 0.01 };
        }
        let again = camera.with_intrinsics(changed).unwrap();
        assert_eq!(again.intrinsics()[..expected], changed[..expected], "{camera:?}");
        let by_intrinsics = camera.project_with_intrinsics_jacobian(&Vector3::new(0.3, -0.2, 1.0)).unwrap().2;
        for index in 4..6 {
            assert_eq!(by_intrinsics.column(index).norm() > 0.0, index < expected, "{camera:?} column {index}");
        }
        assert!(camera.with_intrinsics([0.0, 1.0, 1.0, 1.0, 0.5, 0.0]).is_err());
        assert!(camera.with_intrinsics([1.0, 1.0, f64::NAN, 1.0, 0.5, 0.0]).is_err());
    }
}

/// `tests/data/opencv_lenses.json`.
#[derive(Deserialize)]
struct OpenCvLenses {
    points: Vec<[f64; 3]>,
    lenses: BTreeMap<String, OpenCvLens>,
}

#[derive(Deserialize)]
struct OpenCvLens {
    coeffs: Vec<f64>,
    uv: Vec<[f64; 2]>,
}

#[test]
fn lenses_agree_with_opencv() {
    let golden: OpenCvLenses = serde_json::from_str(include_str!("../../tests/data/opencv_lenses.json")).unwrap();
    assert_eq!(golden.lenses.len(), 4);
    for (name, lens) in &golden.lenses {
        let model = if name == "wide" { "rational_polynomial" } else { name };
        let camera = CameraModel::from_kalibr("pinhole", &INTRINSICS_PX, model, &lens.coeffs, RESOLUTION_PX).unwrap();
        assert_eq!(camera.distortion.name(), model);
        for (point, uv) in golden.points.iter().zip(&lens.uv) {
            let (point, uv) = (Vector3::from(*point), Vector2::from(*uv));
            let projected = camera.project(&point).unwrap();
            assert!((projected - uv).norm() < 1e-9, "{name} {point:?}: {projected:?}, OpenCV {uv:?}");
            let bearing = camera.unproject(&uv).unwrap();
            assert!((bearing - point.normalize()).norm() < 1e-11, "{name} {uv:?} came back as {bearing:?}");
        }
    }
}

#[test]
fn models_with_equal_parameters_project_equally() {
    let pinhole = CameraModel::pinhole(INTRINSICS_PX, RESOLUTION_PX).unwrap();
    let same = [
        (Projection::Omni { xi: 0.0 }, Distortion::None),
        (Projection::Eucm { alpha: 0.0, beta: 1.0 }, Distortion::None),
        (Projection::Ds { xi: 0.0, alpha: 0.0 }, Distortion::None),
        (Projection::Pinhole, Distortion::Radtan([0.0; 4])),
        (Projection::Pinhole, Distortion::Rational(RationalLens::new([0.0; 8]))),
    ];
    for (projection, distortion) in same {
        let camera = CameraModel::new(projection, distortion, INTRINSICS_PX, RESOLUTION_PX).unwrap();
        for point in points() {
            assert!((camera.project(&point).unwrap() - pinhole.project(&point).unwrap()).norm() < 1e-10);
        }
    }
    // An equidistant lens maps the angle to the axis linearly, the definition of its name.
    let fisheye =
        CameraModel::new(Projection::Pinhole, Distortion::Equidistant([0.0; 4]), [100.0, 100.0, 0.0, 0.0], [9, 9])
            .unwrap();
    assert!((fisheye.project(&bearing(0.8, 0.0)).unwrap().x - 80.0).abs() < 1e-10);
    // The unified model written with its own blend: omni with xi is eucm with alpha = xi / (1 + xi), beta = 1.
    let xi = 0.8;
    let omni = CameraModel::new(Projection::Omni { xi }, Distortion::None, [180.0, 180.0, 0.0, 0.0], [9, 9]).unwrap();
    let projection = Projection::Eucm { alpha: xi / (1.0 + xi), beta: 1.0 };
    let eucm = CameraModel::new(projection, Distortion::None, [100.0, 100.0, 0.0, 0.0], [9, 9]).unwrap();
    for point in points() {
        assert!((omni.project(&point).unwrap() - eucm.project(&point).unwrap()).norm() < 1e-10);
    }
}

#[test]
fn invisible_points_do_not_project() {
    let nothing = [Vector3::new(0.0, 0.0, -1.0), Vector3::zeros(), Vector3::new(f64::NAN, 0.0, 1.0)];
    for camera in cameras() {
        for point in &nothing {
            assert_eq!(camera.project(point), None, "{camera:?} {point:?}");
            assert!(camera.project_with_jacobian(point).is_none(), "{camera:?} {point:?}");
        }
        assert_eq!(camera.unproject(&Vector2::new(f64::NAN, 1.0)), None, "{camera:?}");
    }
    // A barrel polynomial folds: a direction beyond its turning point must not project into the image again.
    let barrel = Distortion::Radtan([-0.3, 0.02, 1e-4, -2e-4]);
    let barrel = CameraModel::new(Projection::Pinhole, barrel, INTRINSICS_PX, RESOLUTION_PX).unwrap();
    assert!(barrel.project(&bearing(0.8, 0.2)).is_some());
    assert_eq!(barrel.project(&bearing(1.35, 0.2)), None);
    assert_eq!(barrel.unproject(&Vector2::new(2000.0, 300.0)), None);
    // The equidistant model ends at a right angle; the wide-angle models continue behind it.
    assert_eq!(cameras()[5].unproject(&Vector2::new(322.4 + 352.6 * 1.7, 238.1)), None);
    let behind = bearing(1.7, 0.4);
    let wide = &cameras()[11];
    let uv = wide.project(&behind).unwrap();
    assert!((wide.unproject(&uv).unwrap() - behind).norm() < 1e-11);
    assert_eq!(wide.unproject(&Vector2::new(5000.0, 0.0)), None);
}

#[test]
fn kalibr_parameters_convert_both_ways() {
    for camera in cameras() {
        let again = CameraModel::from_kalibr(
            camera.projection.name(),
            &camera.kalibr_intrinsics(),
            camera.distortion.name(),
            &camera.kalibr_distortion_coeffs(),
            camera.resolution_px,
        );
        assert_eq!(again, Ok(camera));
    }
    let zeros = CameraModel::from_kalibr("pinhole", &INTRINSICS_PX, "none", &[0.0; 4], RESOLUTION_PX);
    assert_eq!(zeros.unwrap().distortion, Distortion::None);
}

#[test]
fn invalid_descriptions_name_the_faulty_field() {
    let check = |model: &str, intrinsics: &[f64], distortion: &str, coefficients: &[f64], resolution, message: &str| {
        let error: CameraError =
            CameraModel::from_kalibr(model, intrinsics, distortion, coefficients, resolution).unwrap_err();
        assert_eq!(error.to_string(), message);
    };
    let good = INTRINSICS_PX;
    check(
        "fish",
        &good,
        "none",
        &[],
        RESOLUTION_PX,
        "unknown camera_model 'fish': expected one of pinhole, omni, eucm, ds",
    );
    check(
        "ds",
        &good,
        "none",
        &[],
        RESOLUTION_PX,
        "intrinsics of 'ds' holds 4 numbers, expected 6: xi, alpha, fx, fy, cx, cy",
    );
    check(
        "pinhole",
        &good,
        "radtan",
        &[0.1],
        RESOLUTION_PX,
        "distortion_coeffs of 'radtan' holds 1 numbers, expected 4: k1, k2, p1, p2",
    );
    check(
        "pinhole",
        &[-1.0, 1.0, 1.0, 1.0],
        "none",
        &[],
        RESOLUTION_PX,
        "focal length fx is -1, expected a positive number of pixels",
    );
    check("pinhole", &good, "none", &[], [0, 480], "image width is 0, expected at least one pixel");
    check(
        "pinhole",
        &good,
        "fov",
        &[4.0],
        RESOLUTION_PX,
        "distortion_coeffs of 'fov' is 4, expected 0 to π, both excluded",
    );
    check(
        "ds",
        &[0.1, 0.5, 1.0, 1.0, 1.0, 1.0],
        "equi",
        &[0.0; 4],
        RESOLUTION_PX,
        "camera_model 'ds' does not support distortion_model 'equidistant': expected none",
    );
    check(
        "eucm",
        &[1.5, 1.0, 1.0, 1.0, 1.0, 1.0],
        "none",
        &[],
        RESOLUTION_PX,
        "alpha of 'eucm' is 1.5, expected 0 to 1",
    );
}
