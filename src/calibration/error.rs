use thiserror::Error;

/// Why a flight could not be calibrated from.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CalibrationError {
    /// The static camera's estimator never began.
    #[error("the static camera '{camera}' gives no trajectory: {reason}; 'dcvins check' says more")]
    NoTrajectory {
        /// Key of the camera.
        camera: String,
        /// What the estimator waited for.
        reason: String,
    },
    /// Joints that stand still tell nothing about their axes.
    #[error(
        "no joint of the gimbal moves by more than {limit_deg:.1}° between {from_s:.1} and {to_s:.1} s ({spreads}): \
         record a flight in which the gimbal looks around"
    )]
    NoJointMotion {
        /// What counts as motion: standard deviation of a joint's angle.
        limit_deg: f64,
        /// Begin of the stretch looked at.
        from_s: f64,
        /// Its end.
        to_s: f64,
        /// What was measured, joint by joint.
        spreads: String,
    },
    /// Fewer pairs of camera poses than the calibration needs.
    #[error(
        "only {found} pairs of static and gimbal camera poses could be measured between {from_s:.1} and {to_s:.1} s, \
         {needed} are needed ({reason}): record a longer flight with both cameras over textured ground"
    )]
    TooFewMeasurements {
        /// How many there are.
        found: usize,
        /// How many there should be.
        needed: usize,
        /// Begin of the stretch with a trajectory.
        from_s: f64,
        /// Its end.
        to_s: f64,
        /// What became of the others.
        reason: String,
    },
    /// A least-squares problem that has no solution.
    #[error("the {stage} did not converge: its equations are singular; 'dcvins check' may say why")]
    Singular {
        /// Which step.
        stage: &'static str,
    },
}
