//! Drawing of the blocks of a document.

use egui::{Align, Color32, FontId, Frame, Label, Layout, Link, RichText, Stroke, TextStyle, Ui, vec2};

use super::markdown::{MarkdownBlock, StyledText};
use crate::gui::theme::Theme;

/// Indentation of a list in points.
const INDENT: f32 = 18.0;
/// Gap between two columns of a table in points.
const COLUMN_GAP: f32 = 14.0;
/// Minimum width of a column that must be narrowed, in points.
const MIN_COLUMN_WIDTH: f32 = 70.0;
/// Sizes of headings by level in points.
const HEADING_SIZES: [f32; 3] = [20.0, 16.5, 14.0];

/// Draws a block and returns the clicked link.
pub(super) fn block_ui(ui: &mut Ui, theme: &Theme, block: &MarkdownBlock) -> Option<String> {
    match block {
        MarkdownBlock::Heading { level, spans, .. } => {
            let level = usize::from(*level).clamp(1, HEADING_SIZES.len());
            ui.add_space(if level == 1 { 2.0 } else { 8.0 });
            spans_ui(ui, theme, spans, Some(HEADING_SIZES[level - 1]))
        }
        MarkdownBlock::Paragraph { depth: 0, spans, .. } => spans_ui(ui, theme, spans, None),
        MarkdownBlock::Paragraph { depth, marker, spans } => {
            let item = ui.horizontal_top(|ui| {
                ui.add_space(INDENT * (*depth as f32 - 1.0));
                ui.spacing_mut().item_spacing.x = 0.0;
                ui.allocate_ui_with_layout(vec2(INDENT, 0.0), Layout::left_to_right(Align::Min), |ui| {
                    ui.set_width(INDENT);
                    ui.label(RichText::new(marker.as_deref().unwrap_or_default()).color(theme.text_weak));
                });
                ui.vertical(|ui| spans_ui(ui, theme, spans, None)).inner
            });
            item.inner
        }
        MarkdownBlock::Code(text) => {
            Frame::new().fill(theme.surface_raised).corner_radius(3).inner_margin(6).show(ui, |ui| {
                ui.set_width(ui.available_width());
                ui.add(Label::new(RichText::new(text).monospace().color(theme.text_strong)).wrap());
            });
            None
        }
        MarkdownBlock::Table(rows) => table_ui(ui, theme, rows),
    }
}

/// Draws a paragraph and returns the clicked link.
pub(super) fn spans_ui(ui: &mut Ui, theme: &Theme, spans: &[StyledText], heading: Option<f32>) -> Option<String> {
    let mut clicked = None;
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing = vec2(0.0, 1.0);
        for span in spans {
            let text = look_of(span, theme, heading);
            if let Some(link) = &span.link {
                if ui.add(Link::new(text)).clicked() {
                    clicked = Some(link.clone());
                }
            } else {
                ui.add(Label::new(text));
            }
        }
    });
    clicked
}

fn look_of(span: &StyledText, theme: &Theme, heading: Option<f32>) -> RichText {
    let mut text = RichText::new(&span.text);
    text = match (heading, span.strong, &span.link) {
        (Some(size), ..) => text.size(size).color(theme.text_strong),
        (None, _, Some(_)) => text.color(theme.accent),
        (None, true, None) => text.color(theme.text_strong),
        (None, false, None) => text.color(theme.text),
    };
    if span.emphasis {
        text = text.italics();
    }
    if span.code && heading.is_none() {
        text = text.monospace().background_color(theme.surface_raised);
    }
    text
}

fn table_ui(ui: &mut Ui, theme: &Theme, rows: &[Vec<Vec<StyledText>>]) -> Option<String> {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let mut natural = vec![0.0_f32; columns];
    for row in rows {
        for (width, cell) in natural.iter_mut().zip(row) {
            *width = width.max(width_of(ui, cell));
        }
    }
    let room = ui.available_width() - COLUMN_GAP * columns.saturating_sub(1) as f32;
    let widths = fitted(&natural, room);
    let mut clicked = None;
    for (number, row) in rows.iter().enumerate() {
        let line = ui.horizontal_top(|ui| {
            ui.spacing_mut().item_spacing.x = COLUMN_GAP;
            for (cell, width) in row.iter().zip(&widths) {
                let place = ui.allocate_ui_with_layout(vec2(*width, 0.0), Layout::top_down(Align::Min), |ui| {
                    ui.set_width(*width);
                    let strong: Vec<StyledText>;
                    let spans = if number == 0 {
                        strong = cell.iter().map(|span| StyledText { strong: true, ..span.clone() }).collect();
                        &strong
                    } else {
                        cell
                    };
                    spans_ui(ui, theme, spans, None)
                });
                clicked = place.inner.or_else(|| clicked.take());
            }
        });
        let (below, stroke) = (line.response.rect, Stroke::new(1.0, theme.outline));
        ui.painter().hline(ui.max_rect().x_range(), below.bottom() + 1.5, stroke);
    }
    clicked
}

/// Width of a cell without line breaks in points.
fn width_of(ui: &Ui, cell: &[StyledText]) -> f32 {
    let fonts = [TextStyle::Body, TextStyle::Monospace].map(|style| style.resolve(ui.style()));
    let width = |span: &StyledText| {
        let font: FontId = fonts[usize::from(span.code)].clone();
        ui.painter().layout_no_wrap(span.text.clone(), font, Color32::WHITE).size().x
    };
    // Rounding of each span must not break the line.
    cell.iter().map(|span| width(span).ceil()).sum::<f32>() + 1.0
}

/// Column widths that fit into the width `room`: narrow columns keep their width, the others share the rest.
fn fitted(natural: &[f32], room: f32) -> Vec<f32> {
    let (mut wide, mut left) = (natural.len(), room);
    let mut limit = f32::INFINITY;
    if natural.iter().sum::<f32>() > room {
        let mut sorted = natural.to_vec();
        sorted.sort_by(f32::total_cmp);
        for width in sorted {
            limit = (left / wide.max(1) as f32).max(MIN_COLUMN_WIDTH);
            if width > limit {
                break;
            }
            left -= width;
            wide -= 1;
        }
    }
    natural.iter().map(|width| width.min(limit)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_columns_share_the_room_that_narrow_ones_leave() {
        assert_eq!(fitted(&[100.0, 200.0], 400.0), [100.0, 200.0]);
        assert_eq!(fitted(&[100.0, 900.0], 400.0), [100.0, 300.0]);
        assert_eq!(fitted(&[100.0, 900.0, 800.0], 500.0), [100.0, 200.0, 200.0]);
        assert_eq!(fitted(&[300.0, 300.0], 60.0), [MIN_COLUMN_WIDTH, MIN_COLUMN_WIDTH]);
        assert!(fitted(&[], 60.0).is_empty());
    }
}
