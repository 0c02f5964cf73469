//! The noise of an IMU as files: the Allan deviation as a table and as a figure, and the lines for a rig.

use std::fs;
use std::path::{Path, PathBuf};

use super::error::ExportError;
use super::flight_noise::FlightNoiseReport;
use crate::flight_log::csv_writer::{CsvWriter, number_cell};
use crate::flight_log::output::OutputSet;
use crate::log_check::AllanReport;

/// Names of the files.
const TABLE: &str = "allan.csv";
const RIG_LINES: &str = "imu0.yaml";
const REPORT: &str = "noise.json";
#[cfg(feature = "gui")]
const PNG: &str = "allan.png";
#[cfg(feature = "gui")]
const SVG: &str = "allan.svg";

/// The points of all axes, one row each.
fn table(report: &AllanReport) -> String {
    let mut table =
        CsvWriter::new(["sensor", "axis", "tau_s", "deviation", "sigma", "low", "high", "fitted", "vibration"]);
    for sensor in &report.sensors {
        for axis in &sensor.axes {
            for point in &axis.points {
                let numbers = [point.tau_s, point.deviation, point.sigma, point.low, point.high];
                let mut row = vec![sensor.sensor.to_owned(), axis.axis.to_owned()];
                row.extend(numbers.map(number_cell));
                row.push(point.model.map_or_else(String::new, number_cell));
                row.push(u8::from(point.vibration).to_string());
                table.row(row);
            }
        }
    }
    table.into_text()
}

/// Writes `allan.csv`, `imu0.yaml` and `noise.json` into a folder, with the window's drawing also `allan.png` and
/// `allan.svg`; returns their paths.
///
/// # Errors
/// When the folder or a file cannot be written.
pub fn write_allan(report: &AllanReport, json: &str, folder: &Path) -> Result<Vec<PathBuf>, ExportError> {
    let files = vec![
        (TABLE, table(report).into_bytes()),
        (RIG_LINES, report.rig_lines().into_bytes()),
        (REPORT, json.as_bytes().to_vec()),
    ];
    #[cfg(feature = "gui")]
    let files = files.into_iter().chain(figures(report)).collect();
    write_files(files, folder)
}

/// Writes `imu0.yaml` and `noise.json` of a flight into a folder; returns their paths.
///
/// # Errors
/// As [`write_allan`].
pub fn write_flight_noise(report: &FlightNoiseReport, json: &str, folder: &Path) -> Result<Vec<PathBuf>, ExportError> {
    write_files(vec![(RIG_LINES, report.rig_lines().into_bytes()), (REPORT, json.as_bytes().to_vec())], folder)
}

fn write_files(files: Vec<(&str, Vec<u8>)>, folder: &Path) -> Result<Vec<PathBuf>, ExportError> {
    fs::create_dir_all(folder).map_err(ExportError::write(folder))?;
    let mut outputs = OutputSet::default();
    let mut paths = Vec::new();
    for (name, content) in files {
        let path = folder.join(name);
        outputs.write(&path, &content).map_err(ExportError::write(&path))?;
        paths.push(path);
    }
    outputs.commit().map_err(ExportError::commit)?;
    Ok(paths)
}

/// The figure, as pixels of the CPU painter and as a drawing.
#[cfg(feature = "gui")]
fn figures(report: &AllanReport) -> Vec<(&'static str, Vec<u8>)> {
    use crate::gui::allan::allan_ui;
    use crate::gui::rendering::headless::{self, HeadlessOptions};
    use crate::gui::theme::{Theme, ThemeName};

    let options = HeadlessOptions { size_px: [1920, 1040], pixels_per_point: 1.5, theme: ThemeName::Print };
    let theme = Theme::of(options.theme);
    let image = headless::draw(options, |ui| allan_ui(ui, &theme, report));
    let drawing = headless::svg_of(options, "allan", "Allan deviation", |ui| allan_ui(ui, &theme, report));
    let mut files = vec![(SVG, drawing.into_bytes())];
    // An image of this size can be encoded.
    files.extend(super::png_bytes(&image).ok().map(|png| (PNG, png)));
    files
}
