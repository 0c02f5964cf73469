//! Noise of an IMU as files: the Allan deviation as a table and as a figure, and lines for a rig.

use std::path::{Path, PathBuf};

use super::error::ExportError;
use super::flight_noise::FlightNoiseReport;
#[cfg(feature = "gui")]
use super::folder_files::figure_files;
use super::folder_files::write_files;
use crate::log_check::{AllanPoint, AllanReport};
use crate::table::{Column, csv};

const TABLE: &str = "allan.csv";
const RIG_LINES: &str = "imu0.yaml";
const REPORT: &str = "noise.json";
#[cfg(feature = "gui")]
const PNG: &str = "allan.png";
#[cfg(feature = "gui")]
const SVG: &str = "allan.svg";

/// Points of all axes, one row each.
fn table(report: &AllanReport) -> String {
    type PointColumn<'a> = Column<'a, (&'static str, &'static str, &'a AllanPoint)>;
    let columns = [
        PointColumn::new("sensor", |(sensor, ..)| *sensor),
        PointColumn::new("axis", |(_, axis, _)| *axis),
        PointColumn::new("tau_s", |(.., point)| point.tau_s),
        PointColumn::new("deviation", |(.., point)| point.deviation),
        PointColumn::new("sigma", |(.., point)| point.sigma),
        PointColumn::new("low", |(.., point)| point.low),
        PointColumn::new("high", |(.., point)| point.high),
        PointColumn::new("fitted", |(.., point)| point.model),
        PointColumn::new("vibration", |(.., point)| usize::from(point.vibration)),
    ];
    let axes = report.sensors.iter().flat_map(|sensor| sensor.axes.iter().map(move |axis| (sensor.sensor, axis)));
    csv(&columns, axes.flat_map(|(sensor, axis)| axis.points.iter().map(move |point| (sensor, axis.axis, point))))
}

/// Writes `allan.csv`, `imu0.yaml` and `noise.json` into a folder, in a build with the window also `allan.png` and
/// `allan.svg`; returns their paths.
///
/// # Errors
/// If the folder or a file cannot be written.
pub fn write_allan(report: &AllanReport, json: &str, folder: &Path) -> Result<Vec<PathBuf>, ExportError> {
    let files = vec![
        (TABLE, table(report).into_bytes()),
        (RIG_LINES, report.rig_lines().into_bytes()),
        (REPORT, json.as_bytes().to_vec()),
    ];
    #[cfg(feature = "gui")]
    let files = files.into_iter().chain(figures(report));
    write_files(files, folder)
}

/// Writes `imu0.yaml` and `noise.json` of a flight into a folder; returns their paths.
///
/// # Errors
/// As [`write_allan`].
pub fn write_flight_noise(report: &FlightNoiseReport, json: &str, folder: &Path) -> Result<Vec<PathBuf>, ExportError> {
    write_files(vec![(RIG_LINES, report.rig_lines().into_bytes()), (REPORT, json.as_bytes().to_vec())], folder)
}

#[cfg(feature = "gui")]
fn figures(report: &AllanReport) -> Vec<(&'static str, Vec<u8>)> {
    figure_files([PNG, SVG], [1920, 1040], ["allan", "Allan deviation"], |ui, theme| {
        crate::gui::figures::allan_ui(ui, theme, report);
    })
}
