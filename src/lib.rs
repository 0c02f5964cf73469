//! A debugger for visual-inertial navigation with a camera on a gimbal.
//!
//! A flight log goes in at one end and a screenshot comes out at the other.
//! A folder may use the folders above it in this list and none below it; `tests/it/layering.rs` reads the imports and
//! fails on one that points the wrong way.
//!
//! | folder | promises | does not know of |
//! | --- | --- | --- |
//! | [`text`] | `KEY=VALUE` entries, tables of keys, names of enums | what the keys mean |
//! | [`geometry`] | rotations, rigid transforms, the one perturbation rule, time units | cameras, logs |
//! | [`camera`] | projection and back-projection with their Jacobians | gimbals, images |
//! | [`gimbal`] | the actuated chain in each parameterization, its Jacobians, conversions and singularity margins | measurements |
//! | [`sensors`] | plain types of what sensors deliver and of the rig that describes them | where they come from |
//! | [`optimization`] | robust loss, reprojection residual with its Jacobians, elimination of landmarks, damped solver | whose unknowns they are |
//! | `flight_log` | MCAP in and out as typed events in time order; rig files; logs of other recorders | what the events are used for |
//! | [`frontend`] | image in, feature tracks out | the estimator, so that runs share tracks |
//! | [`simulation`] | a synthetic flight with ground truth, as tracks or written as a flight log | the estimator |
//! | [`estimator`] | window state, residuals, solver, marginalization; each step returns a `StepReport` | logs, screens, the wall clock |
//! | [`observability`] | a linearization with typed columns in, ranks and null directions out | how it was made |
//! | [`calibration`] | a whole flight of both cameras in, the offline calibration of extrinsics and gimbal out | logs, files |
//! | `log_check` | what is wrong with a log, with evidence and remedy | the estimator |
//! | `session` | a cursor over a log, runs side by side, stored reports | pixels on a screen |
//! | `study` | the runs that a plan asks for, the tables of their results and the comparison of two of them | files, processes, screens |
//! | `gui` | panels, 3D scene, theme: reads reports, sends commands | the inside of the estimator |
//! | `export` | the same tables and panels without a window | windows |
//! | `interop` | a rig as the configuration of another estimator | runs |
//! | `report` | HTML reports of logs and of studies | how their figures are drawn |
//! | `sweep` | the jobs of a study executed, and the files of their results | how jobs are distributed |
//! | `desktop` | what the window asks of the machine: recent files, settings, written panels | sessions |
//!
//! Two places differ from the way of the data, each for a reason: `simulation` stands below `frontend`, whose track types
//! it writes for flights without images; `calibration` stands below `observability`, by which it says what its flight
//! could not constrain.
//!
//! Four absences hold the shape: nothing above `gui` names egui or wgpu; [`frontend`], [`estimator`] and [`calibration`]
//! do not know `flight_log`; [`frontend`] does not know the estimator; only `flight_log`, `export` and what
//! follows it touch the file system, and only `gui` asks the wall clock for anything but the stage timings of a report.
//!
//! Equations and parameterizations: docs/mathematics.md, sections 2 and 3; rank rule: docs/mathematics.md, section 8.
//!
//! Documents beside the source: `docs/tutorial.md` and `docs/manual.md` (the window), `docs/recordings.md` (from a recording
//! to a run), `docs/commands.md`, `docs/formats.md` (logs, rigs, written files), `docs/accuracy.md`, `docs/architecture.md`, `docs/coming_from.md` (Kalibr,
//! VINS-Fusion, OpenVINS), `docs/packages.md`.
//!
//! # The estimator as a library
//!
//! Without default features the crate holds what an estimator needs, and builds without MCAP, SQLite, clap and egui.
//! This estimates eight seconds of a simulated flight with a gimballed camera and compares the velocity, seen in the IMU
//! frame and hence without any alignment, with the ground truth:
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
//!         joint_angles: frame.encoder_angles(encoder_sigma_rad).as_ref(),
//!         tracks: &frame.tracks,
//!         rigid_tracks: &[],
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

pub mod calibration;
pub mod camera;
#[cfg(feature = "gui")]
pub mod desktop;
pub mod estimator;
#[cfg(feature = "logs")]
pub mod export;
#[cfg(feature = "logs")]
pub mod flight_log;
pub mod frontend;
pub mod geometry;
pub mod gimbal;
#[cfg(feature = "gui")]
pub mod gui;
#[cfg(feature = "logs")]
pub mod interop;
#[cfg(feature = "logs")]
pub mod log_check;
pub mod observability;
pub mod optimization;
#[cfg(feature = "logs")]
pub mod report;
pub mod sensors;
#[cfg(feature = "logs")]
pub mod session;
pub mod simulation;
#[cfg(feature = "logs")]
pub mod study;
#[cfg(feature = "logs")]
pub mod sweep;
pub mod text;
