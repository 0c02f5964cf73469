//! Lane of the findings about the selected run: an interval with its name for each, in rows without overlap.

use std::sync::Arc;

use egui::text::{LayoutJob, TextWrapping};
use egui::{Painter, Rangef, Rect, Role, Stroke, Ui, WidgetInfo, pos2};

use crate::gui::plot::PlotArea;
use crate::gui::theme::{self, Theme};
use crate::gui::under_pointer::offer;
use crate::gui::{PanelContext, findings};
use crate::log_check::Trust;
use crate::session::{Answer, RunFinding};

/// Height of a row in points.
const ROW_HEIGHT: f32 = 16.0;
/// Largest number of rows; the list of warnings has the findings without a row.
const MAX_ROWS: usize = 4;
/// Smallest width of an interval in points.
const MIN_WIDTH: f32 = 6.0;
/// Smallest width of an interval with a name in points.
const MIN_NAMED_WIDTH: f32 = 28.0;
/// Duration of the log over the least time that an interval takes in its row.
const LEAST_PARTS: i64 = 40;

/// Findings of a run with their rows.
#[derive(Debug, Default)]
pub(super) struct FindingsLane {
    answer: Arc<Answer>,
    /// Row of each finding; `None` beyond the last row.
    rows: Vec<Option<usize>>,
    /// Rectangle of the rows in the last frame.
    pub(super) rect: Option<Rect>,
}

impl FindingsLane {
    /// Reads the findings about the selected run.
    pub(super) fn read(&mut self, ctx: &PanelContext<'_>) {
        self.answer = ctx.selected_run().map(|run| ctx.answer(run)).unwrap_or_default();
        self.rows = rows(&self.answer.findings, ctx.recording.duration_ns);
        self.rect = None;
    }

    /// Height of the lane in points; zero without findings.
    pub(super) fn height(&self) -> f32 {
        let rows = self.rows.iter().flatten().max().map_or(0, |last| last + 1);
        if rows == 0 { 0.0 } else { ROW_HEIGHT * rows as f32 + 2.0 }
    }

    /// Number of findings, for the label.
    pub(super) fn count(&self) -> usize {
        self.answer.findings.len()
    }

    /// Findings with the part of their interval in the visible range.
    fn shown(&self, area: &PlotArea, lane: Rect) -> impl Iterator<Item = (&RunFinding, Rect)> {
        self.answer.findings.iter().zip(&self.rows).filter_map(move |(finding, row)| {
            let top = lane.top() + ROW_HEIGHT * (*row)? as f32;
            let left = finding.since_ns.map_or_else(|| lane.left(), |since_ns| area.x(since_ns));
            let right =
                finding.until_ns.map_or_else(|| lane.right(), |until_ns| area.x(until_ns)).max(left + MIN_WIDTH);
            let columns = Rangef::new(left, right).intersection(lane.x_range());
            let cell = Rect::from_x_y_ranges(columns, Rangef::new(top, top + ROW_HEIGHT - 1.0));
            (columns.span() > 0.0).then_some((finding, cell))
        })
    }

    /// Paints the intervals with their names.
    pub(super) fn paint(&mut self, painter: &Painter, theme: &Theme, area: &PlotArea) {
        self.rect = Some(area.rect);
        for (finding, cell) in self.shown(area, area.rect) {
            let color = if finding.trust == Trust::NotUsable { theme.error } else { theme.warn };
            painter.rect_filled(cell, 2.0, color.gamma_multiply(0.3));
            painter.vline(cell.left() + 1.0, cell.y_range(), Stroke::new(2.0, color));
            if cell.width() < MIN_NAMED_WIDTH {
                continue;
            }
            let mut job =
                LayoutJob::simple_singleline(finding.statement.clone(), theme::label_font(), theme.text_strong);
            job.wrap = TextWrapping::truncate_at_width(cell.width() - 8.0);
            let galley = painter.layout_job(job);
            let place = pos2(cell.left() + 5.0, cell.center().y - 0.5 * galley.size().y);
            painter.galley(place, galley, theme.text_strong);
        }
    }

    /// A click on an interval shows what its finding is about, from its start on.
    pub(super) fn clicks_ui(&self, ui: &Ui, ctx: &mut PanelContext<'_>, area: &PlotArea) {
        let Some(lane) = self.rect else { return };
        for (number, (finding, cell)) in self.shown(area, lane).enumerate() {
            let (sense, role) = ctx.presentation.clickable(Role::Label);
            let response = ui.interact(cell, ui.unique_id().with(("finding", number)), sense);
            let time = findings::time_of(finding).unwrap_or_else(|| "in the whole run".to_owned());
            response.widget_info(|| WidgetInfo::labeled(role, true, format!("Finding {time}: {}", finding.statement)));
            if response.has_focus() {
                let stroke = Stroke::new(1.5, ctx.theme.accent);
                ui.painter_at(lane.expand(2.0)).rect_stroke(cell, 2.0, stroke, egui::StrokeKind::Outside);
            }
            if response.clicked() {
                findings::show(ctx, finding);
            }
            if response.contains_pointer() {
                offer(ui, findings::text_of(finding));
            }
            response.on_hover_text(findings::text_of(finding));
        }
    }
}

/// Row of each finding: the first one in which no interval of an earlier finding overlaps.
fn rows(findings: &[RunFinding], duration_ns: i64) -> Vec<Option<usize>> {
    let least_ns = duration_ns / LEAST_PARTS;
    let mut taken: Vec<Vec<(i64, i64)>> = vec![Vec::new(); MAX_ROWS];
    let mut place = |finding: &RunFinding| {
        let since_ns = finding.since_ns.unwrap_or(i64::MIN);
        let until_ns = finding.until_ns.unwrap_or(i64::MAX).max(since_ns.saturating_add(least_ns));
        let is_free = |row: &Vec<(i64, i64)>| row.iter().all(|(from, to)| *to <= since_ns || until_ns <= *from);
        let row = taken.iter().position(is_free)?;
        taken[row].push((since_ns, until_ns));
        Some(row)
    };
    findings.iter().map(&mut place).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::faults::{Area, Severity};
    use crate::gui::rendering::headless::{HeadlessOptions, draw};
    use crate::gui::samples::{sample_images, sample_recording};
    use crate::gui::tests::{keep_screenshot, with_context};
    use crate::gui::theme::ThemeName;
    use crate::gui::timeline::TimelinePanel;
    use crate::gui::{Panel as _, Selection};
    use crate::log_check::{Basis, Finding, FindingInterval};
    use crate::session::{FindingSource, Recording};
    use crate::text::Named as _;

    fn finding(severity: Severity, title: &str, times: [Option<f64>; 2]) -> Finding {
        Finding {
            severity,
            area: Area::Images,
            title: title.to_owned(),
            evidence: "3 of 7 images".to_owned(),
            remedy: "add light".to_owned(),
            interval: FindingInterval { since_s: times[0], until_s: times[1] },
            basis: Basis::Measured,
            faults: Vec::new(),
        }
    }

    fn with_findings(recording: Recording) -> Recording {
        let found = [
            finding(Severity::Error, "stamps of cam0 run backwards", [Some(2.0), Some(4.5)]),
            finding(Severity::Warning, "some images of cam0 are blurred", [Some(1.0), Some(1.01)]),
            finding(Severity::Warning, "cam0 has gaps", [Some(3.0), None]),
            finding(Severity::Warning, "cam0 is underexposed", [None, None]),
        ];
        Recording { check: Some(Arc::new(found.to_vec())), ..recording }
    }

    #[test]
    fn overlapping_findings_have_rows_of_their_own() {
        let of = |times: [Option<i64>; 2]| RunFinding {
            trust: Trust::Doubtful,
            source: FindingSource::Residuals,
            statement: String::new(),
            evidence: String::new(),
            remedy: String::new(),
            since_ns: times[0],
            until_ns: times[1],
            checked: None,
            cause: None,
        };
        let found = [[Some(20), Some(40)], [Some(60), Some(61)], [Some(30), None], [None; 2], [None; 2], [None; 2]];
        assert_eq!(rows(&found.map(of), 100), [Some(0), Some(0), Some(1), Some(2), Some(3), None]);
    }

    #[test]
    fn the_lane_is_drawn_with_findings_only() {
        let sound = sample_recording();
        let faulty = with_findings(sound.clone());
        for (name, size_px) in [(ThemeName::Dark, [1600, 320]), (ThemeName::Light, [900, 260])] {
            let options = HeadlessOptions { size_px, pixels_per_point: 1.0, theme: name };
            let theme = Theme::of(name);
            let screenshot = |recording: &Recording| {
                let mut panel = TimelinePanel::default();
                draw(options, |ui| {
                    theme.apply(ui.ctx());
                    let (mut images, mut selection) = (sample_images(), Selection::default());
                    with_context(recording, 1_000_000_000, &mut images, &mut selection, &theme, |ctx| {
                        panel.ui(ui, ctx);
                    });
                })
            };
            let drawn = screenshot(&faulty);
            keep_screenshot(&format!("timeline-findings-{}", name.name()), &drawn);
            assert!(drawn != screenshot(&sound), "the findings are shown");
        }
    }
}
