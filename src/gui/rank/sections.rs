//! Sections and facts of the panel.

use egui::text::{LayoutJob, TextFormat};
use egui::{RichText, Role, TextStyle, Ui, WidgetInfo};

use crate::geometry::seconds_from_ns;
use crate::gui::theme::Theme;
use crate::gui::units::fixed;
use crate::gui::{PanelContext, Presentation};
use crate::session::Command;

/// Height in points of the panel from which counts of verdicts and causes of uninformed directions have a line; in a
/// lower one the heat map needs the room.
pub(super) const MIN_HEIGHT_WITH_CAUSE: f32 = 320.0;

/// Size of a headline in points.
const HEADLINE: f32 = 13.0;

/// A symbol, a label and a headline, wrapped.
pub(super) fn headline_ui(
    ui: &mut Ui,
    theme: &Theme,
    (mark, color): (&str, egui::Color32),
    label: &str,
    headline: &str,
    meaning: &str,
) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 5.0;
        ui.label(RichText::new(mark).color(color).size(HEADLINE));
        let font = egui::FontId::proportional(HEADLINE);
        let mut job = LayoutJob::default();
        job.append(&format!("{label} "), 0.0, TextFormat::simple(font.clone(), theme.text_weak));
        job.append(headline, 0.0, TextFormat::simple(font, theme.text_strong));
        ui.add(egui::Label::new(job).wrap()).on_hover_text(meaning);
    });
}

/// A name and what it is, wrapped.
pub(super) fn fact_ui(ui: &mut Ui, theme: &Theme, name: &str, text: &str, color: egui::Color32) -> egui::Response {
    let font = TextStyle::Body.resolve(ui.style());
    let mut job = LayoutJob::default();
    job.append(name, 0.0, TextFormat::simple(font.clone(), theme.text_weak));
    job.append(text, 0.0, TextFormat::simple(font, color));
    ui.add(egui::Label::new(job).wrap())
}

/// A name, a fact and the time since which it holds, wrapped; a click moves the cursor to that time. Returns true if it
/// was clicked.
pub(super) fn fact_at_ui(
    ui: &mut Ui,
    ctx: &mut PanelContext<'_>,
    name: &str,
    text: &str,
    since_ns: Option<i64>,
    meaning: &str,
) -> bool {
    let Some(stamp_ns) = since_ns else {
        fact_ui(ui, ctx.theme, name, text, ctx.theme.text_strong).on_hover_text(meaning);
        return false;
    };
    let time = format!("{} s", fixed(seconds_from_ns(stamp_ns), 2));
    let font = TextStyle::Body.resolve(ui.style());
    let mut job = LayoutJob::default();
    job.append(name, 0.0, TextFormat::simple(font.clone(), ctx.theme.text_weak));
    job.append(&format!("{text} since "), 0.0, TextFormat::simple(font.clone(), ctx.theme.text_strong));
    let figure = ctx.presentation.is_figure();
    job.append(&time, 0.0, TextFormat::simple(font, if figure { ctx.theme.text_strong } else { ctx.theme.accent }));
    let (sense, _) = ctx.presentation.clickable(Role::Label);
    let response = ui.add(egui::Label::new(job).wrap().sense(sense));
    let role = if figure { Role::Label } else { Role::Link };
    response.widget_info(|| WidgetInfo::labeled(role, true, format!("{name}{text} since {time}")));
    let clicked = response.clicked();
    if clicked {
        ctx.commands.push(Command::Seek { stamp_ns });
    }
    response.on_hover_text(format!("{meaning}\nClick: move the cursor to {time}"));
    clicked
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
