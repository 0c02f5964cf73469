//! Values of the panels of a study as comma-separated values.

use super::context::StudyPanel;
use super::model::StudyModel;
use super::plots::{differences, distributions, success_rates};
use super::strips::StripPlot;
use crate::study::view::columns::KEY;
use crate::study::view::{ParameterErrors, RowGroup, Study, parameter_errors};
use crate::table::{Column, csv};

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
    type PointColumn<'a> = Column<'a, (&'a StripPlot, usize, f64)>;
    let columns = [
        PointColumn::new("group", |(strip, ..)| strip.name.clone()),
        PointColumn::new("key", |(_, row, _)| study.runs.text(*row, KEY).map(str::to_owned)),
        PointColumn::new("run", |(_, row, _)| study.title_of(*row)),
        PointColumn::new(title, |(.., value)| *value),
    ];
    csv(&columns, strips.iter().flat_map(|strip| strip.points.iter().map(move |(row, value)| (strip, *row, *value))))
}

fn success(study: &Study, model: &StudyModel) -> String {
    type SuccessColumn<'a> = Column<'a, (StripPlot, &'a RowGroup)>;
    let columns = [
        SuccessColumn::new("group", |(strip, _)| strip.name.clone()),
        SuccessColumn::new("rate_percent", |(strip, _)| Some(strip.interval?[1])),
        SuccessColumn::new("low_percent", |(strip, _)| Some(strip.interval?[0])),
        SuccessColumn::new("high_percent", |(strip, _)| Some(strip.interval?[2])),
        SuccessColumn::new("runs", |(_, group)| group.rows.len()),
    ];
    csv(&columns, success_rates(study, model).into_iter().zip(&model.arranged.groups))
}

fn parameters(study: &Study, model: &StudyModel) -> String {
    csv(&ParameterErrors::columns(), parameter_errors(study, &study.run_of_parameter_rows(), &model.arranged.rows))
}
