//! Which directions of the calibration the Jacobian cannot see.

/// Ranks of the calibration block at one step, by the rule of section 3 of the mathematics notes.
#[derive(Clone, Debug, PartialEq)]
pub struct RankReport {
    /// Names of the calibration columns.
    pub names: Vec<String>,
    /// Singular values of the prior-scaled, projected calibration columns, largest first, one per column.
    pub singular_values: Vec<f64>,
    /// Singular values with the priors kept in.
    pub singular_values_with_priors: Vec<f64>,
    /// Norm of the prior-scaled calibration columns before projection: the reference of the structural threshold.
    pub reference: f64,
    /// At or below this a singular value is a structural zero.
    pub structural_threshold: f64,
    /// Below this a direction is uninformed (1: the posterior is over 0.71 of the prior).
    pub informed_threshold: f64,
    /// Number of singular values over the structural threshold.
    pub rank_structural: usize,
    /// Number of singular values at or over the informed threshold.
    pub rank_informed: usize,
    /// Lost to the parameterization.
    pub deficit_parameterization: usize,
    /// Lost because joints did not move in the window.
    pub deficit_joints: usize,
    /// Absorbed by free joint angles.
    pub deficit_absorbed: usize,
    /// Lost to the motion of the vehicle.
    pub deficit_motion: usize,
    /// Null and weak directions, weakest first.
    pub directions: Vec<CalibrationDirection>,
    /// Margins to the chart's locks.
    pub margins: Vec<(String, f64)>,
}

/// One right singular direction of the calibration block.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationDirection {
    /// Its singular value.
    pub singular_value: f64,
    /// Whether it is a structural zero (else merely uninformed).
    pub structural: bool,
    /// Signed weight of each parameter in the prior-scaled, unit direction.
    pub weights: Vec<f64>,
}
