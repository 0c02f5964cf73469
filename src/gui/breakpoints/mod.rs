//! Breakpoints panel: conditions on the steps, their hit counts, and buttons to go to the next hit.

use egui::{Button, CollapsingHeader, Grid, Key, RichText, ScrollArea, TextEdit, Ui, WidgetInfo};

use super::units::counted;
use super::{CsvTable, Panel, PanelContext};
use crate::session::breakpoints::{Breakpoint, Condition, quantity_help};
use crate::session::{Command, Recording, RunRecord};
use crate::table::{Column, Stamp, csv};
use crate::text::nearest_name;

#[derive(Debug, Default)]
pub struct BreakpointsPanel {
    typed: String,
    /// Index of the breakpoint whose condition is being edited.
    changing: Option<usize>,
}

impl CsvTable for BreakpointsPanel {
    /// Every hit of every breakpoint, by breakpoint and run.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        type HitColumn<'a> = Column<'a, (&'a Breakpoint, &'a RunRecord, i64)>;
        let columns = [
            HitColumn::new("condition", |(breakpoint, ..)| breakpoint.condition.text().to_owned()),
            HitColumn::new("enabled", |(breakpoint, ..)| breakpoint.enabled),
            HitColumn::new("run", |(_, run, _)| run.spec.label.as_str()),
            HitColumn::new("t_s", |(.., stamp_ns)| Stamp(*stamp_ns)),
        ];
        let (breakpoints, runs) = (ctx.playback.breakpoints.list(), &ctx.recording.runs);
        let pairs = breakpoints.iter().flat_map(|breakpoint| runs.iter().map(move |run| (breakpoint, run)));
        let hits = pairs.flat_map(|(breakpoint, run)| breakpoint.hits_ns(run).map(move |at| (breakpoint, run, at)));
        csv(&columns, hits)
    }
}

impl Panel for BreakpointsPanel {
    fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        let figure = ctx.presentation.is_figure();
        if !figure {
            buttons_ui(ui, ctx);
            self.editor_ui(ui, ctx);
            ui.add_space(4.0);
        }
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            let breakpoints = std::sync::Arc::clone(&ctx.playback.breakpoints);
            for (number, breakpoint) in breakpoints.list().iter().enumerate() {
                self.breakpoint_ui(ui, ctx, number, breakpoint);
            }
            if breakpoints.list().is_empty() {
                let hint = "No breakpoints: type a condition, or press B to set one at this frame";
                let text = if figure { "No breakpoints" } else { hint };
                ui.add(egui::Label::new(RichText::new(text).color(ctx.theme.text_weak)).wrap());
            }
            if !figure {
                help_ui(ui, ctx);
            }
        });
    }
}

impl BreakpointsPanel {
    /// The input line for a condition with its syntax error.
    fn editor_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        let parsed: Result<Condition, _> = self.typed.parse();
        let names = parsed.as_ref().map_or_else(|_| Names::default(), |condition| Names::of(condition, ctx.recording));
        let usable = parsed.is_ok() && names.unknown.is_empty();
        ui.horizontal(|ui| {
            let hint = "rank < 18 or features < 40";
            let width = (ui.available_width() - 74.0).max(60.0);
            let edit = TextEdit::singleline(&mut self.typed).hint_text(hint).desired_width(width).code_editor();
            let edit = ui.add(edit);
            edit.widget_info(|| WidgetInfo::labeled(egui::Role::TextInput, true, "Condition"));
            let entered = edit.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
            let text = if self.changing.is_some() { "Change" } else { "Add" };
            let set = ui.add_enabled(usable, Button::new(text));
            set.widget_info(|| WidgetInfo::labeled(egui::Role::Button, usable, format!("{text} breakpoint")));
            if let (true, Ok(condition)) = (usable && (set.clicked() || entered), &parsed) {
                let condition = condition.clone();
                ctx.commands.push(match self.changing.take() {
                    Some(number) => Command::ChangeBreakpoint { number, condition },
                    None => Command::AddBreakpoint(condition),
                });
                self.typed.clear();
            }
        });
        for text in names.unknown {
            ui.add(egui::Label::new(RichText::new(text).color(ctx.theme.error)).wrap());
        }
        for text in names.absent {
            ui.add(egui::Label::new(RichText::new(text).color(ctx.theme.text_weak)).wrap());
        }
        if let Err(problem) = parsed
            && !self.typed.trim().is_empty()
        {
            // The text again, with a caret under the error.
            let pointed = format!("{}\n{}^", problem.text, " ".repeat(problem.column - 1));
            ui.label(RichText::new(pointed).monospace().color(ctx.theme.text_weak));
            let text = format!("Column {}: {}", problem.column, problem.message);
            ui.add(egui::Label::new(RichText::new(text).color(ctx.theme.error)).wrap());
        }
    }

    fn breakpoint_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, number: usize, breakpoint: &Breakpoint) {
        let theme = *ctx.theme;
        let text = breakpoint.condition.text();
        ui.horizontal(|ui| {
            let mut enabled = breakpoint.enabled;
            let name = RichText::new(text).monospace().color(theme.text_strong);
            // The buttons come first, so that they stay in the panel whatever its width and the number of runs.
            if !ctx.presentation.is_figure() {
                self.buttons_ui(ui, ctx, number, text);
            }
            if ctx.presentation.is_figure() {
                ui.label(name);
                if !enabled {
                    ui.label(RichText::new("disabled").small().color(theme.text_weak));
                }
            } else {
                let check = ui.checkbox(&mut enabled, name);
                if check.on_hover_text("Stop the cursor where the condition becomes true").changed() {
                    ctx.commands.push(Command::EnableBreakpoint { number, enabled });
                }
            }
        });
        ui.horizontal_wrapped(|ui| {
            for (run, record) in ctx.recording.runs.iter().enumerate() {
                let hits = counted(breakpoint.hit_count(record), "hit");
                let text = RichText::new(format!("{} {hits}", record.spec.label)).small().color(theme.run(run).color);
                ui.label(text).on_hover_text("Number of times that the condition became true in this run");
            }
        });
    }

    /// Buttons that change and remove a breakpoint with the text of its condition.
    fn buttons_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, number: usize, text: &str) {
        let small = |ui: &mut Ui, sign: &str, name: String| {
            let button = ui.add(Button::new(sign).small());
            button.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, &name));
            button.on_hover_text(name.clone()).clicked()
        };
        if small(ui, "edit", format!("Edit {text}")) {
            text.clone_into(&mut self.typed);
            self.changing = Some(number);
        }
        if small(ui, "x", format!("Remove {text}")) {
            ctx.commands.push(Command::RemoveBreakpoint(number));
            self.changing = None;
        }
    }
}

/// Messages about parameters and joints of a condition that no run has.
#[derive(Default)]
struct Names {
    /// Names that no run can have; the condition is refused.
    unknown: Vec<String>,
    /// Names that a run could have with other options.
    absent: Vec<String>,
}

impl Names {
    fn of(condition: &Condition, recording: &Recording) -> Self {
        let names = recording.rig.parameter_names();
        let parameters = recording.parameters();
        let (possible, impossible): (Vec<String>, Vec<String>) =
            condition.unknown_names(&names, &parameters).into_iter().partition(|name| names.parse(name).is_some());
        let known: Vec<String> = parameters.iter().map(|parameter| names.name(*parameter)).collect();
        let unknown = |name: &String| match nearest_name(name, known.iter().map(String::as_str)) {
            Some((_, near)) => format!("Unknown name '{name}'; did you mean '{near}'?"),
            None => format!("Unknown name '{name}'"),
        };
        let absent = |name: &String| format!("No run has '{name}': no hits unless a run estimates it");
        Self { unknown: impossible.iter().map(unknown).collect(), absent: possible.iter().map(absent).collect() }
    }
}

/// Buttons to the hits before and after the cursor.
fn buttons_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>) {
    ui.horizontal(|ui| {
        let any = ctx.playback.breakpoints.list().iter().any(|breakpoint| breakpoint.enabled);
        for (text, keys, forward) in [("Previous hit", "Shift+N", false), ("Next hit", "N", true)] {
            let button = ui.add_enabled(any, Button::new(text));
            if button.on_hover_text(format!("Run to this hit ({keys})")).clicked() {
                ctx.commands.push(Command::RunToBreakpoint { forward });
            }
        }
        if ctx.playback.running_to_breakpoint {
            ui.label(RichText::new("running to the next hit…").color(ctx.theme.text_weak));
        }
    });
}

/// The list of quantities for conditions.
fn help_ui(ui: &mut Ui, ctx: &PanelContext<'_>) {
    let theme = ctx.theme;
    let header = CollapsingHeader::new("Quantities and syntax").id_salt("quantities");
    header.show(ui, |ui| {
        let text = "Comparisons: < <= > >= == !=. Operators: and, or, not. Units of numbers: deg, mrad, mm, cm, px, %. \
                    A breakpoint is hit where its condition becomes true.";
        ui.add(egui::Label::new(RichText::new(text).color(theme.text_weak)).wrap());
        Grid::new("quantities").num_columns(2).show(ui, |ui| {
            for (name, meaning) in quantity_help() {
                let short = name.split('|').next().unwrap_or(&name);
                let short = if short == name { name.clone() } else { format!("{short})") };
                ui.label(RichText::new(short).monospace().color(theme.text_strong)).on_hover_text(&name);
                ui.label(RichText::new(meaning).color(theme.text));
                ui.end_row();
            }
        });
    });
}
