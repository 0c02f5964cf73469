//! Descriptions of painted elements for screen readers.

use egui::{Response, Role};

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
