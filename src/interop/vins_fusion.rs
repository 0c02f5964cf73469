//! VINS-Fusion: its configuration and one camodocal file per camera.

use std::fmt::Write as _;

use super::text::{self, imu_from_camera};
use crate::camera::{CameraModel, Distortion, Projection};
use crate::files::yaml::number;
use crate::sensors::Rig;

/// `vins_config.yaml`, `cam0.yaml` and, with two cameras, `cam1.yaml`.
pub(super) fn files(rig: &Rig, head: &[String]) -> Vec<(String, Vec<u8>)> {
    let mut files = vec![("vins_config.yaml".to_owned(), configuration(rig, head).into_bytes())];
    for (number, camera) in rig.cameras.iter().enumerate() {
        let text = format!("{}---\n{}", text::opencv_comments(head), camodocal(&camera.model));
        files.push((format!("cam{number}.yaml"), text.into_bytes()));
    }
    files
}

fn configuration(rig: &Rig, head: &[String]) -> String {
    let first = &rig.cameras[0];
    let second = rig.cameras.get(1);
    let [width, height] = first.model.resolution_px;
    let mut out = text::opencv_comments(head);
    let topic = |camera: Option<&crate::sensors::CameraRig>| {
        // VINS-Fusion always subscribes to a second topic and stores its messages.
        text::quoted(camera.map_or("/unused_image1", |camera| camera.topic.as_str()))
    };
    out.push_str(&text::entries(&[
        ("imu", "1".to_owned()),
        ("num_of_cam", rig.cameras.len().to_string()),
        ("imu_topic", text::quoted(&rig.imu.topic)),
        ("image0_topic", topic(Some(first))),
        ("image1_topic", topic(second)),
        ("output_path", "\"/tmp/\"  # folder of vio.csv, which must exist".to_owned()),
        ("cam0_calib", "\"cam0.yaml\"".to_owned()),
        ("cam1_calib", "\"cam1.yaml\"".to_owned()),
        ("image_width", width.to_string()),
        ("image_height", height.to_string()),
        ("estimate_extrinsic", "0  # 0: fixed, 1: optimized around the values below, without a prior".to_owned()),
    ]));
    out.push_str("# Maps points from the camera to the IMU.\n");
    for (number, camera) in rig.cameras.iter().enumerate() {
        out.push_str(&text::opencv_matrix(&format!("body_T_cam{number}"), &imu_from_camera(camera), 'd'));
    }
    out.push_str("# Front end and optimization: VINS-Fusion's usual values.\n");
    out.push_str(&text::entries(
        &[
            ("multiple_thread", "1"),
            ("max_cnt", "150"),
            ("min_dist", "30"),
            ("freq", "10"),
            ("F_threshold", "1.0"),
            ("show_track", "1"),
            ("flow_back", "1"),
            ("max_solver_time", "0.04"),
            ("max_num_iterations", "8"),
            ("keyframe_parallax", "10.0"),
        ]
        .map(|(key, value)| (key, value.to_owned())),
    ));
    // Noise per sample: VINS-Fusion's covariance has neither 1/dt nor dt.
    let root = rig.imu.rate_hz.sqrt();
    let noise = &rig.imu.noise;
    let discrete =
        |density: f64| format!("{}  # {} · √{}", number(density * root), number(density), number(rig.imu.rate_hz));
    out.push_str("# Noise per sample: the densities of the rig times the root of the IMU's rate in Hz.\n");
    out.push_str(&text::entries(&[
        ("acc_n", discrete(noise.accelerometer_noise_density)),
        ("gyr_n", discrete(noise.gyroscope_noise_density)),
        ("acc_w", discrete(noise.accelerometer_random_walk)),
        ("gyr_w", discrete(noise.gyroscope_random_walk)),
        ("g_norm", number(rig.gravity_m_per_s2)),
        ("estimate_td", "0".to_owned()),
        ("td", format!("{}  # s, t_imu = t_cam + td", number(first.timeshift_cam_imu_s))),
    ]));
    out.push_str("# Loop closure (loop_fusion).\n");
    out.push_str(&text::entries(&[
        ("load_previous_pose_graph", "0".to_owned()),
        ("pose_graph_save_path", "\"/tmp/pose_graph/\"".to_owned()),
        ("save_image", "0".to_owned()),
    ]));
    out
}

fn camodocal(model: &CameraModel) -> String {
    let [fx, fy, cx, cy] = model.intrinsics_px;
    let radtan = match &model.distortion {
        Distortion::Radtan(coefficients) => *coefficients,
        _ => [0.0; 4],
    };
    let tangential = |[k1, k2, p1, p2]: [f64; 4]| vec![("k1", k1), ("k2", k2), ("p1", p1), ("p2", p2)];
    let pinhole = vec![("fx", fx), ("fy", fy), ("cx", cx), ("cy", cy)];
    let (kind, groups) = match (&model.projection, &model.distortion) {
        (Projection::Omni { xi }, _) => (
            "MEI",
            vec![
                ("mirror_parameters", vec![("xi", *xi)]),
                ("distortion_parameters", tangential(radtan)),
                ("projection_parameters", vec![("gamma1", fx), ("gamma2", fy), ("u0", cx), ("v0", cy)]),
            ],
        ),
        // Its k2 … k5 are coefficients of θ³ … θ⁹, Kalibr's k1 … k4.
        (_, Distortion::Equidistant([k1, k2, k3, k4])) => (
            "KANNALA_BRANDT",
            vec![(
                "projection_parameters",
                vec![
                    ("k2", *k1),
                    ("k3", *k2),
                    ("k4", *k3),
                    ("k5", *k4),
                    ("mu", fx),
                    ("mv", fy),
                    ("u0", cx),
                    ("v0", cy),
                ],
            )],
        ),
        (_, Distortion::Rational(lens)) => {
            let [k1, k2, p1, p2, k3, k4, k5, k6] = *lens.coefficients();
            let lens =
                vec![("k1", k1), ("k2", k2), ("k3", k3), ("k4", k4), ("k5", k5), ("k6", k6), ("p1", p1), ("p2", p2)];
            ("PINHOLE_FULL", vec![("distortion_parameters", lens), ("projection_parameters", pinhole)])
        }
        _ => ("PINHOLE", vec![("distortion_parameters", tangential(radtan)), ("projection_parameters", pinhole)]),
    };
    let [width, height] = model.resolution_px;
    let mut out = format!("model_type: {kind}\ncamera_name: camera\nimage_width: {width}\nimage_height: {height}\n");
    for (group, values) in groups {
        out.push_str(group);
        out.push_str(":\n");
        for (key, value) in values {
            let _infallible = writeln!(out, "   {key}: {}", number(value));
        }
    }
    out
}
