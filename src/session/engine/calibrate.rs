//! Offline calibration of a log: features of both cameras are tracked first, then the calibration is estimated, from the
//! posterior of earlier flights if there is one; errors against ground truth by stage.

use crate::flight_log::RigOfLog as _;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};

use serde::Serialize;
use thiserror::Error;

use super::configuration::estimator_config;
use super::tracker::CameraTracker;
use crate::calibration::{
    self, CalibrationError, CalibrationInput, CalibrationOptions, CalibrationOutcome, CalibrationProgress,
    ChainDistance, EarlierFlights, GimbalCamera, InitialTrajectory, StaticCamera, TrackedView,
};
use crate::estimator::CalibrationPosterior;
use crate::files::LogLimits;
use crate::flight_log::{FlightLog, LogError, LogWarning};
use crate::geometry::{Dimension, RigidTransform, ns_from_seconds, seconds_from_ns};
use crate::gimbal::{ClassicalChain, ParameterId, Parameterization};
use crate::sensors::{CameraMount, CameraRig, ChainPrior, GimbalRig, Rig};
use crate::session::plan::{FlightPrior, ParameterizationChoice, RunSpec, SessionError, check_start};

/// Fraction of the progress that feature tracking takes.
const TRACKING_RATIO: f64 = 0.6;
/// Name of the tracking stage in messages.
const TRACKING: &str = "tracking both cameras";
/// Ratio of the bound of a uniform error to its standard deviation: √3.
const BOUND_PER_SIGMA: f64 = 1.732_050_807_568_877_2;

/// The reason why the calibration from a log failed.
#[derive(Debug, Error)]
pub enum CalibrationRunError {
    /// The log, its rig or its ground truth cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A run could not be configured.
    #[error(transparent)]
    Session(#[from] SessionError),
    #[error("the rig '{rig}' has no {missing}; {remedy}: {path}")]
    Missing { rig: String, missing: &'static str, remedy: &'static str, path: PathBuf },
    /// The calibration is not observable from the log, or does not converge.
    #[error("{reason}: {path}")]
    Calibration { reason: CalibrationError, path: PathBuf },
    /// The camera's images could not be read to the end.
    #[error("internal error while tracking {camera}; please report it with the log: {path}")]
    Tracking { camera: String, path: PathBuf },
}

/// The arguments of an offline calibration, as on the command line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CalibrationRequest {
    pub log_path: PathBuf,
    /// Path of the rig file; `None` if it is next to the log or inside it.
    pub rig_path: Option<PathBuf>,
    /// Path of the ground-truth rig file; `None` if it is next to the log.
    pub ground_truth_path: Option<PathBuf>,
    /// Calibration of earlier flights that the calibration starts from.
    pub prior: Option<Arc<FlightPrior>>,
    /// Seconds to skip at the start of the log.
    pub start_s: f64,
    /// Seconds to read from there, `None` for the rest of the log.
    pub duration_s: Option<f64>,
    /// Limits on what is read of the log.
    pub limits: LogLimits,
}

/// The result of an offline calibration.
#[derive(Clone, Debug)]
pub struct CalibrationRun {
    pub log_path: PathBuf,
    /// Time of the log's first message, to which stamps are relative, in nanoseconds.
    pub epoch_ns: i64,
    /// The rig before the calibration, which gave the initial values.
    pub given_rig: Rig,
    /// The rig with the calibrated values and a prior from their standard deviations.
    pub rig: Rig,
    /// The ground-truth rig, when known.
    pub ground_truth_rig: Option<Rig>,
    pub static_camera: String,
    pub gimbal_camera: String,
    /// Estimates, covariances and residuals.
    pub outcome: CalibrationOutcome,
    /// Calibration of gimbal camera and static camera with their joint covariance, as prior of another flight.
    pub posterior: CalibrationPosterior,
    /// Calibration of earlier flights that it started from.
    pub prior: Option<Arc<FlightPrior>>,
    /// Warnings of the reader about the log.
    pub warnings: Vec<LogWarning>,
}

/// Tracks both cameras over the log and calibrates.
///
/// # Errors
/// If the log cannot be read, the rig lacks a camera or encoders, the calibration is not observable, or `on_progress`
/// breaks ([`CalibrationError::Interrupted`]).
pub fn calibrate(
    request: &CalibrationRequest,
    options: &CalibrationOptions,
    on_progress: &mut dyn FnMut(CalibrationProgress) -> ControlFlow<()>,
) -> Result<CalibrationRun, CalibrationRunError> {
    let log = Arc::new(FlightLog::open_with(&request.log_path, &request.limits)?);
    check_start(&log, request.start_s)?;
    let given_rig = Rig::for_log(&log, request.rig_path.as_deref())?;
    let ground_truth_rig = given_rig.own_ground_truth(&log, request.ground_truth_path.as_deref())?;
    let entries = CalibratedEntries::of(&given_rig, request)?;
    let mounts = (entries.imu_from_camera, &entries.gimbal);
    let cameras = [&entries.static_camera, &entries.gimbal_camera];
    let earlier = request.prior.as_ref().map(|prior| earlier_flights(prior, cameras, mounts)).transpose()?;
    let (mut input, trajectory, warnings) = track(&log, &given_rig, &entries, request, on_progress)?;
    input.earlier = earlier;
    let outcome = calibration::calibrate_along(&input, trajectory, options, &mut |progress| {
        on_progress(CalibrationProgress {
            fraction: TRACKING_RATIO + (1.0 - TRACKING_RATIO) * progress.fraction,
            ..progress
        })
    })
    .map_err(|reason| CalibrationRunError::Calibration { reason, path: request.log_path.clone() })?;
    Ok(CalibrationRun {
        log_path: request.log_path.clone(),
        epoch_ns: log.epoch_ns(),
        rig: calibrated(&given_rig, &entries, &outcome),
        posterior: with_absolute_shifts(&outcome.posterior, [&entries.gimbal_camera, &entries.static_camera]),
        prior: request.prior.clone(),
        static_camera: entries.static_camera.key.clone(),
        gimbal_camera: entries.gimbal_camera.key.clone(),
        given_rig,
        ground_truth_rig,
        outcome,
        warnings,
    })
}

#[derive(Clone, Debug)]
struct CalibratedEntries {
    static_camera: CameraRig,
    imu_from_camera: RigidTransform,
    gimbal_camera: CameraRig,
    gimbal: GimbalRig,
}

impl CalibratedEntries {
    fn of(rig: &Rig, request: &CalibrationRequest) -> Result<Self, CalibrationRunError> {
        let missing = |missing: &'static str, remedy: &'static str| CalibrationRunError::Missing {
            rig: rig.name.clone(),
            missing,
            remedy,
            path: request.log_path.clone(),
        };
        let gimbal = rig.gimbal.clone().filter(|gimbal| !gimbal.joints.is_empty()).ok_or_else(|| {
            missing("gimbal", "offline calibration requires a gimbal; for a rigid camera use 'dcvins run --run static'")
        })?;
        let gimbal_camera = rig
            .cameras
            .iter()
            .find(|camera| camera.mount == CameraMount::Gimbal)
            .ok_or_else(|| missing("camera with mount: gimbal", "declare the camera on the gimbal in the rig"))?;
        let found = rig.cameras.iter().find_map(|camera| match &camera.mount {
            CameraMount::Static { imu_from_camera } => Some((camera, *imu_from_camera)),
            CameraMount::Gimbal => None,
        });
        let (static_camera, imu_from_camera) = found.ok_or_else(|| {
            missing(
                "camera with mount: static",
                "offline calibration requires a static camera as reference; record one, or calibrate online with 'dcvins run --run auto'",
            )
        })?;
        if gimbal.encoder_sigma_rad.is_none() || gimbal.topic.is_none() {
            return Err(missing(
                "encoders (gimbal.rostopic and gimbal.encoder_sigma)",
                "offline calibration requires joint angles; calibrate online with 'dcvins run --run auto:encoder=off'",
            ));
        }
        Ok(Self { static_camera: static_camera.clone(), imu_from_camera, gimbal_camera: gimbal_camera.clone(), gimbal })
    }
}

/// Tracks the features of both cameras, each on its own thread; a third thread estimates the static camera's trajectory
/// while its images are tracked.
fn track(
    log: &Arc<FlightLog>,
    rig: &Rig,
    entries: &CalibratedEntries,
    request: &CalibrationRequest,
    on_progress: &mut dyn FnMut(CalibrationProgress) -> ControlFlow<()>,
) -> Result<(CalibrationInput, InitialTrajectory, Vec<LogWarning>), CalibrationRunError> {
    let spec = RunSpec {
        parameterization: ParameterizationChoice::Static,
        camera_key: Some(entries.static_camera.key.clone()),
        ..RunSpec::default()
    };
    let mut estimator = estimator_config(rig, &spec)?;
    estimator.options.keep_linearization = false;
    let mut trajectory = InitialTrajectory::new(estimator.clone());
    let tracker =
        |camera: &CameraRig| CameraTracker::new(Arc::clone(log), rig, &camera.key, request.start_s, request.duration_s);
    let (mut of_static, mut of_gimbal) = (tracker(&entries.static_camera)?, tracker(&entries.gimbal_camera)?);
    let end_s = seconds_from_ns(log.duration_ns()) - request.start_s;
    let length_s = request.duration_s.map_or(end_s, |duration_s| duration_s.min(end_s)).max(1e-3);
    let interrupted = AtomicBool::new(false);
    let (static_result, gimbal_result) = std::thread::scope(|scope| {
        let gimbal = scope.spawn(|| {
            views(&mut of_gimbal, &entries.gimbal_camera, &mut |_| {
                if interrupted.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })
        });
        let (tracked, to_estimate) = mpsc::channel::<TrackedView>();
        let (trajectory, interrupted) = (&mut trajectory, &interrupted);
        scope.spawn(move || {
            let wanted = |_: &TrackedView| !interrupted.load(Ordering::Relaxed);
            to_estimate.into_iter().take_while(wanted).for_each(|view| trajectory.step(&view));
        });
        let rigid = views(&mut of_static, &entries.static_camera, &mut |view| {
            let fraction = TRACKING_RATIO * (seconds_from_ns(view.stamp_ns) - request.start_s) / length_s;
            let flow = on_progress(CalibrationProgress { stage: TRACKING, fraction });
            interrupted.fetch_or(flow.is_break(), Ordering::Relaxed);
            // The receiver is missing only after a thread has panicked; the scope then panics, too.
            drop(tracked.send(view.clone()));
            flow
        });
        drop(tracked);
        (rigid, gimbal.join())
    });
    if interrupted.into_inner() {
        let reason = CalibrationError::Interrupted { stage: TRACKING };
        return Err(CalibrationRunError::Calibration { reason, path: request.log_path.clone() });
    }
    let Ok((gimbal_views, gimbal_warnings)) = gimbal_result else {
        let camera = entries.gimbal_camera.key.clone();
        return Err(CalibrationRunError::Tracking { camera, path: request.log_path.clone() });
    };
    let (static_views, mut warnings) = static_result;
    warnings.extend(gimbal_warnings);
    warnings.extend(log.warnings().iter().cloned());
    warnings.sort_by(|a, b| (a.stamp_ns, &a.message).cmp(&(b.stamp_ns, &b.message)));
    warnings.dedup();
    let input = CalibrationInput {
        static_camera: StaticCamera {
            key: entries.static_camera.key.clone(),
            model: entries.static_camera.model.clone(),
            imu_from_camera: entries.imu_from_camera,
            prior: rig.extrinsics_prior(&entries.static_camera),
            views: static_views,
        },
        gimbal_camera: GimbalCamera {
            key: entries.gimbal_camera.key.clone(),
            model: entries.gimbal_camera.model.clone(),
            chain: entries.gimbal.chain.clone(),
            joints: entries.gimbal.joints.iter().map(|joint| joint.name.clone()).collect(),
            prior: rig.extrinsics_prior(&entries.gimbal_camera),
            views: gimbal_views,
        },
        imu_noise: rig.imu.noise,
        gravity_m_per_s2: rig.gravity_m_per_s2,
        earlier: None,
        estimator,
    };
    Ok((input, trajectory, warnings))
}

/// The tracked images of a camera, up to the image at which `on_image` breaks, with the warnings of the reader.
fn views(
    tracker: &mut CameraTracker,
    camera: &CameraRig,
    on_image: &mut dyn FnMut(&TrackedView) -> ControlFlow<()>,
) -> (Vec<TrackedView>, Vec<LogWarning>) {
    let shift_ns = ns_from_seconds(camera.timeshift_cam_imu_s);
    let (mut views, mut warnings) = (Vec::new(), Vec::new());
    while let Some((input, of_input)) = tracker.next_input() {
        let view = TrackedView {
            frame_index: input.frame_index,
            stamp_ns: input.stamp_ns.saturating_add(shift_ns),
            tracks: Arc::clone(input.main_tracks()),
            imu: input.imu,
            joint_angles: input.joint_angles,
        };
        if on_image(&view).is_break() {
            break;
        }
        warnings.extend(of_input);
        views.push(view);
    }
    warnings.extend_from_slice(tracker.remaining_warnings());
    (views, warnings)
}

/// The rig with the calibrated values. Its prior bounds are √3 times the largest standard deviation of a parameter,
/// because they are bounds of a uniform error.
fn calibrated(rig: &Rig, entries: &CalibratedEntries, outcome: &CalibrationOutcome) -> Rig {
    let mut calibrated = rig.clone();
    let largest = |dimension: Dimension| {
        let sigmas = outcome.parameters.iter().filter(|found| found.parameter.dimension() == dimension);
        BOUND_PER_SIGMA * sigmas.map(|parameter| parameter.sigma).fold(0.0, f64::max)
    };
    for camera in &mut calibrated.cameras {
        if camera.key == entries.static_camera.key {
            camera.mount = CameraMount::Static { imu_from_camera: outcome.extrinsics.imu_from_camera };
            camera.timeshift_cam_imu_s += outcome.extrinsics.time_shift_s.0;
        } else if camera.key == entries.gimbal_camera.key {
            camera.timeshift_cam_imu_s += outcome.gimbal_time_shift_s.0;
        }
    }
    if let Some(gimbal) = &mut calibrated.gimbal {
        gimbal.set_chain(outcome.chain.clone());
        gimbal.prior = ChainPrior {
            translation_bound_m: largest(Dimension::Length),
            rotation_bound_rad: largest(Dimension::Angle),
        };
    }
    calibrated
}

/// Prior of an offline calibration of the static camera and the gimbal camera; `mounts` are the `imu_from_camera` of the
/// first and the gimbal of the second.
///
/// # Errors
/// If the posterior belongs to another mechanism, or to a parameterization that the offline calibration does not have.
pub(super) fn earlier_flights(
    prior: &FlightPrior,
    cameras: [&CameraRig; 2],
    (imu_from_camera, gimbal): (RigidTransform, &GimbalRig),
) -> Result<EarlierFlights, SessionError> {
    let user = "the offline calibration".to_owned();
    let refused = |problem: String| SessionError::Prior { user, problem, folder: prior.folder.clone() };
    let places = cameras.map(|camera| prior.place(&camera.key));
    let check = || {
        prior.check_cameras(&cameras.map(|camera| camera.key.as_str()), &places)?;
        let joints: Vec<String> = gimbal.joints.iter().map(|joint| joint.name.clone()).collect();
        let mount = ClassicalChain { imu_from_base: imu_from_camera, ..ClassicalChain::default() };
        for (place, chain) in places.into_iter().zip([&mount, &gimbal.chain]) {
            let Some(place) = place else { continue };
            prior.check_chain(place, chain, &joints, true)?;
            let parameterization = prior.posterior.cameras[place].parameterization;
            if matches!(parameterization, Parameterization::Classical | Parameterization::Poe) {
                return Err(format!(
                    "its parameterization is {parameterization}, the offline calibration needs a minimal one"
                ));
            }
        }
        Ok(())
    };
    check().map_err(refused)?;
    let given_shifts_s = cameras.map(|camera| camera.timeshift_cam_imu_s);
    Ok(EarlierFlights { posterior: prior.posterior.grown(prior.growth), places, given_shifts_s })
}

/// Posterior with the time offsets of its cameras instead of their changes against the rig; `cameras` are in its order.
pub(super) fn with_absolute_shifts(posterior: &CalibrationPosterior, cameras: [&CameraRig; 2]) -> CalibrationPosterior {
    let mut absolute = posterior.clone();
    let mut before = absolute.before.iter_mut().flat_map(|before| &mut before.values);
    for (found, camera) in absolute.cameras.iter_mut().zip(cameras) {
        let given_shift = |parameter: &ParameterId| {
            if *parameter == ParameterId::timeshift(0) { camera.timeshift_cam_imu_s } else { 0.0 }
        };
        for (parameter, value) in found.parameters.iter().zip(&mut found.values) {
            *value += given_shift(parameter);
            if let Some(before) = before.next() {
                *before += given_shift(parameter);
            }
        }
    }
    absolute
}

/// Errors of `imu_from_camera` against the ground truth; for a chain, over the joint angles of the log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalibrationErrors {
    /// Static camera in the given rig.
    pub static_initial: ChainDistance,
    /// Static camera after the camera–IMU calibration of the static camera alone.
    pub static_camera_imu: ChainDistance,
    /// Static camera after the bundle adjustment of both cameras.
    pub static_final: ChainDistance,
    /// Chain in the given rig.
    pub chain_initial: ChainDistance,
    /// Chain after the pose loops.
    pub chain_pose_loop: ChainDistance,
    /// Chain after the bundle adjustment of both cameras.
    pub chain_final: ChainDistance,
}

impl CalibrationRun {
    /// Errors against ground truth; `None` without a ground-truth rig with this static camera and a gimbal of as many
    /// joints.
    pub fn errors(&self) -> Option<CalibrationErrors> {
        let outcome = &self.outcome;
        let extrinsics = self.true_extrinsics()?;
        let chain = &self.ground_truth_rig.as_ref()?.gimbal.as_ref()?.chain;
        if chain.joint_count() != outcome.chain.joint_count() {
            return None;
        }
        let of_extrinsics = |found: &RigidTransform| ChainDistance::of_extrinsics(found, &extrinsics);
        let of_chain = |found: &ClassicalChain| ChainDistance::over(found, chain, &outcome.visited_rad);
        Some(CalibrationErrors {
            static_initial: of_extrinsics(&outcome.extrinsics.initial),
            static_camera_imu: of_extrinsics(&outcome.static_camera_imu.imu_from_camera),
            static_final: of_extrinsics(&outcome.extrinsics.imu_from_camera),
            chain_initial: of_chain(&outcome.given_chain)?,
            chain_pose_loop: of_chain(&outcome.pose_loop.chain)?,
            chain_final: of_chain(&outcome.chain)?,
        })
    }

    /// `imu_from_camera` of the static camera in the ground-truth rig; `None` without one.
    pub fn true_extrinsics(&self) -> Option<RigidTransform> {
        let cameras = &self.ground_truth_rig.as_ref()?.cameras;
        match cameras.iter().find(|camera| camera.key == self.static_camera)?.mount {
            CameraMount::Static { imu_from_camera } => Some(imu_from_camera),
            CameraMount::Gimbal => None,
        }
    }
}
