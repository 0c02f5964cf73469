//! States changed by one number per column.

use nalgebra::{DMatrix, Vector3, Vector6};

use super::super::columns::all_parameters;
use super::super::rows::stacked;
use super::super::state::{Columns, SensorState};
use super::super::values::{ACCELEROMETER, GYROSCOPE, INTRINSICS, SensorValues};
use super::super::window::SensorWindow;
use crate::camera::CameraError;

impl SensorValues {
    /// Values changed by one number per sensor column.
    pub(super) fn plus(&self, delta: &[f64]) -> Result<Self, CameraError> {
        let mut intrinsics = self.camera.intrinsics();
        for (value, change) in intrinsics.iter_mut().zip(&delta[INTRINSICS..]) {
            *value += change;
        }
        let mut moved = Self {
            timeshift_s: self.timeshift_s + delta[0],
            readout_s: self.readout_s + delta[1],
            encoder_timeshift_s: self.encoder_timeshift_s + delta[2],
            camera: self.camera.with_intrinsics(intrinsics)?,
            ..self.clone()
        };
        for (value, change) in moved.gyroscope.iter_mut().zip(&delta[GYROSCOPE..]) {
            *value += change;
        }
        for (value, change) in moved.accelerometer.iter_mut().zip(&delta[ACCELEROMETER..]) {
            *value += change;
        }
        Ok(moved)
    }
}

impl SensorState {
    /// State changed by one number per column.
    pub(super) fn plus(&self, columns: &Columns, delta: &[f64]) -> Result<Self, CameraError> {
        let mut by_sensor = vec![0.0; all_parameters().len()];
        for (change, (place, _)) in delta[columns.chain..].iter().zip(&columns.sensors) {
            by_sensor[*place] = *change;
        }
        let mut moved = Self {
            chain: self.chain.plus_slice(&delta[..columns.chain]),
            sensors: self.sensors.plus(&by_sensor)?,
            ..self.clone()
        };
        for (index, frame) in moved.frames.iter_mut().enumerate() {
            let joints = &delta[columns.joints_at(index)..][..columns.joints];
            let angles_and_rates = frame.joints_rad.iter_mut().chain(&mut frame.joint_rates_rad_per_s);
            for (value, change) in angles_and_rates.zip(joints) {
                *value += change;
            }
            let navigation = &mut frame.navigation;
            if columns.pose > 0 {
                let pose = Vector6::from_column_slice(&delta[columns.pose_at(index)..][..6]);
                navigation.world_from_imu = navigation.world_from_imu.plus(&pose);
            }
            let velocity_bias = &delta[columns.velocity_bias_at(index)..][..columns.velocity_bias];
            let bias = &mut navigation.bias;
            let parts =
                [&mut navigation.velocity_m_per_s, &mut bias.gyroscope_rad_per_s, &mut bias.accelerometer_m_per_s2];
            for (part, change) in parts.into_iter().zip(velocity_bias.chunks_exact(3)) {
                *part += Vector3::from_column_slice(change);
            }
        }
        Ok(moved)
    }
}

impl SensorWindow<'_> {
    /// Residuals (first column) with the Jacobian, the landmarks projected out; `None` under the condition of
    /// [`SensorWindow::rows`].
    pub(super) fn reduced(&self, state: &SensorState) -> Option<DMatrix<f64>> {
        Some(stacked(&self.rows(state)?))
    }
}
