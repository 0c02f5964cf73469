use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector6};

/// Covariance (6 × 6) of a pose `world_from_imu`.
///
/// The world has the origin and the axes of the first frame after the initialization, where the variances of position
/// and yaw are nearly zero; they grow from there. Calibration, velocities, biases, joint angles and landmarks are
/// marginalized.
///
/// Rows and columns: rotation vector in the IMU frame (`R exp(δφ)`, rad), then position in the world (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseCovariance(pub Matrix6<f64>);

impl PoseCovariance {
    /// Root of the sum of the variances of the three position coordinates, in metres.
    pub fn position_sigma_m(&self) -> f64 {
        self.position_m2().trace().sqrt()
    }

    /// Root of the sum of the variances of the three rotation components, in radians.
    pub fn attitude_sigma_rad(&self) -> f64 {
        self.0.fixed_view::<3, 3>(0, 0).trace().sqrt()
    }

    /// Root of the sum of the variances of the rotations about the two horizontal axes of the world, in radians;
    /// `world_from_imu` is the rotation of the pose.
    pub fn tilt_sigma_rad(&self, world_from_imu: &UnitQuaternion<f64>) -> f64 {
        let in_world = self.in_world(world_from_imu);
        (in_world[(3, 3)] + in_world[(4, 4)]).sqrt()
    }

    /// Covariance of the position in the world (3 × 3), in m².
    pub fn position_m2(&self) -> Matrix3<f64> {
        self.0.fixed_view::<3, 3>(3, 3).into_owned()
    }

    /// Covariance (6 × 6) as in ROS messages: position first, rotations about the axes of the world; `world_from_imu`
    /// is the rotation of the pose.
    pub fn in_world(&self, world_from_imu: &UnitQuaternion<f64>) -> Matrix6<f64> {
        let rotation = world_from_imu.to_rotation_matrix();
        let mut change = Matrix6::zeros();
        change.fixed_view_mut::<3, 3>(0, 3).copy_from(&Matrix3::identity());
        change.fixed_view_mut::<3, 3>(3, 0).copy_from(rotation.matrix());
        let turned = change * self.0 * change.transpose();
        0.5 * (turned + turned.transpose())
    }

    /// Normalized estimation error squared (NEES) of an error with the same rows; 6 on average for a consistent
    /// estimator.
    /// `None` when the covariance is not positive definite.
    pub fn nees(&self, error: &Vector6<f64>) -> Option<f64> {
        Some(error.dot(&self.0.cholesky()?.solve(error)))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn axes_of_the_world_and_of_the_imu_are_told_apart() {
        // Rotations about the x axis of the IMU are uncertain; after a yaw of 90° that is the y axis of the world.
        let covariance = PoseCovariance(Matrix6::from_diagonal(&Vector6::new(0.04, 1e-4, 1e-4, 1.0, 4.0, 4.0)));
        let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), FRAC_PI_2);
        let found = covariance.in_world(&yaw);
        let expected = Matrix6::from_diagonal(&Vector6::new(1.0, 4.0, 4.0, 1e-4, 0.04, 1e-4));
        assert!((found - expected).norm() < 1e-12, "{found}");
        assert!((covariance.position_sigma_m() - 3.0).abs() < 1e-12);
        assert!((covariance.tilt_sigma_rad(&yaw) - 0.0401_f64.sqrt()).abs() < 1e-12);
        assert!((covariance.attitude_sigma_rad() - 0.0402_f64.sqrt()).abs() < 1e-12);
        let error = Vector6::new(0.2, 0.0, 0.0, 1.0, 0.0, 0.0);
        assert!((covariance.nees(&error).unwrap() - 2.0).abs() < 1e-12);
    }
}
