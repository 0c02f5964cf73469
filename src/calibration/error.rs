use thiserror::Error;

/// Reason for the failure of a calibration.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CalibrationError {
    #[error("the static camera '{camera}' has no trajectory: {reason}; details: 'dcvins check'")]
    NoTrajectory {
        camera: String,
        /// Last reason for which the initialization waited.
        reason: String,
    },
    /// No joint moves: the joint axes are unobservable.
    #[error(
        "no joint of the gimbal moves by more than {limit_deg:.1}° between {from_s:.1} and {to_s:.1} s ({spreads}): \
         record a flight in which the gimbal joints move"
    )]
    NoJointMotion {
        /// Smallest standard deviation of the angle of a moving joint.
        limit_deg: f64,
        from_s: f64,
        to_s: f64,
        /// Measured standard deviations, joint by joint.
        spreads: String,
    },
    #[error(
        "only {found} pose pairs of static and gimbal camera between {from_s:.1} and {to_s:.1} s, {needed} required \
         ({reason}): record a longer flight with both cameras over textured ground"
    )]
    TooFewMeasurements {
        found: usize,
        needed: usize,
        from_s: f64,
        to_s: f64,
        /// Numbers of frame sets and missing pairs, by cause.
        reason: String,
    },
    #[error("the {stage} did not converge: its equations are singular; possible reasons: 'dcvins check'")]
    Singular { stage: &'static str },
    /// The caller ended the calibration.
    #[error("interrupted, stage '{stage}': nothing is written")]
    Interrupted { stage: &'static str },
}
