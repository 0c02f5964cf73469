//! The documents in a separate window.

use egui::{Align, Button, Key, Modifiers, RichText, ScrollArea, Ui, WidgetInfo, vec2};

use super::blocks_ui::block_ui;
use super::documents::{DocumentId, LinkTarget};
use super::markdown::{MarkdownBlock, StyledText};
use crate::gui::theme::Theme;
use crate::gui::widgets::choice_ui;

/// Frames in which the section is scrolled into view: the first ones lay out the window and the scroll area.
const FRAMES_TO_SECTION: u8 = 3;

#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Place {
    document: DocumentId,
    /// `None` for the start of the document.
    anchor: Option<String>,
}

/// State of the manual: open or closed, the section, and the previously shown sections.
#[derive(Debug, Default)]
pub(crate) struct Manual {
    open: bool,
    place: Place,
    earlier: Vec<Place>,
    /// Remaining frames in which the section is scrolled into view.
    frames_to_section: u8,
    /// Web address that cannot be opened from here.
    web: Option<String>,
}

impl Manual {
    /// Opens a section of the manual; without an anchor its start.
    pub(crate) fn show(&mut self, anchor: Option<&str>) {
        let place = Place { document: DocumentId::default(), anchor: anchor.map(str::to_owned) };
        self.go(place);
    }

    pub(crate) fn show_tutorial(&mut self) {
        self.go(Place { document: DocumentId::TUTORIAL, anchor: None });
    }

    /// Opens the target of a link in the manual.
    pub(crate) fn follow(&mut self, link: &str) {
        self.follow_from(DocumentId::default(), link);
    }

    fn follow_from(&mut self, document: DocumentId, link: &str) {
        match document.follow(link) {
            Some(LinkTarget::Section(document, anchor)) => self.go(Place { document, anchor }),
            Some(LinkTarget::Web(address)) => self.web = Some(address),
            None => {}
        }
    }

    pub(crate) fn is_open(&self) -> bool {
        self.open
    }

    /// Closes the manual; the section is kept.
    pub(crate) fn close(&mut self) {
        self.open = false;
    }

    fn go(&mut self, place: Place) {
        if self.open && self.place != place {
            self.earlier.push(std::mem::replace(&mut self.place, place));
        } else {
            self.place = place;
        }
        (self.open, self.frames_to_section, self.web) = (true, FRAMES_TO_SECTION, None);
    }

    /// Draws the manual while it is open.
    pub(crate) fn ui(&mut self, ui: &Ui, theme: &Theme) {
        if !self.open {
            return;
        }
        let room = ui.ctx().content_rect();
        let size = vec2((0.45 * room.width()).clamp(420.0, 760.0), 0.8 * room.height());
        let at = room.right_top() + vec2(-size.x - 24.0, 44.0);
        let mut open = true;
        let window = egui::Window::new("Manual").open(&mut open).collapsible(false);
        let window = window.default_size(size.min(room.size() - vec2(24.0, 60.0))).default_pos(at);
        window.show(ui.ctx(), |ui| {
            self.bar_ui(ui, theme);
            ui.separator();
            self.document_ui(ui, theme);
        });
        self.open = open;
        if self.frames_to_section > 0 {
            self.frames_to_section -= 1;
            ui.ctx().request_repaint();
        }
    }

    /// Draws the buttons above the document.
    fn bar_ui(&mut self, ui: &mut Ui, theme: &Theme) {
        ui.horizontal(|ui| {
            let back = ui.add_enabled(!self.earlier.is_empty(), Button::new("◀ Back"));
            back.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, "Back to the section before"));
            if back.on_hover_text("Back to the section before").clicked()
                && let Some(place) = self.earlier.pop()
            {
                (self.place, self.frames_to_section) = (place, FRAMES_TO_SECTION);
            }
            let name = RichText::new("Document").color(theme.text_weak);
            let mut document = self.place.document;
            choice_ui(ui, name, 240.0, &mut document, DocumentId::all(), |document| document.title());
            if document != self.place.document {
                self.go(Place { document, anchor: None });
            }
        });
        if let Some(address) = &self.web {
            ui.horizontal_wrapped(|ui| {
                ui.label(RichText::new(format!("Open in a browser: {address}")).color(theme.text_strong));
                if ui.small_button("Copy").clicked() {
                    ui.ctx().copy_text(address.clone());
                }
            });
        }
    }

    fn document_ui(&mut self, ui: &mut Ui, theme: &Theme) {
        let document = self.place.document;
        let page = page_of(ui);
        let mut clicked = None;
        let area = ScrollArea::vertical().id_salt(document.title()).auto_shrink(false);
        area.show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 6.0;
            if page != 0.0 {
                ui.scroll_with_delta(vec2(0.0, -page * ui.clip_rect().height()));
            }
            for (number, block) in document.blocks().iter().enumerate() {
                let drawn = ui.push_id(number, |ui| block_ui(ui, theme, block));
                clicked = drawn.inner.or_else(|| clicked.take());
                let first = number == 0 && self.place.anchor.is_none();
                if self.frames_to_section > 0 && (first || is_section(block, self.place.anchor.as_deref())) {
                    let animation = egui::style::ScrollAnimation::none();
                    drawn.response.scroll_to_me_animation(Some(Align::TOP), animation);
                }
            }
            // Lets the last section scroll to the top, too.
            ui.add_space(0.7 * ui.clip_rect().height());
        });
        if let Some(link) = clicked {
            self.follow_from(document, &link);
        }
    }
}

/// Number of pages by which the Page keys scroll in this frame.
fn page_of(ui: &Ui) -> f32 {
    if ui.ctx().egui_wants_keyboard_input() {
        return 0.0;
    }
    ui.input_mut(|input| {
        let down = input.consume_key(Modifiers::NONE, Key::PageDown);
        let up = input.consume_key(Modifiers::NONE, Key::PageUp);
        0.9 * (f32::from(u8::from(down)) - f32::from(u8::from(up)))
    })
}

fn is_section(block: &MarkdownBlock, wanted: Option<&str>) -> bool {
    matches!((block, wanted), (MarkdownBlock::Heading { anchor, .. }, Some(wanted)) if anchor == wanted)
}

/// The first paragraph of a section of the manual.
pub(super) fn first_paragraph(section: &str) -> Option<&'static [StyledText]> {
    let blocks = DocumentId::default().blocks();
    let heading = blocks.iter().position(|block| is_section(block, Some(section)))?;
    let MarkdownBlock::Paragraph { spans, .. } = blocks.get(heading + 1)? else { return None };
    Some(spans)
}

#[cfg(test)]
mod tests {
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable as _;

    use super::*;
    use crate::gui::theme::ThemeName;

    #[test]
    fn links_lead_to_sections_and_back() {
        let mut manual = Manual::default();
        manual.show(Some("rank"));
        let mut harness = Harness::builder()
            .with_size([1000.0, 700.0])
            .with_max_steps(20)
            .build_ui_state(|ui, manual: &mut Manual| manual.ui(ui, &Theme::of(ThemeName::Dark)), manual);
        harness.run_steps(6);
        let rect = harness.get_all_by_label("Rank").next().unwrap().rect();
        assert!(rect.top() > 60.0 && rect.top() < 300.0, "the section is at the top: {rect}");
        harness.get_by_label("ranks").click();
        harness.run_steps(6);
        assert_eq!(harness.state().place.anchor.as_deref(), Some("ranks"));
        harness.get_by_label("Back to the section before").click();
        harness.run_steps(6);
        assert_eq!(harness.state().place.anchor.as_deref(), Some("rank"));
        assert!(harness.state().is_open() && harness.state().earlier.is_empty());
    }
}
