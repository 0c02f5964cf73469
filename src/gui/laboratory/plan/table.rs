//! Table of σ: prior, this log, the motion alone and both, with the verdict on each parameter.

use egui::{Label, Rect, RichText, Stroke, StrokeKind, Ui, vec2};

use super::planned_run::FlightSoFar;
use crate::gui::PanelContext;
use crate::gui::determination::look_of;
use crate::gui::help::terms::window;
use crate::gui::table::{TableRow, TableUi};
use crate::gui::theme::Theme;
use crate::gui::units::fixed;
use crate::observability::Determination;
use crate::observability::laboratory::{MotionPrediction, PlannedRow, Situation};
use crate::text::Named as _;

const HEADING_HEIGHT: f32 = 17.0;
/// Gap between two columns in points.
const GAP: f32 = 8.0;

/// A prediction with the one before the last change of the motion.
pub(super) struct ShownPrediction<'a> {
    pub(super) situation: &'a Situation,
    pub(super) now: &'a MotionPrediction,
    pub(super) before: Option<&'a MotionPrediction>,
    pub(super) flight: Option<&'a FlightSoFar>,
}

/// Number of parameters in each verdict, and the least determined one, in a sentence per verdict.
pub(super) fn headline_ui(ui: &mut Ui, theme: &Theme, shown: &ShownPrediction<'_>) {
    let result = shown.now.result();
    let after = if shown.flight.is_some() { "After this log and the motion" } else { "After the motion" };
    let with = |verdict: Determination| {
        let names = result.parameters.iter().filter(|it| it.verdict == verdict).map(|it| it.name.as_str());
        names.collect::<Vec<_>>()
    };
    ui.horizontal_wrapped(|ui| {
        let mut is_open = false;
        for verdict in [Determination::NotDetermined, Determination::WeaklyDetermined] {
            let names = with(verdict);
            if !names.is_empty() {
                is_open = true;
                let (mark, color) = look_of(verdict, theme);
                let text = format!("{mark} {} {}: {}", names.len(), verdict.name(), names.join(", "));
                ui.add(Label::new(RichText::new(text).strong().color(color)).wrap());
            }
        }
        if !is_open {
            let (mark, color) = look_of(Determination::Determined, theme);
            let required = shown.situation.required.text_for(shown.situation.chain.parameters());
            ui.label(RichText::new(format!("{mark} every parameter within {required}")).strong().color(color));
        }
    });
    let text = format!(
        "{after}: largest σ / prior {} ({}), mean {}",
        fixed(result.worst_ratio, 3),
        result.worst,
        fixed(result.mean_ratio, 3)
    );
    ui.add(Label::new(RichText::new(text).color(theme.text)).wrap()).on_hover_text(window::PLAN_SIGMA.meaning);
}

/// Draws the table; it is wider than the room if its columns need that.
pub(super) fn ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, shown: &ShownPrediction<'_>) {
    let theme = *ctx.theme;
    let rows = PlannedRow::all(shown.now, shown.before);
    let columns = PlannedRow::columns(shown.flight.map_or_else(String::new, FlightSoFar::meaning));
    let table = TableUi::new(ui, &columns, &rows, GAP, ui.available_width());
    table.headings_ui(ui, ctx, HEADING_HEIGHT, None);
    let parameters = shown.situation.chain.parameters();
    let names: Vec<String> = parameters.iter().map(|parameter| shown.situation.names.name(*parameter)).collect();
    let properties = |row: &PlannedRow<'_>| TableRow {
        parameter: names.iter().position(|name| *name == row.last.name).map(|index| parameters[index]),
        sentence: row.sentence(),
        hint: String::new(),
    };
    table.rows_ui(ui, ctx, properties, |painter, rect, row| paint_bar(painter, &theme, rect, row));
}

/// Draws σ / prior from 0 to 1 with a line at the required accuracy, the value before the last change as an outline, and
/// the value of the log alone as a thin mark.
fn paint_bar(painter: &egui::Painter, theme: &Theme, rect: Rect, row: &PlannedRow<'_>) {
    let x = |ratio: f64| rect.left() + ratio.clamp(0.0, 1.0) as f32 * rect.width();
    let to = |ratio: f64| Rect::from_x_y_ranges(rect.left()..=x(ratio), rect.y_range());
    painter.rect_filled(rect, 0.0, theme.plot_background);
    let (_, color) = look_of(row.last.verdict, theme);
    painter.rect_filled(to(row.last.ratio), 0.0, color);
    if let Some(before) = row.ratio_before {
        painter.rect_stroke(to(before), 0.0, Stroke::new(1.0, theme.text), StrokeKind::Inside);
    }
    let required = row.last.required * row.last.ratio / row.last.sigma;
    if required < 1.0 {
        painter.vline(x(required), rect.y_range(), Stroke::new(1.0, theme.outline));
    }
    if let Some(flight) = row.flight {
        painter.vline(x(flight.ratio), rect.expand2(vec2(0.0, 2.0)).y_range(), Stroke::new(1.5, theme.text_strong));
    }
}
