//! Window of the sources: which of them agree, as a matrix, and the misfit of each pair over time.

use egui::{Align2, Id, Label, Pos2, Rect, RichText, ScrollArea, Sense, Stroke, StrokeKind, Ui, pos2, vec2};

use crate::gui::PanelContext;
use crate::gui::theme::{Theme, label_font, number_font};
use crate::gui::units::capitalized;
use crate::log_check::{AGREEING_MISFIT, Agreement, LARGEST_MISFIT, PairAgreement, Quantity};

/// Place and size of the window in points at first.
const DEFAULT_POSITION: [f32; 2] = [60.0, 110.0];
const WIDTH: f32 = 640.0;
const HEIGHT: f32 = 560.0;
/// Width of the names beside the matrix and the lanes, and size of a cell, in points.
const NAME_WIDTH: f32 = 240.0;
const CELL: [f32; 2] = [56.0, 24.0];

/// Draws the window. Returns true if it stays open.
pub(super) fn ui(ui: &Ui, ctx: &PanelContext<'_>) -> bool {
    let mut open = true;
    let window = egui::Window::new("Which sources agree")
        .id(Id::unique("sources"))
        .open(&mut open)
        .collapsible(false)
        .default_pos(DEFAULT_POSITION)
        .default_width(WIDTH);
    window.show(ui.ctx(), |ui| {
        ui.set_width(WIDTH);
        let agreement = &ctx.recording.agreement;
        if agreement.pairs.is_empty() {
            let text = if ctx.recording.is_being_checked {
                "The log is being checked."
            } else {
                "No two sources of this log measure one quantity, or it has not been checked."
            };
            return drop(ui.label(text));
        }
        ScrollArea::vertical().max_height(HEIGHT).show(ui, |ui| agreement_ui(ui, ctx, agreement));
    });
    open
}

fn agreement_ui(ui: &mut Ui, ctx: &PanelContext<'_>, agreement: &Agreement) {
    let theme = *ctx.theme;
    if agreement.isolated.is_empty() {
        ui.label(RichText::new("All sources agree.").color(theme.ok).strong());
    }
    for sentence in &agreement.isolated {
        ui.add(Label::new(RichText::new(capitalized(sentence)).color(theme.warn).strong()).wrap());
    }
    for quantity in [Quantity::Rotation, Quantity::SpecificForce, Quantity::Direction] {
        let pairs: Vec<&PairAgreement> = agreement.pairs.iter().filter(|pair| pair.quantity == quantity).collect();
        if pairs.is_empty() {
            continue;
        }
        ui.add_space(8.0);
        ui.label(RichText::new(title(quantity)).color(theme.text_strong).strong());
        if pairs.len() > 1 {
            matrix_ui(ui, &theme, &pairs);
            ui.add_space(4.0);
        }
        for pair in pairs {
            lane_ui(ui, ctx, &theme, pair);
        }
    }
    ui.add_space(4.0);
    let legend = format!(
        "Numbers: misfit in units of noise and tolerance, below {AGREEING_MISFIT:.1} of sources that agree, above {LARGEST_MISFIT:.1} of others. \
         Lanes: the same over time, with the cursor. A red pair with a green lane differs by a constant, which the sentence \
         names."
    );
    ui.add(Label::new(RichText::new(legend).color(theme.text_weak).small()).wrap());
}

fn title(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Rotation => "Rotation of the vehicle over 0.3 s",
        Quantity::SpecificForce => "Acceleration of the vehicle",
        Quantity::Direction => "Direction of the motion of a camera",
    }
}

/// Draws the pairs of one quantity as a matrix of its sources.
fn matrix_ui(ui: &mut Ui, theme: &Theme, pairs: &[&PairAgreement]) {
    let mut names: Vec<&String> = pairs.iter().flat_map(|pair| &pair.sources).collect();
    names.sort();
    names.dedup();
    let size = vec2(NAME_WIDTH + CELL[0] * names.len() as f32, CELL[1] * (names.len() + 1) as f32);
    let (rect, _) = ui.allocate_exact_size(size, Sense::hover());
    let cell = |column: usize, row: usize| {
        let corner = rect.min + vec2(NAME_WIDTH + CELL[0] * column as f32, CELL[1] * (row + 1) as f32);
        Rect::from_min_size(corner, CELL.into()).shrink(1.0)
    };
    let painter = ui.painter().clone();
    for (row, name) in names.iter().enumerate() {
        let left = pos2(rect.min.x, cell(0, row).center().y);
        let text = format!("{}  {name}", row + 1);
        painter.text(left, Align2::LEFT_CENTER, text, label_font(), theme.text);
        let above = pos2(cell(row, 0).center().x, rect.min.y + 0.5 * CELL[1]);
        painter.text(above, Align2::CENTER_CENTER, (row + 1).to_string(), label_font(), theme.text);
        for (column, other) in names.iter().enumerate() {
            let of_both = |pair: &&&PairAgreement| pair.sources.contains(name) && pair.sources.contains(other);
            let pair = pairs.iter().find(of_both).filter(|_| row != column);
            let color = pair.map_or(theme.surface_raised, |pair| if pair.agrees { theme.ok } else { theme.error });
            painter.rect_filled(cell(column, row), 2.0, color.gamma_multiply(if pair.is_some() { 0.45 } else { 1.0 }));
            if let Some(pair) = pair {
                let text = format!("{:.1}", pair.misfit);
                painter.text(cell(column, row).center(), Align2::CENTER_CENTER, text, number_font(), theme.text_strong);
                let id = ui.scope_id().with((row, column));
                ui.interact(cell(column, row), id, Sense::hover()).on_hover_text(text_of(pair));
            }
        }
    }
}

/// Draws the misfit of a pair over time.
fn lane_ui(ui: &mut Ui, ctx: &PanelContext<'_>, theme: &Theme, pair: &PairAgreement) {
    ui.horizontal(|ui| {
        let name = format!("{} – {}", short(&pair.sources[0]), short(&pair.sources[1]));
        let color = if pair.agrees { theme.text } else { theme.error };
        let label = Label::new(RichText::new(name).color(color)).truncate();
        ui.add_sized([NAME_WIDTH, CELL[1]], label).on_hover_text(text_of(pair));
        let width = (ui.available_width() - CELL[0]).max(CELL[0]);
        let (rect, lane) = ui.allocate_exact_size(vec2(width, CELL[1] - 4.0), Sense::hover());
        let duration_s = ctx.recording.duration_ns as f64 * 1e-9;
        let x = |time_s: f64| rect.min.x + rect.width() * (time_s / duration_s.max(1e-9)).clamp(0.0, 1.0) as f32;
        let painter = ui.painter();
        painter.rect_filled(rect, 2.0, theme.plot_background);
        let half_s = pair.bins.windows(2).map(|two| 0.5 * (two[1][0] - two[0][0])).fold(0.5, f64::min);
        for [time_s, misfit] in &pair.bins {
            let color = if *misfit < AGREEING_MISFIT {
                theme.ok
            } else if *misfit < LARGEST_MISFIT {
                theme.warn
            } else {
                theme.error
            };
            let bin = Rect::from_x_y_ranges(x(time_s - half_s)..=x(time_s + half_s), rect.y_range());
            painter.rect_filled(bin.shrink2(vec2(0.5, 2.0)), 0.0, color.gamma_multiply(0.7));
        }
        let cursor = x(ctx.cursor_ns as f64 * 1e-9);
        let ends: [Pos2; 2] = [pos2(cursor, rect.min.y), pos2(cursor, rect.max.y)];
        painter.line_segment(ends, Stroke::new(1.0, theme.cursor));
        painter.rect_stroke(rect, 2.0, Stroke::new(1.0, theme.outline), StrokeKind::Inside);
        lane.on_hover_text(text_of(pair));
        ui.label(RichText::new(format!("{:.1}", pair.misfit)).font(number_font()).color(color));
    });
}

/// Name of a source without its article.
fn short(name: &str) -> &str {
    name.strip_prefix("the ").unwrap_or(name)
}

fn text_of(pair: &PairAgreement) -> String {
    let [one, other] = &pair.sources;
    let verb = if pair.agrees { "agree" } else { "disagree" };
    let since = pair.interval.since_s.map_or_else(String::new, |since_s| format!(" from {since_s:.1} s on"));
    let until = pair.interval.until_s.map_or_else(String::new, |until_s| format!(" up to {until_s:.1} s"));
    let (unit, factor) = match pair.quantity {
        Quantity::Rotation | Quantity::Direction => ("°", 180.0 / std::f64::consts::PI),
        Quantity::SpecificForce => (" m/s²", 1.0),
    };
    let axes: Vec<String> = pair.by_axis.iter().map(|value| format!("{:.3}{unit}", value * factor)).collect();
    format!(
        "{one} and {other} {verb}{since}{until}\nmisfit {:.2} times the noise of {:.3}{unit}; by axis {}",
        pair.misfit,
        pair.noise * factor,
        axes.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use egui_kittest::kittest::Queryable as _;

    use crate::gui::Dialog;
    use crate::gui::window::tests::{bench_of, sample};
    use crate::log_check::{Agreement, FindingInterval, PairAgreement, Quantity};

    fn pair(sources: [&str; 2], misfit: f64, since_s: Option<f64>) -> PairAgreement {
        let bin = |second: i32| {
            let time_s = f64::from(second) + 0.5;
            [time_s, if since_s.is_some_and(|since_s| time_s > since_s) { 4.0 } else { 0.3 }]
        };
        PairAgreement {
            quantity: Quantity::Rotation,
            sources: sources.map(str::to_owned),
            agrees: since_s.is_none(),
            misfit,
            by_axis: vec![0.001, 0.002, 0.001],
            noise: 0.002,
            bins: (0..6).map(bin).collect(),
            interval: FindingInterval { since_s, until_s: None },
        }
    }

    #[test]
    fn the_matrix_names_the_sources_and_the_sentence_about_the_wrong_one() {
        let mut recording = sample();
        let sentence = "the gyroscope disagrees with the images of cam0 and the ground truth from 3.0 s on";
        recording.agreement = Arc::new(Agreement {
            pairs: vec![
                pair(["the gyroscope", "the images of cam0"], 3.1, Some(3.0)),
                pair(["the gyroscope", "the ground truth"], 4.2, Some(3.0)),
                pair(["the images of cam0", "the ground truth"], 0.3, None),
            ],
            isolated: vec![sentence.to_owned()],
        });
        let mut harness = bench_of(recording, [1600.0, 900.0]);
        harness.state_mut().window.dialogs.show(Dialog::Sources);
        harness.run_steps(3);
        assert!(harness.query_by_label(&format!("T{}", &sentence[1..])).is_some());
        assert!(harness.query_by_label("gyroscope – images of cam0").is_some());
        // Without a check nothing is claimed.
        let mut harness = bench_of(sample(), [1600.0, 900.0]);
        harness.state_mut().window.dialogs.show(Dialog::Sources);
        harness.run_steps(3);
        assert!(harness.query_by_label_contains("No two sources of this log").is_some());
    }
}
