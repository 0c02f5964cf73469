//! Dialog that opens a log or a saved session: a path field, and the desktop's file dialog where it exists.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;

use egui::{Label, RichText, Ui};

use super::modal::Modal;
use crate::gui::desktop::Desktop;
use crate::gui::theme::Theme;
use crate::gui::window::path_field::PathField;

/// Period at which the desktop's file dialog is polled.
const POLL_PERIOD: Duration = Duration::from_millis(100);
/// A file dialog that ends without a choice within this many seconds was not shown.
const MIN_CANCEL_S: f64 = 0.5;

#[derive(Default)]
pub(super) struct OpenLogDialog {
    desktop: Option<Arc<dyn Desktop>>,
    path_field: PathField,
    picker: Option<FilePicker>,
}

struct FilePicker {
    /// Chosen files; none if the dialog was cancelled.
    answer: Receiver<Vec<PathBuf>>,
    /// Time in seconds of the first frame in which it was polled.
    since_s: Option<f64>,
}

/// The result of the desktop's file dialog.
pub(super) enum Picked {
    Paths(Vec<PathBuf>),
    Cancelled,
}

impl OpenLogDialog {
    /// A dialog that completes paths.
    pub(super) fn new(desktop: Arc<dyn Desktop>) -> Self {
        Self { path_field: PathField::new(Arc::clone(&desktop)), desktop: Some(desktop), picker: None }
    }

    /// Opens the desktop's file dialog unless it is open.
    pub(super) fn show_picker(&mut self) {
        if self.picker.is_none() {
            let answer = self.desktop.as_ref().and_then(|desktop| desktop.pick_log());
            self.picker = answer.map(|answer| FilePicker { answer, since_s: None });
        }
    }

    /// Result of the desktop's file dialog, returned once; `None` also if the dialog could not be shown and the path
    /// field has to be used.
    pub(super) fn picked(&mut self, ui: &Ui) -> Option<Picked> {
        let picker = self.picker.as_mut()?;
        let now_s = ui.input(|input| input.time);
        let since_s = *picker.since_s.get_or_insert(now_s);
        let paths = match picker.answer.try_recv() {
            Err(TryRecvError::Empty) => {
                ui.ctx().request_repaint_after(POLL_PERIOD);
                return None;
            }
            Ok(paths) => paths,
            Err(TryRecvError::Disconnected) => Vec::new(),
        };
        self.picker = None;
        if !paths.is_empty() {
            return Some(Picked::Paths(paths));
        }
        let unseen = now_s - since_s < MIN_CANCEL_S || !self.path_field.is_empty();
        (!unseen).then_some(Picked::Cancelled)
    }

    /// Draws the dialog. Returns the chosen path, and true if the dialog stays open.
    pub(super) fn ui(&mut self, ui: &Ui, theme: &Theme) -> (Option<PathBuf>, bool) {
        let modal = Modal { name: "open log", title: "Open flight log, recording or session", width: 560.0 };
        modal.ui(ui, theme, |ui| {
            let hint = "MCAP, ROS bags, EuRoC folders, MP4, ULog, DataFlash, telemetry logs. Files can also be dropped onto the \
                        window, a video together with the log of its autopilot";
            ui.add(Label::new(RichText::new(hint).color(theme.text_weak)).wrap());
            ui.add_space(4.0);
            let chosen = self.path_field.ui(ui, theme, true, 300.0);
            ui.add_space(4.0);
            if ui.button("Cancel").clicked() || chosen.is_some() {
                ui.close();
            }
            chosen
        })
    }
}
