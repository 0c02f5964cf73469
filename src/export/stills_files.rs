//! Output files of `dcvins calibrate --stills`.

use crate::files::RigFile as _;
use std::path::{Path, PathBuf};

use super::calibration_files::sigmas_yaml;
use super::error::ExportError;
#[cfg(feature = "gui")]
use super::folder_files::figure_files;
use super::folder_files::{json_text, remove_others, write_files};
use super::stills_report::StillsReport;
use super::stills_rig::rig_of_stills;
use crate::calibration::stills::{SetReport, StillsOutcome, StillsParameter, StillsRank, ViewReport};
use crate::sensors::Stills;
use crate::table::{Column, csv};

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
    let json = json_text(report, &folder.join(STILLS_FILES[0]))?;
    let rig = rig_of_stills(stills, outcome);
    let sigmas = outcome.tables.first().map_or_else(String::new, |table| {
        let sigmas = table.parameters.iter().map(|it| (it.name.as_str(), it.dimension, it.sigma));
        sigmas_yaml(table.parameterization, sigmas)
    });
    let mut files = vec![
        (STILLS_FILES[0], json.into_bytes()),
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
    let chains = outcome.tables.iter().map(|table| (table.parameterization, &table.parameters));
    let rows = chains.chain([("", &outcome.rigid)]);
    let rows = rows.flat_map(|(name, parameters)| parameters.iter().map(move |parameter| (name, parameter)));
    csv(&parameter_columns(), rows)
}

fn parameter_columns<'a>() -> [Column<'a, (&'static str, &'a StillsParameter)>; 8] {
    type ParameterColumn<'a> = Column<'a, (&'static str, &'a StillsParameter)>;
    [
        ParameterColumn::new("parameterization", |(name, _)| *name)
            .means("", "parameterization of the chain; empty for the transforms between the rigid cameras"),
        ParameterColumn::new("parameter", |(_, it)| it.name.as_str()).means("", "name of the parameter"),
        ParameterColumn::new("unit", |(_, it)| it.dimension.unit()).means("", "unit of the following values"),
        ParameterColumn::new("initial", |(_, it)| it.initial).means("", "value of the initial chain"),
        ParameterColumn::new("value", |(_, it)| it.value).means("", "estimate"),
        ParameterColumn::new("sigma", |(_, it)| it.sigma).means("", "the larger of the next two"),
        ParameterColumn::new("sigma_formal", |(_, it)| it.sigma_formal).means("", "by the noise of the measurements"),
        ParameterColumn::new("sigma_jackknife", |(_, it)| it.sigma_jackknife).means("", "by leaving out stations"),
    ]
}

/// One row per set and rigid camera.
fn sets(outcome: &StillsOutcome) -> String {
    type SetColumn<'a> = Column<'a, (&'a SetReport, &'a ViewReport)>;
    let of_joints = |ending: &'static str, of: fn(&SetReport) -> &[f64]| {
        let joints = outcome.joints.iter().enumerate();
        SetColumn::each(
            joints,
            move |(_, joint)| format!("{joint}_{ending}"),
            move |(set, _), (index, _)| of(set)[*index],
        )
    };
    let mut columns = vec![
        SetColumn::new("set", |(set, _)| set.id),
        SetColumn::new("station", |(set, _)| set.station),
        SetColumn::new("wrong", |(set, _)| usize::from(set.wrong)),
    ];
    columns.extend(of_joints("reading_deg", |set| &set.readings_deg));
    columns.extend(of_joints("correction_deg", |set| &set.corrections_deg));
    columns.extend(of_joints("sigma_deg", |set| &set.sigmas_deg));
    columns.extend([
        SetColumn::new("camera", |(_, view)| view.camera.as_str()),
        SetColumn::new("floor_px", |(_, view)| view.floor_px),
        SetColumn::new("initial_px", |(_, view)| view.initial_px),
        SetColumn::new("as_read_px", |(_, view)| view.as_read_px),
        SetColumn::new("estimated_px", |(_, view)| view.estimated_px),
        SetColumn::new("hold_out_as_read_px", |(_, view)| view.hold_out_as_read_px),
        SetColumn::new("hold_out_estimated_px", |(_, view)| view.hold_out_estimated_px),
    ]);
    csv(&columns, outcome.sets.iter().flat_map(|set| set.views.iter().map(move |view| (set, view))))
}

fn ranks(outcome: &StillsOutcome) -> String {
    csv(&rank_columns(), &outcome.ranks)
}

fn rank_columns<'a>() -> [Column<'a, StillsRank>; 9] {
    type RankColumn<'a> = Column<'a, StillsRank>;
    [
        RankColumn::new("parameterization", |rank| rank.parameterization).means("", "parameterization of the chain"),
        RankColumn::new("angles", |rank| rank.angles.name())
            .means("", "knowledge of the angles: known, encoder or free"),
        RankColumn::new("columns", |rank| rank.columns).means("", "parameters"),
        RankColumn::new("rank_structural", |rank| rank.rank_structural).means("", "structural rank"),
        RankColumn::new("rank_informed", |rank| rank.rank_informed).means("", "informed rank"),
        RankColumn::new("redundant", |rank| rank.redundant).means("", "null directions of the parameterization"),
        RankColumn::new("absorbed", |rank| rank.absorbed).means("", "null directions absorbed by free angles"),
        RankColumn::new("null_directions", |rank| rank.null_directions.join("; ")).means("", "null directions"),
        RankColumn::new("uninformed_directions", |rank| rank.uninformed_directions.join("; "))
            .means("", "other uninformed directions"),
    ]
}

fn correlations(outcome: &StillsOutcome) -> String {
    type CorrelationColumn<'a> = Column<'a, (&'a String, &'a Vec<f64>)>;
    let correlations = &outcome.correlations;
    let mut columns = vec![CorrelationColumn::new("parameter", |(name, _)| name.as_str())];
    columns.extend(CorrelationColumn::each(
        correlations.names.iter().enumerate(),
        |(_, name)| (*name).clone(),
        |(_, values), (index, _)| values[*index],
    ));
    csv(&columns, correlations.names.iter().zip(&correlations.values))
}

#[cfg(feature = "gui")]
fn figures(outcome: &StillsOutcome) -> Vec<(&'static str, Vec<u8>)> {
    let names = [STILLS_FILES[7], STILLS_FILES[8]];
    figure_files(names, [1920, 1140], ["stills", "Calibration from stills"], |ui, theme| {
        crate::gui::figures::stills_ui(ui, theme, outcome);
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::documented_tests::documented;

    #[test]
    fn the_documents_list_the_columns() {
        let document = include_str!("../../docs/formats.md");
        for table in [documented(&parameter_columns()), documented(&rank_columns())] {
            assert!(document.contains(&table), "docs/formats.md lacks the table:\n{table}");
        }
    }
}
