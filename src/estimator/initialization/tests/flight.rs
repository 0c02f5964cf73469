//! A synthetic flight: analytic motion, IMU samples, a camera on a rotating gimbal, landmarks and their tracks.

use nalgebra::{UnitQuaternion, Vector2, Vector3};

use crate::frontend::{FeatureId, TrackedFeature};
use crate::geometry::{RigidTransform, SplitMix64, so3};
use crate::sensors::{ImuNoise, ImuSample};

pub(super) const GRAVITY: f64 = 9.81;
pub(super) const FOCAL_PX: f64 = 352.0;
const FRAME_NS: i64 = 50_000_000;
const SAMPLE_NS: i64 = 5_000_000;

pub(super) struct Random(SplitMix64);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed.wrapping_mul(0x5851_f42d_4c95_7f2d) + 1))
    }

    pub(super) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.next_unit()
    }

    pub(super) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.uniform(1e-12, 1.0).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform(0.0, 1.0)).cos()
    }

    pub(super) fn vector(&mut self, bound: f64) -> Vector3<f64> {
        Vector3::new(self.uniform(-bound, bound), self.uniform(-bound, bound), self.uniform(-bound, bound))
    }

    pub(super) fn normal_vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.normal(), self.normal(), self.normal())
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    /// Near-hover, then aggressive motion.
    Flight,
    Hover,
    /// On the ground.
    Stationary,
    RotationOnly,
    /// A straight line at constant velocity, without rotation.
    ConstantVelocity,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct FlightOptions {
    pub(super) seed: u64,
    pub(super) motion: Motion,
    /// Start time of the motion.
    pub(super) hover_s: f64,
    pub(super) duration_s: f64,
    pub(super) gimbal: bool,
    /// True if encoders report the joint angles; they are zero otherwise.
    pub(super) encoders: bool,
    pub(super) encoder_sigma_rad: f64,
    pub(super) chain_rotation_bound_rad: f64,
    pub(super) chain_translation_bound_m: f64,
    pub(super) pixel_sigma: f64,
    pub(super) outlier_ratio: f64,
    pub(super) accelerometer_bias_bound: f64,
    pub(super) gyroscope_bias_bound: f64,
}

impl FlightOptions {
    pub(super) fn new(seed: u64, motion: Motion) -> Self {
        Self {
            seed,
            motion,
            hover_s: 2.0,
            duration_s: 7.0,
            gimbal: true,
            encoders: true,
            encoder_sigma_rad: 0.0087,
            chain_rotation_bound_rad: 0.0087,
            chain_translation_bound_m: 0.003,
            pixel_sigma: 0.5,
            outlier_ratio: 0.02,
            accelerometer_bias_bound: 0.5,
            gyroscope_bias_bound: 0.01,
        }
    }

    pub(super) fn rigid(mut self) -> Self {
        self.gimbal = false;
        self.encoder_sigma_rad = 0.0;
        self
    }
}

pub(super) fn noise() -> ImuNoise {
    ImuNoise {
        accelerometer_noise_density: 0.004,
        accelerometer_random_walk: 0.006,
        gyroscope_noise_density: 3.4e-4,
        gyroscope_random_walk: 3.9e-5,
    }
}

pub(super) struct Frame {
    pub(super) stamp_ns: i64,
    pub(super) features: Vec<TrackedFeature>,
    pub(super) imu: Vec<ImuSample>,
    pub(super) imu_from_camera: RigidTransform,
    pub(super) true_world_from_imu: RigidTransform,
    pub(super) true_velocity: Vector3<f64>,
    pub(super) true_imu_from_camera: RigidTransform,
}

pub(super) struct Flight {
    pub(super) frames: Vec<Frame>,
    pub(super) gyroscope_bias: Vector3<f64>,
    pub(super) accelerometer_bias: Vector3<f64>,
}

struct Path {
    motion: Motion,
    hover_s: f64,
    amplitudes: Vec<[Vector3<f64>; 2]>,
    mean_velocity: Vector3<f64>,
    yaw_rate: f64,
    yaw_amplitude: f64,
}

impl Path {
    fn new(options: &FlightOptions, random: &mut Random) -> Self {
        let amplitudes = (0..3)
            .map(|_| {
                let amplitude = random.vector(1.2).component_mul(&Vector3::new(1.0, 1.0, 0.5));
                let frequency =
                    Vector3::new(random.uniform(0.8, 1.8), random.uniform(0.8, 1.8), random.uniform(0.8, 1.6));
                [amplitude, frequency]
            })
            .collect();
        Self {
            motion: options.motion,
            hover_s: options.hover_s,
            amplitudes,
            mean_velocity: Vector3::new(random.uniform(0.5, 1.5), random.uniform(-1.0, 1.0), 0.0),
            yaw_rate: random.uniform(0.4, 0.9),
            yaw_amplitude: random.uniform(-0.8, 0.8),
        }
    }

    /// 0 before the motion, 1 after 1.5 s of it; smooth to the third derivative.
    fn envelope(&self, t: f64) -> f64 {
        let x = ((t - self.hover_s) / 1.5).clamp(0.0, 1.0);
        x.powi(4) * (35.0 - 84.0 * x + 70.0 * x * x - 20.0 * x.powi(3))
    }

    fn sway(&self, t: f64) -> Vector3<f64> {
        match self.motion {
            Motion::Stationary | Motion::ConstantVelocity => Vector3::zeros(),
            _ => Vector3::new(0.02 * (1.1 * t).sin(), 0.015 * (1.4 * t + 1.0).sin(), 0.01 * (0.9 * t + 2.0).sin()),
        }
    }

    fn position(&self, t: f64) -> Vector3<f64> {
        let mut position = Vector3::new(0.0, 0.0, 2.0) + self.sway(t);
        match self.motion {
            Motion::Flight => {
                let since = t - self.hover_s;
                let mut swing = self.mean_velocity * since;
                for [amplitude, frequency] in &self.amplitudes {
                    swing += amplitude.component_mul(&(frequency * since).map(f64::sin));
                }
                position += swing * self.envelope(t);
            }
            Motion::ConstantVelocity => position += Vector3::new(1.2, 0.7, 0.1) * t,
            _ => {}
        }
        position
    }

    /// Fourth-order differences: exact to about 1e-7 here.
    fn velocity(&self, t: f64) -> Vector3<f64> {
        let h = 1e-3;
        let p = |k: f64| self.position(t + k * h);
        (p(-2.0) - p(2.0) + (p(1.0) - p(-1.0)) * 8.0) / (12.0 * h)
    }

    fn acceleration(&self, t: f64) -> Vector3<f64> {
        let h = 2e-3;
        let p = |k: f64| self.position(t + k * h);
        (-p(-2.0) - p(2.0) + (p(1.0) + p(-1.0)) * 16.0 - p(0.0) * 30.0) / (12.0 * h * h)
    }

    /// Attitude of a multirotor: thrust along the acceleration minus gravity.
    fn rotation(&self, t: f64) -> UnitQuaternion<f64> {
        let envelope = self.envelope(t);
        let yaw = match self.motion {
            Motion::Stationary | Motion::ConstantVelocity => 0.3,
            _ => 0.3 + envelope * self.yaw_amplitude * (self.yaw_rate * (t - self.hover_s)).sin(),
        };
        let heading = UnitQuaternion::from_scaled_axis(Vector3::z() * yaw);
        let tilt = match self.motion {
            Motion::Stationary => so3::exp(&Vector3::new(0.05, -0.03, 0.0)),
            Motion::RotationOnly => {
                so3::exp(&(Vector3::new(0.3 * (1.3 * t).sin(), 0.25 * (1.7 * t).sin(), 0.0) * envelope))
            }
            _ => {
                let thrust = self.acceleration(t) + self.velocity(t) * 0.2 + Vector3::z() * GRAVITY;
                UnitQuaternion::rotation_between(&Vector3::z(), &thrust).unwrap()
            }
        };
        tilt * heading
    }

    fn angular_velocity(&self, t: f64) -> Vector3<f64> {
        let h = 1e-3;
        so3::log(&(self.rotation(t - h).inverse() * self.rotation(t + h))) / (2.0 * h)
    }

    fn pose(&self, t: f64) -> RigidTransform {
        RigidTransform::new(self.rotation(t), self.position(t))
    }
}

/// A yaw–roll–pitch gimbal with a forward-looking optical frame.
#[derive(Clone)]
struct TestGimbal {
    transforms: [RigidTransform; 4],
}

impl TestGimbal {
    fn nominal() -> Self {
        let shift = |x, y, z| RigidTransform::new(UnitQuaternion::identity(), Vector3::new(x, y, z));
        let optical = UnitQuaternion::from_basis_unchecked(&[-Vector3::y(), -Vector3::z(), Vector3::x()]);
        Self {
            transforms: [
                shift(0.09, 0.01, -0.06),
                shift(-0.02, 0.0, -0.04),
                shift(0.03, 0.02, 0.0),
                RigidTransform::new(optical, Vector3::new(0.02, -0.01, 0.01)),
            ],
        }
    }

    fn disturbed(&self, rotation_bound: f64, translation_bound: f64, random: &mut Random) -> Self {
        let mut transforms = self.transforms;
        for fixed_transform in &mut transforms {
            fixed_transform.rotation *= so3::exp(&random.vector(rotation_bound));
            fixed_transform.translation_m += random.vector(translation_bound);
        }
        Self { transforms }
    }

    fn imu_from_camera(&self, angles: &Vector3<f64>) -> RigidTransform {
        let axes = [Vector3::z(), Vector3::x(), Vector3::y()];
        let mut pose = self.transforms[0];
        for joint in 0..3 {
            let joint_rotation = RigidTransform::new(so3::exp(&(axes[joint] * angles[joint])), Vector3::zeros());
            pose = pose * joint_rotation * self.transforms[joint + 1];
        }
        pose
    }
}

fn joint_angles(options: &FlightOptions, path: &Path, t: f64) -> Vector3<f64> {
    if !options.gimbal {
        return Vector3::new(0.1, 0.0, 0.15);
    }
    // Roll counteracts the body's tilt; yaw and pitch scan.
    let up = path.rotation(t).inverse() * Vector3::z();
    let roll = up.y.atan2(up.z).clamp(-0.43, 0.43);
    Vector3::new(0.5 * (0.9 * t + 0.4).sin(), roll, 0.2 + 0.25 * (1.1 * t).sin())
}

#[derive(Clone, Copy)]
struct LiveTrack {
    id: FeatureId,
    landmark: usize,
    /// Drift of an outlier, in pixels per frame.
    drift_px: Vector2<f64>,
    offset_px: Vector2<f64>,
    age: u32,
}

struct Tracker {
    landmarks: Vec<Vector3<f64>>,
    live: Vec<LiveTrack>,
    next_id: u64,
}

impl Tracker {
    fn new(random: &mut Random) -> Self {
        let landmarks = (0..4000)
            .map(|_| {
                let (radius, angle) = (random.uniform(5.0, 25.0), random.uniform(0.0, std::f64::consts::TAU));
                Vector3::new(radius * angle.cos(), radius * angle.sin(), random.uniform(-3.0, 6.0))
            })
            .collect();
        Self { landmarks, live: Vec::new(), next_id: 0 }
    }

    fn pixel(&self, landmark: usize, camera_from_world: &RigidTransform) -> Option<Vector2<f64>> {
        let point = camera_from_world.transform(&self.landmarks[landmark]);
        let uv = Vector2::new(point.x, point.y) / point.z * FOCAL_PX;
        (point.z > 1.0 && uv.x.abs() < 320.0 && uv.y.abs() < 240.0).then_some(uv)
    }

    fn track(
        &mut self,
        world_from_camera: &RigidTransform,
        options: &FlightOptions,
        random: &mut Random,
    ) -> Vec<TrackedFeature> {
        let camera_from_world = world_from_camera.inverse();
        let mut live = std::mem::take(&mut self.live);
        live.retain(|track| {
            self.pixel(track.landmark, &camera_from_world).is_some() && random.uniform(0.0, 1.0) > 0.01
        });
        while live.len() < 110 {
            let landmark = (random.uniform(0.0, 1.0) * self.landmarks.len() as f64) as usize % self.landmarks.len();
            if self.pixel(landmark, &camera_from_world).is_some() {
                let outlier = random.uniform(0.0, 1.0) < options.outlier_ratio;
                let drift_px =
                    if outlier { Vector2::new(random.normal(), random.normal()) * 3.0 } else { Vector2::zeros() };
                let id = FeatureId(self.next_id);
                live.push(LiveTrack { id, landmark, drift_px, offset_px: Vector2::zeros(), age: 0 });
                self.next_id += 1;
            }
        }
        let mut features = Vec::new();
        for track in &mut live {
            let Some(uv) = self.pixel(track.landmark, &camera_from_world) else { continue };
            let noise = Vector2::new(random.normal(), random.normal()) * options.pixel_sigma;
            let uv = uv + track.offset_px + noise;
            let bearing = Vector3::new(uv.x / FOCAL_PX, uv.y / FOCAL_PX, 1.0).normalize();
            features.push(TrackedFeature { id: track.id, age: track.age, uv_px: uv, previous_uv_px: None, bearing });
            track.offset_px += track.drift_px;
            track.age += 1;
        }
        features.sort_by_key(|feature| feature.id);
        self.live = live;
        features
    }
}

pub(super) fn simulate_flight(options: &FlightOptions) -> Flight {
    let mut random = Random::new(options.seed);
    let path = Path::new(options, &mut random);
    let gimbal = TestGimbal::nominal();
    let given = gimbal.disturbed(options.chain_rotation_bound_rad, options.chain_translation_bound_m, &mut random);
    let mut tracker = Tracker::new(&mut random);
    let gyroscope_bias = random.vector(options.gyroscope_bias_bound);
    let accelerometer_bias = random.vector(options.accelerometer_bias_bound);
    let imu_noise = noise();
    let rate = (1e9 / SAMPLE_NS as f64).sqrt();
    let sample = |stamp_ns: i64, random: &mut Random| {
        let t = stamp_ns as f64 * 1e-9;
        let rotation = path.rotation(t);
        ImuSample {
            stamp_ns,
            angular_velocity_rad_per_s: path.angular_velocity(t)
                + gyroscope_bias
                + random.normal_vector() * (imu_noise.gyroscope_noise_density * rate),
            specific_force_m_per_s2: rotation.inverse() * (path.acceleration(t) + Vector3::z() * GRAVITY)
                + accelerometer_bias
                + random.normal_vector() * (imu_noise.accelerometer_noise_density * rate),
            unmeasured_s: 0.0,
        }
    };
    let mut frames: Vec<Frame> = Vec::new();
    let mut stamp_ns = 0;
    while stamp_ns as f64 * 1e-9 <= options.duration_s {
        let t = stamp_ns as f64 * 1e-9;
        let mut imu: Vec<ImuSample> = Vec::new();
        if let Some(previous) = frames.last() {
            imu.extend(previous.imu.last().copied().or_else(|| Some(sample(previous.stamp_ns, &mut random))));
            for step in 1..=FRAME_NS / SAMPLE_NS {
                imu.push(sample(previous.stamp_ns + step * SAMPLE_NS, &mut random));
            }
        }
        let angles = joint_angles(options, &path, t);
        let readings = if options.encoders { angles } else { Vector3::zeros() }
            + random.normal_vector() * options.encoder_sigma_rad;
        let true_imu_from_camera = gimbal.imu_from_camera(&angles);
        let true_world_from_imu = path.pose(t);
        let features = tracker.track(&(true_world_from_imu * true_imu_from_camera), options, &mut random);
        frames.push(Frame {
            stamp_ns,
            features,
            imu,
            imu_from_camera: given.imu_from_camera(&readings),
            true_world_from_imu,
            true_velocity: path.velocity(t),
            true_imu_from_camera,
        });
        stamp_ns += FRAME_NS;
    }
    Flight { frames, gyroscope_bias, accelerometer_bias }
}
