//! Rig of the firefly: the true one, and the given one with errors.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::gimbal::{joints, true_chain};
use super::imu::FIREFLY_IMU;
use super::random::RandomStream;
use crate::camera::{CameraModel, Distortion, Projection};
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::ClassicalChain;
use crate::sensors::{
    CameraMount, CameraRig, ChainPrior, GimbalImuRig, GimbalRig, ImuIntrinsics, ImuIntrinsicsParameters, ImuRig,
    RequiredAccuracy, Rig, ScaleMisalignment,
};
use crate::text::Named;

/// Gravity in the simulated worlds, in m/s².
pub const GRAVITY_M_PER_S2: f64 = 9.81;
/// Rate of the IMU and of the encoders.
pub(crate) const IMU_RATE_HZ: f64 = 200.0;
/// Topic of the ground truth.
pub const GROUND_TRUTH_TOPIC: &str = "/ground_truth/odometry";
/// Topic of the encoders.
pub const JOINT_TOPIC: &str = "/gimbal/joint_states";
/// Image size of the intrinsics below.
const NOMINAL_SIZE_PX: [usize; 2] = [640, 480];

/// Lens of the simulated cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lens {
    /// Pinhole projection without distortion.
    Pinhole,
    /// Mild barrel distortion, radial–tangential.
    Radtan,
}

impl Named for Lens {
    const NAMES: &'static [(Self, &'static str)] = &[(Self::Pinhole, "pinhole"), (Self::Radtan, "radtan")];
}

/// Focal lengths and principal points at [`NOMINAL_SIZE_PX`], by camera: on the gimbal, static, the right one of a stereo
/// pair, thermal.
const INTRINSICS_PX: [[f64; 4]; 4] = [
    [361.4, 360.9, 318.6, 241.8],
    [357.8, 358.3, 322.7, 237.4],
    [359.3, 359.6, 317.9, 243.2],
    [527.4, 527.9, 321.2, 238.7],
];

/// Camera model at this image size; `which` is the index in `INTRINSICS_PX`.
pub fn camera_model(which: usize, lens: Lens, resolution_px: [usize; 2]) -> CameraModel {
    let [fx, fy, cx, cy] = INTRINSICS_PX[which];
    let distortion = match (lens, which) {
        (Lens::Pinhole, _) => Distortion::None,
        (Lens::Radtan, 0) => Distortion::Radtan([-0.112, 0.028, 0.0005, -0.0003]),
        (Lens::Radtan, 1) => Distortion::Radtan([-0.124, 0.034, -0.0004, 0.0006]),
        (Lens::Radtan, _) => Distortion::Radtan([-0.118, 0.031, 0.0003, 0.0002]),
    };
    let scale = |axis: usize| resolution_px[axis] as f64 / NOMINAL_SIZE_PX[axis] as f64;
    // Pixel centres lie at integers, so the image's corner lies at −0.5.
    let centre = |c: f64, axis: usize| (c + 0.5) * scale(axis) - 0.5;
    CameraModel {
        projection: Projection::Pinhole,
        distortion,
        intrinsics_px: [fx * scale(0), fy * scale(1), centre(cx, 0), centre(cy, 1)],
        resolution_px,
    }
}

/// Contents of a rig.
#[derive(Clone, Copy, Debug)]
pub struct Equipment {
    pub gimbal_camera: bool,
    pub static_camera: bool,
    /// Distance of a second static camera to the right of the static one, in metres; `None` without one.
    pub stereo_baseline_m: Option<f64>,
    /// True for a second camera on the gimbal.
    pub second_gimbal_camera: bool,
    pub lens: Lens,
    pub resolution_px: [usize; 2],
    pub camera_rate_hz: f64,
    pub static_camera_rate_hz: f64,
    pub camera_time_offset_s: f64,
    pub readout_s: f64,
    pub encoder_sigma_rad: Option<f64>,
    /// True for an IMU on the gimbal.
    pub gimbal_imu: bool,
}

impl Equipment {
    /// True rig; the manufacturing errors of its chain are drawn from a random stream.
    pub fn true_rig(&self, name: &str, random: &mut RandomStream) -> Rig {
        let chain = true_chain(random);
        let static_extrinsics = static_extrinsics(random);
        let right = self.stereo_baseline_m.map(|baseline_m| beside(Vector3::x() * baseline_m, random));
        let thermal = self.second_gimbal_camera.then(|| beside(Vector3::new(0.0, 0.06, 0.004), random));
        let mut cameras = Vec::new();
        let of_imu = |imu_from_camera: RigidTransform| CameraMount::Static { imu_from_camera };
        let kinds = [
            (self.gimbal_camera, "gimbal_camera", CameraMount::Gimbal, None),
            (self.static_camera, "static_camera", of_imu(static_extrinsics), None),
            (self.static_camera && right.is_some(), "static_camera_right", of_imu(static_extrinsics), right),
            (self.gimbal_camera && thermal.is_some(), "thermal_camera", CameraMount::Gimbal, thermal),
        ];
        for (which, (wanted, camera, mount, beside)) in kinds.into_iter().enumerate() {
            let relative = beside.unwrap_or_else(RigidTransform::identity);
            if wanted {
                let on_gimbal = mount == CameraMount::Gimbal;
                cameras.push(CameraRig {
                    key: format!("cam{}", cameras.len()),
                    first_from_camera: if on_gimbal { relative } else { RigidTransform::identity() },
                    relative_prior: beside.map(|_| ChainPrior::RELATIVE),
                    mount: match mount {
                        CameraMount::Static { imu_from_camera } => of_imu(imu_from_camera * relative),
                        CameraMount::Gimbal => CameraMount::Gimbal,
                    },
                    topic: format!("/{camera}/image_raw/compressed"),
                    use_log_time: false,
                    frame_id: camera.to_owned(),
                    rate_hz: if on_gimbal { self.camera_rate_hz } else { self.static_camera_rate_hz },
                    model: camera_model(which, self.lens, self.resolution_px),
                    timeshift_cam_imu_s: self.camera_time_offset_s,
                    readout_s: self.readout_s,
                    readout_sigma_s: None,
                    intrinsics_sigma: None,
                    mask: None,
                });
            }
        }
        let gimbal = self.gimbal_camera.then(|| GimbalRig {
            topic: self.encoder_sigma_rad.map(|_| JOINT_TOPIC.to_owned()),
            attitude: None,
            use_log_time: false,
            timeshift_gimbal_imu_s: 0.0,
            rate_hz: IMU_RATE_HZ,
            encoder_sigma_rad: self.encoder_sigma_rad,
            prior: ChainPrior { translation_bound_m: 0.0, rotation_bound_rad: 0.0 },
            switches_parameterization: false,
            chain,
            joints: joints(),
        });
        Rig {
            name: name.to_owned(),
            gravity_m_per_s2: GRAVITY_M_PER_S2,
            imu: ImuRig {
                topic: "/imu".to_owned(),
                accelerometer_topic: None,
                use_log_time: false,
                frame_id: "imu".to_owned(),
                rate_hz: IMU_RATE_HZ,
                noise: FIREFLY_IMU,
                intrinsics: ImuIntrinsics::default(),
            },
            gimbal_imu: (self.gimbal_camera && self.gimbal_imu).then(gimbal_imu),
            cameras,
            gimbal,
            ground_truth_topic: Some(GROUND_TRUTH_TOPIC.to_owned()),
            ground_truth_use_log_time: false,
            ground_truth_lever_arm: None,
            required_accuracy: RequiredAccuracy::default(),
            assumed: Vec::new(),
        }
    }
}

/// IMU in the housing of the gimbal's camera, of the same quality as the vehicle's, so that a comparison does not depend
/// on a better sensor: x forward, y left, z up in the camera, 2 cm behind the lens.
fn gimbal_imu() -> GimbalImuRig {
    let axes = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
    let axes = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    let tilt = so3::exp(&Vector3::new(0.011, -0.018, 0.014));
    GimbalImuRig {
        sensor: ImuRig {
            topic: "/gimbal/imu".to_owned(),
            accelerometer_topic: None,
            use_log_time: false,
            frame_id: "gimbal_imu".to_owned(),
            rate_hz: IMU_RATE_HZ,
            noise: FIREFLY_IMU,
            intrinsics: ImuIntrinsics::default(),
        },
        camera_from_imu: RigidTransform::new(axes * tilt, Vector3::new(-0.012, 0.009, -0.021)),
        timeshift_s: 0.0,
    }
}

/// Extrinsics of a static camera under the nose that looks forward and 12° down, with random errors of two degrees.
fn static_extrinsics(random: &mut RandomStream) -> RigidTransform {
    let optical = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let optical = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(optical));
    let down = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 12_f64.to_radians());
    let tilt = random.normal_vector(0.02);
    let shift = random.normal_vector(0.004);
    RigidTransform::new(down * optical * so3::exp(&tilt), Vector3::new(0.105, 0.003, 0.022) + shift)
}

/// Pose of a camera `offset_m` beside another one in the frame of that one, with random errors of half a degree.
fn beside(offset_m: Vector3<f64>, random: &mut RandomStream) -> RigidTransform {
    RigidTransform::new(so3::exp(&random.normal_vector(0.005)), offset_m + random.normal_vector(0.0005))
}

/// Rig given to an estimator: each of the chain's `4N + 6` independent parameters (the parameters of the minimal
/// parameterization) has a uniform error within `bounds`, as at the start of the paper's experiments; static cameras
/// have errors within the same bounds, but of at most 3 mm and 0.5° per axis. A camera beside another one has errors within
/// its prior relative to that one. The cameras' time offset and readout are absent.
pub(crate) fn given_rig(ground_truth: &Rig, bounds: ChainPrior, random: &mut RandomStream) -> Rig {
    let mut given = ground_truth.clone();
    if let Some(gimbal) = &mut given.gimbal {
        gimbal.chain = wrong_chain(&gimbal.chain, bounds, random);
        gimbal.prior = bounds;
    }
    let rotation_bound = bounds.rotation_bound_rad.min(0.5_f64.to_radians());
    let shift = bounds.translation_bound_m.min(0.003);
    for camera in &mut given.cameras {
        camera.timeshift_cam_imu_s = 0.0;
        camera.readout_s = 0.0;
        if camera.relative_prior.is_some() {
            continue;
        }
        if let CameraMount::Static { imu_from_camera } = &mut camera.mount {
            let phi = Vector3::from_fn(|_, _| random.uniform(-rotation_bound, rotation_bound));
            imu_from_camera.rotation *= so3::exp(&phi);
            imu_from_camera.translation_m += Vector3::from_fn(|_, _| random.uniform(-shift, shift));
        }
    }
    for camera in &ground_truth.cameras {
        let (Some(prior), Some(base)) = (camera.relative_prior, ground_truth.base_of(camera)) else { continue };
        let Some(mut pose) = ground_truth.base_from_camera(Some(&base.key), &camera.key) else { continue };
        let [rotation_bound, shift] = [bounds.rotation_bound_rad, bounds.translation_bound_m];
        let (rotation_bound, shift) =
            (rotation_bound.min(prior.rotation_bound_rad), shift.min(prior.translation_bound_m));
        let phi = Vector3::from_fn(|_, _| random.uniform(-rotation_bound, rotation_bound));
        pose.rotation *= so3::exp(&phi);
        pose.translation_m += Vector3::from_fn(|_, _| random.uniform(-shift, shift));
        given.set_base_from_camera(Some(&base.key), &camera.key, pose);
    }
    given
}

/// Random scales and axes of an IMU: normal errors with these standard deviations, limited to twice them. `angle_rad`
/// applies to misalignments and to the rotation between gyroscope and accelerometer.
pub(crate) fn random_imu_intrinsics(scale: f64, angle_rad: f64, random: &mut RandomStream) -> ImuIntrinsics {
    let mut errors = |sigma: f64| Vector3::from_fn(|_, _| sigma * random.normal().clamp(-2.0, 2.0));
    let mut sensor = || ScaleMisalignment { scale: errors(scale), misalignment: errors(angle_rad) };
    let (gyroscope, accelerometer) = (sensor(), sensor());
    let gyroscope_rotation_rad = errors(angle_rad);
    ImuIntrinsics::from_parameters(&ImuIntrinsicsParameters { gyroscope, gyroscope_rotation_rad, accelerometer })
}

/// Adds a uniform error to the independent parameters: two rotations and two translations of the base, all of
/// each link, a rotation about and a translation along the end's y axis.
fn wrong_chain(chain: &ClassicalChain, bounds: ChainPrior, random: &mut RandomStream) -> ClassicalChain {
    let mut wrong = chain.clone();
    if chain.links.is_empty() {
        let rotation_bound = bounds.rotation_bound_rad;
        let phi = Vector3::from_fn(|_, _| random.uniform(-rotation_bound, rotation_bound));
        wrong.imu_from_base.rotation *= so3::exp(&phi);
        return wrong;
    }
    let mut rotation_bound = RandomStream::new(random.next_u64(), 0);
    let mut angle = || rotation_bound.uniform(-bounds.rotation_bound_rad, bounds.rotation_bound_rad);
    let mut length = || random.uniform(-bounds.translation_bound_m, bounds.translation_bound_m);
    let tilt = Vector3::new(angle(), angle(), 0.0);
    let aside = Vector3::new(length(), length(), 0.0);
    wrong.imu_from_base.rotation *= so3::exp(&tilt);
    wrong.imu_from_base.translation_m += aside;
    for link in &mut wrong.links {
        link.theta_offset_rad += angle();
        link.alpha_rad += angle();
        link.d_m += length();
        link.a_m += length();
    }
    let end_turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle());
    let end_shift = Vector3::new(0.0, length(), 0.0);
    let end = &mut wrong.effector_from_camera;
    *end = RigidTransform::new(end_turn * end.rotation, end.translation_m + end_shift);
    wrong
}
