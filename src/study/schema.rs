//! Columns of the tables of a study; also listed in docs/formats.md.

use super::table::{ColumnType, StudyColumn, StudyTable};
use crate::session::RELATIVE_LENGTHS_M;
use ColumnType::{Bool, Integer, Number, Text};

/// Name, type, unit and description of a column.
type Column = (&'static str, ColumnType, &'static str, &'static str);

/// One row per run: inputs, frames and absolute errors.
const RUNS: &[Column] = &[
    ("key", Text, "", "SHA-256 of the job's inputs; name of its folder under jobs/"),
    ("study", Text, "", "name of the study"),
    ("log", Text, "", "name of the log or of the simulated flight"),
    ("disturbance", Text, "", "name of the disturbances of the simulated flight"),
    ("perturbation", Text, "", "name of the errors added to the rig"),
    ("seed", Integer, "", "seed of the flight and of the errors; empty where nothing is random"),
    ("run", Text, "", "specification of the run, normalized; trajectory:LABEL for one of another program"),
    ("label", Text, "", "name of the run or of the trajectory"),
    ("parameterization", Text, "", "parameterization that the specification names"),
    ("encoder", Bool, "", "whether encoder readings are used"),
    ("calibrate", Bool, "", "whether the calibration is estimated"),
    ("timeshift", Bool, "", "whether time offsets are estimated"),
    ("readout", Bool, "", "whether readout times are estimated"),
    ("intrinsics", Bool, "", "whether camera intrinsics are estimated"),
    ("imu_intrinsics", Bool, "", "whether IMU intrinsics are estimated"),
    ("first_estimates", Bool, "", "whether Jacobians are evaluated at first estimates"),
    ("window", Integer, "", "keyframes in the window"),
    ("camera", Text, "", "keys of the cameras, the main one first"),
    ("status", Text, "", "ok, not-initialized, failed, crashed, killed or timeout"),
    (
        "message",
        Text,
        "",
        "why there is no result: the last lines of standard error, or the last initialization attempt",
    ),
    ("attempts", Integer, "", "number of times that the job was started"),
    ("log_sha256", Text, "", "SHA-256 of the log"),
    ("rig_sha256", Text, "", "SHA-256 of the rig as it was used, with its errors and masks"),
    ("log_path", Text, "", "path of the log, relative to the folder of the study where it lies in it"),
    ("rig_path", Text, "", "path of the rig where it is not the log's own, likewise"),
    ("truth_path", Text, "", "path of the ground-truth rig where it is not the log's own, likewise"),
    ("trajectory_path", Text, "", "file of the trajectory, likewise, or topic:/TOPIC in the log; empty for a run"),
    ("start_s", Number, "s", "start in the log"),
    ("duration_s", Number, "s", "requested duration; empty for the rest of the log"),
    ("program", Text, "", "version and SHA-256 of the program"),
    ("initialized_at_s", Number, "s", "time of the first pose since the log began"),
    ("frames", Integer, "", "images passed to the estimator"),
    ("estimated", Integer, "", "images with an estimated pose; poses of a trajectory"),
    ("keyframes", Integer, "", "keyframes"),
    ("length_m", Number, "m", "path length over the estimated frames, of the ground truth where there is one"),
    ("restarts", Integer, "", "restarts after a failure"),
    ("loss_features", Integer, "", "failures: too few observed landmarks for too long"),
    ("loss_imu", Integer, "", "failures: IMU samples missing between two images"),
    ("loss_accelerometer_bias", Integer, "", "failures: accelerometer bias out of bounds"),
    ("loss_gyroscope_bias", Integer, "", "failures: gyroscope bias out of bounds"),
    ("loss_velocity", Integer, "", "failures: velocity out of bounds"),
    ("loss_correction", Integer, "", "failures: correction of the newest position too large"),
    ("lost_s", Number, "s", "time without a pose after the first one"),
    ("warnings", Integer, "", "different warnings about the log and of the run"),
    ("ate_rmse_m", Number, "m", "absolute trajectory error, root mean square, aligned by yaw and position"),
    ("ate_mean_m", Number, "m", "the same, mean"),
    ("ate_median_m", Number, "m", "the same, median"),
    ("ate_max_m", Number, "m", "the same, maximum"),
    ("ate_percent", Number, "%", "ate_rmse_m over length_m"),
];

/// One row per run, after the relative errors: consistency, calibration and times.
const RUNS_REST: &[Column] = &[
    (
        "pose_nees",
        Number,
        "",
        "mean squared error over covariance of the window's newest pose in its oldest one; 6 when consistent",
    ),
    ("pose_nees_samples", Integer, "", "number of samples of pose_nees"),
    (
        "worst_frame_s",
        Number,
        "s",
        "time of the frame with the largest position error, without ground truth with the largest reprojection RMS",
    ),
    ("worst_frame_m", Number, "m", "its position error"),
    ("worst_frame_px", Number, "px", "its reprojection RMS after the solve"),
    ("reprojection_rms_px", Number, "px", "median over the frames of the reprojection RMS after the solve"),
    ("final_parameterization", Text, "", "parameterization at the end"),
    ("columns", Integer, "", "calibration parameters at the end"),
    (
        "chain_error_initial_m",
        Number,
        "m",
        "mean position error of imu_from_camera over the joint angles visited, with the rig's values",
    ),
    ("chain_error_initial_rad", Number, "rad", "the same, angle"),
    ("chain_error_m", Number, "m", "mean position error of imu_from_camera at the end"),
    ("chain_error_rad", Number, "rad", "the same, angle"),
    (
        "parameter_error_sigma",
        Number,
        "",
        "root mean square of error over σ of the calibration parameters; 1 when consistent",
    ),
    (
        "offline_static_alone_px",
        Number,
        "px",
        "mean reprojection error of the offline calibration that the rig comes from, static camera and IMU alone",
    ),
    ("offline_static_px", Number, "px", "the same, static camera in the bundle of both cameras"),
    ("offline_gimbal_px", Number, "px", "the same, gimbal camera"),
    (
        "offline_static_alone_error_m",
        Number,
        "m",
        "position error of the static camera on the IMU after the stage of that calibration with these two alone",
    ),
    ("offline_static_alone_error_rad", Number, "rad", "the same, angle"),
    ("rank_structural", Integer, "", "structural rank at the last step"),
    ("rank_informed", Integer, "", "informed rank at the last step"),
    ("deficit_parameterization", Integer, "", "rank deficit by redundant parameters"),
    ("deficit_joints", Integer, "", "rank deficit by joints that did not move"),
    ("deficit_absorbed", Integer, "", "rank deficit absorbed by free joint angles"),
    ("deficit_motion", Integer, "", "rank deficit by insufficient motion of the vehicle"),
    ("frontend_ms", Number, "ms", "median time of a frame, feature tracking"),
    ("optimize_ms", Number, "ms", "the same, nonlinear solve"),
    ("linearize_ms", Number, "ms", "the same, linearization for the observability analysis"),
    ("report_ms", Number, "ms", "the same, building the report"),
    ("marginalize_ms", Number, "ms", "the same, marginalization"),
    ("observability_ms", Number, "ms", "the same, observability analysis"),
    ("step_ms", Number, "ms", "the same, whole step"),
    ("step_p95_ms", Number, "ms", "95th percentile of the time of a step"),
    ("real_time_factor", Number, "", "seconds of log per second of computation"),
    ("wall_s", Number, "s", "wall time of the job"),
    ("peak_memory_bytes", Integer, "B", "largest resident memory of the job; empty where the system does not say"),
];

/// One row per run and calibration parameter.
const PARAMETERS: &[Column] = &[
    ("key", Text, "", "key of the run"),
    ("log", Text, "", "as in the table of runs"),
    ("disturbance", Text, "", "as in the table of runs"),
    ("perturbation", Text, "", "as in the table of runs"),
    ("seed", Integer, "", "as in the table of runs"),
    ("run", Text, "", "as in the table of runs"),
    ("parameter", Text, "", "name of the parameter"),
    ("unit", Text, "", "unit of the following values"),
    ("initial", Number, "", "value in the rig"),
    ("final", Number, "", "value at the end"),
    ("sigma", Number, "", "posterior standard deviation at the end"),
    ("truth", Number, "", "ground-truth value"),
    ("error", Number, "", "final minus truth"),
];

/// One row per run and image.
const FRAMES: &[Column] = &[
    ("key", Text, "", "key of the run"),
    ("frame", Integer, "", "number of the image"),
    ("t_s", Number, "s", "stamp since the log began"),
    ("estimated", Bool, "", "whether there is a pose"),
    ("keyframe", Bool, "", "whether it is a keyframe"),
    ("x_m", Number, "m", "estimated position in the world"),
    ("y_m", Number, "m", "estimated position in the world"),
    ("z_m", Number, "m", "estimated position in the world"),
    ("position_error_m", Number, "m", "distance from the ground truth after the alignment of the whole run"),
    ("rotation_error_rad", Number, "rad", "angle to the ground truth after that alignment"),
    ("reprojection_rms_px", Number, "px", "reprojection RMS after the solve"),
    ("tracked", Integer, "", "tracked features"),
    ("rank_structural", Integer, "", "structural rank"),
    ("rank_informed", Integer, "", "informed rank"),
    ("step_ms", Number, "ms", "time of the step"),
];

/// Columns by which runs of two studies are paired.
pub const PAIRING_COLUMNS: [&str; 5] = ["log", "disturbance", "perturbation", "seed", "run"];

/// Columns of the relative error over a length: translation and rotation.
pub fn relative_error_columns(length_m: f64) -> [String; 2] {
    [format!("rpe_{length_m}m_translation_m"), format!("rpe_{length_m}m_rotation_rad")]
}

fn columns(columns: &[Column]) -> impl Iterator<Item = StudyColumn> {
    columns.iter().map(|(name, column_type, unit, description)| StudyColumn::new(name, *column_type, unit, description))
}

fn table(columns: impl Iterator<Item = StudyColumn>) -> StudyTable {
    StudyTable::new(columns.collect()).expect("columns are empty and have different names")
}

pub fn runs_table() -> StudyTable {
    let relative = RELATIVE_LENGTHS_M.into_iter().flat_map(|length_m| {
        let [translation, rotation] = relative_error_columns(length_m);
        let meaning = format!("relative error over {length_m} m of path, root mean square of the translation");
        [
            StudyColumn::new(&translation, Number, "m", &meaning),
            StudyColumn::new(&rotation, Number, "rad", "the same, rotation"),
        ]
    });
    table(columns(RUNS).chain(relative).chain(columns(RUNS_REST)))
}

pub fn parameters_table() -> StudyTable {
    table(columns(PARAMETERS))
}

pub fn frames_table() -> StudyTable {
    table(columns(FRAMES))
}
