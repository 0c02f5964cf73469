//! Tables of the accuracy of all runs and of their first divergences from the reference.

use egui::{Button, Grid, RichText, Ui, WidgetInfo, vec2};

use super::columns::{label_of, style_of};
use super::scores::Scores;
use crate::gui::PanelContext;
use crate::gui::help::terms::divergence;
use crate::gui::table::{aligned_rows, number_ui};
use crate::gui::theme::ROW_HEIGHT;
use crate::gui::units::{fixed, seconds, significant};
use crate::session::{Command, ComparedQuantity, Comparison, Divergence};
use crate::text::Named as _;

/// Factor from stored to shown unit, and the shown unit.
pub(super) fn shown(quantity: ComparedQuantity) -> (f64, &'static str) {
    match quantity {
        ComparedQuantity::ChainTranslation => (1e3, "mm"),
        ComparedQuantity::Attitude | ComparedQuantity::JointAngles | ComparedQuantity::ChainRotation => {
            (180.0 / std::f64::consts::PI, "°")
        }
        ComparedQuantity::GyroscopeBias => (180.0 / std::f64::consts::PI, "°/s"),
        other => (1.0, other.unit()),
    }
}

pub(super) fn difference_text(quantity: ComparedQuantity, apart: f64) -> String {
    let (factor, unit) = shown(quantity);
    let space = if unit.is_empty() || unit.starts_with('°') { "" } else { " " };
    let number = if unit.is_empty() { fixed(apart, 0) } else { significant(apart * factor) };
    format!("{number}{space}{unit}")
}

/// Tooltip of a trajectory of another program.
pub(in crate::gui) const POSES_ONLY: &str = "A trajectory has poses only: scene, timeline and comparison show it, panels of calibration, features and residuals do not";

/// Note below the heading of the accuracy if an offline calibration made the reference trajectory.
pub(super) const AGAINST_BATCH: &str = "Against the batch reference, not ground truth";

/// Accuracy of all runs and trajectories; the best value of a row is marked.
pub(super) fn accuracy_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, scores: &Scores) {
    let theme = *ctx.theme;
    let runs = &ctx.recording.runs;
    ui.label(RichText::new("Accuracy over all processed frames").color(theme.text_strong));
    if ctx.recording.truth_is_batch {
        ui.label(RichText::new(AGAINST_BATCH).color(theme.text_weak));
    }
    if scores.is_unfinished() {
        let text = "Runs are still computed: values of different lengths are not compared";
        ui.label(RichText::new(text).color(theme.text_weak));
    }
    let grid = Grid::new("accuracy").striped(true).min_row_height(ROW_HEIGHT).spacing(vec2(14.0, 2.0));
    grid.show(ui, |ui| {
        ui.label("");
        ui.label("");
        for (number, run) in runs.iter().enumerate() {
            let text = RichText::new(&run.spec.label).strong().color(theme.run(number).color);
            if ctx.presentation.is_figure() {
                ui.label(text);
                continue;
            }
            let chosen = ctx.selection.run == number;
            let button = ui.add(Button::new(text).frame(false).selected(chosen));
            button.widget_info(|| {
                let name = format!("Show run {} in all panels", run.spec.label);
                WidgetInfo::selected(egui::Role::Button, true, chosen, name)
            });
            if button.on_hover_text("Show this run in all panels").clicked() {
                ctx.selection.run = number;
            }
        }
        for (number, lane) in ctx.recording.trajectories.iter().enumerate() {
            let text = RichText::new(&lane.label).strong().color(theme.trajectory(number).color);
            ui.label(text).on_hover_text(format!("{}\n{POSES_ONLY}", lane.source));
        }
        ui.end_row();
        let rows: Vec<_> = scores.rows().into_iter().map(|row| (row.best(), row)).collect();
        let texts = rows.iter().map(|(best, row)| {
            let mark = |run| if *best == Some(run) { " ✔" } else { "" };
            (0..row.values.len()).map(|run| format!("{}{}", row.text(run), mark(run))).collect()
        });
        for ((best, row), texts) in rows.iter().zip(aligned_rows(texts.collect())) {
            ui.label(RichText::new(&row.name).color(theme.text)).on_hover_text(row.meaning);
            ui.label(RichText::new(row.unit).color(theme.text_weak)).on_hover_text(row.meaning);
            for (run, text) in texts.into_iter().enumerate() {
                let color = if *best == Some(run) { theme.ok } else { theme.text_strong };
                number_ui(ui, &text, color).on_hover_text(row.meaning);
            }
            ui.end_row();
        }
    });
    let evaluated = ctx.recording.trajectories.iter().any(|lane| lane.evaluation.accuracy.is_some());
    if !evaluated && !ctx.recording.runs.iter().any(|run| run.alignment.is_some()) {
        let text = "No trajectory errors: no ground truth in the log, or too few processed frames with ground truth";
        ui.label(RichText::new(text).color(theme.text_weak));
    }
}

/// Table of the first divergences of each run, with buttons that move the cursor there.
pub(super) fn divergences_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, reference: usize, comparisons: &[Comparison]) {
    let theme = *ctx.theme;
    let Some(base) = ctx.recording.runs.get(reference) else { return };
    for (number, comparison) in comparisons.iter().enumerate() {
        if number == reference {
            continue;
        }
        // A comparison with a trajectory has the stamps of the reference.
        let run = ctx.recording.runs.get(number).unwrap_or(base);
        let (own, other) = (label_of(ctx.recording, number), &base.spec.label);
        ui.horizontal_wrapped(|ui| {
            let text = RichText::new(format!("{own} vs. {other}")).strong();
            ui.label(text.color(style_of(ctx.recording, &theme, number).color));
            if comparison.stamps_ns.is_empty() {
                ui.label(RichText::new("no common frames").color(theme.text_weak));
            } else if comparison.first_exact().is_none() {
                ui.label(RichText::new("identical in all common frames").color(theme.ok));
            }
        });
        for (what, first) in [
            ("First bitwise difference", comparison.first_exact()),
            ("First notable divergence", comparison.first_notable()),
        ] {
            let Some((stamp_ns, quantity)) = first else { continue };
            ui.horizontal(|ui| {
                ui.label(RichText::new(format!("{what}: {} at", quantity.name())).color(theme.text));
                let name = format!("{what} of {own} from {other}");
                time_button(ui, ctx, Some(stamp_ns), &name);
                if let Some(frame) = run.index_at(stamp_ns).and_then(|step| run.steps.get(step)) {
                    let text = format!("frame {}", frame.report.frame_name());
                    ui.label(RichText::new(text).color(theme.text_weak));
                }
            });
        }
        if comparison.first_exact().is_some() {
            table_ui(ui, ctx, number, own, comparison);
        }
        ui.add_space(6.0);
    }
}

fn table_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, number: usize, own: &str, comparison: &Comparison) {
    let theme = *ctx.theme;
    let grid = Grid::new(("divergences", number)).striped(true).min_row_height(ROW_HEIGHT);
    grid.spacing(vec2(12.0, 2.0)).show(ui, |ui| {
        for term in [
            divergence::QUANTITY,
            divergence::EXACT,
            divergence::THRESHOLD,
            divergence::EXCEEDED,
            divergence::AT_CURSOR,
            divergence::MAXIMUM,
            divergence::AT,
        ] {
            ui.label(RichText::new(term.name).small().color(theme.text_weak)).on_hover_text(term.meaning);
        }
        ui.end_row();
        let found = ComparedQuantity::all().zip(&comparison.divergences).filter(|(_, it)| it.largest.is_some());
        let found: Vec<_> =
            found.map(|(quantity, it)| (quantity, it, comparison.at(quantity, ctx.cursor_ns))).collect();
        let texts = found.iter().map(|(quantity, divergence, apart)| {
            let largest = divergence.largest.map(|(largest, _)| largest);
            let text = |apart: Option<f64>| apart.map_or_else(|| "–".to_owned(), |it| difference_text(*quantity, it));
            vec![text(*apart), text(largest)]
        });
        let texts = aligned_rows(texts.collect());
        for ((quantity, divergence, apart), texts) in found.into_iter().zip(texts) {
            let Divergence { exact_ns, notable_ns, largest } = *divergence;
            let name = |what: &str| format!("{own}, {}: {what}", quantity.name());
            ui.label(RichText::new(quantity.name()).color(theme.text)).on_hover_text(quantity.meaning());
            time_button(ui, ctx, exact_ns, &name("first bitwise difference"));
            let tolerance = format!("≥ {}", difference_text(quantity, quantity.notable()));
            let tolerance = ui.label(RichText::new(tolerance).small().color(theme.text_weak));
            tolerance.on_hover_text(divergence::THRESHOLD.meaning);
            time_button(ui, ctx, notable_ns, &name("first difference above the threshold"));
            let is_notable = apart.is_some_and(|apart| apart >= quantity.notable());
            let color = if is_notable { theme.warn } else { theme.text_strong };
            number_ui(ui, &texts[0], color).on_hover_text(divergence::AT_CURSOR.meaning);
            number_ui(ui, &texts[1], theme.text_strong).on_hover_text(divergence::MAXIMUM.meaning);
            let largest_ns = largest.filter(|(largest, _)| *largest > 0.0).map(|(_, stamp_ns)| stamp_ns);
            time_button(ui, ctx, largest_ns, &name("maximum difference"));
            ui.end_row();
        }
    });
}

/// A stamp as a button that moves the cursor there, in a figure as text; a dash if there is no stamp.
fn time_button(ui: &mut Ui, ctx: &mut PanelContext<'_>, stamp_ns: Option<i64>, name: &str) {
    let Some(stamp_ns) = stamp_ns else {
        ui.label(RichText::new("–").color(ctx.theme.text_weak));
        return;
    };
    let text = format!("{} s", seconds(stamp_ns));
    if ctx.presentation.is_figure() {
        ui.label(RichText::new(text).monospace().color(ctx.theme.text_strong));
        return;
    }
    let button = ui.add(Button::new(RichText::new(&text).small().monospace()).small());
    button.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, format!("{name}: {text}")));
    if button.on_hover_text(format!("{name}; click: move the cursor there")).clicked() {
        ctx.commands.push(Command::Seek { stamp_ns });
    }
}
