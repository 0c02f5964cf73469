//! Tables on the screen, painted from the definitions of their columns: rows that can be selected, sorted by clicks on
//! the headings, with wrapped texts where there are some.

use std::sync::Arc;

use egui::{
    Align2, Color32, FontId, Galley, Grid, Painter, Rect, Response, RichText, Role, Sense, Stroke, StrokeKind, Ui,
    WidgetInfo, pos2, vec2,
};

use crate::gimbal::ParameterId;
use crate::gui::PanelContext;
use crate::gui::help::terms::Term;
use crate::gui::theme::{Theme, label_font, number_font};
use crate::gui::under_pointer::{Item, offer, offer_item};
use crate::table::{Column, Medium, Style, Tone, align_numbers};

/// Space above and below the text of a row in points.
const PADDING: f32 = 2.0;
/// Left edge of the first column in points.
const MARGIN: f32 = 4.0;
/// Minimum width in points of the columns with wrapped texts; narrower, their texts are below the other columns.
const MIN_TEXT_WIDTH: f32 = 170.0;
/// Fraction of the room for wrapped texts that the first of them takes.
const FIRST_TEXT_FRACTION: f32 = 0.45;
/// Width of a column with drawings in points.
const DRAWING_WIDTH: f32 = 60.0;

impl Theme {
    /// Colour of a text with this emphasis.
    pub(crate) fn tone(&self, tone: Tone) -> Color32 {
        match tone {
            Tone::Strong => self.text_strong,
            Tone::Plain => self.text,
            Tone::Weak => self.text_weak,
            Tone::Accent => self.accent,
            Tone::Good => self.ok,
            Tone::Caution => self.warn,
            Tone::Bad => self.error,
        }
    }
}

/// Column by which rows are sorted, and the direction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TableOrder {
    heading: String,
    descending: bool,
}

impl TableOrder {
    /// Order by the column with this heading, the largest value on top.
    pub(crate) fn descending(heading: &str) -> Self {
        Self { heading: heading.to_owned(), descending: true }
    }

    /// Sorts rows; equal ones keep their order.
    pub(crate) fn sort<Row>(&self, columns: &[Column<'_, Row>], rows: &mut [Row]) {
        let is_key = |column: &&Column<'_, Row>| column.heading(Medium::Screen) == Some(&*self.heading);
        if let Some(column) = columns.iter().find(is_key) {
            column.sort(rows, self.descending);
        }
    }

    /// Sorts by a clicked column, or reverses its order.
    fn click(&mut self, heading: &str, largest_first: bool) {
        let descending = if self.heading == heading { !self.descending } else { largest_first };
        *self = Self { heading: heading.to_owned(), descending };
    }
}

/// Properties of a row beside its cells.
pub(crate) struct TableRow {
    pub(crate) parameter: Option<ParameterId>,
    /// The row as one text, for a screen reader and the clipboard.
    pub(crate) sentence: String,
    /// Tooltip, empty for none.
    pub(crate) hint: String,
}

/// A table of calibration parameters that is ready to be painted.
pub(crate) struct TableUi<'t, 'c, Row> {
    columns: Vec<PlacedColumn<'t, 'c, Row>>,
    rows: &'t [Row],
    gap: f32,
    /// Width in points in which wrapped texts are laid out, and smallest width of a row.
    width: f32,
    min_width: f32,
}

/// A shown column with the texts of its cells by row.
struct PlacedColumn<'t, 'c, Row> {
    column: &'t Column<'c, Row>,
    texts: Vec<String>,
    /// Left edge, relative to the table, and width in points; `None` for wrapped texts below the row.
    place: Option<[f32; 2]>,
}

impl<'t, 'c, Row> TableUi<'t, 'c, Row> {
    /// Arranges the columns with `gap` points between them in `width` points; without wrapped texts they may need more.
    pub(crate) fn new(ui: &Ui, columns: &'t [Column<'c, Row>], rows: &'t [Row], gap: f32, width: f32) -> Self {
        let size = |text: String, font: FontId| ui.painter().layout_no_wrap(text, font, Color32::WHITE).size().x;
        let shown = columns.iter().filter(|column| column.is_shown(Medium::Screen, rows.iter()));
        let (wrapped, short): (Vec<_>, Vec<_>) = shown.partition(|column| column.style == Style::Wrapped);
        let sort_mark = if wrapped.is_empty() { "" } else { " ▼" };
        let mut left = MARGIN;
        let mut placed = Vec::new();
        let texts_of = |column: &Column<'_, Row>| -> Vec<String> {
            rows.iter().map(|row| column.shown_text(row, Medium::Screen)).collect()
        };
        for column in short {
            let heading = column.heading(Medium::Screen).unwrap_or_default();
            let mut texts = texts_of(column);
            if column.style == Style::Number {
                align_numbers(&mut texts);
            }
            let cells = texts.iter().map(|text| size(text.clone(), font_of(column.style)));
            let widest = cells.fold(size(format!("{heading}{sort_mark}"), label_font()), f32::max);
            let width = if column.style == Style::Drawing { DRAWING_WIDTH } else { widest };
            placed.push(PlacedColumn { column, texts, place: Some([left, width]) });
            left += width + gap;
        }
        let room = width - left - gap;
        let min_width = if wrapped.is_empty() { left } else { 0.0 };
        let is_beside = 0.5 * room >= MIN_TEXT_WIDTH;
        for (column, fraction) in wrapped.into_iter().zip([FIRST_TEXT_FRACTION, 1.0 - FIRST_TEXT_FRACTION]) {
            let place = is_beside.then_some([left, fraction * room]);
            placed.push(PlacedColumn { column, texts: texts_of(column), place });
            left += fraction * room + gap;
        }
        Self { columns: placed, rows, gap, width, min_width }
    }

    /// Draws the headings; with an order, a click sorts by the column.
    pub(crate) fn headings_ui(
        &self,
        ui: &mut Ui,
        ctx: &PanelContext<'_>,
        height: f32,
        mut order: Option<&mut TableOrder>,
    ) {
        let theme = ctx.theme;
        let (_, rect) = ui.allocate_space(vec2(self.min_width.max(ui.available_width()), height));
        for PlacedColumn { column, place, .. } in &self.columns {
            let (Some([left, _]), Some(heading)) = (place, column.heading(Medium::Screen)) else { continue };
            let sorted = order.as_deref().filter(|order| order.heading == heading);
            let mark = match sorted.filter(|_| !ctx.presentation.is_figure()) {
                None => "",
                Some(order) if order.descending => " ▼",
                Some(_) => " ▲",
            };
            let color = if sorted.is_some() { theme.text_strong } else { theme.text_weak };
            let place = pos2(rect.left() + left, rect.center().y);
            let drawn = ui.painter().text(place, Align2::LEFT_CENTER, format!("{heading}{mark}"), label_font(), color);
            if heading.is_empty() {
                continue;
            }
            let id = ui.unique_id().with(("heading", heading));
            if let Some(order) = &mut order {
                let (sense, role) = ctx.presentation.clickable(Role::Label);
                let response = ui.interact(drawn.expand2(vec2(4.0, 2.0)), id, sense);
                let is_sorted = order.heading == heading;
                response.widget_info(|| WidgetInfo::selected(role, true, is_sorted, format!("Sort by {heading}")));
                if response.clicked() {
                    order.click(heading, column.largest_first);
                }
                response.on_hover_text(&*column.meaning);
            } else {
                let response = ui.interact(drawn, id, Sense::hover());
                response.widget_info(|| WidgetInfo::labeled(Role::Label, true, heading));
                response.on_hover_text(&*column.meaning);
            }
        }
        ui.painter().hline(rect.x_range(), rect.bottom() - 1.0, Stroke::new(1.0, theme.outline));
    }

    /// Draws the rows; `draw` paints the cells of drawings. A click selects the parameter; returns the clicked row.
    pub(crate) fn rows_ui(
        &self,
        ui: &mut Ui,
        ctx: &mut PanelContext<'_>,
        properties: impl Fn(&Row) -> TableRow,
        draw: impl Fn(&Painter, Rect, &Row),
    ) -> Option<&'t Row> {
        let spacing = std::mem::take(&mut ui.spacing_mut().item_spacing.y);
        let mut clicked = None;
        for (number, row) in self.rows.iter().enumerate() {
            if self.row_ui(ui, ctx, row, number, &properties, &draw) {
                clicked = Some(row);
            }
        }
        ui.spacing_mut().item_spacing.y = spacing;
        clicked
    }

    fn row_ui(
        &self,
        ui: &mut Ui,
        ctx: &mut PanelContext<'_>,
        row: &Row,
        number: usize,
        properties: &impl Fn(&Row) -> TableRow,
        draw: &impl Fn(&Painter, Rect, &Row),
    ) -> bool {
        let theme = *ctx.theme;
        let line = ui.fonts_mut(|fonts| fonts.row_height(&label_font()));
        let texts = self.wrapped_texts(ui, &theme, number, line);
        let bottom = texts.iter().map(|(_, top, galley)| top + galley.size().y).fold(line, f32::max);
        let (_, rect) = ui.allocate_space(vec2(self.min_width.max(ui.available_width()), bottom + 2.0 * PADDING));
        if !ui.is_rect_visible(rect) {
            return false;
        }
        // A row that is cut off by the edge of the list takes no focus, and one that is focused moves into it.
        let visible = rect.intersect(ui.clip_rect());
        let (sense, role) = ctx.presentation.clickable(Role::Label);
        let sense = if visible.height() < line { Sense::hover() } else { sense };
        let TableRow { parameter, sentence, hint } = properties(row);
        let selected = parameter.is_some() && ctx.selection.parameter == parameter;
        let response = ui.interact(visible, ui.unique_id().with(("row", number)), sense);
        if response.gained_focus() {
            ui.scroll_to_rect(rect, None);
        }
        response.widget_info(|| WidgetInfo::selected(role, true, selected, &sentence));
        let painter = ui.painter_at(rect);
        if number % 2 == 1 {
            painter.rect_filled(rect, 0.0, theme.surface_raised.gamma_multiply(0.35));
        }
        let middle = rect.top() + PADDING + 0.5 * line;
        for (index, PlacedColumn { column, texts, place }) in self.columns.iter().enumerate() {
            let Some([left, width]) = place.map(|[left, width]| [rect.left() + left, width]) else { continue };
            match column.style {
                Style::Wrapped => {}
                Style::Drawing => {
                    let ys = rect.top() + 3.0..=rect.bottom() - 3.0;
                    draw(&painter, Rect::from_x_y_ranges(left..=left + width, ys), row);
                }
                Style::Label | Style::Number => {
                    let tone = if selected && index == 0 { Tone::Accent } else { column.shown_tone(row) };
                    let (text, font) = (&texts[number], font_of(column.style));
                    painter.text(pos2(left, middle), Align2::LEFT_CENTER, text, font, theme.tone(tone));
                }
            }
        }
        for (left, offset, galley) in texts {
            painter.galley(pos2(rect.left() + left, rect.top() + PADDING + offset), galley, theme.text);
        }
        if selected || response.hovered() {
            let stroke = Stroke::new(1.0, if selected { theme.accent } else { theme.outline });
            painter.rect_stroke(rect, 0.0, stroke, StrokeKind::Inside);
        }
        if response.hovered() {
            offer(ui, sentence);
            if let Some(parameter) = parameter {
                offer_item(ui, Item::Parameter(parameter));
            }
        }
        let clicked = response.clicked();
        if clicked {
            ctx.selection.parameter = parameter;
        }
        if !hint.is_empty() {
            response.on_hover_text(hint);
        }
        clicked
    }

    /// Wrapped texts of a row with their places: left edge, and top below the first line's.
    fn wrapped_texts(&self, ui: &Ui, theme: &Theme, row: usize, line: f32) -> Vec<(f32, f32, Arc<Galley>)> {
        let lay_out = |text: String, width: f32| ui.painter().layout(text, label_font(), theme.text, width);
        let mut top = line + PADDING;
        let mut texts = Vec::new();
        for placed in self.columns.iter().filter(|placed| placed.column.style == Style::Wrapped) {
            let PlacedColumn { column, texts: all, place } = placed;
            let text = all[row].clone();
            if let Some([left, width]) = place {
                texts.push((*left, 0.0, lay_out(text, *width)));
            } else if !text.is_empty() {
                let left = MARGIN + self.gap;
                let heading = column.heading(Medium::Screen).unwrap_or_default();
                let galley = lay_out(format!("{heading}: {text}"), (self.width - left - self.gap).max(40.0));
                texts.push((left, top, Arc::clone(&galley)));
                top += galley.size().y;
            }
        }
        texts
    }
}

fn font_of(style: Style) -> FontId {
    if style == Style::Number { number_font() } else { label_font() }
}

/// Rows with the numbers of each column aligned.
pub(crate) fn aligned_rows(mut rows: Vec<Vec<String>>) -> Vec<Vec<String>> {
    align_columns(rows.iter_mut());
    rows
}

/// Aligns the numbers of each column of some rows.
pub(crate) fn align_columns<'r>(rows: impl Iterator<Item = &'r mut Vec<String>>) {
    let mut rows: Vec<_> = rows.collect();
    for column in 0..rows.iter().map(|row| row.len()).max().unwrap_or(0) {
        align_numbers(rows.iter_mut().filter_map(|row| row.get_mut(column)));
    }
}

/// A grid of texts under headings, with aligned numbers; hovering a cell explains its column.
pub(crate) fn grid_ui(
    ui: &mut Ui,
    theme: &Theme,
    (salt, row_height): (&str, f32),
    headings: &[(String, Term)],
    rows: impl Iterator<Item = Vec<String>>,
) {
    Grid::new(salt).striped(true).spacing(vec2(9.0, 1.0)).min_row_height(row_height).show(ui, |ui| {
        for (heading, term) in headings {
            ui.label(RichText::new(heading).small().color(theme.text_weak)).on_hover_text(term.meaning);
        }
        ui.end_row();
        for row in aligned_rows(rows.collect()) {
            for (cell, (_, term)) in row.into_iter().zip(headings) {
                number_ui(ui, &cell, theme.text_strong).on_hover_text(term.meaning);
            }
            ui.end_row();
        }
    });
}

/// A text with aligned numbers; a screen reader gets it without the spaces in front.
pub(crate) fn number_ui(ui: &mut Ui, text: &str, color: Color32) -> Response {
    let label = ui.label(RichText::new(text).monospace().color(color));
    label.widget_info(|| WidgetInfo::labeled(Role::Label, true, text.trim_start()));
    label
}

/// Headings that are the names of the quantities.
pub(crate) fn named(terms: &[Term]) -> Vec<(String, Term)> {
    terms.iter().map(|term| (term.name.to_owned(), *term)).collect()
}
