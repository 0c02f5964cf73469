//! Sections and facts of the panel.

use egui::text::{LayoutJob, TextFormat};
use egui::{RichText, TextStyle, Ui};

use crate::gui::Presentation;
use crate::gui::theme::Theme;

/// A name and what it is, wrapped.
pub(super) fn fact_ui(ui: &mut Ui, theme: &Theme, name: &str, text: &str, color: egui::Color32) -> egui::Response {
    let font = TextStyle::Body.resolve(ui.style());
    let mut job = LayoutJob::default();
    job.append(name, 0.0, TextFormat::simple(font.clone(), theme.text_weak));
    job.append(text, 0.0, TextFormat::simple(font, color));
    ui.add(egui::Label::new(job).wrap())
}

/// A section with a heading, open at first where `height` points are left above the fold.
///
/// A figure has the sections that fit, and no headings to click.
pub(super) fn section_ui(
    ui: &mut Ui,
    theme: &Theme,
    presentation: Presentation,
    title: &str,
    height: f32,
    contents: impl FnOnce(&mut Ui),
) {
    const HEADING: f32 = 24.0;
    let room = ui.clip_rect().bottom() - ui.cursor().top();
    let heading = RichText::new(title).color(theme.text);
    if presentation.is_figure() {
        if room >= height + HEADING {
            ui.label(heading);
            contents(ui);
        }
        return;
    }
    let header = egui::CollapsingHeader::new(heading).id_salt(title).default_open(room >= height + HEADING);
    header.show_unindented(ui, contents);
}
