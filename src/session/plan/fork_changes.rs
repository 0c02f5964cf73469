//! Forks: a run that leaves another one at a frame, with something changed.

use std::collections::BTreeSet;

use thiserror::Error;

use super::run_spec::{ParameterizationChoice, RunSpec};
use crate::estimator::InterventionError;

/// What a fork changes against the run that it leaves.
///
/// Written as `classical,freeze=yaw.alpha+yaw.d,set=pitch.a:30mm,drop=12+15,joint-noise=0.5deg,imu-noise=2`.
#[derive(Clone, Debug, PartialEq)]
pub struct ForkChanges {
    /// Another parameterization of the same chain.
    pub parameterization: Option<ParameterizationChoice>,
    /// Parameters that are fixed at their values from there on.
    pub frozen: Vec<String>,
    /// Parameters that are set to other values, in radians or metres.
    pub values: Vec<(String, f64)>,
    /// Features that are not used any more.
    pub dropped: BTreeSet<u64>,
    /// Keys of cameras that are not used any more, of a run on two.
    pub without: BTreeSet<String>,
    /// Encoder readings are not used any more.
    pub encoder_off: bool,
    /// Standard deviation of noise that is added to every joint angle, in radians, without a change of the estimator's σ.
    pub joint_noise_rad: f64,
    /// Factor on the IMU noise densities.
    pub imu_noise: f64,
    /// Factor on the standard deviation of a tracked pixel.
    pub pixel_noise: f64,
    /// Factor on the standard deviations of the joint angles in the estimator.
    pub encoder_noise: f64,
}

impl Default for ForkChanges {
    fn default() -> Self {
        Self {
            parameterization: None,
            frozen: Vec::new(),
            values: Vec::new(),
            dropped: BTreeSet::new(),
            without: BTreeSet::new(),
            encoder_off: false,
            joint_noise_rad: 0.0,
            imu_noise: 1.0,
            pixel_noise: 1.0,
            encoder_noise: 1.0,
        }
    }
}

/// Why a fork cannot be made.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ForkError {
    /// Something that no fork can change, or a value that it cannot take.
    #[error("fork '{text}': {problem}")]
    BadChange {
        /// What was written.
        text: String,
        /// What is wrong with it, and what was expected.
        problem: String,
    },
    /// The run does not use such a camera.
    #[error("the run uses no camera '{camera}', only {present}")]
    NoCamera {
        /// The key that was given.
        camera: String,
        /// The cameras that it uses.
        present: String,
    },
    /// No camera would be left.
    #[error("without {without} the run would have no visual measurements: leave it one of its cameras")]
    Blind {
        /// The keys of its cameras.
        without: String,
    },
    /// The run has no such parameter.
    #[error(
        "this run cannot be forked so: there is no parameter '{name}' in this parameterization; there are {}",
        known.join(", ")
    )]
    UnknownParameter {
        /// The name that was given.
        name: String,
        /// The parameters that there are.
        known: Vec<String>,
    },
    /// The estimator refuses.
    #[error("this run cannot be forked so: {0}")]
    Estimator(#[from] InterventionError),
    /// There is no step at the cursor, or it cannot be recomputed.
    #[error("there is no step of the run '{run}' here to fork from")]
    NoStep {
        /// The run.
        run: String,
    },
}

/// Why a fork cannot use another camera.
pub(super) const OTHER_CAMERA: &str = "the window of the run holds features that only its own cameras have observed, so that a fork \
                            can leave a camera of two out (without=cam1) but not add another one";

/// Parameterizations that a fork can change to: another camera would have other tracks.
pub const FORK_PARAMETERIZATIONS: [ParameterizationChoice; 5] = [
    ParameterizationChoice::Auto,
    ParameterizationChoice::Minimal,
    ParameterizationChoice::MinimalSwapped,
    ParameterizationChoice::Classical,
    ParameterizationChoice::Poe,
];

impl ForkChanges {
    /// The specification of the fork: the parent's with those changes that a specification has.
    pub(in crate::session) fn spec(&self, parent: &RunSpec, time_s: f64) -> RunSpec {
        let parameterization = self.parameterization.unwrap_or(parent.parameterization);
        let name = self.parameterization.map_or(&*parent.label, |choice| choice.name());
        let encoder = parent.encoder && !self.encoder_off;
        RunSpec { label: format!("{name}-{time_s:.2}s"), parameterization, encoder, ..parent.clone() }
    }
}
