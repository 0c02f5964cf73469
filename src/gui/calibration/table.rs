//! Layout and painting of the calibration table: rows of wrapped texts, sorted by clicks on the headings.

use std::sync::Arc;

use egui::{Align2, Color32, FontId, Galley, Role, ScrollArea, Sense, Stroke, StrokeKind, Ui, WidgetInfo, pos2, vec2};

use super::order::{Order, SortColumn};
use crate::gui::PanelContext;
use crate::gui::determination::look_of;
use crate::gui::parameter_names::meaning_of;
use crate::gui::theme::{Theme, label_font, number_font};
use crate::gui::under_pointer::{Item, offer, offer_item};
use crate::gui::units::{Shown, fixed};
use crate::session::{Command, FlightParameter};
use crate::text::Named as _;

/// Gap between two columns in points.
const GAP: f32 = 12.0;
/// Space above and below the text of a row in points.
const PADDING: f32 = 2.0;
const HEADING_HEIGHT: f32 = 18.0;
/// Width of the scroll bar in points.
const SCROLL_BAR: f32 = 10.0;
/// Minimum width in points of the columns of reason and remedy; narrower, they are below the other columns.
const MIN_TEXT_WIDTH: f32 = 170.0;

/// Fraction of the room for the texts that the reason takes.
const REASON_FRACTION: f32 = 0.45;

/// Columns with their headings and meanings.
const COLUMNS: [(SortColumn, &str, &str); 7] = [
    (SortColumn::Parameter, "Parameter", "Click on a row: go to the start of the verdict and select the parameter"),
    (SortColumn::Value, "Value ± 1 σ", "Estimate at the end of the flight and its posterior standard deviation"),
    (SortColumn::Ratio, "σ / prior", "1: the flight adds nothing; 0.5: three quarters of the information come from it"),
    (SortColumn::Verdict, "Verdict", crate::observability::Determination::RULE),
    (SortColumn::Since, "Since", "Time from which the verdict holds without interruption until the end of the flight"),
    (
        SortColumn::Reason,
        "Why",
        "Cause; windows that inform the parameter less than a prior of 10° or 3 cm; largest posterior correlations",
    ),
    (
        SortColumn::Remedy,
        "What helps",
        "Motion, record or run that would improve the verdict, with its predicted effect on σ",
    ),
];
/// Number of columns without wrapped text.
const SHORT: usize = 5;

/// Places of the columns, relative to the left edge of the table.
struct Layout {
    lefts: [f32; COLUMNS.len()],
    /// Widths of reason and of remedy; `None` where both are below the other columns.
    text_widths: Option<[f32; 2]>,
    width: f32,
}

impl Layout {
    fn new(ui: &Ui, theme: &Theme, rows: &[&FlightParameter], width: f32) -> Self {
        let size = |text: String, font: FontId| ui.painter().layout_no_wrap(text, font, theme.text).size().x;
        let widths = std::array::from_fn::<f32, SHORT, _>(|column| {
            let cells = rows.iter().map(|row| {
                let (text, font, _) = cell(theme, row, column);
                size(text, font)
            });
            cells.fold(size(format!("{} ▼", COLUMNS[column].1), label_font()), f32::max)
        });
        let mut lefts = [0.0; COLUMNS.len()];
        let mut left = 4.0;
        for (column, width) in widths.into_iter().enumerate() {
            lefts[column] = left;
            left += width + GAP;
        }
        let room = width - left - GAP;
        let text_widths =
            (0.5 * room >= MIN_TEXT_WIDTH).then_some([REASON_FRACTION * room, (1.0 - REASON_FRACTION) * room]);
        (lefts[SHORT], lefts[SHORT + 1]) = (left, left + text_widths.map_or(0.0, |[reason, _]| reason) + GAP);
        Self { lefts, text_widths, width }
    }

    /// Wrapped texts of a row: reason and remedy with their places.
    fn texts(&self, ui: &Ui, theme: &Theme, row: &FlightParameter, waits: bool) -> Vec<(f32, f32, Arc<Galley>)> {
        let remedy = if row.remedy.is_empty() && row.cause.is_some() && waits { "computing…" } else { &row.remedy };
        let lay_out = |text: String, width: f32| ui.painter().layout(text, label_font(), theme.text, width);
        if let Some(widths) = self.text_widths {
            let texts = [row.reason.as_str(), remedy].into_iter().zip(widths).zip(&self.lefts[SHORT..]);
            return texts.map(|((text, width), left)| (*left, 0.0, lay_out(text.to_owned(), width))).collect();
        }
        let texts = [("Why: ", row.reason.as_str()), ("What helps: ", remedy)];
        let left = self.lefts[0] + GAP;
        let mut top = line_height(ui) + PADDING;
        let shown = texts.into_iter().filter(|(_, text)| !text.is_empty());
        shown
            .map(|(head, text)| {
                let galley = lay_out(format!("{head}{text}"), (self.width - left - GAP).max(40.0));
                let place = (left, top, Arc::clone(&galley));
                top += galley.size().y;
                place
            })
            .collect()
    }
}

fn line_height(ui: &Ui) -> f32 {
    ui.fonts_mut(|fonts| fonts.row_height(&label_font()))
}

/// Draws the table; `waits` is true while the suggested motions are being computed.
pub(super) fn ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, order: &mut Order, rows: &[&FlightParameter], waits: bool) {
    let theme = *ctx.theme;
    let layout = Layout::new(ui, &theme, rows, ui.available_width() - SCROLL_BAR);
    headings_ui(ui, ctx, &layout, order);
    if rows.is_empty() {
        ui.label(egui::RichText::new("No parameter contains this text").color(theme.text_weak));
    }
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.spacing_mut().item_spacing.y = 0.0;
        for (number, row) in rows.iter().enumerate() {
            row_ui(ui, ctx, &layout, row, number, waits);
        }
    });
}

fn headings_ui(ui: &mut Ui, ctx: &PanelContext<'_>, layout: &Layout, order: &mut Order) {
    let theme = ctx.theme;
    let (_, rect) = ui.allocate_space(vec2(ui.available_width(), HEADING_HEIGHT));
    let shown = if layout.text_widths.is_some() { COLUMNS.len() } else { SHORT };
    for (index, (column, title, meaning)) in COLUMNS.into_iter().enumerate().take(shown) {
        let sorted = order.column == column;
        let mark = match (sorted && !ctx.presentation.is_figure(), order.descending) {
            (false, _) => "",
            (true, false) => " ▲",
            (true, true) => " ▼",
        };
        let left = rect.left() + layout.lefts[index];
        let color = if sorted { theme.text_strong } else { theme.text_weak };
        let place = pos2(left, rect.center().y);
        let drawn = ui.painter().text(place, Align2::LEFT_CENTER, format!("{title}{mark}"), label_font(), color);
        let (sense, role) = ctx.presentation.clickable(Role::Label);
        let response = ui.interact(drawn.expand2(vec2(4.0, 2.0)), ui.unique_id().with(("heading", title)), sense);
        response.widget_info(|| WidgetInfo::selected(role, true, sorted, format!("Sort by {title}")));
        if response.clicked() {
            order.click(column);
        }
        response.on_hover_text(meaning);
    }
    ui.painter().hline(rect.x_range(), rect.bottom() - 1.0, Stroke::new(1.0, theme.outline));
}

/// Text, font and colour of a short cell.
fn cell(theme: &Theme, row: &FlightParameter, column: usize) -> (String, FontId, Color32) {
    let shown = Shown::of_parameter(row.parameter);
    let sigma = row.sigma.unwrap_or(f64::NAN);
    let number = |text: String| (text, number_font(), theme.text_strong);
    match COLUMNS[column].0 {
        SortColumn::Parameter => (row.name.clone(), label_font(), theme.text_strong),
        SortColumn::Value => {
            let value = shown.value(row.value, sigma);
            let value = value.strip_suffix(shown.unit).unwrap_or(&value);
            number(format!("{value} ± {}", shown.sigma(sigma)))
        }
        SortColumn::Ratio => number(row.ratio.map_or_else(String::new, |ratio| fixed(ratio, 3))),
        SortColumn::Verdict => {
            let (mark, color) = look_of(row.verdict, theme);
            (format!("{mark} {}", row.verdict.name()), label_font(), color)
        }
        SortColumn::Since => {
            let text = row.since_s().map_or_else(String::new, |since_s| format!("{} s", fixed(since_s, 2)));
            (text, number_font(), theme.accent)
        }
        SortColumn::Reason | SortColumn::Remedy => (String::new(), label_font(), theme.text),
    }
}

/// Draws a row; a click goes to the start of its verdict and selects its parameter.
fn row_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, layout: &Layout, row: &FlightParameter, number: usize, waits: bool) {
    let theme = *ctx.theme;
    let texts = layout.texts(ui, &theme, row, waits);
    let bottom = texts.iter().map(|(_, top, galley)| top + galley.size().y).fold(line_height(ui), f32::max);
    let (_, rect) = ui.allocate_space(vec2(ui.available_width(), bottom + 2.0 * PADDING));
    if !ui.is_rect_visible(rect) {
        return;
    }
    // A row that is cut off by the edge of the list takes no focus, and one that is focused moves into it.
    let visible = rect.intersect(ui.clip_rect());
    let (sense, role) = ctx.presentation.clickable(Role::Label);
    let sense = if visible.height() < line_height(ui) { Sense::hover() } else { sense };
    let selected = ctx.selection.parameter == Some(row.parameter);
    let response = ui.interact(visible, ui.unique_id().with(("calibration row", &row.name)), sense);
    if response.gained_focus() {
        ui.scroll_to_rect(rect, None);
    }
    let sentence = sentence(row);
    response.widget_info(|| WidgetInfo::selected(role, true, selected, &sentence));
    let painter = ui.painter_at(rect);
    if number % 2 == 1 {
        painter.rect_filled(rect, 0.0, theme.surface_raised.gamma_multiply(0.35));
    }
    let top = rect.top() + PADDING;
    for column in 0..SHORT {
        let (text, font, color) = cell(&theme, row, column);
        let color = if selected && column == 0 { theme.accent } else { color };
        painter.text(pos2(rect.left() + layout.lefts[column], top), Align2::LEFT_TOP, text, font, color);
    }
    for (left, offset, galley) in texts {
        painter.galley(pos2(rect.left() + left, top + offset), galley, theme.text);
    }
    if selected || response.hovered() {
        let stroke = Stroke::new(1.0, if selected { theme.accent } else { theme.outline });
        painter.rect_stroke(rect, 0.0, stroke, StrokeKind::Inside);
    }
    if response.hovered() {
        offer(ui, sentence);
        offer_item(ui, Item::Parameter(row.parameter));
    }
    if response.clicked() {
        ctx.selection.parameter = Some(row.parameter);
        ctx.commands.extend(row.since_ns.map(|stamp_ns| Command::Seek { stamp_ns }));
    }
    response.on_hover_text(format!("{}: {}", row.name, meaning_of(row.parameter, &ctx.recording.rig)));
}

/// The row as one text, for a screen reader and the clipboard.
fn sentence(row: &FlightParameter) -> String {
    let mut text = format!("{} {}", row.name, row.verdict_text());
    for part in [&row.reason, &row.remedy].into_iter().filter(|part| !part.is_empty()) {
        text.push_str("; ");
        text.push_str(part);
    }
    text
}
