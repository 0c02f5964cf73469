//! The view before a log is open.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use egui::{Align, Button, Layout, RichText, ScrollArea, Sense, Stroke, StrokeKind, Ui, vec2};

use crate::gui::desktop::Desktop;
use crate::gui::path_field::PathField;
use crate::gui::theme::Theme;

/// State of the welcome view.
#[derive(Default)]
pub(super) struct Welcome {
    path_field: PathField,
    samples: Vec<PathBuf>,
    recent: Vec<PathBuf>,
}

impl Welcome {
    /// Reads the lists of sample logs and recent logs.
    pub(super) fn new(desktop: Arc<dyn Desktop>) -> Self {
        let (samples, recent) = (desktop.sample_logs(), desktop.recent_logs());
        Self { path_field: PathField::new(desktop), samples, recent }
    }

    /// Draws the view and returns the chosen log. `opening` is the log that is being opened.
    pub(super) fn ui(&mut self, ui: &mut Ui, theme: &Theme, opening: Option<&Path>) -> Option<PathBuf> {
        let mut chosen = None;
        ui.with_layout(Layout::top_down(Align::Center), |ui| {
            ui.add_space((0.08 * ui.available_height()).clamp(8.0, 80.0));
            ui.label(RichText::new("dcvins").size(30.0).color(theme.text_strong));
            let subtitle = "Debugger for visual-inertial navigation with a gimballed camera";
            ui.label(RichText::new(subtitle).size(14.0).color(theme.text_weak));
            ui.add_space(16.0);
            if let Some(path) = opening {
                ui.spinner();
                ui.label(RichText::new(format!("Opening {}", path.display())).color(theme.text));
                return;
            }
            let width = ui.available_width().min(760.0);
            ui.allocate_ui_with_layout(vec2(width, ui.available_height()), Layout::top_down(Align::Min), |ui| {
                ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                    drop_target_ui(ui, theme);
                    ui.add_space(10.0);
                    chosen = self.path_field.ui(ui, theme, false, 130.0);
                    ui.add_space(10.0);
                    let lists = [
                        ("Sample logs", &self.samples, "No sample logs installed"),
                        ("Recent logs", &self.recent, "No recent logs"),
                    ];
                    ui.columns(2, |columns| {
                        for (ui, (title, logs, none)) in columns.iter_mut().zip(lists) {
                            chosen = list_ui(ui, theme, title, logs, none).or_else(|| chosen.take());
                        }
                    });
                });
            });
        });
        chosen
    }
}

/// The area for dropping a log; it is highlighted while a file is dragged over the window.
fn drop_target_ui(ui: &mut Ui, theme: &Theme) {
    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), 76.0), Sense::hover());
    let file_over_window = ui.input(|input| !input.raw.hovered_files.is_empty());
    let color = if file_over_window { theme.accent } else { theme.outline };
    ui.painter().rect(rect, 6.0, theme.plot_background, Stroke::new(1.5, color), StrokeKind::Inside);
    let center = rect.center();
    let font = egui::FontId::proportional(14.0);
    let above = center - vec2(0.0, 10.0);
    ui.painter().text(
        above,
        egui::Align2::CENTER_CENTER,
        "Drop a flight log (.mcap) or a session (.session.json) here",
        font,
        theme.text_strong,
    );
    let below = center + vec2(0.0, 12.0);
    let font = egui::FontId::proportional(12.0);
    let text = "Rig: NAME.rig.yaml next to NAME.mcap, or attached to the log";
    ui.painter().text(below, egui::Align2::CENTER_CENTER, text, font, theme.text_weak);
}

fn list_ui(ui: &mut Ui, theme: &Theme, title: &str, logs: &[PathBuf], none: &str) -> Option<PathBuf> {
    let mut chosen = None;
    ui.label(RichText::new(title).color(theme.text_strong));
    if logs.is_empty() {
        ui.label(RichText::new(none).color(theme.text_weak));
    }
    for path in logs {
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let folder = path.parent().map_or_else(String::new, |folder| folder.display().to_string());
        let button = Button::new(RichText::new(&name).color(theme.accent)).frame(false);
        let response = ui.add(button);
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, format!("Open {name}")));
        if response.on_hover_text(path.display().to_string()).clicked() {
            chosen = Some(path.clone());
        }
        ui.add(egui::Label::new(RichText::new(folder).small().color(theme.text_weak)).truncate());
    }
    chosen
}
