//! Conversion of a theme to egui's style: visuals, fonts, spacing, frames.

use std::collections::BTreeMap;

use egui::style::ScrollStyle;
use egui::{Color32, CornerRadius, FontDefinitions, FontFamily, FontId, Frame, Shadow, Stroke, TextStyle, vec2};

use super::{CORNER_RADIUS, SMALLEST_TEXT, Theme, mix};

impl Theme {
    /// Applies the theme to egui: colours, fonts, spacing.
    pub fn apply(&self, ctx: &egui::Context) {
        let base = if self.is_dark() { egui::Theme::Dark } else { egui::Theme::Light };
        let style = std::sync::Arc::new(self.style(base));
        ctx.set_fonts(fonts());
        // The theme is the user's choice, not the desktop's: both of egui's slots get it.
        ctx.set_style_of(egui::Theme::Dark, style.clone());
        ctx.set_style_of(egui::Theme::Light, style);
        ctx.set_theme(base);
    }

    fn style(&self, base: egui::Theme) -> egui::Style {
        let mut style = base.default_style();
        style.text_styles = text_styles();
        style.spacing.item_spacing = vec2(6.0, 4.0);
        style.spacing.button_padding = vec2(6.0, 2.0);
        style.spacing.interact_size = vec2(28.0, 20.0);
        style.spacing.indent = 12.0;
        // Bars are visible without the pointer: they are the only sign of what is below the edge.
        style.spacing.scroll = ScrollStyle::thin();
        style.interaction.selectable_labels = false;
        style.interaction.tooltip_delay = 0.3;
        style.animation_time = 0.08;

        let visuals = &mut style.visuals;
        visuals.panel_fill = self.surface;
        visuals.window_fill = self.surface;
        visuals.window_stroke = Stroke::new(1.0, self.outline);
        visuals.extreme_bg_color = self.plot_background;
        visuals.faint_bg_color = self.surface_raised.gamma_multiply(0.5);
        visuals.code_bg_color = self.surface_raised;
        visuals.weak_text_color = Some(self.text_weak);
        visuals.hyperlink_color = self.accent;
        visuals.warn_fg_color = self.warn;
        visuals.error_fg_color = self.error;
        visuals.selection.bg_fill = mix(self.surface, self.accent, 0.45);
        visuals.selection.stroke = Stroke::new(1.0, self.text_strong);
        visuals.window_shadow.color = Color32::from_black_alpha(if self.is_dark() { 110 } else { 40 });
        visuals.popup_shadow.color = visuals.window_shadow.color;

        let radius = CornerRadius::same(CORNER_RADIUS);
        visuals.window_corner_radius = radius;
        visuals.menu_corner_radius = radius;
        let widgets = &mut visuals.widgets;
        for (widget, ground, text) in [
            (&mut widgets.noninteractive, self.surface, self.text),
            (&mut widgets.inactive, self.surface_raised, self.text),
            (&mut widgets.hovered, mix(self.surface_raised, self.accent, 0.25), self.text_strong),
            (&mut widgets.active, mix(self.surface_raised, self.accent, 0.45), self.text_strong),
            (&mut widgets.open, self.surface_raised, self.text_strong),
        ] {
            widget.bg_fill = ground;
            widget.weak_bg_fill = ground;
            widget.fg_stroke = Stroke::new(1.0, text);
            widget.corner_radius = radius;
            widget.expansion = 0.0;
        }
        widgets.noninteractive.bg_stroke = Stroke::new(1.0, self.outline);
        widgets.hovered.bg_stroke = Stroke::new(1.0, self.accent);
        widgets.active.bg_stroke = Stroke::new(1.0, self.accent);
        style
    }
}

/// The fonts of egui; the proportional family falls back to the monospace font, the only one with arrows.
pub(crate) fn fonts() -> FontDefinitions {
    let mut fonts = FontDefinitions::default();
    let monospace = fonts.families.get(&FontFamily::Monospace).and_then(|names| names.first()).cloned();
    fonts.families.entry(FontFamily::Proportional).or_default().extend(monospace);
    fonts
}

fn text_styles() -> BTreeMap<TextStyle, FontId> {
    use FontFamily::{Monospace, Proportional};
    [
        (TextStyle::Small, FontId::new(SMALLEST_TEXT, Proportional)),
        (TextStyle::Body, FontId::new(12.5, Proportional)),
        (TextStyle::Button, FontId::new(12.5, Proportional)),
        (TextStyle::Heading, FontId::new(15.0, Proportional)),
        (TextStyle::Monospace, FontId::new(11.5, Monospace)),
    ]
    .into_iter()
    .collect()
}

/// Font of numbers in plots and tables.
pub fn number_font() -> FontId {
    FontId::new(SMALLEST_TEXT, FontFamily::Monospace)
}

/// Font of small labels in plots.
pub fn label_font() -> FontId {
    FontId::new(SMALLEST_TEXT, FontFamily::Proportional)
}

/// Frame of dialogs, notices and menus.
pub(crate) fn dialog_frame(theme: &Theme) -> Frame {
    Frame::new()
        .fill(theme.surface)
        .stroke(Stroke::new(1.0, theme.outline))
        .corner_radius(CORNER_RADIUS)
        .inner_margin(12)
        .shadow(Shadow { offset: [0, 6], blur: 18, spread: 0, color: Color32::from_black_alpha(90) })
}
