use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::ImuSample;
use crate::geometry::so3;

/// Scale and misalignment of gyroscope and accelerometer: `true = C · measured - bias`, with the identity for a
/// calibrated IMU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuIntrinsics {
    /// `C_g`, maps measured angular velocities to those in the IMU frame (3 × 3).
    pub gyroscope_correction: Matrix3<f64>,
    /// `C_a`, maps measured specific forces to those in the IMU frame (3 × 3).
    pub accelerometer_correction: Matrix3<f64>,
}

impl Default for ImuIntrinsics {
    fn default() -> Self {
        Self { gyroscope_correction: Matrix3::identity(), accelerometer_correction: Matrix3::identity() }
    }
}

/// Scale and misalignment of one sensor: `U = I + [[sx, mxy, mxz], [0, sy, myz], [0, 0, sz]]`, without units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ScaleMisalignment {
    /// Relative errors `sx`, `sy`, `sz` of the scales.
    pub scale: Vector3<f64>,
    /// Small angles `mxy`, `mxz`, `myz` between the axes, in radians.
    pub misalignment: Vector3<f64>,
}

/// Independent parameters (15) of [`ImuIntrinsics`]: `C_a = U_a` and `C_g = Exp(r) · U_g`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImuIntrinsicsParameters {
    /// Matrix `U_g` of the gyroscope.
    pub gyroscope: ScaleMisalignment,
    /// `r`, rotation vector in radians from the gyroscope's axes to the IMU frame.
    pub gyroscope_rotation_rad: Vector3<f64>,
    /// Matrix `U_a` of the accelerometer.
    pub accelerometer: ScaleMisalignment,
}

/// Matrices of Kalibr's IMU file: `measured = M · C_gyro_i · true + bias`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KalibrImuMatrices {
    /// `gyroscopes.M` (3 × 3).
    pub gyroscope_m: Matrix3<f64>,
    /// `gyroscopes.C_gyro_i`, a rotation from the IMU frame to the gyroscope's axes (3 × 3).
    pub gyroscope_from_imu: Matrix3<f64>,
    /// `accelerometers.M` (3 × 3).
    pub accelerometer_m: Matrix3<f64>,
}

impl ScaleMisalignment {
    /// `U` (3 × 3), upper triangular.
    pub fn matrix(&self) -> Matrix3<f64> {
        let (s, m) = (self.scale, self.misalignment);
        Matrix3::identity() + Matrix3::new(s.x, m.x, m.y, 0.0, s.y, m.z, 0.0, 0.0, s.z)
    }

    /// Inverse of [`Self::matrix`]; entries below the diagonal are ignored.
    fn of_matrix(upper: &Matrix3<f64>) -> Self {
        let u = upper - Matrix3::identity();
        Self { scale: u.diagonal(), misalignment: Vector3::new(u[(0, 1)], u[(0, 2)], u[(1, 2)]) }
    }
}

impl ImuIntrinsics {
    /// True if neither sensor is corrected.
    pub fn is_identity(&self) -> bool {
        *self == Self::default()
    }

    /// Corrected sample, `C · measured` of both sensors; the same bits for the identity.
    pub fn correct(&self, sample: &ImuSample) -> ImuSample {
        ImuSample {
            stamp_ns: sample.stamp_ns,
            angular_velocity_rad_per_s: self.correct_angular_velocity(&sample.angular_velocity_rad_per_s),
            specific_force_m_per_s2: self.correct_specific_force(&sample.specific_force_m_per_s2),
            unmeasured_s: sample.unmeasured_s,
        }
    }

    /// `C_a · measured`, in m/s²; the same bits for the identity.
    pub fn correct_specific_force(&self, measured_m_per_s2: &Vector3<f64>) -> Vector3<f64> {
        if self.accelerometer_correction == Matrix3::identity() {
            return *measured_m_per_s2;
        }
        self.accelerometer_correction * measured_m_per_s2
    }

    /// `C_g · measured`, in rad/s; the same bits for the identity.
    pub fn correct_angular_velocity(&self, measured_rad_per_s: &Vector3<f64>) -> Vector3<f64> {
        if self.gyroscope_correction == Matrix3::identity() {
            return *measured_rad_per_s;
        }
        self.gyroscope_correction * measured_rad_per_s
    }

    /// Intrinsics of raw samples, if `self` belongs to samples that `first` has corrected.
    pub fn after(&self, first: &Self) -> Self {
        Self {
            gyroscope_correction: self.gyroscope_correction * first.gyroscope_correction,
            accelerometer_correction: self.accelerometer_correction * first.accelerometer_correction,
        }
    }

    /// Remaining correction of `self` for samples that `first` has corrected: `self = left.after(first)`. `None` if a
    /// matrix of `first` is singular.
    pub fn left_after(&self, first: &Self) -> Option<Self> {
        Some(Self {
            gyroscope_correction: self.gyroscope_correction * first.gyroscope_correction.try_inverse()?,
            accelerometer_correction: self.accelerometer_correction * first.accelerometer_correction.try_inverse()?,
        })
    }

    /// Returns the correction in the IMU frame of `given`, since [`Self::parameters`] may rotate it: the correction
    /// that remains after `given` then has an upper triangular matrix of the accelerometer. `None` if a matrix of
    /// `given` is singular.
    pub fn in_frame_of(&self, given: &Self) -> Option<Self> {
        let left = self.left_after(given)?;
        let (own_from_given, _) = rotation_and_upper(&left.accelerometer_correction);
        let given_from_own = own_from_given.transpose();
        Some(Self {
            gyroscope_correction: given_from_own * self.gyroscope_correction,
            accelerometer_correction: given_from_own * self.accelerometer_correction,
        })
    }

    /// Returns the correction in the frame in which the accelerometer's matrix is lower triangular, which is Kalibr's
    /// IMU frame, after the rotation `triangle_from_imu`; the identity, and the same bits, if it is lower triangular
    /// already. The matrix must have a positive determinant.
    pub fn in_lower_triangular_frame(&self) -> (UnitQuaternion<f64>, Self) {
        let c = &self.accelerometer_correction;
        let is_lower = [(0, 1), (0, 2), (1, 2)].iter().all(|entry| c[*entry] == 0.0);
        let Some(inverse) = c.try_inverse().filter(|_| !is_lower) else { return (UnitQuaternion::identity(), *self) };
        // `C = Qᵀ · L` from `C⁻ᵀ = Qᵀ · L⁻ᵀ`, whose second factor is upper triangular.
        let (imu_from_triangle, _) = rotation_and_upper(&inverse.transpose());
        let triangle_from_imu = imu_from_triangle.transpose();
        let mut lower = triangle_from_imu * c;
        for entry in [(0, 1), (0, 2), (1, 2)] {
            lower[entry] = 0.0;
        }
        let rotated = Self {
            gyroscope_correction: triangle_from_imu * self.gyroscope_correction,
            accelerometer_correction: lower,
        };
        (UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(triangle_from_imu)), rotated)
    }

    pub fn from_parameters(parameters: &ImuIntrinsicsParameters) -> Self {
        let rotation = so3::exp(&parameters.gyroscope_rotation_rad).to_rotation_matrix().into_inner();
        Self {
            gyroscope_correction: rotation * parameters.gyroscope.matrix(),
            accelerometer_correction: parameters.accelerometer.matrix(),
        }
    }

    /// Independent parameters, in the IMU frame in which the accelerometer's matrix is upper triangular: for
    /// `C_a = Q · U`, that frame is rotated by `Q`. Both matrices must have a positive determinant.
    pub fn parameters(&self) -> ImuIntrinsicsParameters {
        let (imu_from_triangle, accelerometer) = rotation_and_upper(&self.accelerometer_correction);
        let (rotation, gyroscope) = rotation_and_upper(&(imu_from_triangle.transpose() * self.gyroscope_correction));
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
        ImuIntrinsicsParameters {
            gyroscope: ScaleMisalignment::of_matrix(&gyroscope),
            gyroscope_rotation_rad: so3::log(&rotation),
            accelerometer: ScaleMisalignment::of_matrix(&accelerometer),
        }
    }

    /// Creates intrinsics from the matrices of Kalibr's file; `None` if one of them is singular.
    pub fn from_kalibr(kalibr: &KalibrImuMatrices) -> Option<Self> {
        Some(Self {
            gyroscope_correction: (kalibr.gyroscope_m * kalibr.gyroscope_from_imu).try_inverse()?,
            accelerometer_correction: kalibr.accelerometer_m.try_inverse()?,
        })
    }

    /// Matrices of Kalibr's file, with the gyroscope's `M` lower triangular as in Kalibr; `None` if a correction is
    /// singular.
    pub fn to_kalibr(self) -> Option<KalibrImuMatrices> {
        let measured_from_true = self.gyroscope_correction.try_inverse()?;
        // `A = L · Q` from the transpose, `Aᵀ = Qᵀ · Lᵀ`.
        let (rotation, upper) = rotation_and_upper(&measured_from_true.transpose());
        Some(KalibrImuMatrices {
            gyroscope_m: upper.transpose(),
            gyroscope_from_imu: rotation.transpose(),
            accelerometer_m: self.accelerometer_correction.try_inverse()?,
        })
    }
}

/// Decomposes `A = Q · U` (each 3 × 3) into a rotation and an upper triangular matrix of positive diagonal, by
/// Gram–Schmidt on the columns; exact for an upper triangular matrix with a positive diagonal.
fn rotation_and_upper(matrix: &Matrix3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    let (mut q, mut u) = (Matrix3::zeros(), Matrix3::zeros());
    for column in 0..3 {
        let mut rest: Vector3<f64> = matrix.column(column).into_owned();
        for before in 0..column {
            let axis: Vector3<f64> = q.column(before).into_owned();
            let along = axis.dot(&rest);
            u[(before, column)] = along;
            rest -= axis * along;
        }
        let length = rest.norm();
        u[(column, column)] = length;
        q.set_column(column, &(rest / length));
    }
    (q, u)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some() -> ImuIntrinsicsParameters {
        ImuIntrinsicsParameters {
            gyroscope: ScaleMisalignment {
                scale: Vector3::new(0.01, -0.02, 0.004),
                misalignment: Vector3::new(0.003, -0.001, 0.012),
            },
            gyroscope_rotation_rad: Vector3::new(0.02, -0.05, 0.01),
            accelerometer: ScaleMisalignment {
                scale: Vector3::new(-0.006, 0.001, 0.015),
                misalignment: Vector3::new(0.008, 0.002, -0.004),
            },
        }
    }

    fn check_near(found: &ImuIntrinsics, expected: &ImuIntrinsics) {
        let differences = [
            found.gyroscope_correction - expected.gyroscope_correction,
            found.accelerometer_correction - expected.accelerometer_correction,
        ];
        assert!(differences.iter().all(|difference| difference.amax() < 1e-14), "{found:?}\n{expected:?}");
    }

    #[test]
    fn parameters_and_kalibrs_matrices_lead_back_to_the_corrections() {
        let intrinsics = ImuIntrinsics::from_parameters(&some());
        check_near(&ImuIntrinsics::from_parameters(&intrinsics.parameters()), &intrinsics);
        let found = intrinsics.parameters();
        assert!((found.gyroscope_rotation_rad - some().gyroscope_rotation_rad).norm() < 1e-15);
        assert!((found.gyroscope.misalignment - some().gyroscope.misalignment).norm() < 1e-15);
        assert!((found.accelerometer.matrix() - some().accelerometer.matrix()).amax() < 1e-15);
        let kalibr = intrinsics.to_kalibr().unwrap();
        check_near(&ImuIntrinsics::from_kalibr(&kalibr).unwrap(), &intrinsics);
        // Kalibr's structure: M lower triangular, C_gyro_i a rotation.
        assert_eq!([(0, 1), (0, 2), (1, 2)].map(|entry| kalibr.gyroscope_m[entry]), [0.0; 3]);
        let rotation = kalibr.gyroscope_from_imu;
        assert!((rotation.transpose() * rotation - Matrix3::identity()).amax() < 1e-14 && rotation.determinant() > 0.0);
        // measured = M · C_gyro_i · true
        let actual = Vector3::new(0.3, -0.7, 1.1);
        let measured = kalibr.gyroscope_m * kalibr.gyroscope_from_imu * actual;
        assert!((intrinsics.correct_angular_velocity(&measured) - actual).norm() < 1e-14);
        assert!(measured.metric_distance(&actual) > 0.01);
    }

    #[test]
    fn the_identity_changes_no_bit_and_corrections_chain() {
        let sample = ImuSample {
            stamp_ns: 7,
            angular_velocity_rad_per_s: Vector3::new(0.1, -0.0, 1e-300),
            specific_force_m_per_s2: Vector3::new(1.0 / 3.0, 9.81, -0.0),
            unmeasured_s: 0.0,
        };
        let bits = |v: &Vector3<f64>| v.map(f64::to_bits);
        let corrected = ImuIntrinsics::default().correct(&sample);
        assert_eq!(bits(&corrected.angular_velocity_rad_per_s), bits(&sample.angular_velocity_rad_per_s));
        assert_eq!(bits(&corrected.specific_force_m_per_s2), bits(&sample.specific_force_m_per_s2));
        let whole = ImuIntrinsics::from_parameters(&some());
        let first = ImuIntrinsics { gyroscope_correction: Matrix3::identity(), ..whole };
        let left = whole.left_after(&first).unwrap();
        check_near(&left, &ImuIntrinsics { accelerometer_correction: Matrix3::identity(), ..whole });
        check_near(&left.after(&first), &whole);
    }

    #[test]
    fn kalibrs_frame_has_a_lower_triangular_accelerometer() {
        let intrinsics = ImuIntrinsics::from_parameters(&some());
        let (triangle_from_imu, rotated) = intrinsics.in_lower_triangular_frame();
        let rotation = triangle_from_imu.to_rotation_matrix().into_inner();
        check_near(
            &rotated,
            &ImuIntrinsics {
                gyroscope_correction: rotation * intrinsics.gyroscope_correction,
                accelerometer_correction: rotation * intrinsics.accelerometer_correction,
            },
        );
        assert_eq!([(0, 1), (0, 2), (1, 2)].map(|entry| rotated.accelerometer_correction[entry]), [0.0; 3]);
        assert!(triangle_from_imu.angle() > 0.005);
        // Kalibr's M is lower triangular as well, and no rotation remains.
        let kalibr = rotated.to_kalibr().unwrap();
        assert!([(0, 1), (0, 2), (1, 2)].iter().all(|entry| kalibr.accelerometer_m[*entry].abs() < 1e-16));
        assert_eq!(rotated.in_lower_triangular_frame(), (UnitQuaternion::identity(), rotated));
    }

    #[test]
    fn a_lower_triangular_accelerometer_rotates_the_frame() {
        let kalibr = KalibrImuMatrices {
            gyroscope_m: Matrix3::identity(),
            gyroscope_from_imu: Matrix3::identity(),
            accelerometer_m: Matrix3::new(1.01, 0.0, 0.0, 0.02, 0.99, 0.0, -0.01, 0.005, 1.0),
        };
        let intrinsics = ImuIntrinsics::from_kalibr(&kalibr).unwrap();
        let again = ImuIntrinsics::from_parameters(&intrinsics.parameters());
        // Both matrices differ by one rotation on the left.
        let rotation = again.accelerometer_correction * intrinsics.accelerometer_correction.try_inverse().unwrap();
        assert!((rotation.transpose() * rotation - Matrix3::identity()).amax() < 1e-14);
        assert!((rotation - Matrix3::identity()).amax() > 0.01);
        assert!((rotation * intrinsics.gyroscope_correction - again.gyroscope_correction).amax() < 1e-14);
        // A calibration of corrected samples is transformed back to the frame of the given intrinsics.
        let whole = ImuIntrinsics::from_parameters(&some()).after(&intrinsics);
        let rotated = ImuIntrinsics::from_parameters(&whole.parameters());
        assert!((rotated.accelerometer_correction - whole.accelerometer_correction).amax() > 0.01);
        check_near(&rotated.in_frame_of(&intrinsics).unwrap(), &whole);
    }
}
