//! A debugger for visual-inertial navigation with a camera on a gimbal.
//!
//! The input is a flight log, the output a window, screenshots and result files.
//! A folder may use the folders above it in this list and none below it; `tests/it/layering.rs` reads the imports and
//! fails on an import in the other direction.
//!
//! | folder | contents | does not depend on |
//! | --- | --- | --- |
//! | [`text`] | `KEY=VALUE` entries, tables of keys, conditions, names of enums | what the keys mean |
//! | [`geometry`] | rotations, rigid transforms, the one perturbation rule, time units | cameras, logs |
//! | [`table`] | columns with name, unit, meaning, value, order and look; tables as CSV | the meaning of the rows |
//! | [`camera`] | projection and back-projection with their Jacobians | gimbals, images |
//! | [`gimbal`] | the actuated chain in each parameterization, its Jacobians, conversions and singularity margins | measurements |
//! | [`sensors`] | plain types of sensor measurements and of the rig that describes the sensors | the source of the data |
//! | [`faults`] | faults of measurements and rigs: their table, their application and its inverse, sentences, ranking of explanations | logs, the estimator, screens |
//! | [`optimization`] | robust loss, reprojection residual with its Jacobians, elimination of landmarks, damped solver | the meaning of the unknowns |
//! | `files` | files that are no logs: rigs, stills, robot descriptions, tables; atomic output and limits of what is read | logs |
//! | `flight_log` | MCAP in and out as typed events in time order; the rig of a log; logs of other recorders | the use of the events |
//! | [`frontend`] | image in, feature tracks out | the estimator, so that runs share tracks |
//! | [`simulation`] | a synthetic flight with ground truth, its measurements and tracks | the estimator |
//! | `simulated_log` | such a flight rendered and written as a flight log, with disturbances | the estimator |
//! | [`estimator`] | window state, residuals, solver, marginalization; each step returns a `StepReport` | logs, screens, the wall clock |
//! | [`observability`] | a linearization with typed columns in, ranks and null directions out | the origin of the linearization |
//! | [`calibration`] | a whole flight of both cameras in, the offline calibration of extrinsics and gimbal out | logs, files |
//! | `log_check` | problems of a log, with evidence and remedy | the estimator |
//! | `session` | a cursor over a log, several runs, stored reports | pixels on a screen |
//! | `study` | the runs defined by a plan, the tables of their results and the comparison of two studies | files, processes, screens |
//! | `painting` | frames of egui painted without a window: pixels, SVG, PDF | what they show |
//! | `gui` | panels, 3D scene, theme: reads reports, sends commands | the internals of the estimator |
//! | `export` | the same tables and panels without a window | windows |
//! | `interop` | a rig as the configuration of another estimator | runs |
//! | `report` | HTML reports of logs and of studies | how their figures are drawn |
//! | `sweep` | the jobs of a study executed, and the files of their results | how jobs are distributed |
//! | `desktop` | what the window asks of the machine: recent files, settings, written panels | sessions |
//!
//! The folders are four crates, so that they compile beside each other and an edit compiles again what depends on it:
//! `dcvins-estimation` (`src/estimation.rs`) has those without files and screens, `dcvins-logs` (`src/logs.rs`) `files`,
//! `flight_log`, `simulated_log`, `log_check`, `session` and `study`, `dcvins-painting` the folder of its name, and this one
//! the rest. It re-exports the others, so that all paths begin here.
//!
//! Two folders differ from the order of the data flow: `simulation` comes after `frontend`, because flights without images
//! use its track types; `calibration` comes after `observability`, with which it reports the unobservable parameters of
//! its flight.
//!
//! Four absences hold the shape: nothing above `painting` names egui or wgpu; [`frontend`], [`estimator`] and [`calibration`]
//! do not know `flight_log`; [`frontend`] does not know the estimator; only `files`, `flight_log`, `export` and
//! what follows it touch the file system, and only `gui` asks the wall clock for anything but the stage timings of a report.
//!
//! Equations and parameterizations: docs/mathematics.md, sections 2 and 3; rank rule: docs/mathematics.md, section 8.
//!
//! Documents: `docs/tutorial.md` and `docs/manual.md` (the window), `docs/recordings.md` (from a recording to a run),
//! `docs/commands.md`, `docs/formats.md` (logs, rigs, written files), `docs/accuracy.md` and `docs/experiments/`
//! (results), `docs/architecture.md`, `docs/libraries.md`, `docs/coming_from.md` (Kalibr, VINS-Fusion, OpenVINS),
//! `docs/packages.md`.
//!
//! # The estimator as a library
//!
//! Without default features the crate contains only the estimator and its dependencies, without MCAP, SQLite, clap and
//! egui.
//! This example estimates eight seconds of a simulated flight with a gimbal camera and compares the velocity with the
//! ground truth, in the IMU frame and therefore without alignment:
//!
//! ```
//! use dcvins::estimator::{Estimator, EstimatorConfig, StepInput};
//! use dcvins::gimbal::Parameterization;
//! use dcvins::simulation::{SyntheticOptions, synthetic_tracks};
//!
//! let flight = synthetic_tracks(&SyntheticOptions { duration_s: 8.0, ..SyntheticOptions::default() });
//! let config = EstimatorConfig::for_camera(&flight.given_rig, "cam0", Parameterization::Minimal)?;
//! let encoder_sigma_rad = config.encoder_sigma_rad.expect("the simulated gimbal has encoders");
//! let mut estimator = Estimator::new(config);
//!
//! let mut errors_m_per_s = Vec::new();
//! for frame in &flight.frames {
//!     let report = estimator.step(&StepInput {
//!         frame_index: frame.index,
//!         stamp_ns: frame.stamp_ns,
//!         imu: &frame.imu,
//!         imu_after: &[],
//!         image_times_s: &[],
//!         gimbal_imu: &[],
//!         joint_angles: frame.encoder_angles(encoder_sigma_rad).as_ref(),
//!         tracks: &frame.tracks,
//!         further_tracks: &[],
//!     });
//!     // There is no window before the initialization.
//!     if let Some(newest) = report.newest() {
//!         let estimated = newest.world_from_imu.rotation.inverse() * newest.velocity_m_per_s;
//!         let truth = frame.true_world_from_imu.rotation.inverse() * frame.true_velocity_m_per_s;
//!         errors_m_per_s.push((estimated - truth).norm());
//!     }
//! }
//! let mean_m_per_s = errors_m_per_s.iter().sum::<f64>() / errors_m_per_s.len() as f64;
//! println!("{} frames estimated, mean velocity error {mean_m_per_s:.3} m/s", errors_m_per_s.len());
//! assert!(errors_m_per_s.len() > 80 && mean_m_per_s < 0.05);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(feature = "gui")]
pub mod desktop;
#[cfg(feature = "logs")]
pub mod export;
#[cfg(feature = "gui")]
pub mod gui;
#[cfg(feature = "logs")]
pub mod interop;
#[cfg(feature = "logs")]
pub mod report;
#[cfg(feature = "logs")]
pub mod sweep;

pub use dcvins_estimation::{
    calibration, camera, estimator, faults, frontend, geometry, gimbal, observability, optimization, sensors,
    simulation, table, text,
};
#[cfg(feature = "logs")]
pub use dcvins_logs::{files, flight_log, log_check, session, simulated_log, study};
#[cfg(feature = "gui")]
pub use dcvins_painting as painting;
