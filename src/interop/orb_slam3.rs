//! ORB-SLAM3: settings of a monocular-inertial system, file version 1.0.

use std::fmt::Write as _;

use super::text::{self, imu_from_camera};
use crate::camera::Distortion;
use crate::files::yaml::number;
use crate::sensors::Rig;

/// File `orb_slam3.yaml` of a rig, with name and content.
pub(super) fn files(rig: &Rig, head: &[String]) -> Vec<(String, Vec<u8>)> {
    let camera = &rig.cameras[0];
    let [fx, fy, cx, cy] = camera.model.intrinsics_px;
    let [width, height] = camera.model.resolution_px;
    let (kind, lens) = match &camera.model.distortion {
        Distortion::Equidistant([k1, k2, k3, k4]) => {
            ("KannalaBrandt8", vec![("k1", *k1), ("k2", *k2), ("k3", *k3), ("k4", *k4)])
        }
        Distortion::Rational(lens) => {
            let [k1, k2, p1, p2, k3, ..] = *lens.coefficients();
            ("PinHole", vec![("k1", k1), ("k2", k2), ("p1", p1), ("p2", p2), ("k3", k3)])
        }
        Distortion::Radtan([k1, k2, p1, p2]) => ("PinHole", vec![("k1", *k1), ("k2", *k2), ("p1", *p1), ("p2", *p2)]),
        Distortion::None | Distortion::Fov(_) => ("PinHole", vec![("k1", 0.0), ("k2", 0.0), ("p1", 0.0), ("p2", 0.0)]),
    };
    let mut out = text::opencv_comments(head);
    out.push_str("# Images: the frames of ");
    out.push_str(&crate::text::printable(&camera.topic));
    out.push_str(", IMU: ");
    out.push_str(&crate::text::printable(&rig.imu.topic));
    out.push_str(". The settings name no topic.\n");
    out.push_str(&text::entries(&[
        ("File.version", "\"1.0\"".to_owned()),
        ("Camera.type", text::quoted(kind)),
        ("Camera1.fx", number(fx)),
        ("Camera1.fy", number(fy)),
        ("Camera1.cx", number(cx)),
        ("Camera1.cy", number(cy)),
    ]));
    for (key, value) in lens {
        let _infallible = writeln!(out, "Camera1.{key}: {}", number(value));
    }
    out.push_str(&text::entries(&[
        ("Camera.width", width.to_string()),
        ("Camera.height", height.to_string()),
        ("Camera.newWidth", width.to_string()),
        ("Camera.newHeight", height.to_string()),
        ("Camera.fps", format!("{:.0}", camera.rate_hz.max(1.0))),
        ("Camera.RGB", "1".to_owned()),
    ]));
    out.push_str("# Maps points from the camera to the IMU.\n");
    out.push_str(&text::opencv_matrix("IMU.T_b_c1", &imu_from_camera(camera), 'f'));
    out.push_str("# Continuous-time densities: rad/s/√Hz, m/s²/√Hz, rad/s²/√Hz, m/s³/√Hz.\n");
    let noise = &rig.imu.noise;
    out.push_str(&text::entries(&[
        ("IMU.NoiseGyro", number(noise.gyroscope_noise_density)),
        ("IMU.NoiseAcc", number(noise.accelerometer_noise_density)),
        ("IMU.GyroWalk", number(noise.gyroscope_random_walk)),
        ("IMU.AccWalk", number(noise.accelerometer_random_walk)),
        ("IMU.Frequency", number(rig.imu.rate_hz)),
    ]));
    out.push_str("# Features and viewer: usual values.\n");
    out.push_str(&text::entries(
        &[
            ("ORBextractor.nFeatures", "1000"),
            ("ORBextractor.scaleFactor", "1.2"),
            ("ORBextractor.nLevels", "8"),
            ("ORBextractor.iniThFAST", "20"),
            ("ORBextractor.minThFAST", "7"),
            ("Viewer.KeyFrameSize", "0.05"),
            ("Viewer.KeyFrameLineWidth", "1.0"),
            ("Viewer.GraphLineWidth", "0.9"),
            ("Viewer.PointSize", "2.0"),
            ("Viewer.CameraSize", "0.08"),
            ("Viewer.CameraLineWidth", "3.0"),
            ("Viewer.ViewpointX", "0.0"),
            ("Viewer.ViewpointY", "-0.7"),
            ("Viewer.ViewpointZ", "-3.5"),
            ("Viewer.ViewpointF", "500.0"),
        ]
        .map(|(key, value)| (key, value.to_owned())),
    ));
    vec![("orb_slam3.yaml".to_owned(), out.into_bytes())]
}
