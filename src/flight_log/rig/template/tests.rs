use std::path::Path;

use nalgebra::{Vector2, Vector3};

use super::*;
use crate::camera::{CameraModel, Distortion};
use crate::files::RigFile as _;
use crate::sensors::{BodyAxes, Rig};
use crate::text::Named as _;

const SIZE_PX: [usize; 2] = [640, 480];

fn choices(mechanism: &str, camera: &str) -> RigChoices {
    RigChoices {
        name: "new".to_owned(),
        camera: camera.parse().unwrap(),
        resolution_px: Some(SIZE_PX),
        described: None,
        mechanism: mechanism.parse().unwrap(),
        positive: None,
        imu_axes: None,
        position_m: None,
        imu_topic: None,
        gimbal_imu_topic: None,
        gimbal_imu_axes: None,
        image_topic: None,
        joint_topic: None,
        joint_names: Vec::new(),
        attitude: None,
        noise: None,
    }
}

#[test]
fn an_imu_in_the_cameras_housing_becomes_the_second_one() {
    for (axes, y, z) in [(Some(BodyAxes::Frd), Vector3::x(), Vector3::y()), (None, -Vector3::x(), -Vector3::y())] {
        let choices = RigChoices {
            gimbal_imu_topic: Some("/camera/imu".to_owned()),
            gimbal_imu_axes: axes,
            ..choices("yaw-roll-pitch", "fov:84")
        };
        let template = RigTemplate::new(&choices, None).unwrap();
        let imu = template.rig().gimbal_imu.unwrap();
        assert_eq!(imu.sensor.topic, "/camera/imu");
        // Optical axes: x right, y down, z forward.
        for (axis, expected) in [(Vector3::x(), Vector3::z()), (Vector3::y(), y), (Vector3::z(), z)] {
            let found = imu.camera_from_imu.rotation * axis;
            assert!((found - expected).norm() < 1e-9, "{axes:?}: {axis} is {found}");
        }
        let fields = template.assumed_fields();
        assert!(fields.iter().any(|assumed| assumed.field == "imu1.T_cam_imu"), "{fields:?}");
        let read = Rig::from_yaml(&template.to_yaml(), Path::new("new.rig.yaml")).unwrap();
        assert_eq!(read.gimbal_imu.map(|imu| imu.sensor), Some(imu.sensor));
    }
    let rigid = RigChoices { gimbal_imu_topic: Some("/camera/imu".to_owned()), ..choices("rigid", "fov:84") };
    assert_eq!(RigTemplate::new(&rigid, None).unwrap().rig().gimbal_imu, None);
}

fn template(mechanism: &str, camera: &str) -> RigTemplate {
    RigTemplate::new(&choices(mechanism, camera), None).unwrap()
}

fn model(camera: &str, resolution_px: [usize; 2]) -> CameraModel {
    let choices = RigChoices { resolution_px: Some(resolution_px), ..choices("pitch", camera) };
    RigTemplate::new(&choices, None).unwrap().camera.model.value
}

/// Angle in degrees between the first and the last column, pixel borders included.
fn across_deg(model: &CameraModel) -> f64 {
    let [width, _] = model.resolution_px.map(|side| side as f64);
    let [_, _, cx, cy] = model.intrinsics_px;
    let axis = model.unproject(&Vector2::new(cx, cy)).unwrap();
    let border = |u: f64| model.unproject(&Vector2::new(u, cy)).unwrap().angle(&axis);
    (border(-0.5) + border(width - 0.5)).to_degrees()
}

#[test]
fn a_camera_has_its_field_of_view() {
    let check = |camera: &str, resolution_px: [usize; 2], expected_deg: f64, fisheye: bool| {
        let model = model(camera, resolution_px);
        assert!((across_deg(&model) - expected_deg).abs() < 0.02, "{camera}: {}", across_deg(&model));
        assert_eq!(matches!(model.distortion, Distortion::Equidistant(_)), fisheye, "{camera}");
    };
    check("fov:84", [640, 480], 84.0, false);
    check("fov:150", [640, 480], 150.0, true);
    check("gopro-hero4-wide", [1920, 1080], 118.2, true);
    check("gopro-hero4-wide", [1600, 1200], 122.6, true);
    check("gopro-hero5-linear", [2704, 1520], 86.0, false);
    // A diagonal of 84° in 4:3 is 2·atan(0.8·tan 42°) across.
    check("dji-mavic-3", [3840, 2160], 71.53, false);
}

#[test]
fn unknown_cameras_and_mechanisms_are_named() {
    let camera = |text: &str| text.parse::<CameraChoice>().unwrap_err().to_string();
    assert!(camera("gopro-hero5").contains("gopro-hero5-wide"), "{}", camera("gopro-hero5"));
    assert!(camera("fov:wide").contains("fov:84"));
    assert!(camera("fov:500").contains("1 to 220"));
    for wrong in ["", "yaw-yaw", "yaw-twist", "yaw-roll-pitch-yaw-roll-pitch-yaw-roll-pitch"] {
        let error = wrong.parse::<MechanismAxes>().unwrap_err().to_string();
        assert!(error.contains("yaw-roll-pitch"), "{error}");
    }
}

#[test]
fn the_camera_looks_forward_at_zero_angles() {
    let mut checked = 0;
    for mechanism in
        ["yaw-roll-pitch", "yaw-pitch-roll", "yaw-pitch", "pitch-yaw", "pitch", "roll-pitch", "yaw", "rigid"]
    {
        for positive in [BodyAxes::Flu, BodyAxes::Frd] {
            for imu in [BodyAxes::Flu, BodyAxes::Frd] {
                let position_m = Vector3::new(0.1, 0.02, -0.05);
                let choices = RigChoices {
                    positive: Some(positive),
                    imu_axes: Some(imu),
                    position_m: Some(position_m),
                    ..choices(mechanism, "fov:84")
                };
                let rig = RigTemplate::new(&choices, None).unwrap().rig();
                let chain = rig.chain_of_camera("cam0").unwrap();
                let imu_from_camera = chain.imu_from_camera(&vec![0.0; chain.joint_count()]);
                let vehicle_from_imu = imu.flu_from_axes();
                let forward = vehicle_from_imu * (imu_from_camera.rotation * Vector3::z());
                let down = vehicle_from_imu * (imu_from_camera.rotation * Vector3::y());
                assert!((forward - Vector3::x()).norm() < 1e-12, "{mechanism}: {forward}");
                assert!((down + Vector3::z()).norm() < 1e-12, "{mechanism}: {down}");
                let place = vehicle_from_imu * imu_from_camera.translation_m;
                assert!((place - position_m).norm() < 1e-12, "{mechanism}: {place}");
                checked += 1;
            }
        }
    }
    assert_eq!(checked, 32);
}

#[test]
fn positive_angles_rotate_as_stated() {
    // Viewing direction of the camera after 0.1 rad of one joint, in forward-left-up axes.
    let look = |positive: BodyAxes, angles: [f64; 2]| {
        let choices = RigChoices { positive: Some(positive), ..choices("yaw-pitch", "fov:84") };
        let rig = RigTemplate::new(&choices, None).unwrap().rig();
        rig.chain_of_camera("cam0").unwrap().imu_from_camera(&angles).rotation * Vector3::z()
    };
    let sine = 0.1_f64.sin();
    assert!((look(BodyAxes::Frd, [0.1, 0.0]).y + sine).abs() < 1e-12, "to the right");
    assert!((look(BodyAxes::Frd, [0.0, 0.1]).z - sine).abs() < 1e-12, "up");
    assert!((look(BodyAxes::Flu, [0.1, 0.0]).y - sine).abs() < 1e-12, "to the left");
    assert!((look(BodyAxes::Flu, [0.0, 0.1]).z + sine).abs() < 1e-12, "down");
}

#[test]
fn the_text_reads_back_with_what_is_assumed() {
    for mechanism in ["yaw-roll-pitch", "pitch", "rigid"] {
        let template = template(mechanism, "gopro-hero4-wide");
        let text = template.to_yaml();
        let read = Rig::from_yaml(&text, Path::new("new.rig.yaml")).unwrap();
        let written = template.rig();
        assert_eq!(read.assumed, sorted(template.assumed_fields()), "{text}");
        assert_eq!(read.cameras[0].model, written.cameras[0].model);
        let zero = vec![0.3; read.chain_of_camera("cam0").unwrap().joint_count()];
        let pose = |rig: &Rig| rig.chain_of_camera("cam0").unwrap().imu_from_camera(&zero);
        assert!(pose(&read).minus(&pose(&written)).norm() < 1e-12);
        assert!(text.lines().filter(|line| line.trim_start().starts_with('#')).count() >= 6, "{text}");
        assert!(!text.contains("e-1"), "rounding errors: {text}");
        // Writing preserves the entries.
        let again = Rig::from_yaml(&read.to_yaml(), Path::new("again.rig.yaml")).unwrap();
        assert_eq!(again.assumed, read.assumed);
    }
}

fn sorted(mut fields: Vec<AssumedField>) -> Vec<AssumedField> {
    fields.sort_by(|a, b| a.field.cmp(&b.field));
    fields
}

#[test]
fn an_assumed_field_must_exist() {
    let text = template("pitch", "fov:84").to_yaml();
    let with = |entry: &str| Rig::from_yaml(&format!("{text}  {entry}\n"), Path::new("new.rig.yaml"));
    assert!(with("\"gimbal.links[0].alpha\": the twist is a guess").is_ok());
    let error = with("gimbal.twist: a guess").unwrap_err().to_string();
    assert!(error.contains("assumed") && error.contains("no field 'gimbal.twist'"), "{error}");
    let error = with("\"gimbal.links[7].alpha\": a guess").unwrap_err().to_string();
    assert!(error.contains("no field"), "{error}");
    let error = with("gimbal.prior: 3").unwrap_err().to_string();
    assert!(error.contains("expected a sentence"), "{error}");
}

#[test]
fn an_attitude_is_written_as_the_source_of_the_angles() {
    let with = |entries: &[(&str, &str)]| {
        let entries = entries.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        let attitude = Some(("/gimbal/attitude".to_owned(), entries));
        RigTemplate::new(
            &RigChoices { attitude, imu_axes: Some(BodyAxes::Frd), ..choices("yaw-pitch", "fov:84") },
            None,
        )
    };
    let template =
        with(&[("type", "quaternion"), ("frame", "earth"), ("axes", "frd"), ("vehicle", "/attitude")]).unwrap();
    let read = Rig::from_yaml(&template.to_yaml(), Path::new("new.rig.yaml")).unwrap();
    let gimbal = read.gimbal.unwrap();
    assert_eq!(gimbal.topic.as_deref(), Some("/gimbal/attitude"));
    let source = gimbal.attitude.unwrap();
    assert_eq!(
        (source.frame.name(), source.axes.name(), source.imu_axes.to_string().as_str()),
        ("earth", "frd", "frd")
    );
    assert!(read.assumed.iter().any(|assumed| assumed.field == "gimbal.source"));
    let error = with(&[("type", "quaternion"), ("frame", "earth"), ("axes", "frd")]).unwrap_err().to_string();
    assert!(error.contains("--attitude: vehicle: missing"), "{error}");
}
