//! A run as an MCAP file for Foxglove, Rerun and RViz, to be opened with the log: poses, frames of the chain,
//! landmarks, tracks and residuals over the image, calibration, rank and frame statistics as time series, and events.
//!
//! Topics and frames begin with the run's label, so that the files of several runs can be opened together. Log times
//! are the log times of the images, so that playback is synchronous with the log; stamps are the estimator's.

mod annotations;
mod series;

use std::path::Path;

use crate::files::output::StagedFile;
use crate::flight_log::{LogError, LogLevel, LogWriter, LogWriterOptions, MessageTimes, NamedTransform, Odometry};
use crate::frontend::FeatureId;
use crate::geometry::RigidTransform;
use crate::gimbal::ClassicalChain;
use crate::session::{Recording, RunRecord, StepRecord};
use series::{Names, Series};

/// World frame common to all runs: the frame of the ground truth if there is one.
const WORLD: &str = "world";
/// Period of the path messages in nanoseconds.
const PATH_PERIOD_NS: i64 = 1_000_000_000;
/// Maximum number of poses of a path message; longer paths are thinned.
const PATH_POSES: usize = 300;

/// Writes one run of a recording under a temporary name.
pub(super) fn stage_results(recording: &Recording, run: &RunRecord, path: &Path) -> Result<StagedFile, LogError> {
    let mut results = Results {
        log: LogWriter::create(path, &LogWriterOptions::default())?,
        names: Names::new(&run.spec.label),
        // Without ground truth, the run's world is used as the common world.
        world_from_run: run.alignment.unwrap_or_else(RigidTransform::identity),
        trajectory: Vec::new(),
        path_due_ns: i64::MIN,
        main_camera: &run.camera_key,
        series: Series::new(run, &recording.rig),
        epoch_ns: recording.epoch_ns,
    };
    let last = run.steps.len().saturating_sub(1);
    for (index, step) in run.steps.iter().enumerate() {
        results.write_step(step, index == last)?;
    }
    results.log.finish_staged()
}

struct Results<'a> {
    log: LogWriter,
    names: Names,
    /// Alignment of the run's world with the ground truth's.
    world_from_run: RigidTransform,
    /// Absolute stamps and poses so far.
    trajectory: Vec<(i64, RigidTransform)>,
    /// Stamp of the next path message.
    path_due_ns: i64,
    /// Key of the main camera, whose frame is `camera`.
    main_camera: &'a str,
    series: Series<'a>,
    epoch_ns: i64,
}

impl<'a> Results<'a> {
    fn write_step(&mut self, step: &'a StepRecord, last: bool) -> Result<(), LogError> {
        let report = &step.report;
        let times =
            MessageTimes { stamp_ns: self.epoch_ns + report.stamp_ns, log_time_ns: self.epoch_ns + step.log_time_ns };
        self.write_events(step, times)?;
        annotations::write(&mut self.log, &self.names.topic("annotations"), times, step, 0)?;
        for (further, image) in step.further_images.iter().enumerate() {
            let Some(camera) = report.calibration.further_cameras.get(further) else { continue };
            let topic = self.names.topic(&format!("annotations/{}", camera.key));
            let times = MessageTimes { stamp_ns: self.epoch_ns + image.tracks.stamp_ns, ..times };
            annotations::write(&mut self.log, &topic, times, step, further + 1)?;
        }
        self.series.write(&mut self.log, &self.names, times, step)?;
        if let Some(ground_truth) = &step.ground_truth {
            self.log.write_pose(&self.names.topic("truth"), WORLD, times, ground_truth)?;
        }
        let Some(newest) = report.newest() else { return Ok(()) };
        let (run_world, imu) = (self.names.frame(WORLD), self.names.frame("imu"));
        let transforms = self.transforms(&report.calibration.classical, step);
        self.log.write_transforms("/tf", times, &transforms)?;
        let pose = newest.world_from_imu;
        let covariance = report.newest_pose_covariance.map(|covariance| covariance.in_world(&pose.rotation));
        let odometry = Odometry {
            pose_covariance: covariance.unwrap_or_default(),
            linear_m_per_s: pose.rotation.inverse() * newest.velocity_m_per_s,
            ..Odometry::at_rest(&run_world, &imu, pose)
        };
        self.log.write_odometry(&self.names.topic("odometry"), times, &odometry)?;
        self.log.write_pose(&self.names.topic("pose"), &run_world, times, &pose)?;
        let points: Vec<_> =
            report.landmarks.iter().map(|landmark| (short_id(landmark.id), landmark.position_m)).collect();
        self.log.write_points(&self.names.topic("landmarks"), &run_world, times, &points)?;
        self.trajectory.push((times.stamp_ns, pose));
        if last || report.stamp_ns >= self.path_due_ns {
            self.path_due_ns = report.stamp_ns + PATH_PERIOD_NS;
            let every = self.trajectory.len().div_ceil(PATH_POSES);
            let newest_first = self.trajectory.iter().rev().step_by(every);
            let mut poses: Vec<_> = newest_first.copied().collect();
            poses.reverse();
            self.log.write_path(&self.names.topic("path"), &run_world, times, &poses)?;
            let poses = poses.iter().map(|(_, pose)| pose);
            self.log.write_poses(&self.names.topic("poses"), &run_world, times, poses)?;
        }
        Ok(())
    }

    /// Frames from the world through the run's world and the IMU along the chain to the camera, and the other cameras.
    fn transforms(&self, chain: &ClassicalChain, step: &StepRecord) -> Vec<NamedTransform> {
        let Some(newest) = step.report.newest() else { return Vec::new() };
        let named = |parent: &str, child: &str, pose| NamedTransform {
            parent: if parent == WORLD { parent.to_owned() } else { self.names.frame(parent) },
            child: self.names.frame(child),
            pose,
        };
        let mut transforms = vec![named(WORLD, WORLD, self.world_from_run)];
        let imu = NamedTransform {
            parent: self.names.frame(WORLD),
            child: self.names.frame("imu"),
            pose: newest.world_from_imu,
        };
        transforms.push(imu);
        let angles_rad = &newest.joint_angles_rad;
        if chain.joint_count() == 0 || angles_rad.len() != chain.joint_count() {
            transforms.push(named("imu", "camera", newest.imu_from_camera));
        } else {
            transforms.push(named("imu", "base", chain.imu_from_base));
            let mut parent = "base".to_owned();
            for (index, (link, angle_rad)) in chain.links.iter().zip(angles_rad).enumerate() {
                let last = index + 1 == chain.joint_count();
                let child = if last { "effector".to_owned() } else { format!("joint{}", index + 2) };
                transforms.push(named(&parent, &child, link.transform(*angle_rad)));
                parent = child;
            }
            transforms.push(named(&parent, "camera", chain.effector_from_camera));
        }
        for camera in &step.report.calibration.further_cameras {
            let parent = match camera.base.as_deref() {
                None => "imu",
                Some(base) if base == self.main_camera => "camera",
                Some(base) => base,
            };
            transforms.push(named(parent, &camera.key, camera.base_from_camera));
        }
        transforms
    }

    fn write_events(&mut self, step: &StepRecord, times: MessageTimes) -> Result<(), LogError> {
        use crate::estimator::EventKind;
        let topic = self.names.topic("events");
        for event in &step.report.events {
            let level = match event.kind {
                EventKind::Failure | EventKind::MeasurementMissing => LogLevel::Warning,
                kind if kind.is_notable() => LogLevel::Info,
                _ => LogLevel::Debug,
            };
            self.log.write_log_line(&topic, times, level, &format!("{:?}", event.kind), &event.message)?;
        }
        for warning in &step.report.warnings {
            self.log.write_log_line(&topic, times, LogLevel::Warning, "warning", &warning.to_string())?;
        }
        Ok(())
    }
}

/// Id of a feature as a four-byte point field, which suffices for four thousand million features.
fn short_id(id: FeatureId) -> u32 {
    id.0 as u32
}
