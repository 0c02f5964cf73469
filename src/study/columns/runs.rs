//! Columns of the table of runs.

use super::column::Column;
use super::column::Direction;
use super::job_result::JobResult;
use crate::estimator::FailureCause;
use crate::session::{log_warning_lines, run_warning_lines};
use crate::study::JobLog;
use crate::text::Named as _;

pub(in crate::study) fn run_column(name: &str) -> Option<&'static Column<JobResult<'static>>> {
    JobResult::COLUMNS.iter().find(|column| column.name == name)
}

impl<'a> JobResult<'a> {
    /// Inputs, frames, absolute and relative errors, consistency, calibration and times; one row per run.
    pub(super) const COLUMNS: &'a [Column<Self>] = &[
        Column::text("key", "SHA-256 of the job's inputs; name of its folder under jobs/", |job: &Self| {
            Some(job.key.to_owned())
        })
        .local(),
        Column::text("study", "name of the study", |job| Some(job.job.study.clone())),
        Column::text("log", "name of the log or of the simulated flight", |job| Some(job.job.log.name().to_owned())),
        Column::text("disturbance", "name of the disturbances of the simulated flight", |job| {
            Some(job.job.disturbance.clone())
        }),
        Column::text("perturbation", "name of the errors added to the rig", |job| {
            Some(job.job.perturbation.name.clone())
        }),
        Column::count("seed", "seed of the flight and of the errors; empty where nothing is random", Self::seed),
        Column::text(
            "run",
            "specification of the run, normalized; trajectory:LABEL for one of another program",
            |job| Some(job.job.subject.to_string()),
        ),
        Column::text("label", "name of the run or of the trajectory", |job| Some(job.job.subject.label().to_owned())),
        Column::text("parameterization", "parameterization that the specification names", |job| {
            Some(job.spec()?.parameterization.name().to_owned())
        }),
        Column::flag("encoder", "whether encoder readings are used", |job| Some(job.spec()?.encoder)),
        Column::flag("calibrate", "whether the calibration is estimated", |job| Some(job.spec()?.calibrate)),
        Column::flag("timeshift", "whether time offsets are estimated", |job| Some(job.spec()?.timeshift)),
        Column::flag("readout", "whether readout times are estimated", |job| Some(job.spec()?.readout)),
        Column::flag("intrinsics", "whether camera intrinsics are estimated", |job| Some(job.spec()?.intrinsics)),
        Column::flag("imu_intrinsics", "whether IMU intrinsics are estimated", |job| Some(job.spec()?.imu_intrinsics)),
        Column::flag("first_estimates", "whether Jacobians are evaluated at first estimates", |job| {
            Some(job.spec()?.first_estimates)
        }),
        Column::count("window", "keyframes in the window", |job| Some(job.spec()?.window)),
        Column::text("camera", "keys of the cameras, the main one first", |job| {
            job.summary().map_or_else(|| job.spec()?.camera_key.clone(), |summary| Some(summary.camera.clone()))
        }),
        Column::text("status", "ok, not-initialized, failed, crashed, killed or timeout", |job| {
            Some(job.status.name().to_owned())
        }),
        Column::text(
            "message",
            "why there is no result: the last lines of standard error, or the last initialization attempt",
            |job: &Self| Some(job.message.to_owned()).filter(|text| !text.is_empty()),
        )
        .local(),
        Column::count("attempts", "number of times that the job was started", |job: &Self| Some(job.costs.attempts))
            .local(),
        Column::text("log_sha256", "SHA-256 of the log", |job| job.costs.log_sha256.clone()),
        Column::text("rig_sha256", "SHA-256 of the rig as it was used, with its errors and masks", |job| {
            job.costs.rig_sha256.clone()
        }),
        Column::text(
            "log_path",
            "path of the log, relative to the folder of the study where it lies in it",
            |job: &Self| Some(job.costs.log_path.clone()),
        )
        .local(),
        Column::text("rig_path", "path of the rig where it is not the log's own, likewise", |job: &Self| {
            job.costs.rig_path.clone()
        })
        .local(),
        Column::text(
            "truth_path",
            "path of the ground-truth rig where it is not the log's own, likewise",
            |job: &Self| job.costs.truth_path.clone(),
        )
        .local(),
        Column::text(
            "trajectory_path",
            "file of the trajectory, likewise, or topic:/TOPIC in the log; empty for a run",
            |job: &Self| job.costs.trajectory_path.clone(),
        )
        .local(),
        Column::number("start_s", "s", "start in the log", |job| match &job.job.log {
            JobLog::Recorded(log) => Some(log.start_s),
            JobLog::Simulated(_) => Some(0.0),
        }),
        Column::number("duration_s", "s", "requested duration; empty for the rest of the log", |job| {
            match &job.job.log {
                JobLog::Recorded(log) => log.duration_s,
                JobLog::Simulated(flight) => flight.recipe.duration_s,
            }
        }),
        Column::text("program", "version and SHA-256 of the program", |job: &Self| Some(job.costs.program.clone()))
            .local(),
        Column::number("initialized_at_s", "s", "time of the first pose since the log began", |job| {
            job.summary()?.frames.initialized_at_s
        }),
        Column::count("frames", "images passed to the estimator", |job| Some(job.summary()?.frames.total)),
        Column::count("estimated", "images with an estimated pose; poses of a trajectory", |job: &Self| {
            let poses = || Some(job.trajectory?.track.samples().len());
            job.summary().map_or_else(poses, |summary| Some(summary.frames.estimated))
        })
        .worse(Direction::Smaller),
        Column::count("keyframes", "keyframes", |job: &Self| Some(job.summary()?.frames.keyframes))
            .worse(Direction::Smaller),
        Column::number(
            "length_m",
            "m",
            "path length over the estimated frames, of the ground truth where there is one",
            |job: &Self| {
                let Some(summary) = job.summary() else { return Some(job.trajectory?.length_m) };
                summary.frames.initialized_at_s.map(|_| summary.length_m)
            },
        )
        .worse(Direction::Smaller),
        Column::count("restarts", "restarts after a failure", |job| Some(job.summary()?.frames.restarts)),
        Column::count("loss_features", "failures: too few observed landmarks for too long", |job| {
            Some(job.run.as_ref()?.failures(FailureCause::Features))
        }),
        Column::count("loss_imu", "failures: IMU samples missing between two images", |job| {
            Some(job.run.as_ref()?.failures(FailureCause::Imu))
        }),
        Column::count("loss_accelerometer_bias", "failures: accelerometer bias out of bounds", |job| {
            Some(job.run.as_ref()?.failures(FailureCause::AccelerometerBias))
        }),
        Column::count("loss_gyroscope_bias", "failures: gyroscope bias out of bounds", |job| {
            Some(job.run.as_ref()?.failures(FailureCause::GyroscopeBias))
        }),
        Column::count("loss_velocity", "failures: velocity out of bounds", |job| {
            Some(job.run.as_ref()?.failures(FailureCause::Velocity))
        }),
        Column::count("loss_correction", "failures: correction of the newest position too large", |job| {
            Some(job.run.as_ref()?.failures(FailureCause::Correction))
        }),
        Column::number("lost_s", "s", "time without a pose after the first one", |job| job.run.as_ref()?.lost_s()),
        Column::count("warnings", "different warnings about the log and of the run", |job| {
            let run = job.run.as_ref()?;
            Some(log_warning_lines(&run.recording.warnings).len() + run_warning_lines(run.record).len())
        }),
        Column::number(
            "ate_rmse_m",
            "m",
            "absolute trajectory error, root mean square, aligned by yaw and position",
            |job| Some(job.accuracy()?.ate_rmse_m),
        ),
        Column::number("ate_mean_m", "m", "the same, mean", |job| Some(job.accuracy()?.ate_mean_m)),
        Column::number("ate_median_m", "m", "the same, median", |job| Some(job.accuracy()?.ate_median_m)),
        Column::number("ate_max_m", "m", "the same, maximum", |job| Some(job.accuracy()?.ate_max_m)),
        Column::number("ate_percent", "%", "ate_rmse_m over length_m", |job| {
            Some(job.accuracy()?.ate_percent_of_length)
        }),
        Column::number(
            "heading_drift_rad",
            "rad",
            "heading error gained per full turn, negative behind the turn; only of flights that turn by half a turn or more",
            |job: &Self| Some(job.accuracy()?.heading_drift_deg_per_turn?.to_radians()),
        )
        .worse(Direction::Either),
        Column::number("heading_drift_size_rad", "rad", "its size", |job: &Self| {
            Some(job.accuracy()?.heading_drift_deg_per_turn?.to_radians().abs())
        }),
        Column::number(
            "rpe_5m_translation_m",
            "m",
            "relative error over 5 m of path, root mean square of the translation",
            |job| Some(job.relative(5.0)?.translation_rmse_m),
        ),
        Column::number("rpe_5m_rotation_rad", "rad", "the same, rotation", |job| {
            Some(job.relative(5.0)?.rotation_rmse_deg.to_radians())
        }),
        Column::number(
            "rpe_10m_translation_m",
            "m",
            "relative error over 10 m of path, root mean square of the translation",
            |job| Some(job.relative(10.0)?.translation_rmse_m),
        ),
        Column::number("rpe_10m_rotation_rad", "rad", "the same, rotation", |job| {
            Some(job.relative(10.0)?.rotation_rmse_deg.to_radians())
        }),
        Column::number(
            "rpe_25m_translation_m",
            "m",
            "relative error over 25 m of path, root mean square of the translation",
            |job| Some(job.relative(25.0)?.translation_rmse_m),
        ),
        Column::number("rpe_25m_rotation_rad", "rad", "the same, rotation", |job| {
            Some(job.relative(25.0)?.rotation_rmse_deg.to_radians())
        }),
        Column::number(
            "pose_nees",
            "",
            "mean squared error over covariance of the window's newest pose in its oldest one; 6 when consistent",
            |job: &Self| job.run.as_ref()?.pose_nees(),
        )
        .worse(Direction::Either),
        Column::count("pose_nees_samples", "number of samples of pose_nees", |job| {
            Some(job.run.as_ref()?.consistency.len())
        }),
        Column::number(
            "worst_frame_s",
            "s",
            "time of the frame with the largest position error, without ground truth with the largest reprojection RMS",
            |job| Some(job.worst_frame()?.at_s),
        ),
        Column::number("worst_frame_m", "m", "its position error", |job| job.worst_frame()?.error_m),
        Column::number("worst_frame_px", "px", "its reprojection RMS after the solve", |job| {
            job.worst_frame()?.reprojection_px
        }),
        Column::number(
            "reprojection_rms_px",
            "px",
            "median over the frames of the reprojection RMS after the solve",
            |job| job.run.as_ref()?.reprojection_rms_px(),
        ),
        Column::text("final_parameterization", "parameterization at the end", |job| {
            Some(job.summary()?.calibration.parameterization.clone())
        }),
        Column::count("columns", "calibration parameters at the end", |job| Some(job.summary()?.calibration.columns)),
        Column::number(
            "chain_error_initial_m",
            "m",
            "mean position error of imu_from_camera over the joint angles visited, with the rig's values",
            |job: &Self| Some(job.summary()?.calibration.chain_error_initial?.translation_mean_m),
        )
        .fine(),
        Column::number("chain_error_initial_rad", "rad", "the same, angle", |job| {
            Some(job.summary()?.calibration.chain_error_initial?.rotation_mean_rad)
        }),
        Column::number("chain_error_m", "m", "mean position error of imu_from_camera at the end", |job: &Self| {
            Some(job.summary()?.calibration.chain_error?.translation_mean_m)
        })
        .fine(),
        Column::number("chain_error_rad", "rad", "the same, angle", |job| {
            Some(job.summary()?.calibration.chain_error?.rotation_mean_rad)
        }),
        Column::number(
            "parameter_error_sigma",
            "",
            "root mean square of error over σ of the calibration parameters; 1 when consistent",
            |job: &Self| job.summary()?.calibration.parameter_error_sigma(),
        )
        .worse(Direction::Either),
        Column::number(
            "offline_static_alone_px",
            "px",
            "mean reprojection error of the offline calibration that the rig comes from, static camera and IMU alone",
            |job| Some(job.offline()?.outcome.static_pixels.residuals_px.mean),
        ),
        Column::number("offline_static_px", "px", "the same, static camera in the bundle of both cameras", |job| {
            Some(job.offline()?.outcome.pixels[0].residuals_px.mean)
        }),
        Column::number("offline_gimbal_px", "px", "the same, gimbal camera", |job| {
            Some(job.offline()?.outcome.pixels[1].residuals_px.mean)
        }),
        Column::number(
            "offline_static_alone_error_m",
            "m",
            "position error of the static camera on the IMU after the stage of that calibration with these two alone",
            |job| Some(job.offline()?.errors()?.static_camera_imu.translation_mean_m),
        ),
        Column::number("offline_static_alone_error_rad", "rad", "the same, angle", |job| {
            Some(job.offline()?.errors()?.static_camera_imu.rotation_mean_rad)
        }),
        Column::count("rank_structural", "structural rank at the last step", |job: &Self| {
            Some(job.summary()?.rank.as_ref()?.rank_structural)
        })
        .worse(Direction::Smaller),
        Column::count("rank_informed", "informed rank at the last step", |job: &Self| {
            Some(job.summary()?.rank.as_ref()?.rank_informed)
        })
        .worse(Direction::Smaller),
        Column::count("deficit_parameterization", "rank deficit by redundant parameters", |job| {
            Some(job.summary()?.rank.as_ref()?.deficit.parameterization)
        }),
        Column::count("deficit_joints", "rank deficit by joints that did not move", |job| {
            Some(job.summary()?.rank.as_ref()?.deficit.joints)
        }),
        Column::count("deficit_absorbed", "rank deficit absorbed by free joint angles", |job| {
            Some(job.summary()?.rank.as_ref()?.deficit.absorbed)
        }),
        Column::count("deficit_motion", "rank deficit by insufficient motion of the vehicle", |job| {
            Some(job.summary()?.rank.as_ref()?.deficit.motion)
        }),
        Column::number("frontend_ms", "ms", "median time of a frame, feature tracking", |job: &Self| {
            Some(job.summary()?.timing_ms.as_ref()?.frontend.p50)
        })
        .local(),
        Column::number("optimize_ms", "ms", "the same, nonlinear solve", |job: &Self| {
            Some(job.summary()?.timing_ms.as_ref()?.optimize.p50)
        })
        .local(),
        Column::number("linearize_ms", "ms", "the same, linearization for the observability analysis", |job: &Self| {
            Some(job.summary()?.timing_ms.as_ref()?.linearize.p50)
        })
        .local(),
        Column::number("report_ms", "ms", "the same, building the report", |job: &Self| {
            Some(job.summary()?.timing_ms.as_ref()?.report.p50)
        })
        .local(),
        Column::number("marginalize_ms", "ms", "the same, marginalization", |job: &Self| {
            Some(job.summary()?.timing_ms.as_ref()?.marginalize.p50)
        })
        .local(),
        Column::number("observability_ms", "ms", "the same, observability analysis", |job: &Self| {
            Some(job.summary()?.timing_ms.as_ref()?.observability.p50)
        })
        .local(),
        Column::number("step_ms", "ms", "the same, whole step", |job: &Self| {
            Some(job.summary()?.timing_ms.as_ref()?.step.p50)
        })
        .local(),
        Column::number("step_p95_ms", "ms", "95th percentile of the time of a step", |job: &Self| {
            Some(job.summary()?.timing_ms.as_ref()?.step.p95)
        })
        .local(),
        Column::number("real_time_factor", "", "seconds of log per second of computation", |job: &Self| {
            job.summary()?.real_time_factor
        })
        .worse(Direction::Smaller)
        .local(),
        Column::number("wall_s", "s", "wall time of the job", |job: &Self| Some(job.costs.wall_s)).local(),
        Column::bytes(
            "peak_memory_bytes",
            "largest resident memory of the job; empty where the system does not say",
            |job: &Self| job.costs.peak_memory_bytes.and_then(|bytes| usize::try_from(bytes).ok()),
        )
        .local(),
    ];
}
