//! List of the markers: names, times, removal.

use egui::{Button, Grid, Key, RichText, ScrollArea, TextEdit, Ui, WidgetInfo};

use super::modal::Modal;
use crate::gui::PanelContext;
use crate::gui::units::seconds;
use crate::session::{Command, Marker};

/// Maximum height of the list in points.
const LIST_HEIGHT: f32 = 300.0;

#[derive(Debug, Default)]
pub(super) struct MarkersDialog {
    /// Stamp of the marker whose name gets the keyboard focus in the next frame.
    focused_ns: Option<i64>,
    /// Name that is being edited, with the stamp of its marker.
    edited: Option<(i64, String)>,
}

impl MarkersDialog {
    /// A list in which the name of a marker has the keyboard focus.
    pub(super) fn with_focus(stamp_ns: i64) -> Self {
        Self { focused_ns: Some(stamp_ns), edited: None }
    }

    /// Draws the list. Returns true if it stays open.
    pub(super) fn ui(&mut self, ui: &Ui, ctx: &mut PanelContext<'_>) -> bool {
        let theme = *ctx.theme;
        let modal = Modal { name: "markers", title: "Markers", width: 430.0 };
        let ((), stays_open) = modal.ui(ui, &theme, |ui| {
            ui.add_space(4.0);
            if ctx.playback.markers.is_empty() {
                ui.label(RichText::new("No markers").color(theme.text_weak));
            }
            ScrollArea::vertical().max_height(LIST_HEIGHT).show(ui, |ui| {
                Grid::new("markers").num_columns(3).show(ui, |ui| {
                    let markers = ctx.playback.markers.clone();
                    for marker in markers.iter() {
                        self.marker_ui(ui, ctx, marker);
                        ui.end_row();
                    }
                });
            });
            ui.add_space(6.0);
            ui.horizontal(|ui| {
                let text = format!("Add a marker at {} s", seconds(ctx.cursor_ns));
                if ui.add_enabled(ctx.playback.markers.at(ctx.cursor_ns).is_none(), Button::new(text)).clicked() {
                    ctx.commands.push(Command::ToggleMarker);
                    self.focused_ns = Some(ctx.cursor_ns);
                }
                if ui.button("Close").clicked() {
                    ui.close();
                }
            });
        });
        // Escape discards the name that is being edited, a click outside does not.
        if !stays_open && !ui.input(|input| input.key_pressed(Key::Escape)) {
            self.rename(ctx);
        }
        stays_open
    }

    fn marker_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, marker: &Marker) {
        let stamp_ns = marker.stamp_ns;
        let time = format!("{} s", seconds(stamp_ns));
        let go = ui.add(Button::new(RichText::new(&time).monospace()));
        go.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, format!("Go to {time}")));
        if go.on_hover_text("Move the cursor to this time").clicked() {
            ctx.commands.push(Command::Seek { stamp_ns });
        }
        let mut name = match &self.edited {
            Some((edited_ns, text)) if *edited_ns == stamp_ns => text.clone(),
            _ => marker.name.clone(),
        };
        let field = ui.add(TextEdit::singleline(&mut name).hint_text("name").desired_width(230.0));
        field.widget_info(|| WidgetInfo::labeled(egui::Role::TextInput, true, format!("Name of the marker at {time}")));
        if self.focused_ns == Some(stamp_ns) {
            field.request_focus();
            self.focused_ns = None;
        }
        if field.changed() {
            self.edited = Some((stamp_ns, name));
        }
        if field.lost_focus() {
            if ui.input(|input| input.key_pressed(Key::Escape)) {
                self.edited = None;
            }
            self.rename(ctx);
        }
        let delete = ui.button("Delete");
        delete.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, format!("Delete the marker at {time}")));
        if delete.on_hover_text("Ctrl+Z restores it").clicked() {
            self.edited = None;
            ctx.commands.push(Command::SetMarkers(ctx.playback.markers.without(stamp_ns)));
        }
    }

    /// Gives the edited name to its marker.
    fn rename(&mut self, ctx: &mut PanelContext<'_>) {
        let Some((stamp_ns, name)) = self.edited.take() else { return };
        let renamed = Marker::new(stamp_ns, &name);
        if ctx.playback.markers.at(stamp_ns).is_some_and(|marker| *marker != renamed) {
            ctx.commands.push(Command::SetMarkers(ctx.playback.markers.with(renamed)));
        }
    }
}
