//! Values of the panels of a study as comma-separated values.

use super::context::StudyPanel;
use super::model::StudyModel;
use super::plots::{differences, distributions, success_rates};
use super::strips::StripPlot;
use crate::files::csv_writer::{CsvWriter, number_cell};
use crate::study::view::{Study, parameter_errors};

/// Values of a panel with a header line: runs in the stored units with all columns, plots in the shown units.
pub(super) fn table(panel: StudyPanel, study: &Study, model: &mut StudyModel) -> String {
    model.update(study);
    match panel {
        StudyPanel::Runs | StudyPanel::Parallel => study.runs.csv(model.arranged.rows.iter().copied()),
        StudyPanel::Distributions => {
            let Some(metric) = model.metric() else { return String::new() };
            points(study, &metric.title(), &distributions(study, model, metric))
        }
        StudyPanel::Differences => {
            let (Some(metric), Some(reference)) = (model.metric(), model.reference()) else { return String::new() };
            let title = format!("{} − {reference}", metric.title());
            points(study, &title, &differences(study, model, metric, reference))
        }
        StudyPanel::Success => success(study, model),
        StudyPanel::Parameters => parameters(study, model),
    }
}

fn points(study: &Study, title: &str, strips: &[StripPlot]) -> String {
    let mut table = CsvWriter::new(["group", "key", "run", title]);
    for strip in strips {
        for (row, value) in &strip.points {
            let key = study.runs.text(*row, crate::study::view::columns::KEY).unwrap_or_default().to_owned();
            table.row([strip.name.clone(), key, study.title_of(*row), number_cell(*value)]);
        }
    }
    table.into_text()
}

fn success(study: &Study, model: &StudyModel) -> String {
    let mut table = CsvWriter::new(["group", "rate_percent", "low_percent", "high_percent", "runs"]);
    for (strip, group) in success_rates(study, model).into_iter().zip(&model.arranged.groups) {
        let [low, rate, high] = strip.interval.unwrap_or([f64::NAN; 3]);
        table.row([strip.name, number_cell(rate), number_cell(low), number_cell(high), group.rows.len().to_string()]);
    }
    table.into_text()
}

fn parameters(study: &Study, model: &StudyModel) -> String {
    let head = ["parameter", "unit", "runs", "error_over_sigma_rms", "error_over_sigma_mean", "within_1_sigma"];
    let mut table = CsvWriter::new(head.into_iter().chain(["within_3_sigma", "error_rms", "sigma_median"]));
    for of in parameter_errors(study, &study.run_of_parameter_rows(), &model.arranged.rows) {
        let numbers = [of.ratio_rms, of.ratio_mean, of.within_1, of.within_3, of.error_rms, of.sigma_median];
        let texts = [of.name.clone(), of.unit.to_owned(), of.points.len().to_string()];
        table.row(texts.into_iter().chain(numbers.map(number_cell)));
    }
    table.into_text()
}
