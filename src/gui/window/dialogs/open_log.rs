//! The dialog that opens a log or a saved session.

use std::path::PathBuf;
use std::sync::Arc;

use egui::{RichText, Ui};

use super::modal::Modal;
use crate::gui::desktop::Desktop;
use crate::gui::path_field::PathField;
use crate::gui::theme::Theme;

/// State of the dialog.
#[derive(Default)]
pub(super) struct OpenLogDialog {
    path_field: PathField,
}

impl OpenLogDialog {
    /// A dialog that completes paths.
    pub(super) fn new(desktop: Arc<dyn Desktop>) -> Self {
        Self { path_field: PathField::new(desktop) }
    }

    /// Draws it; returns the path that was chosen, and whether the dialog stays open.
    pub(super) fn ui(&mut self, ui: &Ui, theme: &Theme) -> (Option<PathBuf>, bool) {
        let modal = Modal { name: "open log", title: "Open a flight log or a saved session", width: 560.0 };
        modal.ui(ui, theme, |ui| {
            ui.label(RichText::new("Either can also be dropped onto the window").color(theme.text_weak));
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
