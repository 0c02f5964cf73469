//! The plan of a session: log, rigs, time span, and the runs with their main cameras.

use crate::flight_log::RigOfLog as _;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::distinct_labels;
use super::error::SessionError;
use super::flight_prior::FlightPrior;
use super::run_spec::{MAX_RUNS, ParameterizationChoice, RunSpec};
use super::trajectories::{self, LoadedPositions, LoadedTrajectory, LoadedTruth};
use super::trajectory_spec::{TrajectorySource, TrajectorySpec};
use crate::estimator::pose_columns;
use crate::files::LogLimits;
use crate::flight_log::{
    FlightLog, FollowOptions, LogWarning, MessageKind, WarningKind, image_stamps, imu_samples, is_batch_reference,
};
use crate::geometry::{RigidTransform, seconds_from_ns};
use crate::gimbal::{Chain, ParameterId, Parameterization};
use crate::sensors::{CameraRig, LeverArm, PoseTrack, Rig};
use crate::text::Named as _;

/// The arguments of a session, as on the command line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SessionRequest {
    pub log_path: PathBuf,
    /// Files of the recording that the log was converted from; empty for any other log.
    pub recording: Vec<PathBuf>,
    /// Path of the rig file; `None` if it is next to the log or inside it.
    pub rig_path: Option<PathBuf>,
    /// Path of the ground-truth rig file; `None` if it is next to the log.
    pub ground_truth_path: Option<PathBuf>,
    /// Specifications of the runs; empty means one `auto`.
    pub specs: Vec<RunSpec>,
    /// Trajectories of other programs, shown with the runs.
    pub trajectories: Vec<TrajectorySpec>,
    /// Ground truth of the trajectory, poses or positions, instead of the rig's topic.
    pub truth_trajectory: Option<TrajectorySource>,
    /// Lever arm of the antenna whose positions are the ground truth, instead of the rig's `ground_truth.lever_arm`.
    pub lever_arm: Option<LeverArm>,
    /// Required accuracy instead of the rig's, as in [`RequiredAccuracy::with`](crate::sensors::RequiredAccuracy::with).
    pub required_accuracy: Option<String>,
    /// Calibration of earlier flights that the runs start from.
    pub prior: Option<Arc<FlightPrior>>,
    /// Seconds to skip at the start of the log.
    pub start_s: f64,
    /// Seconds to read from there, `None` for the rest of the log.
    pub duration_s: Option<f64>,
    /// Limits on what is read of the log.
    pub limits: LogLimits,
    /// For a log that another program is writing: how it is read.
    pub following: Option<FollowOptions>,
}

/// A request with its log opened and a camera found for each run.
#[derive(Clone, Debug)]
pub struct SessionPlan {
    pub log: Arc<FlightLog>,
    pub log_path: PathBuf,
    /// Files of the recording that the log was converted from; empty for any other log.
    pub recording: Vec<PathBuf>,
    /// Path of the rig file, if it was given.
    pub rig_path: Option<PathBuf>,
    /// Path of the ground-truth rig file, if it was given.
    pub ground_truth_path: Option<PathBuf>,
    /// The rig whose calibration gives the priors of the runs.
    pub rig: Arc<Rig>,
    /// The ground-truth rig, if known.
    pub ground_truth_rig: Option<Arc<Rig>>,
    /// Calibration of earlier flights that the runs start from.
    pub prior: Option<Arc<FlightPrior>>,
    /// The runs, each with the key of its main camera.
    pub runs: Vec<(RunSpec, String)>,
    /// Cameras that runs of all cameras cannot use.
    pub warnings: Vec<LogWarning>,
    /// Trajectories of other programs, shown with the runs.
    pub trajectories: Vec<LoadedTrajectory>,
    /// Requested ground truth of the trajectory, and requested lever arm.
    pub truth_request: (Option<TrajectorySource>, Option<LeverArm>),
    /// Ground-truth poses over the whole log; `None` if nothing needs them.
    pub ground_truth_track: Option<Arc<PoseTrack>>,
    /// True if the ground truth is the reference of an offline calibration.
    pub truth_is_batch: bool,
    /// Antenna positions that are the ground truth.
    pub position_truth: Option<LoadedPositions>,
    /// Seconds to skip at the start of the log.
    pub start_s: f64,
    /// Seconds to read from there, `None` for the rest of the log.
    pub duration_s: Option<f64>,
    /// One report in this many frames keeps its linearization, from which covariances are computed; `None` keeps none.
    pub keep_linearization_every: Option<usize>,
    /// Memory budget of record and histories in bytes. Beyond it, only summaries of steps are kept, and steps at the
    /// cursor are recomputed.
    pub memory_budget_bytes: usize,
    /// Ends the computation after the current step once it is set, by any thread or a signal; computed steps are kept.
    pub interrupted: Arc<AtomicBool>,
}

/// Memory budget with which the whole process stays below 1.5 GiB while a log is played.
pub const DEFAULT_MEMORY_BUDGET_BYTES: usize = 1200 << 20;

impl SessionPlan {
    /// Opens the log and its rigs and finds each run's camera.
    pub fn open(request: &SessionRequest) -> Result<Self, SessionError> {
        let log = Arc::new(match &request.following {
            None => FlightLog::open_with(&request.log_path, &request.limits)?,
            Some(follow) => FlightLog::open_following(&request.log_path, &request.limits, follow.clone())?,
        });
        Self::of_log(request, log)
    }

    /// Finds the rigs of an open log and each run's camera.
    ///
    /// # Errors
    /// As [`SessionPlan::open`].
    pub fn of_log(request: &SessionRequest, log: Arc<FlightLog>) -> Result<Self, SessionError> {
        check_start(&log, request.start_s)?;
        let mut rig = Rig::for_log(&log, request.rig_path.as_deref())?;
        if let Some(text) = &request.required_accuracy {
            let required = rig.required_accuracy.with(text, &rig.parameter_names());
            rig.required_accuracy = required.map_err(|problem| SessionError::RequiredAccuracy { problem })?;
        }
        let ground_truth_rig = rig.own_ground_truth(&log, request.ground_truth_path.as_deref())?;
        let mut specs = request.specs.clone();
        if specs.is_empty() {
            specs.push(RunSpec::default());
        }
        if specs.len() > MAX_RUNS {
            return Err(SessionError::TooManyRuns { count: specs.len() });
        }
        distinct_labels(&mut specs);
        let warnings = specs.iter_mut().flat_map(|spec| name_usable_cameras(&log, &rig, spec)).collect();
        let runs = specs
            .into_iter()
            .map(|spec| cameras_of_run(&rig, &spec).map(|cameras| (spec, cameras.main.key.clone())))
            .collect::<Result<Vec<_>, _>>()?;
        let labels: Vec<&str> = runs.iter().map(|(spec, _)| spec.label.as_str()).collect();
        let span = (request.start_s, request.duration_s);
        let trajectories = trajectories::load(&log, &rig, &request.trajectories, &labels, span)?;
        let truth_request = (request.truth_trajectory.clone(), request.lever_arm);
        let positions_in_log = rig.ground_truth_topic.as_deref().is_some_and(|topic| log.is_position_topic(topic));
        let needed = truth_request != (None, None) || positions_in_log || !trajectories.is_empty();
        let truth = if needed {
            trajectories::ground_truth(&log, &rig, truth_request.0.as_ref(), truth_request.1)?
        } else {
            None
        };
        let (ground_truth_track, position_truth) = match truth {
            None => (None, None),
            Some(LoadedTruth::Poses(track)) => (Some(Arc::new(track)), None),
            Some(LoadedTruth::Positions(positions)) => (None, Some(positions)),
        };
        let truth_is_batch = matches!(&truth_request.0, Some(TrajectorySource::File(path)) if is_batch_reference(path));
        Ok(Self {
            trajectories,
            truth_is_batch,
            truth_request,
            ground_truth_track,
            position_truth,
            log,
            log_path: request.log_path.clone(),
            recording: request.recording.clone(),
            rig_path: request.rig_path.clone(),
            ground_truth_path: request.ground_truth_path.clone(),
            rig: Arc::new(rig),
            ground_truth_rig: ground_truth_rig.map(Arc::new),
            prior: request.prior.clone(),
            runs,
            warnings,
            start_s: request.start_s,
            duration_s: request.duration_s,
            keep_linearization_every: None,
            memory_budget_bytes: DEFAULT_MEMORY_BUDGET_BYTES,
            interrupted: Arc::default(),
        })
    }

    /// Poses that replace the ground truth of the log's frames, empty if the ground truth is antenna positions; `None`
    /// keeps the log's.
    pub(in crate::session) fn replaced_ground_truth(&self) -> Option<Arc<PoseTrack>> {
        self.truth_request.0.as_ref().map(|_| self.ground_truth_track.clone().unwrap_or_default())
    }

    /// The calibration parameters of its runs, in all parameterizations.
    pub fn parameters(&self) -> Vec<ParameterId> {
        let mut parameters: Vec<ParameterId> = Vec::new();
        for (spec, camera_key) in &self.runs {
            parameters.extend(chain_parameters(&self.rig, camera_key));
            let columns =
                |camera: &CameraRig| pose_columns(self.rig.camera_number(&camera.key), &RigidTransform::identity());
            let others = cameras_of_run(&self.rig, spec).map(|cameras| cameras.others).unwrap_or_default();
            parameters.extend(others.into_iter().flat_map(columns).map(|(id, _)| id));
        }
        let mut known = BTreeSet::new();
        parameters.retain(|parameter| known.insert(*parameter));
        parameters
    }
}

/// The parameters of a camera's chain in all parameterizations; some occur several times.
pub(in crate::session) fn chain_parameters(rig: &Rig, camera_key: &str) -> Vec<ParameterId> {
    let chain = rig.chain_of_camera(camera_key).unwrap_or_default();
    Parameterization::all().flat_map(|form| Chain::from_classical(&chain, form).parameters()).collect()
}

/// Returns an error if the start is after the end of the log.
pub(in crate::session) fn check_start(log: &FlightLog, start_s: f64) -> Result<(), SessionError> {
    let end_s = seconds_from_ns(log.duration_ns());
    if start_s > 0.0 && start_s >= end_s {
        return Err(SessionError::StartBeyondEnd { start_s, end_s, path: log.path().to_owned() });
    }
    Ok(())
}

#[derive(Clone, Debug)]
pub(in crate::session) struct RunCameras<'rig> {
    /// The camera whose image is shown.
    pub(in crate::session) main: &'rig CameraRig,
    /// The other cameras of a cluster, in the order of the rig.
    pub(in crate::session) others: Vec<&'rig CameraRig>,
}

impl<'rig> RunCameras<'rig> {
    /// The main camera, then the others.
    pub(in crate::session) fn iter(&self) -> impl Iterator<Item = &'rig CameraRig> {
        std::iter::once(self.main).chain(self.others.iter().copied())
    }
}

pub(in crate::session) fn cameras_of_run<'rig>(
    rig: &'rig Rig,
    spec: &RunSpec,
) -> Result<RunCameras<'rig>, SessionError> {
    let refused = |wanted: String| SessionError::NoCamera {
        run: spec.label.clone(),
        wanted,
        rig: rig.name.clone(),
        present: rig.cameras.iter().map(describe).collect::<Vec<_>>().join(", "),
    };
    if spec.parameterization == ParameterizationChoice::Cluster {
        return cluster(rig, spec, refused);
    }
    let (main, wanted) = match &spec.camera_key {
        Some(key) => (rig.camera(key).ok(), format!("camera '{key}'")),
        None if spec.parameterization == ParameterizationChoice::Static || rig.gimbal.is_none() => {
            (rig.cameras.iter().find(|camera| !camera.is_on_gimbal()), "a camera with mount: static".to_owned())
        }
        None => (rig.cameras.iter().find(|camera| camera.is_on_gimbal()), "a camera with mount: gimbal".to_owned()),
    };
    Ok(RunCameras { main: main.ok_or_else(|| refused(wanted))?, others: Vec::new() })
}

/// Names the cameras of a cluster of all cameras, if it cannot use others; returns a warning for each of those.
pub(in crate::session) fn name_usable_cameras(log: &Arc<FlightLog>, rig: &Rig, spec: &mut RunSpec) -> Vec<LogWarning> {
    // A cluster has at least two cameras, so that one of two is not left out.
    if spec.parameterization != ParameterizationChoice::Cluster
        || !spec.cluster_keys.is_empty()
        || rig.cameras.len() < 3
    {
        return Vec::new();
    }
    let imu_ns = imu_samples(log, rig).ok().and_then(|mut samples| samples.next()).map(|sample| sample.stamp_ns);
    let (mut usable, mut warnings) = (Vec::new(), Vec::new());
    for camera in &rig.cameras {
        match reason_against(log, rig, camera, imu_ns) {
            None => usable.push(camera.key.clone()),
            Some(reason) => {
                let message = format!("{} is not used by '{}': {reason}", camera.key, spec.label);
                warnings.push(LogWarning::new(WarningKind::Topics, &camera.topic, 0, message));
            }
        }
    }
    if usable.len() < 2 || warnings.is_empty() {
        return Vec::new();
    }
    spec.cluster_keys = usable;
    warnings
}

/// Reason why a cluster cannot use a camera, `None` if it can; `imu_ns` is the stamp of the first IMU sample.
fn reason_against(log: &Arc<FlightLog>, rig: &Rig, camera: &CameraRig, imu_ns: Option<i64>) -> Option<String> {
    if log.require_topic(&format!("{}.rostopic", camera.key), &camera.topic, &MessageKind::IMAGES).is_err() {
        return Some("the log has no images of its topic".to_owned());
    }
    if let Some(first) = rig.first_of_topic(camera) {
        return Some(format!("it has the topic of {}", first.key));
    }
    let image_ns = image_stamps(log, camera, 0).ok().and_then(|mut stamps| stamps.next())?;
    let apart_ns = (image_ns - imu_ns?).abs();
    (apart_ns > log.duration_ns()).then(|| {
        let apart_s = seconds_from_ns(apart_ns);
        format!("its first image is {apart_s:.1} s from the first IMU sample; check {}.timeshift_cam_imu", camera.key)
    })
}

/// Cameras of a cluster: those that it names, else all; the one on the gimbal is the main one.
fn cluster<'rig>(
    rig: &'rig Rig,
    spec: &RunSpec,
    refused: impl Fn(String) -> SessionError,
) -> Result<RunCameras<'rig>, SessionError> {
    let named = &spec.cluster_keys;
    if let Some(unknown) = named.iter().find(|key| rig.camera(key).is_err()) {
        return Err(refused(format!("camera '{unknown}'")));
    }
    let is_used = |camera: &&CameraRig| named.is_empty() || named.contains(&camera.key);
    let mut cameras: Vec<&CameraRig> = rig.cameras.iter().filter(is_used).collect();
    let main = if let Some(key) = &spec.camera_key {
        // Poses of cameras on the gimbal are relative to the first one, which is the main one where there are several.
        cameras.retain(|camera| camera.key == *key || !camera.is_on_gimbal());
        let camera = cameras.iter().find(|camera| camera.key == *key && camera.is_on_gimbal());
        *camera.ok_or_else(|| refused(format!("camera '{key}' with mount: gimbal")))?
    } else {
        let first = cameras.iter().find(|camera| camera.is_on_gimbal()).or_else(|| cameras.first());
        *first.ok_or_else(|| refused("a camera".to_owned()))?
    };
    cameras.retain(|camera| camera.key != main.key);
    if cameras.is_empty() {
        return Err(refused("a second camera".to_owned()));
    }
    Ok(RunCameras { main, others: cameras })
}

fn describe(camera: &CameraRig) -> String {
    let mount = if camera.is_on_gimbal() { "gimbal" } else { "static" };
    format!("{} (mount: {mount})", camera.key)
}
