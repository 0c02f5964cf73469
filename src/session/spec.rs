use thiserror::Error;

/// Which parameterization a run estimates in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterizationChoice {
    /// The minimal form in the chart that suits the mechanism.
    Auto,
    /// Eqs. 18–20 as printed (corrected).
    Minimal,
    /// The end block swapped against gimbal lock.
    MinimalSwapped,
    /// Eqs. 5–6, 12 + 4N columns.
    Classical,
    /// The chart-free product of exponentials.
    Poe,
    /// The rigid camera of the rig.
    Static,
}

/// One `--run NAME[:key=value,…]`.
#[derive(Clone, Debug, PartialEq)]
pub struct RunSpec {
    /// Its name on screen and as a folder: `name=…`, or the spec as written.
    pub label: String,
    /// The parameterization.
    pub parameterization: ParameterizationChoice,
    /// Whether encoder readings are used (`encoder=off` clears it).
    pub encoder: bool,
    /// Whether the static calibration is estimated (`calibrate=off` clears it).
    pub calibrate: bool,
    /// Number of keyframes in the window (`window=10`).
    pub window: usize,
}

/// Why a run specification was refused.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum RunSpecError {
    /// No such parameterization.
    #[error("unknown run '{name}': expected one of auto, minimal, minimal-swapped, classical, poe, static")]
    UnknownName {
        /// What was written.
        name: String,
    },
    /// A key that no run has, or a value that the key cannot take.
    #[error("run '{spec}': {problem}")]
    BadOption {
        /// The whole specification.
        spec: String,
        /// What is wrong with it, and what was expected.
        problem: String,
    },
}
