//! `calibration.json` and the printed report of `dcvins calibrate`, modelled on Kalibr's.

use std::fmt;

use nalgebra::Matrix4;
use serde::Serialize;

use super::posterior::SigmaTable;
use crate::calibration::{CalibrationOutcome, ExtrinsicsReport, PixelReport, PoseLoopReport, Statistics};
use crate::geometry::{Dimension, RigidTransform, seconds_from_ns, so3};
use crate::gimbal::{Chain, Quantity};
use crate::sensors::Rig;
use crate::session::{CalibrationErrors, CalibrationRun, FlightSigmas, WarningLine, log_warning_lines};
use crate::table::text::{TextTable, left, right};
use crate::text::{Named as _, log_name};

/// One parameter before and after the calibration.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterReport {
    /// Name, with the names of joints and cameras.
    pub name: String,
    /// Serialized as its unit.
    #[serde(rename = "unit")]
    pub dimension: Dimension,
    /// Value in the given rig.
    pub initial: f64,
    #[serde(rename = "final")]
    pub last: f64,
    pub sigma: f64,
    /// Prior standard deviation from the rig.
    pub prior_sigma: Option<f64>,
    #[serde(rename = "truth", skip_serializing_if = "Option::is_none")]
    pub ground_truth: Option<f64>,
    /// Calibrated minus ground-truth value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
}

/// Ranks of the chain's calibration over the whole log.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct CalibrationRank {
    /// Number of calibration parameters.
    pub columns: usize,
    pub rank_structural: usize,
    /// Number of directions with σ below 10° and 3 cm from the log alone.
    pub rank_informed: usize,
    /// The result in one line.
    pub verdict: String,
}

/// Content of the file `calibration.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalibrationReport {
    /// File name of the log.
    pub log: String,
    /// Start and end of the used interval, in seconds since the log began.
    pub stretch_s: [f64; 2],
    /// Number of synchronized frame sets whose states were estimated.
    #[serde(rename = "instants")]
    pub frame_sets: usize,
    /// Name of the parameterization of the estimated chain.
    pub parameterization: String,
    /// Reprojection errors of the static camera's calibration alone.
    pub camera_imu_reprojection: PixelReport,
    /// Reprojection errors of the bundle adjustment, static camera first.
    pub reprojection: [PixelReport; 2],
    /// Difference of mean angular rates between frames and the gyroscope's, in rad/s.
    pub gyroscope_error_rad_per_s: Statistics,
    /// Difference of mean accelerations between frames and the accelerometer's, in m/s².
    pub accelerometer_error_m_per_s2: Statistics,
    pub pose_loops: PoseLoopReport,
    /// Every calibrated parameter: static camera, time offsets, chain.
    pub parameters: Vec<ParameterReport>,
    /// `T_cam_imu` of the static camera, by rows.
    pub static_t_cam_imu: [[f64; 4]; 4],
    /// `T_imu_cam` of the gimbal camera with all joint angles at zero, by rows.
    pub gimbal_t_imu_cam_at_zero: [[f64; 4]; 4],
    /// Observability of the chain's calibration.
    pub rank: Option<CalibrationRank>,
    /// Errors against ground truth, `None` if there is none.
    #[serde(rename = "truth")]
    pub ground_truth: Option<CalibrationErrors>,
    /// Standard deviations of all parameters under the rig's prior and after each flight.
    pub flights: Vec<FlightSigmas>,
    /// The same as a table, `None` if the calibration did not start from other flights.
    #[serde(skip)]
    flight_table: Option<SigmaTable>,
    pub warnings: Vec<String>,
}

pub fn report_calibration(run: &CalibrationRun) -> CalibrationReport {
    let flights = SigmaTable::of_calibration(run);
    let outcome = &run.outcome;
    let zero = vec![0.0; outcome.chain.joint_count()];
    let mut warnings = outcome.warnings.clone();
    warnings.extend(log_warning_lines(&run.warnings).iter().map(WarningLine::with_time));
    CalibrationReport {
        log: log_name(&run.log_path),
        stretch_s: [seconds_from_ns(outcome.stretch_ns.0), seconds_from_ns(outcome.stretch_ns.1)],
        frame_sets: outcome.frame_sets,
        parameterization: outcome.parameterization.to_string(),
        camera_imu_reprojection: outcome.static_pixels.clone(),
        reprojection: outcome.pixels.clone(),
        gyroscope_error_rad_per_s: outcome.imu.gyroscope_rad_per_s,
        accelerometer_error_m_per_s2: outcome.imu.accelerometer_m_per_s2,
        pose_loops: outcome.pose_loop.clone(),
        parameters: parameters(run),
        static_t_cam_imu: rows(&outcome.extrinsics.imu_from_camera.inverse()),
        gimbal_t_imu_cam_at_zero: rows(&outcome.chain.imu_from_camera(&zero)),
        rank: outcome.rank.as_ref().map(|rank| CalibrationRank {
            columns: rank.parameters.len(),
            rank_structural: rank.rank_structural,
            rank_informed: rank.rank_informed,
            verdict: rank.verdict(&run.given_rig.parameter_names()),
        }),
        ground_truth: run.errors(),
        flights: flights.flights().to_vec(),
        flight_table: run.prior.is_some().then_some(flights),
        warnings,
    }
}

fn rows(transform: &RigidTransform) -> [[f64; 4]; 4] {
    let matrix: Matrix4<f64> = transform.to_matrix();
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}

/// Static camera, time offsets, then the chain.
fn parameters(run: &CalibrationRun) -> Vec<ParameterReport> {
    let outcome = &run.outcome;
    let mut parameters = extrinsics_parameters(run, &outcome.extrinsics);
    parameters.push(time_shift(run, &run.static_camera, outcome.extrinsics.time_shift_s));
    parameters.extend(chain_parameters(run, outcome));
    parameters.push(time_shift(run, &run.gimbal_camera, outcome.gimbal_time_shift_s));
    parameters
}

fn extrinsics_parameters(run: &CalibrationRun, extrinsics: &ExtrinsicsReport) -> Vec<ParameterReport> {
    let values = |transform: &RigidTransform| {
        let (rotation_vector, shift) = (so3::log(&transform.rotation), transform.translation_m);
        [rotation_vector.x, rotation_vector.y, rotation_vector.z, shift.x, shift.y, shift.z]
    };
    let ground_truth = run.true_extrinsics();
    let (initial, last) = (values(&extrinsics.initial), values(&extrinsics.imu_from_camera));
    let ground_truth_values = ground_truth.as_ref().map(values);
    let error = ground_truth.map(|ground_truth| extrinsics.imu_from_camera.minus(&ground_truth));
    Quantity::TRANSFORM
        .into_iter()
        .enumerate()
        .map(|(axis, quantity)| ParameterReport {
            name: format!("{}.{}", run.static_camera, quantity.name()),
            dimension: quantity.dimension(),
            initial: initial[axis],
            last: last[axis],
            sigma: extrinsics.sigmas[axis],
            prior_sigma: None,
            ground_truth: ground_truth_values.map(|ground_truth| ground_truth[axis]),
            error: error.map(|error| error[axis]),
        })
        .collect()
}

fn time_shift(run: &CalibrationRun, key: &str, (change_s, sigma_s): (f64, f64)) -> ParameterReport {
    let of = |rig: &Rig| rig.cameras.iter().find(|camera| camera.key == key).map(|camera| camera.timeshift_cam_imu_s);
    let initial = of(&run.given_rig).unwrap_or(0.0);
    let ground_truth = run.ground_truth_rig.as_ref().and_then(of);
    ParameterReport {
        name: format!("{key}.timeshift_cam_imu"),
        dimension: Dimension::Time,
        initial,
        last: initial + change_s,
        sigma: sigma_s,
        prior_sigma: None,
        ground_truth,
        error: ground_truth.map(|ground_truth| initial + change_s - ground_truth),
    }
}

fn chain_parameters(run: &CalibrationRun, outcome: &CalibrationOutcome) -> Vec<ParameterReport> {
    let ground_truth = run.ground_truth_rig.as_ref().and_then(|rig| {
        let chain_of = |rig: &Rig| Some(Chain::from_classical(&rig.gimbal.as_ref()?.chain, outcome.parameterization));
        let (chain, given) = (chain_of(rig)?, chain_of(&run.given_rig)?);
        (chain.dof() == outcome.parameters.len()).then(|| chain.values_from(&given))
    });
    let names = run.given_rig.parameter_names();
    outcome
        .parameters
        .iter()
        .enumerate()
        .map(|(place, parameter)| {
            let ground_truth = ground_truth.as_ref().map(|values| values[place]);
            let dimension = parameter.parameter.dimension();
            let initial = parameter.parameter.principal_value(parameter.initial);
            ParameterReport {
                name: names.name(parameter.parameter),
                dimension,
                initial,
                last: parameter.parameter.value_near(initial, parameter.value),
                sigma: parameter.sigma,
                prior_sigma: Some(parameter.prior_sigma),
                ground_truth: ground_truth.map(|ground_truth| parameter.parameter.value_near(initial, ground_truth)),
                error: ground_truth.map(|ground_truth| dimension.difference(parameter.value, ground_truth)),
            }
        })
        .collect()
}

impl fmt::Display for CalibrationReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "Offline calibration of {}, {:.2} to {:.2} s, {} synchronized frame sets, parameterization {}",
            self.log, self.stretch_s[0], self.stretch_s[1], self.frame_sets, self.parameterization
        )?;
        let line = |f: &mut fmt::Formatter<'_>, name: &str, unit: &str, s: &Statistics| {
            writeln!(
                f,
                "  {:<38} mean {:.4}, median {:.4}, std {:.4}, rms {:.4} ({})",
                format!("{name} [{unit}]:"),
                s.mean,
                s.median,
                s.std,
                s.rms,
                s.count
            )
        };
        writeln!(f, "\nCamera-IMU calibration of the static camera")?;
        let alone = &self.camera_imu_reprojection;
        line(f, &format!("Reprojection error ({})", alone.camera), "px", &alone.residuals_px)?;
        writeln!(f, "\nPose loops")?;
        let loops = &self.pose_loops;
        writeln!(
            f,
            "  {} pose pairs of static and gimbal camera in {} segments, {} inliers",
            loops.pairs, loops.segments, loops.fitting
        )?;
        line(f, "Loop closure error", "m", &loops.gaps_m)?;
        writeln!(f, "\nBundle adjustment of both cameras")?;
        for camera in &self.reprojection {
            line(f, &format!("Reprojection error ({})", camera.camera), "px", &camera.residuals_px)?;
        }
        line(f, "Gyroscope error", "rad/s", &self.gyroscope_error_rad_per_s)?;
        line(f, "Accelerometer error", "m/s²", &self.accelerometer_error_m_per_s2)?;
        if let Some(rank) = &self.rank {
            writeln!(f, "  Observability: {}", rank.verdict)?;
        }
        let columns = [left("Parameters", 28), right("initial", 13), right("final", 12), left("     ± σ", 0)];
        let rows = self.parameters.iter().map(|parameter| {
            let (factor, unit) = parameter.dimension.shown_unit();
            let [initial, last, sigma] = [parameter.initial, parameter.last, parameter.sigma].map(|it| it * factor);
            let error = parameter.error.map_or_else(String::new, |error| format!("  (error {:+.4})", error * factor));
            [
                format!("  {}", parameter.name),
                format!("{initial:.4}"),
                format!("{last:.4}"),
                format!(" ± {sigma:<9.4} {unit}{error}"),
            ]
        });
        write!(f, "\n{}", TextTable::new(columns, rows).not_indented())?;
        matrix(f, "T_cam_imu of the static camera", &self.static_t_cam_imu)?;
        matrix(f, "T_imu_cam of the gimbal camera, all joints at zero", &self.gimbal_t_imu_cam_at_zero)?;
        if let Some(ground_truth) = &self.ground_truth {
            writeln!(
                f,
                "\nExtrinsics errors against the ground truth, mean ± standard deviation over the joint angles of the log"
            )?;
            for (name, distance) in [
                ("static camera, rig", &ground_truth.static_initial),
                ("static camera, camera-IMU", &ground_truth.static_camera_imu),
                ("static camera, bundle", &ground_truth.static_final),
                ("gimbal, rig", &ground_truth.chain_initial),
                ("gimbal, pose loops", &ground_truth.chain_pose_loop),
                ("gimbal, bundle", &ground_truth.chain_final),
            ] {
                writeln!(
                    f,
                    "  {name:<26} {:8.2} ± {:5.2} mm {:8.3} ± {:6.3}°",
                    distance.translation_mean_m * 1e3,
                    distance.translation_std_m * 1e3,
                    distance.rotation_mean_rad.to_degrees(),
                    distance.rotation_std_rad.to_degrees()
                )?;
            }
        }
        if let Some(flights) = &self.flight_table {
            write!(f, "\n{flights}")?;
        }
        for warning in &self.warnings {
            writeln!(f, "  warning      {warning}")?;
        }
        Ok(())
    }
}

fn matrix(f: &mut fmt::Formatter<'_>, title: &str, rows: &[[f64; 4]; 4]) -> fmt::Result {
    writeln!(f, "\n{title}")?;
    for row in rows {
        writeln!(f, "  [{:>12.8} {:>12.8} {:>12.8} {:>12.8}]", row[0], row[1], row[2], row[3])?;
    }
    Ok(())
}
