use crate::sensors::ChainPrior;

/// What to do while the vehicle is stationary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StandstillPolicy {
    /// Remember the standstill and wait for motion: the most accurate.
    WaitForMotion,
    /// Start at once, with velocity zero and without depths.
    InitializeAtOnce,
}

/// Error of the mount's rotation in each frame without an encoder.
const BLIND_MOUNT_NOISE_RAD: f64 = 0.5;
/// Error of the mount's rotation that all frames share without an encoder.
const BLIND_MOUNT_SIGMA_RAD: f64 = 1.0;

/// Tunables of [`super::try_initialize`].
#[derive(Clone, Debug, PartialEq)]
pub struct InitializationOptions {
    /// Standard deviation of a bearing: one pixel over the focal length, or what the tracker is worth.
    pub bearing_sigma_rad: f64,
    /// Error of the mount's rotation that all frames share (calibration).
    pub mount_rotation_sigma_rad: f64,
    /// Error of the mount's rotation of its own in each frame (encoder noise; zero for a rigid camera).
    pub mount_rotation_noise_rad: f64,
    /// Error of the camera's place on the IMU.
    pub mount_translation_sigma_m: f64,
    /// Turn-on bias of the gyroscope, standard deviation per axis.
    pub gyroscope_bias_sigma_rad_per_s: f64,
    /// Turn-on bias of the accelerometer, standard deviation per axis.
    pub accelerometer_bias_sigma_m_per_s2: f64,
    /// What to do in a standstill.
    pub standstill_policy: StandstillPolicy,

    /// Frames older than this against the newest are not used.
    pub longest_window_s: f64,
    /// The views must span at least this.
    pub shortest_window_s: f64,
    /// Most views.
    pub most_views: usize,
    /// Fewest views.
    pub least_views: usize,
    /// Views lie at least this far apart in time.
    pub least_spacing_s: f64,
    /// Views lie at most this far apart in time, when nothing moves.
    pub most_spacing_s: f64,
    /// Rotation-compensated parallax at which a further view is taken.
    pub spacing_parallax_rad: f64,

    /// Common features that neighbouring views and the base of the reconstruction need.
    pub least_common_features: usize,
    /// Rotation-compensated parallax that the base of the reconstruction needs.
    pub least_parallax_rad: f64,
    /// Standard deviation of the acceleration between views, gravity included, below which the scale is unobservable.
    pub least_excitation_m_per_s2: f64,
    /// Share of features that must agree with a pose.
    pub least_inlier_share: f64,
    /// Fewest landmarks with a depth.
    pub least_landmarks: usize,
    /// Most features that take part.
    pub most_landmarks: usize,
    /// Largest root mean square reprojection error, in standard deviations of a bearing.
    pub most_reprojection_sigmas: f64,
    /// The IMU may be noisier than its rig says by this factor before its residuals reject a solution.
    pub inertial_noise_factor: f64,
    /// Largest relative standard deviation of the scale.
    pub most_scale_sigma: f64,
    /// Largest standard deviation of the newest velocity.
    pub most_velocity_sigma_m_per_s: f64,
    /// Largest standard deviation of gravity's direction.
    pub most_gravity_sigma_rad: f64,
}

impl Default for InitializationOptions {
    fn default() -> Self {
        Self {
            bearing_sigma_rad: 0.0025,
            mount_rotation_sigma_rad: 0.01,
            mount_rotation_noise_rad: 0.0,
            mount_translation_sigma_m: 0.005,
            gyroscope_bias_sigma_rad_per_s: 0.05,
            accelerometer_bias_sigma_m_per_s2: 0.4,
            standstill_policy: StandstillPolicy::WaitForMotion,
            longest_window_s: 3.5,
            shortest_window_s: 0.6,
            most_views: 15,
            least_views: 6,
            least_spacing_s: 0.12,
            most_spacing_s: 0.5,
            spacing_parallax_rad: 0.02,
            least_common_features: 25,
            least_parallax_rad: 0.02,
            least_excitation_m_per_s2: 0.25,
            least_inlier_share: 0.6,
            least_landmarks: 25,
            most_landmarks: 200,
            most_reprojection_sigmas: 1.5,
            inertial_noise_factor: 1.5,
            most_scale_sigma: 0.05,
            most_velocity_sigma_m_per_s: 0.25,
            most_gravity_sigma_rad: 0.06,
        }
    }
}

/// Parallax, in standard deviations of a bearing, that two views need to triangulate: a landmark that is seen under so wide
/// an angle has a depth to about a fifth (the noise of two bearings over it), and hundreds of them make a base.
const PARALLAX_SIGMAS: f64 = 7.0;

impl InitializationOptions {
    /// Sets what depends on the camera: the noise of a bearing, and the parallaxes that are measured by it.
    ///
    /// Times do not depend on the camera's rate: what they wait for is the motion of the vehicle.
    #[must_use]
    pub fn for_camera(mut self, focal_length_px: f64, pixel_sigma_px: f64) -> Self {
        self.bearing_sigma_rad = pixel_sigma_px / focal_length_px;
        self.spacing_parallax_rad = PARALLAX_SIGMAS * self.bearing_sigma_rad;
        self.least_parallax_rad = PARALLAX_SIGMAS * self.bearing_sigma_rad;
        self
    }

    /// Sets the mount's errors for a gimbal of `joints` joints: bounds of the chain's uniform errors, and the noise of an
    /// encoder reading (`None` without encoders: the mount's rotation is then hardly known).
    #[must_use]
    pub fn for_gimbal(mut self, prior: &ChainPrior, joints: usize, encoder_sigma_rad: Option<f64>) -> Self {
        // A uniform error of bound b has standard deviation b/√3; errors of base, links and end add up along the chain.
        let parts = (joints + 2) as f64;
        let rotation = prior.rotation_bound_rad / 3.0_f64.sqrt();
        let translation = prior.translation_bound_m / 3.0_f64.sqrt();
        // Part of the shared error turns with the joints and so differs from frame to frame.
        let wandering = 0.5 * rotation * parts.sqrt();
        self.mount_rotation_sigma_rad = (rotation * parts.sqrt()).max(1e-3);
        self.mount_translation_sigma_m = (translation * parts.sqrt()).max(1e-3);
        if let Some(sigma) = encoder_sigma_rad {
            self.mount_rotation_noise_rad = sigma.hypot(wandering).max(1e-3);
        } else {
            self.mount_rotation_noise_rad = BLIND_MOUNT_NOISE_RAD;
            self.mount_rotation_sigma_rad = BLIND_MOUNT_SIGMA_RAD;
        }
        self
    }

    /// Sets the errors of a rigid mount.
    #[must_use]
    pub fn for_rigid_mount(mut self, rotation_sigma_rad: f64, translation_sigma_m: f64) -> Self {
        self.mount_rotation_sigma_rad = rotation_sigma_rad.max(1e-4);
        self.mount_rotation_noise_rad = 0.0;
        self.mount_translation_sigma_m = translation_sigma_m.max(1e-4);
        self
    }
}
