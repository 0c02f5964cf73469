#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationOptions {
    /// Time between frame sets, in seconds.
    pub spacing_s: f64,
    /// Longest track in frame sets; longer ones are cut, which bounds the computing time.
    pub max_frame_sets_per_track: usize,
    /// Smallest number of observations of a landmark.
    pub min_observations: usize,
    /// Smallest angle between two rays of a landmark, in radians.
    pub min_parallax_rad: f64,
    /// Largest number of iterations of one adjustment.
    pub iterations: usize,
    /// Convergence threshold: a step lowers the cost by less than this fraction.
    pub relative_cost_tolerance: f64,
    /// Number of bundle adjustments, with outlier rejection between them.
    pub rounds: usize,
    /// Standard deviations beyond which an observation is dropped.
    pub outlier_sigmas: f64,
    /// Largest number of views in one reconstruction of the gimbal camera's poses.
    pub segment_views: usize,
    /// Smallest number of pairs of poses; the paper uses 39.
    pub min_measurements: usize,
    /// Smallest standard deviation of the angle of a moving joint, in radians.
    pub min_joint_motion_rad: f64,
    /// Compute the covariance of every pose of the trajectory.
    pub pose_covariances: bool,
    /// Prior standard deviation of a camera's time offset, in seconds.
    pub time_shift_sigma_s: f64,
    /// Prior standard deviations of the first biases about zero, in rad/s and m/s².
    pub bias_sigmas: (f64, f64),
}

impl Default for CalibrationOptions {
    fn default() -> Self {
        Self {
            spacing_s: 0.1,
            max_frame_sets_per_track: 18,
            min_observations: 3,
            min_parallax_rad: 0.015,
            iterations: 15,
            relative_cost_tolerance: 1e-5,
            rounds: 3,
            outlier_sigmas: 4.0,
            segment_views: 16,
            min_measurements: 39,
            min_joint_motion_rad: 1.5_f64.to_radians(),
            pose_covariances: false,
            time_shift_sigma_s: 0.01,
            bias_sigmas: (0.05, 0.5),
        }
    }
}
