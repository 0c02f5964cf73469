//! Messages for the user: a line in the status bar, toasts where there is none, a banner for stopped runs, a list of all
//! warnings.

use std::collections::VecDeque;

use egui::{Align2, Area, Button, Color32, Frame, Id, Margin, Order, Panel, RichText, ScrollArea, Ui, vec2};

use crate::gui::PanelContext;
use crate::gui::theme::{Theme, dialog_frame};
use crate::gui::units::seconds;
use crate::log_check::Trust;
use crate::session::Command;
use crate::session::warning_lines;

/// Severity of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoticeLevel {
    Info,
    /// A problem that does not stop the operation.
    Warning,
    Error,
}

/// Maximum number of messages that are kept for the list.
const MAX_KEPT: usize = 100;

impl NoticeLevel {
    /// Seconds for which a message is shown; the pointer on it holds it.
    const fn shown_s(self) -> f64 {
        match self {
            Self::Info => 8.0,
            Self::Warning => 12.0,
            Self::Error => 40.0,
        }
    }

    fn look(self, theme: &Theme) -> (&'static str, Color32) {
        match self {
            Self::Info => ("ℹ", theme.accent),
            Self::Warning => ("⚠", theme.warn),
            Self::Error => ("✖", theme.error),
        }
    }
}

#[derive(Debug)]
struct Toast {
    level: NoticeLevel,
    text: String,
    since_s: Option<f64>,
}

/// Messages on the screen.
#[derive(Debug, Default)]
pub struct Notices {
    toasts: Vec<Toast>,
    /// Messages so far, the newest last.
    kept: VecDeque<(NoticeLevel, String)>,
    /// True if the list of warnings is open.
    pub list_open: bool,
}

impl Notices {
    pub fn show_message(&mut self, level: NoticeLevel, text: impl Into<String>) {
        let text = text.into();
        if !self.toasts.iter().any(|toast| toast.text == text) {
            self.kept.push_back((level, text.clone()));
            if self.kept.len() > MAX_KEPT {
                self.kept.pop_front();
            }
            self.toasts.push(Toast { level, text, since_s: None });
        }
    }

    /// Shows a message that is no problem.
    pub fn inform(&mut self, text: impl Into<String>) {
        self.show_message(NoticeLevel::Info, text);
    }

    /// Shows the message of a success, after which earlier problems are of no interest any more, or the problem.
    pub fn report(&mut self, result: Result<String, String>) {
        match result {
            Ok(text) => {
                self.toasts.clear();
                self.inform(text);
            }
            Err(problem) => self.show_message(NoticeLevel::Error, problem),
        }
    }

    /// Removes the messages whose time is over; returns true if there are others.
    fn has_current(&mut self, ui: &Ui) -> bool {
        let now_s = ui.input(|input| input.time);
        for toast in &mut self.toasts {
            toast.since_s.get_or_insert(now_s);
        }
        self.toasts.retain(|toast| toast.since_s.is_none_or(|since_s| now_s - since_s < toast.level.shown_s()));
        if !self.toasts.is_empty() {
            ui.ctx().request_repaint_after(std::time::Duration::from_secs(1));
        }
        !self.toasts.is_empty()
    }

    /// A message is not taken away while it is read.
    fn hold(&mut self, ui: &Ui) {
        let now_s = ui.input(|input| input.time);
        for toast in &mut self.toasts {
            toast.since_s = Some(now_s);
        }
    }

    /// Draws the newest message from right to left in a line of the status bar, where it covers nothing, with the number of
    /// the others; a click on it opens the list.
    pub(super) fn line_ui(&mut self, ui: &mut Ui, theme: &Theme) {
        if self.list_open || !self.has_current(ui) {
            return;
        }
        let Some(Toast { level, text, .. }) = self.toasts.last() else { return };
        let (mark, color) = level.look(theme);
        let dismissed = dismiss_ui(ui);
        let others = self.toasts.len() - 1;
        let more = if others > 0 { format!(" (+{others})") } else { String::new() };
        let line = RichText::new(format!("{mark} {text}{more}")).color(color);
        let label = ui.add(egui::Label::new(line).truncate().sense(egui::Sense::click()));
        label.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Label, true, text));
        let label = label.on_hover_text(text.as_str());
        if dismissed {
            self.toasts.pop();
        } else if label.clicked() {
            self.list_open = true;
        } else if label.hovered() {
            self.hold(ui);
        }
    }

    /// Draws the messages low in a window without a status bar.
    pub(crate) fn toasts_ui(&mut self, ui: &Ui, theme: &Theme) {
        if !self.has_current(ui) {
            return;
        }
        let mut dismissed = None;
        let area =
            Area::new(Id::unique("notices")).order(Order::Foreground).anchor(Align2::RIGHT_BOTTOM, vec2(-12.0, -30.0));
        let shown = area.show(ui.ctx(), |ui| {
            for (number, toast) in self.toasts.iter().enumerate() {
                let (mark, color) = toast.level.look(theme);
                dialog_frame(theme).inner_margin(8).show(ui, |ui| {
                    ui.set_max_width(420.0);
                    ui.horizontal_top(|ui| {
                        ui.label(RichText::new(mark).color(color));
                        ui.add(egui::Label::new(RichText::new(&toast.text).color(theme.text_strong)).wrap());
                        if dismiss_ui(ui) {
                            dismissed = Some(number);
                        }
                    });
                });
            }
        });
        if let Some(number) = dismissed {
            self.toasts.remove(number);
        }
        if shown.response.contains_pointer() {
            self.hold(ui);
        }
    }

    /// True if a message is to be shown.
    pub(super) fn is_shown(&self) -> bool {
        !self.list_open && !self.toasts.is_empty()
    }

    /// Draws the list of warnings about the log and its runs; a click on a stamp moves the cursor there.
    pub(crate) fn list_ui(&mut self, ui: &Ui, ctx: &mut PanelContext<'_>) {
        let theme = *ctx.theme;
        let mut open = self.list_open;
        let window = egui::Window::new("Warnings").open(&mut open).collapsible(false).default_size(vec2(520.0, 260.0));
        window.anchor(Align2::RIGHT_BOTTOM, vec2(-16.0, -40.0)).show(ui.ctx(), |ui| {
            let warnings = warning_lines(ctx.recording);
            let answer = ctx.selected_run().map(|run| ctx.answer(run));
            let findings = answer.as_ref().map_or(&[][..], |answer| &answer.findings);
            if warnings.is_empty() && findings.is_empty() {
                ui.label(RichText::new("No warnings").color(theme.text_weak));
            }
            for finding in findings {
                let color = if finding.trust == Trust::NotUsable { theme.error } else { theme.warn };
                ui.horizontal_top(|ui| {
                    ui.label(RichText::new(finding.trust.mark()).color(color));
                    let text = RichText::new(finding.sentence()).color(theme.text_strong);
                    ui.add(egui::Label::new(text).wrap()).on_hover_text(&finding.evidence);
                });
            }
            for (level, text) in self.kept.iter().filter(|(level, _)| *level != NoticeLevel::Info) {
                let (mark, color) = level.look(&theme);
                ui.horizontal_top(|ui| {
                    ui.label(RichText::new(mark).color(color));
                    ui.add(egui::Label::new(RichText::new(text).color(theme.text)).wrap());
                });
            }
            ScrollArea::vertical().auto_shrink([false, true]).show(ui, |ui| {
                for warning in warnings {
                    let stamp_ns = warning.first_ns;
                    ui.horizontal_top(|ui| {
                        let time = Button::new(RichText::new(format!("{} s", seconds(stamp_ns))).monospace());
                        if ui.add(time).on_hover_text("Move the cursor to this time").clicked() {
                            ctx.commands.push(Command::Seek { stamp_ns });
                        }
                        ui.add(egui::Label::new(RichText::new(warning.text()).color(theme.text)).wrap());
                    });
                }
            });
        });
        self.list_open = open;
    }
}

/// Draws the button that dismisses a message; true if it was clicked.
fn dismiss_ui(ui: &mut Ui) -> bool {
    let close = ui.add(Button::new("x").small());
    close.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, "Dismiss notice"));
    close.clicked()
}

/// Draws a banner for each run that stopped with an error.
pub(super) fn banner_ui(ui: &mut Ui, ctx: &PanelContext<'_>) {
    let theme = ctx.theme;
    for (number, run) in ctx.recording.runs.iter().enumerate() {
        let Some(error) = &run.error else { continue };
        let frame = Frame::new().fill(super::super::theme::mix(theme.surface, theme.error, 0.18));
        let panel = Panel::top(("run error", number)).frame(frame.inner_margin(Margin::symmetric(10, 4)));
        panel.show(ui, |ui| {
            let text = format!("✖ Run {} stopped: {error}", run.spec.label);
            ui.add(egui::Label::new(RichText::new(text).color(theme.text_strong)).wrap());
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::rendering::headless::{Headless, HeadlessOptions};
    use crate::gui::theme::ThemeName;

    #[test]
    fn messages_leave_by_themselves_and_are_low_in_the_window() {
        let theme = Theme::of(ThemeName::Light);
        let options = HeadlessOptions { size_px: [800, 600], pixels_per_point: 1.0, theme: theme.name };
        // A frame per second.
        let mut headless = Headless::new(options);
        let mut notices = Notices::default();
        notices.inform("copied");
        notices.show_message(NoticeLevel::Error, "failed");
        let mut shown = Vec::new();
        for second in 0..50 {
            headless.frame(Vec::new(), |ui| notices.toasts_ui(ui, &theme)).textures.clear();
            shown.push(notices.toasts.len());
            let area = headless.context().memory(|memory| memory.area_rect(Id::unique("notices")));
            // Its size is known after the first frames.
            let low = area.is_some_and(|area| area.top() > 400.0);
            assert!(second < 3 || notices.toasts.is_empty() || low, "{area:?}");
        }
        assert_eq!((shown[3], shown[20], shown[49]), (2, 1, 0), "{shown:?}");
        assert_eq!(notices.kept.len(), 2, "the list has them still");
    }
}
