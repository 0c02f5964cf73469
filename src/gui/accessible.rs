//! What a screen reader says about painted elements.

use egui::{Response, Role};

/// Gives an element that is painted, and not made of texts, its content as text.
///
/// The content is both value and description: Linux desktops read only the description of an image.
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
