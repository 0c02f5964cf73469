//! Synthetic stills of a gimbal with known truth: known points, joint readings, errors of encoders and map.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{UnitQuaternion, Vector2, Vector3, Vector6};

use super::random::RandomStream;
use crate::camera::CameraModel;
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::{ClassicalChain, DhLink};
use crate::sensors::{MapPoint, StillCamera, StillSet, StillView, Stills, StillsChain};

/// Stream of the random numbers of stills.
const STREAM: u64 = 49;

/// Settings of synthetic stills.
#[derive(Clone, Debug, PartialEq)]
pub struct SyntheticStillsOptions {
    pub seed: u64,
    pub stations: usize,
    pub sets_per_station: usize,
    pub points_per_view: usize,
    /// Standard deviation of a pixel coordinate.
    pub pixel_sigma_px: f64,
    /// σ of yaw, roll and pitch readings.
    pub encoder_sigma_rad: [f64; 3],
    /// σ of the rotation of a rigid camera by the map, common to a station.
    pub station_rotation_rad: f64,
    /// σ of the position of a rigid camera by the map, common to a station.
    pub station_position_m: f64,
    /// σ of the position of the gimbal camera by the map.
    pub set_position_m: f64,
    /// Bounds of the errors of the initial chain, in radians and metres.
    pub initial_error: (f64, f64),
    /// Readings with a gross error: index of the set, joint, error in rad.
    pub wrong_readings: Vec<(usize, usize, f64)>,
    /// Error of each encoder in proportion to its angle.
    pub encoder_scale: [f64; 3],
    /// True if the views have no pose.
    pub without_poses: bool,
}

impl Default for SyntheticStillsOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            stations: 10,
            sets_per_station: 4,
            points_per_view: 80,
            pixel_sigma_px: 1.0,
            encoder_sigma_rad: [0.006, 0.006, 0.009],
            station_rotation_rad: 1.5e-3,
            station_position_m: 5e-3,
            set_position_m: 2e-3,
            initial_error: (0.12, 0.015),
            wrong_readings: Vec::new(),
            encoder_scale: [0.0; 3],
            without_poses: false,
        }
    }
}

/// Stills with the truth that made them.
#[derive(Clone, Debug, PartialEq)]
pub struct SyntheticStills {
    pub stills: Stills,
    pub truth: StillsChain,
    /// True joint angles of each set, in rad.
    pub joint_angles_rad: Vec<Vec<f64>>,
}

/// Yaw, roll and pitch with axes some degrees off the right angle, a camera behind them, and two rigid cameras.
fn mechanism() -> StillsChain {
    let link = |theta_offset_rad, d_m, a_m, alpha_rad| DhLink { theta_offset_rad, d_m, a_m, alpha_rad };
    let about = |x, y, z| so3::exp(&Vector3::new(x, y, z));
    let chain = ClassicalChain {
        imu_from_base: RigidTransform::new(about(1.3, 0.15, -0.2), Vector3::new(-0.24, 0.03, -0.1)),
        links: vec![
            link(-0.17, 0.14, 0.012, FRAC_PI_2 + 0.02),
            link(FRAC_PI_2 + 0.05, 0.022, 0.018, FRAC_PI_2 - 0.03),
            link(-FRAC_PI_2 - 0.04, 0.012, -0.02, 0.0),
        ],
        effector_from_camera: RigidTransform::new(about(0.02, -FRAC_PI_2, 0.01), Vector3::new(0.01, 0.008, -0.005)),
    };
    let second_from_first = RigidTransform::new(about(0.2, 1.2, 0.1), Vector3::new(0.4, 0.02, -0.3));
    StillsChain { chain, further_from_first: vec![second_from_first] }
}

/// Makes stills; equal options give equal values.
///
/// # Panics
///
/// Never: the intrinsics of the cameras are valid.
pub fn synthetic_stills(options: &SyntheticStillsOptions) -> SyntheticStills {
    let mut random = RandomStream::new(options.seed, STREAM);
    let camera = |name: &str, focal_px: f64| StillCamera {
        name: name.to_owned(),
        model: CameraModel::pinhole([focal_px, focal_px, 640.0, 360.0], [1280, 720]).expect("valid intrinsics"),
    };
    let gimbal_camera = camera("gimbal", 1100.0);
    let rigid_cameras = vec![camera("front", 660.0), camera("side", 660.0)];
    let truth = mechanism();
    let mut sets = Vec::new();
    let mut joint_angles_rad = Vec::new();
    for station in 0..options.stations {
        let turn = random.normal_vector(0.5);
        let first_from_world = RigidTransform::new(so3::exp(&turn), random.normal_vector(2.0));
        let map_errors: Vec<Vector6<f64>> = (0..rigid_cameras.len())
            .map(|_| pose_error(&mut random, options.station_rotation_rad, options.station_position_m))
            .collect();
        for _ in 0..options.sets_per_station {
            let index = sets.len();
            let bounds = [2.6, 0.35, 0.9];
            let angles: Vec<f64> = bounds.iter().map(|bound| random.uniform(-bound, *bound)).collect();
            let camera_from_first = truth.chain.imu_from_camera(&angles).inverse();
            let gimbal_error = pose_error(&mut random, 0.0, options.set_position_m);
            let mut view = |camera: &StillCamera, pose: &RigidTransform, error: &Vector6<f64>| {
                still_view(&mut random, options, camera, pose, error)
            };
            let gimbal = view(&gimbal_camera, &(camera_from_first * first_from_world), &gimbal_error);
            let rigid = rigid_cameras.iter().enumerate().map(|(place, camera)| {
                Some(view(camera, &(truth.rigid_from_first(place) * first_from_world), &map_errors[place]))
            });
            let rigid = rigid.collect();
            let joint_readings_rad = angles
                .iter()
                .enumerate()
                .map(|(joint, angle)| {
                    let gross = options.wrong_readings.iter().filter(|it| (it.0, it.1) == (index, joint));
                    let gross: f64 = gross.map(|it| it.2).sum();
                    let noise = options.encoder_sigma_rad[joint] * random.normal();
                    angle * (1.0 + options.encoder_scale[joint]) + noise + gross
                })
                .collect();
            sets.push(StillSet {
                id: index as u64 + 1,
                station: station as u64 + 1,
                joint_readings_rad,
                gimbal,
                rigid,
            });
            joint_angles_rad.push(angles);
        }
    }
    let initial = perturbed(&mut random, &truth, options.initial_error);
    let joints = ["yaw", "roll", "pitch"].map(str::to_owned).into();
    let stills = Stills { name: "synthetic".to_owned(), joints, gimbal_camera, rigid_cameras, initial, sets };
    SyntheticStills { stills, truth, joint_angles_rad }
}

/// `[φ; δt]` with standard deviations per coordinate.
fn pose_error(random: &mut RandomStream, rotation_rad: f64, position_m: f64) -> Vector6<f64> {
    let (rotation, position) = (random.normal_vector(rotation_rad), random.normal_vector(position_m));
    Vector6::from_iterator(rotation.iter().chain(position.iter()).copied())
}

/// Points in front of a camera at `camera_from_world`, with coordinates of a map in which that pose has an error.
fn still_view(
    random: &mut RandomStream,
    options: &SyntheticStillsOptions,
    camera: &StillCamera,
    camera_from_world: &RigidTransform,
    map_error: &Vector6<f64>,
) -> StillView {
    let on_map = camera_from_world.plus(map_error);
    let [width, height] = camera.model.resolution_px.map(|pixels| pixels as f64);
    let points = (0..options.points_per_view).filter_map(|_| {
        let uv_px = Vector2::new(random.uniform(0.0, width), random.uniform(0.0, height));
        let distance_m = random.uniform(2.0, 6.0);
        let point_in_camera = camera.model.unproject(&uv_px)? * distance_m;
        let noise = Vector2::new(random.normal(), random.normal()) * options.pixel_sigma_px;
        Some(MapPoint { point_in_world_m: on_map.inverse().transform(&point_in_camera), uv_px: uv_px + noise })
    });
    let points = points.collect();
    let given = on_map.plus(&pose_error(random, 0.01, 0.02));
    StillView { camera_from_world: (!options.without_poses).then_some(given), points }
}

/// Chain with uniform errors on every angle and length.
fn perturbed(random: &mut RandomStream, truth: &StillsChain, (angle_rad, length_m): (f64, f64)) -> StillsChain {
    let mut near = |bound: f64| random.uniform(-1.0, 1.0) * bound;
    let mut moved = |transform: &RigidTransform| {
        let angles: [f64; 3] = std::array::from_fn(|_| near(angle_rad));
        let shift: [f64; 3] = std::array::from_fn(|_| near(length_m));
        let rotation: UnitQuaternion<f64> = transform.rotation * so3::exp(&Vector3::from(angles));
        RigidTransform::new(rotation, transform.translation_m + Vector3::from(shift))
    };
    let imu_from_base = moved(&truth.chain.imu_from_base);
    let effector_from_camera = moved(&truth.chain.effector_from_camera);
    let further_from_first = truth.further_from_first.iter().map(&mut moved).collect();
    let links = truth.chain.links.iter().map(|link| DhLink {
        theta_offset_rad: link.theta_offset_rad + near(angle_rad),
        d_m: link.d_m + near(length_m),
        a_m: link.a_m + near(length_m),
        alpha_rad: link.alpha_rad + near(angle_rad),
    });
    let links = links.collect();
    StillsChain { chain: ClassicalChain { imu_from_base, links, effector_from_camera }, further_from_first }
}
