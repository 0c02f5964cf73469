use std::sync::Arc;

use nalgebra::Vector3;

use super::super::world;
use super::super::{SimulationError, SimulationOptions, simulate};
use super::images::{cells_with_corners, radiance};
use super::logs::{small, write};
use crate::flight_log::RigOfLog as _;
use crate::flight_log::{FlightLog, FrameStream, recorded_images};
use crate::geometry::wrap_angle;
use crate::sensors::Rig;
use crate::simulation::equipment::Lens;
use crate::simulation::experiment::{Environment, Experiment, WorldKind};

/// Number of 300 image cells with corners from a position along a heading, 8° down.
fn corners(environment: Environment, kind: WorldKind, place_m: [f64; 3], heading_deg: f64) -> usize {
    let world = world::build(environment, kind, 1);
    cells_with_corners(&radiance(&world, Lens::Pinhole, place_m, heading_deg))
}

#[test]
fn a_plain_world_shows_its_house_and_nothing_else() {
    let at = |kind, heading_deg| corners(Environment::House, kind, [-13.0, -11.0, 2.6], heading_deg);
    let towards_deg = 11_f64.atan2(13.0).to_degrees();
    assert!(at(WorldKind::Plain, towards_deg) > 60, "{}", at(WorldKind::Plain, towards_deg));
    // Away from the house, and from its shadow, the images of the other world are full of corners.
    for heading_deg in [180.0, 220.0] {
        let (plain, textured) = (at(WorldKind::Plain, heading_deg), at(WorldKind::Textured, heading_deg));
        assert!(plain == 0 && textured > 100, "{heading_deg}°: {plain} and {textured}");
    }
}

#[test]
fn a_world_of_facades_has_texture_on_buildings_alone() {
    let place_m = [-15.0, -4.0, 2.9];
    let (facades, textured) = (
        corners(Environment::Town, WorldKind::Facades, place_m, 90.0),
        corners(Environment::Town, WorldKind::Textured, place_m, 90.0),
    );
    assert!(facades > 60 && facades < textured - 20, "{facades} and {textured}");
    // High above the roofs' edges the image shows ground and sky alone.
    let outside_m = [-90.0, 0.0, 2.9];
    assert_eq!(corners(Environment::Town, WorldKind::Facades, outside_m, 180.0), 0);
}

/// Headings of vehicle and gimbal camera relative to the direction of the house, in degrees, every 0.05 s.
fn relative_headings_deg(experiment: Experiment, swing_deg: f64) -> (Vec<f64>, Vec<f64>) {
    let folder = tempfile::tempdir().unwrap();
    let options = SimulationOptions {
        duration_s: Some(14.0),
        resolution_px: [32, 24],
        static_camera: false,
        swing_rad: Some(swing_deg.to_radians()),
        world: WorldKind::Plain,
        ..small(experiment)
    };
    let summary = write(&options, folder.path());
    let log = Arc::new(FlightLog::open(&summary.log).unwrap());
    let rig = Rig::ground_truth_for_log(&log, None).unwrap().unwrap();
    let chain = rig.gimbal.as_ref().unwrap().chain.clone();
    let frames = FrameStream::new(log, &rig, "cam0", 0.0, None).unwrap();
    let mut headings = (Vec::new(), Vec::new());
    for frame in frames {
        let world_from_imu = frame.ground_truth.unwrap();
        let camera = world_from_imu.rotation * chain.imu_from_camera(&frame.joint_angles.unwrap().angles_rad).rotation;
        let to_house = -world_from_imu.translation_m;
        let relative =
            |axis: Vector3<f64>| wrap_angle(axis.y.atan2(axis.x) - to_house.y.atan2(to_house.x)).to_degrees();
        headings.0.push(relative(world_from_imu.rotation * Vector3::x()));
        headings.1.push(relative(camera * Vector3::z()));
    }
    headings
}

#[test]
fn the_heading_swings_off_the_house_and_the_gimbal_points_at_it() {
    for experiment in [Experiment::T1, Experiment::T2] {
        let (vehicle, camera) = relative_headings_deg(experiment, 45.0);
        let most = |values: &[f64]| values.iter().copied().fold(f64::MIN, f64::max);
        let least = |values: &[f64]| values.iter().copied().fold(f64::MAX, f64::min);
        assert!(most(&vehicle) > 35.0 && least(&vehicle) < -35.0, "{experiment:?}: {vehicle:?}");
        assert!(most(&camera) < 30.0 && least(&camera) > -30.0, "{experiment:?}: {camera:?}");
        let (level, _) = relative_headings_deg(experiment, 0.0);
        assert!(most(&level) < 30.0 && least(&level) > -30.0, "{experiment:?}: {level:?}");
    }
}

#[test]
fn one_camera_is_blind_and_the_other_one_sees() {
    let folder = tempfile::tempdir().unwrap();
    let mut options = small(Experiment::T3);
    options.disturbances.set("blind-static=0.2,0.5,0").unwrap();
    options.disturbances.set("blind-gimbal=0.8,0.1,150").unwrap();
    let summary = write(&options, folder.path());
    let log = Arc::new(FlightLog::open(&summary.log).unwrap());
    let rig = Rig::for_log(&log, None).unwrap();
    // Stamps start at 3 ms, every 50 ms.
    for (key, blind, grey) in [("cam0", 16..18, 150.0), ("cam1", 4..14, 0.0)] {
        let images = recorded_images(&log, &rig, rig.camera(key).unwrap()).unwrap();
        for (number, recorded) in images.enumerate() {
            let pixels = &recorded.image.pixels;
            let mean = pixels.iter().map(|grey| f64::from(*grey)).sum::<f64>() / pixels.len() as f64;
            let spread = pixels.iter().max().unwrap() - pixels.iter().min().unwrap();
            // Vignetting darkens the corners by 12 %.
            let even = spread < 50 && (mean - grey).abs() < 15.0;
            assert_eq!(even, blind.contains(&number), "{key}, image {number}: mean {mean}, spread {spread}");
        }
    }
}

#[test]
fn a_world_of_another_environment_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let options = SimulationOptions { world: WorldKind::Facades, ..small(Experiment::T1) };
    let error = simulate(&options, &folder.path().join("x.mcap"), &mut |_| ()).unwrap_err();
    assert!(matches!(error, SimulationError::WrongWorld { .. }), "{error}");
    assert_eq!(error.to_string(), "T1 has no world 'facades': expected textured, or plain for T1 and T2");
}
