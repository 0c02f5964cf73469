//! Flights without images: ideal feature tracks with noise, for fast tests of an estimator against ground truth.

use std::collections::BTreeMap;

use nalgebra::{Vector2, Vector3};

use super::equipment::{Equipment, Lens};
use super::exercise::Exercise;
use super::experiment::Experiment;
use super::gimbal::{JointMotion, LookAround};
use super::imu::SimulatedBias;
use super::random::RandomStream;
use super::route::{Drill, Flight, Manoeuvres, Station};
use super::scenario::{Scenario, ScenarioOptions, gravity_m_per_s2, stream};
use super::trajectory::{Trajectory, VehicleLimits};
use crate::camera::CameraModel;
use crate::faults::LensChange;
use crate::frontend::{FeatureId, FrontEndStatistics, TrackedFeature, TrackedFrame};
use crate::geometry::{RigidTransform, median, ns_from_seconds};
use crate::sensors::{ChainPrior, ImuSample, JointAngles, JointMotionFit, Rig};

/// Carrier of the camera of a synthetic flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SyntheticMount {
    /// The three-joint gimbal, `cam0` with `mount: gimbal`.
    Gimbal,
    /// The vehicle; the rig has no gimbal.
    Static,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SyntheticMotion {
    /// Aggressive from the first frame on.
    Aggressive,
    /// Two seconds of hover with centimetres of sway, then aggressive.
    HoverThenAggressive,
    /// Two seconds without any motion, then aggressive.
    StationaryThenAggressive,
    /// Hover with centimetres of sway throughout: the calibration stays unobservable.
    Hover,
}

#[derive(Clone, Debug, PartialEq)]
pub struct SyntheticOptions {
    pub mount: SyntheticMount,
    pub motion: SyntheticMotion,
    /// Seed of all random numbers.
    pub seed: u64,
    pub duration_s: f64,
    pub frame_rate_hz: f64,
    /// Time by which all images are later.
    pub phase_s: f64,
    /// Noise of a feature's pixel, per axis.
    pub pixel_sigma_px: f64,
    /// Ratio of features whose tracks drift away from their landmark.
    pub outlier_ratio: f64,
    /// Maximum number of features in a frame.
    pub features: usize,
    /// Factor of noise, bias random walk and turn-on bias of the IMU; 0 makes it ideal.
    pub imu_noise_scale: f64,
    /// True for a camera beside the one of `mount`, `cam1` of the rigs: the right one of a stereo pair, or a second one on the
    /// gimbal.
    pub beside: bool,
    /// Standard deviation of the encoders; `None` without encoders.
    pub encoder_sigma_rad: Option<f64>,
    /// True for an IMU on the gimbal, with the noise scale of the vehicle's.
    pub gimbal_imu: bool,
    /// Delays of the camera's exposures and of the encoder readings after their stamps, in seconds.
    pub clock_offsets_s: [f64; 2],
    /// Readout of the camera: each landmark is observed at the time of its row. Absent from the given rig.
    pub readout_s: f64,
    /// Intrinsics of the given rig relative to the true ones; bearings are computed with the given camera.
    pub intrinsics_error: LensChange,
    /// Standard deviations of the errors of the IMU's scales, and of its angles in radians (misalignment, rotation
    /// between the sensors). Absent from the given rig; zeros for an ideal IMU.
    pub imu_intrinsics_error: [f64; 2],
    /// First-order Gauss–Markov error of each axis of the accelerometer: standard deviation in m/s², time constant in
    /// seconds.
    pub accelerometer_drift: Option<[f64; 2]>,
    /// Errors of the given rig's chain.
    pub start_error: ChainPrior,
    /// Amplitude of the gimbal's yaw, in radians (pitch 0.4 and roll 0.15 of it); with 0 it only stabilizes.
    pub look_around_rad: f64,
    pub lens: Lens,
    /// Replaces the motion: one position with a warm-up until this time in seconds, then the exercise.
    pub exercise: Option<(f64, Exercise)>,
}

impl Default for SyntheticOptions {
    fn default() -> Self {
        Self {
            mount: SyntheticMount::Gimbal,
            motion: SyntheticMotion::HoverThenAggressive,
            seed: 1,
            duration_s: 20.0,
            frame_rate_hz: 20.0,
            phase_s: 0.0,
            pixel_sigma_px: 0.3,
            outlier_ratio: 0.0,
            features: 150,
            imu_noise_scale: 1.0,
            beside: false,
            encoder_sigma_rad: Some(0.5_f64.to_radians()),
            gimbal_imu: false,
            clock_offsets_s: [0.0; 2],
            readout_s: 0.0,
            intrinsics_error: LensChange::NONE,
            imu_intrinsics_error: [0.0; 2],
            accelerometer_drift: None,
            start_error: Experiment::T1.start_error(),
            look_around_rad: 0.5,
            lens: Lens::Pinhole,
            exercise: None,
        }
    }
}

/// One frame: input of the estimator and ground truth.
#[derive(Clone, Debug, PartialEq)]
pub struct SyntheticFrame {
    pub index: usize,
    /// Stamp since the start of the flight.
    pub stamp_ns: i64,
    /// IMU samples from the previous frame's stamp to this one's, both ends included and interpolated; for the first
    /// frame, samples since the start of the flight.
    pub imu: Vec<ImuSample>,
    /// Samples of the IMU on the gimbal over the same interval; empty without one.
    pub gimbal_imu: Vec<ImuSample>,
    /// Encoder angles; `None` without encoders.
    pub joint_angles_rad: Option<Vec<f64>>,
    pub tracks: TrackedFrame,
    /// True pose of the IMU in the world.
    pub true_world_from_imu: RigidTransform,
    /// True velocity in the world.
    pub true_velocity_m_per_s: Vector3<f64>,
    pub true_bias: SimulatedBias,
    /// True joint angles; empty for a rigid camera.
    pub true_joint_angles_rad: Vec<f64>,
    /// True rates of the joints in rad/s; empty for a rigid camera.
    pub true_joint_rates_rad_per_s: Vec<f64>,
    /// True pose of the camera in the world at the exposure of the first row.
    pub true_world_from_camera: RigidTransform,
}

impl SyntheticFrame {
    /// Encoder readings as input of an estimator, white with a standard deviation of `sigma_rad`; `None` without
    /// encoders.
    pub fn encoder_angles(&self, sigma_rad: f64) -> Option<JointAngles> {
        let angles_rad = self.joint_angles_rad.clone()?;
        let count = angles_rad.len();
        Some(JointAngles {
            angles_rad,
            sigmas_rad: vec![sigma_rad; count],
            lasting_sigmas_rad: vec![0.0; count],
            rates_rad_per_s: self.true_joint_rates_rad_per_s.clone(),
            motion_fits: vec![JointMotionFit::UNKNOWN; count],
        })
    }
}

#[derive(Clone, Debug)]
pub struct SyntheticFlight {
    /// Frames in time order.
    pub frames: Vec<SyntheticFrame>,
    /// Rig given to the estimator; its camera is `cam0`, or `cam1` with [`SyntheticOptions::beside`].
    pub given_rig: Rig,
    pub true_rig: Rig,
    /// True positions of the tracked landmarks.
    pub landmarks: BTreeMap<FeatureId, Vector3<f64>>,
}

/// Baseline of a stereo pair.
const STEREO_BASELINE_M: f64 = 0.12;
/// Stamp of the first frame.
const FIRST_FRAME_S: f64 = 0.003;
/// Half the interval of the central difference that gives the rate of a joint.
const RATE_STEP_S: f64 = 0.005;

/// Simulates a flight and its feature tracks.
pub fn synthetic_tracks(options: &SyntheticOptions) -> SyntheticFlight {
    let gimbal = options.mount == SyntheticMount::Gimbal;
    let equipment = Equipment {
        gimbal_camera: gimbal,
        static_camera: !gimbal,
        stereo_baseline_m: options.beside.then_some(STEREO_BASELINE_M),
        second_gimbal_camera: options.beside,
        lens: options.lens,
        resolution_px: [640, 480],
        camera_rate_hz: options.frame_rate_hz,
        static_camera_rate_hz: options.frame_rate_hz,
        camera_time_offset_s: 0.0,
        readout_s: options.readout_s,
        encoder_sigma_rad: options.encoder_sigma_rad,
        gimbal_imu: options.gimbal_imu,
    };
    let swing_deg = options.look_around_rad.to_degrees();
    let look = LookAround::new(
        [0.0, swing_deg],
        [-5.0, 0.4 * swing_deg],
        0.15 * swing_deg,
        &mut RandomStream::new(options.seed, stream::LOOK),
    );
    let mut scenario = Scenario::new(
        trajectory(options),
        |trajectory, gimbal| JointMotion::stabilized(trajectory, gimbal, &look),
        ScenarioOptions {
            seed: options.seed,
            true_rig: equipment.true_rig("synthetic", &mut RandomStream::new(options.seed, stream::RIG)),
            start_error: options.start_error,
            imu_noise_scale: options.imu_noise_scale,
        },
    );
    if let (Some((start_s, exercise)), Some(motion), Some(gimbal)) =
        (&options.exercise, &mut scenario.joints, &scenario.true_rig.gimbal)
    {
        motion.exercise_from(*start_s, exercise, &gimbal.joints);
    }
    scenario.measure_gimbal_imu(options.imu_noise_scale);
    spoil(&mut scenario, options);
    let gimbal_imu = scenario.gimbal_imu_record.as_ref();
    let index = usize::from(options.beside);
    let camera = &scenario.true_rig.cameras[index];
    let mut encoders = RandomStream::new(options.seed, stream::ENCODERS);
    let mut tracker = Tracker::new(camera.model.clone(), scenario.given_rig.cameras[index].model.clone(), options);
    let first_s = FIRST_FRAME_S + options.phase_s;
    let count = ((options.duration_s - first_s) * options.frame_rate_hz).floor().max(0.0) as usize + 1;
    let mut frames = Vec::with_capacity(count);
    let mut previous_ns = 0;
    for index in 0..count {
        let time_s = first_s + index as f64 / options.frame_rate_hz;
        let stamp_ns = ns_from_seconds(time_s);
        let ground_truth = scenario.trajectory.at(time_s);
        let [camera_offset_s, encoder_offset_s] = options.clock_offsets_s;
        let true_world_from_camera = scenario.world_from_camera(camera, time_s + camera_offset_s);
        let world_from_camera = |row_px: f64| match camera.row_time_s(row_px) {
            0.0 => true_world_from_camera,
            row_s => scenario.world_from_camera(camera, time_s + camera_offset_s + row_s),
        };
        let joint_angles_rad = |time_s: f64| scenario.joint_angles_rad(time_s).unwrap_or_default();
        let true_joint_angles_rad = joint_angles_rad(time_s);
        let (before, after) = (joint_angles_rad(time_s - RATE_STEP_S), joint_angles_rad(time_s + RATE_STEP_S));
        let true_joint_rates_rad_per_s =
            before.iter().zip(&after).map(|(before, after)| (after - before) / (2.0 * RATE_STEP_S)).collect();
        let read_angles_rad = options.encoder_sigma_rad.filter(|_| gimbal).map(|sigma| {
            let read = joint_angles_rad(time_s + encoder_offset_s);
            read.iter().map(|angle| angle + sigma * encoders.normal()).collect()
        });
        frames.push(SyntheticFrame {
            index,
            stamp_ns,
            imu: scenario.imu_record.between(previous_ns, stamp_ns),
            gimbal_imu: gimbal_imu.map_or_else(Vec::new, |record| record.between(previous_ns, stamp_ns)),
            joint_angles_rad: read_angles_rad,
            tracks: tracker.track(stamp_ns, &world_from_camera),
            true_world_from_imu: ground_truth.world_from_imu,
            true_velocity_m_per_s: ground_truth.velocity_m_per_s,
            true_bias: scenario.imu_record.bias_at(stamp_ns),
            true_joint_angles_rad,
            true_joint_rates_rad_per_s,
            true_world_from_camera,
        });
        previous_ns = stamp_ns;
    }
    SyntheticFlight { frames, given_rig: scenario.given_rig, true_rig: scenario.true_rig, landmarks: tracker.landmarks }
}

/// Applies the errors of the options to the IMU and the given rig.
fn spoil(scenario: &mut Scenario, options: &SyntheticOptions) {
    if let Some([sigma_m_per_s2, time_constant_s]) = options.accelerometer_drift {
        let mut random = RandomStream::new(options.seed, stream::ACCELEROMETER_DRIFT);
        scenario.imu_record.drift(sigma_m_per_s2, time_constant_s, &mut random);
    }
    if options.imu_intrinsics_error != [0.0; 2] {
        let mut random = RandomStream::new(options.seed, stream::IMU_INTRINSICS);
        scenario.miscalibrate_imu(options.imu_intrinsics_error, &mut random);
    }
    scenario.spoil_intrinsics(&options.intrinsics_error);
}

/// Flight around the house of T1, or at one position.
fn trajectory(options: &SyntheticOptions) -> Trajectory {
    let mut route = RandomStream::new(options.seed, stream::ROUTE);
    let pace = match options.motion {
        SyntheticMotion::Aggressive => Manoeuvres { hover_s: -30.0, ..Manoeuvres::aggressive() },
        SyntheticMotion::HoverThenAggressive => Manoeuvres::aggressive(),
        SyntheticMotion::StationaryThenAggressive => {
            Manoeuvres { hover_s: 4.0, sway_m: 0.0, ..Manoeuvres::aggressive() }
        }
        SyntheticMotion::Hover => Manoeuvres { hover_s: 1e6, ..Manoeuvres::aggressive() },
    };
    let station_m = Vector3::new(0.0, -12.0, 2.5);
    let flight: Box<dyn Flight> = if let Some((start_s, exercise)) = options.exercise {
        Box::new(Drill { position_m: station_m, heading_rad: 1.0, start_s, exercise })
    } else if options.motion == SyntheticMotion::Hover {
        Box::new(Station { pace, position_m: station_m, heading_rad: 1.0 })
    } else {
        Experiment::T1.flight_at(pace, 0.0, &mut route)
    };
    Trajectory::new(
        flight.as_ref(),
        &mut RandomStream::new(options.seed, stream::MANOEUVRES),
        &VehicleLimits::default(),
        options.duration_s,
        gravity_m_per_s2(),
    )
}

/// A feature on its way through the frames.
struct SyntheticTrack {
    id: FeatureId,
    age: u32,
    landmark_m: Vector3<f64>,
    uv_px: Vector2<f64>,
    slip_px: Option<Vector2<f64>>,
    remaining: u32,
}

/// Ideal front end with known correspondences.
struct Tracker {
    model: CameraModel,
    /// Camera model given to the estimator, which defines the bearings.
    given: CameraModel,
    random: RandomStream,
    pixel_sigma_px: f64,
    outlier_ratio: f64,
    features: usize,
    tracks: Vec<SyntheticTrack>,
    landmarks: BTreeMap<FeatureId, Vector3<f64>>,
    next_id: u64,
    before: Option<RigidTransform>,
}

/// Minimum distance of a new feature from all others.
const SPACING_PX: f64 = 22.0;
/// Distance from the border at which features end.
const BORDER_PX: f64 = 6.0;
/// Maximum number of iterations for the row in which a landmark is observed.
const MOST_ROW_STEPS: usize = 12;
/// Change of the row at which the iterations end.
const ROW_TOLERANCE_PX: f64 = 1e-9;
/// Mean duration of a track that stays in the image, in frames.
const LIFE_FRAMES: f64 = 60.0;
/// Nearest and farthest landmark at its first observation.
const DEPTH_M: [f64; 2] = [2.5, 20.0];

impl Tracker {
    fn new(model: CameraModel, given: CameraModel, options: &SyntheticOptions) -> Self {
        Self {
            model,
            given,
            random: RandomStream::new(options.seed, stream::FEATURES),
            pixel_sigma_px: options.pixel_sigma_px,
            outlier_ratio: options.outlier_ratio,
            features: options.features,
            tracks: Vec::new(),
            landmarks: BTreeMap::new(),
            next_id: 0,
            before: None,
        }
    }

    /// Tracks a frame of a camera whose rows have these poses.
    fn track(&mut self, stamp_ns: i64, world_from_camera: &dyn Fn(f64) -> RigidTransform) -> TrackedFrame {
        let before = self.tracks.len();
        let mut features = Vec::with_capacity(self.features);
        self.follow(world_from_camera, &mut features);
        let tracked = features.len();
        let mut statistics = FrontEndStatistics { tracked, lost: before - tracked, ..Default::default() };
        let first_row = world_from_camera(0.0);
        self.measure_motion(&first_row, &features, &mut statistics);
        self.find(world_from_camera, &mut features);
        statistics.detected = features.len() - tracked;
        self.before = Some(first_row);
        TrackedFrame { stamp_ns, features, matched: Vec::new(), statistics }
    }

    fn noisy(&mut self, uv_px: Vector2<f64>) -> Vector2<f64> {
        uv_px + Vector2::new(self.random.normal(), self.random.normal()) * self.pixel_sigma_px
    }

    /// Continues the tracks that stay in the image.
    fn follow(&mut self, world_from_camera: &dyn Fn(f64) -> RigidTransform, features: &mut Vec<TrackedFeature>) {
        for mut track in std::mem::take(&mut self.tracks) {
            if let Some(slip) = &mut track.slip_px {
                *slip += Vector2::new(self.random.normal(), self.random.normal()) * 1.5;
            }
            track.remaining = track.remaining.saturating_sub(1);
            let seen = self.observe(world_from_camera, &track.landmark_m).filter(|_| track.remaining > 0);
            let Some(ideal_px) = seen else { continue };
            let uv_px = self.noisy(ideal_px) + track.slip_px.unwrap_or_default();
            let Some(bearing) = self.given.unproject(&uv_px).filter(|_| self.model.contains(&uv_px, BORDER_PX)) else {
                continue;
            };
            track.age += 1;
            let previous_uv_px = Some(track.uv_px);
            features.push(TrackedFeature { id: track.id, age: track.age, uv_px, previous_uv_px, bearing });
            track.uv_px = uv_px;
            self.tracks.push(track);
        }
    }

    /// Pixel of a landmark, at the pose of the row in which it is observed; `None` behind the camera or outside the
    /// lens.
    fn observe(
        &self,
        world_from_camera: &dyn Fn(f64) -> RigidTransform,
        landmark_m: &Vector3<f64>,
    ) -> Option<Vector2<f64>> {
        let at_row = |row_px: f64| {
            let point = world_from_camera(row_px).inverse().transform(landmark_m);
            self.model.project(&point).filter(|_| point.z > 0.3)
        };
        let mut seen_px = at_row(0.5 * self.model.resolution_px[1] as f64)?;
        // Each iteration reduces the error by the ratio of image motion during the readout to the image height: to a
        // tenth, or to zero for a global shutter.
        for _ in 0..MOST_ROW_STEPS {
            let before_px = seen_px;
            seen_px = at_row(before_px.y)?;
            if (seen_px.y - before_px.y).abs() < ROW_TOLERANCE_PX {
                break;
            }
        }
        Some(seen_px)
    }

    /// Adds new features in free regions of the image.
    fn find(&mut self, world_from_camera: &dyn Fn(f64) -> RigidTransform, features: &mut Vec<TrackedFeature>) {
        let [width, height] = self.model.resolution_px.map(|size| size as f64);
        for _ in 0..20 * self.features {
            if features.len() >= self.features {
                return;
            }
            let ideal_px = Vector2::new(self.random.uniform(0.0, width), self.random.uniform(0.0, height));
            let taken = |feature: &TrackedFeature| (feature.uv_px - ideal_px).norm() < SPACING_PX;
            if !self.model.contains(&ideal_px, 2.0 * BORDER_PX) || features.iter().any(taken) {
                continue;
            }
            let Some(ray) = self.model.unproject(&ideal_px) else { continue };
            let Some(landmark_m) = self.landmark(&world_from_camera(ideal_px.y), &ray) else { continue };
            let uv_px = self.noisy(ideal_px);
            let Some(bearing) = self.given.unproject(&uv_px) else { continue };
            let id = FeatureId(self.next_id);
            self.next_id += 1;
            let slips = self.random.chance(self.outlier_ratio);
            let life = 2.0 - LIFE_FRAMES * (1.0 - self.random.unit()).ln();
            self.landmarks.insert(id, landmark_m);
            self.tracks.push(SyntheticTrack {
                id,
                age: 0,
                landmark_m,
                uv_px,
                slip_px: slips.then(Vector2::zeros),
                remaining: life as u32,
            });
            features.push(TrackedFeature { id, age: 0, uv_px, previous_uv_px: None, bearing });
        }
    }

    /// Point on a ray: at a random distance, or on the ground if that is nearer.
    fn landmark(&mut self, world_from_camera: &RigidTransform, ray: &Vector3<f64>) -> Option<Vector3<f64>> {
        let [near, far] = DEPTH_M;
        let distance_m = self.random.uniform(near.ln(), far.ln()).exp();
        let direction = world_from_camera.rotation * ray;
        let to_ground_m = if direction.z < -1e-3 { -world_from_camera.translation_m.z / direction.z } else { f64::MAX };
        let distance_m = distance_m.min(to_ground_m);
        (distance_m > 0.5).then(|| world_from_camera.translation_m + direction * distance_m)
    }

    /// Sets the median motion in the image and the mean parallax with the rotation removed.
    fn measure_motion(&self, pose: &RigidTransform, features: &[TrackedFeature], statistics: &mut FrontEndStatistics) {
        let Some(before) = &self.before else { return };
        let before_from_now = before.rotation.inverse() * pose.rotation;
        let mut flows = Vec::with_capacity(features.len());
        let mut parallax_px = 0.0;
        let mut counted = 0_usize;
        for feature in features {
            let Some(previous_px) = feature.previous_uv_px else { continue };
            flows.push((feature.uv_px - previous_px).norm());
            if let Some(turned_px) = self.given.project(&(before_from_now * feature.bearing)) {
                parallax_px += (turned_px - previous_px).norm();
                counted += 1;
            }
        }
        statistics.median_flow_px = median(flows).unwrap_or(0.0);
        statistics.mean_parallax_px = parallax_px / counted.max(1) as f64;
    }
}
