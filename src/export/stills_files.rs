//! Output files of `dcvins calibrate --stills`.

use std::path::{Path, PathBuf};

use super::calibration_files::sigmas_yaml;
use super::error::ExportError;
#[cfg(feature = "gui")]
use super::folder_files::figure_files;
use super::folder_files::{remove_others, write_files};
use super::stills_report::StillsReport;
use super::stills_rig::rig_of_stills;
use crate::calibration::stills::StillsOutcome;
use crate::files::csv_writer::{CsvWriter, number_cell};
use crate::sensors::Stills;

/// Names of all files; the first one names the stills.
pub(super) const STILLS_FILES: [&str; 9] = [
    "calibration.json",
    "gimbal.rig.yaml",
    "report.txt",
    "parameters.csv",
    "sets.csv",
    "ranks.csv",
    "correlations.csv",
    "stills.png",
    "stills.svg",
];

/// Writes the files of a calibration from stills, or of the judgement of a chain, into a folder; returns their paths.
///
/// # Errors
/// If the folder or a file cannot be written.
pub fn write_stills(stills: &Stills, report: &StillsReport, folder: &Path) -> Result<Vec<PathBuf>, ExportError> {
    let outcome = &report.outcome;
    let json = serde_json::to_string_pretty(report)
        .map_err(|source| ExportError::Write { source: source.into(), path: folder.join(STILLS_FILES[0]) })?;
    let rig = rig_of_stills(stills, outcome);
    let sigmas = outcome.tables.first().map_or_else(String::new, |table| {
        let sigmas = table.parameters.iter().map(|it| (it.name.as_str(), it.dimension, it.sigma));
        sigmas_yaml(table.parameterization, sigmas)
    });
    let mut files = vec![
        (STILLS_FILES[0], format!("{json}\n").into_bytes()),
        (STILLS_FILES[1], format!("{}{sigmas}", rig.to_yaml()).into_bytes()),
        (STILLS_FILES[2], report.to_string().into_bytes()),
        (STILLS_FILES[4], sets(outcome).into_bytes()),
    ];
    if outcome.angles.is_some() {
        files.push((STILLS_FILES[3], parameters(outcome).into_bytes()));
        files.push((STILLS_FILES[5], ranks(outcome).into_bytes()));
        files.push((STILLS_FILES[6], correlations(outcome).into_bytes()));
    }
    #[cfg(feature = "gui")]
    files.extend(figures(outcome));
    let paths = write_files(files, folder)?;
    remove_others(&STILLS_FILES, &paths, folder)?;
    Ok(paths)
}

fn parameters(outcome: &StillsOutcome) -> String {
    let mut table = CsvWriter::new([
        "parameterization",
        "parameter",
        "unit",
        "initial",
        "value",
        "sigma",
        "sigma_formal",
        "sigma_jackknife",
    ]);
    let chains = outcome.tables.iter().map(|table| (table.parameterization, &table.parameters));
    for (parameterization, parameters) in chains.chain([("", &outcome.rigid)]) {
        for parameter in parameters {
            let numbers = [parameter.initial, parameter.value, parameter.sigma, parameter.sigma_formal];
            let mut row = vec![parameterization.to_owned(), parameter.name.clone()];
            row.push(parameter.dimension.unit().to_owned());
            row.extend(numbers.map(number_cell));
            row.push(optional(parameter.sigma_jackknife));
            table.row(row);
        }
    }
    table.into_text()
}

fn optional(number: Option<f64>) -> String {
    number.map_or_else(String::new, number_cell)
}

/// One row per set and rigid camera.
fn sets(outcome: &StillsOutcome) -> String {
    let of_joints = |ending: &'static str| outcome.joints.iter().map(move |joint| format!("{joint}_{ending}"));
    let mut header: Vec<String> = ["set", "station", "wrong"].map(str::to_owned).into();
    header.extend(of_joints("reading_deg").chain(of_joints("correction_deg")).chain(of_joints("sigma_deg")));
    header.extend(
        [
            "camera",
            "floor_px",
            "initial_px",
            "as_read_px",
            "estimated_px",
            "hold_out_as_read_px",
            "hold_out_estimated_px",
        ]
        .map(str::to_owned),
    );
    let mut table = CsvWriter::new(header);
    for set in &outcome.sets {
        for view in &set.views {
            let mut row = vec![set.id.to_string(), set.station.to_string(), u8::from(set.wrong).to_string()];
            let angles = [&set.readings_deg, &set.corrections_deg, &set.sigmas_deg];
            row.extend(angles.into_iter().flatten().map(|angle| number_cell(*angle)));
            row.push(view.camera.clone());
            row.push(number_cell(view.floor_px));
            row.extend(
                [
                    view.initial_px,
                    view.as_read_px,
                    view.estimated_px,
                    view.hold_out_as_read_px,
                    view.hold_out_estimated_px,
                ]
                .map(optional),
            );
            table.row(row);
        }
    }
    table.into_text()
}

fn ranks(outcome: &StillsOutcome) -> String {
    let mut table = CsvWriter::new([
        "parameterization",
        "angles",
        "columns",
        "rank_structural",
        "rank_informed",
        "redundant",
        "absorbed",
        "null_directions",
        "uninformed_directions",
    ]);
    for rank in &outcome.ranks {
        let counts = [rank.columns, rank.rank_structural, rank.rank_informed, rank.redundant, rank.absorbed];
        let mut row = vec![rank.parameterization.to_owned(), rank.angles.name().to_owned()];
        row.extend(counts.map(|count| count.to_string()));
        row.extend([rank.null_directions.join("; "), rank.uninformed_directions.join("; ")]);
        table.row(row);
    }
    table.into_text()
}

fn correlations(outcome: &StillsOutcome) -> String {
    let correlations = &outcome.correlations;
    let header = std::iter::once("parameter".to_owned()).chain(correlations.names.iter().cloned());
    let mut table = CsvWriter::new(header.collect::<Vec<_>>());
    for (name, values) in correlations.names.iter().zip(&correlations.values) {
        let cells = values.iter().map(|value| number_cell(*value));
        table.row(std::iter::once(name.clone()).chain(cells).collect::<Vec<_>>());
    }
    table.into_text()
}

#[cfg(feature = "gui")]
fn figures(outcome: &StillsOutcome) -> Vec<(&'static str, Vec<u8>)> {
    let names = [STILLS_FILES[7], STILLS_FILES[8]];
    figure_files(names, [1920, 1140], ["stills", "Calibration from stills"], |ui, theme| {
        crate::gui::figures::stills_ui(ui, theme, outcome);
    })
}
