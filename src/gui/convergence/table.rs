//! Table of the parameters that the flight determines up to the cursor.

use egui::{Color32, Grid, Label, RichText, ScrollArea, Ui, vec2};

use super::names::{meaning_of, part_of};
use crate::gui::PanelContext;
use crate::gui::copied_value::offer;
use crate::gui::help::terms::window;
use crate::gui::theme::Theme;
use crate::gui::units::{Shown, fixed};
use crate::observability::{Estimability, ParameterEstimability, count_of, estimability};
use crate::session::RunRecord;
use crate::text::Named as _;

const HEADS: [(&str, &str); 8] = [
    ("Parameter", "Click: select it in all panels"),
    ("Group", "Sensor or mechanism of the parameter"),
    ("Value", "Estimate at the cursor"),
    ("σ", "Posterior standard deviation"),
    ("Prior σ", "Standard deviation before the flight"),
    ("σ / prior", "1: the flight adds nothing; 0.5: three quarters of the information come from it"),
    ("Verdict", "Known: σ below 0.3 of the prior; not from this flight: σ of 0.9 of the prior or more"),
    (
        "Reason",
        "Null or weak direction of the last window that contains the parameter, with the others in it, or its largest \
         posterior correlation",
    ),
];

/// Draws the table of a run at the cursor.
pub(super) fn table_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, run: &RunRecord) {
    let theme = *ctx.theme;
    let names = ctx.names();
    let Some(index) = run.index_at(ctx.cursor_ns) else { return };
    let Some(estimate) = run.step(index).map(|step| &step.report.calibration) else { return };
    let rank = (0..=index).rev().find_map(|step| run.steps.get(step)?.rank.as_ref());
    let mut rows = estimability(estimate, rank, &names);
    rows.sort_by_key(|row| part_of(row.parameter));
    ui.label(RichText::new(summary(&rows)).color(theme.text_strong)).on_hover_text(window::CONVERGENCE.meaning);
    ScrollArea::both().auto_shrink(false).show(ui, |ui| {
        Grid::new("estimable parameters").striped(true).spacing(vec2(14.0, 1.0)).min_row_height(15.0).show(ui, |ui| {
            for (head, meaning) in HEADS {
                ui.label(RichText::new(head).color(theme.text_weak)).on_hover_text(meaning);
            }
            ui.end_row();
            for row in &rows {
                row_ui(ui, ctx, &theme, row, &names.name(row.parameter));
                ui.end_row();
            }
        });
    });
}

fn row_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, theme: &Theme, row: &ParameterEstimability, name: &str) {
    let shown = Shown::of_parameter(row.parameter);
    let selected = ctx.selection.parameter == Some(row.parameter);
    let meaning = meaning_of(row.parameter, &ctx.recording.rig);
    let label = ui.selectable_label(selected, name).on_hover_text(format!("{name}: {meaning}"));
    if label.clicked() {
        ctx.selection.parameter = if selected { None } else { Some(row.parameter) };
    }
    ui.label(RichText::new(row.parameter.group().name()).color(theme.text));
    let numbers = [
        shown.value(row.value, row.sigma),
        shown.sigma(row.sigma),
        shown.sigma(row.prior_sigma),
        fixed(row.ratio(), 3),
    ];
    for number in numbers {
        ui.label(RichText::new(number).monospace().color(theme.text_strong));
    }
    let (mark, color) = mark_of(row.estimability, theme);
    let verdict = format!("{mark} {}", row.estimability.name());
    if label.hovered() {
        offer(ui, format!("{name} {verdict} {}", row.reason));
    }
    ui.label(RichText::new(verdict).color(color));
    let reason = if row.reason.is_empty() { "–" } else { &row.reason };
    ui.add(Label::new(RichText::new(reason).color(theme.text)).extend());
}

/// Symbol and colour of a verdict; the symbol is unique without the colour.
fn mark_of(estimability: Estimability, theme: &Theme) -> (&'static str, Color32) {
    match estimability {
        Estimability::Known => ("✔", theme.ok),
        Estimability::Weak => ("⚠", theme.warn),
        Estimability::NotFromThisFlight => ("✖", theme.error),
        Estimability::Fixed | Estimability::Waiting => ("…", theme.text_weak),
    }
}

fn summary(rows: &[ParameterEstimability]) -> String {
    let verdicts = [
        Estimability::Known,
        Estimability::Weak,
        Estimability::NotFromThisFlight,
        Estimability::Fixed,
        Estimability::Waiting,
    ];
    let counts = verdicts.map(|verdict| (count_of(rows, verdict), verdict.name()));
    let counted: Vec<String> =
        counts.iter().filter(|(count, _)| *count > 0).map(|(count, name)| format!("{count} {name}")).collect();
    format!("{} parameters: {}", rows.len(), counted.join(", "))
}
