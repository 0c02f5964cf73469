//! Lanes of the timeline; one row per step or event.

use super::TimelinePanel;
use crate::gui::events::name_of;
use crate::gui::residuals::rms_px;
use crate::gui::{CsvTable, PanelContext};
use crate::observability::RankReport;
use crate::session::StepRecord;
use crate::table::{Column, Stamp, csv};

/// Name, value, threshold and message of an event or a warning.
type EventCells<'a> = (&'static str, Option<f64>, Option<f64>, &'a str);
/// Stamp and run of a step, or of an event.
type LaneRow<'a> = (i64, &'a str, Option<&'a StepRecord>, Option<EventCells<'a>>);
type LaneColumn<'a> = Column<'a, LaneRow<'a>>;

impl CsvTable for TimelinePanel {
    /// A row for every step of every run, followed by one for each of its notable events and findings and of the log's
    /// warnings.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let answers: Vec<_> = ctx.recording.runs.iter().map(|run| ctx.answer(run)).collect();
        let rank = |step: Option<&StepRecord>, of: fn(&RankReport) -> usize| {
            step?.rank.as_ref().filter(|rank| !rank.parameters.is_empty()).map(of)
        };
        let columns = [
            LaneColumn::new("t_s", |(stamp_ns, ..)| Stamp(*stamp_ns)),
            LaneColumn::new("run", |(_, run, ..)| *run),
            LaneColumn::new("phase", |(_, _, step, _)| Some((*step)?.report.phase.name())),
            LaneColumn::new("keyframe", |(_, _, step, _)| Some((*step)?.report.keyframe)),
            LaneColumn::new("features", |(_, _, step, _)| Some((*step)?.feature_count())),
            LaneColumn::new("reprojection_rms_px", |(_, _, step, _)| Some(rms_px(&(*step)?.report))),
            LaneColumn::new("rank_informed", |(_, _, step, _)| rank(*step, |rank| rank.rank_informed)),
            LaneColumn::new("rank_structural", |(_, _, step, _)| rank(*step, |rank| rank.rank_structural)),
            LaneColumn::new("rejected", |(_, _, step, _)| Some((*step)?.report.counts.rejected)),
            LaneColumn::new("event", |(.., event)| event.map(|(name, ..)| name)),
            LaneColumn::new("value", |(.., event)| event.and_then(|(_, value, ..)| value)),
            LaneColumn::new("threshold", |(.., event)| event.and_then(|(_, _, threshold, _)| threshold)),
            LaneColumn::new("message", |(.., event)| event.map(|(.., message)| message)),
        ];
        let warnings = ctx.recording.warnings.iter();
        let warning = |message| Some(("warning", None, None, message));
        let mut rows: Vec<LaneRow<'_>> =
            warnings.map(|it| (it.stamp_ns, "", None, warning(it.message.as_str()))).collect();
        for (run, answer) in ctx.recording.runs.iter().zip(&answers) {
            for finding in &answer.findings {
                let stamp_ns = finding.since_ns.unwrap_or(ctx.recording.start_ns);
                rows.push((stamp_ns, &run.spec.label, None, Some(("finding", None, None, &finding.statement))));
            }
            let label = run.spec.label.as_str();
            for step in &run.steps {
                rows.push((step.report.stamp_ns, label, Some(step), None));
                for event in step.report.events.iter().filter(|event| event.kind.is_notable()) {
                    let cells = (name_of(event.kind), event.value, event.threshold, event.message.as_str());
                    rows.push((step.report.stamp_ns, label, None, Some(cells)));
                }
            }
        }
        rows.sort_by_key(|(stamp_ns, ..)| *stamp_ns);
        csv(&columns, rows)
    }
}
