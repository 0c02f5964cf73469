//! Lane of the calibration parameters: verdict on each parameter over time, in one fixed order of rows.

use egui::{Align2, Painter, Rangef, Rect, Role, Ui, WidgetInfo, pos2, vec2};

use crate::gui::PanelContext;
use crate::gui::derived::flight::{DeterminationHistory, ParameterHistory};
use crate::gui::determination::{LEVELS, level_color, level_of, look_of};
use crate::gui::plot::PlotArea;
use crate::gui::theme::{self, Theme};
use crate::gui::under_pointer::{Item, offer_item};
use crate::gui::units::fixed;
use crate::observability::Determination;
use crate::text::Named as _;

/// Height in points of the heading above the rows of the open lane.
pub(super) const HEADING_HEIGHT: f32 = 16.0;
/// Height of a row of the open lane in points.
pub(super) const ROW_HEIGHT: f32 = 13.0;
/// Height of a row from which it has a name, in points.
const MIN_HEIGHT_WITH_NAME: f32 = 11.0;

/// Levels with the texts of the legend: from the best one to the worst.
const LEGEND: [(u8, &str); 5] = [
    (1, "determined by the flight"),
    (4, "given with the prior"),
    (6, "weakly determined, σ up to 3 × required"),
    (7, "not determined"),
    (LEVELS - 2, "redundant"),
];

/// Stretches of equal level on the screen, updated only when data, range or width changes.
#[derive(Debug, Default)]
pub(super) struct LevelMap {
    key: Option<(u64, u64, usize, i64, i64, u32)>,
    /// By row: ranges in points to the right of the lane's left edge, with their level.
    rows: Vec<Vec<(Rangef, u8)>>,
}

impl LevelMap {
    /// Updates the map to the history of the run with this id.
    pub(super) fn update(&mut self, area: &PlotArea, run: u64, history: &DeterminationHistory) {
        let width_px = area.rect.width().max(1.0) as u32;
        let key = (run, history.epoch, history.stamps_ns.len(), area.begin_ns, area.end_ns, width_px);
        if self.key == Some(key) {
            return;
        }
        self.key = Some(key);
        let left = area.rect.left();
        let last_ns = history.stamps_ns.last().copied().unwrap_or(i64::MIN);
        let steps: Vec<Option<usize>> = (0..width_px)
            .map(|column| {
                let stamp_ns = area.stamp_ns_at(left + column as f32 + 0.5);
                history.row_at(stamp_ns).filter(|_| stamp_ns <= last_ns)
            })
            .collect();
        self.rows = history.parameters.iter().map(|parameter| stretches(&steps, parameter)).collect();
    }
}

/// Adjacent pixel columns with the same level; level 0 is left out.
fn stretches(steps: &[Option<usize>], parameter: &ParameterHistory) -> Vec<(Rangef, u8)> {
    let level =
        |step: &Option<usize>| step.map_or(0, |step| level_of(parameter.verdicts[step], parameter.ratios[step]));
    let mut found: Vec<(Rangef, u8)> = Vec::new();
    for (column, level) in steps.iter().map(level).enumerate() {
        let range = Rangef::new(column as f32, column as f32 + 1.0);
        match found.last_mut() {
            Some((open, last)) if *last == level && open.max == range.min => open.max = range.max,
            _ if level > 0 => found.push((range, level)),
            _ => {}
        }
    }
    found
}

/// Vertical range of a row, on whole pixels.
fn row_range(rect: Rect, row: usize, rows: usize) -> Rangef {
    let edge = |row: usize| (rect.top() + rect.height() * row as f32 / rows.max(1) as f32).round();
    Rangef::new(edge(row), edge(row + 1))
}

/// Row of a history at a screen y; `None` outside.
pub(super) fn row_under(rect: Rect, y: f32, rows: usize) -> Option<usize> {
    (0..rows).find(|row| row_range(rect, *row, rows).contains(y))
}

/// Paints the rows into a rectangle.
pub(super) fn paint(painter: &Painter, theme: &Theme, rect: Rect, map: &LevelMap) {
    let count = map.rows.len();
    for (row, stretches) in map.rows.iter().enumerate() {
        let range = row_range(rect, row, count);
        let gap = if range.span() >= 6.0 { 1.0 } else { 0.0 };
        for (columns, level) in stretches {
            let columns = Rangef::new(rect.left() + columns.min, rect.left() + columns.max);
            let cell = Rect::from_x_y_ranges(columns, Rangef::new(range.min, range.max - gap));
            painter.rect_filled(cell, 0.0, level_color(*level, theme));
        }
    }
}

/// Paints the legend of the levels in the heading of the open lane.
pub(super) fn legend(painter: &Painter, theme: &Theme, heading: Rect, redundant: bool) {
    let mut left = heading.left() + 4.0;
    for (level, text) in LEGEND.into_iter().take(if redundant { LEGEND.len() } else { LEGEND.len() - 1 }) {
        let sample = Rect::from_min_size(pos2(left, heading.center().y - 4.0), vec2(12.0, 8.0));
        painter.rect_filled(sample, 0.0, level_color(level, theme));
        let place = sample.right_center() + vec2(4.0, 0.0);
        left = painter.text(place, Align2::LEFT_CENTER, text, theme::label_font(), theme.text_weak).right() + 12.0;
    }
}

/// Draws name, ratio and verdict at the cursor of each row to the left of the open lane; a click selects the parameter.
pub(super) fn labels_ui(ui: &Ui, ctx: &mut PanelContext<'_>, rect: Rect, history: &DeterminationHistory) {
    let (theme, names) = (*ctx.theme, ctx.names());
    let (painter, count) = (ui.painter_at(rect), history.parameters.len());
    let step = history.row_at(ctx.cursor_ns);
    for (row, parameter) in history.parameters.iter().enumerate() {
        let line = Rect::from_x_y_ranges(rect.x_range(), row_range(rect, row, count));
        let name = names.name(parameter.parameter);
        let verdict = step.map_or(Determination::Initializing, |step| parameter.verdicts[step]);
        let ratio = step.map_or(f64::NAN, |step| f64::from(parameter.ratios[step]));
        let selected = ctx.selection.parameter == Some(parameter.parameter);
        if line.height() >= MIN_HEIGHT_WITH_NAME {
            let color = if selected { theme.accent } else { theme.text };
            painter.text(line.left_center() + vec2(10.0, 0.0), Align2::LEFT_CENTER, &name, theme::label_font(), color);
            let (mark, color) = look_of(verdict, &theme);
            let text = format!("{mark} {}", fixed(ratio, 2));
            let place = line.right_center() - vec2(4.0, 0.0);
            painter.text(place, Align2::RIGHT_CENTER, text, theme::number_font(), color);
        }
        let (sense, role) = ctx.presentation.clickable(Role::Label);
        let response = ui.interact(line, ui.unique_id().with(("parameter of the lane", &name)), sense);
        let text = format!("{name}: {}, σ / required {}", verdict.name(), fixed(ratio, 2));
        response.widget_info(|| WidgetInfo::selected(role, true, selected, format!("{text} at the cursor")));
        if response.contains_pointer() {
            offer_item(ui, Item::Parameter(parameter.parameter));
        }
        if response.clicked() {
            ctx.selection.parameter = if selected { None } else { Some(parameter.parameter) };
        }
        response.on_hover_text(text);
    }
}

/// Width in points of the widest name with its ratio.
pub(super) fn label_width(ui: &Ui, ctx: &PanelContext<'_>, history: &DeterminationHistory) -> f32 {
    /// Indentation of the names, and room for mark and ratio.
    const REST: f32 = 60.0;
    let names = ctx.names();
    let width = |parameter: &ParameterHistory| {
        let name = names.name(parameter.parameter);
        ui.painter().layout_no_wrap(name, theme::label_font(), ctx.theme.text).size().x
    };
    history.parameters.iter().map(width).fold(0.0, f32::max) + REST
}

/// Text of the map under the pointer: parameter, verdict and ratio at a stamp.
pub(super) fn hover_text(
    ctx: &PanelContext<'_>,
    history: &DeterminationHistory,
    row: usize,
    stamp_ns: i64,
) -> Option<String> {
    let parameter = history.parameters.get(row)?;
    let step = history.row_at(stamp_ns)?;
    let name = ctx.names().name(parameter.parameter);
    let ratio = fixed(f64::from(parameter.ratios[step]), 3);
    Some(format!("{name}: {}, σ / required {ratio}", parameter.verdicts[step].name()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::sample_recording_of;

    #[test]
    fn the_map_has_the_verdicts_of_the_steps_in_a_fixed_order() {
        let recording = sample_recording_of(80, &["auto"]);
        let tables = crate::gui::Selection::default().flight;
        let (context, run) = (egui::Context::default(), &recording.runs[0]);
        let answer = crate::session::Answer::of_run(&recording, run);
        let whole = tables.report(&context, &recording, run, &answer).history;
        let rect = Rect::from_min_max(pos2(50.0, 10.0), pos2(850.0, 250.0));
        let area = PlotArea { rect, begin_ns: 0, end_ns: recording.last_stamp_ns(), low: 0.0, high: 1.0, middle: None };
        let mut map = LevelMap::default();
        map.update(&area, run.id, &whole);
        assert_eq!(map.rows.len(), whole.parameters.len());
        for (row, parameter) in map.rows.iter().zip(&whole.parameters) {
            assert!(row.len() < 60, "{} stretches", row.len());
            for (range, level) in row {
                let step = whole.row_at(area.stamp_ns_at(rect.left() + range.min + 0.5)).unwrap();
                assert_eq!(*level, level_of(parameter.verdicts[step], parameter.ratios[step]));
            }
            let (end, _) = row.last().expect("the parameter is estimated at the end");
            assert!(end.max > 795.0, "{end:?}");
        }
        // While the run is computed, the rows have the same order.
        let mut growing = run.clone();
        growing.steps.truncate(70);
        let part = crate::gui::Selection::default().flight.report(&context, &recording, &growing, &answer).history;
        let order = |history: &DeterminationHistory| -> Vec<_> {
            history.parameters.iter().map(|parameter| parameter.parameter).collect()
        };
        assert_eq!(order(&part), order(&whole));
        assert_eq!(row_under(rect, 11.0, 24), Some(0));
        assert_eq!(row_under(rect, 249.0, 24), Some(23));
        assert_eq!(row_under(rect, 251.0, 24), None);
    }
}
