//! Rows as lines over parallel axes.

use crate::gui::plot::ValueAxis;
use crate::study::view::{Metric, columns, group_columns, metrics};
use crate::study::{ColumnType, StudyTable};

#[derive(Clone, Debug, PartialEq)]
pub(super) enum AxisScale {
    /// Numbers on a linear or logarithmic scale.
    Values(ValueAxis),
    /// Texts in this order from below, at equal distances.
    Names(Vec<String>),
}

/// One axis with the positions of rows on it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ParallelAxis {
    pub(super) column: String,
    /// Title of the axis, with the shown unit.
    pub(super) title: String,
    pub(super) scale: AxisScale,
    /// Position of each requested row, from 0 (bottom) to 1; `None` for an empty cell.
    pub(super) positions: Vec<Option<f64>>,
}

/// Maximum number of texts on an axis; with more, the names are illegible.
const MAX_NAMES: usize = 40;

/// The axis of a column with the positions of `rows`; `None` for an unknown column or too many different texts.
pub(super) fn parallel_axis(table: &StudyTable, column: &str, rows: &[usize]) -> Option<ParallelAxis> {
    let found = table.column(column)?;
    if matches!(found.values.column_type(), ColumnType::Text | ColumnType::Bool) || column == columns::SEED {
        let texts: Vec<Option<String>> = rows
            .iter()
            .map(|row| table.cell(*row, column))
            .map(|cell| cell.column_type().map(|_| cell.to_string()))
            .collect();
        let mut names: Vec<String> = texts.iter().flatten().cloned().collect();
        names.sort_by(|a, b| natural(a).cmp(&natural(b)));
        names.dedup();
        if names.len() > MAX_NAMES {
            return None;
        }
        let place = |name: &String| names.iter().position(|known| known == name);
        let position = |place: usize| (place as f64 + 0.5) / names.len() as f64;
        let positions = texts.iter().map(|text| text.as_ref().and_then(place).map(position)).collect();
        return Some(ParallelAxis {
            column: column.to_owned(),
            title: column.to_owned(),
            scale: AxisScale::Names(names),
            positions,
        });
    }
    let metric = Metric::of(found)?;
    let values: Vec<Option<f64>> = rows.iter().map(|row| metric.value(table, *row)).collect();
    let axis = ValueAxis::over(values.iter().flatten().copied());
    let positions = values.iter().map(|value| value.map(|value| axis.position(value))).collect();
    Some(ParallelAxis { column: column.to_owned(), title: metric.title(), scale: AxisScale::Values(axis), positions })
}

/// Sort key that orders numbers before texts, and numbers by value.
fn natural(text: &str) -> (Option<i64>, &str) {
    (text.parse().ok(), text)
}

/// The initial axes: inputs that vary, then the most important results that have values.
pub(super) fn default_axes(table: &StudyTable) -> Vec<String> {
    const INPUTS: [&str; 4] = [columns::RUN, columns::LOG, columns::DISTURBANCE, columns::PERTURBATION];
    const RESULTS: [&str; 6] =
        [columns::ATE, "rpe_10m_translation_m", "pose_nees", "chain_error_m", "reprojection_rms_px", "rank_informed"];
    const MOST: usize = 7;
    let grouped = group_columns(table);
    let few = |name: &&str| grouped.iter().any(|known| known == name);
    let known = metrics(table);
    let results = RESULTS.into_iter().filter(|name| known.iter().any(|metric| metric.column == *name));
    INPUTS.into_iter().filter(few).chain(results).take(MOST).map(str::to_owned).collect()
}
