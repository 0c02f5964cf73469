use nalgebra::{UnitQuaternion, Vector3};

use crate::flight_log::ImuSample;
use crate::geometry::{seconds_from_ns, so3};

/// How a camera turned between two images, `camera_now_from_camera_previous`, from the gyroscope and from how the camera
/// sat on the IMU at either image.
///
/// `imu` goes from the previous image's stamp to this one's (see [`SensorFrame::imu`](crate::flight_log::SensorFrame)); the
/// angular velocity is taken as linear between its samples.
/// `gyroscope_bias_rad_per_s` is taken off; zero where it is not known.
/// Returns `None` with fewer than two samples, when time does not run forwards, or when a number is not finite.
pub fn predict_camera_rotation(
    imu: &[ImuSample],
    gyroscope_bias_rad_per_s: &Vector3<f64>,
    imu_from_camera_previous: &UnitQuaternion<f64>,
    imu_from_camera_now: &UnitQuaternion<f64>,
) -> Option<UnitQuaternion<f64>> {
    if imu.len() < 2 {
        return None;
    }
    let mut imu_previous_from_imu_now = UnitQuaternion::identity();
    for pair in imu.windows(2) {
        let duration_s = seconds_from_ns(pair[1].stamp_ns - pair[0].stamp_ns);
        let mean = 0.5 * (pair[0].angular_velocity_rad_per_s + pair[1].angular_velocity_rad_per_s);
        let angle = (mean - gyroscope_bias_rad_per_s) * duration_s;
        if duration_s < 0.0 || !angle.iter().all(|value| value.is_finite()) {
            return None;
        }
        imu_previous_from_imu_now *= so3::exp(&angle);
    }
    let rotation = imu_from_camera_now.inverse() * imu_previous_from_imu_now.inverse() * imu_from_camera_previous;
    rotation.coords.iter().all(|value| value.is_finite()).then_some(rotation)
}
