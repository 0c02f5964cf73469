//! Values of the sensor columns: times, intrinsics of the camera, corrections of the IMU.

use nalgebra::{Matrix3, Matrix3xX, Rotation3, Vector3};

use crate::camera::CameraModel;
use crate::geometry::so3;

/// Columns of the gyroscope: scale and misalignment, then rotation.
pub(super) const GYROSCOPE_COLUMNS: usize = 9;
/// Columns of the accelerometer: scale and misalignment.
pub(super) const ACCELEROMETER_COLUMNS: usize = 6;
/// Index of the first column of the camera's intrinsics.
pub(super) const INTRINSICS: usize = 3;
/// Index of the first column of the gyroscope.
pub(super) const GYROSCOPE: usize = 9;
/// Index of the first column of the accelerometer.
pub(super) const ACCELEROMETER: usize = GYROSCOPE + GYROSCOPE_COLUMNS;

/// Row and column of `sx sy sz mxy mxz myz` (scale and misalignment) in an upper triangular matrix.
const TRIANGLE: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// Times and intrinsics of the sensors of one camera and one IMU.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SensorValues {
    /// `t_imu = t_camera + timeshift`, relative to the nominal times of the frames.
    pub(super) timeshift_s: f64,
    /// Time from the first to one past the last image row.
    pub(super) readout_s: f64,
    /// `t_imu = t_encoder + timeshift`.
    pub(super) encoder_timeshift_s: f64,
    pub(super) camera: CameraModel,
    /// `sx sy sz mxy mxz myz rx ry rz`.
    pub(super) gyroscope: [f64; GYROSCOPE_COLUMNS],
    /// `sx sy sz mxy mxz myz`.
    pub(super) accelerometer: [f64; ACCELEROMETER_COLUMNS],
}

impl SensorValues {
    /// Corrected angular rate `R·U·ω`, and its derivative by the nine columns.
    pub(super) fn correct_rate(&self, measured: &Vector3<f64>) -> (Vector3<f64>, Matrix3xX<f64>) {
        let [sx, sy, sz, mxy, mxz, myz, rx, ry, rz] = self.gyroscope;
        let rotation_vector = Vector3::new(rx, ry, rz);
        let rotation: Rotation3<f64> = so3::exp(&rotation_vector).to_rotation_matrix();
        let triangle = triangular(&[sx, sy, sz, mxy, mxz, myz]);
        let stretched = triangle * measured;
        let corrected = rotation * stretched;
        let mut by_columns = Matrix3xX::zeros(GYROSCOPE_COLUMNS);
        let by_triangle = rotation.matrix() * by_triangle(measured);
        by_columns.columns_mut(0, 6).copy_from(&by_triangle);
        // Exp(r + δ) w ≈ Exp(r)·(w − [w]^·J_r·δ).
        let by_rotation = -(rotation.matrix() * so3::hat(&stretched) * so3::right_jacobian(&rotation_vector));
        by_columns.columns_mut(6, 3).copy_from(&by_rotation);
        (corrected, by_columns)
    }

    /// Corrected specific force `U·f`, and its derivative by the six columns.
    pub(super) fn correct_force(&self, measured: &Vector3<f64>) -> (Vector3<f64>, Matrix3xX<f64>) {
        (triangular(&self.accelerometer) * measured, by_triangle(measured))
    }

    /// Measured angular rate and specific force from the true ones, without bias.
    pub(super) fn measure(&self, rate: &Vector3<f64>, force: &Vector3<f64>) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let [sx, sy, sz, mxy, mxz, myz, rx, ry, rz] = self.gyroscope;
        let rotation = so3::exp(&Vector3::new(rx, ry, rz));
        let gyroscope = triangular(&[sx, sy, sz, mxy, mxz, myz]).try_inverse()?;
        let accelerometer = triangular(&self.accelerometer).try_inverse()?;
        Some((gyroscope * (rotation.inverse() * rate), accelerometer * force))
    }
}

/// `I + [[sx, mxy, mxz], [0, sy, myz], [0, 0, sz]]`.
fn triangular(values: &[f64; 6]) -> Matrix3<f64> {
    let mut matrix = Matrix3::identity();
    for (place, value) in TRIANGLE.into_iter().zip(values) {
        matrix[place] += value;
    }
    matrix
}

/// Derivative of `U·w` by the six parameters of U.
fn by_triangle(vector: &Vector3<f64>) -> Matrix3xX<f64> {
    let mut derivative = Matrix3xX::zeros(TRIANGLE.len());
    for (column, (row, factor)) in TRIANGLE.into_iter().enumerate() {
        derivative[(row, column)] = vector[factor];
    }
    derivative
}
