//! The view before a log is open.

use std::path::PathBuf;
use std::sync::Arc;

use egui::{Align, Button, Layout, RichText, ScrollArea, Sense, Stroke, StrokeKind, Ui, vec2};

use super::repaint::POLL_PERIOD;
use super::sample::SampleFlight;
use crate::gui::desktop::Desktop;
use crate::gui::theme::Theme;
use crate::gui::window::path_field::PathField;

/// Maximum width of the content in points.
const WIDTH: f32 = 760.0;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Choice {
    Open(PathBuf),
    /// Open a log and take the tour over it.
    Tour(PathBuf),
    Manual,
    Tutorial,
}

pub(super) struct Welcome {
    desktop: Arc<dyn Desktop>,
    path_field: PathField,
    samples: Vec<PathBuf>,
    recent: Vec<PathBuf>,
    flight: SampleFlight,
    /// True if the tour starts when the sample flight is simulated.
    tour: bool,
}

impl Welcome {
    /// Reads the lists of sample logs and recent logs.
    pub(super) fn new(desktop: Arc<dyn Desktop>) -> Self {
        let (samples, recent) = (desktop.sample_logs(), desktop.recent_logs());
        let path_field = PathField::new(Arc::clone(&desktop));
        Self { desktop, path_field, samples, recent, flight: SampleFlight::default(), tour: false }
    }

    /// Stops a simulation; used when another log is shown.
    pub(super) fn stop(&mut self) {
        self.flight = SampleFlight::default();
    }

    /// Path of the sample log; without one, starts its simulation.
    pub(super) fn sample(&mut self, tour: bool) -> Option<Choice> {
        self.tour = tour;
        if let Some(path) = self.samples.first() {
            return Some(chosen_sample(path.clone(), tour));
        }
        self.flight.start(&self.desktop);
        None
    }

    /// Draws the view and returns the choice. `opening` draws the progress of a log that is being opened.
    pub(super) fn ui(
        &mut self,
        ui: &mut Ui,
        theme: &Theme,
        opening: Option<&mut dyn FnMut(&mut Ui)>,
    ) -> Option<Choice> {
        let mut chosen = self.flight.receive().map(|path| chosen_sample(path, self.tour));
        if self.flight.is_running() {
            ui.ctx().request_repaint_after(POLL_PERIOD);
        }
        ui.with_layout(Layout::top_down(Align::Center), |ui| {
            ui.add_space((0.04 * ui.available_height()).clamp(4.0, 60.0));
            ui.label(RichText::new("dcvins").size(30.0).color(theme.text_strong));
            let subtitle = "Debugger for visual-inertial navigation with a gimballed camera";
            ui.label(RichText::new(subtitle).size(14.0).color(theme.text_weak));
            ui.add_space(12.0);
            if let Some(opening) = opening {
                opening(ui);
                return;
            }
            let width = ui.available_width().min(WIDTH);
            ui.allocate_ui_with_layout(vec2(width, ui.available_height()), Layout::top_down(Align::Min), |ui| {
                ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                    let first = self.first_steps_ui(ui, theme);
                    ui.add_space(10.0);
                    drop_target_ui(ui, theme);
                    ui.add_space(10.0);
                    let typed = self.path_field.ui(ui, theme, false, 130.0).map(Choice::Open);
                    ui.add_space(10.0);
                    let lists = [
                        ("Recent logs", &self.recent, "No recent logs"),
                        ("Sample logs", &self.samples, "None yet: the buttons above simulate one"),
                    ];
                    let mut listed = None;
                    ui.columns(2, |columns| {
                        for (ui, (title, logs, none)) in columns.iter_mut().zip(lists) {
                            listed = list_ui(ui, theme, title, logs, none).map(Choice::Open).or_else(|| listed.take());
                        }
                    });
                    chosen = chosen.take().or(first).or(typed).or(listed);
                });
            });
        });
        chosen
    }

    /// Draws buttons for the tour, the sample flight and the documents.
    fn first_steps_ui(&mut self, ui: &mut Ui, theme: &Theme) -> Option<Choice> {
        let mut chosen = None;
        let running = self.flight.is_running();
        ui.horizontal_wrapped(|ui| {
            // Four buttons to the right edge, or as many as fit in a row.
            let gaps = 3.0 * ui.spacing().item_spacing.x;
            let width = (0.25 * (ui.available_width() - gaps)).floor().max(160.0);
            let big = |text: &str| Button::new(RichText::new(text).size(14.0)).min_size(vec2(width, 30.0));
            let tour = big("Take the tour").fill(theme.accent.gamma_multiply(0.35));
            let hover = "Six steps over the sample flight: which parameter is unobservable, since when, why, and \
                         which motion fixes it";
            if ui.add_enabled(!running, tour).on_hover_text(hover).clicked() {
                chosen = self.sample(true);
            }
            if ui.add_enabled(!running, big("Open the sample flight")).clicked() {
                chosen = self.sample(false);
            }
            if ui.add(big("Manual")).on_hover_text("Shift+F1").clicked() {
                chosen = Some(Choice::Manual);
            }
            if ui
                .add(big("Tutorial"))
                .on_hover_text("The sample flight in the window and on the command line")
                .clicked()
            {
                chosen = Some(Choice::Tutorial);
            }
        });
        ui.add_space(2.0);
        self.flight.ui(ui, theme);
        if !self.flight.is_running() && self.samples.is_empty() {
            let text = format!(
                "The sample flight is simulated on this machine once, in about 15 s: 8.5 s of a drone around a house, \
                 24 MB in {}",
                self.desktop.sample_folder().display()
            );
            ui.add(egui::Label::new(RichText::new(text).color(theme.text_weak)).wrap());
        }
        chosen
    }
}

fn chosen_sample(path: PathBuf, tour: bool) -> Choice {
    if tour { Choice::Tour(path) } else { Choice::Open(path) }
}

/// Draws the drop area for a log; it is highlighted while a file is dragged over the window.
fn drop_target_ui(ui: &mut Ui, theme: &Theme) {
    let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), 92.0), Sense::hover());
    let file_over_window = ui.input(|input| !input.raw.hovered_files.is_empty());
    let color = if file_over_window { theme.accent } else { theme.outline };
    ui.painter().rect(rect, 6.0, theme.plot_background, Stroke::new(1.5, color), StrokeKind::Inside);
    let lines = [
        ("Drop a flight log (.mcap), a recording, or a saved session (.session.json) here", 14.0, theme.text_strong),
        (
            "Recordings: ROS 1 and ROS 2 bags, EuRoC folders, MP4 videos together with their .ulg, .bin or .tlog",
            12.0,
            theme.text_weak,
        ),
        ("Rig: dropped with the log, next to it (NAME.rig.yaml), attached, or described here", 12.0, theme.text_weak),
    ];
    let spoken = lines.map(|(text, ..)| text).join(". ");
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Label, true, &spoken));
    for (line, (text, size, color)) in lines.into_iter().enumerate() {
        let at = rect.center_top() + vec2(0.0, 22.0 + 24.0 * line as f32);
        let galley = ui.painter().layout(text.to_owned(), egui::FontId::proportional(size), color, rect.width() - 16.0);
        ui.painter().galley(at - 0.5 * galley.size(), galley, color);
    }
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
