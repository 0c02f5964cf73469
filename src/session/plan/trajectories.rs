//! Trajectories of other programs as poses on the clock of the log.

use nalgebra::{UnitQuaternion, Vector3};

use super::error::SessionError;
use super::trajectory_spec::{MAX_TRAJECTORIES, TrajectorySource, TrajectorySpec, distinct_trajectory_labels};
use crate::flight_log::stamps::clock::StampClock;
use crate::flight_log::{FlightLog, LogError, RecordedPose, read_trajectory_file};
use crate::geometry::{RigidTransform, ns_from_seconds, seconds_from_ns};
use crate::sensors::{LeverArm, PoseSample, PoseTrack, PositionSample, Rig};

/// A loaded trajectory, on the clock of the log.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedTrajectory {
    /// Source and label; the label is unique among trajectories and runs.
    pub spec: TrajectorySpec,
    /// Poses within the time of the session.
    pub track: PoseTrack,
}

/// Loads the trajectories of a request.
///
/// # Errors
/// If there are too many, or if one cannot be read, has no attitudes, or has no pose within the time of the session.
pub(super) fn load(
    log: &FlightLog,
    rig: &Rig,
    specs: &[TrajectorySpec],
    run_labels: &[&str],
    (start_s, duration_s): (f64, Option<f64>),
) -> Result<Vec<LoadedTrajectory>, SessionError> {
    if specs.len() > MAX_TRAJECTORIES {
        return Err(SessionError::TooManyTrajectories { count: specs.len() });
    }
    let mut specs = specs.to_vec();
    distinct_trajectory_labels(&mut specs, run_labels);
    let begin_ns = ns_from_seconds(start_s);
    let end_ns = duration_s.map_or_else(|| log.duration_ns(), |duration_s| begin_ns + ns_from_seconds(duration_s));
    let of_spec = |spec: TrajectorySpec| {
        let poses = recorded(log, rig, &spec.source)?;
        let refuse = |problem: String| SessionError::Trajectory { source_name: spec.source.to_string(), problem };
        let sample = |pose: &RecordedPose| {
            let stamp_ns = pose.stamp_ns.checked_sub(log.epoch_ns())?;
            let world_from_imu = RigidTransform::new(pose.rotation?, pose.position_m);
            (begin_ns..=end_ns).contains(&stamp_ns).then_some(PoseSample { stamp_ns, world_from_imu })
        };
        if poses.iter().all(|pose| pose.rotation.is_none()) {
            return Err(refuse("it has positions without attitudes; a comparison needs poses".to_owned()));
        }
        let samples: Vec<PoseSample> = poses.iter().filter_map(sample).collect();
        if samples.is_empty() {
            return Err(refuse(no_overlap(log, &poses, (begin_ns, end_ns))));
        }
        Ok(LoadedTrajectory { spec, track: PoseTrack::new(samples) })
    };
    specs.into_iter().map(of_spec).collect()
}

/// Poses of a file or topic; stamps are log times where the rig says so.
fn recorded(log: &FlightLog, rig: &Rig, source: &TrajectorySource) -> Result<Vec<RecordedPose>, LogError> {
    match source {
        TrajectorySource::File(path) => read_trajectory_file(path),
        TrajectorySource::Topic(topic) => log.trajectory_of_topic(topic, StampClock::of_rig(rig.uses_log_time(topic))),
    }
}

/// Message that no pose lies within a span of the log, in nanoseconds since the log began.
fn no_overlap(log: &FlightLog, poses: &[RecordedPose], (begin_ns, end_ns): (i64, i64)) -> String {
    let absolute_s = |ns: i64| seconds_from_ns(log.epoch_ns().saturating_add(ns));
    let stamps_s = |pose: Option<&RecordedPose>| pose.map_or(0.0, |pose| seconds_from_ns(pose.stamp_ns));
    format!(
        "no pose with an attitude within the time of the log: its stamps are {:.3} to {:.3} s, those of the log {:.3} to {:.3} s; \
         give header stamps of the log's messages, in seconds (TUM) or nanoseconds (EuRoC)",
        stamps_s(poses.first()),
        stamps_s(poses.last()),
        absolute_s(begin_ns),
        absolute_s(end_ns),
    )
}

/// Antenna positions as ground truth.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedPositions {
    /// The file or topic.
    pub source: String,
    /// Positions within the time of the log, in the order of their stamps.
    pub samples: Vec<PositionSample>,
    pub lever_arm: LeverArm,
}

/// Ground truth from another source than the frames of the log.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum LoadedTruth {
    /// Poses of the IMU.
    Poses(PoseTrack),
    Positions(LoadedPositions),
}

/// The requested ground truth, else the ground truth of the rig's topic; `None` if there is neither.
///
/// # Errors
/// If the requested ground truth cannot be read or has nothing within the time of the log, or if a lever arm was given
/// with poses.
pub(super) fn ground_truth(
    log: &FlightLog,
    rig: &Rig,
    asked: Option<&TrajectorySource>,
    lever_arm: Option<LeverArm>,
) -> Result<Option<LoadedTruth>, SessionError> {
    let of_rig = || rig.ground_truth_topic.clone().map(TrajectorySource::Topic);
    let Some(source) = asked.cloned().or_else(of_rig) else { return Ok(None) };
    let poses = match (recorded(log, rig, &source), asked) {
        (Ok(poses), _) => poses,
        (Err(error), Some(_)) => return Err(error.into()),
        // The reader of the frames warns of a missing topic.
        (Err(_), None) => return Ok(None),
    };
    let refuse = |problem: String| SessionError::Trajectory { source_name: source.to_string(), problem };
    let on_log = |pose: &&RecordedPose| {
        pose.stamp_ns.checked_sub(log.epoch_ns()).is_some_and(|stamp_ns| (0..=log.duration_ns()).contains(&stamp_ns))
    };
    let within: Vec<&RecordedPose> = poses.iter().filter(on_log).collect();
    if within.is_empty() {
        let span = (0, log.duration_ns());
        return if asked.is_some() { Err(refuse(no_overlap(log, &poses, span))) } else { Ok(None) };
    }
    // Programs that write positions as poses leave the attitude zero or the identity.
    let no_attitude =
        |pose: &&RecordedPose| pose.rotation.is_none_or(|rotation| rotation == UnitQuaternion::identity());
    if within.iter().all(no_attitude) {
        let sample = |pose: &&RecordedPose| PositionSample {
            stamp_ns: pose.stamp_ns - log.epoch_ns(),
            position_m: pose.position_m,
        };
        let lever_arm = lever_arm.or(rig.ground_truth_lever_arm).unwrap_or_else(|| LeverArm::Known(Vector3::zeros()));
        let samples = within.iter().map(sample).collect();
        return Ok(Some(LoadedTruth::Positions(LoadedPositions { source: source.to_string(), samples, lever_arm })));
    }
    if lever_arm.is_some() {
        let problem =
            "it has attitudes, but a lever arm applies only to positions: omit --lever-arm, or give positions";
        return Err(refuse(problem.to_owned()));
    }
    let sample = |pose: &&RecordedPose| {
        let world_from_imu = RigidTransform::new(pose.rotation?, pose.position_m);
        Some(PoseSample { stamp_ns: pose.stamp_ns - log.epoch_ns(), world_from_imu })
    };
    Ok(Some(LoadedTruth::Poses(PoseTrack::new(within.iter().filter_map(sample).collect()))))
}
