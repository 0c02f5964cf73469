//! Messages for the user: toasts, a banner for stopped runs, a list of all warnings.

use egui::{Align2, Area, Button, Frame, Id, Margin, Order, Panel, RichText, ScrollArea, Ui, vec2};

use crate::gui::PanelContext;
use crate::gui::theme::{Theme, dialog_frame};
use crate::gui::units::seconds;
use crate::session::Command;
use crate::session::warning_lines;

/// Severity of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoticeLevel {
    Info,
    /// A problem that does not stop the operation.
    Warning,
    /// A failed operation; the message stays until it is dismissed.
    Error,
}

/// Seconds for which a message below error level is shown.
const SHOWN_S: f64 = 8.0;

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
    /// True if the list of warnings is open.
    pub list_open: bool,
}

impl Notices {
    pub fn show_message(&mut self, level: NoticeLevel, text: impl Into<String>) {
        let text = text.into();
        if !self.toasts.iter().any(|toast| toast.text == text) {
            self.toasts.push(Toast { level, text, since_s: None });
        }
    }

    /// Draws the messages in the corner.
    pub(crate) fn toasts_ui(&mut self, ui: &Ui, theme: &Theme) {
        let now_s = ui.input(|input| input.time);
        for toast in &mut self.toasts {
            toast.since_s.get_or_insert(now_s);
        }
        self.toasts.retain(|toast| {
            toast.level == NoticeLevel::Error || toast.since_s.is_none_or(|since_s| now_s - since_s < SHOWN_S)
        });
        if self.toasts.is_empty() {
            return;
        }
        let mut dismissed = None;
        let area =
            Area::new(Id::unique("notices")).order(Order::Foreground).anchor(Align2::RIGHT_TOP, vec2(-12.0, 40.0));
        area.show(ui.ctx(), |ui| {
            for (number, toast) in self.toasts.iter().enumerate() {
                let (mark, color) = match toast.level {
                    NoticeLevel::Info => ("ℹ", theme.accent),
                    NoticeLevel::Warning => ("⚠", theme.warn),
                    NoticeLevel::Error => ("✖", theme.error),
                };
                dialog_frame(theme).inner_margin(8).show(ui, |ui| {
                    ui.set_max_width(420.0);
                    ui.horizontal_top(|ui| {
                        ui.label(RichText::new(mark).color(color));
                        ui.add(egui::Label::new(RichText::new(&toast.text).color(theme.text_strong)).wrap());
                        let close = ui.add(Button::new("x").small());
                        close.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, "Dismiss notice"));
                        if close.clicked() {
                            dismissed = Some(number);
                        }
                    });
                });
            }
        });
        if let Some(number) = dismissed {
            self.toasts.remove(number);
        }
        if self.toasts.iter().any(|toast| toast.level != NoticeLevel::Error) {
            ui.ctx().request_repaint_after(std::time::Duration::from_secs(1));
        }
    }

    /// Draws the list of warnings about the log and its runs; a click on a stamp moves the cursor there.
    pub(crate) fn list_ui(&mut self, ui: &Ui, ctx: &mut PanelContext<'_>) {
        let theme = *ctx.theme;
        let mut open = self.list_open;
        let window = egui::Window::new("Warnings").open(&mut open).collapsible(false).default_size(vec2(520.0, 260.0));
        window.anchor(Align2::RIGHT_BOTTOM, vec2(-16.0, -40.0)).show(ui.ctx(), |ui| {
            let warnings = warning_lines(ctx.recording);
            if warnings.is_empty() {
                ui.label(RichText::new("No warnings").color(theme.text_weak));
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
