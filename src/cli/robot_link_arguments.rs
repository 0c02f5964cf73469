//! Links of a robot description between which the chain of a gimbal lies.

use clap::Args;
use dcvins::flight_log::urdf::CameraAxes;
use dcvins::text::Named as _;

/// Links of a robot description that bound the chain, with the axes of the camera's link.
#[derive(Args, Clone, Debug)]
pub(crate) struct RobotLinkArguments {
    /// Link of the robot description that has the frame of the IMU.
    #[arg(long, value_name = "LINK", requires = "urdf")]
    pub imu_link: Option<String>,
    /// Link of the robot description that has the frame of the camera.
    #[arg(long, value_name = "LINK", requires = "urdf")]
    pub camera_link: Option<String>,
    /// Axes of that link: optical (x right, y down, z forward) or flu (x forward, y left, z up) [default: optical if its name
    /// contains "optical", else flu].
    #[arg(long, value_name = "optical|flu", value_parser = camera_axes, requires = "urdf")]
    pub camera_axes: Option<CameraAxes>,
}

impl RobotLinkArguments {
    /// Links of IMU and camera with the axes of the latter; `None` unless both are given.
    pub(crate) fn given(&self) -> Option<(&str, &str, CameraAxes)> {
        let (imu, camera) = (self.imu_link.as_deref()?, self.camera_link.as_deref()?);
        Some((imu, camera, self.camera_axes.unwrap_or_else(|| CameraAxes::of_link(camera))))
    }
}

fn camera_axes(text: &str) -> Result<CameraAxes, String> {
    CameraAxes::from_name(text).ok_or_else(|| format!("expected {}", CameraAxes::alternatives()))
}
