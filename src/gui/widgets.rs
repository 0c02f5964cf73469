//! Widgets that several panels share: lists to choose from, texts over curves, descriptions for screen readers.

use std::sync::Arc;

use egui::{Align2, Color32, ComboBox, Galley, Painter, Pos2, Rect, Response, RichText, Role, Ui, Vec2, WidgetText};

/// Sets `value` as the accessible content of a painted element without text.
///
/// Sets both value and description: Linux desktops read only the description of an image.
pub(crate) fn describe(response: &Response, value: &str) {
    if value.is_empty() {
        return;
    }
    response.ctx.accesskit_node_builder(response.id, |node| {
        // The value of a label is its text.
        if node.role() != Role::Label {
            node.set_value(value);
        }
        node.set_description(value);
    });
}

/// Shows the reason why a panel has no content.
pub(crate) fn empty_ui(ui: &mut Ui, why: &str) {
    ui.centered_and_justified(|ui| ui.label(RichText::new(why).weak()));
}

/// Draws a name and a list of choices that is `width` points wide; `text` is the shown text of a value.
pub(crate) fn choice_ui<T: PartialEq>(
    ui: &mut Ui,
    name: impl Into<WidgetText>,
    width: f32,
    value: &mut T,
    choices: impl IntoIterator<Item = T>,
    text: impl Fn(&T) -> String,
) -> Response {
    hinted_choice_ui(ui, name, width, value, choices, text, |_| "")
}

/// As [`choice_ui`], with a hint for each choice; an empty one is not shown.
pub(crate) fn hinted_choice_ui<'a, T: PartialEq>(
    ui: &mut Ui,
    name: impl Into<WidgetText>,
    width: f32,
    value: &mut T,
    choices: impl IntoIterator<Item = T>,
    text: impl Fn(&T) -> String,
    hint: impl Fn(&T) -> &'a str,
) -> Response {
    let name = name.into();
    let combo = ComboBox::from_id_salt(name.text()).width(width).truncate().selected_text(text(value));
    let label = ui.label(name);
    let shown = combo.show_ui(ui, |ui| {
        for choice in choices {
            let (text, hint) = (text(&choice), hint(&choice));
            let entry = ui.selectable_value(value, choice, text);
            if !hint.is_empty() {
                entry.on_hover_text(hint);
            }
        }
    });
    shown.response.labelled_by(label.id)
}

/// Draws a text on a plate that makes it legible over curves and images; returns the rectangle of the text.
pub(crate) fn plated_text(
    painter: &Painter,
    at: Pos2,
    align: Align2,
    (galley, color): (Arc<Galley>, Color32),
    (plate, margin): (Color32, Vec2),
) -> Rect {
    let rect = align.anchor_size(at, galley.size());
    painter.rect_filled(rect.expand2(margin), 2.0, plate);
    painter.galley(rect.min, galley, color);
    rect
}
