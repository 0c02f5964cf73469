//! Window of exact measurements of a rolling-shutter camera, encoders and a continuous IMU.

use std::sync::Arc;

use nalgebra::{DVector, Matrix2x6, Matrix2xX, SMatrix, Vector2, Vector3};

use super::propagation::{Change, ContinuousImu, IMU_COLUMNS, ReadoutChanges};
use crate::estimator::state::calibration::Calibration;
use crate::estimator::state::calibrations::{Calibrations, MAIN};
use crate::estimator::state::camera_pose::camera_map;
use crate::estimator::state::frame_state::{FrameState, Rates};
use crate::estimator::state::given_chain::GivenSigmas;
use crate::estimator::state::imu_calibration::ImuCalibration;
use crate::estimator::state::imu_errors::{IMU_ERRORS, ImuErrors};
use crate::estimator::state::layout::{Layout, POSE};
use crate::estimator::state::navigation::Matrix15;
use crate::estimator::state::sensor_columns::SensorColumn;
use crate::estimator::{ImuBias, JointKnowledge, NavigationState, PoseKnowledge};
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::{ParameterId, ParameterPart, Quantity};
use crate::observability::laboratory::SensorColumns;
use crate::observability::laboratory::experiment::{CHAIN_PRIOR, LaboratoryForm, LaboratorySetup};
use crate::observability::laboratory::motion::MechanismMotion;
use crate::sensors::ImuIntrinsics;

/// Largest number of iterations that find the image row in which a landmark is exposed; the camera moves little within
/// a readout.
const ROW_ITERATIONS: usize = 25;
/// Change of the row, as a ratio of the image height, at which the iterations end.
const ROW_TOLERANCE: f64 = 1e-12;
/// Columns of a frame's state `[φ, p, v, b_g, b_a]` with the intrinsics of the IMU.
const STATE_COLUMNS: usize = 9 + IMU_COLUMNS;

/// Observation of one landmark in one image.
#[derive(Clone, Copy, Debug)]
pub(super) struct SensorObservation {
    pub(super) slot: usize,
    pub(super) uv_px: Vector2<f64>,
    /// Row of the pixel as a ratio of the image height.
    pub(super) row_ratio: f64,
}

/// Unknowns of a window. Joint rates are unknowns only without encoders; known joint angles are not part of the state.
#[derive(Clone, Debug)]
pub(super) struct SensorState {
    pub(super) frames: Vec<FrameState>,
    pub(super) calibration: Calibrations,
    /// Positions in the world, in metres.
    pub(super) landmarks: Vec<Vector3<f64>>,
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
    pub(super) layout: Layout,
    /// Square-root information of the preintegrated motion to each frame but the first, at the true state.
    pub(super) information: Vec<Matrix15>,
}

/// A predicted pixel and its derivatives.
pub(super) struct Prediction {
    pub(super) uv_px: Vector2<f64>,
    /// By the landmark's position in the world.
    pub(super) by_landmark: SMatrix<f64, 2, 3>,
    /// By the columns of the frame.
    pub(super) by_frame: Matrix2xX<f64>,
    /// By the columns of the calibration.
    pub(super) by_calibration: Matrix2xX<f64>,
}

/// Pose of the IMU at an exposure.
struct Exposure {
    world_from_imu: RigidTransform,
    /// Velocity in the world and angular rate in the IMU frame, `[ω; v]`.
    motion: SMatrix<f64, 6, 1>,
    /// Derivative of `[φ; p]` by the state of the frame and the intrinsics of the IMU; zero with known poses.
    by_state: SMatrix<f64, 6, STATE_COLUMNS>,
}

/// Joint angles at an exposure, their rates, and the derivative of the angles by the time offset of the encoders.
struct JointsAt {
    angles_rad: Vec<f64>,
    rates_rad_per_s: Vec<f64>,
    by_encoder_time: Vec<f64>,
}

impl<'a> SensorWindow<'a> {
    /// Window of an experiment in one parameterization, with the sensor columns that its measurements have: encoders and
    /// IMU only where they measure, lens coefficients only where the camera has them.
    pub(super) fn new(setup: &'a LaboratorySetup, form: LaboratoryForm, columns: SensorColumns) -> Self {
        let flight = setup.flight();
        let times_s: Vec<f64> = (0..setup.frames).map(LaboratorySetup::time_s).collect();
        let calibration = given_calibration(setup, form, columns);
        let frames: Vec<FrameState> = times_s.iter().map(|time_s| frame_at(&flight, *time_s, setup.joints)).collect();
        let layout = Layout {
            frames: frames.len(),
            joints: frames.first().map_or(0, |frame| frame.joints_rad.len()),
            joint_motion: frames.first().map_or(0, |frame| frame.joint_motion.len()),
            moving_rows: true,
            gimbal_imu: 0,
            calibration: calibration.dof(),
        };
        let truth = SensorState { frames, landmarks: Vec::new(), calibration };
        let mut window =
            Self { flight, setup, times_s, observations: Vec::new(), truth, layout, information: Vec::new() };
        window.information = window.true_information();
        window.observe();
        window
    }

    /// Square-root information of each interval; empty with known poses.
    fn true_information(&self) -> Vec<Matrix15> {
        let PoseKnowledge::Imu { noise, .. } = self.setup.poses else { return Vec::new() };
        let imu = self.imu(&self.truth, ImuBias::default());
        let of_interval = |times: &[f64]| {
            let motion = Change::preintegration(&imu, (times[0], times[1] - times[0]), Some(&noise));
            motion.square_root_information().unwrap_or_else(Matrix15::identity)
        };
        self.times_s.windows(2).map(of_interval).collect()
    }

    /// Draws the landmarks and computes their pixels.
    fn observe(&mut self) {
        let changes = self.readout_changes(&self.truth);
        let cameras: Vec<RigidTransform> = self.times_s.iter().map(|time_s| self.world_from_camera(*time_s)).collect();
        let (mut positions, mut tracks) = (Vec::new(), Vec::new());
        for landmark in self.setup.landmarks_of(&cameras) {
            let point = landmark.bearing / landmark.inverse_distance_per_m;
            let position = cameras[landmark.anchor].transform(&point);
            let observers = [landmark.anchor].into_iter().chain(landmark.observers.iter().copied());
            let mut observations: Vec<SensorObservation> =
                observers.filter_map(|slot| self.observation(&changes, &position, slot)).collect();
            if observations.len() > 1 {
                observations.sort_by_key(|it| it.slot);
                positions.push(position);
                tracks.push(observations);
            }
        }
        drop(changes);
        self.truth.landmarks = positions;
        self.observations = tracks;
    }

    /// Observation of a position in one frame; `None` outside the image.
    fn observation(
        &self,
        changes: &[ReadoutChanges<'_>],
        position: &Vector3<f64>,
        slot: usize,
    ) -> Option<SensorObservation> {
        let (camera, readout_s) = (&self.setup.camera, self.setup.readout_s);
        let height = camera.resolution_px[1] as f64;
        let mut row_ratio = 0.5;
        for _ in 0..ROW_ITERATIONS {
            let world_from_camera = self.world_from_camera(self.times_s[slot] + row_ratio * readout_s);
            let pixel = camera.project(&world_from_camera.inverse().transform(position))?;
            let change = pixel.y / height - row_ratio;
            row_ratio += change;
            if !(-1.0..=2.0).contains(&row_ratio) {
                return None;
            }
            if change.abs() < ROW_TOLERANCE || readout_s == 0.0 {
                break;
            }
        }
        let uv_px = self.predict(&self.truth, changes, position, slot, row_ratio)?.uv_px;
        camera.contains(&uv_px, 0.0).then_some(SensorObservation { slot, uv_px, row_ratio })
    }

    /// Pose of the camera at a time of the true motion.
    fn world_from_camera(&self, time_s: f64) -> RigidTransform {
        let joints_rad = self.flight.joints_rad(time_s);
        self.flight.world_from_imu(time_s) * self.truth.calibration.of(MAIN).imu_from_camera(&joints_rad)
    }

    /// IMU with the intrinsics of a state and these biases.
    pub(super) fn imu(&self, state: &SensorState, bias: ImuBias) -> ContinuousImu<'_> {
        let errors = state.calibration.imu_errors().copied().unwrap_or_else(ImuErrors::zeros);
        ContinuousImu { flight: &self.flight, errors, bias }
    }

    /// Changes of the IMU within the readout of each frame at a state; none where poses are known.
    pub(super) fn readout_changes(&self, state: &SensorState) -> Vec<ReadoutChanges<'_>> {
        if self.setup.poses == PoseKnowledge::Known {
            return Vec::new();
        }
        let calibration = state.calibration.of(MAIN);
        let longest_s = calibration.camera_shift_s() + calibration.readout_s();
        let of_frame = |(time_s, frame): (&f64, &FrameState)| {
            ReadoutChanges::new(self.imu(state, frame.navigation.bias), (*time_s, longest_s))
        };
        self.times_s.iter().zip(&state.frames).map(of_frame).collect()
    }

    /// Predicted pixel of a position in a frame, at the row in which it was observed (Eqs. 9, 10); `None` behind the
    /// camera. `changes` come from [`Self::readout_changes`].
    pub(super) fn predict(
        &self,
        state: &SensorState,
        changes: &[ReadoutChanges<'_>],
        position: &Vector3<f64>,
        slot: usize,
        row_ratio: f64,
    ) -> Option<Prediction> {
        let calibration = state.calibration.of(MAIN);
        let since_s = calibration.camera_shift_s() + row_ratio * calibration.readout_s();
        let exposure = self.exposure(state, changes, slot, since_s);
        let joints = self.joints_at(state, slot, since_s, row_ratio);
        let count = joints.angles_rad.len();
        let chain = calibration.linearize(&joints.angles_rad);
        let world_from_camera = exposure.world_from_imu * chain.imu_from_camera;
        let in_camera = world_from_camera.inverse().transform(position);
        let camera = calibration.camera_model(&self.setup.camera);
        let (uv_px, by_point, by_intrinsics) = camera.project_with_intrinsics_jacobian(&in_camera)?;
        let by_landmark = by_point * world_from_camera.rotation_matrix().transpose();
        let mut by_camera = Matrix2x6::zeros();
        by_camera.fixed_columns_mut::<3>(0).copy_from(&(by_point * so3::hat(&in_camera)));
        by_camera.fixed_columns_mut::<3>(3).copy_from(&-by_landmark);

        let (by_pose_joints, by_chain) = camera_map(&exposure.world_from_imu.rotation_matrix(), count, &chain);
        let by_pose_joints = by_camera * by_pose_joints;
        let by_pose: Matrix2x6<f64> = by_pose_joints.fixed_columns::<POSE>(0).into_owned();
        let by_joints = by_pose_joints.columns(POSE, count);
        let along = |rates: &[f64]| by_joints * DVector::from_column_slice(rates);
        let by_time = by_pose * exposure.motion + along(&joints.rates_rad_per_s);
        let by_state = by_pose * exposure.by_state;

        let layout = &self.layout;
        let mut by_frame = Matrix2xX::zeros(layout.frame_len());
        by_frame.columns_range_mut(layout.pose(0)).copy_from(&by_state.fixed_columns::<POSE>(0));
        by_frame.columns_range_mut(layout.velocity_bias(0)).copy_from(&by_state.fixed_columns::<9>(POSE));
        if layout.joints > 0 {
            by_frame.columns_range_mut(layout.joints(0)).copy_from(&by_joints);
        }
        if layout.joint_motion > 0 {
            by_frame.columns_range_mut(layout.joint_motion(0)).copy_from(&(by_joints * since_s));
        }
        let mut by_calibration = Matrix2xX::zeros(layout.calibration);
        by_calibration.columns_mut(0, by_chain.ncols()).copy_from(&(by_camera * by_chain));
        let times = [
            (calibration.camera_shift_column(), by_time),
            (calibration.readout_column(), by_time * row_ratio),
            (calibration.encoder_shift_column(), along(&joints.by_encoder_time)),
        ];
        for (column, derivative) in times {
            if let Some(column) = column {
                by_calibration.set_column(column, &derivative);
            }
        }
        let intrinsics = calibration.intrinsics_columns();
        by_calibration.columns_range_mut(intrinsics.clone()).copy_from(&by_intrinsics.columns(0, intrinsics.len()));
        if !state.calibration.imu_columns().is_empty() {
            let by_errors = by_state.fixed_columns::<IMU_ERRORS>(STATE_COLUMNS - IMU_ERRORS);
            by_calibration.columns_range_mut(state.calibration.imu_columns()).copy_from(&by_errors);
        }
        Some(Prediction { uv_px, by_landmark, by_frame, by_calibration })
    }

    /// Pose of the IMU a time t after a frame, from its state (R, p, v) and the change (ΔR, Δp, Δv) since then:
    ///
    /// ```text
    /// R' = R ΔR    p' = p + v t + ½ g t² + R Δp    v' = v + g t + R Δv
    /// φ' = ΔRᵀ φ + δφ    p' moves by δp − R [Δp]× φ + t δv + R δ(Δp)
    /// ```
    fn exposure(&self, state: &SensorState, changes: &[ReadoutChanges<'_>], slot: usize, since_s: f64) -> Exposure {
        let moved = |angular: Vector3<f64>, linear: Vector3<f64>| {
            SMatrix::<f64, 6, 1>::from_iterator(angular.iter().chain(linear.iter()).copied())
        };
        let Some(changes) = changes.get(slot) else {
            let kinematics = self.flight.kinematics(self.times_s[slot] + since_s);
            return Exposure {
                world_from_imu: kinematics.world_from_imu,
                motion: moved(kinematics.angular_velocity_rad_per_s, kinematics.velocity_m_per_s),
                by_state: SMatrix::zeros(),
            };
        };
        let NavigationState { world_from_imu, velocity_m_per_s, .. } = &state.frames[slot].navigation;
        let (change, rate) = changes.after(since_s);
        let (rotation, gravity) = (world_from_imu.rotation_matrix(), self.flight.gravity_in_world);
        let position = world_from_imu.translation_m
            + velocity_m_per_s * since_s
            + gravity * (0.5 * since_s * since_s)
            + rotation * change.position;
        let mut by_state = SMatrix::<f64, 6, STATE_COLUMNS>::zeros();
        by_state.fixed_view_mut::<3, 3>(0, 0).copy_from(&change.rotation.transpose());
        by_state.fixed_view_mut::<3, 3>(3, 0).copy_from(&-(rotation * so3::hat(&change.position)));
        by_state.fixed_view_mut::<3, 3>(3, 3).fill_with_identity();
        by_state.fixed_view_mut::<3, 3>(3, 6).fill_diagonal(since_s);
        by_state.fixed_view_mut::<3, IMU_COLUMNS>(0, 9).copy_from(&change.by_imu.fixed_rows::<3>(0));
        by_state.fixed_view_mut::<3, IMU_COLUMNS>(3, 9).copy_from(&(rotation * change.by_imu.fixed_rows::<3>(3)));
        Exposure {
            world_from_imu: RigidTransform::new(world_from_imu.rotation * change.unit_rotation(), position),
            motion: moved(rate, velocity_m_per_s + gravity * since_s + rotation * change.velocity),
            by_state,
        }
    }

    fn joints_at(&self, state: &SensorState, slot: usize, since_s: f64, row_ratio: f64) -> JointsAt {
        let time_s = self.times_s[slot];
        let encoder_s = state.calibration.of(MAIN).encoder_shift_s();
        let (angles, rates) = self.flight.joint_motion(time_s + since_s - encoder_s);
        let own = &state.frames[slot];
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
                let true_since_s = row_ratio * self.setup.readout_s;
                let (angles_before, rates_before) = self.flight.joint_motion(time_s);
                let (angles, _) = self.flight.joint_motion(time_s + true_since_s);
                let rest = |joint: usize| angles[joint] - angles_before[joint] - rates_before[joint] * true_since_s;
                let angle = |joint: usize| own.joints_rad[joint] + own.joint_motion[joint] * since_s + rest(joint);
                JointsAt {
                    angles_rad: joints.clone().map(angle).collect(),
                    rates_rad_per_s: own.joint_motion.clone(),
                    by_encoder_time: joints.map(|_| 0.0).collect(),
                }
            }
        }
    }
}

/// True calibration with the wanted columns that the measurements can have.
fn given_calibration(setup: &LaboratorySetup, form: LaboratoryForm, wanted: SensorColumns) -> Calibrations {
    let encoders = setup.mechanism.chain.joint_count() > 0 && setup.joints != JointKnowledge::Unknown;
    let times = [ParameterId::timeshift(0), ParameterId::readout(0)];
    let times = times.into_iter().chain(encoders.then_some(ParameterId::ENCODER_TIMESHIFT));
    let intrinsics = Quantity::INTRINSICS.into_iter().take(setup.camera.intrinsic_count());
    let intrinsics = intrinsics.map(|quantity| ParameterId { part: ParameterPart::Camera(0), quantity });
    let parameters = times.chain(intrinsics).filter(|parameter| wanted.has(*parameter));
    let columns = parameters.map(|parameter| SensorColumn { parameter, given: 0.0, sigma: parameter.scale() });
    let (translation_m, rotation_rad) = CHAIN_PRIOR;
    let sigmas = GivenSigmas { translation_m, rotation_rad };
    let main = Calibration::new(&setup.mechanism.chain, form.parameterization, sigmas, true, form.joint_offsets)
        .with_sensors(columns.collect())
        .with_given_readout(setup.readout_s);
    let imu = wanted.imu_intrinsics && setup.poses != PoseKnowledge::Known;
    Calibrations::new(main, []).with_imu(imu.then(|| ImuCalibration::new(ImuIntrinsics::default())))
}

/// True state of a frame.
fn frame_at(flight: &MechanismMotion<'_>, time_s: f64, joints: JointKnowledge) -> FrameState {
    let kinematics = flight.kinematics(time_s);
    let if_any = |values: Vec<f64>, unknown: bool| if unknown { values } else { Vec::new() };
    FrameState {
        navigation: NavigationState {
            world_from_imu: kinematics.world_from_imu,
            velocity_m_per_s: kinematics.velocity_m_per_s,
            bias: ImuBias::default(),
        },
        joints_rad: if_any(kinematics.joints_rad, joints != JointKnowledge::Known),
        joint_motion: if_any(kinematics.joint_rates_rad_per_s, joints == JointKnowledge::Unknown),
        gimbal_imu: None,
        rates: Arc::new(Rates::default()),
    }
}
