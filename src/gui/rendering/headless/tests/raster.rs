use egui::Ui;

use super::super::{HeadlessOptions, draw};
use crate::gui::tests::keep_screenshot;
use crate::gui::theme::{Theme, ThemeName};
use crate::text::Named as _;

fn options(theme: ThemeName, scale: f32) -> HeadlessOptions {
    HeadlessOptions { size_px: [(200.0 * scale) as u32, (60.0 * scale) as u32], pixels_per_point: scale, theme }
}

fn text_ui(ui: &mut Ui) {
    ui.label("ρ = 0.25 px, χ² 1.2, ±3σ");
    ui.label("⏵ Play");
}

#[test]
fn screenshots_are_repeatable_opaque_and_show_text() {
    for theme in [ThemeName::Dark, ThemeName::Light, ThemeName::Print] {
        for scale in [1.0, 1.5, 2.0] {
            let options = options(theme, scale);
            let image = draw(options, text_ui);
            keep_screenshot(&format!("text-{}-{scale}", theme.name()), &image);
            assert_eq!([image.width(), image.height()], options.size_px);
            assert!(image == draw(options, text_ui), "two screenshots differ");
            assert!(image.pixels().all(|pixel| pixel.0[3] == 255));
            let ground = Theme::of(theme).background.to_array();
            let inked = image.pixels().filter(|pixel| pixel.0 != ground).count();
            assert!(inked > 400, "{inked} pixels of ink");
        }
    }
}
