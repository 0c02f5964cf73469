//! The report of a study: one HTML file with tables and figures, and JSON and CSV files.

use std::fs;
use std::path::{Path, PathBuf};

use maud::{Markup, html};
use serde::Serialize;

use super::content::ReportFigure;
use super::html::{document, figure, table};
use crate::export::ExportError;
use crate::export::existing::read_index;
use crate::export::folder_files::json_text;
use crate::files::output;
use crate::files::output::OutputSet;
use crate::study::view::{GroupSummary, ParameterErrors};
use crate::table::Column;
use crate::table::Medium::Page;

/// File that identifies the report of a study.
const INDEX: &str = "report.json";

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StudyReport {
    pub study: String,
    pub runs: usize,
    /// Number of runs that pass the filter.
    pub shown: usize,
    /// Filter condition, empty for all runs.
    pub filter: String,
    pub group: Option<String>,
    /// Title of the metric with its unit.
    pub metric: String,
    pub reference: Option<String>,
    pub success: String,
    pub groups: Vec<GroupSummary>,
    pub parameters: Vec<ParameterErrors>,
    pub command: String,
    pub program: String,
    /// Figures in the order of the page.
    #[serde(skip)]
    pub figures: Vec<ReportFigure>,
    /// Names and texts of the CSV tables of the report.
    #[serde(skip)]
    pub tables: Vec<(String, String)>,
}

/// Checks that a folder contains no other report.
///
/// # Errors
/// If the folder cannot be written or, without `force`, contains another report.
pub fn check_study_report(folder: &Path, study: &str, force: bool) -> Result<(), ExportError> {
    output::check_folder(folder).map_err(ExportError::write(folder))?;
    let path = folder.join(INDEX);
    if force || !path.exists() {
        return Ok(());
    }
    let known =
        read_index(&path).and_then(|index| index.get("study").and_then(|name| name.as_str().map(str::to_owned)));
    if known.as_deref() == Some(study) {
        return Ok(());
    }
    let problem = format!("the folder holds a report that is not of the study '{study}'");
    Err(ExportError::Existing { problem, path })
}

/// Writes report.html, report.json and the tables; returns the path of the page.
///
/// # Errors
/// If a file cannot be written.
pub fn write_study_report(report: &StudyReport, folder: &Path) -> Result<PathBuf, ExportError> {
    fs::create_dir_all(folder).map_err(ExportError::write(folder))?;
    let mut outputs = OutputSet::default();
    let json_path = folder.join(INDEX);
    let json = json_text(report, &json_path)?;
    let path = folder.join("report.html");
    let mut files = vec![(json_path, json), (path.clone(), page(report))];
    files.extend(report.tables.iter().map(|(name, text)| (folder.join(format!("{name}.csv")), text.clone())));
    for (path, text) in &files {
        outputs.write(path, text.as_bytes()).map_err(ExportError::write(path))?;
    }
    outputs.commit().map_err(ExportError::commit)?;
    Ok(path)
}

fn page(report: &StudyReport) -> String {
    let title = format!("Study report: {}", report.study);
    let body = html! {
        h1 { (title) }
        p.lead { (lead(report)) }
        h2 { "Groups" }
        (groups(report))
        @for (number, shown) in (1..).zip(&report.figures) {
            @if number == 1 || report.figures[number - 2].heading != shown.heading {
                h2 { (shown.heading) }
            }
            (figure(number, shown))
        }
        @if !report.parameters.is_empty() {
            h2 { "Calibration parameters" }
            (parameters(report))
        }
        h2 { "Reproduction" }
        p { "Command" }
        pre { (report.command) }
        p {
            "Version: " (report.program) ". The same tables, command and version give the same bytes. Files next to \
             this page: report.json and, for each figure, a table of its values (CSV)."
        }
    };
    document(&title, &body)
}

fn lead(report: &StudyReport) -> String {
    let successes: usize = report.groups.iter().map(|group| group.success.successes).sum();
    let filter =
        if report.filter.is_empty() { String::new() } else { format!(" that pass the filter '{}'", report.filter) };
    let condition = if report.success.is_empty() { String::new() } else { format!(" ({})", report.success) };
    format!("{} of {} runs{filter}; {successes} of them succeeded{condition}.", report.shown, report.runs)
}

/// Success, quantiles and differences of each group.
fn groups(report: &StudyReport) -> Markup {
    type GroupColumn<'a> = Column<'a, GroupSummary>;
    let significant = |value: f64| {
        let decimals = if value == 0.0 { 0.0 } else { (2.0 - value.abs().log10().floor()).clamp(0.0, 9.0) };
        Page.fixed(value, decimals as usize)
    };
    let range = move |low: f64, high: f64| format!("{} to {}", significant(low), significant(high));
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "–".to_owned());
    let rate = |group: &GroupSummary| {
        let [rate, low, high] =
            [group.success.rate, group.success.low, group.success.high].map(|it| Page.fixed(100.0 * it, 1));
        format!("{rate} % ({low} to {high})")
    };
    let mut columns = vec![
        GroupColumn::page(report.group.as_deref().unwrap_or("runs"), |group| {
            if group.name.is_empty() { "all runs".to_owned() } else { group.name.clone() }
        }),
        GroupColumn::page("succeeded", |group| format!("{} of {}", group.success.successes, group.success.runs)),
        GroupColumn::page("rate (95 %, Wilson)", rate),
        GroupColumn::page(format!("median {}", report.metric), move |group| {
            or_dash(group.spread.map(|spread| significant(spread.median)))
        }),
        GroupColumn::page("quartiles", move |group| or_dash(group.spread.map(|spread| range(spread.q1, spread.q3)))),
    ];
    if let Some(reference) = &report.reference {
        columns.extend([
            GroupColumn::page(format!("mean difference to {reference}"), move |group| {
                or_dash(group.difference.map(|[_, mean, _]| significant(mean)))
            }),
            GroupColumn::page("95 % interval", move |group| {
                or_dash(group.difference.map(|[low, _, high]| range(low, high)))
            }),
            GroupColumn::page("pairs", |group| group.pairs),
        ]);
    }
    table(
        "Groups of the study; differences are of runs on the same log, disturbance, perturbation and seed",
        &columns,
        &report.groups,
    )
}

fn parameters(report: &StudyReport) -> Markup {
    let caption = "Errors against σ; consistent: RMS 1, 68.3 % within 1 σ, 99.7 % within 3 σ";
    table(caption, &ParameterErrors::columns(), &report.parameters)
}
