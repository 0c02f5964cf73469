/// Tunables of the calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationOptions {
    /// Time between the instants whose states are estimated, in seconds.
    pub spacing_s: f64,
    /// A track is cut so that none spans more instants than this: it bounds the work.
    pub max_frame_sets_per_track: usize,
    /// Fewest sightings of a landmark.
    pub min_observations: usize,
    /// Rays of a landmark must open this far, in radians.
    pub min_parallax_rad: f64,
    /// Most iterations of one adjustment.
    pub iterations: usize,
    /// An adjustment ends when a step lowers its cost by less than this share.
    pub relative_cost_tolerance: f64,
    /// Adjustments of the bundle, outliers dropped between them.
    pub rounds: usize,
    /// Sightings beyond this many standard deviations are dropped.
    pub outlier_sigmas: f64,
    /// Views in one reconstruction of the gimbal camera's poses.
    pub segment_views: usize,
    /// Fewest pairs of poses; the paper takes 39.
    pub min_measurements: usize,
    /// A joint counts as moving when its angle's standard deviation exceeds this, in radians.
    pub min_joint_motion_rad: f64,
    /// Standard deviation of a camera's unknown time offset, in seconds.
    pub time_shift_sigma_s: f64,
    /// Standard deviation of the biases about zero at the begin, in rad/s and m/s².
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
            time_shift_sigma_s: 0.01,
            bias_sigmas: (0.05, 0.5),
        }
    }
}
