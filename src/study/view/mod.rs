//! Models of the study view, without a window: filters, order and groups of the rows, distributions, paired
//! differences, success rates and errors against σ.
//!
//! - `study`: the tables of one study, and the names of the columns that the view relies on.
//! - `filter`: conditions on rows, `ate_rmse_m < 0.1 and run = auto`.
//! - `arrange`: rows that pass, their order and their groups.
//! - `metric`: numeric columns with the shown unit.
//! - `spread`, `paired`: quantiles, differences between groups on equal inputs.
//! - `summary`: statistics and success rates of the groups, with Wilson intervals.
//! - `parameters`: errors of calibration parameters against their σ.
//! - `comparable`: the runs that are opened together with a run.

mod arrange;
mod comparable;
mod filter;
mod metric;
mod paired;
mod parameters;
mod spread;
mod study;
mod summary;
#[cfg(test)]
pub(crate) mod tests;

pub use arrange::{Arranged, RowGroup, SortKey, arrange, group_columns};
pub use comparable::comparable_rows;
pub use filter::RowFilter;
pub use metric::{Metric, metrics};
pub use paired::{GroupDifference, PairedDifference, paired_differences};
pub use parameters::{ParameterErrors, ParameterPoint, SigmaVerdict, parameter_errors};
pub use spread::Spread;
pub use study::{Study, columns};
pub use summary::{GroupSummary, SuccessRate, success_rate, summarize_groups};
