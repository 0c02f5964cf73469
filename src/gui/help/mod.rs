//! Help: the content of each panel, the manual in the window, and the definition of each shown quantity.

mod blocks_ui;
mod documents;
mod manual;
mod markdown;
pub(crate) mod terms;

use egui::{
    Button, Id, Key, Modifiers, Popup, PopupAnchor, PopupCloseBehavior, Rect, RectAlign, RichText, Ui, WidgetInfo, vec2,
};

use self::blocks_ui::spans_ui;
pub(crate) use self::manual::Manual;
use self::manual::first_paragraph;
use super::PanelName;
use super::theme::Theme;
use crate::text::Named as _;

/// Width of the popup in points.
const WIDTH: f32 = 360.0;
/// Side of the button in points.
const BUTTON: f32 = 18.0;

/// State of the help: the panel of the popup, and the manual.
#[derive(Debug, Default)]
pub(crate) struct Help {
    panel: Option<PanelName>,
    /// Panel for which a key requested the popup; its button takes the focus.
    asked: Option<PanelName>,
    pub(crate) manual: Manual,
}

fn popup_id() -> Id {
    Id::unique("what is this")
}

impl Help {
    /// Opens the popup about a panel, or closes it if it is open.
    pub(crate) fn toggle(&mut self, context: &egui::Context, panel: PanelName) {
        if self.panel == Some(panel) && Popup::is_id_open(context, popup_id()) {
            Popup::close_id(context, popup_id());
        } else {
            self.panel = Some(panel);
            Popup::open_id(context, popup_id());
        }
    }

    /// Opens or closes the popup about a panel in the next frame, and moves the focus to it.
    pub(crate) fn ask(&mut self, panel: PanelName) {
        self.asked = Some(panel);
    }

    /// Draws the popup below the upper right corner of its panel, and the manual. `places` are the rectangles of the
    /// visible panels.
    pub(crate) fn ui(&mut self, ui: &Ui, theme: &Theme, places: &[(PanelName, Rect)]) {
        let by_key = self.asked.is_some();
        if let Some(panel) = self.asked.take() {
            self.toggle(ui.ctx(), panel);
        }
        if let Some(panel) = self.panel {
            let place = places.iter().find(|(known, _)| *known == panel).map(|(_, place)| *place);
            self.popup_ui(ui, theme, panel, place.unwrap_or_else(|| ui.ctx().content_rect()), by_key);
        }
        self.manual.ui(ui, theme);
    }

    /// Draws the manual if no log is open, and handles its keys.
    pub(crate) fn welcome_ui(&mut self, ui: &Ui, theme: &Theme) {
        let (opens, closes) = ui.input_mut(|input| {
            let opens = input.consume_key(Modifiers::SHIFT, Key::F1) || input.consume_key(Modifiers::NONE, Key::F1);
            (opens, self.manual.is_open() && input.consume_key(Modifiers::NONE, Key::Escape))
        });
        if closes {
            self.manual.close();
        } else if opens {
            self.manual.show(None);
        }
        self.manual.ui(ui, theme);
    }

    fn popup_ui(&mut self, ui: &Ui, theme: &Theme, panel: PanelName, place: Rect, by_key: bool) {
        let corner = Rect::from_min_size(place.right_top() - vec2(BUTTON, 0.0), vec2(BUTTON, 1.0));
        let popup = Popup::new(popup_id(), ui.ctx().clone(), PopupAnchor::ParentRect(corner), ui.layer_id())
            .open_memory(None)
            .align(RectAlign::BOTTOM_END)
            .close_behavior(PopupCloseBehavior::CloseOnClickOutside)
            .width(WIDTH);
        let shown = popup.show(|ui| {
            ui.set_width(WIDTH);
            ui.label(RichText::new(panel.title()).size(15.0).color(theme.text_strong));
            let mut link = first_paragraph(panel.name()).and_then(|spans| spans_ui(ui, theme, spans, None));
            let button = ui.button(format!("Open manual: {}", panel.title()));
            if by_key {
                button.request_focus();
            }
            if button.clicked() {
                link = Some(format!("#{}", panel.name()));
            }
            link
        });
        let Some(shown) = shown else {
            self.panel = None;
            return;
        };
        if let Some(link) = shown.inner {
            self.manual.follow(&link);
            Popup::close_id(ui.ctx(), popup_id());
        }
    }
}

/// Draws the button that opens the popup about a panel.
pub(crate) fn button_ui(ui: &mut Ui, theme: &Theme, panel: PanelName) -> bool {
    let sign = RichText::new("?").color(theme.text_weak);
    let button = ui.add(Button::new(sign).small().min_size(vec2(BUTTON, 16.0)));
    button.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, format!("What is this? {}", panel.title())));
    button.on_hover_text("What is this? (F1: the focused panel)").clicked()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manual_has_a_paragraph_about_every_panel() {
        for panel in PanelName::all() {
            let spans = first_paragraph(panel.name());
            let text: String = spans.unwrap_or_default().iter().map(|span| span.text.as_str()).collect();
            assert!((80..=700).contains(&text.len()), "{}: {} letters: {text}", panel.title(), text.len());
        }
    }
}
