//! Basalt: a calibration in the JSON format of cereal.

use serde::Serialize;

use super::text::imu_from_camera;
use crate::camera::{CameraModel, Distortion, Projection};
use crate::geometry::{RigidTransform, ns_from_seconds};
use crate::sensors::{ImuIntrinsics, Rig};

/// The root; cereal calls an object without a name `value0`.
#[derive(Serialize)]
struct Archive<'a> {
    value0: Calibration<'a>,
}

/// Basalt's calibration. Its reader looks up members by name and ignores `comment`.
#[derive(Serialize)]
struct Calibration<'a> {
    comment: &'a [String],
    #[serde(rename = "T_imu_cam")]
    imu_from_cameras: Vec<Pose>,
    intrinsics: Vec<Camera>,
    resolution: Vec<[usize; 2]>,
    vignette: [f64; 0],
    calib_accel_bias: [f64; 9],
    calib_gyro_bias: [f64; 12],
    imu_update_rate: f64,
    accel_noise_std: [f64; 3],
    gyro_noise_std: [f64; 3],
    accel_bias_std: [f64; 3],
    gyro_bias_std: [f64; 3],
    cam_time_offset_ns: i64,
    #[serde(rename = "T_mocap_world")]
    mocap_from_world: Pose,
    #[serde(rename = "T_imu_marker")]
    imu_from_marker: Pose,
    mocap_time_offset_ns: i64,
    mocap_to_imu_offset_ns: i64,
}

#[derive(Serialize)]
struct Pose {
    px: f64,
    py: f64,
    pz: f64,
    qx: f64,
    qy: f64,
    qz: f64,
    qw: f64,
}

#[derive(Serialize)]
struct Camera {
    camera_type: &'static str,
    intrinsics: Intrinsics,
}

#[derive(Serialize)]
struct Intrinsics {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    #[serde(flatten)]
    lens: Lens,
}

#[derive(Serialize)]
#[serde(untagged)]
enum Lens {
    Pinhole {},
    Kb4 { k1: f64, k2: f64, k3: f64, k4: f64 },
    Ucm { alpha: f64 },
    Eucm { alpha: f64, beta: f64 },
    Ds { xi: f64, alpha: f64 },
}

/// File `basalt_calib.json` of a rig, with name and content.
pub(super) fn files(rig: &Rig, head: &[String]) -> Vec<(String, Vec<u8>)> {
    let noise = &rig.imu.noise;
    let (calib_accel_bias, calib_gyro_bias) = imu_parameters(&rig.imu.intrinsics);
    let calibration = Calibration {
        comment: head,
        imu_from_cameras: rig.cameras.iter().map(|camera| pose(&imu_from_camera(camera))).collect(),
        intrinsics: rig.cameras.iter().map(|camera| lens(&camera.model)).collect(),
        resolution: rig.cameras.iter().map(|camera| camera.model.resolution_px).collect(),
        vignette: [],
        calib_accel_bias,
        calib_gyro_bias,
        imu_update_rate: rig.imu.rate_hz,
        accel_noise_std: [noise.accelerometer_noise_density; 3],
        gyro_noise_std: [noise.gyroscope_noise_density; 3],
        accel_bias_std: [noise.accelerometer_random_walk; 3],
        gyro_bias_std: [noise.gyroscope_random_walk; 3],
        // t_imu = t_cam + offset.
        cam_time_offset_ns: ns_from_seconds(rig.cameras[0].timeshift_cam_imu_s),
        mocap_from_world: pose(&RigidTransform::identity()),
        imu_from_marker: pose(&RigidTransform::identity()),
        mocap_time_offset_ns: 0,
        mocap_to_imu_offset_ns: 0,
    };
    let json = serde_json::to_string_pretty(&Archive { value0: calibration }).expect("finite numbers and texts");
    vec![("basalt_calib.json".to_owned(), format!("{json}\n").into_bytes())]
}

fn pose(transform: &RigidTransform) -> Pose {
    let (t, q) = (&transform.translation_m, &transform.rotation);
    Pose { px: t.x, py: t.y, pz: t.z, qx: q.i, qy: q.j, qz: q.k, qw: q.w }
}

fn lens(model: &CameraModel) -> Camera {
    let [fx, fy, cx, cy] = model.intrinsics_px;
    let (camera_type, scale, lens) = match (&model.projection, &model.distortion) {
        // `f / (z + ξ·d) = f / (1 + ξ) / (α·d + (1 − α)·z)` with `α = ξ / (1 + ξ)`.
        (Projection::Omni { xi }, _) => ("ucm", 1.0 + xi, Lens::Ucm { alpha: xi / (1.0 + xi) }),
        (Projection::Eucm { alpha, beta }, _) => ("eucm", 1.0, Lens::Eucm { alpha: *alpha, beta: *beta }),
        (Projection::Ds { xi, alpha }, _) => ("ds", 1.0, Lens::Ds { xi: *xi, alpha: *alpha }),
        (Projection::Pinhole, Distortion::Equidistant([k1, k2, k3, k4])) => {
            ("kb4", 1.0, Lens::Kb4 { k1: *k1, k2: *k2, k3: *k3, k4: *k4 })
        }
        (Projection::Pinhole, _) => ("pinhole", 1.0, Lens::Pinhole {}),
    };
    Camera { camera_type, intrinsics: Intrinsics { fx: fx / scale, fy: fy / scale, cx, cy, lens } }
}

/// `calibrated = raw + S · raw − bias`: zero biases, then the columns of `S = C − I`, for the accelerometer without the
/// elements above the diagonal.
fn imu_parameters(intrinsics: &ImuIntrinsics) -> ([f64; 9], [f64; 12]) {
    let a = intrinsics.accelerometer_correction - nalgebra::Matrix3::identity();
    let g = intrinsics.gyroscope_correction - nalgebra::Matrix3::identity();
    let accelerometer = [0.0, 0.0, 0.0, a[(0, 0)], a[(1, 0)], a[(2, 0)], a[(1, 1)], a[(2, 1)], a[(2, 2)]];
    let mut gyroscope = [0.0; 12];
    gyroscope[3..].copy_from_slice(g.as_slice());
    (accelerometer, gyroscope)
}
