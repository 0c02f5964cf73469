//! The buttons above the lanes: play, pause, step, seek.

use egui::{Button, ComboBox, RichText, TextStyle, Ui, vec2};

use super::pace::PaceReading;
use crate::gui::PanelContext;
use crate::gui::help::terms::window;
use crate::gui::units::{fixed, seconds};
use crate::session::{Command, PlaybackSpeed, RunRecord};

/// Height of the row of buttons in points.
pub(super) const HEIGHT: f32 = 26.0;

/// Selectable speeds in log seconds per second.
pub(crate) const SPEEDS: [f64; 7] = [0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 10.0];

/// The next higher or lower selectable speed; `None` at the end of the list.
pub(crate) fn next_speed(speed: f64, faster: bool) -> Option<f64> {
    if faster {
        SPEEDS.into_iter().find(|other| *other > speed)
    } else {
        SPEEDS.into_iter().rev().find(|other| *other < speed)
    }
}

/// Draws the buttons, the time, and the progress of the estimation; a figure has only the time.
pub(super) fn ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, pace: Option<PaceReading>) {
    ui.horizontal(|ui| {
        ui.set_height(HEIGHT - 4.0);
        ui.spacing_mut().item_spacing.x = 3.0;
        if ctx.presentation.is_figure() {
            time_ui(ui, ctx);
            return;
        }
        let playing = ctx.playback.playing;
        let (icon, name) = if playing { ("⏸", "Pause") } else { ("▶", "Play") };
        let buttons = [
            ("⏮", "Go to start", "Home", Command::GoToStart),
            ("⏪", "Previous event", "Ctrl+Left", Command::JumpToEvent { forward: false }),
            ("◀", "Step back", "Left", Command::StepFrames(-1)),
            (icon, name, "Space", Command::TogglePlay),
            ("▶|", "Step", "Right", Command::StepFrames(1)),
            ("⏩", "Next event", "Ctrl+Right", Command::JumpToEvent { forward: true }),
            ("⏭", "Go to end", "End", Command::GoToEnd),
        ];
        for (icon, name, keys, command) in buttons {
            if icon_button(ui, icon, name, keys, name == "Pause") {
                ctx.commands.push(command);
            }
        }
        ui.add_space(4.0);
        speed_ui(ui, ctx);
        loop_ui(ui, ctx);
        let marked = ctx.playback.markers.at(ctx.cursor_ns).is_some();
        if icon_button(ui, "⚑", "Marker", "M; names: Shift+M", marked) {
            ctx.commands.push(Command::ToggleMarker);
        }
        ui.add_space(8.0);
        time_ui(ui, ctx);
        ui.add_space(12.0);
        if let Some(pace) = pace {
            pace_ui(ui, ctx, pace);
        }
        progress_ui(ui, ctx);
    });
}

fn icon_button(ui: &mut Ui, icon: &str, name: &str, keys: &str, on: bool) -> bool {
    let response = ui.add(Button::new(icon).selected(on).min_size(vec2(26.0, 20.0)));
    response.widget_info(|| egui::WidgetInfo::selected(egui::Role::Button, true, on, name));
    response.on_hover_text(format!("{name} ({keys})")).clicked()
}

fn speed_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>) {
    let text = |speed: f64| format!("{speed}×");
    let combo = ComboBox::from_id_salt("speed").width(52.0).selected_text(text(ctx.playback.speed));
    let response = combo.show_ui(ui, |ui| {
        for speed in SPEEDS {
            if ui.selectable_label(ctx.playback.speed == speed, text(speed)).clicked() {
                ctx.commands.push(Command::SetSpeed(PlaybackSpeed(speed)));
            }
        }
    });
    response.response.on_hover_text("Playback speed, log seconds per second ([ slower, ] faster)");
}

fn loop_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>) {
    let on = ctx.playback.loop_range_ns.is_some();
    if icon_button(ui, "🔁", "Loop", "L; loop range: Shift+drag on the lanes", on) {
        ctx.commands.push(toggled_loop(ctx));
    }
}

/// Ends the loop, or starts one over the visible range.
pub(crate) fn toggled_loop(ctx: &PanelContext<'_>) -> Command {
    let range = ctx.playback.loop_range_ns.is_none().then(|| crate::gui::plot::visible_range(ctx));
    Command::SetLoop(range)
}

/// The time at the cursor, the length of the log, and the index of the frame.
fn time_ui(ui: &mut Ui, ctx: &PanelContext<'_>) {
    let theme = ctx.theme;
    let cursor = RichText::new(format!("{} s", seconds(ctx.cursor_ns))).monospace().size(14.0);
    ui.label(cursor.color(theme.text_strong)).on_hover_text(window::CURSOR.meaning);
    ui.add_space(5.0);
    let duration = RichText::new(format!("of {} s", seconds(ctx.recording.duration_ns))).monospace();
    ui.label(duration.color(theme.text_weak)).on_hover_text(window::DURATION.meaning);
    let run = ctx.selected_run();
    if let Some(step) = run.and_then(|run| run.step_at(ctx.cursor_ns)) {
        ui.add_space(8.0);
        ui.label(RichText::new("frame").color(theme.text_weak)).on_hover_text(window::FRAME.meaning);
        let number = RichText::new(step.report.frame_name()).monospace().color(theme.text_strong);
        ui.label(number).on_hover_text(window::FRAME.meaning);
    }
    if ctx.playback.solver.is_some()
        && let Some(run) = run
    {
        solver_ui(ui, ctx, run);
    }
    if ctx.playback.recomputing {
        ui.label(RichText::new("recomputing…").color(theme.text_weak))
            .on_hover_text("Details of this step are recomputed from the nearest estimator snapshot");
    }
}

/// Shows the displayed solver iteration and the result of the last iteration.
fn solver_ui(ui: &mut Ui, ctx: &PanelContext<'_>, run: &RunRecord) {
    let theme = ctx.theme;
    ui.add_space(8.0);
    ui.label(RichText::new("iteration").color(theme.text_weak));
    let Some(trace) = &run.trace else {
        ui.label(RichText::new("…").color(theme.text_weak));
        return;
    };
    let text = format!("{} of {}", trace.at, trace.iterations());
    ui.label(RichText::new(text).monospace().color(theme.warn))
        .on_hover_text("Panels show the window after this solver iteration (keys: , and .)");
    if let Some(iteration) = trace.shown().and_then(|state| state.report.iterations.last()) {
        let (before, after) = (fixed(iteration.cost_before, 2), fixed(iteration.cost_after, 2));
        let taken = if iteration.accepted { "" } else { ", rejected" };
        let cost = RichText::new(format!("cost {before} → {after}{taken}")).monospace().color(theme.text);
        ui.label(cost).on_hover_text(window::COST.meaning);
    }
}

/// Shows the frame rate, and a warning when the cursor is slower than the set speed. The cursor is then limited by the
/// estimator: slow drawing only skips frames.
fn pace_ui(ui: &mut Ui, ctx: &PanelContext<'_>, pace: PaceReading) {
    /// Ratio of the set speed below which the cursor counts as slow.
    const LATE_RATIO: f64 = 0.9;
    let theme = ctx.theme;
    let text = format!("{} fps", fixed(pace.fps, 0));
    ui.label(RichText::new(text).color(theme.text_weak)).on_hover_text("Rendered frames per second during playback");
    if pace.speed < LATE_RATIO * ctx.playback.speed {
        let text = format!("⚠ {}×, estimator behind", fixed(pace.speed, 2));
        ui.label(RichText::new(text).color(theme.warn))
            .on_hover_text("Achieved playback speed: the cursor waits for the estimator");
    }
    ui.add_space(8.0);
}

/// The progress of each run, until all are finished.
fn progress_ui(ui: &mut Ui, ctx: &PanelContext<'_>) {
    let theme = ctx.theme;
    let lines: Vec<(usize, [String; 3])> = ctx
        .recording
        .runs
        .iter()
        .enumerate()
        .filter(|(_, run)| !run.finished)
        .map(|(number, run)| {
            let computed_ns = run.reached_ns();
            let percent = fixed(100.0 * run.computed_fraction(ctx.recording.duration_ns), 0);
            let (label, computed_s) = (&run.spec.label, fixed(computed_ns as f64 * 1e-9, 1));
            if ctx.recording.is_being_written {
                let behind = fixed(run.behind_s(ctx.recording.duration_ns), 1);
                let long = format!("{label} computed to {computed_s} s, {behind} s behind the log");
                return (number, [long, format!("{label} {behind} s behind"), format!("{behind} s")]);
            }
            let long = format!("{label} {}computed to {computed_s} s ({percent} %)", run.pass_text());
            (number, [long, format!("{label} {percent} %"), format!("{percent} %")])
        })
        .collect();
    // The longest variant in which the lines of all runs fit.
    let font = TextStyle::Body.resolve(ui.style());
    let width = |text: &String| ui.painter().layout_no_wrap(text.clone(), font.clone(), theme.text).size().x + 8.0;
    let fits = |form: usize| lines.iter().map(|(_, texts)| width(&texts[form])).sum::<f32>() <= ui.available_width();
    let form = (0..2).find(|form| fits(*form)).unwrap_or(2);
    for (number, texts) in &lines {
        let text = RichText::new(&texts[form]).color(theme.run(*number).color);
        ui.label(text).on_hover_text(&texts[0]);
    }
}
