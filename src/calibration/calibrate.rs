//! Stages of the calibration.

use std::ops::ControlFlow;

use nalgebra::{DMatrix, DVector, Vector3};

use super::border_prior::{BorderTerm, ChainTerm};
use super::bundle::{Priors, gimbal_view};
use super::frame_sets::{FrameSet, ImuBuffer, frame_sets};
use super::outcome::{
    CalibratedParameter, CalibrationOutcome, ExtrinsicsReport, ImuResidualReport, PixelReport, PoseLoopReport,
    Statistics,
};
use super::pose_loop::{PoseLoopSolution, PoseLoops, paired};
use super::rounds::{Stage, StageResult};
use super::segments::{self, Segment, SegmentCounts};
use super::state::{BundleEstimate, Camera, Columns};
use super::trajectory::{InitialTrajectory, batch_trajectory};
use super::{CalibrationError, CalibrationInput, CalibrationOptions, observations, trajectory};
use crate::estimator::factors::start_prior::StartPrior;
use crate::estimator::{
    CalibrationPosterior, CameraPosterior, ColumnBelief, ColumnBlock, ColumnId, ImuBias, Linearization,
    NavigationState, gravity_in_world, imu_factor,
};
use crate::geometry::{RigidTransform, seconds_from_ns};
use crate::gimbal::{Chain, ClassicalChain, ParameterId, Parameterization};
use crate::observability::{RankReport, analyse};
use crate::sensors::JointAngles;

/// Names of the stages in messages.
const ALONE: &str = "camera-IMU calibration";
const LOOPS: &str = "pose loops";
const BOTH: &str = "bundle adjustment of both cameras";

fn singular(stage: &'static str) -> CalibrationError {
    CalibrationError::Singular { stage }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationProgress {
    /// Name of the current stage.
    pub stage: &'static str,
    /// Completed fraction of the whole calibration, 0 to 1.
    pub fraction: f64,
}

/// Calibrates static camera and gimbal from a flight: static camera and IMU, then pose loops, then a bundle adjustment
/// of both cameras.
///
/// # Errors
///
/// If the flight does not constrain the calibration: no trajectory, no moving joint, too few pairs of camera poses. If
/// `on_progress` breaks, [`CalibrationError::Interrupted`].
pub fn calibrate(
    input: &CalibrationInput,
    options: &CalibrationOptions,
    on_progress: &mut dyn FnMut(CalibrationProgress) -> ControlFlow<()>,
) -> Result<CalibrationOutcome, CalibrationError> {
    let images = input.static_camera.views.len().max(1) as f64;
    let trajectory = trajectory::estimate_trajectory(&input.static_camera, &input.estimator, &mut |place| {
        report(on_progress, "processing the static camera", 0.5 * place as f64 / images)
    })?;
    calibrate_along(input, trajectory, options, on_progress)
}

/// [`calibrate`] with a given trajectory over all images of the static camera.
///
/// # Errors
///
/// As [`calibrate`].
pub fn calibrate_along(
    input: &CalibrationInput,
    trajectory: InitialTrajectory,
    options: &CalibrationOptions,
    on_progress: &mut dyn FnMut(CalibrationProgress) -> ControlFlow<()>,
) -> Result<CalibrationOutcome, CalibrationError> {
    let mut report_progress = |stage: &'static str, fraction: f64| report(on_progress, stage, fraction);
    let states = trajectory.states(&input.static_camera.key)?;
    let (mut frame_sets, navigation) = frame_sets(input, options, &states);
    let stretch_ns = stretch(&frame_sets);
    check_joint_motion(input, options, &frame_sets, stretch_ns)?;

    let priors = priors(input, options, &navigation);
    let stage = |name: &'static str| Stage {
        name,
        cameras: [&input.static_camera.model, &input.gimbal_camera.model],
        gravity_in_world: gravity_in_world(input.gravity_m_per_s2),
        priors: &priors,
        options,
        pose_covariances: options.pose_covariances && name == BOTH,
    };
    let first = given_estimate(input, &priors, &frame_sets, navigation);
    let static_tracks = observations::collect(input, options, &frame_sets, Camera::Static, &|_| true);
    let alone = stage(ALONE).run(&mut frame_sets, &static_tracks, first, &mut |round| {
        report_progress("calibrating the static camera", 0.5 + 0.05 * round as f64)
    })?;

    report_progress("reconstructing the gimbal camera's poses", 0.7)?;
    let (segments, counts) = segments::reconstruct(input, options, &frame_sets, &alone.estimate);
    check_measurements(options, &segments, counts, stretch_ns)?;
    report_progress("closing the pose loops", 0.75)?;
    let (loops, gaps_m) = close_loops(input, &priors, &frame_sets, &segments, &alone.estimate)?;

    let mut start = alone.estimate.clone();
    start.chain = loops.state.chain.clone();
    let mut measured = vec![false; frame_sets.len()];
    for (segment, joints_rad) in segments.iter().zip(&loops.state.joints_rad) {
        for (&frame_set, angles) in segment.frame_sets.iter().zip(joints_rad) {
            start.joints_rad[frame_set].clone_from(angles);
            measured[frame_set] = true;
        }
    }
    let mut tracks = static_tracks;
    tracks.extend(observations::collect(input, options, &frame_sets, Camera::Gimbal, &|frame_set| measured[frame_set]));
    tracks.sort_by_key(|track| track.observations[0].view);
    let both = stage(BOTH).run(&mut frame_sets, &tracks, start, &mut |round| {
        report_progress("bundle adjustment of both cameras", 0.8 + 0.05 * round as f64)
    })?;

    let visited_rad: Vec<Vec<f64>> =
        measured.iter().zip(&both.estimate.joints_rad).filter(|(used, _)| **used).map(|(_, q)| q.clone()).collect();
    let columns = both.columns();
    let chain_sigmas = |place: usize| both.covariance[(Columns::CHAIN + place, Columns::CHAIN + place)].max(0.0).sqrt();
    let pixels = |result: &StageResult, camera: Camera| pixel_report(input, result, camera);
    let imu = ImuBuffer::new(&input.static_camera.views);
    let gravity = gravity_in_world(input.gravity_m_per_s2);
    let poses = |StageResult { estimate, pose_covariances, .. }: &StageResult| {
        batch_trajectory(&imu, input.imu_noise, &gravity, &frame_sets, &estimate.navigation, pose_covariances)
    };
    Ok(CalibrationOutcome {
        stretch_ns,
        frame_sets: frame_sets.len(),
        static_camera_imu: extrinsics_report(input, &alone),
        static_pixels: pixels(&alone, Camera::Static).ok_or_else(|| singular(ALONE))?,
        pose_loop: PoseLoopReport {
            segments: segments.len(),
            pairs: segments.iter().map(|segment| segment.frame_sets.len()).sum(),
            fitting: loops.weights.iter().flatten().filter(|weight| **weight >= 0.5).count(),
            gaps_m,
            position_sigma_m: loops.position_sigma_m,
            chain: loops.state.chain.to_classical(),
            sigmas: loops.covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect(),
            iterations: loops.iterations,
        },
        extrinsics: extrinsics_report(input, &both),
        gimbal_time_shift_s: (
            both.estimate.shifts_s[1],
            both.covariance[(columns.gimbal_shift(), columns.gimbal_shift())].max(0.0).sqrt(),
        ),
        chain: both.estimate.chain.to_classical(),
        given_chain: input.gimbal_camera.chain.clone(),
        parameterization: both.estimate.chain.parameterization(),
        parameters: parameters(&priors.border.rig, &both.estimate.chain, &chain_sigmas),
        pixels: [
            pixels(&both, Camera::Static).ok_or_else(|| singular(BOTH))?,
            pixels(&both, Camera::Gimbal).ok_or_else(|| singular(BOTH))?,
        ],
        iterations: [alone.iterations, both.iterations],
        imu: imu_residual_report(input, &frame_sets, &both.estimate).ok_or_else(|| singular(BOTH))?,
        rank: rank(&both, &visited_rad),
        static_trajectory: poses(&alone),
        trajectory: poses(&both),
        warnings: warnings(counts, &segments, &frame_sets),
        posterior: posterior(&both, &priors.border),
        visited_rad,
    })
}

/// Values of the encoders, the rig and the trajectory, without landmarks; joint angles are zero where no encoder was read.
fn given_estimate(
    input: &CalibrationInput,
    priors: &Priors,
    frame_sets: &[FrameSet],
    navigation: Vec<NavigationState>,
) -> BundleEstimate {
    let joints = input.gimbal_camera.chain.joint_count();
    let angles_rad = |frame_set: &FrameSet| {
        frame_set.gimbal.as_ref().map_or_else(|| vec![0.0; joints], |gimbal| gimbal.encoder.angles_rad.clone())
    };
    BundleEstimate {
        joints_rad: frame_sets.iter().map(angles_rad).collect(),
        navigation,
        extrinsics: priors.border.extrinsics,
        shifts_s: priors.border.shifts_s,
        chain: priors.border.chain.given.clone(),
        landmarks: Vec::new(),
    }
}

/// Reports progress; an error if `on_progress` breaks.
fn report(
    on_progress: &mut dyn FnMut(CalibrationProgress) -> ControlFlow<()>,
    stage: &'static str,
    fraction: f64,
) -> Result<(), CalibrationError> {
    match on_progress(CalibrationProgress { stage, fraction }) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(CalibrationError::Interrupted { stage }),
    }
}

fn stretch(frame_sets: &[FrameSet]) -> (i64, i64) {
    (frame_sets.first().map_or(0, |first| first.stamp_ns), frame_sets.last().map_or(0, |last| last.stamp_ns))
}

/// Rejects flights without a moving joint: the variance of its readings must exceed their noise and the limit.
fn check_joint_motion(
    input: &CalibrationInput,
    options: &CalibrationOptions,
    frame_sets: &[FrameSet],
    (from_ns, to_ns): (i64, i64),
) -> Result<(), CalibrationError> {
    let gimbal = &input.gimbal_camera;
    let readings: Vec<&Vec<f64>> =
        frame_sets.iter().filter_map(|frame_set| Some(&frame_set.gimbal.as_ref()?.encoder.angles_rad)).collect();
    let count = readings.len().max(1) as f64;
    let noise = segments::encoder_sigma_rad(frame_sets).powi(2);
    // Three standard deviations of the estimated variance of the readings.
    let doubt = 3.0 * noise * (2.0 / count).sqrt();
    let mut moving = false;
    let mut spreads = Vec::new();
    for (joint, name) in gimbal.joints.iter().enumerate() {
        let angles: Vec<f64> = readings.iter().filter_map(|reading| reading.get(joint).copied()).collect();
        let variance = Statistics::of(&angles).map_or(0.0, |statistics| statistics.std.powi(2));
        moving |= variance - noise > options.min_joint_motion_rad.powi(2) + doubt;
        spreads.push(format!("{name} {:.1}°", (variance - noise).max(0.0).sqrt().to_degrees()));
    }
    if moving || readings.is_empty() {
        return Ok(());
    }
    Err(CalibrationError::NoJointMotion {
        limit_deg: options.min_joint_motion_rad.to_degrees(),
        from_s: seconds_from_ns(from_ns),
        to_s: seconds_from_ns(to_ns),
        spreads: spreads.join(", "),
    })
}

fn check_measurements(
    options: &CalibrationOptions,
    segments: &[Segment],
    counts: SegmentCounts,
    (from_ns, to_ns): (i64, i64),
) -> Result<(), CalibrationError> {
    let found: usize = segments.iter().map(|segment| segment.frame_sets.len()).sum();
    if found >= options.min_measurements {
        return Ok(());
    }
    let SegmentCounts { offered, broken, unsolved } = counts;
    Err(CalibrationError::TooFewMeasurements {
        found,
        needed: options.min_measurements,
        from_s: seconds_from_ns(from_ns),
        to_s: seconds_from_ns(to_ns),
        reason: format!(
            "frame sets with a gimbal image and encoder readings: {offered}, too few common features in {broken}, too \
             little parallax in {unsolved}"
        ),
    })
}

fn priors(input: &CalibrationInput, options: &CalibrationOptions, navigation: &[NavigationState]) -> Priors {
    Priors {
        border: BorderTerm::new(input, options),
        start: StartPrior {
            reference: navigation.first().map_or_else(RigidTransform::identity, |first| first.world_from_imu),
            bias: ImuBias::default(),
            gyroscope_bias_sigma: Vector3::repeat(options.bias_sigmas.0),
            accelerometer_bias_sigma: Vector3::repeat(options.bias_sigmas.1),
            gimbal_bias_sigmas: None,
        },
    }
}

/// Solves the pose loops and returns the statistics of their gaps.
fn close_loops(
    input: &CalibrationInput,
    priors: &Priors,
    frame_sets: &[FrameSet],
    segments: &[Segment],
    estimate: &BundleEstimate,
) -> Result<(PoseLoopSolution, Statistics), CalibrationError> {
    let gravity = gravity_in_world(input.gravity_m_per_s2);
    let pairs = paired(
        segments,
        &|frame_set| estimate.world_from_imu(gimbal_view(frame_set), frame_sets, &gravity),
        &|frame_set| {
            let none = JointAngles::default;
            frame_sets[frame_set].gimbal.as_ref().map_or_else(none, |gimbal| gimbal.encoder.clone())
        },
    );
    let solution = PoseLoops::new(&pairs, &priors.border.chain).solve().ok_or_else(|| singular(LOOPS))?;
    let gaps = Statistics::of(&solution.gaps_m).ok_or_else(|| singular(LOOPS))?;
    Ok((solution, gaps))
}

fn extrinsics_report(input: &CalibrationInput, result: &StageResult) -> ExtrinsicsReport {
    let sigma = |column: usize| result.covariance[(column, column)].max(0.0).sqrt();
    ExtrinsicsReport {
        initial: input.static_camera.imu_from_camera,
        imu_from_camera: result.estimate.extrinsics,
        sigmas: std::array::from_fn(|axis| sigma(Columns::EXTRINSICS + axis)),
        time_shift_s: (result.estimate.shifts_s[0], sigma(Columns::STATIC_SHIFT)),
    }
}

/// Calibration of the gimbal camera, then of the static one, with their joint covariance; time offsets relative to the
/// rig's.
fn posterior(result: &StageResult, prior: &BorderTerm) -> CalibrationPosterior {
    let (columns, estimate) = (result.columns(), &result.estimate);
    let chain: Vec<usize> = (Columns::CHAIN..=columns.gimbal_shift()).collect();
    let order: Vec<usize> = chain.iter().copied().chain(0..=Columns::STATIC_SHIFT).collect();
    let ordered = |covariance: &DMatrix<f64>| covariance.select_rows(&order).select_columns(&order);
    let mount = |imu_from_camera: RigidTransform| {
        let mount = ClassicalChain { imu_from_base: imu_from_camera, ..ClassicalChain::default() };
        Chain::from_classical(&mount, Parameterization::Minimal)
    };
    let values = |chain: &Chain, shift_s: f64| chain.values().iter().copied().chain([shift_s]).collect::<Vec<f64>>();
    let camera = |chain: &Chain, shift_s: f64, columns: &[usize]| CameraPosterior {
        chain: chain.to_classical(),
        parameterization: chain.parameterization(),
        parameters: chain.parameters().into_iter().chain([ParameterId::timeshift(0)]).collect(),
        values: values(chain, shift_s),
        rig_sigmas: columns.iter().map(|column| prior.rig_sigmas[*column]).collect(),
    };
    let (of_gimbal, of_static) = order.split_at(chain.len());
    let before = [(&prior.chain.given, prior.shifts_s[1]), (&mount(prior.extrinsics), prior.shifts_s[0])];
    CalibrationPosterior {
        cameras: vec![
            camera(&estimate.chain, estimate.shifts_s[1], of_gimbal),
            camera(&mount(estimate.extrinsics), estimate.shifts_s[0], of_static),
        ],
        covariance: ordered(&result.covariance),
        before: prior.covariance().map(|covariance| ColumnBelief {
            values: before.into_iter().flat_map(|(chain, shift_s)| values(chain, shift_s)).collect(),
            covariance: ordered(&covariance),
        }),
    }
}

fn parameters(prior: &ChainTerm, chain: &Chain, sigma: &dyn Fn(usize) -> f64) -> Vec<CalibratedParameter> {
    let (initial, values) = (prior.given.values(), chain.values_from(&prior.given));
    chain
        .parameters()
        .into_iter()
        .enumerate()
        .map(|(place, parameter)| CalibratedParameter {
            parameter,
            initial: initial[place],
            value: values[place],
            sigma: sigma(place),
            prior_sigma: prior.prior_sigmas[place],
        })
        .collect()
}

fn pixel_report(input: &CalibrationInput, result: &StageResult, camera: Camera) -> Option<PixelReport> {
    let camera_index = usize::from(camera == Camera::Gimbal);
    let sees = |track: &&super::visual::BundleTrack| {
        track.observations.iter().any(|observation| observation.view.camera() == camera)
    };
    Some(PixelReport {
        camera: [&input.static_camera.key, &input.gimbal_camera.key][camera_index].clone(),
        landmarks: result.tracks.iter().filter(sees).count(),
        residuals_px: Statistics::of(&result.residuals_px[camera_index])?,
        sigma_px: result.sigma_px[camera_index],
    })
}

/// Rotation and velocity residuals of the IMU intervals, divided by their duration.
fn imu_residual_report(
    input: &CalibrationInput,
    frame_sets: &[FrameSet],
    estimate: &BundleEstimate,
) -> Option<ImuResidualReport> {
    let gravity: Vector3<f64> = gravity_in_world(input.gravity_m_per_s2);
    let (mut gyroscope, mut accelerometer) = (Vec::new(), Vec::new());
    for index in 1..frame_sets.len() {
        let Some((motion, _)) = &frame_sets[index].motion else { continue };
        let residual =
            imu_factor::residual(motion, &estimate.navigation[index - 1], &estimate.navigation[index], &gravity, None);
        gyroscope.push(residual.fixed_rows::<3>(0).norm() / motion.duration_s());
        accelerometer.push(residual.fixed_rows::<3>(6).norm() / motion.duration_s());
    }
    Some(ImuResidualReport {
        gyroscope_rad_per_s: Statistics::of(&gyroscope)?,
        accelerometer_m_per_s2: Statistics::of(&accelerometer)?,
    })
}

/// Ranks of the chain over the whole flight, all other unknowns eliminated.
fn rank(result: &StageResult, visited_rad: &[Vec<f64>]) -> Option<RankReport> {
    let chain = &result.estimate.chain;
    let count = chain.dof();
    let place = (Columns::CHAIN, Columns::CHAIN);
    let block = |matrix: &DMatrix<f64>| matrix.view(place, (count, count)).into_owned();
    // Besides the chain, the border has extrinsics and time offsets: the marginal information of the chain is the
    // inverse of its covariance.
    let with_priors = block(&result.covariance).cholesky()?.inverse();
    let priors = block(&result.prior_information);
    let measured = &with_priors - &priors;
    let square_root = |matrix: DMatrix<f64>| {
        let eigen = matrix.symmetric_eigen();
        let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
        DMatrix::from_diagonal(&roots) * eigen.eigenvectors.transpose()
    };
    let linearization = Linearization {
        columns: chain
            .parameters()
            .into_iter()
            .enumerate()
            .map(|(start, parameter)| ColumnBlock { id: ColumnId::Calibration(parameter), start, len: 1 })
            .collect(),
        fixed_parameters: Vec::new(),
        calibration_column_norms: DVector::from_fn(count, |k, _| measured[(k, k)].max(0.0).sqrt()),
        jacobian: square_root(measured),
        prior_jacobian: square_root(priors),
        rig_prior_rows: count,
        chain: chain.clone(),
    };
    analyse(&linearization, chain, visited_rad, false)
}

fn warnings(counts: SegmentCounts, segments: &[Segment], frame_sets: &[FrameSet]) -> Vec<String> {
    let mut warnings = Vec::new();
    let used: usize = segments.iter().map(|segment| segment.frame_sets.len()).sum();
    let missing = frame_sets.len() - counts.offered;
    if missing > 0 {
        warnings
            .push(format!("{missing} of {} frame sets have no gimbal image with encoder readings", frame_sets.len()));
    }
    if 2 * used < counts.offered {
        warnings.push(format!(
            "relative pose from only {used} of {} gimbal images: too few common features in {}, too little parallax in {}",
            counts.offered, counts.broken, counts.unsolved
        ));
    }
    warnings
}
