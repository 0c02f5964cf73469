//! The files that `dcvins calibrate` writes.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::calibration_report::CalibrationReport;
use super::error::ExportError;
use super::tables::INTO_STRING;
use crate::session::CalibrationRun;

/// Writes `rig.yaml`, `calibration.json` and `report.txt` into a folder.
///
/// # Errors
/// When a file or the folder cannot be written.
pub fn write_calibration(run: &CalibrationRun, report: &CalibrationReport, folder: &Path) -> Result<(), ExportError> {
    fs::create_dir_all(folder).map_err(ExportError::write(folder))?;
    let json = serde_json::to_string_pretty(report)
        .map_err(|source| ExportError::Write { source: source.into(), path: folder.join("calibration.json") })?;
    let files = [
        ("rig.yaml", format!("{}{}", run.rig.to_yaml(), sigmas_yaml(report))),
        ("calibration.json", format!("{json}\n")),
        ("report.txt", report.to_string()),
    ];
    for (name, text) in files {
        let path = folder.join(name);
        fs::write(&path, text).map_err(ExportError::write(&path))?;
    }
    Ok(())
}

/// The standard deviations as a further entry of the rig, which its readers pass over.
fn sigmas_yaml(report: &CalibrationReport) -> String {
    let mut text = "# Standard deviations of the calibrated parameters, in the form named here.\n".to_owned();
    writeln!(text, "calibration:\n  parameterization: {}\n  sigmas:", report.parameterization).expect(INTO_STRING);
    for parameter in &report.parameters {
        writeln!(text, "    {}_{}: {:?}", parameter.name, parameter.dimension.unit(), parameter.sigma)
            .expect(INTO_STRING);
    }
    text
}
