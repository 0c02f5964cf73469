//! Window of exact measurements of a rolling-shutter camera, encoders and a continuous IMU.

use nalgebra::{Matrix2xX, Matrix3, SMatrix, Vector2, Vector3};

use super::columns::{SensorColumns, all_parameters};
use super::propagation::{IMU_COLUMNS, Measured, ReadoutChanges};
use super::state::{Columns, SensorFrameState, SensorState};
use super::values::SensorValues;
use crate::estimator::{HypotheticalFrame, JointKnowledge, NavigationState, PoseKnowledge};
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::ParameterId;
use crate::observability::laboratory::experiment::{LaboratoryForm, LaboratorySetup};
use crate::observability::laboratory::motion::{MechanismMotion, MechanismState};

/// Largest number of iterations that find the image row in which a landmark is exposed; the camera moves little within
/// a readout.
const ROW_ITERATIONS: usize = 25;
/// Change of the row, as a ratio of the image height, at which the iterations end.
const ROW_TOLERANCE: f64 = 1e-12;
/// Observation of one landmark in one image.
#[derive(Clone, Copy, Debug)]
pub(super) struct SensorObservation {
    pub(super) frame: usize,
    pub(super) uv_px: Vector2<f64>,
    /// Row of the pixel as a ratio of the image height.
    pub(super) row_ratio: f64,
}

/// A window with its exact state.
#[derive(Debug)]
pub(super) struct SensorWindow<'a> {
    pub(super) flight: MechanismMotion<'a>,
    pub(super) setup: &'a LaboratorySetup,
    /// Times of the frames: exposure of the first row at the true time offset.
    pub(super) times_s: Vec<f64>,
    pub(super) observations: Vec<Vec<SensorObservation>>,
    pub(super) truth: SensorState,
    pub(super) columns: Columns,
    /// Weights of the preintegrated motion to each frame but the first: inverse of its covariance at the true state.
    pub(super) weights: Vec<SMatrix<f64, 9, 9>>,
}

/// A predicted pixel and its derivatives.
pub(super) struct Prediction {
    pub(super) uv_px: Vector2<f64>,
    /// By the landmark's position in the world.
    pub(super) by_landmark: SMatrix<f64, 2, 3>,
    pub(super) by_chain: Matrix2xX<f64>,
    pub(super) by_joints: Matrix2xX<f64>,
    pub(super) by_joint_rates: Matrix2xX<f64>,
    /// By `[φ; δp]` of the frame's pose.
    pub(super) by_pose: SMatrix<f64, 2, 6>,
    pub(super) by_velocity: SMatrix<f64, 2, 3>,
    /// By biases and intrinsics of the IMU.
    pub(super) by_imu: SMatrix<f64, 2, IMU_COLUMNS>,
    /// By the exposure time.
    pub(super) by_time: Vector2<f64>,
    /// By the time offset of the encoders.
    pub(super) by_encoder_time: Vector2<f64>,
    /// By `[fx, fy, cx, cy, k1, k2]`.
    pub(super) by_intrinsics: SMatrix<f64, 2, 6>,
}

/// Pose of the IMU at an exposure, with its derivatives by the frame's unknowns.
struct Exposure {
    world_from_imu: RigidTransform,
    velocity: Vector3<f64>,
    angular_velocity: Vector3<f64>,
    /// Of the rotation vector, by the frame's rotation vector.
    rotation_by_rotation: Matrix3<f64>,
    /// Of the position, by the frame's rotation vector.
    position_by_rotation: Matrix3<f64>,
    rotation_by_imu: SMatrix<f64, 3, IMU_COLUMNS>,
    position_by_imu: SMatrix<f64, 3, IMU_COLUMNS>,
}

/// Joint angles at an exposure, their rates, and the derivative of the angles by the time offset of the encoders.
struct JointsAt {
    angles_rad: Vec<f64>,
    rates_rad_per_s: Vec<f64>,
    by_encoder_time: Vec<f64>,
}

impl<'a> SensorWindow<'a> {
    /// Window of an experiment in one parameterization, with every sensor column that its measurements can have.
    pub(super) fn new(setup: &'a LaboratorySetup, form: LaboratoryForm) -> Self {
        let flight = setup.flight();
        let chain = form.chain(&setup.mechanism);
        let times_s: Vec<f64> = (0..setup.frames).map(LaboratorySetup::time_s).collect();
        let frames = times_s.iter().map(|time_s| frame_at(&flight.kinematics(*time_s))).collect();
        let sensors = SensorValues {
            timeshift_s: 0.0,
            readout_s: setup.readout_s,
            encoder_timeshift_s: 0.0,
            camera: setup.camera.clone(),
            gyroscope: Default::default(),
            accelerometer: Default::default(),
        };
        let (pose, velocity_bias) = Columns::of_poses(&setup.poses);
        let joints = chain.joint_count();
        let columns = Columns {
            chain: chain.dof(),
            sensors: available(setup),
            frames: times_s.len(),
            joints: match setup.joints {
                JointKnowledge::Known => 0,
                JointKnowledge::Encoder(_) => joints,
                JointKnowledge::Unknown => 2 * joints,
            },
            pose,
            velocity_bias,
        };
        let truth = SensorState { frames, landmarks: Vec::new(), chain, sensors };
        let mut window = Self { flight, setup, times_s, observations: Vec::new(), truth, columns, weights: Vec::new() };
        window.weights = window.imu_weights();
        window.observe();
        window
    }

    /// Draws the landmarks and computes their pixels.
    fn observe(&mut self) {
        let height = self.setup.camera.resolution_px[1] as f64;
        let hypothetical = |(frame, time_s): (&SensorFrameState, &f64)| HypotheticalFrame {
            time_s: *time_s,
            navigation: frame.navigation,
            joints_rad: frame.joints_rad.clone(),
            imu: Vec::new(),
            camera_imu: None,
        };
        let frames: Vec<HypotheticalFrame> = self.truth.frames.iter().zip(&self.times_s).map(hypothetical).collect();
        let changes = self.readout_changes(&self.truth);
        for landmark in self.setup.landmarks_of(&frames) {
            let anchor = &self.truth.frames[landmark.anchor];
            let world_from_camera =
                anchor.navigation.world_from_imu * self.truth.chain.imu_from_camera(&anchor.joints_rad);
            let position = world_from_camera.transform(&(landmark.bearing / landmark.inverse_distance_per_m));
            let observers = [landmark.anchor].into_iter().chain(landmark.observers.iter().copied());
            let mut observations: Vec<SensorObservation> =
                observers.filter_map(|frame| self.observation(&changes, &position, frame, height)).collect();
            if observations.len() > 1 {
                observations.sort_by_key(|it| it.frame);
                self.truth.landmarks.push(position);
                self.observations.push(observations);
            }
        }
    }

    /// Observation of a position in one frame; `None` outside the image.
    fn observation(
        &self,
        changes: &[ReadoutChanges],
        position: &Vector3<f64>,
        frame: usize,
        height: f64,
    ) -> Option<SensorObservation> {
        let readout_s = self.truth.sensors.readout_s;
        let mut row_ratio = 0.5;
        for _ in 0..ROW_ITERATIONS {
            let pixel = self.true_pixel(position, self.times_s[frame] + row_ratio * readout_s)?;
            let change = pixel.y / height - row_ratio;
            row_ratio += change;
            if !(-1.0..=2.0).contains(&row_ratio) {
                return None;
            }
            if change.abs() < ROW_TOLERANCE || readout_s == 0.0 {
                break;
            }
        }
        let uv_px = self.predict(&self.truth, changes, position, frame, row_ratio)?.uv_px;
        self.truth.sensors.camera.contains(&uv_px, 0.0).then_some(SensorObservation { frame, uv_px, row_ratio })
    }

    /// Pixel of a position at a time of the true motion.
    fn true_pixel(&self, position: &Vector3<f64>, time_s: f64) -> Option<Vector2<f64>> {
        let imu_from_camera = self.truth.chain.imu_from_camera(&self.flight.joints_rad(time_s));
        let world_from_camera = self.flight.world_from_imu(time_s) * imu_from_camera;
        self.truth.sensors.camera.project(&world_from_camera.inverse().transform(position))
    }

    /// Measured angular rate and specific force at a time.
    pub(super) fn measured(&self, time_s: f64) -> Measured {
        let (rate, force) = self.flight.rate_and_force(time_s);
        self.truth.sensors.measure(&rate, &force).expect("the true corrections of an experiment are invertible")
    }

    /// Changes of the IMU within the readout of each frame at a state; none where poses are known.
    pub(super) fn readout_changes(&self, state: &SensorState) -> Vec<ReadoutChanges> {
        if self.setup.poses == PoseKnowledge::Known {
            return Vec::new();
        }
        let measured = |time_s: f64| self.measured(time_s);
        let longest_s = state.sensors.timeshift_s + state.sensors.readout_s;
        let of_frame = |(time_s, frame): (&f64, &SensorFrameState)| {
            ReadoutChanges::new(&measured, (*time_s, longest_s), &state.sensors, &frame.navigation.bias)
        };
        self.times_s.iter().zip(&state.frames).map(of_frame).collect()
    }

    /// Predicted pixel of a position in a frame, at the row in which it was observed; `None` behind the camera.
    /// `changes` are those of [`Self::readout_changes`].
    pub(super) fn predict(
        &self,
        state: &SensorState,
        changes: &[ReadoutChanges],
        position: &Vector3<f64>,
        frame: usize,
        row_ratio: f64,
    ) -> Option<Prediction> {
        let sensors = &state.sensors;
        let since_s = sensors.timeshift_s + row_ratio * sensors.readout_s;
        let exposure = self.exposure(state, changes, frame, since_s);
        let joints = self.joints_at(state, frame, since_s, row_ratio);
        let chain = state.chain.linearize(&joints.angles_rad);
        let imu_from_camera = chain.imu_from_camera;
        let in_imu = exposure.world_from_imu.inverse().transform(position);
        let in_camera = imu_from_camera.inverse().transform(&in_imu);
        let (uv_px, by_point, by_intrinsics) = sensors.camera.project_with_intrinsics_jacobian(&in_camera)?;
        let camera_from_imu = imu_from_camera.rotation_matrix().transpose();
        let imu_from_world = exposure.world_from_imu.rotation_matrix().transpose();
        let camera_from_world = camera_from_imu * imu_from_world;
        let by_imu_rotation = by_point * camera_from_imu * so3::hat(&in_imu);
        let by_imu_position = -(by_point * camera_from_world);
        let mut by_extrinsics = SMatrix::<f64, 2, 6>::zeros();
        by_extrinsics.fixed_view_mut::<2, 3>(0, 0).copy_from(&(by_point * so3::hat(&in_camera)));
        by_extrinsics.fixed_view_mut::<2, 3>(0, 3).copy_from(&-(by_point * camera_from_imu));
        let mut by_pose = SMatrix::<f64, 2, 6>::zeros();
        let by_rotation =
            by_imu_rotation * exposure.rotation_by_rotation + by_imu_position * exposure.position_by_rotation;
        by_pose.fixed_view_mut::<2, 3>(0, 0).copy_from(&by_rotation);
        by_pose.fixed_view_mut::<2, 3>(0, 3).copy_from(&by_imu_position);
        let by_joints = by_extrinsics * &chain.by_joints;
        let along = |rates: &[f64]| &by_joints * nalgebra::DVector::from_column_slice(rates);
        Some(Prediction {
            uv_px,
            by_landmark: by_point * camera_from_world,
            by_chain: by_extrinsics * &chain.by_parameters,
            by_joint_rates: &by_joints * since_s,
            by_pose,
            by_velocity: by_imu_position * since_s,
            by_imu: by_imu_rotation * exposure.rotation_by_imu + by_imu_position * exposure.position_by_imu,
            by_time: by_imu_rotation * exposure.angular_velocity
                + by_imu_position * exposure.velocity
                + along(&joints.rates_rad_per_s),
            by_encoder_time: along(&joints.by_encoder_time),
            by_joints,
            by_intrinsics,
        })
    }

    fn exposure(&self, state: &SensorState, changes: &[ReadoutChanges], frame: usize, since_s: f64) -> Exposure {
        let time_s = self.times_s[frame];
        if self.setup.poses == PoseKnowledge::Known {
            let kinematics = self.flight.kinematics(time_s + since_s);
            return Exposure {
                world_from_imu: kinematics.world_from_imu,
                velocity: kinematics.velocity_m_per_s,
                angular_velocity: kinematics.angular_velocity_rad_per_s,
                rotation_by_rotation: Matrix3::identity(),
                position_by_rotation: Matrix3::zeros(),
                rotation_by_imu: SMatrix::zeros(),
                position_by_imu: SMatrix::zeros(),
            };
        }
        let NavigationState { world_from_imu, velocity_m_per_s, bias } = &state.frames[frame].navigation;
        let measured = |time_s: f64| self.measured(time_s);
        let change = changes[frame].after(&measured, since_s, &state.sensors, bias);
        let rotation = world_from_imu.rotation_matrix();
        let gravity = self.flight.gravity_in_world;
        let (rate, _) = state.sensors.correct_rate(&measured(time_s + since_s).0);
        let position = world_from_imu.translation_m
            + velocity_m_per_s * since_s
            + gravity * (0.5 * since_s * since_s)
            + rotation * change.position;
        Exposure {
            world_from_imu: RigidTransform::new(world_from_imu.rotation * change.rotation(), position),
            velocity: velocity_m_per_s + gravity * since_s + rotation * change.velocity,
            angular_velocity: rate - bias.gyroscope_rad_per_s,
            rotation_by_rotation: change.rotation.transpose(),
            position_by_rotation: -(rotation * so3::hat(&change.position)),
            rotation_by_imu: change.rotation_by,
            position_by_imu: rotation * change.position_by,
        }
    }

    fn joints_at(&self, state: &SensorState, frame: usize, since_s: f64, row_ratio: f64) -> JointsAt {
        let time_s = self.times_s[frame];
        let encoder_s = state.sensors.encoder_timeshift_s;
        let (angles, rates) = self.flight.joint_motion(time_s + since_s - encoder_s);
        let own = &state.frames[frame];
        let joints = 0..angles.len();
        match self.setup.joints {
            JointKnowledge::Known => JointsAt {
                by_encoder_time: rates.iter().map(|rate| -rate).collect(),
                angles_rad: angles,
                rates_rad_per_s: rates,
            },
            JointKnowledge::Encoder(_) => {
                let (angles_before, rates_before) = self.flight.joint_motion(time_s - encoder_s);
                let change = |joint: usize| angles[joint] - angles_before[joint];
                let slower = |joint: usize| rates_before[joint] - rates[joint];
                JointsAt {
                    angles_rad: joints.clone().map(|joint| own.joints_rad[joint] + change(joint)).collect(),
                    by_encoder_time: joints.map(slower).collect(),
                    rates_rad_per_s: rates,
                }
            }
            JointKnowledge::Unknown => {
                // Deviation of the true motion from a constant rate within the image: a known number.
                let true_since_s = self.truth.sensors.timeshift_s + row_ratio * self.truth.sensors.readout_s;
                let (angles_before, rates_before) = self.flight.joint_motion(time_s);
                let (angles, _) = self.flight.joint_motion(time_s + true_since_s);
                let rest = |joint: usize| angles[joint] - angles_before[joint] - rates_before[joint] * true_since_s;
                let own_rate = |joint: usize| own.joint_rates_rad_per_s[joint];
                JointsAt {
                    angles_rad: joints
                        .clone()
                        .map(|joint| own.joints_rad[joint] + own_rate(joint) * since_s + rest(joint))
                        .collect(),
                    rates_rad_per_s: joints.clone().map(own_rate).collect(),
                    by_encoder_time: joints.map(|_| 0.0).collect(),
                }
            }
        }
    }
}

fn frame_at(kinematics: &MechanismState) -> SensorFrameState {
    SensorFrameState {
        navigation: NavigationState {
            world_from_imu: kinematics.world_from_imu,
            velocity_m_per_s: kinematics.velocity_m_per_s,
            ..NavigationState::default()
        },
        joints_rad: kinematics.joints_rad.clone(),
        joint_rates_rad_per_s: kinematics.joint_rates_rad_per_s.clone(),
    }
}

/// Sensor columns that the measurements of an experiment can have: encoders and IMU only where they measure, lens
/// coefficients only where the camera has them.
fn available(setup: &LaboratorySetup) -> Vec<(usize, ParameterId)> {
    let intrinsics = SensorColumns { intrinsics: true, ..SensorColumns::NONE };
    let imu = SensorColumns { imu_intrinsics: true, ..SensorColumns::NONE };
    let encoders = setup.mechanism.chain.joint_count() > 0 && setup.joints != JointKnowledge::Unknown;
    let lens = super::values::INTRINSICS + setup.camera.intrinsic_count();
    let has = |(place, parameter): &(usize, ParameterId)| {
        if *parameter == ParameterId::ENCODER_TIMESHIFT {
            encoders
        } else if imu.has(*parameter) {
            setup.poses != PoseKnowledge::Known
        } else {
            !intrinsics.has(*parameter) || *place < lens
        }
    };
    all_parameters().into_iter().enumerate().filter(has).collect()
}
