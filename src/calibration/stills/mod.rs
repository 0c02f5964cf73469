//! Calibration of a gimbal from still images of known points, joint readings and rigid cameras, without IMU.
//!
//! 1. The pose of every camera is refined on its own points (`view_pose`).
//! 2. Pose loops (`observed`) compare rigid camera, chain and gimbal camera in each set. Joint angles are the readings
//!    with noise; the standard deviations of encoders and map are estimated with the chain (`fit`), and sets whose
//!    readings contradict the images lose them.
//! 3. Parameters with σ in every parameterization, ranks, systematic errors of the encoders, and errors in pixels on
//!    training and held-out sets.
//!
//! The chain is estimated as a product of exponentials, which has no singularity; other parameterizations are exact
//! conversions.

mod calibrate;
mod encoders;
mod fit;
mod hold_out;
mod loops;
mod noise;
mod observed;
mod outcome;
mod parameters;
mod pixels;
mod point_residual;
mod pose_start;
mod ranks;
mod scores;
#[cfg(test)]
mod tests;
mod view_pose;
mod warnings;
mod wrong_readings;

pub use calibrate::{StillsError, StillsOptions, calibrate_stills, judge_stills};
pub use encoders::{EncoderErrorKind, EncoderTest};
pub use fit::AngleModel;
pub use noise::StillsNoise;
pub use outcome::{
    AxisAngle, CameraFloor, ParameterTable, PixelStatistics, ScoredChain, SetReport, StillsCorrelations, StillsOutcome,
    StillsParameter, StillsScore, ViewReport,
};
pub use ranks::{AngleKnowledge, StillsRank};
