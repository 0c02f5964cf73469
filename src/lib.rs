//! A debugger for visual-inertial navigation with a camera on a gimbal.
//!
//! A flight log goes in at one end and a picture comes out at the other.
//! A folder may use the folders above it in this list and none below it.
//!
//! | folder | promises | does not know of |
//! | --- | --- | --- |
//! | [`geometry`] | rotations, rigid transforms, the one perturbation rule, time units | cameras, logs |
//! | [`camera`] | projection and back-projection with their Jacobians | gimbals, images |
//! | [`gimbal`] | the actuated chain in each parameterization, its Jacobians, conversions and margins | measurements |
//! | [`flight_log`] | MCAP in and out as typed events in time order; rigs; logs of other recorders | what the events are used for |
//! | [`simulation`] | a synthetic flight with known truth, written as a flight log | the estimator |
//! | [`frontend`] | image in, feature tracks out | the estimator, so that runs share tracks |
//! | [`estimator`] | window state, residuals, solver, marginalization; each step leaves a `StepReport` | files, screens, the wall clock |
//! | [`observability`] | a linearization with named columns in, ranks and null directions out | how it was made |
//! | [`calibration`] | a whole flight of both cameras in, the offline calibration of mount and gimbal out | logs, files |
//! | [`session`] | a cursor over a log, runs side by side, stored reports | pixels on a screen |
//! | `gui` | panels, 3D scene, theme: reads reports, sends commands | the inside of the estimator |
//! | [`export`] | the same tables and panels without a window | windows |
//!
//! Three absences hold the shape: nothing above `gui` names egui or wgpu; [`frontend`] does not know the estimator; only
//! [`flight_log`], [`export`] and `main.rs` touch the file system, and only `gui` asks the wall clock for anything but
//! the stage timings of a report.

pub mod calibration;
pub mod camera;
pub mod estimator;
pub mod export;
pub mod flight_log;
pub mod frontend;
pub mod geometry;
pub mod gimbal;
#[cfg(feature = "gui")]
pub mod gui;
pub mod log_check;
pub mod observability;
pub mod sensors;
pub mod session;
pub mod simulation;
