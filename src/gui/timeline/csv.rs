//! Lanes of the timeline; one row per step or event.

use super::TimelinePanel;
use crate::files::csv_writer::{CsvWriter, number_cell, seconds_cell};
use crate::gui::events::name_of;
use crate::gui::residuals::rms_px;
use crate::gui::{CsvTable, PanelContext};

impl CsvTable for TimelinePanel {
    /// A row for every step of every run, followed by one for each of its notable events and of the log's warnings.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        const VALUES: [&str; 7] =
            ["phase", "keyframe", "features", "reprojection_rms_px", "rank_informed", "rank_structural", "rejected"];
        const EVENT: [&str; 4] = ["event", "value", "threshold", "message"];
        let mut rows: Vec<(i64, Vec<String>)> = Vec::new();
        let event_row = |run: &str, event: [String; EVENT.len()]| -> Vec<String> {
            std::iter::once(run.to_owned()).chain(VALUES.map(|_| String::new())).chain(event).collect()
        };
        for warning in &ctx.recording.warnings {
            let cells = ["warning".to_owned(), String::new(), String::new(), warning.message.clone()];
            rows.push((warning.stamp_ns, event_row("", cells)));
        }
        for run in &ctx.recording.runs {
            for step in &run.steps {
                let (report, label) = (&step.report, &run.spec.label);
                let rank = step.rank.as_ref().filter(|rank| !rank.parameters.is_empty());
                let values = [
                    report.phase.name().to_owned(),
                    report.keyframe.to_string(),
                    step.tracks.features.len().to_string(),
                    number_cell(rms_px(report)),
                    rank.map_or_else(String::new, |rank| rank.rank_informed.to_string()),
                    rank.map_or_else(String::new, |rank| rank.rank_structural.to_string()),
                    report.counts.rejected.to_string(),
                ];
                let nothing = EVENT.map(|_| String::new());
                let cells = std::iter::once(label.clone()).chain(values).chain(nothing);
                rows.push((report.stamp_ns, cells.collect()));
                for event in report.events.iter().filter(|event| event.kind.is_notable()) {
                    let significant = |value: Option<f64>| number_cell(value.unwrap_or(f64::NAN));
                    let cells = [
                        name_of(event.kind).to_owned(),
                        significant(event.value),
                        significant(event.threshold),
                        event.message.clone(),
                    ];
                    rows.push((report.stamp_ns, event_row(label, cells)));
                }
            }
        }
        rows.sort_by_key(|(stamp_ns, _)| *stamp_ns);
        let heads: Vec<&str> = ["t_s", "run"].into_iter().chain(VALUES).chain(EVENT).collect();
        let mut table = CsvWriter::new(heads);
        for (stamp_ns, cells) in rows {
            table.row(std::iter::once(seconds_cell(stamp_ns)).chain(cells));
        }
        table.into_text()
    }
}
