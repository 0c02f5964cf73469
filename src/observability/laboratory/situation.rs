//! State and calibration posterior of a run, from which excitation is suggested.

use nalgebra::{DMatrix, DVector, Vector3};

use super::mechanism::LaboratoryJoint;
use super::motion::middle_angle_rad;
use super::{FRAME_PERIOD_S, LaboratoryForm, LaboratorySetup};
use crate::camera::CameraModel;
use crate::estimator::{
    EstimatorConfig, INACCURATE_ROTATION_RAD, JointKnowledge, NavigationState, PoseKnowledge, StepReport,
    gravity_in_world,
};
use crate::geometry::Dimension;
use crate::gimbal::{Chain, ParameterNames};
use crate::observability::{RankReport, analyse, chain_of_step};
use crate::sensors::{ImuNoise, RequiredAccuracy, Rig};

/// State of a run and posterior of its calibration.
#[derive(Clone, Debug)]
pub struct Situation {
    pub camera: CameraModel,
    /// The chain in its estimated parameterization.
    pub chain: Chain,
    pub joints: Vec<LaboratoryJoint>,
    pub names: ParameterNames,
    /// True if rotations of the chain are given worse than [`INACCURATE_ROTATION_RAD`].
    pub has_inaccurate_rotations: bool,
    /// Posterior of the calibration as the information matrix of its columns (n × n), in units of 10° and 3 cm.
    pub information: DMatrix<f64>,
    pub navigation: NavigationState,
    pub joints_rad: Vec<f64>,
    /// Measurements of the joint angles.
    pub encoders: JointKnowledge,
    pub imu_noise: ImuNoise,
    /// Gravity in the world, in m/s².
    pub gravity_in_world: Vector3<f64>,
    /// Standard deviation of a pixel, averaged over the observations.
    pub pixel_sigma_px: f64,
    /// Distances of the scene's landmarks from the camera, in metres.
    pub distances_m: Vec<f64>,
    /// Time between two images, in seconds.
    pub image_period_s: f64,
    /// Accuracy that the calibration must reach.
    pub required: RequiredAccuracy,
}

/// Information about a fixed parameter in units of 10° and 3 cm: σ is a millionth of the unit.
const KNOWN: f64 = 1e12;

/// Assumed distances of a scene without landmarks, in metres.
const UNKNOWN_DISTANCE_M: [f64; 3] = [4.0, 7.0, 12.0];

impl Situation {
    /// State after a step of a run with a rig's camera; `None` without a rank report.
    pub fn of_step(report: &StepReport, rank: &RankReport, rig: &Rig, camera_key: &str) -> Option<Self> {
        let newest = report.newest()?;
        let chain = chain_of_step(report, rank).filter(|_| rank.posterior.columns() == rank.parameters.len())?;
        let free: Vec<bool> =
            chain.parameters().iter().map(|parameter| !rank.fixed_parameters.contains(parameter)).collect();
        let count = free.iter().filter(|free| **free).count();
        let information = spread(&marginal(rank.posterior.information(), count)?, &free);
        let sigma_of_joints = newest.encoder_sigmas_rad.as_ref().and_then(|sigmas| mean(sigmas));
        let position_m = (newest.world_from_imu * newest.imu_from_camera).translation_m;
        let mut distances_m: Vec<f64> =
            report.landmarks.iter().map(|landmark| (landmark.position_m - position_m).norm()).collect();
        distances_m.sort_by(f64::total_cmp);
        let joints = rig.gimbal.iter().flat_map(|gimbal| &gimbal.joints).take(chain.joint_count());
        Some(Self {
            camera: rig.camera(camera_key).ok()?.model.clone(),
            joints: joints
                .map(|joint| LaboratoryJoint { name: joint.name.clone(), limits_rad: joint.limits_rad })
                .collect(),
            names: rig.parameter_names(),
            has_inaccurate_rotations: rig
                .gimbal
                .as_ref()
                .is_some_and(|gimbal| gimbal.prior.sigmas().1 > INACCURATE_ROTATION_RAD),
            information,
            navigation: NavigationState {
                world_from_imu: newest.world_from_imu,
                velocity_m_per_s: newest.velocity_m_per_s,
                bias: crate::estimator::ImuBias {
                    gyroscope_rad_per_s: newest.gyroscope_bias_rad_per_s,
                    accelerometer_m_per_s2: newest.accelerometer_bias_m_per_s2,
                },
            },
            joints_rad: newest.joint_angles_rad.clone(),
            encoders: sigma_of_joints.map_or(JointKnowledge::Unknown, JointKnowledge::Encoder),
            imu_noise: rig.imu.noise,
            gravity_in_world: gravity_in_world(rig.gravity_m_per_s2),
            pixel_sigma_px: report.effective_pixel_sigma_px,
            distances_m,
            image_period_s: rig.camera(camera_key).ok()?.rate_hz.recip(),
            required: rig.required_accuracy.clone(),
            chain,
        })
    }

    /// State at the end of an experiment. Its prior (10° and 3 cm) and its window form the posterior.
    pub fn of_experiment(setup: &LaboratorySetup, form: LaboratoryForm, imu_noise: ImuNoise) -> Option<Self> {
        let window = setup.window();
        let chain = form.chain(&setup.mechanism);
        let linearization = window.linearize(&setup.mechanism.chain, form.parameterization, form.joint_offsets);
        let angles: Vec<&[f64]> = window.frames.iter().map(|frame| frame.joints_rad.as_slice()).collect();
        let free = setup.joints == JointKnowledge::Unknown && chain.joint_count() > 0;
        let rank = analyse(&linearization, &chain, &angles, free)?;
        let last = window.frames.last()?;
        let imu_noise = match setup.poses {
            PoseKnowledge::Imu { noise, .. } => noise,
            PoseKnowledge::Known => imu_noise,
        };
        Some(Self {
            camera: setup.camera.clone(),
            joints: setup.mechanism.joints.clone(),
            names: setup.mechanism.names.clone(),
            has_inaccurate_rotations: Dimension::Angle.scale() > INACCURATE_ROTATION_RAD,
            information: rank.posterior.information(),
            navigation: last.navigation,
            joints_rad: last.joints_rad.clone(),
            encoders: setup.joints,
            imu_noise,
            gravity_in_world: window.gravity_in_world,
            pixel_sigma_px: window.pixel_sigma_px,
            distances_m: window.landmarks.iter().map(|landmark| landmark.inverse_distance_per_m.recip()).collect(),
            image_period_s: FRAME_PERIOD_S,
            required: RequiredAccuracy::default(),
            chain,
        })
    }

    /// Names of the joints, from base to end effector.
    pub fn joint_names(&self) -> Vec<String> {
        self.joints.iter().map(|joint| joint.name.clone()).collect()
    }

    /// State before a flight: the IMU at rest at the origin and level, with the calibration known as well as the prior.
    ///
    /// `joints` has one entry per joint of the configured chain. The joints start in the middle: at zero, moved so that
    /// at least a quarter of the range lies on both sides. `encoder_sigma_rad` is the standard deviation of an encoder
    /// angle at an image. The required accuracy is the default. `None` when the calibration is fixed or a number is not finite.
    pub fn before_flight(
        config: &EstimatorConfig,
        joints: Vec<LaboratoryJoint>,
        names: ParameterNames,
        encoder_sigma_rad: Option<f64>,
        distances_m: Vec<f64>,
        image_period_s: f64,
    ) -> Option<Self> {
        let chain = Chain::from_classical(&config.chain, config.parameterization);
        // Without encoders the estimator fixes the joint offsets.
        let chain = if encoder_sigma_rad.is_some() { chain } else { chain.without_joint_offsets() };
        let (translation_m, rotation_rad) = config.extrinsics_sigmas(0);
        let scale = scale_of(&chain);
        let covariance = chain.prior_covariance(&config.chain, translation_m, rotation_rad);
        let scaled = DMatrix::from_fn(covariance.nrows(), covariance.ncols(), |row, column| {
            covariance[(row, column)] / (scale[row] * scale[column])
        });
        let joints_rad = joints.iter().map(|joint| middle_angle_rad(joint.limits_rad)).collect();
        config.calibrate.then_some(())?;
        Some(Self {
            camera: config.camera.clone(),
            joints,
            names,
            has_inaccurate_rotations: rotation_rad > INACCURATE_ROTATION_RAD,
            information: regular(scaled).cholesky()?.inverse(),
            navigation: NavigationState::default(),
            joints_rad,
            encoders: encoder_sigma_rad.map_or(JointKnowledge::Unknown, JointKnowledge::Encoder),
            imu_noise: config.imu_noise.scaled(config.options.imu_noise_factor),
            gravity_in_world: gravity_in_world(config.gravity_m_per_s2),
            pixel_sigma_px: config.options.pixel_sigma_px,
            distances_m,
            image_period_s,
            required: RequiredAccuracy::default(),
            chain,
        })
    }

    /// Distances of the scene's landmarks in metres; [`UNKNOWN_DISTANCE_M`] without landmarks.
    pub(super) fn scene_m(&self) -> &[f64] {
        if self.distances_m.is_empty() { &UNKNOWN_DISTANCE_M } else { &self.distances_m }
    }

    /// True if the joint angles are estimated without encoder readings.
    pub(super) fn joints_free(&self) -> bool {
        self.encoders == JointKnowledge::Unknown && self.chain.joint_count() > 0
    }

    /// True if the estimator makes keyframes by the motion of joints.
    pub(super) fn joints_make_keyframes(&self) -> bool {
        self.has_inaccurate_rotations && !self.joints_free()
    }

    /// One unit of each column: 10° or 3 cm.
    pub(super) fn scale(&self) -> DVector<f64> {
        scale_of(&self.chain)
    }
}

fn scale_of(chain: &Chain) -> DVector<f64> {
    let parameters = chain.parameters();
    DVector::from_iterator(parameters.len(), parameters.iter().map(|parameter| parameter.scale()))
}

/// Covariance with a floor on its diagonal, for columns that the prior fixes.
fn regular(mut covariance: DMatrix<f64>) -> DMatrix<f64> {
    for column in 0..covariance.ncols() {
        covariance[(column, column)] += 1.0 / KNOWN;
    }
    covariance
}

/// Marginal information of the first `count` columns; the columns of further cameras are marginalized.
fn marginal(information: DMatrix<f64>, count: usize) -> Option<DMatrix<f64>> {
    if information.ncols() <= count {
        return Some(information);
    }
    let covariance = information.cholesky()?.inverse();
    Some(covariance.view((0, 0), (count, count)).into_owned().cholesky()?.inverse())
}

/// Extends the information of the free columns to all columns; the others are known.
fn spread(information: &DMatrix<f64>, free: &[bool]) -> DMatrix<f64> {
    let mut places = vec![None; free.len()];
    for (place, column) in (0..free.len()).filter(|column| free[*column]).enumerate() {
        places[column] = Some(place);
    }
    DMatrix::from_fn(free.len(), free.len(), |row, column| match (places[row], places[column]) {
        (Some(row), Some(column)) => information[(row, column)],
        (None, None) if row == column => KNOWN,
        _ => 0.0,
    })
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}
