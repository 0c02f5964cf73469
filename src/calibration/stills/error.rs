use thiserror::Error;

/// Reason for the failure of a calibration from stills.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum StillsError {
    #[error(
        "{found} sets with poses of gimbal camera and a rigid camera, at least {needed} are needed for {joints} joints: \
         take more stills with different joint angles{left_out}"
    )]
    TooFewSets {
        found: usize,
        needed: usize,
        joints: usize,
        /// Views that were left out, with reasons; empty without one.
        left_out: String,
    },
    #[error(
        "the pose loops did not converge: their equations are singular; check that every joint moves and that signs and \
         order of the joints are those of the initial chain"
    )]
    Singular,
    /// The caller ended the calibration.
    #[error("interrupted, stage '{stage}': nothing is written")]
    Interrupted { stage: &'static str },
}
