//! Forks: a fork continues another run from a frame on, with changes.

use std::collections::BTreeSet;

use thiserror::Error;

use super::run_spec::{ParameterizationChoice, RunSpec};
use crate::estimator::{InterventionError, SensorParameters};
use crate::faults::Fault;
use crate::text::Named as _;

/// The changes of a fork against its parent run.
///
/// Syntax: `classical,estimate=readout,freeze=yaw.alpha+yaw.d,set=pitch.a:30mm,drop=12+15,joint-noise=0.5deg,imu-noise=2`;
/// the keys are [`ForkChanges::KEYS`].
#[derive(Clone, Debug, PartialEq)]
pub struct ForkChanges {
    /// Another parameterization of the same chain.
    pub parameterization: Option<ParameterizationChoice>,
    /// Sensor parameters that are estimated from here on (`estimate=readout+intrinsics`).
    pub estimated: BTreeSet<SensorParameters>,
    /// Names of parameters that are fixed at their values (`freeze=`).
    pub frozen: Vec<String>,
    /// Names and new values of parameters, in radians or metres (`set=`).
    pub values: Vec<(String, f64)>,
    /// Ids of features that are no longer used (`drop=`).
    pub dropped: BTreeSet<u64>,
    /// Keys of cameras that are no longer used, for a run with two (`without=`).
    pub without: BTreeSet<String>,
    /// Use encoder readings (`encoder=off` clears it).
    pub encoder: bool,
    /// Standard deviation of noise added to every joint angle, in radians; the estimator's σ stays as it is.
    pub joint_noise_rad: f64,
    /// Scale factor of the IMU noise densities.
    pub imu_noise: f64,
    /// Scale factor of the standard deviation of a tracked pixel.
    pub pixel_noise: f64,
    /// Scale factor of the joint angles' standard deviations in the estimator.
    pub encoder_noise: f64,
    /// Scale factor of the rig's standard deviations of the chain (`chain-prior=`).
    pub chain_prior: f64,
    /// Errors of recording or rig that are undone (`correct=`).
    pub corrections: Vec<Fault>,
}

impl Default for ForkChanges {
    fn default() -> Self {
        Self {
            parameterization: None,
            estimated: BTreeSet::new(),
            frozen: Vec::new(),
            values: Vec::new(),
            dropped: BTreeSet::new(),
            without: BTreeSet::new(),
            encoder: true,
            joint_noise_rad: 0.0,
            imu_noise: 1.0,
            pixel_noise: 1.0,
            encoder_noise: 1.0,
            chain_prior: 1.0,
            corrections: Vec::new(),
        }
    }
}

/// Reason why a fork cannot be made.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ForkError {
    /// A change that is not supported, or an invalid value.
    #[error("fork '{text}': {problem}")]
    BadChange { text: String, problem: String },
    #[error("the run uses no camera '{camera}', only {present}")]
    NoCamera {
        camera: String,
        /// Keys of the cameras of the run.
        present: String,
    },
    #[error("without {without} the run has no visual measurements: keep one of its cameras")]
    Blind { without: String },
    #[error(
        "cannot fork this run: no parameter '{name}' in this parameterization; expected one of {}",
        known.join(", ")
    )]
    UnknownParameter { name: String, known: Vec<String> },
    /// The estimator rejected the change.
    #[error("cannot fork this run: {0}")]
    Estimator(#[from] InterventionError),
    /// There is no step at the cursor, or it cannot be recomputed.
    #[error("run '{run}' has no step at the cursor to fork from")]
    NoStep { run: String },
}

/// Reason why a fork cannot use another camera.
pub(super) const OTHER_CAMERA: &str = "the window of the run contains features that only its own cameras have observed, so that a \
                            fork can exclude one of two cameras (without=cam1) but not add another one";

/// Parameterizations to which a fork can change. Those of another camera would need other tracks.
pub const FORK_PARAMETERIZATIONS: [ParameterizationChoice; 5] = [
    ParameterizationChoice::Auto,
    ParameterizationChoice::Minimal,
    ParameterizationChoice::MinimalSwapped,
    ParameterizationChoice::Classical,
    ParameterizationChoice::Poe,
];

impl ForkChanges {
    /// Specification of the fork: the parent's, with the changes that a specification can express and a new label.
    pub(in crate::session) fn spec(&self, parent: &RunSpec, time_s: f64) -> RunSpec {
        let parameterization = self.parameterization.unwrap_or(parent.parameterization);
        let name = self.parameterization.map_or(&*parent.label, |choice| choice.name());
        let encoder = parent.encoder && self.encoder;
        let mut spec = RunSpec { label: format!("{name}-{time_s:.2}s"), parameterization, encoder, ..parent.clone() };
        self.estimated.iter().for_each(|columns| *spec.estimates_mut(*columns) = true);
        spec
    }
}
