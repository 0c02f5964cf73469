use crate::sensors::ChainPrior;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StationaryPolicy {
    /// Keep its estimate and wait for motion (most accurate).
    WaitForMotion,
    /// Initialize at once, with zero velocity and without depths.
    InitializeAtOnce,
}

/// Independent rotation error of the extrinsics in each frame, without an encoder.
const BLIND_EXTRINSICS_NOISE_RAD: f64 = 0.5;
/// Common rotation error of the extrinsics, without an encoder.
const BLIND_EXTRINSICS_SIGMA_RAD: f64 = 1.0;

#[derive(Clone, Debug, PartialEq)]
pub struct InitializationOptions {
    /// Standard deviation of a bearing: pixel noise over focal length.
    pub bearing_sigma_rad: f64,
    /// Rotation error of the extrinsics common to all frames (calibration).
    pub extrinsics_rotation_sigma_rad: f64,
    /// Rotation error of the extrinsics, independent in each frame (encoder noise; zero for a rigid camera).
    pub extrinsics_rotation_noise_rad: f64,
    /// Translation error of the extrinsics.
    pub extrinsics_translation_sigma_m: f64,
    /// Turn-on bias of the gyroscope, standard deviation per axis.
    pub gyroscope_bias_sigma_rad_per_s: f64,
    /// Turn-on bias of the accelerometer, standard deviation per axis.
    pub accelerometer_bias_sigma_m_per_s2: f64,
    pub stationary_policy: StationaryPolicy,

    /// Largest age of a frame relative to the newest.
    pub longest_window_s: f64,
    /// Smallest time span of the views.
    pub shortest_window_s: f64,
    pub max_views: usize,
    pub min_views: usize,
    pub min_spacing_s: f64,
    /// Largest time between views without motion.
    pub max_spacing_s: f64,
    /// Rotation-compensated parallax that selects the next view.
    pub spacing_parallax_rad: f64,

    /// Smallest number of common features of neighbouring views and of the reconstruction's initial pair.
    pub min_common_features: usize,
    /// Smallest rotation-compensated parallax of the reconstruction's initial pair.
    pub min_parallax_rad: f64,
    /// Smallest standard deviation of the acceleration between views, gravity included; the scale is unobservable
    /// below.
    pub min_excitation_m_per_s2: f64,
    /// Smallest ratio of inliers to features for a pose.
    pub min_inlier_ratio: f64,
    /// Smallest number of landmarks with a depth.
    pub min_landmarks: usize,
    pub max_landmarks: usize,
    /// Largest root mean square reprojection error, in standard deviations of a bearing.
    pub max_reprojection_sigmas: f64,
    /// Factor on the rig's IMU noise that the residuals may reach before a solution is rejected.
    pub imu_noise_factor: f64,
    /// Largest relative standard deviation of the scale.
    pub max_scale_sigma: f64,
    /// Largest standard deviation of the newest velocity.
    pub max_velocity_sigma_m_per_s: f64,
    /// Largest standard deviation of the direction of gravity.
    pub max_gravity_sigma_rad: f64,
}

impl Default for InitializationOptions {
    fn default() -> Self {
        Self {
            bearing_sigma_rad: 0.0025,
            extrinsics_rotation_sigma_rad: 0.01,
            extrinsics_rotation_noise_rad: 0.0,
            extrinsics_translation_sigma_m: 0.005,
            gyroscope_bias_sigma_rad_per_s: 0.05,
            accelerometer_bias_sigma_m_per_s2: 0.4,
            stationary_policy: StationaryPolicy::WaitForMotion,
            longest_window_s: 3.5,
            shortest_window_s: 0.6,
            max_views: 15,
            min_views: 6,
            min_spacing_s: 0.12,
            max_spacing_s: 0.5,
            spacing_parallax_rad: 0.02,
            min_common_features: 25,
            min_parallax_rad: 0.02,
            min_excitation_m_per_s2: 0.25,
            min_inlier_ratio: 0.6,
            min_landmarks: 25,
            max_landmarks: 200,
            max_reprojection_sigmas: 1.5,
            imu_noise_factor: 1.5,
            max_scale_sigma: 0.05,
            max_velocity_sigma_m_per_s: 0.25,
            max_gravity_sigma_rad: 0.06,
        }
    }
}

/// Parallax that two views need to triangulate, in standard deviations of a bearing. It gives the depth of a landmark
/// to about a fifth (noise of two bearings over the parallax); hundreds of such landmarks suffice for an initial pair.
const PARALLAX_SIGMAS: f64 = 7.0;

impl InitializationOptions {
    /// Sets the options that depend on the camera: noise of a bearing, and parallaxes relative to it.
    ///
    /// Times depend on the motion of the vehicle, not on the frame rate.
    #[must_use]
    pub fn for_camera(mut self, focal_length_px: f64, pixel_sigma_px: f64) -> Self {
        self.bearing_sigma_rad = pixel_sigma_px / focal_length_px;
        self.spacing_parallax_rad = PARALLAX_SIGMAS * self.bearing_sigma_rad;
        self.min_parallax_rad = PARALLAX_SIGMAS * self.bearing_sigma_rad;
        self
    }

    /// Sets the errors of the extrinsics for a gimbal with `joints` joints from the bounds of the chain's uniform
    /// errors and the noise of an encoder reading (`None` without encoders: the rotation is then almost unknown).
    #[must_use]
    pub fn for_gimbal(self, prior: &ChainPrior, joints: usize, encoder_sigma_rad: Option<f64>) -> Self {
        // A uniform error of bound b has standard deviation b/√3; errors of base, links and end accumulate along the
        // chain.
        let parts = (joints + 2) as f64;
        let rotation = prior.rotation_bound_rad / 3.0_f64.sqrt();
        let translation = prior.translation_bound_m / 3.0_f64.sqrt();
        self.for_gimbal_with(rotation * parts.sqrt(), translation * parts.sqrt(), encoder_sigma_rad)
    }

    /// Sets the errors of the extrinsics for a gimbal from the total standard deviations of its chain.
    #[must_use]
    pub(crate) fn for_gimbal_with(
        mut self,
        rotation_sigma_rad: f64,
        translation_sigma_m: f64,
        encoder_sigma_rad: Option<f64>,
    ) -> Self {
        // Part of the common error rotates with the joints and so differs between frames.
        let wandering = 0.5 * rotation_sigma_rad;
        self.extrinsics_rotation_sigma_rad = rotation_sigma_rad.max(1e-3);
        self.extrinsics_translation_sigma_m = translation_sigma_m.max(1e-3);
        if let Some(sigma) = encoder_sigma_rad {
            self.extrinsics_rotation_noise_rad = sigma.hypot(wandering).max(1e-3);
        } else {
            self.extrinsics_rotation_noise_rad = BLIND_EXTRINSICS_NOISE_RAD;
            self.extrinsics_rotation_sigma_rad = BLIND_EXTRINSICS_SIGMA_RAD;
        }
        self
    }

    /// Sets the errors of rigid extrinsics.
    #[must_use]
    pub fn for_rigid_camera(mut self, rotation_sigma_rad: f64, translation_sigma_m: f64) -> Self {
        self.extrinsics_rotation_sigma_rad = rotation_sigma_rad.max(1e-4);
        self.extrinsics_rotation_noise_rad = 0.0;
        self.extrinsics_translation_sigma_m = translation_sigma_m.max(1e-4);
        self
    }
}
