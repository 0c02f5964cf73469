//! Columns of the table of runs.

use super::job_result::JobResult;
use crate::estimator::{FailureCause, Stage, StageTimes};
use crate::session::{RELATIVE_LENGTHS_M, RunSpec, log_warning_lines, run_warning_lines};
use crate::study::JobLog;
use crate::table::{Column, Direction};
use crate::text::Named as _;

type RunColumn<'a> = Column<'a, JobResult<'a>>;

pub(in crate::study) fn run_column(name: &str) -> Option<RunColumn<'static>> {
    JobResult::columns().into_iter().find(|column| column.name == name)
}

impl<'a> JobResult<'a> {
    /// Columns of the table of runs; one row per run.
    pub(super) fn columns() -> Vec<RunColumn<'a>> {
        let parts = [
            Self::inputs(),
            Self::frames(),
            Self::absolute_errors(),
            Self::relative_errors(),
            Self::consistency(),
            Self::calibration(),
            Self::ranks(),
            Self::stage_times(),
            Self::costs(),
        ];
        parts.into_iter().flatten().collect()
    }

    /// Job, run, files and status.
    fn inputs() -> Vec<RunColumn<'a>> {
        let flag = |name: &'static str, meaning: &'static str, of: fn(&RunSpec) -> bool| {
            RunColumn::new(name, move |job| job.spec().map(of)).means("", meaning)
        };
        let columns = [
            RunColumn::local("key", |job| job.key)
                .means("", "SHA-256 of the job's inputs; name of its folder under jobs/"),
            RunColumn::new("study", |job| job.job.study.as_str()).means("", "name of the study"),
            RunColumn::new("log", |job| job.job.log.name()).means("", "name of the log or of the simulated flight"),
            RunColumn::new("disturbance", |job| job.job.disturbance.as_str())
                .means("", "name of the disturbances of the simulated flight"),
            RunColumn::new("perturbation", |job| job.job.perturbation.name.as_str())
                .means("", "name of the errors added to the rig"),
            RunColumn::new("seed", Self::seed)
                .means("", "seed of the flight and of the errors; empty where nothing is random"),
            RunColumn::new("run", |job| job.job.subject.to_string())
                .means("", "specification of the run, normalized; trajectory:LABEL for one of another program"),
            RunColumn::new("label", |job| job.job.subject.label()).means("", "name of the run or of the trajectory"),
            RunColumn::new("parameterization", |job| Some(job.spec()?.parameterization.name()))
                .means("", "parameterization that the specification names"),
            flag("encoder", "whether encoder readings are used", |spec| spec.encoder),
            flag("calibrate", "whether the calibration is estimated", |spec| spec.calibrate),
            flag("timeshift", "whether time offsets are estimated", |spec| spec.timeshift),
            flag("readout", "whether readout times are estimated", |spec| spec.readout),
            flag("intrinsics", "whether camera intrinsics are estimated", |spec| spec.intrinsics),
            flag("imu_intrinsics", "whether IMU intrinsics are estimated", |spec| spec.imu_intrinsics),
            flag("first_estimates", "whether Jacobians are evaluated at first estimates", |spec| spec.first_estimates),
            RunColumn::new("window", |job| Some(job.spec()?.window)).means("", "keyframes in the window"),
            RunColumn::new("camera", |job| {
                job.summary().map_or_else(|| job.spec()?.camera_key.clone(), |summary| Some(summary.camera.clone()))
            })
            .means("", "keys of the cameras, the main one first"),
            RunColumn::new("status", |job| job.status.name())
                .means("", "ok, not-initialized, failed, crashed, killed or timeout"),
            RunColumn::local("message", |job| Some(job.message).filter(|text| !text.is_empty())).means(
                "",
                "why there is no result: the last lines of standard error, or the last \
                     initialization attempt",
            ),
            RunColumn::local("attempts", |job| job.costs.attempts)
                .means("", "number of times that the job was started"),
            RunColumn::new("log_sha256", |job| job.costs.log_sha256.clone()).means("", "SHA-256 of the log"),
            RunColumn::new("rig_sha256", |job| job.costs.rig_sha256.clone())
                .means("", "SHA-256 of the rig as it was used, with its errors and masks"),
            RunColumn::local("log_path", |job| job.costs.log_path.clone())
                .means("", "path of the log, relative to the folder of the study where it lies in it"),
            RunColumn::local("rig_path", |job| job.costs.rig_path.clone())
                .means("", "path of the rig where it is not the log's own, likewise"),
            RunColumn::local("truth_path", |job| job.costs.truth_path.clone())
                .means("", "path of the ground-truth rig where it is not the log's own, likewise"),
            RunColumn::local("trajectory_path", |job| job.costs.trajectory_path.clone())
                .means("", "file of the trajectory, likewise, or topic:/TOPIC in the log; empty for a run"),
            RunColumn::new("start_s", |job| match &job.job.log {
                JobLog::Recorded(log) => Some(log.start_s),
                JobLog::Simulated(_) => Some(0.0),
            })
            .means("s", "start in the log"),
            RunColumn::new("duration_s", |job| match &job.job.log {
                JobLog::Recorded(log) => log.duration_s,
                JobLog::Simulated(flight) => flight.recipe.duration_s,
            })
            .means("s", "requested duration; empty for the rest of the log"),
            RunColumn::local("program", |job| job.costs.program.clone())
                .means("", "version and SHA-256 of the program"),
        ];
        columns.into()
    }

    /// Numbers of images and failures.
    fn frames() -> Vec<RunColumn<'a>> {
        let loss = |name: &'static str, meaning: &'static str, cause: FailureCause| {
            RunColumn::new(name, move |job| Some(job.run.as_ref()?.failures(cause))).means("", meaning)
        };
        let columns = [
            RunColumn::new("initialized_at_s", |job| job.summary()?.frames.initialized_at_s)
                .means("s", "time of the first pose since the log began"),
            RunColumn::new("frames", |job| Some(job.summary()?.frames.total))
                .means("", "images passed to the estimator"),
            RunColumn::new("estimated", |job| {
                let poses = || Some(job.trajectory?.track.samples().len());
                job.summary().map_or_else(poses, |summary| Some(summary.frames.estimated))
            })
            .means("", "images with an estimated pose; poses of a trajectory")
            .worse(Direction::Smaller),
            RunColumn::new("keyframes", |job| Some(job.summary()?.frames.keyframes))
                .means("", "keyframes")
                .worse(Direction::Smaller),
            RunColumn::new("length_m", |job| {
                let Some(summary) = job.summary() else { return Some(job.trajectory?.length_m) };
                summary.frames.initialized_at_s.map(|_| summary.length_m)
            })
            .means("m", "path length over the estimated frames, of the ground truth where there is one")
            .worse(Direction::Smaller),
            RunColumn::new("restarts", |job| Some(job.summary()?.frames.restarts))
                .means("", "restarts after a failure"),
            loss("loss_features", "failures: too few observed landmarks for too long", FailureCause::Features),
            loss("loss_imu", "failures: IMU samples missing between two images", FailureCause::Imu),
            loss(
                "loss_accelerometer_bias",
                "failures: accelerometer bias out of bounds",
                FailureCause::AccelerometerBias,
            ),
            loss("loss_gyroscope_bias", "failures: gyroscope bias out of bounds", FailureCause::GyroscopeBias),
            loss("loss_velocity", "failures: velocity out of bounds", FailureCause::Velocity),
            loss("loss_correction", "failures: correction of the newest position too large", FailureCause::Correction),
            RunColumn::new("lost_s", |job| job.run.as_ref()?.lost_s())
                .means("s", "time without a pose after the first one"),
            RunColumn::new("warnings", |job| {
                let run = job.run.as_ref()?;
                Some(log_warning_lines(&run.recording.warnings).len() + run_warning_lines(run.record).len())
            })
            .means("", "different warnings about the log and of the run"),
        ];
        columns.into()
    }

    /// Errors against the ground truth.
    fn absolute_errors() -> Vec<RunColumn<'a>> {
        let columns = [
            RunColumn::new("ate_rmse_m", |job| Some(job.accuracy()?.ate_rmse_m))
                .means("m", "absolute trajectory error, root mean square, aligned by yaw and position"),
            RunColumn::new("ate_mean_m", |job| Some(job.accuracy()?.ate_mean_m)).means("m", "the same, mean"),
            RunColumn::new("ate_median_m", |job| Some(job.accuracy()?.ate_median_m)).means("m", "the same, median"),
            RunColumn::new("ate_max_m", |job| Some(job.accuracy()?.ate_max_m)).means("m", "the same, maximum"),
            RunColumn::new("ate_percent", |job| Some(job.accuracy()?.ate_percent_of_length))
                .means("%", "ate_rmse_m over length_m"),
            RunColumn::new("heading_drift_rad", |job| Some(job.accuracy()?.heading_drift_deg_per_turn?.to_radians()))
                .means(
                    "rad",
                    "heading error gained per full turn, negative behind the turn; only of flights \
             that turn by half a turn or more",
                )
                .worse(Direction::Either),
            RunColumn::new("heading_drift_size_rad", |job| {
                Some(job.accuracy()?.heading_drift_deg_per_turn?.to_radians().abs())
            })
            .means("rad", "its size"),
        ];
        columns.into()
    }

    /// Errors over each path length.
    fn relative_errors() -> Vec<RunColumn<'a>> {
        let both = RELATIVE_LENGTHS_M.into_iter().flat_map(|length_m| {
            let meaning = format!("relative error over {length_m} m of path, root mean square of the translation");
            [
                RunColumn::new(format!("rpe_{length_m}m_translation_m"), move |job| {
                    Some(job.relative(length_m)?.translation_rmse_m)
                })
                .means("m", meaning),
                RunColumn::new(format!("rpe_{length_m}m_rotation_rad"), move |job| {
                    Some(job.relative(length_m)?.rotation_rmse_deg.to_radians())
                })
                .means("rad", "the same, rotation"),
            ]
        });
        both.collect()
    }

    /// Errors against their covariance, and the worst frame.
    fn consistency() -> Vec<RunColumn<'a>> {
        let columns = [
            RunColumn::new("pose_nees", |job| job.run.as_ref()?.pose_nees())
                .means(
                    "",
                    "mean squared error over covariance of the window's newest pose in its oldest one; 6 \
                     when consistent",
                )
                .worse(Direction::Either),
            RunColumn::new("pose_nees_samples", |job| Some(job.run.as_ref()?.consistency.len()))
                .means("", "number of samples of pose_nees"),
            RunColumn::new("worst_frame_s", |job| Some(job.worst_frame()?.at_s)).means(
                "s",
                "time of the frame with the largest position error, without ground truth with the \
                     largest reprojection RMS",
            ),
            RunColumn::new("worst_frame_m", |job| job.worst_frame()?.error_m).means("m", "its position error"),
            RunColumn::new("worst_frame_px", |job| job.worst_frame()?.reprojection_px)
                .means("px", "its reprojection RMS after the solve"),
            RunColumn::new("reprojection_rms_px", |job| job.run.as_ref()?.reprojection_rms_px())
                .means("px", "median over the frames of the reprojection RMS after the solve"),
        ];
        columns.into()
    }

    /// Calibration at the end.
    fn calibration() -> Vec<RunColumn<'a>> {
        let columns = [
            RunColumn::new("final_parameterization", |job| Some(job.summary()?.calibration.parameterization.clone()))
                .means("", "parameterization at the end"),
            RunColumn::new("columns", |job| Some(job.summary()?.calibration.columns))
                .means("", "calibration parameters at the end"),
            RunColumn::new("chain_error_initial_m", |job| {
                Some(job.summary()?.calibration.chain_error_initial?.translation_mean_m)
            })
            .means(
                "m",
                "mean position error of imu_from_camera over the joint angles visited, with the \
                     rig's values",
            )
            .fine(),
            RunColumn::new("chain_error_initial_rad", |job| {
                Some(job.summary()?.calibration.chain_error_initial?.rotation_mean_rad)
            })
            .means("rad", "the same, angle"),
            RunColumn::new("chain_error_m", |job| Some(job.summary()?.calibration.chain_error?.translation_mean_m))
                .means("m", "mean position error of imu_from_camera at the end")
                .fine(),
            RunColumn::new("chain_error_rad", |job| Some(job.summary()?.calibration.chain_error?.rotation_mean_rad))
                .means("rad", "the same, angle"),
            RunColumn::new("parameter_error_sigma", |job| job.summary()?.calibration.parameter_error_sigma())
                .means("", "root mean square of error over σ of the calibration parameters; 1 when consistent")
                .worse(Direction::Either),
            RunColumn::new("offline_static_alone_px", |job| {
                Some(job.offline()?.outcome.static_pixels.residuals_px.mean)
            })
            .means(
                "px",
                "mean reprojection error of the offline calibration that the rig comes from, static \
                     camera and IMU alone",
            ),
            RunColumn::new("offline_static_px", |job| Some(job.offline()?.outcome.pixels[0].residuals_px.mean))
                .means("px", "the same, static camera in the bundle of both cameras"),
            RunColumn::new("offline_gimbal_px", |job| Some(job.offline()?.outcome.pixels[1].residuals_px.mean))
                .means("px", "the same, gimbal camera"),
            RunColumn::new("offline_static_alone_error_m", |job| {
                Some(job.offline()?.errors()?.static_camera_imu.translation_mean_m)
            })
            .means(
                "m",
                "position error of the static camera on the IMU after the stage of that calibration \
                     with these two alone",
            ),
            RunColumn::new("offline_static_alone_error_rad", |job| {
                Some(job.offline()?.errors()?.static_camera_imu.rotation_mean_rad)
            })
            .means("rad", "the same, angle"),
        ];
        columns.into()
    }

    /// Ranks at the last step.
    fn ranks() -> Vec<RunColumn<'a>> {
        let columns = [
            RunColumn::new("rank_structural", |job| Some(job.rank()?.rank_structural))
                .means("", "structural rank at the last step")
                .worse(Direction::Smaller),
            RunColumn::new("rank_informed", |job| Some(job.rank()?.rank_informed))
                .means("", "informed rank at the last step")
                .worse(Direction::Smaller),
            RunColumn::new("deficit_parameterization", |job| Some(job.rank()?.deficit.parameterization))
                .means("", "rank deficit by redundant parameters"),
            RunColumn::new("deficit_joints", |job| Some(job.rank()?.deficit.joints))
                .means("", "rank deficit by joints that did not move"),
            RunColumn::new("deficit_absorbed", |job| Some(job.rank()?.deficit.absorbed))
                .means("", "rank deficit absorbed by free joint angles"),
            RunColumn::new("deficit_motion", |job| Some(job.rank()?.deficit.motion))
                .means("", "rank deficit by insufficient motion of the vehicle"),
        ];
        columns.into()
    }

    /// Median times of the stages.
    fn stage_times() -> Vec<RunColumn<'a>> {
        let column = |(index, stage): (usize, &'static Stage)| {
            let what = if index == 0 { "median time of a frame" } else { "the same" };
            RunColumn::local(format!("{}_ms", stage.key), move |job| Some(job.timing()?.0[index].1.p50))
                .means("ms", format!("{what}, {}", stage.meaning))
        };
        StageTimes::STAGES.iter().enumerate().map(column).collect()
    }

    /// Times of the whole job and memory.
    fn costs() -> Vec<RunColumn<'a>> {
        let columns = [
            RunColumn::local("step_p95_ms", |job| Some(job.timing()?.0.last()?.1.p95))
                .means("ms", "95th percentile of the time of a step"),
            RunColumn::local("real_time_factor", |job| job.summary()?.real_time_factor)
                .means("", "seconds of log per second of computation")
                .worse(Direction::Smaller),
            RunColumn::local("wall_s", |job| job.costs.wall_s).means("s", "wall time of the job"),
            RunColumn::local("peak_memory_bytes", |job| job.costs.peak_memory_bytes)
                .means("B", "largest resident memory of the job; empty where the system does not say"),
        ];
        columns.into()
    }
}
