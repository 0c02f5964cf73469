//! Arguments that several sub-commands share, and parsers of their values.

use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Result;
use clap::Args;
use dcvins::export;
use dcvins::files::urdf::CameraAxes;
use dcvins::files::{LimitSetting, LogLimits};
use dcvins::session::FlightPrior;
use dcvins::text::Named as _;

/// Parses a time or a duration in seconds, 0 or more.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite() && *value >= 0.0);
    value.ok_or_else(|| "expected seconds, a number from 0 up".to_owned())
}

/// Parses a number within `range`, in a unit.
pub(crate) fn within(text: &str, range: RangeInclusive<f64>, unit: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| range.contains(value));
    value.ok_or_else(|| format!("expected {unit} from {} to {}", range.start(), range.end()))
}

/// Parses `WIDTHxHEIGHT`, both within `range`, in pixels.
pub(crate) fn sides(text: &str, range: RangeInclusive<usize>) -> Option<[usize; 2]> {
    let parse = |side: &str| side.parse::<usize>().ok().filter(|side| range.contains(side));
    text.split_once('x').and_then(|(width, height)| Some([parse(width)?, parse(height)?]))
}

/// Limits on the content of a file.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct LimitArguments {
    /// Raise or lower a limit on the content of a file: NAME one of record-bytes (a chunk or message in memory),
    /// unpacked-bytes (a compressed file), messages, topics, name-bytes, image-pixels; NUMBER may end in K, M or G.
    #[arg(long = "limit", value_name = "NAME=NUMBER")]
    pub settings: Vec<LimitSetting>,
}

impl LimitArguments {
    /// Default limits, changed by these arguments.
    pub(crate) fn limits(&self) -> LogLimits {
        LogLimits { settings: self.settings.clone() }
    }
}

/// Calibration of earlier flights and the growth of its standard deviations.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct PriorArguments {
    /// Start from the calibration of earlier flights, values and covariance: the folder of a run (OUT/NAME of
    /// 'dcvins run') or of 'dcvins calibrate'.
    #[arg(long, value_name = "DIR")]
    pub prior: Option<PathBuf>,
    /// Factor on the standard deviations of an earlier flight when another one starts from them: 1 if nothing was changed
    /// in between, 2 to 5 after work on the mechanism.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = growth)]
    pub prior_growth: f64,
}

fn growth(text: &str) -> Result<f64, String> {
    within(text, 1.0..=1000.0, "a factor")
}

impl PriorArguments {
    /// Reads the calibration, `None` without one.
    pub(crate) fn read(&self) -> Result<Option<Arc<FlightPrior>>> {
        let read = |folder: &PathBuf| export::read_prior(folder, self.prior_growth);
        Ok(self.prior.as_ref().map(read).transpose()?.map(Arc::new))
    }
}

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
