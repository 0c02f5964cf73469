//! The artificial flight of the samples: a walled yard, a rig with a three-axis gimbal, and the ground-truth
//! trajectory.

use nalgebra::{UnitQuaternion, Vector2, Vector3};

use crate::camera::{CameraModel, Distortion, Projection};
use crate::frontend::FeatureId;
use crate::geometry::{RigidTransform, SplitMix64, so3};
use crate::gimbal::{ClassicalChain, DhLink};
use crate::sensors::{CameraMount, CameraRig, ChainPrior, GimbalRig, ImuNoise, ImuRig, Joint, Rig};

/// The first frame in which the estimator tracks (2.5 s).
pub(crate) const FIRST_TRACKED_FRAME: usize = 50;
/// Half the side of the walled yard in metres.
pub(super) const YARD_HALF_SIDE_M: f64 = 22.0;
/// Height of its walls in metres.
pub(super) const WALL_HEIGHT_M: f64 = 12.0;
/// Focal lengths and principal point of the camera in pixels.
pub(super) const INTRINSICS_PX: [f64; 4] = [352.6, 352.1, 322.4, 238.1];
/// Its resolution in pixels.
pub(super) const RESOLUTION_PX: [usize; 2] = [640, 480];

/// Seeded random numbers, so that the sample is the same on every machine.
pub(super) struct RandomNumbers(SplitMix64);

impl RandomNumbers {
    pub(super) fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    /// Uniform in `[0, 1)`.
    pub(super) fn unit(&mut self) -> f64 {
        self.0.next_unit()
    }

    /// Approximately normal with unit variance (sum of twelve uniform numbers).
    pub(super) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
}

/// `world_from_imu`, joint angles and the camera's pose at one frame.
pub(super) struct FlightState {
    pub(super) world_from_imu: RigidTransform,
    pub(super) velocity_m_per_s: Vector3<f64>,
    pub(super) joint_angles_rad: [f64; 3],
    pub(super) world_from_camera: RigidTransform,
}

impl FlightState {
    /// The ground truth at a frame.
    pub(super) fn at(frame_index: usize, chain: &ClassicalChain) -> Self {
        let t_s = frame_index as f64 * 0.05;
        let position = position_m(t_s);
        let velocity = (position_m(t_s + 0.01) - position_m(t_s - 0.01)) / 0.02;
        let acceleration = (position_m(t_s + 0.05) + position_m(t_s - 0.05) - position * 2.0) / 0.0025;
        let heading = 0.35 * (0.5 * t_s).sin() + 0.12 * t_s;
        let rotated = UnitQuaternion::from_euler_angles(0.0, 0.0, -heading) * acceleration;
        let rotation = UnitQuaternion::from_euler_angles(
            (-rotated.y / 9.81).clamp(-0.5, 0.5),
            (rotated.x / 9.81).clamp(-0.5, 0.5),
            heading,
        );
        let world_from_imu = RigidTransform::new(rotation, position);
        let joint_angles_rad = [0.5 * (0.7 * t_s).sin(), 0.2 * (1.3 * t_s).sin(), -0.25 + 0.15 * (0.9 * t_s).sin()];
        let world_from_camera = world_from_imu * chain_pose(chain, &joint_angles_rad);
        Self { world_from_imu, velocity_m_per_s: velocity, joint_angles_rad, world_from_camera }
    }
}

/// Position in metres: hover for two seconds, then a figure of eight.
fn position_m(t_s: f64) -> Vector3<f64> {
    let moved_s = (t_s - 2.0).max(0.0);
    let phase = 0.55 * moved_s * moved_s / (moved_s + 1.5);
    let breath = 0.02 * (2.1 * t_s).sin();
    Vector3::new(
        11.0 * phase.sin() + breath,
        6.5 * (2.0 * phase).sin() + 0.5 * breath,
        3.0 + 1.4 * (1.0 - (0.9 * phase).cos()) + breath,
    )
}

/// `imu_from_camera` of the classical chain at joint angles, link by link.
pub(crate) fn chain_pose(chain: &ClassicalChain, joint_angles_rad: &[f64]) -> RigidTransform {
    let mut pose = chain.imu_from_base;
    for (link, angle_rad) in chain.links.iter().zip(joint_angles_rad) {
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_rad + link.theta_offset_rad);
        let twist = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), link.alpha_rad);
        pose = pose
            * RigidTransform::new(rotation, Vector3::new(0.0, 0.0, link.d_m))
            * RigidTransform::new(twist, Vector3::new(link.a_m, 0.0, 0.0));
    }
    pose * chain.effector_from_camera
}

fn pose_of(rotation_vector: [f64; 3], translation_m: [f64; 3]) -> RigidTransform {
    RigidTransform::new(so3::exp(&Vector3::from(rotation_vector)), Vector3::from(translation_m))
}

fn link(theta_offset_rad: f64, d_m: f64, a_m: f64, alpha_rad: f64) -> DhLink {
    DhLink { theta_offset_rad, d_m, a_m, alpha_rad }
}

/// The ground-truth chain: yaw, roll, pitch, an optical camera frame that looks forward.
pub(crate) fn true_chain() -> ClassicalChain {
    ClassicalChain {
        imu_from_base: pose_of([3.13, -0.04, 0.02], [0.09, 0.008, -0.062]),
        links: vec![
            link(-1.5568, 0.047, 0.013, -1.5481),
            link(1.5603, -0.021, 0.034, -1.6005),
            link(-1.5516, 0.024, 0.016, -1.5464),
        ],
        effector_from_camera: pose_of([-1.2092, 1.2092, -1.2092], [0.029, -0.005, 0.007]),
    }
}

/// The chain of the rig: each parameter has an error of up to 6 mm and 1.5°.
pub(crate) fn given_chain() -> ClassicalChain {
    let mut chain = true_chain();
    let mut random_numbers = RandomNumbers::new(7);
    let mut wrong = |bound: f64| bound * (2.0 * random_numbers.unit() - 1.0);
    let shift = |pose: &RigidTransform, wrong: &mut dyn FnMut(f64) -> f64| {
        let entries: Vec<f64> = (0..6).map(|entry| wrong(if entry < 3 { 0.026 } else { 0.006 })).collect();
        pose.plus(&nalgebra::Vector6::from_column_slice(&entries))
    };
    chain.imu_from_base = shift(&chain.imu_from_base, &mut wrong);
    for link in &mut chain.links {
        link.theta_offset_rad += wrong(0.026);
        link.d_m += wrong(0.006);
        link.a_m += wrong(0.006);
        link.alpha_rad += wrong(0.026);
    }
    chain.effector_from_camera = shift(&chain.effector_from_camera, &mut wrong);
    chain
}

pub(super) fn rig_with(chain: ClassicalChain, name: &str) -> Rig {
    let joint = |name: &str, low_deg: f64, high_deg: f64| Joint {
        name: name.to_owned(),
        limits_rad: (low_deg.to_radians(), high_deg.to_radians()),
    };
    Rig {
        name: name.to_owned(),
        gravity_m_per_s2: 9.81,
        imu: ImuRig {
            topic: "/imu".to_owned(),
            accelerometer_topic: None,
            frame_id: "imu".to_owned(),
            rate_hz: 200.0,
            noise: ImuNoise {
                accelerometer_noise_density: 0.004,
                accelerometer_random_walk: 0.006,
                gyroscope_noise_density: 3.4e-4,
                gyroscope_random_walk: 3.9e-5,
            },
        },
        cameras: vec![CameraRig {
            key: "cam0".to_owned(),
            mount: CameraMount::Gimbal,
            topic: "/gimbal_camera/image_raw".to_owned(),
            frame_id: "gimbal_camera".to_owned(),
            rate_hz: 20.0,
            model: CameraModel {
                projection: Projection::Pinhole,
                distortion: Distortion::None,
                intrinsics_px: INTRINSICS_PX,
                resolution_px: RESOLUTION_PX,
            },
            timeshift_cam_imu_s: 0.0,
        }],
        gimbal: Some(GimbalRig {
            topic: Some("/gimbal/joint_states".to_owned()),
            rate_hz: 200.0,
            encoder_sigma_rad: Some(0.0087),
            prior: ChainPrior { translation_bound_m: 0.006, rotation_bound_rad: 0.026 },
            switches_parameterization: false,
            chain,
            joints: vec![joint("yaw", -180.0, 180.0), joint("roll", -25.0, 25.0), joint("pitch", -120.0, 30.0)],
        }),
        ground_truth_topic: Some("/ground_truth/odometry".to_owned()),
    }
}

/// Points on the walls and the ground of the yard.
pub(super) fn yard_points() -> Vec<Vector3<f64>> {
    let mut random_numbers = RandomNumbers::new(11);
    let side = YARD_HALF_SIDE_M;
    (0..6000)
        .map(|index| {
            let (along, other) = (2.0 * random_numbers.unit() - 1.0, random_numbers.unit());
            match index % 5 {
                0 => Vector3::new(side * along, side * (2.0 * other - 1.0), 0.0),
                1 => Vector3::new(side, side * along, WALL_HEIGHT_M * other),
                2 => Vector3::new(-side, side * along, WALL_HEIGHT_M * other),
                3 => Vector3::new(side * along, side, WALL_HEIGHT_M * other),
                _ => Vector3::new(side * along, -side, WALL_HEIGHT_M * other),
            }
        })
        .collect()
}

pub(super) fn project(
    world_from_camera: &RigidTransform,
    point_in_world: &Vector3<f64>,
) -> Option<(Vector2<f64>, f64)> {
    let point = world_from_camera.inverse().transform(point_in_world);
    let [fx, fy, cx, cy] = INTRINSICS_PX;
    if point.z < 0.5 {
        return None;
    }
    let uv = Vector2::new(fx * point.x / point.z + cx, fy * point.y / point.z + cy);
    let inside =
        (6.0..RESOLUTION_PX[0] as f64 - 6.0).contains(&uv.x) && (6.0..RESOLUTION_PX[1] as f64 - 6.0).contains(&uv.y);
    inside.then_some((uv, point.z))
}

/// The point of a feature; its id is the point's index plus one.
pub(super) fn point_of(id: FeatureId, points: &[Vector3<f64>]) -> Vector3<f64> {
    points[id.0 as usize - 1]
}
